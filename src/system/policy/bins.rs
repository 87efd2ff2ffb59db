//! Bins from the guide's own uncertainty: how slow CLK must be for windows to hold its estimates (thesis Eq. 25).
//!
//! CLK is one for the whole chip, so that what counts is the share over all macropixels: those of which the guide is sure have windows
//! wider than they need, those of which it is not, narrower ones.

use super::WindowPolicy;
use crate::chip::{Exposure, Sensor, SensorConfig, Tdc, WindowLaw};
use crate::guide::GuideMap;
use crate::theory::design::share_inside;
use crate::units::SPEED_OF_LIGHT_M_PER_S;

/// By how much CLK slows down from one attempt to the next.
const FINER: f64 = 1.005;

/// Longest bin that is tried, m: windows of the shortest histograms then reach farther than any guide.
const LONGEST_BIN_M: f64 = 100.0;

/// Share of a map's estimates whose targets windows with bins of `bin_m` hold, if the guide errs as it claims; 1 without estimates.
pub fn share_held(guide: &GuideMap, sensor: &SensorConfig, bin_m: f64) -> f64 {
    let (window_m, step_m) = (
        sensor.bins as f64 * bin_m,
        sensor.step_periods as f64 * bin_m,
    );
    let estimates = (0..guide.range_m.len()).filter_map(|pixel| guide.estimate_of(pixel));
    let (count, held) = estimates.fold((0.0, 0.0), |(count, held), (_, sigma_m)| {
        let share = match sigma_m > 0.0 {
            true => share_inside(sigma_m, window_m, step_m),
            false => 1.0,
        };
        (count + 1.0, held + share)
    });
    if count > 0.0 { held / count } else { 1.0 }
}

impl WindowPolicy {
    /// The sensor with the fastest CLK, no faster than its own, with which windows hold `within` of what the guide claims, and CLK periods of a
    /// laser cycle that lasts as long as `stop_periods` of its own; `None` where bins are no CLK periods, or none is long enough.
    pub fn slowed(
        &self,
        guide: &GuideMap,
        sensor: &Sensor,
        stop_periods: u32,
    ) -> Option<(Sensor, u32)> {
        if sensor.tdc != Tdc::Clocked {
            return None;
        }
        let own_bin_m = SPEED_OF_LIGHT_M_PER_S / (2.0 * sensor.clk_hz);
        let mut slower = 1.0;
        while own_bin_m * slower <= LONGEST_BIN_M {
            let slowed = Sensor::from(SensorConfig {
                clk_hz: sensor.clk_hz / slower,
                ..SensorConfig::clone(sensor)
            });
            let periods = (f64::from(stop_periods) / slower).ceil() as u32;
            let holds = share_held(guide, sensor, own_bin_m * slower) >= self.within;
            // At some periods two signals meet and no window can be aimed.
            if holds
                && let Ok(exposure) = Exposure::checked(&slowed, periods, 1)
                && WindowLaw::new(&slowed, &exposure).refusal().is_none()
            {
                return Some((slowed, periods));
            }
            slower *= FINER;
        }
        None
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::chip::hslidar_delay_line;
    use crate::photon::{Purpose, normal, random_stream};
    use crate::units::Time;

    fn map(sigma_m: f64) -> GuideMap {
        GuideMap::new(
            2,
            2,
            [Some((60.0, sigma_m)), None, Some((80.0, sigma_m)), None],
        )
    }

    #[test]
    fn windows_of_the_slowed_chip_hold_the_share_that_is_asked_for() {
        let sensor = Sensor::default();
        let (policy, sigma_m) = (WindowPolicy::default(), 2.5);
        let (slowed, periods) = policy.slowed(&map(sigma_m), &sensor, 520).unwrap();
        // Eq. 25 asks for bins of 6·2.5/16 m = 0.94 m; 99.7 % and centres on the grid change that by a hundredth.
        let bin_m = SPEED_OF_LIGHT_M_PER_S / (2.0 * slowed.clk_hz);
        assert!((bin_m / 0.9375 - 1.0).abs() < 0.02, "{bin_m}");
        let law = WindowLaw::new(&slowed, &Exposure::new(&slowed, periods, 1));
        let inside = (0..20_000).filter(|&n| {
            let mut random = random_stream(1, Purpose::Guide, n, 0);
            let true_m = 80.0 + 0.013 * f64::from(n % 100);
            let guide_m = true_m + sigma_m * normal(&mut random);
            let start = law.start_for(Time::of_flight(guide_m)).unwrap();
            let window = law.interval(&law.window(start).open().unwrap());
            window.contains(&Time::of_flight(true_m))
        });
        let share = inside.count() as f64 / 20_000.0;
        // Four standard errors of 0.0004.
        assert!((share - 0.997).abs() < 0.0016, "{share}");
    }

    #[test]
    fn a_guide_that_is_sure_leaves_clk_alone_and_one_that_knows_nothing_has_no_bin() {
        let sensor = Sensor::default();
        let policy = WindowPolicy::default();
        let (same, periods) = policy.slowed(&map(0.1), &sensor, 520).unwrap();
        assert_eq!((same, periods), (sensor.clone(), 520));
        assert_eq!(policy.slowed(&map(1e4), &sensor, 520), None);
        assert_eq!(policy.slowed(&map(0.1), &hslidar_delay_line(), 520), None);
    }
}
