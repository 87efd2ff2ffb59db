//! The description of a detector, as files and commands have it, and what is wrong with it.
//!
//! ```toml
//! bin_width_ns = 1.0       # or bin_edges_ns = [10.0, 11.0, 12.5]: one number more than bins
//! start_ns = 10.0          # when bin 0 begins after the centre of the pulse has left
//! pulse_fwhm_ns = 2.0
//! counts = "first"         # or "every"
//! laser_cycles = 2000
//! most_counts = 1023       # where a bin stops
//! coincidence = { spads = 2, within_ns = 4.0, of = 16 }
//! ```

use std::f64::consts::LN_2;

use serde::{Deserialize, Serialize};

use super::{Coincidence, CountedEvents, Detector};
use crate::settings::Range::{OneOf, Text, Within};
use crate::settings::{Section, Settings, keys, remarks};

/// The longest bin over the mean one, and the mean one over the shortest: chosen. The search for peaks would see little in more unequal ones.
const MOST_UNEQUAL: f64 = 4.0;

keys! {
    /// A detector in the words of its user; what is missing has its default, or is asked for.
    pub struct DetectorDescription {
        /// Length of a bin.
        bin_width_ns: Option<f64> ["ns"] = None, in Within(1e-3, 1e6), usually (0.005, 200.0);
        /// Where bins begin, and the last one ends, after the centre of the laser pulse has left.
        bin_edges_ns: Option<Vec<f64>> ["ns"] = None, in Within(-1e9, 1e9), usually (0.0, 1e5);
        /// When bin 0 of equal bins begins after the centre of the laser pulse has left; 0 if missing.
        start_ns: Option<f64> ["ns"] = None, in Within(-1e9, 1e9), usually (0.0, 1e5);
        /// Full width at half maximum of the laser pulse with all jitter.
        pulse_fwhm_ns: Option<f64> ["ns"] = None, in Within(0.0, 1e6), usually (0.01, 500.0);
        /// Which events count; every one if missing.
        counts: Option<CountedEvents> = None, in OneOf(&["every", "first"]);
        /// Laser cycles of a histogram.
        laser_cycles: Option<u32> = None, in Within(1.0, u32::MAX as f64);
        /// Counts at which a bin stops.
        most_counts: Option<u32> = None, in Within(1.0, u32::MAX as f64);
        /// What an event is, if it is not a photon.
        coincidence: Option<DescribedCoincidence> = None, in Text;
    }
}

/// SPADs that fire together.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct DescribedCoincidence {
    /// How many.
    pub spads: u32,
    /// Within this time.
    pub within_ns: f64,
    /// SPADs in all.
    pub of: u32,
}

/// What is wrong with a description.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
#[error("{key}: {message}")]
pub struct BadDetector {
    /// The key that it is about.
    pub key: &'static str,
    /// What is wrong, and what to do.
    pub message: String,
}

impl DetectorDescription {
    /// Sentences on values that are probably in another unit than their key has.
    pub fn remarks(&self) -> Vec<String> {
        let values = toml::Table::try_from(self).expect("numbers and words");
        remarks(&[Section::new("", "A detector", Self::KEYS)], &values)
    }

    /// The detector with `bins` bins.
    ///
    /// # Errors
    /// What is missing, or cannot be.
    pub fn detector(&self, bins: usize) -> Result<Detector, BadDetector> {
        let edges_s = self.edges_s(bins)?;
        let fwhm_ns = needed("pulse_fwhm_ns", self.pulse_fwhm_ns)?;
        check_range("pulse_fwhm_ns", fwhm_ns)?;
        let all_ns = 1e9 * (edges_s[bins] - edges_s[0]);
        if fwhm_ns > 0.5 * all_ns * (1.0 + 1e-9) {
            let message = format!(
                "{fwhm_ns} is more than half of {bins} bins, {all_ns:.3} ns in all; give the width of the laser pulse"
            );
            return Err(bad("pulse_fwhm_ns", message));
        }
        let counted = self.counts.unwrap_or(CountedEvents::Every);
        let coincidence = self.coincidence.map(checked).transpose()?;
        match self.laser_cycles {
            Some(0) => return Err(bad("laser_cycles", "0 is impossible; give 1 or more")),
            None if counted == CountedEvents::First => {
                let message =
                    "is needed where only the first event of a laser cycle counts; give 1 or more";
                return Err(bad("laser_cycles", message));
            }
            None if coincidence.is_some() => {
                let message = "is needed where SPADs must fire together; give 1 or more";
                return Err(bad("laser_cycles", message));
            }
            _ => {}
        }
        if self.most_counts == Some(0) {
            return Err(bad("most_counts", "0 is impossible; give 1 or more"));
        }
        Ok(Detector {
            edges_s,
            pulse_sigma_s: 1e-9 * fwhm_ns / (8.0 * LN_2).sqrt(),
            counted,
            laser_cycles: self.laser_cycles,
            coincidence,
            most_counts: self.most_counts,
            crosstalk: Vec::new(),
        })
    }

    fn edges_s(&self, bins: usize) -> Result<Vec<f64>, BadDetector> {
        let Some(edges_ns) = &self.bin_edges_ns else {
            let bin_ns = needed("bin_width_ns", self.bin_width_ns)?;
            check_range("bin_width_ns", bin_ns)?;
            let start_ns = self.start_ns.unwrap_or(0.0);
            check_range("start_ns", start_ns)?;
            return Ok(Detector::equal_edges_s(
                bins,
                1e-9 * start_ns,
                1e-9 * bin_ns,
            ));
        };
        for (key, is_given) in [
            ("bin_width_ns", self.bin_width_ns.is_some()),
            ("start_ns", self.start_ns.is_some()),
        ] {
            if is_given {
                return Err(bad(
                    key,
                    "says the same as bin_edges_ns; leave one of them out",
                ));
            }
        }
        let fault = |message: String| Err(bad("bin_edges_ns", message));
        if edges_ns.len() != bins + 1 {
            let edges = edges_ns.len();
            return fault(format!(
                "has {edges} numbers for {bins} bins; give one more than bins"
            ));
        }
        let is_time = |edge: &&f64| (-1e9..=1e9).contains(*edge);
        if edges_ns.iter().filter(is_time).count() < edges_ns.len() {
            return fault("has a number that is no time; give -1e9 to 1e9".into());
        }
        let mean_ns = (edges_ns[bins] - edges_ns[0]) / bins as f64;
        for (bin, ends) in edges_ns.windows(2).enumerate() {
            let ns = ends[1] - ends[0];
            if ns <= 0.0 {
                return fault(format!(
                    "bin {bin} ends before it begins; give edges that rise"
                ));
            }
            if ns > MOST_UNEQUAL * mean_ns || ns < mean_ns / MOST_UNEQUAL {
                return fault(format!(
                    "bin {bin} is {ns} ns long, and bins are {mean_ns} ns on average; no bin may be {MOST_UNEQUAL} times as long or short"
                ));
            }
        }
        Ok(edges_ns.iter().map(|edge| 1e-9 * edge).collect())
    }
}

fn checked(coincidence: DescribedCoincidence) -> Result<Coincidence, BadDetector> {
    let DescribedCoincidence {
        spads,
        within_ns,
        of,
    } = coincidence;
    check_within("coincidence.within_ns", within_ns, (1e-3, 1e6))?;
    check_within("coincidence.of", f64::from(of), (1.0, 1024.0))?;
    check_within("coincidence.spads", f64::from(spads), (1.0, f64::from(of)))?;
    Ok(Coincidence {
        spads,
        within_s: 1e-9 * within_ns,
        lit_spads: of,
    })
}

fn bad(key: &'static str, message: impl Into<String>) -> BadDetector {
    BadDetector {
        key,
        message: message.into(),
    }
}

fn needed(key: &'static str, value: Option<f64>) -> Result<f64, BadDetector> {
    value.ok_or_else(|| bad(key, "is needed to make depths of bins; give it"))
}

/// Checks a value against the range of its key.
fn check_range(name: &'static str, value: f64) -> Result<(), BadDetector> {
    let key = DetectorDescription::KEYS
        .iter()
        .find(|key| key.name == name);
    let fault = key.and_then(|key| key.fault(&value.into()));
    let Some(fault) = fault else { return Ok(()) };
    let message = fault.strip_prefix(&format!("{name} = ")).unwrap_or(&fault);
    Err(bad(name, message))
}

fn check_within(
    key: &'static str,
    value: f64,
    (least, most): (f64, f64),
) -> Result<(), BadDetector> {
    if (least..=most).contains(&value) {
        return Ok(());
    }
    Err(bad(
        key,
        format!("{value} is impossible; give {least} to {most}"),
    ))
}

#[cfg(test)]
mod tests {
    use super::*;

    fn plain() -> DetectorDescription {
        DetectorDescription {
            bin_width_ns: Some(1.0),
            pulse_fwhm_ns: Some(1.0),
            ..DetectorDescription::default()
        }
    }

    #[test]
    fn edges_say_what_a_width_and_a_start_say() {
        let start_ns = Some(10.0);
        let equal = DetectorDescription {
            start_ns,
            ..plain()
        };
        let equal = equal.detector(3).unwrap();
        let edges = DetectorDescription {
            bin_width_ns: None,
            bin_edges_ns: Some(vec![10.0, 11.0, 12.0, 13.0]),
            ..plain()
        };
        let edges = edges.detector(3).unwrap();
        for (a, b) in equal.edges_s.iter().zip(&edges.edges_s) {
            assert!((a - b).abs() < 1e-20);
        }
    }

    #[test]
    fn each_fault_names_its_key() {
        let edges = |edges: &[f64]| DetectorDescription {
            bin_width_ns: None,
            bin_edges_ns: Some(edges.to_vec()),
            ..plain()
        };
        let together = |spads, within_ns, of| DetectorDescription {
            coincidence: Some(DescribedCoincidence {
                spads,
                within_ns,
                of,
            }),
            laser_cycles: Some(10),
            ..plain()
        };
        let first = DetectorDescription {
            counts: Some(CountedEvents::First),
            ..plain()
        };
        let faults = [
            (DetectorDescription::default(), "bin_width_ns"),
            (edges(&[0.0, 1.0, 2.0]), "bin_edges_ns"),
            (edges(&[0.0, 2.0, 1.0, 3.0]), "bin_edges_ns"),
            (edges(&[0.0, 1.0, f64::NAN, 3.0]), "bin_edges_ns"),
            (edges(&[0.0, 1.0, 2.0, 40.0]), "bin_edges_ns"),
            (first, "laser_cycles"),
            (together(17, 4.0, 16), "coincidence.spads"),
            (together(0, 4.0, 16), "coincidence.spads"),
            (together(2, 0.0, 16), "coincidence.within_ns"),
            (together(1, 1.0, 0), "coincidence.of"),
        ];
        for (description, key) in faults {
            assert_eq!(description.detector(3).unwrap_err().key, key);
        }
        let mut both = edges(&[0.0, 1.0, 2.0, 3.0]);
        both.start_ns = Some(1.0);
        assert_eq!(both.detector(3).unwrap_err().key, "start_ns");
        assert!(together(2, 4.0, 16).detector(3).is_ok());
    }
}
