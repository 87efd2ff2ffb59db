//! Which points a study takes of the space that its keys span: all, or some that fill it evenly. Point `i` is computed from `i`, so that
//! no list of points is ever held in memory, and shards agree about them.
//!
//! | design | point `i` |
//! |---|---|
//! | grid | every combination, the last axis fastest |
//! | latin | McKay, Beckman, Conover 1979: on every axis one point in each N-th part, in an order of its own |
//! | sobol | Sobol' 1967 with the direction numbers of Joe and Kuo 2008, shifted digitally by the seed |
//!
//! The order of a Latin hypercube is a permutation of 0…N−1 made by a Feistel network of Philox words, of the next power of four; what
//! falls beyond N − 1 goes through it again (Black and Rogaway 2002).

use rand_philox::{philox4x32_10, u32_to_unit_f64};

use crate::photon::{RandomPurpose, philox_key};

/// How points are chosen.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum SamplingDesign {
    /// Every combination.
    Grid,
    /// So many points, evenly on every axis.
    Latin(u64),
    /// So many points of a sequence that fills the space evenly.
    Sobol(u64),
}

/// Axes that a Sobol' sequence is given for here.
pub(super) const MOST_SOBOL_AXES: usize = 21;

/// Where point `index` of a drawn design, which is no grid, lies on axis number `axis`, both from 0: as a share of the way, from 0 to less
/// than 1.
pub(super) fn share(design: SamplingDesign, seed: u64, axis: usize, index: u64) -> f64 {
    let key = philox_key(seed);
    match design {
        SamplingDesign::Grid => unreachable!("a grid has values, no shares"),
        SamplingDesign::Latin(points) => {
            let part = permuted(key, axis as u32, points, index);
            let [word, ..] = words(key, axis as u32, WITHIN, part);
            (part as f64 + u32_to_unit_f64(word)) / points as f64
        }
        SamplingDesign::Sobol(_) => {
            let [shift, ..] = words(key, axis as u32, SHIFT, 0);
            // In the middle of its cell, so that it is never 0.
            (f64::from(sobol(axis, index as u32) ^ shift) + 0.5) / 2f64.powi(32)
        }
    }
}

/// What words of an axis are for: rounds of the Feistel network have the numbers below.
const WITHIN: u32 = 100;
const SHIFT: u32 = 101;

fn words(key: [u32; 2], axis: u32, what: u32, index: u64) -> [u32; 4] {
    let purpose = (RandomPurpose::Sweep as u32) << 16 | axis;
    philox4x32_10([index as u32, (index >> 32) as u32, what, purpose], key)
}

const ROUNDS: u32 = 6;

/// A permutation of 0…`points` − 1.
fn permuted(key: [u32; 2], axis: u32, points: u64, index: u64) -> u64 {
    let half_bits = (u64::BITS - (points - 1).leading_zeros())
        .div_ceil(2)
        .max(1);
    let mask = (1 << half_bits) - 1;
    let mut at = index;
    loop {
        let (mut left, mut right) = (at >> half_bits, at & mask);
        for round in 0..ROUNDS {
            let [word, ..] = words(key, axis, round, right);
            (left, right) = (right, left ^ (u64::from(word) & mask));
        }
        at = left << half_bits | right;
        if at < points {
            return at;
        }
    }
}

/// Degree s, coefficients a and first direction numbers m of the primitive polynomials (Joe and Kuo, new-joe-kuo-6.21201); the first
/// axis has none.
const DIRECTIONS: [(u32, u32, &[u32]); MOST_SOBOL_AXES - 1] = [
    (1, 0, &[1]),
    (2, 1, &[1, 3]),
    (3, 1, &[1, 3, 1]),
    (3, 2, &[1, 1, 1]),
    (4, 1, &[1, 1, 3, 3]),
    (4, 4, &[1, 3, 5, 13]),
    (5, 2, &[1, 1, 5, 5, 17]),
    (5, 4, &[1, 1, 5, 5, 5]),
    (5, 7, &[1, 1, 7, 11, 19]),
    (5, 11, &[1, 1, 5, 1, 1]),
    (5, 13, &[1, 1, 1, 3, 11]),
    (5, 14, &[1, 3, 5, 5, 31]),
    (6, 1, &[1, 3, 3, 9, 7, 49]),
    (6, 13, &[1, 1, 1, 15, 21, 21]),
    (6, 16, &[1, 3, 1, 13, 27, 49]),
    (6, 19, &[1, 1, 1, 15, 7, 5]),
    (6, 22, &[1, 3, 1, 15, 13, 25]),
    (6, 25, &[1, 1, 5, 5, 19, 61]),
    (7, 1, &[1, 3, 7, 11, 23, 15, 103]),
    (7, 4, &[1, 3, 7, 13, 13, 15, 69]),
];

/// The 32 bits after the point of Sobol' number `index` on an axis.
fn sobol(axis: usize, index: u32) -> u32 {
    let directions = match axis.checked_sub(1) {
        None => std::array::from_fn(|bit| 1 << (31 - bit)),
        Some(row) => {
            let (s, a, m) = DIRECTIONS[row];
            let s = s as usize;
            let mut v = [0u32; 32];
            for bit in 0..32 {
                v[bit] = match m.get(bit) {
                    Some(m) => m << (31 - bit),
                    None => {
                        let mut value = v[bit - s] ^ (v[bit - s] >> s);
                        for k in 1..s {
                            value ^= (a >> (s - 1 - k) & 1) * v[bit - k];
                        }
                        value
                    }
                };
            }
            v
        }
    };
    (0..32).fold(0, |sum, bit| sum ^ ((index >> bit & 1) * directions[bit]))
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    proptest! {
        #[test]
        fn a_latin_hypercube_has_one_point_in_each_part(seed: u64, axis in 0usize..9, points in 1u64..700) {
            let mut parts: Vec<u64> = (0..points)
                .map(|i| (share(SamplingDesign::Latin(points), seed, axis, i) * points as f64) as u64)
                .collect();
            parts.sort_unstable();
            prop_assert!(parts.into_iter().eq(0..points));
        }

        /// The first 2ᵏ points lie in each of the 2ᵏ equal parts of every axis once, shifted or not.
        #[test]
        fn sobol_points_are_even_on_every_axis(seed: u64, axis in 0..MOST_SOBOL_AXES, bits in 0u32..11) {
            let points = 1u64 << bits;
            let mut parts: Vec<u64> = (0..points)
                .map(|i| (share(SamplingDesign::Sobol(points), seed, axis, i) * points as f64) as u64)
                .collect();
            parts.sort_unstable();
            prop_assert!(parts.into_iter().eq(0..points));
        }
    }

    /// As scipy.stats.qmc.Sobol(8, scramble=False) has them, in the order of the index and not of its Gray code.
    #[test]
    fn sobol_points_are_those_of_joe_and_kuo() {
        let point = |index| -> Vec<f64> {
            (0..8)
                .map(|axis| f64::from(sobol(axis, index)) / 2f64.powi(32))
                .collect()
        };
        assert_eq!(point(1), [0.5; 8]);
        assert_eq!(point(2), [0.25, 0.75, 0.75, 0.75, 0.25, 0.25, 0.75, 0.25]);
        assert_eq!(
            point(5),
            [0.625, 0.125, 0.875, 0.625, 0.625, 0.875, 0.125, 0.125]
        );
    }

    #[test]
    fn orders_of_two_axes_have_nothing_to_do_with_each_other() {
        let n = 4096;
        let centred_share = |axis, i| share(SamplingDesign::Latin(n), 7, axis, i) - 0.5;
        let correlation = (0..n)
            .map(|i| centred_share(0, i) * centred_share(1, i))
            .sum::<f64>()
            / n as f64
            * 12.0;
        assert!(correlation.abs() < 4.0 / (n as f64).sqrt(), "{correlation}");
    }
}
