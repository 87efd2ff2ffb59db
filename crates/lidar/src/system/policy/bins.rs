//! Bins from the guide's own uncertainty: how slow CLK must be for windows to hold its estimates (thesis Eq. 25).
//!
//! CLK is one for the whole chip, so that what counts is the share over all macropixels: those of which the guide is sure have windows
//! wider than they need, those of which it is not, narrower ones. Windows are those that start values open within the laser cycle: with a slow CLK
//! the first one opens late, and what is nearer is in none.
//!
//! A bin is worth having while it tells more than the guide: rounding to it, bin/√12, is then less than what the guide claims for half of its
//! estimates. Slower than that CLK does not get.

use super::{WindowPolicy, normal_between};
use crate::chip::{Exposure, Sensor, SensorConfig, Tdc, WindowLaw};
use crate::guide::GuideMap;
use crate::theory::design::share_inside;
use crate::units::{SPEED_OF_LIGHT_M_PER_S, Time, TimeOfFlight};

/// By how much CLK slows down from one attempt to the next.
const FINER: f64 = 1.005;

/// Why a guide's claims make no bins.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
#[non_exhaustive]
pub enum NoBins {
    /// Bins are those of delay lines.
    #[error("bins of delay lines do not follow CLK; leave it out")]
    DelayLines,
    /// Not even the longest bins worth having are enough.
    #[error(
        "windows hold at most {:.1} % of what this guide claims, with bins of {bin_m:.2} m, and longer bins would be less precise than the guide", 100.0 * share
    )]
    Unsure {
        /// Share that is held.
        share: f64,
        /// By bins of this length, m.
        bin_m: f64,
    },
}

/// Share of a map's estimates whose targets the windows of a law hold, if the guide errs as it claims; 1 without estimates.
fn share_held(guide: &GuideMap, law: &WindowLaw) -> f64 {
    let held = estimates(guide).map(|(range_m, sigma_m)| {
        let start = law.start_for(Time::of_flight(range_m));
        let Some(window) = start.and_then(|start| law.window(start).open()) else {
            return 0.0;
        };
        let seen = law.interval(&window);
        normal_between(
            &(seen.start.as_range_m()..seen.end.as_range_m()),
            range_m,
            sigma_m,
        )
    });
    mean(held)
}

/// The same of windows that open wherever they are wanted: no law's are better.
fn share_held_at_best(guide: &GuideMap, sensor: &SensorConfig, bin_m: f64) -> f64 {
    let [window_m, step_m] = [sensor.bins, sensor.step_periods].map(|bins| bins as f64 * bin_m);
    mean(estimates(guide).map(|(_, sigma_m)| {
        if sigma_m > 0.0 {
            share_inside(sigma_m, window_m, step_m)
        } else {
            1.0
        }
    }))
}

fn estimates(guide: &GuideMap) -> impl Iterator<Item = (f64, f64)> {
    (0..guide.range_m.len()).filter_map(|pixel| guide.estimate_of(pixel))
}

fn mean(shares: impl Iterator<Item = f64>) -> f64 {
    let (count, sum) = shares.fold((0.0, 0.0), |(count, sum), share| (count + 1.0, sum + share));
    if count > 0.0 { sum / count } else { 1.0 }
}

/// The longest bin that tells more than the guide, m.
fn longest_bin_m(guide: &GuideMap) -> f64 {
    let mut sigmas_m: Vec<f64> = estimates(guide).map(|(_, sigma_m)| sigma_m).collect();
    sigmas_m.sort_by(f64::total_cmp);
    let median_m = sigmas_m.get(sigmas_m.len() / 2).copied().unwrap_or(0.0);
    12f64.sqrt() * median_m
}

impl WindowPolicy {
    /// The sensor with the fastest CLK, no faster than its own, with which windows hold `within` of what the guide claims, and CLK periods of a
    /// laser cycle that lasts as long as `stop_periods` of its own.
    ///
    /// # Errors
    /// Where bins are no CLK periods, and where none that is worth having is long enough.
    pub(crate) fn slowed(
        &self,
        guide: &GuideMap,
        sensor: &Sensor,
        stop_periods: u32,
    ) -> Result<(Sensor, u32), NoBins> {
        if sensor.tdc == Tdc::DelayLine {
            return Err(NoBins::DelayLines);
        }
        let own_bin_m = SPEED_OF_LIGHT_M_PER_S / (2.0 * sensor.clk_hz);
        let longest_m = longest_bin_m(guide).max(own_bin_m);
        let (mut bin_m, mut most) = (own_bin_m, (0.0, own_bin_m));
        while bin_m <= longest_m {
            let at_best = share_held_at_best(guide, sensor, bin_m);
            let last = bin_m * FINER > longest_m;
            if at_best >= self.within || last {
                let slower = bin_m / own_bin_m;
                let slowed = Sensor::from(SensorConfig {
                    clk_hz: sensor.clk_hz / slower,
                    ..SensorConfig::clone(sensor)
                });
                let periods = (f64::from(stop_periods) / slower).ceil() as u32;
                // At some periods two signals meet and no window can be aimed.
                if let Ok(exposure) = Exposure::checked(&slowed, periods, 1) {
                    let law = WindowLaw::new(&slowed, &exposure);
                    let share = share_held(guide, &law);
                    if share >= self.within {
                        return Ok((slowed, periods));
                    }
                    if share > most.0 {
                        most = (share, bin_m);
                    }
                }
            }
            bin_m *= FINER;
        }
        let (share, bin_m) = most;
        Err(NoBins::Unsure { share, bin_m })
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::chip::hslidar_delay_line;
    use crate::photon::{RandomPurpose, normal, random_stream};
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
            let mut random = random_stream(1, RandomPurpose::Guide, n, 0);
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
        let unsure = policy.slowed(&map(1e4), &sensor, 520);
        assert!(matches!(unsure, Err(NoBins::Unsure { .. })), "{unsure:?}");
        let lines = policy.slowed(&map(0.1), &hslidar_delay_line(), 520);
        assert_eq!(lines.unwrap_err(), NoBins::DelayLines);
    }

    /// A few wild claims do not slow CLK down for all the others: bins would then tell less than the guide does of most.
    #[test]
    fn bins_that_tell_less_than_the_guide_are_refused() {
        let estimates = (0..100).map(|n| Some((60.0, if n < 2 { 30.0 } else { 0.3 })));
        let map = GuideMap::new(10, 10, estimates);
        let refused = WindowPolicy::default().slowed(&map, &Sensor::default(), 520);
        let Err(NoBins::Unsure { share, bin_m }) = refused else {
            panic!("{refused:?}");
        };
        assert!(
            bin_m <= 12f64.sqrt() * 0.3 && share < 0.99,
            "{share} {bin_m}"
        );
    }

    /// What lies beyond the laser cycle no window holds, however wide it is.
    #[test]
    fn what_no_window_of_the_laser_cycle_reaches_is_not_held() {
        let sensor = Sensor::default();
        let map = GuideMap::new(1, 1, [Some((150.0, 0.3))]);
        for (periods, share) in [(520, 1.0), (300, 0.0)] {
            let law = WindowLaw::new(&sensor, &Exposure::new(&sensor, periods, 1));
            assert!((share_held(&map, &law) - share).abs() < 1e-6);
            let slowed = WindowPolicy::default().slowed(&map, &sensor, periods);
            assert_eq!(slowed.is_ok(), share > 0.0);
        }
    }
}
