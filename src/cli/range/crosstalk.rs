//! The light that a cover glass throws back into each zone: measured without a target, or fitted.

use std::ops::Range;
use std::path::Path;

use rayon::prelude::*;

use super::args::RangeArgs;
use crate::files::{HistogramFormat, InputError, ZoneHistograms};
use crate::ranging::Detector;

/// Photons of the glass in each bin of each zone and capture; no bins in a zone without any.
///
/// # Errors
/// A file that cannot be read or is of another sensor, counts from which it cannot be known.
pub(super) fn light(
    args: &RangeArgs,
    (source, format): (&Path, HistogramFormat),
    (histograms, kept): (&ZoneHistograms, Range<usize>),
    detectors: &[Detector],
) -> Result<Vec<Vec<f64>>, InputError> {
    // The pulse leaves at nearly the same time in all captures.
    let detector = &detectors[0];
    let is_fit = source.as_os_str() == "fit";
    let measured = if is_fit {
        None
    } else {
        let mut measured = ZoneHistograms::read(source, format, args.counts_per_unit)?;
        let (zones, bins) = (histograms.zones(), histograms.bins);
        let is_alike = measured.zones() == zones && measured.bins >= kept.end;
        if is_alike {
            measured.keep_bins(kept);
        }
        if !is_alike || measured.bins != bins {
            let message = format!(
                "has {} zones of {} bins, and {} has {zones} zones; give a capture of the same sensor",
                measured.zones(),
                measured.bins,
                args.histograms.display()
            );
            return Err(InputError::new(source.display(), message));
        }
        Some(measured)
    };
    let captures = measured.as_ref().unwrap_or(histograms);
    let of_zone = |zone: usize| {
        let zones = captures.captures.iter();
        let zones = zones.map(|capture| {
            let mut of_bins = capture.counts.chunks_exact(captures.bins);
            of_bins.nth(zone).expect("captures have as many zones")
        });
        let mut sums = vec![0_u32; captures.bins];
        for counts in zones {
            let bins = sums.iter_mut().zip(counts);
            bins.for_each(|(sum, &count)| *sum = sum.saturating_add(count));
        }
        let number = captures.captures.len() as u32;
        let light = if is_fit {
            detector.fitted_crosstalk(&sums, number)
        } else {
            detector.measured_crosstalk(&sums, number)
        };
        light.map_err(|error| {
            let file = if is_fit { &args.histograms } else { source };
            let message = format!("zone {zone} {error}; correct pulse_fwhm_ns and start_ns, or leave the bins of the glass out with --bins");
            InputError::new(file.display(), message)
        })
    };
    let zones = (0..captures.zones()).into_par_iter().map(of_zone);
    // The first zone of which there is something to say, whichever ends first.
    zones.collect::<Vec<_>>().into_iter().collect()
}
