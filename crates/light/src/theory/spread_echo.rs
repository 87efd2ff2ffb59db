//! Probability of detection of an echo that spreads over several bins.
//!
//! [`detection`](super::detection) puts the whole echo into one bin, as thesis 3.2.2 does. A pulse as long as a bin fills two or three, each
//! with less. Here every bin gets its share of a Gaussian pulse, and all places of the pulse within a bin are equally likely. The peak is right
//! if the middle of its bin is within a bin of the echo, or within half the pulse's width (FWHM) where that is more.
//!
//! ```text
//!          ┌──┐                  P = Σⱼ Σₓ p_j(x) ∫₀¹ Πₖ (P(N_k < x) + u·p_k(x)) du,   k ≠ j, j right
//!    ┌──┬──┤  ├──┬──┬──┐
//!    └──┴──┴──┴──┴──┴──┘         u draws the winner among equal counts by lot
//!        right bins: ▔▔▔▔▔
//! ```
//!
//! Checked against histograms drawn at random. Error: up to 0.005 from sixteen places in half a bin, since the number of right bins changes
//! in a step; 10⁻⁶ from sums over every sixth of a standard deviation where counts are many.

use std::f64::consts::LN_2;

use super::counts::{Counts, Stride, Tails};
use super::cycles::search;
use super::detection::Detection;
use crate::numerics::{gauss_legendre, normal_above};

/// Places of the echo in half a bin; the other half is its mirror image.
const PLACES: u32 = 16;

/// Grid points per standard deviation where means are large.
const POINTS_PER_SIGMA: f64 = 6.0;

/// ln of the probabilities of counts that are left out.
const LN_LEFT_OUT: f64 = -45.0;

/// A share of the echo below which a bin counts as background.
const LEAST_SHARE: f64 = 1e-9;

/// What counts in a bin.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Hits {
    /// One hit a laser cycle, as in this chip.
    OneACycle,
    /// Every photon.
    All,
}

/// An echo in the middle of a window, with the light of one laser cycle.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct SpreadEcho {
    /// Photons of the echo in a laser cycle.
    pub signal: f64,
    /// Photons of the background in a laser cycle and bin.
    pub background: f64,
    /// Bins of the window, ≥ 1.
    pub bins: u32,
    /// Standard deviation of the pulse, in bins, ≥ 0.
    pub sigma_bins: f64,
}

/// Bins of equal light.
struct Alike {
    share: f64,
    right: bool,
    number: u32,
}

impl SpreadEcho {
    /// Probability that the fullest bin is right after `cycles` laser cycles. Equal counts are decided by lot.
    pub fn detection(&self, cycles: u64, hits: Hits) -> Detection {
        let (mut hit, mut miss) = (0.0, 0.0);
        for place in 0..PLACES {
            let (h, m) = self.at_place(self.place(place), cycles, hits);
            hit += h / f64::from(PLACES);
            miss += m / f64::from(PLACES);
        }
        Detection::new(hit, miss)
    }

    /// The smallest number of laser cycles from which on [`Self::detection`] is at least `target` (0 to 1, exclusive); `None` if that takes
    /// more than 10¹⁰ counts in a bin, or for ever.
    pub fn laser_cycles_for(&self, target: f64, hits: Hits) -> Option<u64> {
        if self.signal <= 0.0 {
            return None;
        }
        let reaches = |cycles| self.detection(cycles, hits).probability >= target;
        search(self.signal + self.background, reaches)
    }

    /// Share of the echo in its fullest bin, on average over its place.
    pub fn fullest_share(&self) -> f64 {
        let fullest = |place| {
            let shares = self.alike(self.place(place));
            shares.iter().map(|a| a.share).fold(0.0, f64::max)
        };
        (0..PLACES).map(fullest).sum::<f64>() / f64::from(PLACES)
    }

    fn place(&self, k: u32) -> f64 {
        f64::from(self.bins / 2) + (f64::from(k) + 0.5) / (2.0 * f64::from(PLACES))
    }

    /// The bins, when the echo is `at` bins after the window's start.
    fn alike(&self, at: f64) -> Vec<Alike> {
        let fwhm = self.sigma_bins * (8.0 * LN_2).sqrt();
        let mut groups: Vec<Alike> = Vec::new();
        for bin in 0..self.bins {
            let from = f64::from(bin) - at;
            let share = normal_between(from, from + 1.0, self.sigma_bins);
            let share = if share < LEAST_SHARE { 0.0 } else { share };
            let right = (from + 0.5).abs() <= (0.5 * fwhm).max(1.0);
            match groups
                .iter_mut()
                .find(|g| g.share == share && g.right == right)
            {
                Some(group) => group.number += 1,
                None => groups.push(Alike {
                    share,
                    right,
                    number: 1,
                }),
            }
        }
        groups
    }

    /// P(the peak is right) and P(it is not), for an echo `at` a place.
    fn at_place(&self, at: f64, cycles: u64, hits: Hits) -> (f64, f64) {
        let mut bins: Vec<(Alike, Counts)> = (self.alike(at).into_iter())
            .map(|bin| {
                let photons = bin.share * self.signal + self.background;
                let counts = match hits {
                    Hits::All => Counts::poisson(photons * cycles as f64, 0.0),
                    Hits::OneACycle => Counts::Bernoulli {
                        cycles,
                        photons_per_cycle: photons,
                    },
                };
                (bin, counts)
            })
            .collect();
        let ranges: Vec<(u64, u64)> = (bins.iter())
            .map(|(_, counts)| counts.likely(LN_LEFT_OUT))
            .collect();
        // The peak is at least what its fullest bin surely has; bins that never reach that cannot win.
        let first = ranges.iter().map(|r| r.0).max().unwrap_or(0);
        let last = ranges.iter().map(|r| r.1).max().unwrap_or(0);
        let mut reaches = ranges.iter().map(|r| r.1 >= first);
        bins.retain(|_| reaches.next() == Some(true));
        let sigma = bins
            .iter()
            .map(|(_, c)| c.sigma())
            .fold(f64::INFINITY, f64::min);
        let stride = Stride::smooth(sigma, POINTS_PER_SIGMA);
        let tables: Vec<(Alike, Tails)> = (bins.into_iter())
            .map(|(bin, counts)| (bin, Tails::new(&counts, first, last, stride)))
            .collect();
        let (mut hit, mut miss) = (0.0, 0.0);
        for x in 0..tables[0].1.at.len() {
            let here = |u: f64, tails: &Tails| tails.below[x] + u * tails.at[x];
            // Everybody is at or below x, and a bin that is right, or one that is not, has x and the best lot.
            let wins = |right: bool, u: f64| {
                let factors = tables
                    .iter()
                    .map(|(bin, tails)| here(u, tails).powi(bin.number as i32));
                let all: f64 = factors.product();
                let winners = tables.iter().filter(|(bin, _)| bin.right == right);
                let each = winners.map(|(bin, tails)| {
                    if tails.at[x] > 0.0 {
                        f64::from(bin.number) * tails.at[x] / here(u, tails)
                    } else {
                        0.0
                    }
                });
                all * each.sum::<f64>()
            };
            let right = self.by_lot(|u| wins(true, u));
            let wrong = self.by_lot(|u| wins(false, u));
            hit += right * stride.counts as f64;
            miss += wrong * stride.counts as f64;
        }
        (hit, miss)
    }

    /// ∫₀¹ of a polynomial in u of a degree below the number of bins: exact up to 32 of them, one panel for every 32.
    fn by_lot(&self, f: impl Fn(f64) -> f64) -> f64 {
        let panels = self.bins.div_ceil(32);
        let edge = |k: u32| f64::from(k) / f64::from(panels);
        (0..panels)
            .map(|k| gauss_legendre(&f, edge(k), edge(k + 1)))
            .sum()
    }
}

/// Share of a Gaussian of deviation `sigma` about 0 between `from` and `to`.
fn normal_between(from: f64, to: f64, sigma: f64) -> f64 {
    if sigma <= 0.0 {
        return f64::from(u8::from(from <= 0.0 && 0.0 < to));
    }
    // From the nearer tail, so that small shares keep their digits.
    if from + to > 0.0 {
        normal_above(from / sigma) - normal_above(to / sigma)
    } else {
        normal_above(-to / sigma) - normal_above(-from / sigma)
    }
}

#[cfg(test)]
mod tests {
    use proptest::prelude::*;

    use super::*;
    use crate::theory::detection::{DetectionModel, PerCycle, Ties, probability};

    fn echo(signal: f64, background: f64, sigma_bins: f64) -> SpreadEcho {
        SpreadEcho {
            signal,
            background,
            bins: 16,
            sigma_bins,
        }
    }

    /// Histograms drawn photon by photon: the share of those whose peak is right.
    fn drawn(echo: &SpreadEcho, cycles: u64, hits: Hits, trials: u32) -> f64 {
        use rand_philox::{philox4x32_10, u32_to_unit_f64};
        let mut draws = 0;
        let mut random = || {
            draws += 1;
            u32_to_unit_f64(philox4x32_10([draws, 0, 0, 0], [7, 0])[0])
        };
        let mut right = 0.0;
        for _ in 0..trials {
            let at = 8.0 + random();
            let mut counts = [0u64; 16];
            for (bin, count) in counts.iter_mut().enumerate() {
                let from = bin as f64 - at;
                let share = normal_between(from, from + 1.0, echo.sigma_bins);
                let mean = share * echo.signal + echo.background;
                for _ in 0..cycles {
                    // Poisson by multiplication of uniform numbers.
                    let (mut left, mut photons) = (random(), 0);
                    while left > libm::exp(-mean) {
                        left *= random();
                        photons += 1;
                    }
                    *count += match hits {
                        Hits::All => photons,
                        Hits::OneACycle => photons.min(1),
                    };
                }
            }
            let peak = *counts.iter().max().unwrap();
            let tied: Vec<usize> = (0..16).filter(|&bin| counts[bin] == peak).collect();
            let winner = tied[(random() * tied.len() as f64) as usize % tied.len()];
            let within = (0.5 * echo.sigma_bins * (8.0 * LN_2).sqrt()).max(1.0);
            right += f64::from(u8::from((winner as f64 + 0.5 - at).abs() <= within));
        }
        right / f64::from(trials)
    }

    #[test]
    fn histograms_drawn_photon_by_photon_are_right_as_often() {
        let trials = 4000;
        for (signal, background, sigma, cycles) in [
            (0.05, 0.02, 0.3, 60),
            (0.05, 0.02, 1.9, 60),
            (0.5, 0.3, 0.7, 30),
            (0.01, 0.05, 0.5, 200),
            (0.2, 0.0, 0.05, 10),
        ] {
            for hits in [Hits::All, Hits::OneACycle] {
                let echo = echo(signal, background, sigma);
                let found = echo.detection(cycles, hits);
                let share = drawn(&echo, cycles, hits, trials);
                let sigma_of_share = (0.25 / f64::from(trials)).sqrt();
                assert!(
                    (found.probability - share).abs() < 4.0 * sigma_of_share,
                    "{echo:?} {hits:?}: {} drawn {share}",
                    found.probability
                );
            }
        }
    }

    proptest! {
        #![proptest_config(ProptestConfig::with_cases(24))]
        #[test]
        fn probabilities_add_up_to_one(
            signal in 0.0f64..2.0, background in 1e-4f64..1.0, sigma in 0.0f64..3.0, ln_cycles in 0.0f64..12.0,
        ) {
            let echo = echo(signal, background, sigma);
            let cycles = libm::exp(ln_cycles) as u64;
            for hits in [Hits::All, Hits::OneACycle] {
                let (hit, miss) = echo.at_place(8.3, cycles, hits);
                prop_assert!((hit + miss - 1.0).abs() < 1e-6, "{} {}", hit, miss);
            }
        }

        #[test]
        fn a_short_pulse_is_at_least_as_likely_as_one_bin_of_equation_17(
            signal in 0.01f64..1.0, background in 0.001f64..0.5, cycles in 1u64..3000,
        ) {
            let short = echo(signal, background, 0.0).detection(cycles, Hits::OneACycle);
            let light = PerCycle { signal, background, bins: 16 };
            let one_bin = probability(&light, cycles, DetectionModel::Bernoulli(Ties::Random));
            // The neighbour's lucky peak counts as right too, one of fifteen.
            let neighbour = one_bin.miss / 15.0;
            prop_assert!((short.probability - one_bin.probability - neighbour).abs() < 1e-6);
        }

        #[test]
        fn a_longer_pulse_that_fits_its_bins_is_found_less_often(signal in 0.05f64..0.2, cycles in 50u64..500) {
            let found = |sigma| echo(signal, 0.05, sigma).detection(cycles, Hits::OneACycle);
            prop_assert!(found(0.8).probability <= found(0.2).probability + 1e-9);
        }
    }

    /// With one hit a laser cycle very bright light fills the neighbours too, and equal counts are decided by lot.
    #[test]
    fn very_bright_echoes_are_found_photon_by_photon_and_are_a_lot_in_full_bins() {
        for signal in [100.0, 1e4, 1e8] {
            let detection = |hits| echo(signal, 0.1, 0.3).detection(200, hits);
            assert!(detection(Hits::All).probability > 0.999_999, "{signal}");
            let full = detection(Hits::OneACycle);
            assert!(
                full.probability > 0.3 && full.probability <= 1.0,
                "{signal} {full:?}"
            );
        }
    }

    /// Against 256 places in half a bin.
    #[test]
    fn its_places_are_enough() {
        for (sigma, error) in [(0.05, 5e-3), (0.3, 1e-4), (0.9, 5e-3), (1.9, 5e-3)] {
            let echo = echo(0.05, 0.05, sigma);
            let detection_at =
                |k: u32| echo.at_place(8.0 + (f64::from(k) + 0.5) / 512.0, 100, Hits::OneACycle);
            let many = (0..256).map(|k| detection_at(k).0).sum::<f64>() / 256.0;
            let found = echo.detection(100, Hits::OneACycle).probability;
            assert!((found - many).abs() < error, "{sigma}: {found} {many}");
        }
    }

    #[test]
    fn laser_cycles_are_the_fewest() {
        let echo = echo(0.02, 0.05, 0.6);
        let cycles = echo.laser_cycles_for(0.99, Hits::OneACycle).unwrap();
        let probability = |cycles| echo.detection(cycles, Hits::OneACycle).probability;
        assert!(
            probability(cycles) >= 0.99 && probability(cycles - 1) < 0.99,
            "{cycles}"
        );
        assert_eq!(
            SpreadEcho {
                signal: 0.0,
                ..echo
            }
            .laser_cycles_for(0.99, Hits::All),
            None
        );
    }
}
