//! Draws that split cohorts: exact at any size, and also where probabilities are tiny.

use super::words::RandomWords;
use crate::numerics::stirling_error;

/// Above this, logarithms are quicker than factors.
const MOST_FACTORS: u64 = 4096;

/// `base` to the `exponent`, by squaring, without a branch that depends on its digits.
fn power(mut base: f64, mut exponent: u64) -> f64 {
    let mut power = 1.0;
    while exponent > 0 {
        power *= if exponent & 1 == 1 { base } else { 1.0 };
        base *= base;
        exponent >>= 1;
    }
    power
}

/// Means from which rejection is the faster way; it may not begin any earlier.
const INVERSION_MEAN: f64 = 10.0;

/// How many of `n` trials succeed, each with probability `p`; `q` is 1 − `p`.
///
/// Both are given because neither follows from the other when it is tiny. A generator that takes only p keeps few
/// digits of a small one: at p = 10⁻¹⁵ and n = 10⁹, 1 − p alone puts the mean 11 % off.
pub fn binomial(n: u64, p: f64, q: f64, random: &mut RandomWords) -> u64 {
    debug_assert!(
        p >= 0.0 && q >= 0.0 && (p + q - 1.0).abs() < 1e-12,
        "{p} + {q}"
    );
    if n == 0 || p <= 0.0 {
        return 0;
    }
    if q <= 0.0 {
        return n;
    }
    if p > q {
        return n - binomial(n, q, p, random);
    }
    if n as f64 * p < INVERSION_MEAN {
        return invert(n, p, q, random);
    }
    reject(n, p, q, random)
}

/// Rejection from a transformed uniform number with a squeeze: Hörmann's BTRS, *The generation of binomial random
/// variates*, J. Stat. Comput. Simul. 46 (1993). `n` `p` is at least 10, `p` at most a half.
fn reject(n: u64, p: f64, q: f64, random: &mut RandomWords) -> u64 {
    let trials = n as f64;
    let variance = trials * p * q;
    let deviation = variance.sqrt();
    let b = 1.15 + 2.53 * deviation;
    let a = -0.0873 + 0.0248 * b + 0.01 * p;
    let centre = trials * p + 0.5;
    let inside = 0.92 - 4.2 / b;
    loop {
        let u = random.uniform() - 0.5;
        let v = random.coarse();
        let us = 0.5 - u.abs();
        let place = (2.0 * a / us + b) * u + centre;
        // Seven draws of eight end here.
        if us >= 0.07 && v <= inside {
            return place as u64;
        }
        if !(place >= 0.0 && place < trials + 1.0) {
            continue;
        }
        let k = (place as u64) as f64;
        let alpha = (2.83 + 5.1 / b) * deviation;
        let height = libm::log(v * alpha / (a / (us * us) + b));
        let from_mode = (k - mode(trials, p)).abs();
        if from_mode < 0.5 * variance - 1.0 {
            // Bounds about the normal law settle nearly all that is left.
            let normal = -from_mode * from_mode / (2.0 * variance);
            let margin = from_mode / variance
                * (((from_mode / 3.0 + 0.625) * from_mode + 1.0 / 6.0) / variance + 0.5);
            if height <= normal - margin {
                return k as u64;
            }
            if height > normal + margin {
                continue;
            }
        }
        if height <= log_likelihood_to_mode(k, trials, p, q) {
            return k as u64;
        }
    }
}

/// The most likely of the numbers of successes.
fn mode(n: f64, p: f64) -> f64 {
    (((n + 1.0) * p) as u64) as f64
}

/// ln of the probability of `k` successes, less that of the most likely number.
fn log_likelihood_to_mode(k: f64, n: f64, p: f64, q: f64) -> f64 {
    let mode = mode(n, p);
    let odds = p / q;
    // Stirling's formula is in powers of k + 1 here, which 0! suits, too.
    let left_out = |k: f64| stirling_error(k as u64 + 1);
    (mode + 0.5) * libm::log((mode + 1.0) / (odds * (n - mode + 1.0)))
        + (n + 1.0) * libm::log((n - mode + 1.0) / (n - k + 1.0))
        + (k + 0.5) * libm::log(odds * (n - k + 1.0) / (k + 1.0))
        + left_out(mode)
        + left_out(n - mode)
        - left_out(k)
        - left_out(n - k)
}

/// Largest result of an inversion: 10 + 110 is 35 standard deviations above the largest mean.
const INVERSION_LIMIT: u64 = 120;

/// 1/k, so that the sum waits for no division.
const RECIPROCALS: [f64; INVERSION_LIMIT as usize + 1] = {
    let mut reciprocals = [f64::INFINITY; INVERSION_LIMIT as usize + 1];
    let mut k = 1;
    while k < reciprocals.len() {
        reciprocals[k] = 1.0 / k as f64;
        k += 1;
    }
    reciprocals
};

/// Sums the probabilities of 0, 1, 2, … until they exceed a uniform number.
fn invert(n: u64, p: f64, q: f64, random: &mut RandomWords) -> u64 {
    let mut left = random.uniform();
    if left <= 1.0 - n as f64 * p {
        return 0; // qⁿ is no less
    }
    let none = none_of(n, p, q);
    let odds = p / q;
    let limit = n.min(INVERSION_LIMIT);
    let mut probability = none;
    let mut k = 0;
    while left > probability && k < limit {
        left -= probability;
        k += 1;
        probability *= (n - k + 1) as f64 * odds * RECIPROCALS[k as usize];
    }
    k
}

/// Probability that none of `n` trials succeeds, `q`ⁿ, each succeeding with probability `p` = 1 − `q` up to a half.
/// Relative error below 10⁻¹² down to 10⁻²⁹⁰.
pub fn none_of(n: u64, p: f64, q: f64) -> f64 {
    if n <= MOST_FACTORS {
        return power(q, n);
    }
    let ln_q = match p < 1e-3 {
        true => -p * (1.0 + p * (1.0 / 2.0 + p * (1.0 / 3.0 + p * (0.25 + p * 0.2)))),
        false => libm::log1p(-p),
    };
    libm::exp(n as f64 * ln_q)
}

/// So many `draws` of things, taken without putting back from `total` of which `marked` are marked.
#[derive(Debug, Clone, Copy)]
pub struct Draws {
    pub total: u64,
    pub marked: u64,
    pub draws: u64,
}

impl Draws {
    /// Calls `meet` for every marked one drawn.
    ///
    /// Draw i is marked with probability (marked − seen) / (total − i). Candidates come at the largest value that may
    /// take and are thinned to it, so that the cost goes with the result. Where among the draws they stand
    /// matters only to the few that lie between the probabilities of the first draw and the last.
    #[inline]
    pub fn meet(self, random: &mut RandomWords, mut meet: impl FnMut(&mut RandomWords)) {
        let Draws {
            total,
            marked,
            draws,
        } = self;
        debug_assert!(marked <= total && draws <= total, "{self:?}");
        if marked == 0 || draws == 0 {
            return;
        }
        let mut left = marked;
        let last = (total - draws + 1) as f64;
        let largest = marked as f64 / last;
        if largest > 0.5 {
            for i in 0..draws {
                if random.below(total - i) < left {
                    left -= 1;
                    meet(random);
                }
            }
            return;
        }
        let candidates = binomial(draws, largest, 1.0 - largest, random);
        let mut places: Option<Vec<u64>> = None;
        for candidate in 0..candidates {
            let height = random.coarse() * largest;
            let unseen = left as f64;
            let is_marked = if height * (total as f64) < unseen {
                true
            } else if height * last >= unseen {
                false
            } else {
                let places = places.get_or_insert_with(|| some_of(draws, candidates, random));
                height * ((total - places[candidate as usize]) as f64) < unseen
            };
            if is_marked {
                left -= 1;
                meet(random);
            }
        }
    }
}

/// `count` different numbers below `n`, in order.
#[cold]
fn some_of(n: u64, count: u64, random: &mut RandomWords) -> Vec<u64> {
    let mut some: Vec<u64> = Vec::with_capacity(count as usize);
    while (some.len() as u64) < count {
        let one = random.below(n);
        if let Err(place) = some.binary_search(&one) {
            some.insert(place, one);
        }
    }
    some
}

#[cfg(test)]
mod tests {
    use super::*;

    fn mean_and_variance(n: u32, draw: impl FnMut() -> u64) -> (f64, f64) {
        let draws: Vec<f64> = std::iter::repeat_with(draw)
            .take(n as usize)
            .map(|x| x as f64)
            .collect();
        let mean = draws.iter().sum::<f64>() / f64::from(n);
        let squares: f64 = draws.iter().map(|x| (x - mean).powi(2)).sum();
        (mean, squares / f64::from(n))
    }

    #[test]
    fn binomials_have_their_mean_and_variance_from_tiny_to_huge() {
        let mut random = RandomWords::new(11, 0);
        let trials = 40_000;
        for (n, p) in [
            (1, 0.3),
            (16, 0.02),
            (1000, 0.009),
            (16_000, 0.02),
            (1_000_000_000, 1e-15),
            (1_000_000_000, 3e-9),
            (1_000_000_000, 0.4),
            (50, 0.97),
        ] {
            let (mean, variance) =
                mean_and_variance(trials, || binomial(n, p, 1.0 - p, &mut random));
            let (m, v) = (n as f64 * p, n as f64 * p * (1.0 - p));
            let error = 5.0 * (v / f64::from(trials)).sqrt();
            assert!((mean - m).abs() <= error, "n {n}, p {p}: {mean} {m}");
            // The fourth moment of a binomial is below v + 3v².
            let error = 5.0 * ((v + 2.0 * v * v) / f64::from(trials)).sqrt();
            assert!(
                (variance - v).abs() <= error,
                "n {n}, p {p}: {variance} {v}"
            );
        }
    }

    /// Number by number, for inversion and, on either side of its squeeze, for rejection.
    #[test]
    fn binomials_follow_their_whole_law() {
        let mut random = RandomWords::new(14, 0);
        let trials = 400_000;
        for (n, p) in [
            (30, 0.3f64),
            (40, 0.25),
            (100, 0.2),
            (64, 0.5),
            (5_000, 0.05),
        ] {
            let mut seen = vec![0u32; n as usize + 1];
            for _ in 0..trials {
                seen[binomial(n, p, 1.0 - p, &mut random) as usize] += 1;
            }
            let mut law = none_of(n, p, 1.0 - p);
            for (k, &count) in (0..).zip(&seen) {
                let expected = law * f64::from(trials);
                law *= (n - k) as f64 / (k + 1) as f64 * p / (1.0 - p);
                let error = 5.0 * (expected + 1.0).sqrt();
                let off = (f64::from(count) - expected).abs();
                assert!(off < error, "{n}, {p}, {k}: {count} {expected}");
            }
        }
    }

    #[test]
    fn probabilities_next_to_one_keep_their_distance_from_it() {
        let mut random = RandomWords::new(12, 0);
        let n = 1_000_000_000u64;
        let (missing, _) =
            mean_and_variance(40_000, || n - binomial(n, 1.0 - 3e-9, 3e-9, &mut random));
        assert!(
            (missing - 3.0).abs() < 5.0 * (3.0f64 / 40_000.0).sqrt(),
            "{missing}"
        );
    }

    #[test]
    fn overlaps_follow_the_hypergeometric_law() {
        let mut random = RandomWords::new(13, 0);
        for (total, marked, draws) in [(40, 6, 9), (256_000, 1000, 333), (10, 6, 4)] {
            let trials = 50_000;
            let mut seen = vec![0u32; draws.min(marked) as usize + 1];
            for _ in 0..trials {
                let mut met = 0;
                let of = Draws {
                    total,
                    marked,
                    draws,
                };
                of.meet(&mut random, |_| met += 1);
                seen[met] += 1;
            }
            let none = |i| 1.0 - marked as f64 / (total - i) as f64;
            let mut law: f64 = (0..draws).map(none).product();
            for (k, &count) in seen.iter().enumerate() {
                let expected = law * f64::from(trials);
                let unmarked = (total - marked - draws) as f64 + k as f64 + 1.0;
                let ways = (marked - k as u64) as f64 * (draws - k as u64) as f64;
                law *= ways / ((k + 1) as f64 * unmarked);
                let error = 5.0 * (expected + 1.0).sqrt();
                assert!(
                    (f64::from(count) - expected).abs() < error,
                    "{total}, {marked}, {draws}, {k}: {count} {expected}"
                );
            }
        }
    }
}
