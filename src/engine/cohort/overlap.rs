//! How many of some SPADs drawn from a pool are marked ones: a hypergeometric number, met one by one.
//!
//! Draw i meets a marked one with probability (marked − met) / (total − i). Candidates come at a probability that this
//! never exceeds and are thinned to it, so that the cost goes with the result, and how many candidates come is known
//! before what is marked. Where among the draws they stand matters only to the few that lie between the
//! probabilities of the first draw and the last.

use super::words::RandomWords;
use crate::numerics::branchless::{count, floor, real};

/// So many draws from a total of which a number is marked.
#[derive(Debug, Clone, Copy)]
pub struct Overlap {
    draws: u64,
    total: f64,
    /// What is left of the total for the last draw.
    last: f64,
    /// Probability that a draw is a candidate.
    pub candidate: f64,
}

impl Overlap {
    /// So many `draws`, without putting back, from `total`, at most `bound` of which are marked.
    #[inline(always)]
    pub fn new(total: u64, draws: u64, bound: u64) -> Self {
        let last = real(total) - real(draws) + 1.0;
        Overlap {
            draws,
            total: real(total),
            last,
            candidate: (real(bound) / last).min(1.0),
        }
    }

    /// The marked ones drawn, when so many draws are `candidates` and `marked` are marked.
    #[inline(always)]
    pub fn met(&self, candidates: u64, marked: u64) -> Met<'_> {
        debug_assert!(candidates <= self.draws, "{candidates} of {self:?}");
        Met {
            overlap: self,
            candidates,
            seen: 0,
            left: real(marked),
            places: None,
        }
    }
}

/// Marked ones, one after the other.
pub struct Met<'o> {
    overlap: &'o Overlap,
    candidates: u64,
    /// Candidates up to now.
    seen: u64,
    /// Marked ones not met yet.
    left: f64,
    /// Where among the draws the candidates stand, once asked.
    places: Option<Vec<u64>>,
}

impl Met<'_> {
    /// The next one's place among those that are left.
    #[inline(always)]
    pub fn next(&mut self, random: &mut RandomWords) -> Option<u64> {
        let &mut Met { overlap, left, .. } = self;
        while self.seen < self.candidates {
            self.seen += 1;
            let height = random.coarse() * overlap.candidate;
            let mut place = height * overlap.total;
            if place >= left {
                if height * overlap.last >= left || height * self.before_last(random) >= left {
                    continue;
                }
                place = random.uniform() * left;
            }
            self.left -= 1.0;
            return Some(count(floor(place)));
        }
        None
    }

    /// What was left of the total when the last candidate was drawn.
    #[cold]
    fn before_last(&mut self, random: &mut RandomWords) -> f64 {
        let some = || some_of(self.overlap.draws, self.candidates, random);
        let places = self.places.get_or_insert_with(some);
        self.overlap.total - real(places[self.seen as usize - 1])
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
    use super::super::draw::binomial;
    use super::*;

    #[test]
    fn overlaps_follow_the_hypergeometric_law() {
        let mut random = RandomWords::new(13, 0);
        for (total, bound, marked, draws) in [
            (40, 6, 6, 9),
            (40, 9, 6, 9),
            (256_000, 1000, 1000, 333),
            (256_000, 1500, 1000, 333),
            (10, 6, 6, 4),
            (10, 10, 6, 9),
        ] {
            let trials = 50_000;
            let mut seen = vec![0u32; draws.min(marked) as usize + 1];
            let mut first_half = 0;
            let of = Overlap::new(total, draws, bound);
            for _ in 0..trials {
                let candidates = binomial(draws, of.candidate, 1.0 - of.candidate, &mut random);
                let mut met = 0;
                let mut all = of.met(candidates, marked);
                while let Some(place) = all.next(&mut random) {
                    assert!(place < marked - met);
                    if met == 0 && 2 * place < marked {
                        first_half += 1;
                    }
                    met += 1;
                }
                seen[met as usize] += 1;
            }
            let none = |i| (1.0 - marked as f64 / (total - i) as f64).max(0.0);
            let mut law: f64 = (0..draws).map(none).product();
            let any = f64::from(trials) * (1.0 - law);
            let even = 0.5 * any;
            assert!(
                (f64::from(first_half) - even).abs() < 5.0 * (0.25 * any).sqrt(),
                "{of:?}, {marked}: {first_half} {even}"
            );
            if law == 0.0 {
                let mean: f64 = (0..)
                    .zip(&seen)
                    .map(|(k, &n)| f64::from(k) * f64::from(n))
                    .sum();
                let expected = f64::from(trials) * (draws * marked) as f64 / total as f64;
                assert!(
                    (mean - expected).abs() < 5.0 * f64::from(trials).sqrt(),
                    "{mean} {expected}"
                );
                continue;
            }
            for (k, &count) in seen.iter().enumerate() {
                let expected = law * f64::from(trials);
                let unmarked = (total - marked - draws) as f64 + k as f64 + 1.0;
                let ways = (marked - k as u64) as f64 * (draws - k as u64) as f64;
                law *= ways / ((k + 1) as f64 * unmarked);
                let error = 5.0 * (expected + 1.0).sqrt();
                assert!(
                    (f64::from(count) - expected).abs() < error,
                    "{of:?}, {marked}, {k}: {count} {expected}"
                );
            }
        }
    }
}
