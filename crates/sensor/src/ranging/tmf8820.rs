//! Captures of an ams TMF8820, a multi-zone dToF sensor, as JSON.
//!
//! The file is a list of captures, each an object with
//!
//! | key | what |
//! |---|---|
//! | `capture` | number of the capture |
//! | `dist_to_plane_m` | true distance to a plane in front of the sensor, m |
//! | `reference_hist` | counts of the light that goes straight from the laser to a SPAD, one per bin |
//! | `hists` | counts, zones × bins |
//! | `on_chip_depths_mm` | what the sensor itself made of each zone, mm; 0 where it saw no target |

use std::path::Path;

use serde::Deserialize;

use crate::files::{InputError, parse_json, read_text};

/// One capture.
#[derive(Debug, Clone, PartialEq, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Capture {
    /// Number of the capture.
    pub capture: u64,
    /// True distance to the plane, m.
    pub dist_to_plane_m: f64,
    /// Reference counts, one per bin.
    pub reference_hist: Vec<u32>,
    /// Counts, zones × bins.
    pub hists: Vec<Vec<u32>>,
    /// The sensor's own depths, mm, one per zone; 0 where it saw no target.
    pub on_chip_depths_mm: Vec<f64>,
}

/// Reads a file of captures; all have the same zones and bins, at least one of each.
///
/// # Errors
/// Unreadable files, malformed JSON with its line, and captures of another shape with their number.
pub fn read(path: &Path) -> Result<Vec<Capture>, InputError> {
    parse(path.display(), &read_text(path)?)
}

fn parse(source: impl std::fmt::Display, text: &str) -> Result<Vec<Capture>, InputError> {
    let captures: Vec<Capture> = parse_json(&source, text, "a list of TMF8820 captures")?;
    let Some(first) = captures.first() else {
        return Err(InputError::new(
            source,
            "has no captures; give at least one",
        ));
    };
    let (zones, bins) = (first.hists.len(), first.reference_hist.len());
    if zones == 0 || bins == 0 {
        let message = "the first capture has no zones or no bins; give histograms";
        return Err(InputError::new(source, message));
    }
    for capture in &captures {
        let fits = capture.hists.len() == zones
            && capture.on_chip_depths_mm.len() == zones
            && capture.reference_hist.len() == bins
            && capture.hists.iter().all(|counts| counts.len() == bins);
        if !fits {
            let message = format!(
                "capture {} is not of {zones} zones and {bins} bins like the first; correct or remove it",
                capture.capture
            );
            return Err(InputError::new(source, message));
        }
        if !capture.dist_to_plane_m.is_finite() {
            let message = format!(
                "capture {} has no finite dist_to_plane_m; correct or remove it",
                capture.capture
            );
            return Err(InputError::new(source, message));
        }
    }
    Ok(captures)
}

#[cfg(test)]
mod tests {
    use super::*;

    const GOOD: &str = r#"[
{"capture": 0, "dist_to_plane_m": 0.1, "reference_hist": [1, 9, 2], "hists": [[0, 1, 7], [0, 2, 8]],
 "on_chip_depths_mm": [99, 101]}]"#;

    #[test]
    fn a_capture_reads_back() {
        let captures = parse("a.json", GOOD).unwrap();
        assert_eq!(captures.len(), 1);
        assert_eq!(captures[0].hists[1], [0, 2, 8]);
        let dir = tempfile::tempdir().unwrap();
        let path = dir.path().join("a.json");
        std::fs::write(&path, GOOD).unwrap();
        assert_eq!(read(&path).unwrap().len(), 1);
    }

    #[test]
    fn what_is_wrong_is_said_in_one_sentence() {
        let error = |text: &str| parse("a.json", text).unwrap_err().to_string();
        assert!(error("[]").contains("at least one"));
        assert!(error("[\n{]").starts_with("a.json:2:"));
        assert!(error(&GOOD.replace("[0, 2, 8]", "[0, 2]")).contains("capture 0"));
        assert!(error(&GOOD.replace("[99, 101]", "[99]")).contains("capture 0"));
        assert!(error(&GOOD.replace("9, 2]", "-9, 2]")).starts_with("a.json:2:"));
        assert!(error(&GOOD.replace("[[0, 1, 7], [0, 2, 8]]", "[]")).contains("no zones"));
    }
}
