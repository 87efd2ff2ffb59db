//! The clocks of an exposure: where every CLK and STOP edge lies.
//!
//! Time 0 is the first rising edge of STOP. CLK falls with it, or `stop_phase` earlier. Falling CLK edge
//! k comes at k·T − phase, rising edge k half a period later, and STOP rises every `stop_periods` CLK
//! periods. All edges are computed from their number, in whole femtoseconds.

use crate::units::{Frequency, Time};

use super::config::SensorConfig;

/// When the chip's clocks tick during one exposure.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Exposure {
    /// CLK.
    pub clock: Frequency,
    /// Rise of STOP after CLK's fall.
    pub stop_phase: Time,
    /// CLK periods in a laser cycle, at least 2.
    pub stop_periods: u32,
    /// Laser cycles, at least 1.
    pub laser_cycles: u32,
}

/// Longest exposure, s. GTKWave refuses times beyond 2⁵³ fs, which is 9.007 s.
const LONGEST_S: f64 = 9.0;

/// Why an exposure cannot have this length.
#[derive(Debug, Clone, Copy, PartialEq, thiserror::Error)]
pub enum ExposureError {
    /// STOP needs a CLK period high and one low.
    #[error("{stop_periods} CLK periods are no laser cycle; give at least 2")]
    ShortCycle {
        /// CLK periods in a laser cycle.
        stop_periods: u32,
    },
    /// There is no laser cycle.
    #[error("an exposure needs a laser cycle; give at least 1")]
    NoCycle,
    /// Waveforms of it could not be shown.
    #[error(
        "{stop_periods} CLK periods times {laser_cycles} laser cycles last {seconds:.1} s; stay below {LONGEST_S} s"
    )]
    TooLong {
        /// CLK periods in a laser cycle.
        stop_periods: u32,
        /// Laser cycles.
        laser_cycles: u32,
        /// How long they last, s.
        seconds: f64,
    },
}

impl Exposure {
    /// An exposure of the given length on this sensor, checked.
    ///
    /// # Errors
    /// When it has no laser cycle, a laser cycle shorter than two CLK periods, or lasts longer than 9 s.
    pub fn checked(
        config: &SensorConfig,
        stop_periods: u32,
        laser_cycles: u32,
    ) -> Result<Self, ExposureError> {
        let seconds = f64::from(stop_periods) * f64::from(laser_cycles) / config.clk_hz;
        if stop_periods < 2 {
            return Err(ExposureError::ShortCycle { stop_periods });
        }
        if laser_cycles == 0 {
            return Err(ExposureError::NoCycle);
        }
        if seconds > LONGEST_S {
            return Err(ExposureError::TooLong {
                stop_periods,
                laser_cycles,
                seconds,
            });
        }
        Ok(Self::new(config, stop_periods, laser_cycles))
    }

    /// An exposure of the given length on this sensor.
    pub fn new(config: &SensorConfig, stop_periods: u32, laser_cycles: u32) -> Self {
        Exposure {
            clock: config.clock(),
            stop_phase: config.stop_phase(),
            stop_periods,
            laser_cycles,
        }
    }

    /// Falling CLK edge `k`.
    pub fn falling(&self, k: i64) -> Time {
        self.clock.half_periods(2 * k) - self.stop_phase
    }

    /// Rising CLK edge `k`, half a period after falling edge `k`.
    pub fn rising(&self, k: i64) -> Time {
        self.clock.half_periods(2 * k + 1) - self.stop_phase
    }

    /// The last rising CLK edge at or before `time`.
    pub(crate) fn rising_until(&self, time: Time) -> i64 {
        (self.clock.half_periods_until(time + self.stop_phase) - 1).div_euclid(2)
    }

    /// Rising STOP edge `cycle`.
    pub fn stop(&self, cycle: i64) -> Time {
        self.clock.periods(cycle * self.stop_periods as i64)
    }

    /// Falling STOP edge of `cycle`, about half a laser cycle after its rising edge.
    pub fn stop_fall(&self, cycle: i64) -> Time {
        let periods = self.stop_periods as i64;
        self.clock.periods(cycle * periods + periods.div_euclid(2))
    }

    /// The end of the last laser cycle: one more STOP edge.
    pub fn end(&self) -> Time {
        self.stop(self.laser_cycles as i64)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    #[test]
    fn what_no_chip_runs_is_refused() {
        let config = SensorConfig::default();
        let checked =
            |stop_periods, laser_cycles| Exposure::checked(&config, stop_periods, laser_cycles);
        assert!(matches!(
            checked(1, 5),
            Err(ExposureError::ShortCycle { stop_periods: 1 })
        ));
        assert!(matches!(checked(2, 0), Err(ExposureError::NoCycle)));
        // At 384 MHz 9 s are 3 456 000 000 CLK periods.
        assert_eq!(checked(2, 1), Ok(Exposure::new(&config, 2, 1)));
        assert_eq!(
            checked(1000, 3_456_000),
            Ok(Exposure::new(&config, 1000, 3_456_000))
        );
        let too_long = checked(1000, 3_456_001);
        assert!(matches!(too_long, Err(ExposureError::TooLong { seconds, .. }) if seconds > 9.0));
        let exposure = checked(7, 3).unwrap();
        let period = config.clock().period().as_s();
        let periods = [exposure.stop_fall(2), exposure.stop(2), exposure.end()]
            .map(|t| (t.as_s() / period).round());
        assert_eq!(periods, [17.0, 14.0, 21.0]);
    }

    proptest! {
        #[test]
        fn rising_until_finds_its_edge(hz in 1e8f64..1e9, phase_ps in -400i64..400, k in -2000i64..2_000_000) {
            let exposure = Exposure {
                clock: Frequency::from_hz_f64(hz).unwrap(),
                stop_phase: Time::from_ps(phase_ps),
                stop_periods: 520,
                laser_cycles: 1,
            };
            let edge = exposure.rising(k);
            prop_assert_eq!(exposure.rising_until(edge), k);
            prop_assert_eq!(exposure.rising_until(edge - Time::from_fs(1)), k - 1);
        }
    }
}
