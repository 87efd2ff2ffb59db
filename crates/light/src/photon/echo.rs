//! The law of echoes: which photons of which laser pulse fall where.
//!
//! An exposure is N laser cycles of length T, the first of which starts at time 0. Laser cycle k, 0 ≤ k < N, sends one
//! pulse, whose echo is centred `arrival` after the cycle's start: within the cycle, before it or cycles later. No pulse
//! is ever cut. What overruns a laser cycle falls into its neighbours, as many away as it reaches; only the exposure has
//! ends, and photons outside them do not exist:
//!
//! ```text
//!   density of signal photons at t  =  Σₖ pulse(t − arrival − k·T),  k = 0 … N − 1,  where 0 ≤ t < N·T;  0 elsewhere
//!
//!   echo of         none        0           1                     N−1      none
//!                          ╱▔▔╲        ╱▔▔╲                  ╱▔▔╲
//!   ──────────────────┬───╱────╲──┬───╱────╲──┬── … ──┬─────╱────╲──┬──────────
//!   laser cycle       0           1           2      N−1            N
//! ```
//!
//! So laser cycle 0 has no tail of a cycle −1, the last one no rise of a cycle N, and all but the first and last few,
//! as many as an echo overruns, have the same light. [`EchoLaw::share`] is the law, slow and obvious; code that draws
//! or integrates photons is held to it.

use std::ops::Range;

use super::gaussian::pulse_share;

/// Standard deviations from its centre within which a Gaussian echo lies: 2·10⁻¹⁹ of it is outside.
pub const ECHO_REACH: f64 = 9.0;

/// The echoes of a Gaussian pulse. Times in femtoseconds.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct EchoLaw {
    /// Length of a laser cycle, above 0.
    pub cycle_fs: f64,
    /// Centre of an echo after the start of its laser cycle; may be negative, or longer than a laser cycle.
    pub arrival_fs: f64,
    /// Standard deviation of a photon's time, at least 0.
    pub sigma_fs: f64,
}

impl EchoLaw {
    /// Numbers of the laser cycles whose echoes reach into `[from_fs, to_fs)`, were the exposure endless: times and
    /// numbers are relative to one and the same laser cycle.
    pub fn reaching(&self, from_fs: f64, to_fs: f64) -> Range<i64> {
        let reach_fs = ECHO_REACH * self.sigma_fs;
        let first = (from_fs - self.arrival_fs - reach_fs) / self.cycle_fs;
        let last = (to_fs - self.arrival_fs + reach_fs) / self.cycle_fs;
        // A pulse without width may stand on either edge.
        first.ceil() as i64..last.floor() as i64 + 1
    }

    /// Centre of the echo of laser cycle `number`, fs.
    pub fn centre_fs(&self, number: i64) -> f64 {
        number as f64 * self.cycle_fs + self.arrival_fs
    }

    /// Photons in `[from_fs, to_fs)` after the start of laser cycle `number` of an exposure of `cycles`, as a share of
    /// those of one whole echo. In [0, 1], but for echoes that are longer than a laser cycle. Absolute error below 10⁻¹²
    /// for each echo that reaches there.
    pub fn share(&self, number: u32, cycles: u32, from_fs: f64, to_fs: f64) -> f64 {
        let (before, after) = (i64::from(number), i64::from(cycles - number));
        let from_fs = from_fs.max(-before as f64 * self.cycle_fs);
        let to_fs = to_fs.min(after as f64 * self.cycle_fs);
        if from_fs >= to_fs {
            return 0.0;
        }
        let reaching = self.reaching(from_fs, to_fs);
        (reaching.start.max(-before)..reaching.end.min(after))
            .map(|k| {
                let centre_fs = self.centre_fs(k);
                pulse_share(from_fs - centre_fs, to_fs - centre_fs, self.sigma_fs)
            })
            .sum()
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    const CYCLES: u32 = 5;

    proptest! {
        /// Nothing is lost or made: all laser cycles together hold what of all echoes is within the exposure.
        #[test]
        fn no_pulse_is_cut(
            arrival in -3.0f64..3.0,
            sigma in prop_oneof![Just(0.0), 0.001f64..3.0],
            parts in 1usize..7,
        ) {
            let law = EchoLaw { cycle_fs: 1000.0, arrival_fs: 1000.0 * arrival, sigma_fs: 1000.0 * sigma };
            let edge = |i: usize| 1000.0 * i as f64 / parts as f64;
            let held: f64 = (0..CYCLES)
                .flat_map(|n| (0..parts).map(move |i| (n, i)))
                .map(|(n, i)| law.share(n, CYCLES, edge(i), edge(i + 1)))
                .sum();
            let end_fs = f64::from(CYCLES) * 1000.0;
            let sent: f64 = (0..CYCLES)
                .map(|k| f64::from(k) * 1000.0 + law.arrival_fs)
                .map(|centre_fs| pulse_share(-centre_fs, end_fs - centre_fs, law.sigma_fs))
                .sum();
            prop_assert!((held - sent).abs() < 1e-9, "{held} {sent}");
        }

        /// The same stretch of time, told from another laser cycle, holds the same photons.
        #[test]
        fn a_time_has_the_same_light_whichever_cycle_it_is_told_from(
            arrival in -3000.0f64..3000.0,
            sigma in 0.0f64..3000.0,
            from in -2000.0f64..6000.0,
            length in 1.0f64..3000.0,
            n in 0u32..CYCLES,
        ) {
            let law = EchoLaw { cycle_fs: 1000.0, arrival_fs: arrival, sigma_fs: sigma };
            let time = |n: u32| from - 1000.0 * f64::from(n);
            let (a, b) = (law.share(0, CYCLES, time(0), time(0) + length), law.share(n, CYCLES, time(n), time(n) + length));
            prop_assert!((a - b).abs() < 1e-9, "{a} {b}");
        }
    }

    #[test]
    fn the_first_and_the_last_cycle_lack_what_their_missing_neighbours_would_spill() {
        // Half of each echo comes before its cycle's start.
        let law = EchoLaw {
            cycle_fs: 1000.0,
            arrival_fs: 0.0,
            sigma_fs: 10.0,
        };
        let shares: Vec<f64> = (0..3).map(|n| law.share(n, 3, 0.0, 1000.0)).collect();
        for (found, expected) in shares.iter().zip([1.0, 1.0, 0.5]) {
            assert!((found - expected).abs() < 1e-12, "{shares:?}");
        }
        assert_eq!(law.share(0, 3, -500.0, 0.0), 0.0);
        assert_eq!(law.share(2, 3, 1000.0, 1500.0), 0.0);
    }
}
