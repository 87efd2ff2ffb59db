//! The peak of a histogram, interpolated between bins (thesis 6.3.1, Eq. 28).
//!
//! Eq. 28 is the centre of mass of the counts, taken, as the thesis says of its practice, over a
//! few bins either side of the fullest one. The thesis counts bins from 1; positions here count
//! from 0, so that bin i has its centre at i and covers i − ½ to i + ½.
//!
//! Background pulls a centre of mass towards the middle of the bins summed. [`Background::Median`]
//! subtracts an estimate of it first; [`Background::None`] is the equation as printed.

use std::ops::Range;

/// What to take off the counts before interpolating.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
#[non_exhaustive]
pub enum Background {
    /// Nothing: Eq. 28 to the letter.
    None,
    /// The median of the bins outside the peak region, no bin falling below zero. With no bins
    /// outside, nothing.
    #[default]
    Median,
}

/// How to interpolate.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
#[non_exhaustive]
pub struct PeakOptions {
    /// Bins taken either side of the fullest one.
    pub half_width: usize,
    /// Background estimate.
    pub background: Background,
}

impl Default for PeakOptions {
    fn default() -> Self {
        PeakOptions {
            half_width: 2,
            background: Background::default(),
        }
    }
}

impl PeakOptions {
    /// The peak region about `peak_bin` of a histogram of `bins` bins; at an edge it is cut off, not shifted.
    pub(crate) fn region(&self, peak_bin: usize, bins: usize) -> Range<usize> {
        let end = peak_bin.saturating_add(self.half_width).saturating_add(1);
        peak_bin.saturating_sub(self.half_width)..end.min(bins)
    }
}

/// A peak found in a histogram.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Peak {
    /// Interpolated position in bins; bin i's centre is i.
    pub position_bins: f64,
    /// The fullest bin; of several as full, the earliest.
    pub peak_bin: usize,
    /// Counts of the peak region above background.
    pub signal_counts: f64,
    /// Background taken off each bin, counts.
    pub background_per_bin: f64,
}

/// Finds and interpolates the peak of `counts`, one entry per bin, earliest first.
///
/// `None` if no count of the
/// peak region exceeds the background, as with an empty histogram.
pub fn interpolate(counts: &[u32], options: &PeakOptions) -> Option<Peak> {
    let peak_bin = (0..counts.len()).rev().max_by_key(|&bin| counts[bin])?;
    let counts: Vec<f64> = counts.iter().map(|&n| f64::from(n)).collect();
    interpolate_at(&counts, peak_bin, options)
}

/// As [`interpolate`], about a given bin of `counts` and with counts that need not be whole, such as mean ones.
pub(super) fn interpolate_at(
    counts: &[f64],
    peak_bin: usize,
    options: &PeakOptions,
) -> Option<Peak> {
    // Moments about the fullest bin keep their digits in a long histogram.
    let place = |bin: usize| bin as f64 - peak_bin as f64;
    let mass = centre_of_mass(counts, peak_bin, options, place)?;
    Some(Peak {
        position_bins: peak_bin as f64 + mass.place,
        peak_bin,
        signal_counts: mass.signal_counts,
        background_per_bin: mass.background_per_bin,
    })
}

/// Where the counts of a peak are on average.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct CentreOfMass {
    /// In what the places of bins are given in.
    pub place: f64,
    /// Counts of the peak region above background.
    pub signal_counts: f64,
    /// Background taken off each bin, counts.
    pub background_per_bin: f64,
}

/// The centre of mass of the peak about `peak_bin`, where bin i is at `place(i)`: Eq. 28 with places that are the bins' numbers, Eq. 29 with
/// the times C_i of a calibration. `None` if no count of the peak region exceeds the background.
pub fn centre_of_mass(
    counts: &[f64],
    peak_bin: usize,
    options: &PeakOptions,
    place: impl Fn(usize) -> f64,
) -> Option<CentreOfMass> {
    let region = options.region(peak_bin, counts.len());
    let background_per_bin = match options.background {
        Background::None => 0.0,
        Background::Median => median(counts[..region.start].iter().chain(&counts[region.end..])),
    };
    let (mut signal_counts, mut moment) = (0.0, 0.0);
    for bin in region {
        let signal = (counts[bin] - background_per_bin).max(0.0);
        signal_counts += signal;
        moment += signal * place(bin);
    }
    (signal_counts > 0.0).then(|| CentreOfMass {
        place: moment / signal_counts,
        signal_counts,
        background_per_bin,
    })
}

/// The median, between the middle two of an even number of values; 0 of none.
pub(super) fn median<'a>(values: impl Iterator<Item = &'a f64>) -> f64 {
    let mut sorted: Vec<f64> = values.copied().collect();
    sorted.sort_unstable_by(f64::total_cmp);
    let n = sorted.len();
    match n {
        0 => 0.0,
        _ => (sorted[(n - 1) / 2] + sorted[n / 2]) / 2.0,
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    const LITERAL: PeakOptions = PeakOptions {
        half_width: 2,
        background: Background::None,
    };

    #[test]
    fn a_median_is_in_the_middle() {
        assert_eq!(median([5.0, 1.0, 9.0, 3.0, 40.0].iter()), 5.0);
        assert_eq!(median([5.0, 1.0, 9.0, 3.0, 40.0, 8.0].iter()), 6.5);
        assert_eq!(median([2.0, 4.0].iter()), 3.0);
        assert_eq!(median([].iter()), 0.0);
    }

    #[test]
    fn equation_28_by_hand() {
        // Bins 1 to 5 around the peak, in the thesis's count from 1 bins 2 to 6:
        // (2·2 + 3·4 + 4·10 + 5·6 + 6·3) / 25 = 104 / 25 = 4.16, which is 3.16 from 0.
        let peak = interpolate(&[9, 2, 4, 10, 6, 3, 1], &LITERAL).unwrap();
        assert_eq!(peak.peak_bin, 3);
        assert!((peak.position_bins - 3.16).abs() < 1e-12);
        assert_eq!(peak.signal_counts, 25.0);
        assert_eq!(peak.background_per_bin, 0.0);
    }

    #[test]
    fn the_median_outside_the_peak_is_taken_off() {
        // Outside bins 2 to 6 stand 5, 7, 6, 4: median 5.5. Left: 0, 4.5, 14.5, 0.5, 0.
        let counts = [5, 7, 5, 10, 20, 6, 3, 6, 4];
        let peak = interpolate(&counts, &PeakOptions::default()).unwrap();
        assert_eq!(peak.background_per_bin, 5.5);
        assert_eq!(peak.signal_counts, 19.5);
        let expected = (3.0 * 4.5 + 4.0 * 14.5 + 5.0 * 0.5) / 19.5;
        assert!((peak.position_bins - expected).abs() < 1e-12);
    }

    #[test]
    fn background_pulls_the_literal_equation_but_not_the_default() {
        let mut counts = [100u32; 16];
        counts[9] += 300;
        counts[10] += 300;
        let literal = interpolate(&counts, &LITERAL).unwrap().position_bins;
        let default = interpolate(&counts, &PeakOptions::default()).unwrap();
        assert!((default.position_bins - 9.5).abs() < 1e-12);
        assert!((literal - 9.5).abs() > 0.1, "{literal}");
    }

    #[test]
    fn nothing_to_find_is_none() {
        let default = PeakOptions::default();
        assert_eq!(interpolate(&[], &default), None);
        assert_eq!(interpolate(&[0], &default), None);
        assert_eq!(interpolate(&[0; 16], &LITERAL), None);
        assert_eq!(interpolate(&[7; 16], &default), None);
    }

    #[test]
    fn a_single_bin_is_its_own_peak() {
        let peak = interpolate(&[3], &PeakOptions::default()).unwrap();
        assert_eq!((peak.position_bins, peak.signal_counts), (0.0, 3.0));
    }

    #[test]
    fn of_equal_bins_the_earliest_is_the_peak() {
        let options = PeakOptions {
            half_width: 0,
            ..LITERAL
        };
        assert_eq!(interpolate(&[1, 8, 3, 8], &options).unwrap().peak_bin, 1);
    }

    #[test]
    fn the_largest_counts_and_widths_do_not_overflow() {
        let options = PeakOptions {
            half_width: usize::MAX,
            background: Background::Median,
        };
        let peak = interpolate(&[u32::MAX; 16], &options).unwrap();
        assert!((peak.position_bins - 7.5).abs() < 1e-9);
        assert_eq!(peak.signal_counts, 16.0 * f64::from(u32::MAX));
    }

    proptest! {
        #[test]
        fn a_symmetric_peak_is_at_its_centre(
            near in 0u32..1000, far in 0u32..1000, floor in 0u32..50, centre in 2usize..14,
        ) {
            let mut counts = [floor; 16];
            let top = near.max(far) + floor + 1;
            counts[centre] = top;
            for (distance, extra) in [(1, near), (2, far)] {
                counts[centre - distance] = floor + extra;
                counts[centre + distance] = floor + extra;
            }
            for background in [Background::None, Background::Median] {
                let options = PeakOptions { half_width: 2, background };
                if let Some(peak) = interpolate(&counts, &options) {
                    prop_assert!((peak.position_bins - centre as f64).abs() < 1e-9);
                }
            }
        }

        #[test]
        fn a_shifted_histogram_has_a_shifted_peak(
            body in prop::collection::vec(0u32..10_000, 1..12), shift in 0usize..20,
        ) {
            let padded = |before: usize| {
                let mut counts = vec![0; 2 + before];
                counts.extend(&body);
                counts.extend(vec![0; 22 - before]);
                interpolate(&counts, &PeakOptions::default())
            };
            match (padded(0), padded(shift)) {
                (Some(here), Some(there)) => {
                    let moved = there.position_bins - here.position_bins;
                    prop_assert!((moved - shift as f64).abs() < 1e-9);
                    prop_assert_eq!(here.signal_counts, there.signal_counts);
                }
                (here, there) => prop_assert_eq!(here, there),
            }
        }

        #[test]
        fn the_peak_lies_within_its_region(
            counts in prop::collection::vec(any::<u32>(), 0..40), half_width in 0usize..6,
        ) {
            for background in [Background::None, Background::Median] {
                if let Some(peak) = interpolate(&counts, &PeakOptions { half_width, background }) {
                    let offset = (peak.position_bins - peak.peak_bin as f64).abs();
                    prop_assert!(offset <= half_width as f64 + 1e-9);
                    prop_assert!((-1e-9..=counts.len() as f64).contains(&peak.position_bins));
                }
            }
        }
    }
}
