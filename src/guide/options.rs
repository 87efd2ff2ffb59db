//! Guides by name: `NAME` or `NAME:KEY=VALUE,KEY=VALUE`, as users write them.

use std::path::PathBuf;
use std::sync::Arc;

use serde::de::DeserializeOwned;
use toml::Table;

use super::from_file::{FileMap, FileSigma};
use super::fused::{Fused, MOST_GUIDES};
use super::{
    BehaviouralStereo, Guide, IntensityStereo, Kalman, MatchedStereo, Monocular, NoisyTruth, Radar,
};
use super::{intensity, kalman, monocular, noisy_truth, radar, rendered};
use crate::files::InputError;
use crate::settings::{Document, Key, Range};

/// A guide from settings that are held to its keys.
type Make = fn(&Document, &[Key]) -> Result<Arc<dyn Guide>, InputError>;

/// A guide that goes by a name.
#[derive(Debug)]
pub struct Kind {
    /// Name.
    pub name: &'static str,
    /// What it is, without a full stop.
    pub what: &'static str,
    /// What can be set.
    pub keys: &'static [Key],
    make: Make,
}

/// All guides.
pub const KINDS: &[Kind] = &[
    Kind {
        name: "stereo",
        what: "The scene's camera pair with drawn errors; its keys are the scene's",
        keys: &[],
        make: |document, keys| {
            let _: Nothing = read(document, keys)?;
            Ok(Arc::new(BehaviouralStereo))
        },
    },
    Kind {
        name: "truth",
        what: "The true distance with a Gaussian error",
        keys: noisy_truth::KEYS,
        make: |document, keys| Ok(Arc::new(read::<NoisyTruth>(document, keys)?)),
    },
    Kind {
        name: "matched",
        what: "The scene's camera pair: rendered images, semi-global matching",
        keys: rendered::KEYS,
        make: |document, keys| Ok(Arc::new(read::<MatchedStereo>(document, keys)?)),
    },
    Kind {
        name: "monocular",
        what: "Depth from one image by a network: everywhere, and poor",
        keys: monocular::KEYS,
        make: |document, keys| Ok(Arc::new(read::<Monocular>(document, keys)?)),
    },
    Kind {
        name: "radar",
        what: "Good range, coarse angle",
        keys: radar::KEYS,
        make: |document, keys| Ok(Arc::new(read::<Radar>(document, keys)?)),
    },
    Kind {
        name: "intensity",
        what: "The intensity images of two lidars, matched",
        keys: intensity::KEYS,
        make: |document, keys| Ok(Arc::new(read::<IntensityStereo>(document, keys)?)),
    },
    Kind {
        name: "kalman",
        what: "Prediction from earlier frames; knows nothing before the first",
        keys: kalman::KEYS,
        make: |document, keys| Ok(Arc::new(read::<Kalman>(document, keys)?)),
    },
    Kind {
        name: "file",
        what: "A map from a .npy file",
        keys: FILE_KEYS,
        make: |document, keys| {
            let FileOptions {
                path,
                sigma_m,
                sigma_path,
            } = read(document, keys)?;
            let sigma = match &sigma_path {
                Some(path) => FileSigma::Map(path),
                None => FileSigma::Same(sigma_m),
            };
            Ok(Arc::new(FileMap::read(&path, sigma)?))
        },
    },
];

const FILE_KEYS: &[Key] = &[
    Key {
        name: "path",
        what: "Distances along the ray, rows x cols, m; 0 where there is no estimate",
        unit: "",
        range: Range::Text,
        source: "-",
    },
    Key {
        name: "sigma_m",
        what: "Standard deviation of all of them",
        unit: "m",
        range: Range::Within(0.0, 1e4),
        source: "chosen",
    },
    Key {
        name: "sigma_path",
        what: "Standard deviations, rows x cols, m, instead",
        unit: "",
        range: Range::Text,
        source: "-",
    },
];

/// No keys at all.
#[derive(serde::Deserialize)]
#[serde(deny_unknown_fields)]
struct Nothing {}

#[derive(serde::Deserialize)]
#[serde(deny_unknown_fields, default)]
struct FileOptions {
    path: PathBuf,
    sigma_m: f64,
    sigma_path: Option<PathBuf>,
}

impl Default for FileOptions {
    fn default() -> Self {
        FileOptions {
            path: PathBuf::new(),
            sigma_m: 1.0,
            sigma_path: None,
        }
    }
}

/// The guide that `text` describes; `source` is what complaints call the place where it stands.
///
/// # Errors
/// When there is no such guide, its keys or values are wrong, or its files cannot be read.
pub fn parse(text: &str, source: &str) -> Result<Arc<dyn Guide>, InputError> {
    let (name, settings) = text.split_once(':').unwrap_or((text, ""));
    let Some(kind) = KINDS.iter().find(|kind| kind.name == name) else {
        let names: Vec<&str> = KINDS.iter().map(|kind| kind.name).collect();
        let message = format!("{name:?} is no guide; give {}", names.join(", "));
        return Err(InputError::new(source, message));
    };
    let option = format!("{source} {text}");
    let mut document = Document::of(&option, Table::new());
    for assignment in settings.split(',').filter(|part| !part.is_empty()) {
        document.assign(assignment, &option)?;
    }
    if kind.name == "file" && !document.table().contains_key("path") {
        return Err(InputError::new(
            option,
            "names no file; give file:path=MAP.npy",
        ));
    }
    (kind.make)(&document, kind.keys)
}

/// Several guides, fused where there are more than one.
///
/// # Errors
/// As [`parse`], and when there are none or more than eight.
pub fn parse_all<'t>(
    texts: impl IntoIterator<Item = &'t str>,
    source: &str,
) -> Result<Arc<dyn Guide>, InputError> {
    let guides = texts.into_iter().map(|text| parse(text, source));
    let mut guides: Vec<_> = guides.collect::<Result<_, _>>()?;
    if guides.is_empty() || guides.len() > MOST_GUIDES {
        let message = format!("{} guides; give 1 to {MOST_GUIDES}", guides.len());
        return Err(InputError::new(source, message));
    }
    match guides.len() {
        1 => Ok(guides.remove(0)),
        _ => Ok(Arc::new(Fused::new(guides))),
    }
}

/// Settings with their defaults, checked.
fn read<T: DeserializeOwned>(document: &Document, keys: &[Key]) -> Result<T, InputError> {
    let mut faults = Vec::new();
    let table = document.section::<T>("", document.table(), keys, &Table::new(), &mut faults);
    document.complain(faults)?;
    Ok(table.try_into().expect("every value has been tried"))
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    #[test]
    fn every_kind_goes_by_its_name_with_and_without_settings() {
        for kind in KINDS.iter().filter(|kind| kind.name != "file") {
            assert_eq!(parse(kind.name, "guide").unwrap().name(), kind.name);
        }
        let radar = parse("radar:azimuth_beam_deg=4°,range_sigma_m=20 cm", "guide").unwrap();
        assert_eq!(
            format!("{radar:?}"),
            format!(
                "{:?}",
                Radar {
                    azimuth_beam_deg: 4.0,
                    range_sigma_m: 0.2,
                    ..Radar::default()
                }
            )
        );
        let fused = parse_all(["stereo", "radar"], "guide").unwrap();
        assert_eq!(fused.name(), "stereo + radar");
    }

    /// Keys of the tables are those of the structs, with defaults within their ranges.
    #[test]
    fn tables_of_keys_are_whole() {
        let tables = [
            (noisy_truth::KEYS, Table::try_from(NoisyTruth::default())),
            (monocular::KEYS, Table::try_from(Monocular::default())),
            (radar::KEYS, Table::try_from(Radar::default())),
            (rendered::KEYS, Table::try_from(MatchedStereo::default())),
            (intensity::KEYS, Table::try_from(IntensityStereo::default())),
            (kalman::KEYS, Table::try_from(Kalman::default())),
        ];
        for (keys, table) in tables {
            let table = table.unwrap();
            assert_eq!(table.len(), keys.len());
            for key in keys {
                assert_eq!(key.fault(&table[key.name]), None);
            }
        }
    }

    #[test]
    fn what_is_wrong_is_said_in_one_sentence() {
        for (text, says) in [
            ("lidar", "\"lidar\" is no guide; give stereo, truth"),
            ("radar:beam=3", "unknown field `beam`"),
            (
                "radar:resolution_m=-1",
                "resolution_m = -1 is impossible; give 0.01 to 100 m",
            ),
            ("radar:resolution_m=4 ns", "is a time; give a length"),
            ("truth:sigma_m", "has no value; give key=value"),
            ("stereo:x=1", "unknown field `x`"),
            ("file", "give file:path=MAP.npy"),
            ("file:path=/nonexistent.npy", "/nonexistent.npy"),
            ("truth:sigma_m=nan", "sigma_m = NaN is impossible"),
        ] {
            let error = parse(text, "guide").unwrap_err().to_string();
            assert!(error.contains(says), "{text}: {error}");
            assert_eq!(error.lines().count(), 1, "{error}");
        }
        assert!(parse_all([], "guide").is_err());
        assert!(parse_all(["stereo"; 9], "guide").is_err());
    }

    proptest! {
        #[test]
        fn any_text_is_a_guide_or_a_complaint(text in "(truth|radar|kalman|file)?:?\\PC{0,30}") {
            let _ = parse(&text, "guide");
        }
    }
}
