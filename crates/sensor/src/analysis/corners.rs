//! At which process, voltage and temperature a clock fails: found by search.
//!
//! All delays and limits scale by one factor ([`Conditions::delay_factor`]), so the search is for the factor from
//! which on the macropixel no longer works, and then for the conditions that have it.

use super::{Aim, LocalClocks, MacropixelTiming};
use crate::chip::{Limits, SensorConfig, Silicon};
use crate::netlist::{Conditions, Corner};
use crate::units::Time;

/// Factors on every delay with which a macropixel counts as the library's does.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct FactorRange {
    /// The smallest, if faster silicon fails; to 1 in 10⁵.
    pub fastest: Option<f64>,
    /// The largest, to 1 in 10⁵.
    pub slowest: f64,
    /// Bins by which windows end later there than at a slow clock.
    pub moved: i64,
}

/// How far one process can be taken from the library's conditions until the sensor's CLK fails.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct CornerLimit {
    /// Silicon.
    pub process: Corner,
    /// Whether it works at the library's voltage and temperature.
    pub works_at_reference: bool,
    /// The highest voltage (to 1 mV) at the library's temperature at which it is too slow; none if it never is.
    pub fails_below_v: Option<f64>,
    /// The lowest temperature (to 0.1 °C) at the library's voltage at which it is too slow; none if it never is.
    pub fails_above_c: Option<f64>,
    /// The lowest voltage at which it is too fast.
    pub fails_above_v: Option<f64>,
    /// The highest temperature at which it is too fast.
    pub fails_below_c: Option<f64>,
}

/// The factors on every delay, to 1 in 10⁵, with which macropixel (0, 0) counts as at the library's delays or, if those
/// fail, as at a slow clock; none if it does not work at a hundredth of its delays either. A factor on `silicon` is
/// replaced.
pub fn factor_range(
    config: &SensorConfig,
    silicon: &Silicon,
    limits: Limits,
) -> Option<FactorRange> {
    const ONE: u64 = 100_000;
    const NEAR_NONE: u64 = 1_000;
    /// Of a factor.
    const STEP: f64 = 0.02;
    let (period, phase) = (config.clock().period(), config.stop_phase());
    let timing = |steps: u64| {
        let scaled = silicon.with_factor(steps as f64 * 1e-5);
        MacropixelTiming::analyse(config, &scaled, limits, (0, 0))
    };
    let library = timing(ONE).aim(period, phase);
    let works = |steps, aim| timing(steps).slack(period, phase, aim) >= Time::ZERO;
    let tried = [(ONE, library), (NEAR_NONE, Aim::SLOW)];
    let (start, aim) = tried.into_iter().find(|&(steps, aim)| works(steps, aim))?;
    let between = |works: &dyn Fn(u64) -> bool, mut good: u64, mut bad: u64| {
        while good.abs_diff(bad) > 1 {
            let middle = (good + bad) / 2;
            if works(middle) {
                good = middle;
            } else {
                bad = middle;
            }
        }
        good
    };
    let works = |steps| works(steps, aim);
    // The front end follows SPADs at any CLK, but not with any delays.
    let follows = |steps: u64| {
        let scaled = silicon.with_factor(steps as f64 * 1e-5);
        let local = LocalClocks::analyse(config, &scaled);
        let mut slacks = (local.toggles.iter())
            .filter_map(|toggle| local.toggle_slack(toggle, config.pulse_width()));
        slacks.all(|slack| slack >= Time::ZERO)
    };
    let step = |steps: u64| (steps as f64 * STEP) as u64;
    let mut good = start;
    while works(good + step(good)) {
        good += step(good);
    }
    let mut slowest = between(&works, good, good + step(good));
    if follows(start) && !follows(slowest) {
        slowest = between(&follows, start, slowest);
    }
    // Down to delays near none, to the first that fails.
    let mut good = start;
    let mut fastest = None;
    while good - step(good) >= NEAR_NONE {
        let faster = good - step(good);
        if !works(faster) {
            fastest = Some(between(&works, good, faster) as f64 * 1e-5);
            break;
        }
        good = faster;
    }
    Some(FactorRange {
        fastest,
        slowest: slowest as f64 * 1e-5,
        moved: aim.moved(),
    })
}

/// The limits of slow, typical and fast silicon for a chip that works with these factors on its delays.
pub fn corner_limits(range: Option<FactorRange>) -> [CornerLimit; 3] {
    let reference = Conditions::default();
    let slowest = range.map_or(0.0, |range| range.slowest);
    let fastest = range.and_then(|range| range.fastest).unwrap_or(0.0);
    [Corner::Slow, Corner::Typ, Corner::Fast].map(|process| {
        let factor = |voltage_v: f64, temperature_c: f64| {
            let conditions = Conditions {
                process,
                voltage_v,
                temperature_c,
            };
            conditions.delay_factor()
        };
        let (volts, celsius) = (reference.voltage_v, reference.temperature_c);
        let at_voltage = |v: &f64| factor(*v, celsius);
        let at_temperature = |c: &f64| factor(volts, *c);
        let is_slow = |factor: Option<f64>| factor.is_some_and(|factor| factor > slowest);
        let is_fast = |factor: Option<f64>| factor.is_some_and(|factor| factor < fastest);
        let voltages = || (0..=2_000).map(|mv| f64::from(mv) * 1e-3);
        let temperatures = || (-550..=1_500).map(|tenth| f64::from(tenth) * 0.1);
        let at_reference = factor(volts, celsius);
        CornerLimit {
            process,
            works_at_reference: !is_slow(at_reference) && !is_fast(at_reference),
            // Towards slower silicon, and towards faster: the first that fails.
            fails_below_v: voltages().rev().find(|v| is_slow(at_voltage(v))),
            fails_above_c: temperatures().find(|c| is_slow(at_temperature(c))),
            fails_above_v: voltages().find(|v| is_fast(at_voltage(v))),
            fails_below_c: temperatures().rev().find(|c| is_fast(at_temperature(c))),
        }
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_chip_with_less_margin_fails_at_a_higher_voltage_and_a_lower_temperature() {
        let up_to = |slowest| {
            corner_limits(Some(FactorRange {
                fastest: None,
                slowest,
                moved: 0,
            }))
        };
        let [tight, loose] = [1.02, 1.05].map(up_to);
        assert!(
            tight
                .iter()
                .all(|t| t.fails_above_v.is_none() && t.fails_below_c.is_none())
        );
        let between = corner_limits(Some(FactorRange {
            fastest: Some(0.95),
            slowest: 1.05,
            moved: 1,
        }));
        let [_, typ, fast] = between;
        assert!(typ.works_at_reference && !fast.works_at_reference);
        assert!(typ.fails_above_v > Some(1.1) && fast.fails_above_v < Some(1.1));
        for (tight, loose) in tight.iter().zip(loose) {
            assert!(tight.fails_below_v > loose.fails_below_v);
            let (tight, loose) = (tight.fails_above_c, loose.fails_above_c);
            assert!(loose.is_none() || tight.unwrap() <= loose.unwrap());
        }
        assert!(tight[1].works_at_reference && !up_to(0.99)[1].works_at_reference);
    }
}
