//! What a light is on average: the figures that a golden model of a chip is fed with, beside the pulses.

use super::{PixelLight, Segment, SpadSpread};
use crate::units::Time;

/// Light averaged over an exposure. Other lasers are in none of its rates.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct MeanLight {
    /// Detected signal photons of all echoes in a laser cycle, before dead time.
    pub signal_per_cycle: f64,
    /// Detected background photons and dark counts of all SPADs per second, before dead time.
    pub background_hz: f64,
    /// When the centre of the brightest echo comes after the start of its laser cycle; `None` without an echo.
    pub arrival: Option<Time>,
}

impl PixelLight {
    /// The means over an exposure of `laser_cycles` laser cycles (at least 1) of length `cycle`.
    pub fn mean(&self, laser_cycles: u32, cycle: Time) -> MeanLight {
        let factor = self.spads.as_ref().map_or(1.0, SpadSpread::mean_factor);
        let dark_hz = self.spads.as_ref().map_or(0.0, SpadSpread::total_dark_hz);
        let ends = self.later.iter().map(|segment| segment.first_cycle);
        let segments = self.segments().zip(ends.chain([u32::MAX]));
        let (mut signal, mut background_hz) = (0.0, 0.0);
        let mut brightest: Option<(f64, Time)> = None;
        for (segment, end) in segments {
            let cycles = end.min(laser_cycles).saturating_sub(segment.first_cycle);
            let weight = f64::from(cycles) / f64::from(laser_cycles);
            signal += weight * segment.signal_per_cycle();
            background_hz += weight * segment.mean_background_hz(cycle);
            for echo in segment.echoes().filter(|_| cycles > 0) {
                let photons = weight * echo.photons;
                if brightest.is_none_or(|(most, _)| photons > most) {
                    brightest = Some((photons, echo.arrival));
                }
            }
        }
        MeanLight {
            signal_per_cycle: signal * factor,
            background_hz: background_hz * factor + dark_hz,
            arrival: brightest.map(|(_, arrival)| arrival),
        }
    }
}

impl Segment {
    /// Constant background, and the mean of the profile over a laser cycle.
    fn mean_background_hz(&self, cycle: Time) -> f64 {
        let within = |profile: &super::Profile| profile.photons(0.0, cycle.as_fs() as f64);
        let photons = self.profile.as_deref().map_or(0.0, within);
        self.background_hz + photons / cycle.as_s()
    }
}

#[cfg(test)]
mod tests {
    use super::super::{Echo, Profile};
    use super::*;

    #[test]
    fn segments_count_by_their_laser_cycles() {
        let near = PixelLight::echo(1.0, Time::from_ns(100)).with_background(1e6);
        let far = PixelLight::echo(4.0, Time::from_ns(200))
            .with_echo(Echo::new(2.0, Time::from_ns(300)))
            .with_background(5e6);
        let light = PixelLight::timeline([(0, near), (30, far)]).unwrap();
        let cycle = Time::from_ns(1000);
        let mean = light.mean(40, cycle);
        assert!((mean.signal_per_cycle - (0.75 * 1.0 + 0.25 * 6.0)).abs() < 1e-12);
        assert!((mean.background_hz - 2e6).abs() < 1e-6);
        assert_eq!(mean.arrival, Some(Time::from_ns(200)));
        // What begins after the exposure is none of it.
        let mean = light.mean(20, cycle);
        assert_eq!(mean.signal_per_cycle, 1.0);
        assert_eq!(mean.arrival, Some(Time::from_ns(100)));
    }

    #[test]
    fn profiles_and_unlike_spads_are_in_the_background() {
        let edges = [0, 100, 300].map(Time::from_ns);
        let profile = Profile::new(&edges, &[2e6, 1e6]).unwrap();
        let spads = SpadSpread::new(&[0.5, 1.0], &[3.0, 4.0]).unwrap();
        let light = PixelLight::background(1e6)
            .with_profile(profile)
            .with_spads(spads);
        let mean = light.mean(7, Time::from_ns(1000));
        let expected = 0.75 * (1e6 + 0.1 * 2e6 + 0.2 * 1e6) + 7.0;
        assert!((mean.background_hz - expected).abs() < 1e-6, "{mean:?}");
        assert_eq!((mean.signal_per_cycle, mean.arrival), (0.0, None));
    }
}
