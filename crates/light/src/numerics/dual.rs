//! Numbers that carry their derivatives along (forward-mode automatic differentiation).
//!
//! ```text
//!   Dual { value: f(θ), slope: [∂f/∂θ₁ … ∂f/∂θ_K] }      every operation applies the chain rule
//! ```
//!
//! One pass of a model then gives its value and its exact slopes, for about the price of K plain passes without any of
//! the rounding of differences.

use std::ops::{Add, AddAssign, Mul, Sub, SubAssign};

/// A value and its derivatives with respect to K parameters.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Dual<const K: usize> {
    /// The value.
    pub value: f64,
    /// Its derivatives.
    pub slope: [f64; K],
}

impl<const K: usize> Dual<K> {
    /// Nothing.
    pub const ZERO: Self = Self::constant(0.0);

    /// A number that depends on no parameter.
    pub const fn constant(value: f64) -> Self {
        Dual {
            value,
            slope: [0.0; K],
        }
    }

    /// Parameter number `of` itself.
    pub fn parameter(value: f64, index: usize) -> Self {
        let mut dual = Self::constant(value);
        dual.slope[index] = 1.0;
        dual
    }

    /// f of this number, given f's value and derivative there.
    #[inline]
    pub fn chain(self, value: f64, derivative: f64) -> Self {
        Dual {
            value,
            slope: self.slope.map(|s| s * derivative),
        }
    }

    /// 1 over this number.
    #[inline]
    pub fn recip(self) -> Self {
        let inverse = self.value.recip();
        self.chain(inverse, -inverse * inverse)
    }

    /// e to the power of this number.
    #[inline]
    pub fn exp(self) -> Self {
        let exp = libm::exp(self.value);
        self.chain(exp, exp)
    }

    /// 1 − e⁻ˣ and 1 − (1 − e⁻ˣ)/x of this number: the chances that one of x photons comes while it can, and before it can
    /// if that begins evenly among them.
    #[inline]
    pub fn hits(self) -> (Self, Self) {
        let missed = self.exprel_neg();
        let hit = self.value * missed.value;
        (self.chain(hit, 1.0 - hit), Self::constant(1.0) - missed)
    }

    /// (1 − e⁻ˣ)/x of this number, which may be of either sign.
    #[inline]
    pub fn exprel_neg(self) -> Self {
        let x = self.value;
        if x.abs() < 1e-2 {
            // Σ (−x)ⁿ/(n+1)!; the next term is below 10⁻¹³.
            let value = 1.0 - x / 2.0 * (1.0 - x / 3.0 * (1.0 - x / 4.0 * (1.0 - x / 5.0)));
            let slope = -0.5 + x / 3.0 - x * x / 8.0 + x * x * x / 30.0;
            return self.chain(value, slope);
        }
        let hit = -libm::expm1(-x);
        let value = hit / x;
        self.chain(value, (1.0 - hit - value) / x)
    }
}

impl<const K: usize> Add for Dual<K> {
    type Output = Self;

    #[inline]
    fn add(mut self, other: Self) -> Self {
        self += other;
        self
    }
}

impl<const K: usize> AddAssign for Dual<K> {
    #[inline]
    fn add_assign(&mut self, other: Self) {
        self.value += other.value;
        for (s, o) in self.slope.iter_mut().zip(other.slope) {
            *s += o;
        }
    }
}

impl<const K: usize> Sub for Dual<K> {
    type Output = Self;

    #[inline]
    fn sub(mut self, other: Self) -> Self {
        self -= other;
        self
    }
}

impl<const K: usize> SubAssign for Dual<K> {
    #[inline]
    fn sub_assign(&mut self, other: Self) {
        self.value -= other.value;
        for (s, o) in self.slope.iter_mut().zip(other.slope) {
            *s -= o;
        }
    }
}

impl<const K: usize> Mul for Dual<K> {
    type Output = Self;

    #[inline]
    fn mul(self, other: Self) -> Self {
        let mut slope = self.slope;
        for (s, o) in slope.iter_mut().zip(other.slope) {
            *s = *s * other.value + o * self.value;
        }
        Dual {
            value: self.value * other.value,
            slope,
        }
    }
}

impl<const K: usize> Mul<f64> for Dual<K> {
    type Output = Self;

    #[inline]
    fn mul(self, factor: f64) -> Self {
        self.chain(self.value * factor, factor)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    proptest! {
        #[test]
        fn slopes_are_those_of_differences(x in -3.0f64..3.0, y in 0.2f64..3.0) {
            let f = |x: Dual<2>, y: Dual<2>| {
                (x * y - y.recip()) * (x * 0.3).exp() + (x - y).exprel_neg() + x.exprel_neg() * 2.0
            };
            let value = |x: f64, y: f64| f(Dual::constant(x), Dual::constant(y)).value;
            let dual = f(Dual::parameter(x, 0), Dual::parameter(y, 1));
            let h = 1e-5;
            let by_x = (value(x + h, y) - value(x - h, y)) / (2.0 * h);
            let by_y = (value(x, y + h) - value(x, y - h)) / (2.0 * h);
            prop_assert_eq!(dual.value, value(x, y));
            prop_assert!((dual.slope[0] - by_x).abs() < 1e-6 * (1.0 + by_x.abs()), "{} {by_x}", dual.slope[0]);
            prop_assert!((dual.slope[1] - by_y).abs() < 1e-6 * (1.0 + by_y.abs()), "{} {by_y}", dual.slope[1]);
        }
    }
}
