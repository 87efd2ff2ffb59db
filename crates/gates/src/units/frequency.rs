//! Clock frequencies as exact ratios, and clock edges computed from their number.
//!
//! 384 MHz has a period of 15625/6 ps, which no binary or decimal fraction of a femtosecond
//! holds. Accumulating a rounded period drifts; computing edge k from k does not, so edge 10¹²
//! is as exact as edge 1.

use super::Time;

const FS_PER_S: i128 = 1_000_000_000_000_000;

/// An exact clock frequency, a ratio of integers in hertz.
///
/// # Example
///
/// ```
/// use femtogate::units::{Frequency, Time};
///
/// // A period of 384 MHz is 15625/6 ps; errors of rounding do not add up.
/// let clock = Frequency::from_hz(384_000_000);
/// assert_eq!(clock.period(), Time::from_fs(2_604_167));
/// assert_eq!(clock.periods(6), Time::from_ps(15_625));
/// assert_eq!(Frequency::from_period(Time::from_ns(2))?, Frequency::from_hz(500_000_000));
/// # Ok::<(), femtogate::units::FrequencyError>(())
/// ```
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash)]
pub struct Frequency {
    numerator: u64,
    denominator: u64,
}

/// Why a number is no clock frequency.
#[derive(Debug, Clone, Copy, PartialEq, thiserror::Error)]
#[non_exhaustive]
pub enum FrequencyError {
    /// Zero, negative, infinite or NaN.
    #[error("{0} Hz is not a clock frequency: give a positive, finite number of hertz")]
    NotPositive(f64),
    /// Outside 1 Hz … 1 THz.
    #[error("{0} Hz is outside the modelled range of 1 Hz to 1 THz")]
    OutOfRange(f64),
}

impl Frequency {
    /// A whole number of hertz, 1 ≤ `hz` ≤ 10¹².
    ///
    /// # Panics
    /// When `hz` is outside that range.
    pub const fn from_hz(hz: u64) -> Self {
        assert!(
            hz >= 1 && hz <= 1_000_000_000_000,
            "frequency outside 1 Hz to 1 THz"
        );
        Frequency {
            numerator: hz,
            denominator: 1,
        }
    }

    /// The frequency nearest to `hz` in steps of 1 µHz.
    ///
    /// # Errors
    /// When `hz` is not a number from 1 to 10¹².
    pub fn from_hz_f64(hz: f64) -> Result<Self, FrequencyError> {
        if !(hz.is_finite() && hz > 0.0) {
            return Err(FrequencyError::NotPositive(hz));
        }
        if !(1.0..=1e12).contains(&hz) {
            return Err(FrequencyError::OutOfRange(hz));
        }
        Ok(Self::reduced((hz * 1e6).round() as u64, 1_000_000))
    }

    /// The frequency whose period is exactly `period` (1 ps … 1 s).
    ///
    /// # Errors
    /// When the period is outside that range.
    pub fn from_period(period: Time) -> Result<Self, FrequencyError> {
        let fs = period.as_fs();
        if fs <= 0 {
            return Err(FrequencyError::NotPositive(1e15 / fs as f64));
        }
        if !(1_000..=FS_PER_S as i64).contains(&fs) {
            return Err(FrequencyError::OutOfRange(1e15 / fs as f64));
        }
        Ok(Self::reduced(FS_PER_S as u64, fs as u64))
    }

    fn reduced(numerator: u64, denominator: u64) -> Self {
        let (mut a, mut b) = (numerator, denominator);
        while b != 0 {
            (a, b) = (b, a % b);
        }
        Frequency {
            numerator: numerator / a,
            denominator: denominator / a,
        }
    }

    /// In hertz.
    pub fn as_hz(self) -> f64 {
        self.numerator as f64 / self.denominator as f64
    }

    /// The period, rounded to the nearest femtosecond. For edges far away use
    /// [`Frequency::half_periods`], which never accumulates this rounding.
    pub fn period(self) -> Time {
        self.half_periods(2)
    }

    /// The time of `k` half periods, rounded to the nearest femtosecond (halves up).
    ///
    /// With a falling edge at `k = 0`, even `k` are falling edges and odd `k` rising ones.
    #[inline]
    pub fn half_periods(self, k: i64) -> Time {
        let numerator = k as i128 * FS_PER_S * self.denominator as i128 + self.numerator as i128;
        Time::from_fs(numerator.div_euclid(2 * self.numerator as i128) as i64)
    }

    /// The time of `k` whole periods, rounded as in [`Frequency::half_periods`].
    #[inline]
    pub fn periods(self, k: i64) -> Time {
        self.half_periods(2 * k)
    }

    /// How many whole femtoseconds `k` periods last: the shortest distance of two edges `k` periods apart.
    pub fn whole_fs(self, k: i64) -> i64 {
        let numerator = k as i128 * FS_PER_S * self.denominator as i128;
        numerator.div_euclid(self.numerator as i128) as i64
    }

    /// The length of one of 2^`bits` equal parts of a period, for `bits` up to 30: whole femtoseconds, and what is left
    /// over in units of 2⁻⁶⁴ fs, rounded down.
    pub fn part_fs(self, bits: u32) -> (u64, u64) {
        let step = FS_PER_S as u128 * u128::from(self.denominator);
        let parts = u128::from(self.numerator) << bits;
        let (whole, rest) = (step / parts, step % parts);
        let (high, rest) = ((rest << 32) / parts, (rest << 32) % parts);
        let low = (rest << 32) / parts;
        (whole as u64, (high << 32 | low) as u64)
    }

    /// The times of half periods `first`, `first` + 1, … without end: the same as [`Frequency::half_periods`] of
    /// each, by addition with an exact remainder.
    pub fn ticks(self, first: i64) -> impl Iterator<Item = Time> + Send {
        let modulus = 2 * self.numerator;
        let step = FS_PER_S * self.denominator as i128;
        let quotient = (step / modulus as i128) as i64;
        let remainder = (step % modulus as i128) as u64;
        let mut time = self.half_periods(first);
        let start = first as i128 * step + self.numerator as i128;
        let mut fraction = start.rem_euclid(modulus as i128) as u64;
        std::iter::from_fn(move || {
            let tick = time;
            time += Time::from_fs(quotient);
            fraction += remainder;
            if fraction >= modulus {
                fraction -= modulus;
                time += Time::from_fs(1);
            }
            Some(tick)
        })
    }

    /// The times of every `periods`-th whole period.
    pub fn every(self, periods: u32) -> Every {
        let modulus = 2 * self.numerator;
        let step = 2 * i128::from(periods) * FS_PER_S * i128::from(self.denominator);
        Every {
            whole_fs: (step / i128::from(modulus)) as i64,
            rest: (step % i128::from(modulus)) as u64,
            modulus,
        }
    }

    /// How many whole half periods lie in `[0, t]`: the largest `k` with `half_periods(k) <= t`.
    pub fn half_periods_until(self, t: Time) -> i64 {
        let guess = (t.as_fs() as i128 * 2 * self.numerator as i128)
            .div_euclid(FS_PER_S * self.denominator as i128) as i64;
        let mut k = guess - 1;
        while self.half_periods(k + 1) <= t {
            k += 1;
        }
        k
    }
}

/// The times of every n-th period of a clock: those of [`Frequency::periods`], without a long division where the
/// clock's frequency has few digits.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Every {
    whole_fs: i64,
    rest: u64,
    modulus: u64,
}

impl Every {
    /// The `n`-th of them; the first is number 0, at time 0.
    #[inline]
    pub fn time(&self, n: u32) -> Time {
        let half = self.modulus / 2;
        let short = self.rest.checked_mul(n.into());
        let rest = match short.and_then(|rest| rest.checked_add(half)) {
            Some(rest) => rest / self.modulus,
            None => {
                let rest = u128::from(self.rest) * u128::from(n) + u128::from(half);
                (rest / u128::from(self.modulus)) as u64
            }
        };
        Time::from_fs(i64::from(n) * self.whole_fs + rest as i64)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    #[test]
    fn edges_do_not_drift_after_a_million_million_cycles() {
        let clk = Frequency::from_hz(384_000_000);
        // 10¹² periods of 15625/6 ps are 2604166666666666.67 ps.
        let t = clk.periods(1_000_000_000_000);
        assert_eq!(t.as_fs(), 2_604_166_666_666_666_667);
        assert_eq!(clk.period(), Time::from_fs(2_604_167));
    }

    #[test]
    fn impossible_frequencies_are_refused() {
        use FrequencyError::{NotPositive, OutOfRange};
        for hz in [0.0, -1.0, f64::INFINITY] {
            assert_eq!(Frequency::from_hz_f64(hz), Err(NotPositive(hz)));
        }
        let nan = Frequency::from_hz_f64(f64::NAN);
        assert!(matches!(nan, Err(NotPositive(_))));
        for hz in [0.5, 2e12] {
            assert_eq!(Frequency::from_hz_f64(hz), Err(OutOfRange(hz)));
        }
        let from_period_fs = |fs| Frequency::from_period(Time::from_fs(fs));
        assert_eq!(from_period_fs(0), Err(NotPositive(f64::INFINITY)));
        assert_eq!(from_period_fs(-4), Err(NotPositive(-2.5e14)));
        assert_eq!(from_period_fs(500), Err(OutOfRange(2e12)));
        assert_eq!(Frequency::from_hz_f64(1.5).unwrap().as_hz(), 1.5);
    }

    proptest! {
        #[test]
        fn every_edge_is_within_half_a_femtosecond(hz in 1_000u64..1_000_000_000_000, k in 0i64..1_000_000) {
            let f = Frequency::from_hz(hz);
            let exact_times_2hz = k as i128 * FS_PER_S;
            let got_times_2hz = f.half_periods(k).as_fs() as i128 * 2 * hz as i128;
            prop_assert!((exact_times_2hz - got_times_2hz).abs() <= hz as i128);
        }

        #[test]
        fn half_periods_until_inverts_half_periods(hz in 1e6f64..1e10, k in -1_000_000i64..1_000_000) {
            let f = Frequency::from_hz_f64(hz).unwrap();
            let t = f.half_periods(k);
            prop_assert_eq!(f.half_periods_until(t), k);
            prop_assert_eq!(f.half_periods_until(t - Time::from_fs(1)), k - 1);
        }

        #[test]
        fn no_two_edges_are_closer_than_the_whole_femtoseconds(
            hz in 1e6f64..1e10,
            k in 1i64..10_000,
            from in 0i64..1_000_000,
        ) {
            let f = Frequency::from_hz_f64(hz).unwrap();
            let apart = (f.periods(from + k) - f.periods(from)).as_fs();
            prop_assert!((0..=1).contains(&(apart - f.whole_fs(k))));
        }

        #[test]
        fn ticks_are_the_half_periods(hz in 1e6f64..2e9, first in -1_000_000_000i64..1_000_000_000) {
            let f = Frequency::from_hz_f64(hz).unwrap();
            let mut ticks = f.ticks(first);
            for k in first..first + 10_000 {
                prop_assert_eq!(ticks.next(), Some(f.half_periods(k)));
            }
        }

        #[test]
        fn a_part_is_that_of_a_long_division(hz in 1.0f64..1e12, bits in 0u32..=30) {
            let f = Frequency::from_hz_f64(hz).unwrap();
            let step = FS_PER_S as u128 * u128::from(f.denominator);
            let parts = u128::from(f.numerator) << bits;
            let (mut rest, mut digits) = (step % parts, 0);
            for _ in 0..64 {
                rest *= 2;
                digits = 2 * digits + u64::from(rest >= parts);
                rest -= if rest >= parts { parts } else { 0 };
            }
            prop_assert_eq!(f.part_fs(bits), ((step / parts) as u64, digits));
        }

        #[test]
        fn every_so_manyth_period_is_that_period(
            hz in prop_oneof![1e3f64..2e9, (1u32..2_000).prop_map(|mhz| f64::from(mhz) * 1e6)],
            periods in 1u32..10_000,
            n in prop_oneof![0u32..100_000, any::<u32>()],
        ) {
            let f = Frequency::from_hz_f64(hz).unwrap();
            let k = i64::from(n) * i64::from(periods);
            prop_assume!((k as f64) < 9e3 * hz);
            prop_assert_eq!(f.every(periods).time(n), f.periods(k));
        }

        #[test]
        fn a_period_round_trips(fs in 1_000i64..1_000_000_000) {
            let f = Frequency::from_period(Time::from_fs(fs)).unwrap();
            prop_assert_eq!(f.period(), Time::from_fs(fs));
        }
    }
}
