//! When a pulse arrived: the time by which a fraction of its counts had come.
//!
//! ```text
//!   counts ▁▁▁▁▁█▇▄▃▂▂▁▁▁▁      cumulative counts of the region, background taken off,
//!          ──────/‾‾‾‾‾‾‾‾      cross `fraction` at the arrival
//! ```
//!
//! Unlike a centre of mass it is not pulled by a long tail, and unlike a leading edge it uses most of the
//! counts: with a sharp rise and a slow fall, the pulse of a laser diode, it moves evenly from bin to bin.

use super::peak::{Peak, median};

/// The region and fraction that define an arrival.
#[derive(Debug, Clone, Copy, PartialEq)]
#[non_exhaustive]
pub struct ArrivalOptions {
    /// Bins taken before the fullest one.
    pub before: usize,
    /// Bins taken after the fullest one.
    pub after: usize,
    /// Fraction of the region's counts that must have come, between 0 and 1.
    pub fraction: f64,
}

impl Default for ArrivalOptions {
    fn default() -> Self {
        ArrivalOptions {
            before: 3,
            after: 6,
            fraction: 0.5,
        }
    }
}

/// Finds the arrival of the highest pulse in `counts`, one entry per bin, earliest first; positions as in
/// [`Peak`]: bin i covers i − ½ to i + ½.
///
/// The background is the median of the bins outside the region. `None` if no count of the region exceeds it.
pub fn arrival(counts: &[u32], options: &ArrivalOptions) -> Option<Peak> {
    debug_assert!(options.fraction > 0.0 && options.fraction < 1.0);
    let peak_bin = (0..counts.len()).rev().max_by_key(|&bin| counts[bin])?;
    let first = peak_bin.saturating_sub(options.before);
    let end = (peak_bin + options.after + 1).min(counts.len());
    let counts: Vec<f64> = counts.iter().map(|&n| f64::from(n)).collect();
    let background_per_bin = median(counts[..first].iter().chain(&counts[end..]));
    let signal = |bin: usize| (counts[bin] - background_per_bin).max(0.0);
    let signal_counts: f64 = (first..end).map(signal).sum();
    if signal_counts <= 0.0 {
        return None;
    }
    let wanted = options.fraction * signal_counts;
    let mut before = 0.0;
    let mut bin = first;
    while before + signal(bin) < wanted && bin + 1 < end {
        before += signal(bin);
        bin += 1;
    }
    let within = ((wanted - before) / signal(bin)).clamp(0.0, 1.0);
    Some(Peak {
        position_bins: bin as f64 - 0.5 + within,
        peak_bin,
        signal_counts,
        background_per_bin,
    })
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    #[test]
    fn half_of_the_counts_by_hand() {
        // Background 10; above it 4, 8, 12, 0: the 12th of 24 counts ends bin 21.
        let mut counts = [10u32; 40];
        counts[20] += 4;
        counts[21] += 8;
        counts[22] += 12;
        // Six bins after the highest end the region.
        counts[29] += 5;
        let found = arrival(&counts, &ArrivalOptions::default()).unwrap();
        assert!((found.position_bins - 21.5).abs() < 1e-12, "{found:?}");
        assert_eq!(
            (
                found.peak_bin,
                found.signal_counts,
                found.background_per_bin
            ),
            (22, 24.0, 10.0)
        );
        // The 6th of 24 is the 2nd of the 8 of bin 21.
        let quarter = ArrivalOptions {
            fraction: 0.25,
            ..ArrivalOptions::default()
        };
        let found = arrival(&counts, &quarter).unwrap();
        assert!((found.position_bins - 20.75).abs() < 1e-12, "{found:?}");
    }

    #[test]
    fn nothing_to_find_is_none() {
        let default = ArrivalOptions::default();
        assert_eq!(arrival(&[], &default), None);
        assert_eq!(arrival(&[7; 30], &default), None);
        assert!(arrival(&[0, 0, 5], &default).is_some());
    }

    proptest! {
        /// Until the arrival comes the share that is asked for, and no more: summed with the part of its bin that lies before it.
        #[test]
        fn the_share_of_the_counts_comes_before_the_arrival(
            counts in proptest::collection::vec(prop_oneof![Just(5u32), 0u32..60], 1..40),
            fraction in 0.02f64..0.98,
            before in 0usize..9,
            after in 0usize..9,
        ) {
            let options = ArrivalOptions { before, after, fraction };
            let most = *counts.iter().max().expect("a bin");
            let peak_bin = counts.iter().position(|&n| n == most).expect("the highest");
            let region = peak_bin.saturating_sub(before)..(peak_bin + after + 1).min(counts.len());
            let mut outside: Vec<u32> = (0..counts.len()).filter(|bin| !region.contains(bin)).map(|bin| counts[bin]).collect();
            outside.sort_unstable();
            let n = outside.len();
            let background = if n == 0 { 0.0 } else { f64::from(outside[(n - 1) / 2] + outside[n / 2]) / 2.0 };
            let signal = |bin: usize| (f64::from(counts[bin]) - background).max(0.0);
            let all: f64 = region.clone().map(signal).sum();
            let found = arrival(&counts, &options);
            if all == 0.0 {
                prop_assert_eq!(found, None);
                return Ok(());
            }
            let found = found.expect("a pulse");
            prop_assert_eq!((found.peak_bin, found.signal_counts, found.background_per_bin), (peak_bin, all, background));
            let part = |bin: usize| (found.position_bins - (bin as f64 - 0.5)).clamp(0.0, 1.0);
            let until: f64 = region.map(|bin| part(bin) * signal(bin)).sum();
            prop_assert!((until - fraction * all).abs() < 1e-9 * all, "{found:?}");
        }

        #[test]
        fn a_shifted_and_brighter_pulse_arrives_as_much_later(
            pulse in proptest::collection::vec(1u32..1000, 1..4),
            shift in 0usize..20,
            gain in 1u32..100,
        ) {
            let histogram = |at: usize, gain: u32| {
                let mut counts = vec![3; 60];
                for (i, &n) in pulse.iter().enumerate() {
                    counts[at + i] += gain * n;
                }
                arrival(&counts, &ArrivalOptions::default()).unwrap().position_bins
            };
            let moved = histogram(20 + shift, gain) - histogram(20, 1);
            prop_assert!((moved - shift as f64).abs() < 1e-9);
        }
    }
}
