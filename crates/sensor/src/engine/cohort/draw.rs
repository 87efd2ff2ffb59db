//! Draws that split cohorts: exact at any size, and also where probabilities are tiny.

use super::rejection::Rejection;
use super::words::RandomWords;

/// Above this, logarithms are quicker than factors.
pub(super) const MOST_FACTORS: u64 = 4096;

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
pub(super) const INVERSION_MEAN: f64 = 10.0;

/// How many of `n` trials succeed, each with probability `p`; `q` is 1 − `p`.
///
/// Both are given because neither follows from the other when it is tiny. A generator that takes only p keeps few
/// digits of a small one: at p = 10⁻¹⁵ and n = 10⁹, 1 − p alone puts the mean 11 % off.
#[inline]
pub(super) fn binomial(n: u64, p: f64, q: f64, random: &mut RandomWords) -> u64 {
    debug_assert!(
        p >= 0.0 && q >= 0.0 && (p + q - 1.0).abs() < 1e-12,
        "{p} + {q}"
    );
    // Counted are the rarer ones of successes and failures.
    let (rarer, other) = if p > q { (q, p) } else { (p, q) };
    let mean = n as f64 * rarer;
    let drawn = if mean >= INVERSION_MEAN {
        Rejection::new(n as f64, rarer, other).draw(random)
    } else if mean > 0.0 {
        invert(n, rarer, other, random)
    } else {
        0
    };
    if p > q { n - drawn } else { drawn }
}

/// Largest result of an inversion: 10 + 110 is 35 standard deviations above the largest mean.
pub(super) const INVERSION_LIMIT: u64 = 120;

/// 1/k, so that the sum waits for no division.
pub(super) const RECIPROCALS: [f64; INVERSION_LIMIT as usize + 1] = {
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
    let ln_q = if p < 1e-3 {
        -p * (1.0 + p * (1.0 / 2.0 + p * (1.0 / 3.0 + p * (0.25 + p * 0.2))))
    } else {
        libm::log1p(-p)
    };
    libm::exp(n as f64 * ln_q)
}

#[cfg(test)]
pub(super) mod tests {
    use super::*;

    /// Checks the mean of `trials` draws, as a difference from the binomial's own, and their `variance`.
    pub(crate) fn assert_moments(n: u64, p: f64, trials: u32, from_mean: f64, variance: f64) {
        let (v, trials) = (n as f64 * p * (1.0 - p), f64::from(trials));
        assert!(
            from_mean.abs() <= 5.0 * (v / trials).sqrt(),
            "{n}, {p}: {from_mean}"
        );
        // The fourth moment of a binomial is below v + 3v².
        let error = 5.0 * ((v + 2.0 * v * v) / trials).sqrt();
        assert!((variance - v).abs() <= error, "{n}, {p}: {variance} {v}");
    }

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
            assert_moments(n, p, trials, mean - n as f64 * p, variance);
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
}
