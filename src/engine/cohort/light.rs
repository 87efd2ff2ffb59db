//! Mean photons on one SPAD in any stretch of time, relative to the STOP edge of some laser cycle.
//!
//! The light is that of the photon stream: background and dark counts evenly, the echo as a Gaussian that is cut off
//! at the ends of its laser cycle. It repeats with the laser cycle, so that a window that begins before STOP sees the
//! tail of the cycle before.

use std::ops::Range;

use smallvec::{SmallVec, smallvec};

use super::FEW_STEPS;
use crate::photon::{PixelLight, SPADS, StreamConfig, pulse_shares};

/// Standard deviations within which the echo lies: 2·10⁻¹⁹ of it is outside.
const ECHO_REACH: f64 = 9.0;

/// Mean photons below which [`absorbed_dim`] holds.
pub const DIM: f64 = 0.015;

/// Probability of a photon where `mean` are expected.
pub fn absorbed(mean: f64) -> f64 {
    match mean < DIM {
        true => absorbed_dim(mean),
        false => -libm::expm1(-mean),
    }
}

/// As [`absorbed`], for means below [`DIM`]: seven terms of the series are all there is to it.
#[inline(always)]
pub fn absorbed_dim(mean: f64) -> f64 {
    const PARTS: [f64; 6] = [
        1.0 / 7.0,
        1.0 / 6.0,
        1.0 / 5.0,
        1.0 / 4.0,
        1.0 / 3.0,
        1.0 / 2.0,
    ];
    let series = PARTS
        .iter()
        .fold(1.0, |series, part| 1.0 - mean * part * series);
    mean * series
}

/// Light on one SPAD of a macropixel. Times in femtoseconds.
#[derive(Debug, Clone, Copy)]
pub struct SpadLight {
    cycle_fs: f64,
    arrival_fs: f64,
    sigma_fs: f64,
    signal: f64,
    background_per_fs: f64,
}

impl SpadLight {
    /// A sixteenth of `light`.
    pub fn new(config: &StreamConfig, light: &PixelLight) -> Self {
        SpadLight {
            cycle_fs: config.cycle_s() * 1e15,
            arrival_fs: light.arrival.as_fs() as f64,
            sigma_fs: config.pulse_sigma.as_fs() as f64,
            signal: light.signal_per_cycle / SPADS as f64,
            background_per_fs: light.background_hz * 1e-15 / SPADS as f64,
        }
    }

    /// Mean background photons in `duration_fs`.
    pub fn background(&self, duration_fs: f64) -> f64 {
        self.background_per_fs * duration_fs
    }

    /// Where the echo of laser cycle `cycle` is to be found; `None` where there is none.
    pub fn echo(&self, cycle: f64) -> Option<Range<f64>> {
        let start = cycle * self.cycle_fs;
        let centre = start + self.arrival_fs;
        let reach = ECHO_REACH * self.sigma_fs;
        let from = (centre - reach).max(start);
        // A pulse without width is somewhere within a femtosecond.
        let to = (centre + reach + 1.0).min(start + self.cycle_fs);
        (self.signal > 0.0 && from < to).then_some(from..to)
    }

    /// Mean photons in `count` successive steps of `step_fs` from `from_fs` on, dark before `dark_until_fs`.
    pub fn steps(
        &self,
        from_fs: f64,
        step_fs: f64,
        count: usize,
        dark_until_fs: f64,
    ) -> SmallVec<[f64; FEW_STEPS]> {
        let edge = |i: usize| from_fs + step_fs * i as f64;
        let mut means: SmallVec<_> = smallvec![self.background(step_fs); count];
        if dark_until_fs > from_fs {
            for (i, mean) in means.iter_mut().enumerate() {
                let lit = (edge(i + 1) - edge(i).max(dark_until_fs)).max(0.0);
                *mean = self.background(lit);
            }
        }
        let first = (from_fs / self.cycle_fs).floor() as i64;
        let last = (edge(count) / self.cycle_fs).floor() as i64;
        for cycle in first..=last {
            let Some(echo) = self.echo(cycle as f64) else {
                continue;
            };
            let centre = cycle as f64 * self.cycle_fs + self.arrival_fs;
            let from_step = ((echo.start - from_fs) / step_fs).floor().max(0.0) as usize;
            let to_step = ((echo.end - from_fs) / step_fs)
                .ceil()
                .clamp(0.0, count as f64) as usize;
            let bounds = echo.start.max(dark_until_fs)..echo.end;
            let first = bounds.start.min(bounds.end);
            if from_step >= to_step {
                continue;
            }
            let time = |i: usize| edge(from_step + i).clamp(first, bounds.end) - centre;
            let mut shares: SmallVec<[f64; FEW_STEPS]> = smallvec![0.0; to_step - from_step];
            pulse_shares(time, self.sigma_fs, &mut shares);
            for (mean, share) in means[from_step..to_step].iter_mut().zip(shares) {
                *mean += self.signal * share;
            }
        }
        means
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::photon::SpadModel;
    use crate::units::{Frequency, Time};

    fn config() -> StreamConfig {
        StreamConfig {
            seed: 0,
            clock: Frequency::from_hz(100_000_000),
            stop_periods: 100,
            laser_cycles: 1,
            lead: Time::ZERO,
            pulse_sigma: Time::from_ns(2),
            pulse_shape: None,
            spads: SpadModel::with_dead_time(Time::from_ns(30)),
        }
    }

    fn light(arrival_ns: i64) -> SpadLight {
        let light = PixelLight {
            signal_per_cycle: 16.0,
            arrival: Time::from_ns(arrival_ns),
            background_hz: 16e6,
        };
        SpadLight::new(&config(), &light)
    }

    const NS: f64 = 1e6;

    #[test]
    fn a_whole_cycle_holds_echo_and_background() {
        let sum: f64 = light(500).steps(0.0, 10.0 * NS, 100, 0.0).iter().sum();
        assert!((sum - 2.0).abs() < 1e-12, "{sum}");
        let elsewhere: f64 = light(500)
            .steps(300.0 * NS, 10.0 * NS, 100, 0.0)
            .iter()
            .sum();
        assert!((elsewhere - 2.0).abs() < 1e-12, "{elsewhere}");
    }

    #[test]
    fn an_echo_is_cut_off_at_the_ends_of_its_cycle() {
        // Half of an echo at the very start of its cycle would come before it.
        let sum: f64 = light(0)
            .steps(-500.0 * NS, 10.0 * NS, 100, f64::MIN)
            .iter()
            .sum();
        assert!((sum - 1.5).abs() < 1e-12, "{sum}");
        let late: f64 = light(999).steps(0.0, 10.0 * NS, 100, 0.0).iter().sum();
        assert!(late < 2.0 - 0.3, "{late}");
    }

    #[test]
    fn a_window_before_stop_sees_the_previous_echo_unless_it_is_dark() {
        let before = |dark_until| light(990).steps(-20.0 * NS, 10.0 * NS, 2, dark_until);
        assert!(before(f64::MIN).iter().sum::<f64>() > 0.99);
        assert_eq!(before(0.0).to_vec(), [0.0, 0.0]);
    }
}
