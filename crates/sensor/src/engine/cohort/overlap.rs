//! How many of some SPADs drawn from a pool are marked ones: a hypergeometric number, met one by one.
//!
//! Draw i meets a marked one with probability (marked − met) / (total − i). Candidates come at a probability that this
//! never exceeds and are thinned to it, so that the cost goes with the result, and how many candidates come is known
//! before what is marked. Where among the draws they stand matters only to the few that lie between the
//! probabilities of the first draw and the last.

use super::words::RandomWords;
use crate::numerics::branchless::{VECTOR, real};

/// So many draws from a total of which a number is marked.
#[derive(Debug, Clone, Copy)]
pub(super) struct Overlap {
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
    pub(super) fn new(total: u64, draws: u64, bound: u64) -> Self {
        let last = real(total) - real(draws) + 1.0;
        Overlap {
            draws,
            total: real(total),
            last,
            candidate: (real(bound) / last).min(1.0),
        }
    }

    /// Takes the marked ones among `candidates` draws out of their groups. Entry i of `marked` counts those of the
    /// groups 0 to i; entries after the last group repeat its count.
    #[inline(always)]
    pub(super) fn draw_marked(
        &self,
        candidates: u64,
        marked: &mut [[f64; VECTOR]],
        random: &mut RandomWords,
    ) {
        debug_assert!(candidates <= self.draws, "{candidates} of {self:?}");
        let mut places: Option<Vec<u64>> = None;
        for candidate in 0..candidates {
            let height = random.coarse() * self.candidate;
            let mut place = height * self.total;
            let left = marked.as_flattened().last().map_or(0.0, |left| *left);
            if place >= left {
                if height * self.last >= left {
                    continue;
                }
                let places = places.get_or_insert_with(|| some_of(self.draws, candidates, random));
                let before = real(places[candidate as usize]);
                if height * (self.total - before) >= left {
                    continue;
                }
                place = random.uniform() * left;
            }
            // No branch: which group it is cannot be foreseen.
            for groups in marked.iter_mut() {
                for up_to in groups {
                    *up_to -= if place < *up_to { 1.0 } else { 0.0 };
                }
            }
        }
    }
}

/// `count` different numbers below `n`, in order.
#[cold]
fn some_of(n: u64, count: u64, random: &mut RandomWords) -> Vec<u64> {
    let mut some: Vec<u64> = Vec::with_capacity(count as usize);
    while (some.len() as u64) < count {
        let one = random.whole_below(n);
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
            let mut in_first = 0.0;
            let overlap = Overlap::new(total, draws, bound);
            for _ in 0..trials {
                let candidates = binomial(
                    draws,
                    overlap.candidate,
                    1.0 - overlap.candidate,
                    &mut random,
                );
                let half = (marked / 2) as f64;
                let mut groups = [[half, marked as f64, marked as f64, marked as f64]];
                overlap.draw_marked(candidates, &mut groups, &mut random);
                let [[first, all, ..]] = groups;
                let met = marked - all as u64;
                in_first += half - first;
                seen[met as usize] += 1;
            }
            let none = |i| (1.0 - marked as f64 / (total - i) as f64).max(0.0);
            let mut law: f64 = (0..draws).map(none).product();
            // Half of those met are of the first half.
            let met: f64 = (0..)
                .zip(&seen)
                .map(|(k, &n)| f64::from(k) * f64::from(n))
                .sum();
            assert!(
                (in_first - 0.5 * met).abs() < 5.0 * (0.25 * met).sqrt(),
                "{in_first} of {met}"
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
                    "{overlap:?}, {marked}, {k}: {count} {expected}"
                );
            }
        }
    }
}
