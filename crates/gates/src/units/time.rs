//! Time as a signed count of femtoseconds.
//!
//! An `i64` spans ±9223 s, five orders beyond any exposure. Signed, because what is
//! timed may begin before the edge that it belongs to.

use std::fmt;
use std::ops::{Add, AddAssign, Mul, Neg, Sub};

/// A point in time or a duration, in whole femtoseconds. For serde it is that number.
///
/// # Example
///
/// ```
/// use femtogate::units::Time;
///
/// let delay = Time::from_ns(2) + Time::from_ps(500);
/// assert_eq!(delay, Time::from_fs(2_500_000));
/// assert_eq!((delay.as_ns(), delay.to_string()), (2.5, "2.500 ns".to_owned()));
/// assert!(Time::ZERO - delay < Time::ZERO);
/// ```
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Hash, Default)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
#[cfg_attr(feature = "serde", serde(transparent))]
pub struct Time(i64);

impl Time {
    /// Time zero.
    pub const ZERO: Time = Time(0);
    /// The latest representable time.
    pub const MAX: Time = Time(i64::MAX);

    /// From femtoseconds.
    #[inline]
    pub const fn from_fs(fs: i64) -> Self {
        Time(fs)
    }

    /// From picoseconds.
    #[inline]
    pub const fn from_ps(ps: i64) -> Self {
        Time(ps * 1_000)
    }

    /// From nanoseconds.
    #[inline]
    pub const fn from_ns(ns: i64) -> Self {
        Time(ns * 1_000_000)
    }

    /// From seconds, rounded to the nearest femtosecond (saturating; NaN becomes zero).
    pub fn from_s(s: f64) -> Self {
        Time((s * 1e15).round() as i64)
    }

    /// In femtoseconds.
    #[inline]
    pub const fn as_fs(self) -> i64 {
        self.0
    }

    /// In seconds.
    pub fn as_s(self) -> f64 {
        self.0 as f64 * 1e-15
    }

    /// In nanoseconds.
    pub fn as_ns(self) -> f64 {
        self.0 as f64 * 1e-6
    }
}

impl Add for Time {
    type Output = Time;
    #[inline]
    fn add(self, rhs: Time) -> Time {
        Time(self.0 + rhs.0)
    }
}

impl AddAssign for Time {
    #[inline]
    fn add_assign(&mut self, rhs: Time) {
        self.0 += rhs.0;
    }
}

impl Sub for Time {
    type Output = Time;
    #[inline]
    fn sub(self, rhs: Time) -> Time {
        Time(self.0 - rhs.0)
    }
}

impl Neg for Time {
    type Output = Time;
    #[inline]
    fn neg(self) -> Time {
        Time(-self.0)
    }
}

impl Mul<i64> for Time {
    type Output = Time;
    #[inline]
    fn mul(self, rhs: i64) -> Time {
        Time(self.0 * rhs)
    }
}

impl fmt::Display for Time {
    /// Prints with the largest unit that leaves at least one digit before the point.
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let fs = self.0 as f64;
        let (value, unit) = match self.0.unsigned_abs() {
            0..1_000 => return write!(f, "{} fs", self.0),
            1_000..1_000_000 => (fs * 1e-3, "ps"),
            1_000_000..1_000_000_000 => (fs * 1e-6, "ns"),
            1_000_000_000..1_000_000_000_000 => (fs * 1e-9, "us"),
            1_000_000_000_000..1_000_000_000_000_000 => (fs * 1e-12, "ms"),
            _ => (fs * 1e-15, "s"),
        };
        write!(f, "{value:.3} {unit}")
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn units_and_operations_are_those_of_whole_femtoseconds() {
        let time = Time::from_fs(2_500_000);
        assert_eq!([Time::from_ps(2_500), Time::from_s(2.5e-9)], [time; 2]);
        assert_eq!([time.as_s(), time.as_ns()], [2.5e-9, 2.5]);
        let mut sum = time + Time::from_fs(7);
        sum += Time::from_fs(5);
        assert_eq!(sum - time, Time::from_fs(12));
        assert_eq!([-sum, sum * 3].map(Time::as_fs), [-2_500_012, 7_500_036]);
    }

    #[test]
    fn prints_with_the_largest_unit_below() {
        for (power, unit) in [(3, "ps"), (6, "ns"), (9, "us"), (12, "ms"), (15, "s")] {
            let fs = 10i64.pow(power);
            assert_eq!(Time::from_fs(fs).to_string(), format!("1.000 {unit}"));
            assert!(
                !Time::from_fs(fs - 1)
                    .to_string()
                    .ends_with(&format!(" {unit}"))
            );
        }
    }

    #[test]
    fn prints_with_a_readable_unit() {
        assert_eq!(Time::from_fs(12).to_string(), "12 fs");
        assert_eq!(Time::from_fs(1_200_000).to_string(), "1.200 ns");
        assert_eq!(Time::from_ns(-2_500).to_string(), "-2.500 us");
    }
}
