//! What a detector should count in known light, and whether counts are such.
//!
//! ```text
//!   every photon   mean of bin i = λᵢ                                λᵢ photons of all laser cycles in bin i
//!   first photon   mean of bin i = N·e^(−Λ₀ − … − Λᵢ₋₁)·(1 − e^(−Λᵢ))   Λᵢ photons of a laser cycle, N laser cycles
//! ```
//!
//! Counts are compared by χ²: bins are put together with the next ones until five counts are expected. Where only first photons count,
//! laser cycles without any are a further cell. Source: Pearson 1900; five is the usual least (Cochran 1954).

use super::{Counted, Detector};
use crate::numerics::intervals::chi_squared_above;
use crate::numerics::normal_above;
use crate::units::SPEED_OF_LIGHT_M_PER_S;

/// Counts that a cell must expect.
const LEAST_EXPECTED: f64 = 5.0;

/// Light of one surface before a background that does not change.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct SurfaceLight {
    /// Distance of the surface, m.
    pub depth_m: f64,
    /// Photons of its echo in all laser cycles.
    pub photons: f64,
    /// Background photons in all bins and all laser cycles.
    pub background: f64,
}

/// How well counts agree with what was expected.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Agreement {
    /// Sum of squared deviations, each over its variance.
    pub chi_squared: f64,
    /// Cells that are compared.
    pub cells: usize,
    /// Chance that counts of the expected light deviate at least as much.
    pub p: f64,
}

impl Detector {
    /// The mean of each bin.
    pub fn expected(&self, light: &SurfaceLight) -> Vec<f64> {
        let flight_s = 2.0 * light.depth_m / SPEED_OF_LIGHT_M_PER_S;
        let place_bins = (flight_s - self.begins_s) / self.bin_s;
        let sigma_bins = (self.pulse_sigma_s / self.bin_s).max(f64::MIN_POSITIVE);
        let until = |edge: usize| normal_above((place_bins - edge as f64) / sigma_bins);
        let photons = (0..self.bins).map(|bin| {
            let share = until(bin + 1) - until(bin);
            light.photons * share + light.background / self.bins as f64
        });
        match self.counted {
            Counted::EveryPhoton => photons.collect(),
            Counted::FirstPhoton { laser_cycles } => {
                let all = f64::from(laser_cycles);
                let mut left = all;
                let first = |photons: f64| {
                    let counted = left * -libm::expm1(-photons / all);
                    left -= counted;
                    counted
                };
                photons.map(first).collect()
            }
        }
    }

    /// Whether `counts` are what a detector has that expects these means.
    pub fn agreement(&self, counts: &[u32], expected: &[f64]) -> Agreement {
        debug_assert_eq!(counts.len(), expected.len());
        let mut cells: Vec<(f64, f64)> = Vec::new();
        let (mut counted, mut mean) = (0.0, 0.0);
        for (&count, &bin) in counts.iter().zip(expected) {
            counted += f64::from(count);
            mean += bin;
            if mean >= LEAST_EXPECTED {
                cells.push((counted, mean));
                (counted, mean) = (0.0, 0.0);
            }
        }
        // What is left belongs to the last cell, or is the only one.
        match cells.last_mut() {
            Some(last) => *last = (last.0 + counted, last.1 + mean),
            None => cells.push((counted, mean)),
        }
        let mut freedom = cells.len();
        if let Counted::FirstPhoton { laser_cycles } = self.counted {
            let sum = |of: fn(&(f64, f64)) -> f64| cells.iter().map(of).sum::<f64>();
            let without = f64::from(laser_cycles) - sum(|cell| cell.1);
            let counted = f64::from(laser_cycles) - sum(|cell| cell.0);
            if without >= LEAST_EXPECTED {
                cells.push((counted, without));
            } else {
                freedom -= 1;
            }
        }
        let square = |&(counted, mean): &(f64, f64)| {
            let off = counted - mean;
            if mean > 0.0 {
                off * off / mean
            } else if off == 0.0 {
                0.0
            } else {
                f64::INFINITY
            }
        };
        let chi_squared: f64 = cells.iter().map(square).sum();
        Agreement {
            chi_squared,
            cells: cells.len(),
            p: chi_squared_above(chi_squared, freedom.max(1)),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::super::tests::{BINS, FIRST, LASER_CYCLES, detector, histogram};
    use super::*;
    use rand::SeedableRng;
    use rand::rngs::StdRng;

    /// Light of `signal` and `background` photons a laser cycle at a place in bins.
    fn light(
        detector: &Detector,
        (place_bins, signal, background): (f64, f64, f64),
    ) -> SurfaceLight {
        let flight_s = detector.begins_s + (place_bins + 0.5) * detector.bin_s;
        SurfaceLight {
            depth_m: 0.5 * SPEED_OF_LIGHT_M_PER_S * flight_s,
            photons: signal * f64::from(LASER_CYCLES),
            background: background * f64::from(LASER_CYCLES),
        }
    }

    #[test]
    fn counts_drawn_photon_by_photon_agree_and_those_of_other_light_do_not() {
        let mut random = StdRng::seed_from_u64(3);
        for counted in [Counted::EveryPhoton, FIRST] {
            let detector = detector(counted);
            let (mut low, mut high) = (0, 0);
            const REPEATS: usize = 100;
            for repeat in 0..REPEATS {
                // Few photons, so that one of twenty that may come is nearly a Poisson number.
                let place = (20.0 + 0.29 * repeat as f64, 0.1, 0.2);
                let counts = histogram(&mut random, &detector, place);
                let expected = detector.expected(&light(&detector, place));
                let found = detector.agreement(&counts, &expected);
                low += usize::from(found.p < 0.05);
                high += usize::from(found.p > 0.95);
                // A bin too late, and twice as much background.
                for other in [(place.0 + 1.0, 0.1, 0.2), (place.0, 0.1, 0.4)] {
                    let expected = detector.expected(&light(&detector, other));
                    assert!(detector.agreement(&counts, &expected).p < 1e-4, "{other:?}");
                }
            }
            // Five each are expected; the numbers drawn spread a little less than Poisson numbers.
            assert!((0..=12).contains(&low), "{counted:?}: {low}");
            assert!((1..=16).contains(&high), "{counted:?}: {high}");
        }
    }

    #[test]
    fn first_photons_are_no_more_than_laser_cycles() {
        let first = detector(FIRST);
        let bright = first.expected(&light(&first, (30.0, 5.0, 8.0)));
        let all: f64 = bright.iter().sum();
        assert!(all < f64::from(LASER_CYCLES) && all > 0.999 * f64::from(LASER_CYCLES));
        let every = detector(Counted::EveryPhoton);
        let same = every.expected(&light(&every, (30.0, 5.0, 8.0)));
        assert!((same.iter().sum::<f64>() / f64::from(LASER_CYCLES) - 13.0).abs() < 1e-9);
        assert_eq!(same.len(), BINS);
    }

    #[test]
    fn counts_where_none_can_be_do_not_agree() {
        let every = detector(Counted::EveryPhoton);
        let mut counts = vec![0; BINS];
        assert_eq!(every.agreement(&counts, &[0.0; BINS]).p, 1.0);
        counts[4] = 1;
        assert_eq!(every.agreement(&counts, &[0.0; BINS]).p, 0.0);
    }
}
