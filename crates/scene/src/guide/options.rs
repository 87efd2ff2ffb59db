//! Guides by name: `NAME` or `NAME:KEY=VALUE,KEY=VALUE`, as users write them.

use std::path::PathBuf;
use std::sync::Arc;

use toml::Table;

use super::from_file::{FileMap, FileSigma};
use super::fused::{Fused, MOST_GUIDES};
use super::{
    BehaviouralStereo, Guide, IntensityStereo, Kalman, MatchedStereo, Monocular, NoisyTruth, Radar,
};
use crate::files::{InputError, instead_of};
use crate::settings::Range::Within;
use crate::settings::{Assignment, Document, Key, Settings, keys};

/// A guide that goes by a name.
#[derive(Debug)]
#[non_exhaustive]
pub struct GuideKind {
    /// Name.
    pub name: &'static str,
    /// What it is, without a full stop.
    pub what: &'static str,
    /// What can be set.
    pub keys: &'static [Key],
    make: fn(&Document) -> Result<Arc<dyn Guide>, InputError>,
}

impl GuideKind {
    /// A guide that is its own settings.
    const fn new<G: Guide + Settings + 'static>(name: &'static str, what: &'static str) -> Self {
        GuideKind {
            name,
            what,
            keys: G::KEYS,
            make: |document| Ok(Arc::new(read::<G>(document)?)),
        }
    }
}

/// What people ask for who want no guide.
const WITHOUT: [&str; 4] = ["none", "off", "no", "unguided"];

/// All guides.
pub const KINDS: &[GuideKind] = &[
    GuideKind {
        name: "stereo",
        what: "The scene's camera pair, with errors drawn at random; its keys are the scene's",
        keys: Nothing::KEYS,
        make: |document| read::<Nothing>(document).map(|_| Arc::new(BehaviouralStereo) as _),
    },
    GuideKind::new::<NoisyTruth>("truth", "The true distance with a Gaussian error"),
    GuideKind {
        make: |document| {
            let guide: MatchedStereo = read(document)?;
            guide
                .check()
                .map_err(|message| document.refuse("paths", message))?;
            Ok(Arc::new(guide))
        },
        ..GuideKind::new::<MatchedStereo>(
            "matched",
            "The scene's camera pair: images are rendered and matched",
        )
    },
    GuideKind::new::<Monocular>(
        "monocular",
        "Depth from one image: everywhere, but with large errors",
    ),
    GuideKind::new::<Radar>("radar", "Good range, coarse angle"),
    GuideKind::new::<IntensityStereo>("intensity", "The intensity images of two lidars, matched"),
    GuideKind::new::<Kalman>(
        "kalman",
        "Prediction from earlier frames; has no estimate in the first",
    ),
    GuideKind {
        name: "file",
        what: "A map of distances from a .npy file",
        keys: FileOptions::KEYS,
        make: |document| {
            let FileOptions {
                path,
                sigma_m,
                sigma_path,
            } = read(document)?;
            let sigma = match &sigma_path {
                Some(path) => FileSigma::Map(path),
                None => FileSigma::Same(sigma_m),
            };
            Ok(Arc::new(FileMap::read(&path, sigma)?))
        },
    },
];

keys! {
    /// No keys at all.
    struct Nothing {}
}

keys! {
    /// Those of a map from a file.
    struct FileOptions {
        /// File with distances along the ray, rows x cols, m; 0 where there is no estimate.
        path: PathBuf = PathBuf::new(), from "-";
        /// Standard deviation of all distances.
        sigma_m: f64 ["m"] = 1.0, in Within(0.0, 1e4);
        /// File with standard deviations, rows x cols, m, instead of sigma_m.
        sigma_path: Option<PathBuf> = None, from "-";
    }
}

/// The guide that `text` describes; `source` is what complaints call the place where it stands.
///
/// # Errors
/// When there is no such guide, its keys or values are wrong, or its files cannot be read.
pub fn parse(text: &str, source: &str) -> Result<Arc<dyn Guide>, InputError> {
    let (name, settings) = text.split_once(':').unwrap_or((text, ""));
    let Some(kind) = KINDS.iter().find(|kind| kind.name == name) else {
        let names = || KINDS.iter().map(|kind| kind.name);
        let given = name.split(',').map(str::trim);
        let instead = if name.contains(',') && given.clone().all(|part| names().any(|n| n == part))
        {
            let each = given.map(|part| format!("{source} {part}"));
            format!(
                "give each by itself: {}",
                each.collect::<Vec<_>>().join(" ")
            )
        } else if WITHOUT.contains(&name) {
            "a chip without one opens every window at the same time: give mode = \"conventional\" and as many bins as stop_periods, as in the recipe \"Take a frame without a guide\"".to_owned()
        } else {
            instead_of(name, names())
        };
        let message = format!("{name:?} is not a guide; {instead}");
        return Err(InputError::new(source, message));
    };
    let option = format!("{source} {text}");
    let mut document = Document::from_table(&option, Table::new());
    for text in settings.split(',').filter(|part| !part.is_empty()) {
        document.assign(&Assignment::parse(text, &option)?)?;
    }
    if kind.name == "file" && !document.table.contains_key("path") {
        return Err(InputError::new(
            option,
            "names no file; give file:path=MAP.npy",
        ));
    }
    (kind.make)(&document)
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
fn read<T: Settings>(document: &Document) -> Result<T, InputError> {
    let mut faults = Vec::new();
    let table = document.section::<T>("", &document.table, &mut faults);
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

    #[test]
    fn defaults_are_within_their_ranges() {
        fn check<T: Settings + serde::Serialize>() {
            let table = Table::try_from(T::default()).unwrap();
            for key in T::KEYS {
                assert_eq!(key.fault(&table[key.name]), None);
            }
        }
        check::<NoisyTruth>();
        check::<Monocular>();
        check::<Radar>();
        check::<MatchedStereo>();
        check::<IntensityStereo>();
        check::<Kalman>();
    }

    #[test]
    fn what_is_wrong_is_said_in_one_sentence() {
        for (text, says) in [
            ("lidar", "\"lidar\" is not a guide; give stereo, truth"),
            ("radar:beam=3", "unknown key `beam`; give"),
            ("radr", "\"radr\" is not a guide; did you mean `radar`?"),
            ("none", "\"none\" is not a guide; a chip without one opens"),
            ("unguided", "give mode = \"conventional\" and as many bins"),
            (
                "stereo,radar",
                "give each by itself: guide stereo guide radar",
            ),
            (
                "matched:paths=6",
                "paths = 6 is impossible; give 3, 4, 5 or 8",
            ),
            ("radar:range_sigma=3", "did you mean `range_sigma_m`?"),
            (
                "radar:resolution_m=-1",
                "resolution_m = -1 is impossible; give 0.01 to 100 m",
            ),
            ("radar:resolution_m=4 ns", "is a time; give a length"),
            ("truth:sigma_m", "has no value; give key=value"),
            ("stereo:x=1", "unknown key `x`; leave it out"),
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
        assert!(parse_all(["stereo"; 8], "guide").is_ok());
        assert_eq!(parse_all(["radar"], "guide").unwrap().name(), "radar");
    }

    proptest! {
        #[test]
        fn any_text_is_a_guide_or_a_complaint(text in "(truth|radar|kalman|file)?:?\\PC{0,30}") {
            let _ = parse(&text, "guide");
        }
    }
}
