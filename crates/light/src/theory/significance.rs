//! Whether a peak can be chance: the false-alarm probability of the fullest stretch of a histogram.
//!
//! ```text
//!   counts  ▃▂▃▂▄▃▂▃██▃▂▃▂▃▃      M bins, N laser cycles; a bin counts once a laser cycle at most
//!                   └┘            the fullest stretch of w neighbouring bins holds k of all n counts
//! ```
//!
//! Light that comes at any time alike gives each of the M·N cells (a bin in a laser cycle) the same chance to count. Given
//! that n of them did, all choices of n cells are equally likely, whatever the level of the light, so that the k
//! counts of w bins are hypergeometric: w·N cells drawn out of M·N, of which n are marked. This is Fisher's exact test
//! of the stretch against the histogram; the background level is estimated by n from the same histogram, and the
//! uncertainty of that estimate is part of the test. With few counts to a cell it is a binomial one with n trials of
//! chance w/M, that of Poisson counts with an unknown mean.
//!
//! The stretch is searched over M − w + 1 positions. The chance that any of them holds k or more is at most their number
//! times the chance of one (Bonferroni). As stretches overlap and counts are whole, that is a little too careful: of 100 000
//! simulated dark windows 0.6 to 0.9 of the stated rate alarm from ten counts a bin on, half of it at two and a third
//! at one half.
//!
//! What the test leaves out: dead time ties neighbouring bins together, but spread over 16 SPADs weakly, and makes counts more
//! even, not less. Afterpulses and crosstalk make them less even, by about their probability.

use std::f64::consts::PI;

use super::Counts;
use crate::numerics::{normal_above, poisson_deviance, stirling_error};

/// The search for the fullest stretch.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Scan {
    /// Neighbouring bins of a stretch w, at least 1 and at most those of the histogram.
    pub width: usize,
    /// Laser cycles N of the exposure.
    pub laser_cycles: u32,
}

/// The fullest stretch of a histogram.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Stretch {
    /// Its first bin; of several as full, the earliest.
    pub first: usize,
    /// Its counts k.
    pub counts: u64,
    /// ln of the chance that light without an echo makes some stretch as full, at most 0.
    pub ln_false_alarm: f64,
}

impl Scan {
    /// The width that finds a Gaussian pulse of this standard deviation (in bins) among `bins` bins with the fewest counts: its
    /// share in the best of the stretches, over the square root of their background, for an echo that may lie
    /// anywhere relative to the bins.
    pub fn matched(pulse_sigma_bins: f64, bins: usize, laser_cycles: u32) -> Self {
        // Beyond half of the histogram nothing is left to compare with.
        let most = (bins / 2).max(1);
        // 2.8 σ is the best width without bins, and rounding to them matters below some bins only.
        let about = (2.8 * pulse_sigma_bins).round().max(1.0);
        let width = if about > 8.0 {
            about.min(most as f64) as usize
        } else {
            (1..=12)
                .max_by(|&a, &b| gain(a, pulse_sigma_bins).total_cmp(&gain(b, pulse_sigma_bins)))
                .unwrap_or(1)
                .min(most)
        };
        Scan {
            width,
            laser_cycles,
        }
    }

    /// The fullest stretch of `counts`, at least [`width`](Self::width) bins. Should a bin hold more counts than there were
    /// laser cycles, as many cycles are assumed.
    pub fn fullest(&self, counts: &[u32]) -> Stretch {
        debug_assert!((1..=counts.len()).contains(&self.width));
        let sum = |counts: &[u32]| counts.iter().map(|&n| u64::from(n)).sum::<u64>();
        let stretches = counts.windows(self.width).map(sum).enumerate();
        let (first, fullest) = stretches.rev().max_by_key(|&(_, k)| k).unwrap_or_default();
        let cycles = counts.iter().copied().fold(self.laser_cycles, u32::max);
        let cells = |bins: usize| bins as u64 * u64::from(cycles);
        let ln_one =
            ln_hypergeometric_tail(fullest, sum(counts), cells(self.width), cells(counts.len()));
        let positions = (counts.len() - self.width + 1) as f64;
        Stretch {
            first,
            counts: fullest,
            ln_false_alarm: (ln_one + libm::log(positions)).min(0.0),
        }
    }
}

impl Scan {
    /// The stretch of `counts` that is least likely by chance where bins differ in length: `shares` are those of light that comes at any
    /// time alike, 1 on average over the bins. With equal ones it is [`fullest`](Self::fullest).
    pub fn least_likely(&self, counts: &[u32], shares: &[f64]) -> Stretch {
        debug_assert_eq!(counts.len(), shares.len());
        let sum = |counts: &[u32]| counts.iter().map(|&n| u64::from(n)).sum::<u64>();
        let cycles = f64::from(counts.iter().copied().fold(self.laser_cycles, u32::max));
        let (marked, cells) = (sum(counts), (counts.len() as f64 * cycles).round() as u64);
        let positions = counts.len() - self.width + 1;
        let stretch = |first: usize| {
            let bins = first..first + self.width;
            let drawn = (shares[bins.clone()].iter().sum::<f64>() * cycles).round() as u64;
            let counts = sum(&counts[bins]);
            let ln_one = ln_hypergeometric_tail(counts, marked, drawn.min(cells), cells);
            Stretch {
                first,
                counts,
                ln_false_alarm: (ln_one + libm::log(positions as f64)).min(0.0),
            }
        };
        let by_chance = |a: &Stretch, b: &Stretch| {
            let fuller = b.counts.cmp(&a.counts);
            a.ln_false_alarm.total_cmp(&b.ln_false_alarm).then(fuller)
        };
        let stretches = (0..positions).map(stretch);
        stretches
            .min_by(by_chance)
            .expect("a histogram has a stretch")
    }
}

/// Where counts come from, as means of bins: the chance of one to count in a laser cycle.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Chances {
    /// Histogram bins M.
    pub bins: usize,
    /// Of the stretch that holds the echo.
    pub stretch: f64,
    /// Of all bins beside it.
    pub beside: f64,
}

/// Standard deviations beyond which a count is taken for certain.
const CERTAIN_SIGMA: f64 = 12.0;

/// Where a mean over a normal distribution is taken, standard deviations off its middle, and the weights (Gauss and Hermite).
const NORMAL_POINTS: [(f64, f64); 3] = [
    (-1.732_050_807_568_877_2, 1.0 / 6.0),
    (0.0, 2.0 / 3.0),
    (1.732_050_807_568_877_2, 1.0 / 6.0),
];

impl Scan {
    /// The power of the test: the chance that the stretch which holds an echo is found, at a false-alarm rate e^`ln_false_alarm`.
    ///
    /// The stretch's counts are binomial. How many it takes depends on the counts beside it, over which the mean is taken as over a normal
    /// distribution. Other stretches that the echo fills are left out, so that a little more is found.
    pub fn power(&self, chances: &Chances, ln_false_alarm: f64) -> f64 {
        let cells = |bins: usize| bins as u64 * u64::from(self.laser_cycles);
        let (inside, outside) = (cells(self.width), cells(chances.bins - self.width));
        let beside = chances.beside.clamp(0.0, 1.0);
        let mean = outside as f64 * beside;
        let sigma = (mean * (1.0 - beside)).sqrt();
        let ln_one = ln_false_alarm - libm::log((chances.bins - self.width + 1) as f64);
        let powers = NORMAL_POINTS.map(|(off, weight)| {
            let rest = (mean + off * sigma).clamp(0.0, outside as f64).round() as u64;
            let least = least_significant(inside, outside, rest, ln_one);
            weight * least.map_or(0.0, |least| at_least(least, inside, chances.stretch))
        });
        powers.iter().sum::<f64>().min(1.0)
    }
}

/// The fewest counts in `inside` cells, beside `rest` in `outside` cells, of which chance makes as many no more often than e^`ln_one`.
fn least_significant(inside: u64, outside: u64, rest: u64, ln_one: f64) -> Option<u64> {
    let is_enough =
        |k: u64| ln_hypergeometric_tail(k, k + rest, inside, inside + outside) <= ln_one;
    // As many as the others have on average are not.
    let usual = rest as f64 * (inside as f64 / outside as f64);
    let (mut failed, mut reach) = (usual as u64, 4 + usual.sqrt() as u64);
    while !is_enough((failed + reach).min(inside)) {
        if failed + reach >= inside {
            return None;
        }
        (failed, reach) = (failed + reach, 2 * reach);
    }
    let mut enough = (failed + reach).min(inside);
    while enough - failed > 1 {
        let middle = failed + (enough - failed) / 2;
        if is_enough(middle) {
            enough = middle
        } else {
            failed = middle
        }
    }
    Some(enough)
}

/// The chance of `least` or more counts (at least 1) in so many cells.
fn at_least(least: u64, cells: u64, chance: f64) -> f64 {
    let chance = chance.clamp(0.0, 1.0 - 1e-12);
    let mean = cells as f64 * chance;
    let sigma = (mean * (1.0 - chance)).sqrt();
    if mean - least as f64 > CERTAIN_SIGMA * (1.0 + sigma) {
        return 1.0;
    }
    let counts = Counts::Bernoulli {
        cycles: cells,
        photons_per_cycle: -libm::log1p(-chance),
    };
    counts.tail_above(least - 1)
}

/// Share of a pulse in the best of all stretches of `width` bins, averaged over where it lies, over √width.
fn gain(width: usize, sigma_bins: f64) -> f64 {
    const STEPS: usize = 16;
    let half = width as f64 / 2.0;
    let share = |off: f64| {
        if sigma_bins > 0.0 {
            normal_above((off - half) / sigma_bins) - normal_above((off + half) / sigma_bins)
        } else {
            1.0
        }
    };
    let offs = (0..STEPS).map(|i| (i as f64 + 0.5) / (2 * STEPS) as f64);
    offs.map(share).sum::<f64>() / STEPS as f64 / (width as f64).sqrt()
}

/// ln P(K ≥ k) for the marked among `drawn` out of `cells` cells, `marked` of which are marked.
///
/// Summed upwards from k, so that it keeps its digits however small it is; up to the mean, where it says nothing, it is
/// taken as 0. Accurate to about 10⁻¹².
pub(crate) fn ln_hypergeometric_tail(k: u64, marked: u64, drawn: u64, cells: u64) -> f64 {
    debug_assert!(marked <= cells && drawn <= cells);
    let most = marked.min(drawn);
    if k > most {
        return f64::NEG_INFINITY;
    }
    if k as f64 <= marked as f64 * (drawn as f64 / cells as f64) {
        return 0.0;
    }
    let unmarked = cells - marked;
    let (mut term, mut sum) = (1.0, 1.0);
    for x in k..most {
        let left = (unmarked + x + 1) as f64 - drawn as f64;
        term *= (marked - x) as f64 * (drawn - x) as f64 / ((x + 1) as f64 * left);
        sum += term;
        if term < 1e-17 * sum {
            break;
        }
    }
    (ln_hypergeometric(k, marked, drawn, cells) + libm::log(sum)).min(0.0)
}

/// ln P(K = k), as three binomials of the same chance (Loader).
fn ln_hypergeometric(k: u64, marked: u64, drawn: u64, cells: u64) -> f64 {
    let share = drawn as f64 / cells as f64;
    ln_binomial(k, marked, share) + ln_binomial(drawn - k, cells - marked, share)
        - ln_binomial(drawn, cells, share)
}

fn ln_binomial(k: u64, n: u64, p: f64) -> f64 {
    let (x, y, n_f) = (k as f64, (n - k) as f64, n as f64);
    match (k, n - k) {
        (0, 0) => 0.0,
        (0, _) => y * libm::log1p(-p),
        (_, 0) => x * libm::log(p),
        _ => {
            stirling_error(n)
                - stirling_error(k)
                - stirling_error(n - k)
                - poisson_deviance(x, n_f * p)
                - poisson_deviance(y, n_f * (1.0 - p))
                - 0.5 * libm::log(2.0 * PI * x * (y / n_f))
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    /// By counting all choices: Σ C(marked, x)·C(unmarked, drawn − x) / C(cells, drawn).
    fn by_counting(k: u64, marked: u64, drawn: u64, cells: u64) -> f64 {
        let choose = |n: u64, r: u64| -> f64 {
            if r <= n {
                (0..r).map(|i| (n - i) as f64 / (i + 1) as f64).product()
            } else {
                0.0
            }
        };
        let ways = |x: u64| {
            if x <= drawn {
                choose(marked, x) * choose(cells - marked, drawn - x)
            } else {
                0.0
            }
        };
        (k..=marked).map(ways).sum::<f64>() / choose(cells, drawn)
    }

    #[test]
    fn a_tea_tasting_by_hand() {
        // Fisher's lady: 4 of 8 cups have the milk first; all four are found by chance once in 70 times.
        let chance = ln_hypergeometric_tail(4, 4, 4, 8).exp();
        assert!((chance - 1.0 / 70.0).abs() < 1e-15);
        assert!((ln_hypergeometric_tail(3, 4, 4, 8).exp() - 17.0 / 70.0).abs() < 1e-15);
    }

    #[test]
    fn many_cells_are_a_binomial() {
        // 40 of 100 counts in one of 16 bins: Σ C(100, x) 15^(100 − x) / 16^100 from 40 on, with Python's fractions.
        let ln = ln_hypergeometric_tail(40, 100, 1 << 40, 1 << 44);
        assert!((ln - BINOMIAL_40_OF_100).abs() < 1e-9, "{ln}");
    }

    /// ln of that sum.
    const BINOMIAL_40_OF_100: f64 = -49.883_105_316_057_19;

    #[test]
    fn the_fullest_stretch_is_the_earliest_and_its_chance_that_of_all_positions() {
        let scan = Scan {
            width: 2,
            laser_cycles: 10,
        };
        let found = scan.fullest(&[1, 0, 6, 4, 0, 4, 6, 1]);
        assert_eq!((found.first, found.counts), (2, 10));
        let one = by_counting(10, 22, 20, 80);
        assert!((found.ln_false_alarm - (7.0 * one).ln()).abs() < 1e-12);
        for nothing in [[0; 8], [10; 8]] {
            assert_eq!(scan.fullest(&nothing).ln_false_alarm, 0.0);
        }
    }

    /// The power beside the test itself on histograms that are drawn: four standard errors of 4000, and as much again of the
    /// stretches that are left out.
    #[test]
    fn the_power_is_how_often_drawn_echoes_are_found() {
        use crate::photon::{Poisson, RandomPurpose, random_stream};
        let ln_false_alarm = 1e-3f64.ln();
        for (bins, stretch, beside, laser_cycles) in [
            (16, 0.049, 0.04, 8000u32),
            (16, 0.0008, 0.0, 6000),
            (8, 0.0125, 0.01, 20_000),
            (64, 0.024, 0.02, 15_000),
            (4, 0.024, 0.02, 30_000),
            (4, 0.97, 0.45, 10),
        ] {
            let scan = Scan {
                width: 2,
                laser_cycles,
            };
            let chances = Chances {
                bins,
                stretch,
                beside,
            };
            let power = scan.power(&chances, ln_false_alarm);
            let runs = 4000;
            let found = (0..runs).filter(|&run| {
                let mut random = random_stream(5, RandomPurpose::Photons, run, 0);
                let counts: Vec<u32> = (0..bins)
                    .map(|bin| {
                        let chance = if bin / 2 == 1 { stretch } else { beside };
                        // One by one where a bin is nearly sure to count.
                        let counts =
                            |_: &u32| f64::from(random.next_u32()) < chance * 2f64.powi(32);
                        if laser_cycles < 100 {
                            (0..laser_cycles).filter(counts).count() as u32
                        } else {
                            Poisson::new(chance * f64::from(laser_cycles)).draw(&mut random)
                        }
                    })
                    .collect();
                let fullest = scan.fullest(&counts);
                fullest.first == 2 && fullest.ln_false_alarm <= ln_false_alarm
            });
            let share = found.count() as f64 / f64::from(runs);
            let error = (power * (1.0 - power) / f64::from(runs)).sqrt();
            assert!((0.05..0.999).contains(&power), "{power}");
            assert!(
                (share - power).abs() < 4.0 * error + 0.01,
                "{bins}: {share} {power}"
            );
        }
    }

    #[test]
    fn an_echo_that_is_none_is_not_found_and_a_strong_one_always() {
        let scan = Scan {
            width: 2,
            laser_cycles: 10_000,
        };
        let power = |stretch, beside| {
            let chances = Chances {
                bins: 16,
                stretch,
                beside,
            };
            scan.power(&chances, 1e-3f64.ln())
        };
        assert!(power(0.02, 0.02) < 1e-3);
        assert_eq!(power(0.0, 0.0), 0.0);
        assert!(power(0.5, 0.02) > 1.0 - 1e-12);
        assert_eq!(power(1.0, 1.0), 0.0);
    }

    #[test]
    fn stretches_are_as_wide_as_the_pulse_wants() {
        let width = |sigma| Scan::matched(sigma, 16, 1).width;
        assert_eq!((width(0.0), width(0.1), width(0.73)), (1, 1, 2));
        assert_eq!((width(2.0), width(100.0)), (6, 8));
        assert_eq!(Scan::matched(5.0, 1, 1).width, 1);
    }

    proptest! {
        #[test]
        fn with_equal_bins_the_least_likely_stretch_is_the_fullest(
            counts in prop::collection::vec(0u32..60, 4..20), width in 1usize..4
        ) {
            let scan = Scan { width, laser_cycles: 100 };
            let equal = vec![1.0; counts.len()];
            let (full, least) = (scan.fullest(&counts), scan.least_likely(&counts, &equal));
            prop_assert!((full.ln_false_alarm - least.ln_false_alarm).abs() < 1e-9);
            prop_assert_eq!(full.counts, least.counts);
        }

        #[test]
        fn tails_are_those_of_counting(cells in 1u64..60, marked in 0u64..60, drawn in 0u64..60, k in 0u64..60) {
            let (marked, drawn) = (marked.min(cells), drawn.min(cells));
            let wanted = by_counting(k, marked, drawn, cells);
            let got = ln_hypergeometric_tail(k, marked, drawn, cells).exp();
            if k as f64 > marked as f64 * drawn as f64 / cells as f64 {
                prop_assert!((got - wanted).abs() <= 1e-11 * wanted, "{got} {wanted}");
            } else {
                prop_assert_eq!(got, 1.0);
            }
        }
    }
}
