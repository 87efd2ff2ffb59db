//! Normal draws by inversion, one random number each and no branch.
//!
//! The quantile function is steep near 0 and smooth in the logarithm of the probability. So its pieces halve in width with
//! every power of two, 16 to each, as floating-point numbers do: exponent and first bits of a probability are the number
//! of its piece. Within a piece a cubic meets values and slopes at both ends; it is off by less than 10⁻⁷ σ anywhere.
//!
//! ```text
//!   p    2⁻⁵⁰ …   1/32   1/16       1/8                1/4                                  1/2
//!        ─┼┼┼┼┼┼┼┼┼┼┼┼┼┼┼┼┼┼┼┼┼┼┼┼─┼─┼─┼─┼─┼─┼─┼─┼─┼─┼──┼──┼──┼──┼──┼──┼──┼──┼──┼──┼──┤   the upper half by symmetry
//! ```

use std::f64::consts::{FRAC_1_SQRT_2, PI};
use std::sync::LazyLock;

/// Random bits of a draw: one for the sign, the others for the probability of the tail beyond it.
pub(super) const NORMAL_BITS: u32 = 1 + TAIL_BITS;
const TAIL_BITS: u32 = 48;

/// Bits of a rank. Few, so that many fit into a vector, with room for edges above all ranks.
const RANK_BITS: u32 = 14;

/// Ranks are below that.
pub const RANKS: i16 = 1 << RANK_BITS;

/// Pieces for every power of two.
const PIECE_BITS: u32 = 4;
const POWERS: usize = TAIL_BITS as usize + 1;
const PIECES: usize = POWERS << PIECE_BITS;
/// A power of two, so that an index needs no check.
const ROOM: usize = PIECES.next_power_of_two();

const MANTISSA_BITS: u32 = f64::MANTISSA_DIGITS - 1;
const WITHIN_BITS: u32 = MANTISSA_BITS - PIECE_BITS;
const WITHIN: u64 = (1 << WITHIN_BITS) - 1;

/// What the bits of the smallest probability, 2⁻⁵⁰, give as a piece.
const FIRST_PIECE: u64 = (f64::MAX_EXP as u64 - 1 - (TAIL_BITS as u64 + 2)) << PIECE_BITS;

/// Cubics in the distance from the beginning of their piece.
static CUBICS: LazyLock<Box<[[f64; 4]; ROOM]>> = LazyLock::new(|| {
    let start = |piece: usize| f64::from_bits((FIRST_PIECE + piece as u64) << WITHIN_BITS);
    let mut z = 0.0;
    let mut knots = vec![(0.0, 0.0); PIECES + 1];
    for (piece, knot) in knots.iter_mut().enumerate().rev() {
        z = quantile(start(piece), z);
        *knot = (z, 1.0 / density(z));
    }
    let mut cubics = Box::new([[0.0; 4]; ROOM]);
    for (piece, (cubic, ends)) in cubics.iter_mut().zip(knots.windows(2)).enumerate() {
        let width = start(piece + 1) - start(piece);
        let [(z0, slope0), (z1, slope1)] = [ends[0], ends[1]];
        let secant = (z1 - z0) / width;
        *cubic = [
            z0,
            slope0,
            (3.0 * secant - 2.0 * slope0 - slope1) / width,
            (slope0 + slope1 - 2.0 * secant) / (width * width),
        ];
    }
    cubics
});

fn density(z: f64) -> f64 {
    libm::exp(-0.5 * z * z) / libm::sqrt(2.0 * PI)
}

/// The lower tail up to `z`.
fn normal_cdf(z: f64) -> f64 {
    0.5 * libm::erfc(-z * FRAC_1_SQRT_2)
}

/// Where the lower tail is `p`; `near` is on the right side of it. Newton's method on the logarithm of the tail, which is
/// concave.
fn quantile(p: f64, near: f64) -> f64 {
    let mut z = near;
    for _ in 0..8 {
        let tail = normal_cdf(z);
        z -= libm::log(tail / p) * tail / density(z);
    }
    z
}

/// Draws of a normal distribution of mean 0.
#[derive(Debug, Clone, Copy)]
pub struct NormalSampler {
    /// The standard deviation.
    pub(crate) sigma: f64,
    cubics: &'static [[f64; 4]; ROOM],
}

impl NormalSampler {
    /// With this standard deviation, finite and ≥ 0.
    pub fn new(sigma: f64) -> Self {
        NormalSampler {
            sigma,
            cubics: &CUBICS,
        }
    }

    /// The value below which a share `p` of all draws lies, 0 ≤ `p` ≤ 1; at most as far out as draws are.
    #[inline]
    pub(crate) fn quantile(&self, p: f64) -> f64 {
        let tail = p.min(1.0 - p).max(0.5f64.powi(TAIL_BITS as i32 + 2));
        let z = self.lower_quantile(tail);
        if p > 0.5 {
            -z * self.sigma
        } else {
            z * self.sigma
        }
    }

    /// The quantile of a tail of 2⁻⁵⁰ to ½ of the standard normal distribution.
    #[inline]
    fn lower_quantile(&self, tail: f64) -> f64 {
        let bits = tail.to_bits();
        let piece = ((bits >> WITHIN_BITS) - FIRST_PIECE) as usize;
        let [c0, c1, c2, c3] = self.cubics[piece % ROOM];
        let within = tail - f64::from_bits(bits & !WITHIN);
        c0 + within * (c1 + within * (c2 + within * c3))
    }

    /// A draw from the lowest 49 bits of `word`: the highest is its sign, the others are the tail beyond it in steps of
    /// 2⁻⁴⁹.
    #[inline]
    pub fn draw(&self, word: u64) -> f64 {
        let half_steps = (word & ((1 << TAIL_BITS) - 1)) << 1 | 1;
        let tail = half_steps as f64 * 0.5f64.powi(TAIL_BITS as i32 + 2);
        let z = self.lower_quantile(tail);
        let sign = word >> TAIL_BITS << 63;
        f64::from_bits((z * self.sigma).to_bits() ^ sign)
    }

    /// 14 bits of a word, given by halves, that rise with its draw.
    #[inline]
    pub(crate) fn rank(low: u32, high: u32) -> i16 {
        const IN_HIGH: u32 = NORMAL_BITS - u32::BITS;
        let bits = high << (u32::BITS - IN_HIGH) | low >> IN_HIGH;
        let upper = (bits as i32 >> 31) as u32;
        let rising = (bits & (u32::MAX >> 1)) ^ upper;
        (rising >> (u32::BITS - RANK_BITS)) as i16
    }

    /// The first rank whose draws may be at least `z` − `tolerance`, and the first whose draws are all at least
    /// `z` + `tolerance`: the same extreme number where all draws are, or none.
    pub(crate) fn ranks_at(&self, z: f64, tolerance: f64) -> [i16; 2] {
        // Draws are cubics that miss the quantiles by that much.
        let tolerance = tolerance + 1e-7 * self.sigma;
        let (first, last) = (z - tolerance, z + tolerance);
        if last <= -self.reach() {
            return [i16::MIN; 2];
        } else if first > self.reach() {
            return [i16::MAX; 2];
        }
        let rank = |z: f64| normal_cdf(z / self.sigma) * f64::from(RANKS);
        // A rank stands for all probabilities up to the next one.
        [rank(first).floor() as i16 - 1, rank(last).ceil() as i16 + 1]
    }

    /// No draw is farther from 0.
    pub(crate) fn reach(&self) -> f64 {
        self.sigma * -self.cubics[0][0]
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    #[test]
    fn the_reach_is_nearly_eight() {
        let reach = NormalSampler::new(1.0).reach();
        assert!((7.9..8.0).contains(&reach), "{reach}");
        assert_eq!(NormalSampler::new(0.0).draw(12345).abs(), 0.0);
    }

    proptest! {
        #![proptest_config(ProptestConfig::with_cases(20_000))]
        #[test]
        fn ranks_tell_which_draws_come_after(
            word: u64,
            near in prop_oneof![-1e-6f64..1e-6, -9.0f64..9.0],
            tolerance in 0.0f64..1e-5,
            sigma in prop_oneof![Just(0.0), Just(1e-6), 0.5f64..2.0],
        ) {
            let sampler = NormalSampler::new(sigma);
            let draw = sampler.draw(word);
            let z = draw + near;
            let rank = NormalSampler::rank(word as u32, (word >> 32) as u32);
            prop_assert!(rank >= 0);
            let [may, must] = sampler.ranks_at(z, tolerance);
            if draw >= z - tolerance {
                prop_assert!(rank >= may);
            }
            if rank >= must {
                prop_assert!(draw >= z + tolerance);
            }
            // Ranks are as wide as 2⁻¹⁴ of all draws; one to either side is in doubt.
            prop_assert!(sigma < 0.5 || i32::from(must) - i32::from(may) <= 4);
        }

        #[test]
        fn draws_leave_the_tail_that_was_drawn(word: u64, shift in 0u32..TAIL_BITS, upper: bool) {
            let tail_word = (word & ((1 << TAIL_BITS) - 1)) >> shift;
            let word = u64::from(upper) << TAIL_BITS | tail_word;
            let z = NormalSampler::new(1.0).draw(word);
            prop_assert_eq!(z.is_sign_positive(), upper);
            prop_assert!(z.abs() <= NormalSampler::new(1.0).reach());
            let expected = (tail_word as f64 + 0.5) * 0.5f64.powi(TAIL_BITS as i32 + 1);
            let tail = normal_cdf(-z.abs());
            // In standard deviations: the tail's error over the density.
            let error = (tail - expected).abs() / density(z);
            prop_assert!(error < 1e-7, "{error}");
        }
    }
}
