//! Functions without branches, made for loops over arrays: the compiler turns those into vectors.
//!
//! They use plain arithmetic only, so that they round alike on every machine. Each is good to a few units in the last
//! place in the range that it states, and harmless elsewhere.

/// Numbers that fill a vector. Rows of this length, or a multiple, leave no scalar rest.
pub const VECTOR: usize = 4;

/// Added to a number below 2⁵¹ in magnitude, it leaves the nearest whole number in the lowest bits.
const ROUNDER: f64 = 1.5 * (1u64 << 52) as f64;

const MANTISSA_BITS: u32 = 52;

/// ln 2 in two parts: products of the first with exponents are exact.
const LN_2_HIGH: f64 = f64::from_bits(0x3FE6_2E42_FEE0_0000);
const LN_2_LOW: f64 = f64::from_bits(0x3DEA_39EF_3579_3C76);

/// The least number whose neighbours are whole: its mantissa counts them.
const WHOLE: f64 = (1u64 << MANTISSA_BITS) as f64;

/// A count as a number, up to 2⁵².
#[inline(always)]
pub fn real(count: u64) -> f64 {
    f64::from_bits(WHOLE.to_bits() | count) - WHOLE
}

/// A whole number from 0 to 2⁵² as a count.
#[inline(always)]
pub fn count(whole: f64) -> u64 {
    (whole + WHOLE).to_bits().wrapping_sub(WHOLE.to_bits())
}

/// The largest whole number up to x, which is below 2⁵¹ in magnitude.
#[inline(always)]
pub fn floor(x: f64) -> f64 {
    let nearest = (x + ROUNDER) - ROUNDER;
    if nearest > x { nearest - 1.0 } else { nearest }
}

/// eˣ for −708 ≤ x ≤ 709; 0 for less.
#[inline(always)]
pub fn exp(x: f64) -> f64 {
    const INVERSE_FACTORIALS: [f64; 14] = {
        let mut inverse = [1.0; 14];
        let mut k = 1;
        let mut factorial = 1.0;
        while k < 14 {
            factorial *= k as f64;
            inverse[k] = 1.0 / factorial;
            k += 1;
        }
        inverse
    };
    let rounded = x * std::f64::consts::LOG2_E + ROUNDER;
    let exponent = rounded - ROUNDER;
    let rest = (x - exponent * LN_2_HIGH) - exponent * LN_2_LOW;
    let mut series = 0.0;
    for inverse in INVERSE_FACTORIALS.into_iter().rev() {
        series = series * rest + inverse;
    }
    let scale = f64::from_bits((rounded.to_bits() << MANTISSA_BITS).wrapping_add(1f64.to_bits()));
    if x < -708.0 { 0.0 } else { series * scale }
}

/// 1, 1/3, 1/5, …: 2 atanh s = 2s (1 + s²/3 + s⁴/5 + …)
const INVERSE_ODD: [f64; 11] = {
    let mut inverse = [1.0; 11];
    let mut k = 0;
    while k < inverse.len() {
        inverse[k] = 1.0 / (2 * k + 1) as f64;
        k += 1;
    }
    inverse
};

/// Exponent k and s, where ln x = k ln 2 + 2 atanh s.
#[inline(always)]
fn ln_parts(x: f64) -> (f64, f64) {
    /// From it on mantissas are halved, so that they lie about 1.
    const HALVED: u64 = std::f64::consts::FRAC_1_SQRT_2.to_bits();
    const BIAS: u64 = 1023;
    let bits = x.to_bits();
    let biased = bits.wrapping_add((BIAS << MANTISSA_BITS).wrapping_sub(HALVED)) >> MANTISSA_BITS;
    let exponent = real(biased) - BIAS as f64;
    let shift = biased.wrapping_sub(BIAS) << MANTISSA_BITS;
    let mantissa = f64::from_bits(bits.wrapping_sub(shift));
    (exponent, (mantissa - 1.0) / (mantissa + 1.0))
}

#[inline(always)]
fn ln_of_parts((exponent, s): (f64, f64), series: f64) -> f64 {
    exponent * LN_2_HIGH + (2.0 * s * series + exponent * LN_2_LOW)
}

/// ln x for normal numbers x > 0; for 0 it is below all others.
#[inline(always)]
pub fn ln(x: f64) -> f64 {
    let parts = ln_parts(x);
    let square = parts.1 * parts.1;
    let mut series = 0.0;
    for inverse in INVERSE_ODD.into_iter().rev() {
        series = series * square + inverse;
    }
    ln_of_parts(parts, series)
}

/// [`ln`] of many numbers, 64 or so, step by step for all of them: no number's step waits for the one before.
#[inline(always)]
pub fn ln_of_all<const N: usize>(numbers: &mut [f64; N]) {
    let mut parts = ([0.0; N], [0.0; N]);
    let (mut squares, mut series) = ([0.0; N], [0.0; N]);
    for at in 0..N {
        (parts.0[at], parts.1[at]) = ln_parts(numbers[at]);
        squares[at] = parts.1[at] * parts.1[at];
    }
    for inverse in INVERSE_ODD.into_iter().rev() {
        for at in 0..N {
            series[at] = series[at] * squares[at] + inverse;
        }
    }
    for at in 0..N {
        numbers[at] = ln_of_parts((parts.0[at], parts.1[at]), series[at]);
    }
}

/// P(Z > z) of the standard normal distribution for 0 ≤ z ≤ 37.5; 0 beyond. Relative error below 10⁻¹³ (that of z²/2).
#[inline(always)]
pub fn normal_above(z: f64) -> f64 {
    /// [`BEND`] / ([`BEND`] + z) where the fit ends, at z = 38.
    const LEAST: f64 = BEND / (BEND + 38.0);
    const BEND: f64 = 5.0;
    /// P(Z > z) exp(z²/2) / t for t = 5 / (5 + z), in powers of t scaled to −1 … 1: interpolated in Chebyshev's points
    /// with 40 digits, to 4·10⁻¹⁷.
    const COEFFICIENTS: [f64; 22] = [
        0.17075693397994693,
        0.14040402373909208,
        0.09671596305384629,
        0.055254232596736154,
        0.025564210845529258,
        0.009097367339752109,
        0.0021772911678435577,
        0.0001665188128845124,
        -0.00010340702131125324,
        -3.759314559453921e-05,
        9.815146413903235e-07,
        3.459524303025582e-06,
        3.4631717217914133e-07,
        -3.071435725463495e-07,
        -5.519646711715974e-08,
        3.0989564601641866e-08,
        6.421829544773249e-09,
        -3.6105619512189737e-09,
        -6.118693992127948e-10,
        4.224051531622084e-10,
        3.7290502141352876e-11,
        -3.3460495224768555e-11,
    ];
    let t = BEND / (BEND + z);
    let x = (2.0 * t - LEAST - 1.0) / (1.0 - LEAST);
    let mut series = 0.0;
    for coefficient in COEFFICIENTS.into_iter().rev() {
        series = series * x + coefficient;
    }
    series * t * exp(-0.5 * z * z)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::numerics::special;
    use proptest::prelude::*;

    fn check_near(found: f64, expected: f64, error: f64) -> Result<(), TestCaseError> {
        let off = (found - expected).abs();
        prop_assert!(off <= error * expected.abs(), "{found} {expected}");
        Ok(())
    }

    proptest! {
        #[test]
        fn exponentials_are_those_of_libm(x in -708.0f64..709.0, small in -1.0f64..1.0) {
            check_near(exp(x), libm::exp(x), 1e-15)?;
            check_near(exp(small), libm::exp(small), 1e-15)?;
        }

        #[test]
        fn logarithms_are_those_of_libm(ln_x in -700.0f64..700.0, about_one in 0.5f64..2.0) {
            let x = libm::exp(ln_x);
            check_near(ln(x), libm::log(x), 1e-15)?;
            check_near(ln(about_one), libm::log(about_one), 1e-15)?;
        }

        #[test]
        fn counts_stay_what_they_are(n in 0u64..1 << 52) {
            prop_assert_eq!(real(n), n as f64);
            prop_assert_eq!(count(n as f64), n);
        }

        #[test]
        fn whole_numbers_are_below(x in -1e15f64..1e15, small in -3.0f64..3.0) {
            prop_assert_eq!([floor(x), floor(small)], [x.floor(), small.floor()]);
        }

        #[test]
        fn tails_are_those_of_the_error_function(z in 0.0f64..37.5, small in 0.0f64..3.0) {
            check_near(normal_above(z), special::normal_above(z), 2e-13)?;
            check_near(normal_above(small), special::normal_above(small), 2e-15)?;
        }
    }

    #[test]
    fn ends_are_harmless() {
        assert_eq!(exp(-709.0), 0.0);
        assert_eq!(exp(f64::NEG_INFINITY), 0.0);
        assert_eq!([exp(0.0), ln(1.0)], [1.0, 0.0]);
        assert!(ln(0.0) < -700.0);
        assert_eq!(normal_above(1e9), 0.0);
        assert_eq!(normal_above(f64::INFINITY), 0.0);
    }
}
