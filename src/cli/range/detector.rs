//! The detector that options and a file describe. An option goes before the same key of the file.

use super::args::{Counts, RangeArgs};
use crate::files::{InputError, parse_toml, read_text};
use crate::ranging::{BadDetector, CountedEvents, Detector, DetectorDescription};

/// A detector, and whether its description says when bins begin.
pub(super) struct DescribedDetector {
    pub(super) detector: Detector,
    pub(super) has_start: bool,
}

/// The description in the file, with the options.
///
/// # Errors
/// A file that cannot be read or is no description.
pub(super) fn description(args: &RangeArgs) -> Result<DetectorDescription, InputError> {
    let mut described = match &args.detector {
        Some(path) => parse_toml::<DetectorDescription>(path.display(), &read_text(path)?)?,
        None => DetectorDescription::default(),
    };
    if args.bin_width_ns.is_some() {
        described.bin_edges_ns = None;
    }
    let counts = args.counts.map(|counts| match counts {
        Counts::Every => CountedEvents::Every,
        Counts::First => CountedEvents::First,
    });
    described.bin_width_ns = args.bin_width_ns.or(described.bin_width_ns);
    described.start_ns = args.start_ns.or(described.start_ns);
    described.pulse_fwhm_ns = args.pulse_fwhm_ns.or(described.pulse_fwhm_ns);
    described.counts = counts.or(described.counts);
    described.laser_cycles = args.laser_cycles.or(described.laser_cycles);
    Ok(described)
}

/// The detector of a histogram with `bins` bins.
///
/// # Errors
/// What is missing, or cannot be.
pub(super) fn described_detector(
    args: &RangeArgs,
    described: &DetectorDescription,
    bins: usize,
) -> Result<DescribedDetector, InputError> {
    let complain = |bad: BadDetector| {
        let option = match bad.key {
            "bin_width_ns" => Some(("--bin-width-ns", args.bin_width_ns.is_some())),
            "start_ns" => Some(("--start-ns", args.start_ns.is_some())),
            "pulse_fwhm_ns" => Some(("--pulse-fwhm-ns", args.pulse_fwhm_ns.is_some())),
            "laser_cycles" => Some(("--laser-cycles", args.laser_cycles.is_some())),
            _ => None,
        };
        match (option, &args.detector) {
            (Some((option, is_given)), file) if is_given || file.is_none() => {
                InputError::new(option, bad.message)
            }
            (_, Some(path)) => InputError::new(path.display(), bad.to_string()),
            (_, None) => InputError::new("--detector", bad.to_string()),
        }
    };
    Ok(DescribedDetector {
        has_start: described.start_ns.is_some() || described.bin_edges_ns.is_some(),
        detector: described.detector(bins).map_err(complain)?,
    })
}

/// Checks that an option's value is from `least` to `most`.
///
/// # Errors
/// That it is not.
pub(super) fn check_within(
    option: &str,
    value: f64,
    (least, most): (f64, f64),
) -> Result<(), InputError> {
    if (least..=most).contains(&value) {
        return Ok(());
    }
    let message = format!("{value} is impossible; give {least} to {most}");
    Err(InputError::new(option, message))
}
