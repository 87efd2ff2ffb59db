//! How many counts a histogram bin holds: Poisson, or binomial where a bin takes one hit a cycle.
//!
//! Point probabilities follow Loader: Stirling's errors and deviances instead of factorials, so
//! that a probability of 10⁻³⁰⁰ keeps as many digits as one of 0.1. [`Tails`] adds them up from
//! both ends, never as 1 − p.

use std::f64::consts::PI;

use crate::numerics::{poisson_deviance, stirling_error};

/// Below this logarithm a probability is zero in `f64`.
const LN_TINY: f64 = -745.0;

/// Distribution of the counts of one bin after an exposure.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum Counts {
    /// Every photon counts. The mean is `mean + rest`, `rest` far below `mean`'s last digit.
    Poisson {
        /// Mean number of counts, ≥ 0.
        mean: f64,
        /// What rounding took from `mean`.
        rest: f64,
    },
    /// One hit a cycle at most: binomial with `cycles` trials.
    Bernoulli {
        /// Laser cycles.
        cycles: u64,
        /// Mean photons per cycle γ: a cycle counts with probability 1 − e^(−γ).
        photons_per_cycle: f64,
    },
}

impl Counts {
    /// Poisson counts of mean `a` + `b`, keeping what the sum of the two would round away.
    pub(crate) fn poisson(a: f64, b: f64) -> Self {
        let mean = a + b;
        let (small, large) = if a < b { (a, b) } else { (b, a) };
        Counts::Poisson {
            mean,
            rest: small - (mean - large),
        }
    }

    /// Mean counts.
    pub(crate) fn mean(&self) -> f64 {
        match *self {
            Counts::Poisson { mean, .. } => mean,
            Counts::Bernoulli {
                cycles,
                photons_per_cycle,
            } => cycles as f64 * -libm::expm1(-photons_per_cycle),
        }
    }

    /// Standard deviation of the counts.
    pub(crate) fn sigma(&self) -> f64 {
        match *self {
            Counts::Poisson { mean, .. } => mean.sqrt(),
            Counts::Bernoulli {
                photons_per_cycle, ..
            } => (self.mean() * libm::exp(-photons_per_cycle)).sqrt(),
        }
    }

    /// ln P(N = k).
    pub(crate) fn ln_probability(&self, k: u64) -> f64 {
        let x = k as f64;
        match *self {
            Counts::Poisson { mean: 0.0, .. } => certain(k == 0),
            Counts::Poisson { mean, rest } if k == 0 => -mean - rest,
            Counts::Poisson { mean, rest } => {
                let shift = rest * (x - mean) / mean;
                shift
                    - stirling_error(k)
                    - poisson_deviance(x, mean)
                    - 0.5 * libm::log(2.0 * PI * x)
            }
            Counts::Bernoulli {
                cycles,
                photons_per_cycle,
            } => ln_binomial(k, cycles, photons_per_cycle),
        }
    }

    /// P(N = k); zero below 10⁻³²³.
    pub(crate) fn probability(&self, k: u64) -> f64 {
        libm::exp(self.ln_probability(k))
    }

    /// P(N = k + 1) / P(N = k).
    fn ratio(&self, k: u64) -> f64 {
        match *self {
            Counts::Poisson { mean, .. } => mean / (k + 1) as f64,
            Counts::Bernoulli {
                cycles,
                photons_per_cycle,
            } if k < cycles => {
                (cycles - k) as f64 / (k + 1) as f64 * libm::expm1(photons_per_cycle)
            }
            // Not zero times infinity, where the light is very bright.
            Counts::Bernoulli { .. } => 0.0,
        }
    }

    /// P(N > k), summed upwards from k: quick where k is not far below the mean.
    pub(crate) fn tail_above(&self, k: u64) -> f64 {
        sum_outwards(self.probability(k), k.., |k| self.ratio(k))
    }

    /// Smallest and largest count whose probability `f64` can hold.
    pub(crate) fn support(&self) -> (u64, u64) {
        self.likely(LN_TINY)
    }

    /// Smallest and largest count whose probability is above e^`ln_least`.
    pub(crate) fn likely(&self, ln_least: f64) -> (u64, u64) {
        let possible = |k: u64| self.ln_probability(k) > ln_least;
        let most = match *self {
            Counts::Poisson { .. } => u64::MAX >> 2,
            Counts::Bernoulli { cycles, .. } => cycles,
        };
        let mode = (self.mean() as u64).min(most);
        let mut reach = 1;
        while mode + reach < most && possible(mode + reach) {
            reach *= 2;
        }
        let above = (mode + reach).min(most);
        let last = mode + count_leading(above - mode, |d| possible(mode + 1 + d));
        let first = mode - count_leading(mode, |d| possible(mode - 1 - d));
        (first, last)
    }
}

fn certain(yes: bool) -> f64 {
    if yes { 0.0 } else { f64::NEG_INFINITY }
}

/// For how many of 0, 1, …, `n` − 1 `holds` is true, when it is true for the first ones only.
fn count_leading(n: u64, holds: impl Fn(u64) -> bool) -> u64 {
    let (mut low, mut high) = (0, n);
    while low < high {
        let middle = low + (high - low) / 2;
        if holds(middle) {
            low = middle + 1;
        } else {
            high = middle;
        }
    }
    low
}

fn ln_binomial(k: u64, n: u64, photons: f64) -> f64 {
    let hit = -libm::expm1(-photons);
    if k > n {
        return f64::NEG_INFINITY;
    }
    if k == 0 {
        return -photons * n as f64;
    }
    if k == n {
        return n as f64 * libm::log(hit);
    }
    if hit == 0.0 {
        return f64::NEG_INFINITY;
    }
    let (x, y, n_f) = (k as f64, (n - k) as f64, n as f64);
    stirling_error(n)
        - stirling_error(k)
        - stirling_error(n - k)
        - poisson_deviance(x, n_f * hit)
        - poisson_deviance(y, n_f * libm::exp(-photons))
        - 0.5 * libm::log(2.0 * PI * x * (y / n_f))
}

/// A distribution on the counts `first`, `first + stride`, … up to `last` or just beyond.
#[derive(Debug, Clone)]
pub struct Tails {
    /// P(N = k).
    pub at: Vec<f64>,
    /// P(N < k).
    pub below: Vec<f64>,
    /// P(N > k).
    pub above: Vec<f64>,
}

impl Tails {
    /// Tabulates `counts`. The points between two grid points are summed by recurrence from the lower one, so no rounding travels further than
    /// one stride; those of a [`Stride::smooth`] one are those of a curve.
    pub(crate) fn new(counts: &Counts, first: u64, last: u64, stride: Stride) -> Self {
        let grid = |i: usize| first + i as u64 * stride.counts;
        let points = ((last - first).div_ceil(stride.counts) + 1) as usize;
        let at: Vec<f64> = (0..points).map(|i| counts.probability(grid(i))).collect();
        let between: Vec<f64> = (0..points)
            .map(|i| between(counts, grid(i), stride))
            .collect();
        let mut below = vec![0.0; points];
        below[0] = all_below(counts, first, stride);
        for i in 1..points {
            below[i] = below[i - 1] + at[i - 1] + between[i - 1];
        }
        let end = points - 1;
        let mut above = vec![0.0; points];
        above[end] = all_above(counts, grid(end), stride);
        for i in (0..end).rev() {
            above[i] = above[i + 1] + at[i + 1] + between[i];
        }
        Tails { at, below, above }
    }

    /// ln P(N ≤ k) at grid point `i`, accurate near 0 and near 1.
    pub(crate) fn ln_at_most(&self, i: usize) -> f64 {
        ln_of(self.below[i] + self.at[i], self.above[i])
    }

    /// ln P(N < k) at grid point `i`, accurate near 0 and near 1.
    pub(crate) fn ln_below(&self, i: usize) -> f64 {
        ln_of(self.below[i], self.above[i] + self.at[i])
    }
}

/// ln p of a probability known together with its complement.
fn ln_of(p: f64, complement: f64) -> f64 {
    if complement < 0.5 {
        libm::log1p(-complement)
    } else {
        libm::log(p)
    }
}

/// The way from one grid point to the next.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Stride {
    pub(crate) counts: u64,
    is_smooth: bool,
}

/// Strides from which on the probabilities between two grid points may be taken for a smooth curve: chosen. With a sixth of a standard deviation,
/// sums are off by less than 10⁻⁶ out to six standard deviations, and by 10⁻⁵ out to eight.
const SMOOTH: u64 = 64;

impl Stride {
    /// One with as many points to a standard deviation, summed count by count.
    pub(crate) fn exact(sigma: f64, points_per_sigma: f64) -> Self {
        Stride {
            counts: ((sigma / points_per_sigma) as u64).max(1),
            is_smooth: false,
        }
    }

    /// The same, or a little less, by a curve where the counts are many.
    pub(crate) fn smooth(sigma: f64, points_per_sigma: f64) -> Self {
        let Stride { counts, .. } = Self::exact(sigma, points_per_sigma);
        Stride {
            counts: if counts < SMOOTH {
                counts
            } else {
                counts / 4 * 4
            },
            is_smooth: counts >= SMOOTH,
        }
    }
}

/// P(k < N < k + stride): by Boole's rule and the first terms of Euler and Maclaurin's formula where the stride is long.
fn between(counts: &Counts, k: u64, stride: Stride) -> f64 {
    let Stride {
        counts: stride,
        is_smooth,
    } = stride;
    if !is_smooth {
        let mut term = counts.probability(k);
        let terms = (k..k + stride - 1).map(|k| {
            term *= counts.ratio(k);
            term
        });
        return terms.sum();
    }
    debug_assert!(stride.is_multiple_of(4), "{stride}");
    let at = [0, 1, 2, 3, 4].map(|quarter| counts.probability(k + quarter * (stride / 4)));
    let boole = 7.0 * (at[0] + at[4]) + 32.0 * (at[1] + at[3]) + 12.0 * at[2];
    let slope = |k: u64, at: f64| {
        if k == 0 || at == 0.0 {
            return 0.0;
        }
        0.5 * at * (counts.ratio(k) - 1.0 / counts.ratio(k - 1))
    };
    let slopes = slope(k + stride, at[4]) - slope(k, at[0]);
    (stride as f64 * boole / 90.0 - 0.5 * (at[0] + at[4]) + slopes / 12.0).max(0.0)
}

/// P(N < k).
fn all_below(counts: &Counts, k: u64, stride: Stride) -> f64 {
    let (mut k, mut sum) = (k, 0.0);
    while stride.is_smooth && k >= stride.counts {
        k -= stride.counts;
        let part = counts.probability(k) + between(counts, k, stride);
        sum += part;
        if part <= 1e-18 * sum {
            return sum;
        }
    }
    sum + sum_outwards(counts.probability(k), (0..k).rev(), |k| {
        1.0 / counts.ratio(k)
    })
}

/// P(N > k).
fn all_above(counts: &Counts, k: u64, stride: Stride) -> f64 {
    if !stride.is_smooth {
        return counts.tail_above(k);
    }
    let (mut k, mut sum) = (k, 0.0);
    loop {
        let part = between(counts, k, stride) + counts.probability(k + stride.counts);
        (k, sum) = (k + stride.counts, sum + part);
        if part <= 1e-18 * sum {
            return sum;
        }
    }
}

/// Sums `term`·ratio, ·ratio², … over `steps` until it no longer matters. Stops before denormal numbers, which
/// a ratio just below 1 would never shrink to nothing.
fn sum_outwards(
    mut term: f64,
    steps: impl Iterator<Item = u64>,
    ratio: impl Fn(u64) -> f64,
) -> f64 {
    let mut sum = 0.0;
    for k in steps {
        term *= ratio(k);
        sum += term;
        if term <= (1e-18 * sum).max(f64::MIN_POSITIVE) {
            break;
        }
    }
    sum
}

#[cfg(test)]
mod tests {
    use proptest::prelude::*;

    use super::*;

    proptest! {
        #![proptest_config(ProptestConfig { cases: 24, ..ProptestConfig::default() })]
        /// The sums of long strides are those of every count.
        #[test]
        fn long_strides_lose_nothing(
            ln_mean in 12.0f64..15.5,
            share in prop_oneof![Just(0.0), 0.001f64..0.9],
            points_per_sigma in prop_oneof![Just(6.0), Just(24.0)],
        ) {
            let mean = libm::exp(ln_mean) * if points_per_sigma > 6.0 { 16.0 } else { 1.0 };
            let counts = if share > 0.0 {
                Counts::Bernoulli {
                    cycles: (mean / share / (1.0 - share)) as u64,
                    photons_per_cycle: -libm::log1p(-share),
                }
            } else {
                Counts::poisson(mean, 0.0)
            };
            let stride = Stride::smooth(counts.sigma(), points_per_sigma);
            prop_assert!(stride.is_smooth, "{stride:?}");
            let reach = (8.0 * counts.sigma()) as u64;
            let middle = counts.mean() as u64;
            let (first, last) = (middle - reach, middle + reach);
            let quick = Tails::new(&counts, first, last, stride);
            let slow = Tails::new(&counts, first, last + stride.counts, Stride::exact(1.0, 1.0));
            for i in 0..quick.at.len() {
                let one = i * stride.counts as usize;
                for (quick, slow) in [(quick.below[i], slow.below[one]), (quick.above[i], slow.above[one])] {
                    let error = if slow > 1e-9 { 1e-6 } else { 1e-5 };
                    prop_assert!((quick / slow - 1.0).abs() < error, "{i}: {quick} {slow}");
                }
            }
        }
    }
}
