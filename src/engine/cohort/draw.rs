//! Draws that split cohorts: exact at any size, and also where probabilities are tiny.

use rand_distr::{Binomial, Distribution};
use rand_philox::Philox;

/// Means from which the rejection method of `rand_distr` is the faster one.
const INVERSION_MEAN: f64 = 10.0;

/// How many of `n` trials succeed, each with probability `p`; `q` is 1 − `p`.
///
/// Both are given because neither follows from the other when it is tiny. Small means are inverted here and not in
/// `rand_distr`, whose 1 − p keeps few digits of a small p: at p = 10⁻¹⁵ and n = 10⁹ its mean is 11 % off.
pub fn binomial(n: u64, p: f64, q: f64, random: &mut Philox) -> u64 {
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
    if n as f64 * p >= INVERSION_MEAN {
        let distribution = Binomial::new(n, p).expect("a probability");
        return distribution.sample(random);
    }
    invert(n, p, q, random)
}

/// Largest result of an inversion: 10 + 110 is 35 standard deviations above the largest mean.
const INVERSION_LIMIT: u64 = 120;

/// Sums the probabilities of 0, 1, 2, … until they exceed a uniform number.
fn invert(n: u64, p: f64, q: f64, random: &mut Philox) -> u64 {
    let none = none_of(n, p, q);
    let odds = p / q;
    let limit = n.min(INVERSION_LIMIT);
    let mut left = uniform(random);
    let mut probability = none;
    let mut k = 0;
    while left > probability && k < limit {
        left -= probability;
        k += 1;
        probability *= (n - k + 1) as f64 / k as f64 * odds;
    }
    k
}

/// Probability that none of `n` trials succeeds, `q`ⁿ, each succeeding with probability `p` = 1 − `q` up to a half.
/// Relative error below 10⁻¹² down to 10⁻²⁹⁰.
pub fn none_of(n: u64, p: f64, q: f64) -> f64 {
    if n <= 64 {
        return q.powi(n as i32);
    }
    let ln_q = match p < 1e-3 {
        true => -p * (1.0 + p * (1.0 / 2.0 + p * (1.0 / 3.0 + p * (0.25 + p * 0.2)))),
        false => libm::log1p(-p),
    };
    libm::exp(n as f64 * ln_q)
}

/// A number in [0, 1) with 53 random bits.
pub fn uniform(random: &mut Philox) -> f64 {
    (random.next_u64() >> 11) as f64 * (0.5f64).powi(53)
}

/// A whole number below `n` > 0, which stays below 2³²; uneven by less than n/2⁶⁴.
pub fn below(n: u64, random: &mut Philox) -> u64 {
    ((u128::from(random.next_u64()) * u128::from(n)) >> 64) as u64
}

/// How many of `draws` things, taken without putting back from `total` of which `marked` are marked, are marked.
///
/// Draw i is marked with probability (marked − seen) / (total − i). Candidates come at the largest value that may
/// take and are thinned to it, so that the cost goes with the result.
pub fn overlap(total: u64, marked: u64, draws: u64, random: &mut Philox) -> u64 {
    debug_assert!(
        marked <= total && draws <= total,
        "{marked}, {draws} of {total}"
    );
    if marked == 0 || draws == 0 {
        return 0;
    }
    let largest = marked as f64 / (total - draws + 1) as f64;
    if largest > 0.5 {
        let mut seen = 0;
        for i in 0..draws {
            seen += u64::from(below(total - i, random) < marked - seen);
        }
        return seen;
    }
    let candidates = binomial(draws, largest, 1.0 - largest, random) as usize;
    let mut at: Vec<u64> = Vec::with_capacity(candidates);
    while at.len() < candidates {
        let i = below(draws, random);
        if let Err(place) = at.binary_search(&i) {
            at.insert(place, i);
        }
    }
    let mut seen = 0;
    for i in at {
        let probability = (marked - seen) as f64 / (total - i) as f64;
        seen += u64::from(uniform(random) * largest < probability);
    }
    seen
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::photon::{Purpose, random_stream};

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
        let mut random = random_stream(11, Purpose::Cohort, 0, 0);
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

    #[test]
    fn probabilities_next_to_one_keep_their_distance_from_it() {
        let mut random = random_stream(12, Purpose::Cohort, 0, 0);
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
        let mut random = random_stream(13, Purpose::Cohort, 0, 0);
        for (total, marked, draws) in [(40, 6, 9), (256_000, 1000, 333), (10, 6, 4)] {
            let trials = 50_000;
            let mut seen = vec![0u32; draws.min(marked) as usize + 1];
            for _ in 0..trials {
                seen[overlap(total, marked, draws, &mut random) as usize] += 1;
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
