//! At which process, voltage and temperature a clock fails: found by search.
//!
//! All delays and limits scale by one factor ([`Conditions::delay_factor`]), so the search is for the factor from
//! which on the macropixel no longer works, and then for the conditions that have it.

use super::{Limits, MacropixelTiming, Silicon};
use crate::chip::SensorConfig;
use crate::netlist::{Conditions, Process};

/// How far one process can be taken from the library's conditions until the sensor's CLK fails.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct CornerLimit {
    /// Silicon.
    pub process: Process,
    /// Whether it works at the library's voltage and temperature.
    pub works_at_reference: bool,
    /// The highest voltage (to 1 mV) at the library's temperature at which it fails; none if it never does.
    pub fails_below_v: Option<f64>,
    /// The lowest temperature (to 0.1 °C) at the library's voltage at which it fails; none if it never does.
    pub fails_above_c: Option<f64>,
}

/// The largest factor on every delay, to 1 in 10⁵, at which macropixel (0, 0) works at the sensor's CLK; none if
/// it does not work at a hundredth of its delays. A factor on `silicon` is replaced.
pub fn critical_factor(config: &SensorConfig, silicon: &Silicon, limits: Limits) -> Option<f64> {
    let (period, phase) = (config.clock().period(), config.stop_phase());
    let works = |steps: u32| {
        let scaled = silicon.at(steps as f64 * 1e-5);
        MacropixelTiming::of(config, &scaled, limits, (0, 0)).works(period, phase)
    };
    // From the nominal delays, or near none, up to the first that fails: faster ones need not work at a free STOP phase.
    let mut good = [100_000, 1_000].into_iter().find(|&steps| works(steps))?;
    let mut bad = good;
    while works(bad) {
        good = bad;
        bad += 2_000;
    }
    while bad - good > 1 {
        let middle = (good + bad) / 2;
        if works(middle) {
            good = middle;
        } else {
            bad = middle;
        }
    }
    Some(good as f64 * 1e-5)
}

/// The limits of slow, typical and fast silicon for a chip that works up to `critical` times its delays.
pub fn corner_limits(critical: f64) -> [CornerLimit; 3] {
    let reference = Conditions::default();
    [Process::Slow, Process::Typ, Process::Fast].map(|process| {
        let fails = |voltage_v: f64, temperature_c: f64| {
            let conditions = Conditions {
                process,
                voltage_v,
                temperature_c,
            };
            conditions
                .delay_factor()
                .is_some_and(|factor| factor > critical)
        };
        // Downwards from the highest supply, upwards from the lowest temperature: the first that fails.
        let mut voltages = (0..=2_000).rev().map(|mv| mv as f64 * 1e-3);
        let mut temperatures = (-550..=1_500).map(|tenth| tenth as f64 * 0.1);
        CornerLimit {
            process,
            works_at_reference: !fails(reference.voltage_v, reference.temperature_c),
            fails_below_v: voltages.find(|&v| fails(v, reference.temperature_c)),
            fails_above_c: temperatures.find(|&c| fails(reference.voltage_v, c)),
        }
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_chip_with_less_margin_fails_at_a_higher_voltage_and_a_lower_temperature() {
        let [tight, loose] = [1.02, 1.05].map(corner_limits);
        for (tight, loose) in tight.iter().zip(loose) {
            assert!(tight.fails_below_v > loose.fails_below_v);
            let (tight, loose) = (tight.fails_above_c, loose.fails_above_c);
            assert!(loose.is_none() || tight.unwrap() <= loose.unwrap());
        }
        assert!(tight[1].works_at_reference && !corner_limits(0.99)[1].works_at_reference);
    }
}
