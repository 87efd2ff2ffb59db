//! Special functions that keep their digits where the obvious formula loses them.
//!
//! Exponentials and logarithms are those of `libm`: the last digit of the system's depends on the processor.

use std::f64::consts::{FRAC_1_SQRT_2, PI};

use libm::{exp, log, log1p};

/// Density of the standard normal distribution.
pub fn normal_density(z: f64) -> f64 {
    exp(-0.5 * z * z) / (2.0 * PI).sqrt()
}

/// P(Z > z) of the standard normal distribution, with relative accuracy in the upper tail.
pub fn normal_above(z: f64) -> f64 {
    if z < 1.0 {
        return 0.5 * libm::erfc(z * FRAC_1_SQRT_2);
    }
    if z > 40.0 {
        return 0.0; // below the smallest number
    }
    // erfc alone would magnify the rounding of z/√2 by z².
    let square = z * z;
    let lost = z.mul_add(z, -square);
    0.5 * exp(-0.5 * square) * (1.0 - 0.5 * lost) * erfcx(z * FRAC_1_SQRT_2)
}

/// ln P(Z < z), with relative accuracy where the probability is near 1 and where it is near 0.
pub fn ln_normal_below(z: f64) -> f64 {
    match z {
        z if z > -1.0 => log1p(-normal_above(z)),
        z => -0.5 * z * z + log(0.5 * erfcx(-z * FRAC_1_SQRT_2)),
    }
}

/// exp(x²)·erfc(x) for x ≥ 0, which never underflows.
pub(crate) fn erfcx(x: f64) -> f64 {
    debug_assert!(x >= 0.0, "{x}");
    if x < 5.0 {
        // x² is rounded; what the rounding lost is put back to first order.
        let square = x * x;
        let lost = x.mul_add(x, -square);
        return exp(square) * (1.0 + lost) * libm::erfc(x);
    }
    // Laplace's continued fraction, from a depth that suffices at x = 5.
    let tail = (1..=40)
        .rev()
        .fold(x, |tail, k| x + 0.5 * f64::from(k) / tail);
    1.0 / (PI.sqrt() * tail)
}

/// ln((1 − e^(−t))/t) for t ≥ 0: about −t/2 near 0, −ln t far away, 0 at 0.
pub(crate) fn ln_exprel_neg(t: f64) -> f64 {
    debug_assert!(t >= 0.0, "{t}");
    if t > 1.0 {
        return log1p(-exp(-t)) - log(t);
    }
    // ln(sinh(t/2)/(t/2)) = Σ B₂ₙ t²ⁿ / (2n (2n)!), B₂ₙ the Bernoulli numbers.
    const COEFFICIENTS: [f64; 8] = [
        1.0 / 24.0,
        -1.0 / 2_880.0,
        1.0 / 181_440.0,
        -1.0 / 9_676_800.0,
        1.0 / 479_001_600.0,
        -691.0 / 15_692_092_416_000.0,
        1.0 / 1_046_139_494_400.0,
        -3617.0 / 170_729_965_486_080_000.0,
    ];
    let square = t * t;
    let series = COEFFICIENTS
        .iter()
        .rev()
        .fold(0.0, |sum, c| sum * square + c);
    -0.5 * t + square * series
}

/// ln(eᵃ + eᵇ); either may be −∞.
pub(crate) fn ln_sum_exp(a: f64, b: f64) -> f64 {
    let (small, large) = if a < b { (a, b) } else { (b, a) };
    if small == f64::NEG_INFINITY {
        return large;
    }
    large + log1p(exp(small - large))
}

/// ln n! − (n ln n − n + ½ ln 2πn), the error of Stirling's formula, for n ≥ 1.
pub fn stirling_error(n: u64) -> f64 {
    if n < 16 {
        let factorial: f64 = (2..=n).map(|k| k as f64).product();
        let n = n as f64;
        return log(factorial) - (n * log(n) - n + 0.5 * log(2.0 * PI * n));
    }
    stirling_series(n as f64)
}

/// As [`stirling_error`], for n ≥ 11, without a branch.
#[inline(always)]
pub fn stirling_series(n: f64) -> f64 {
    const COEFFICIENTS: [f64; 6] = [
        1.0 / 12.0,
        -1.0 / 360.0,
        1.0 / 1_260.0,
        -1.0 / 1_680.0,
        1.0 / 1_188.0,
        -691.0 / 360_360.0,
    ];
    let inverse = 1.0 / n;
    let square = inverse * inverse;
    let series = COEFFICIENTS.iter().rev();
    inverse * series.fold(0.0, |sum, c| sum * square + c)
}

/// x ln(x/µ) + µ − x for x ≥ 0, µ > 0, without cancellation where x is near µ.
///
/// Loader's trick (C. Loader, Fast and accurate computation of binomial probabilities, 2000):
/// with v = (x − µ)/(x + µ) the logarithm is 2 artanh v, and the leading terms cancel by algebra.
pub(crate) fn poisson_deviance(x: f64, mean: f64) -> f64 {
    let difference = x - mean;
    if difference.abs() >= 0.1 * (x + mean) {
        return if x == 0.0 {
            mean
        } else {
            x * log(x / mean) - difference
        };
    }
    let v = difference / (x + mean);
    let square = v * v;
    let mut power = 2.0 * x * v;
    let mut sum = difference * v;
    for k in 1.. {
        power *= square;
        let next = sum + power / f64::from(2 * k + 1);
        if next == sum {
            break;
        }
        sum = next;
    }
    sum
}

#[cfg(test)]
mod tests {
    use super::*;

    fn assert_near(got: f64, want: f64) {
        assert!((got - want).abs() <= 4e-15 * want.abs(), "{got} {want}");
    }

    /// Values of mpmath at 30 digits.
    #[test]
    fn tails_keep_their_digits() {
        assert_near(erfcx(0.5), 0.615_690_344_192_925_9);
        assert_near(erfcx(4.999), 0.110_725_974_564_275_4);
        assert_near(erfcx(5.001), 0.110_683_308_983_239_94);
        assert_near(erfcx(1e6), 5.641_895_835_474_742e-7);
        assert_near(ln_normal_below(-40.0), -804.608_442_013_753_8);
        assert_near(ln_normal_below(9.0), -1.128_588_405_953_840_6e-19);
        assert_eq!(normal_above(1e300), 0.0);
    }

    #[test]
    fn branches_meet() {
        assert_near(ln_exprel_neg(1.0), ln_exprel_neg(1.0 + 1e-15));
        assert_near(ln_normal_below(-1.0), ln_normal_below(-1.0 + 1e-15));
        assert_near(ln_exprel_neg(1e-200), -0.5e-200);
        assert_eq!(ln_exprel_neg(0.0), 0.0);
        assert_eq!(ln_sum_exp(f64::NEG_INFINITY, 2.0), 2.0);
        assert_near(ln_sum_exp(0.0, 0.0), std::f64::consts::LN_2);
    }

    #[test]
    fn factorials_and_deviances_are_exact() {
        let ln_factorial_20 = 2_432_902_008_176_640_000f64.ln();
        let stirling = 20.0 * 20f64.ln() - 20.0 + 0.5 * (40.0 * PI).ln();
        assert!((ln_factorial_20 - stirling - stirling_error(20)).abs() < 1e-14);
        assert_near(poisson_deviance(0.0, 3.0), 3.0);
        // d²/2µ − d³/6µ² + … for x = µ + d
        assert_near(poisson_deviance(1e9 + 1.0, 1e9), 0.5e-9 - 1e-18 / 6.0);
        assert_near(poisson_deviance(2.0, 1.0), 2.0 * 2f64.ln() - 1.0);
    }
}
