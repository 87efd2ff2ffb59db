//! Captures of an ams TMF8820, a multi-zone dToF sensor, as JSON.
//!
//! The file is a list of captures, each an object with
//!
//! | key | what |
//! |---|---|
//! | `capture` | number of the capture |
//! | `dist_to_plane_m` | true distance to a plane in front of the sensor, m; may be left out |
//! | `reference_hist` | counts of the light that goes straight from the laser to a SPAD, one per bin |
//! | `hists` | counts, zones × bins |
//! | `on_chip_depths_mm` | what the sensor itself made of each zone, mm; 0 where it saw no target; may be left out |
//!
//! Other keys are passed over.

use std::path::Path;

use serde::Deserialize;

use crate::files::{InputError, parse_json, read_text};

/// Further than such a sensor sees by far, m: a distance that is given in mm.
const FURTHEST_M: f64 = 50.0;

/// One capture.
#[derive(Debug, Clone, PartialEq, Deserialize)]
pub struct Capture {
    /// Number of the capture.
    #[serde(default)]
    pub capture: u64,
    /// True distance to the plane, m, if it is known.
    pub dist_to_plane_m: Option<f64>,
    /// Reference counts, one per bin.
    pub reference_hist: Vec<u32>,
    /// Counts, zones × bins.
    pub hists: Vec<Vec<u32>>,
    /// The sensor's own depths, mm, one per zone; 0 where it saw no target. Empty if they are not known.
    #[serde(default)]
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
            && [0, zones].contains(&capture.on_chip_depths_mm.len())
            && capture.reference_hist.len() == bins
            && capture.hists.iter().all(|counts| counts.len() == bins);
        if !fits {
            let message = format!(
                "capture {} is not of {zones} zones and {bins} bins like the first; correct or remove it",
                capture.capture
            );
            return Err(InputError::new(source, message));
        }
        let Some(plane_m) = capture.dist_to_plane_m else {
            continue;
        };
        if !(0.0..=FURTHEST_M).contains(&plane_m) {
            let message = format!(
                "capture {} has a dist_to_plane_m of {plane_m}, which no such sensor sees; give metres, from 0 to {FURTHEST_M}",
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
        assert!(error(&GOOD.replace("0.1", "600")).contains("give metres"));
        assert!(error(&GOOD.replace("0.1", "-0.6")).contains("give metres"));
    }

    #[test]
    fn what_a_logger_adds_or_leaves_out_is_no_fault() {
        let read = |text: &str| parse("a.json", text).unwrap().remove(0);
        let more = read(&GOOD.replace("{", r#"{"temperature": 27, "#));
        assert_eq!(more.dist_to_plane_m, Some(0.1));
        let less = GOOD.replace(r#""dist_to_plane_m": 0.1, "#, "");
        let less = read(&less.replace(",\n \"on_chip_depths_mm\": [99, 101]", ""));
        assert_eq!(less.dist_to_plane_m, None);
        assert!(less.on_chip_depths_mm.is_empty());
    }
}
