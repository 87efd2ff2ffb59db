//! Logs of the ams TMF8829 with histograms switched on, as the maker's client writes them, packed by gzip or not.
//!
//! ```text
//!   { "configuration": {…},
//!     "Result_Set": [ { "mp_histo":  [[{"bin": […]}, …], …],                 rows × columns
//!                       "ref_histo": [{"bin": […]}, …],                      reference SPADs
//!                       "results":   [[{"peaks": [{"distance": mm, …}]}, …], …], … }, … ] }
//! ```
//!
//! Fields that are not named here are passed over. References are added up. They tell when the laser pulse left only if they have as many
//! bins as the zones, which they have where zones have 64. Without `mp_histo` a frame has the sensor's own depths alone.

use std::io::Read;
use std::path::Path;

use femtogate::InputError;
use flate2::read::MultiGzDecoder;
use serde::Deserialize;

use super::{ZoneCounts, ZoneHistograms};
use crate::files::guarded::open_input;
use crate::files::input::parse_json;

/// Most bytes of a log, unpacked.
const MOST_BYTES: u64 = 1 << 31;

#[derive(Deserialize)]
struct Log {
    #[serde(rename = "Result_Set")]
    frames: Vec<Frame>,
}

#[derive(Deserialize)]
struct Frame {
    #[serde(default, rename = "mp_histo")]
    zones: Vec<Vec<Histogram>>,
    #[serde(default, rename = "ref_histo")]
    references: Vec<Histogram>,
    #[serde(default, rename = "results")]
    depths: Vec<Vec<ZoneResult>>,
}

#[derive(Deserialize)]
struct Histogram {
    #[serde(rename = "bin")]
    bins: Vec<u32>,
}

#[derive(Deserialize)]
struct ZoneResult {
    #[serde(default)]
    peaks: Vec<ZonePeak>,
}

#[derive(Deserialize)]
struct ZonePeak {
    /// 0 where the sensor saw nothing.
    #[serde(rename = "distance")]
    distance_mm: Option<f64>,
}

/// Reads a log.
pub(super) fn read(path: &Path) -> Result<ZoneHistograms, InputError> {
    let complain = |message: String| InputError::new(path.display(), message);
    let wanted = "a log of a TMF8829 with a `Result_Set`";
    let log: Log = parse_json(path.display(), &unpacked(path)?, wanted)?;
    let first = log.frames.iter().find(|frame| !frame.zones.is_empty());
    let (zones, bins) = first.map_or((0, 0), |frame| {
        let zones = frame.zones.iter().map(Vec::len).sum();
        let first = frame.zones.iter().flatten().next();
        (zones, first.map_or(0, |histogram| histogram.bins.len()))
    });
    let mut captures = Vec::new();
    let mut cut_short = 0;
    for (number, frame) in log.frames.iter().enumerate() {
        if frame.zones.is_empty() {
            cut_short += 1;
            continue;
        }
        let histograms: Vec<&Histogram> = frame.zones.iter().flatten().collect();
        let fits = |histogram: &&Histogram| histogram.bins.len() == bins;
        if histograms.len() != zones || !histograms.iter().all(fits) {
            return Err(complain(format!(
                "frame {number} of its `Result_Set` is not of {zones} zones and {bins} bins like the first; give frames of one mode"
            )));
        }
        let own_depths: Vec<Option<f64>> = frame.depths.iter().flatten().map(nearest_m).collect();
        captures.push(ZoneCounts {
            counts: histograms.iter().flat_map(|h| &h.bins).copied().collect(),
            reference: sum(&frame.references),
            own_depths_m: if own_depths.len() == zones {
                own_depths
            } else {
                Vec::new()
            },
        });
    }
    Ok(ZoneHistograms {
        bins,
        captures,
        cut_short,
    })
}

/// The distance of the first peak.
fn nearest_m(zone: &ZoneResult) -> Option<f64> {
    let distance_mm = zone.peaks.first()?.distance_mm?;
    (distance_mm > 0.0).then_some(1e-3 * distance_mm)
}

fn sum(references: &[Histogram]) -> Option<Vec<u32>> {
    let bins = references.first()?.bins.len();
    let is_usable = references.iter().all(|r| r.bins.len() == bins);
    is_usable.then(|| {
        let sum = |bin: usize| {
            references
                .iter()
                .fold(0u32, |sum, r| sum.saturating_add(r.bins[bin]))
        };
        (0..bins).map(sum).collect()
    })
}

fn unpacked(path: &Path) -> Result<String, InputError> {
    let complain = |message: &str| InputError::new(path.display(), message);
    let mut bytes = Vec::new();
    let mut file = open_input(path)?.take(MOST_BYTES);
    file.read_to_end(&mut bytes)
        .map_err(|e| InputError::unreadable(path, &e))?;
    if bytes.starts_with(&[0x1f, 0x8b]) {
        let mut text = Vec::new();
        let mut unpacked = MultiGzDecoder::new(&bytes[..]).take(MOST_BYTES);
        unpacked.read_to_end(&mut text).map_err(|_| {
            complain("is packed by gzip, and damaged or cut short; give the whole file")
        })?;
        bytes = text;
    }
    let is_too_long = bytes.len() as u64 >= MOST_BYTES;
    if is_too_long {
        return Err(complain("has more than 2 GiB of text; give fewer frames"));
    }
    String::from_utf8(bytes)
        .map_err(|_| complain("is no text; give a log as JSON, or packed by gzip"))
}

#[cfg(test)]
mod tests {
    use super::super::HistogramFormat;
    use super::super::tests::read_bytes;
    use super::*;
    use flate2::Compression;
    use flate2::write::GzEncoder;
    use std::io::Write;

    const LOG: &str = r#"{"configuration": {"bin_shift": 2}, "Result_Set": [
        {"info": {"temperature": 27}, "results": [[{"peaks": []}]]},
        {"mp_histo": [[{"bin": [1, 2, 3]}, {"bin": [4, 5, 6]}]], "ref_histo": [{"bin": [9, 1, 0]}, {"bin": [8, 0, 0]}],
         "results": [[{"noise": 3, "peaks": [{"distance": 1500, "snr": 9}]}, {"peaks": [{"distance": 0}]}]]}]}"#;

    fn read(bytes: &[u8]) -> Result<ZoneHistograms, String> {
        read_bytes("log.json.gz", bytes, HistogramFormat::Tmf8829, None)
    }

    #[test]
    fn logs_are_read_packed_or_not() {
        let expected = ZoneHistograms {
            bins: 3,
            captures: vec![ZoneCounts {
                counts: vec![1, 2, 3, 4, 5, 6],
                reference: Some(vec![17, 1, 0]),
                own_depths_m: vec![Some(1.5), None],
            }],
            cut_short: 1,
        };
        assert_eq!(read(LOG.as_bytes()), Ok(expected.clone()));
        let mut packed = GzEncoder::new(Vec::new(), Compression::fast());
        packed.write_all(LOG.as_bytes()).unwrap();
        let packed = packed.finish().unwrap();
        assert_eq!(read(&packed), Ok(expected));
        assert!(
            read(&packed[..packed.len() / 2])
                .unwrap_err()
                .contains("cut short")
        );
    }

    #[test]
    fn other_files_are_named_for_what_they_lack() {
        assert!(
            read(b"{\"frames\": []}")
                .unwrap_err()
                .contains("Result_Set")
        );
        assert!(
            read(b"{\"Result_Set\": [{}]}")
                .unwrap_err()
                .contains("histograms must be switched on")
        );
        let uneven = LOG.replace("[4, 5, 6]", "[4, 5]");
        assert!(
            read(uneven.as_bytes())
                .unwrap_err()
                .contains("frame 1 of its")
        );
        assert!(read(&[0xff, 0xfe, 1]).unwrap_err().contains("no text"));
    }
}
