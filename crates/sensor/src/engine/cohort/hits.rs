//! How many of some SPADs a photon hits in one step: the binomial tails that split a cohort.

use smallvec::{SmallVec, smallvec};

use super::draw::binomial;
use super::words::RandomWords;

/// Probabilities that at least 0, 1, 2, … of some SPADs are hit, and their complements.
#[derive(Debug, Clone)]
pub(super) struct Hits {
    /// How many SPADs there are.
    pub(super) spads: usize,
    at_least: SmallVec<[f64; FEW_SPADS + 2]>,
    exactly: SmallVec<[f64; FEW_SPADS + 1]>,
}

/// Numbers of SPADs that need no memory of their own.
const FEW_SPADS: usize = 16;

impl Hits {
    /// Each of `spads` SPADs is hit with probability `p`; `q` is 1 − `p`.
    pub(super) fn new(spads: usize, p: f64, q: f64) -> Self {
        let (mut exactly, mut at_least);
        if spads == FEW_SPADS {
            // Lengths that the compiler knows: 3 % of a frame's time on the cohort engine.
            let mut tails = ([0.0; FEW_SPADS + 1], [0.0; FEW_SPADS + 2]);
            fill(FEW_SPADS, p, q, &mut tails.0, &mut tails.1);
            (exactly, at_least) = (SmallVec::from_buf(tails.0), SmallVec::from_buf(tails.1));
        } else {
            (exactly, at_least) = (smallvec![0.0; spads + 1], smallvec![0.0; spads + 2]);
            fill(spads, p, q, &mut exactly, &mut at_least);
        }
        Hits {
            spads,
            at_least,
            exactly,
        }
    }

    /// Probability that any is hit.
    pub(super) fn any(&self) -> f64 {
        self.at_least[1]
    }

    /// Probability that none is hit.
    pub(super) fn none(&self) -> f64 {
        self.exactly[0]
    }

    /// Probability that exactly `hit` are hit.
    pub(super) fn exactly(&self, hit: usize) -> f64 {
        self.exactly[hit]
    }

    /// Of `cycles` laser cycles in each of which at least `least` SPADs are hit, those with one more at least.
    pub(super) fn more(&self, cycles: u64, least: usize, random: &mut RandomWords) -> u64 {
        if cycles == 0 || least >= self.spads || self.at_least[least] == 0.0 {
            return 0;
        }
        let hit_probability = self.at_least[least];
        let (p, q) = (
            self.at_least[least + 1] / hit_probability,
            self.exactly[least] / hit_probability,
        );
        binomial(cycles, p.min(1.0), q.min(1.0), random)
    }
}

/// Fills in the probabilities of [`Hits`], from zeros.
#[inline(always)]
fn fill(spads: usize, p: f64, q: f64, exactly: &mut [f64], at_least: &mut [f64]) {
    if q > 0.0 {
        exactly[0] = q.powi(spads as i32);
        for hit in 0..spads {
            let ways = (spads - hit) as f64 / (hit + 1) as f64;
            exactly[hit + 1] = exactly[hit] * ways * (p / q);
        }
    }
    if exactly[0] < 1e-200 {
        // Nearly all are hit: count down from there, before digits are lost to underflow.
        exactly[spads] = p.powi(spads as i32);
        for hit in (0..spads).rev() {
            let ways = (hit + 1) as f64 / (spads - hit) as f64;
            exactly[hit] = exactly[hit + 1] * ways * (q / p);
        }
    }
    for hit in (0..=spads).rev() {
        at_least[hit] = at_least[hit + 1] + exactly[hit];
    }
}

/// Probability that at least `k` of a macropixel's `spads` are hit, with `mean` photons on each. Relative error below
/// 10⁻¹³ down to 10⁻²⁹⁰.
pub fn at_least_hit(k: usize, spads: usize, mean: f64) -> f64 {
    Hits::new(spads, -libm::expm1(-mean), libm::exp(-mean)).at_least[k]
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    proptest! {
        #[test]
        fn tails_add_up(spads in 0usize..=64, mean in 1e-12f64..400.0) {
            let (p, q) = (-libm::expm1(-mean), libm::exp(-mean));
            let hits = Hits::new(spads, p, q);
            prop_assert!((hits.at_least[0] - 1.0).abs() < 1e-12);
            let any = -libm::expm1(-mean * spads as f64);
            prop_assert!((hits.any() - any).abs() <= 1e-13 * any, "{} {any}", hits.any());
            let mean: f64 = hits.at_least[1..].iter().sum();
            prop_assert!((mean - p * spads as f64).abs() <= 1e-13 * mean);
        }
    }
}
