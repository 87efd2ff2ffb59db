//! How positions in histograms become distances, for those who read them without this program.

use std::collections::BTreeMap;

use serde::Serialize;

use crate::chip::{Exposure, SensorConfig, WindowLaw};
use crate::units::SPEED_OF_LIGHT_M_PER_S;

/// The law of an exposure's distances, with its numbers.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct DistanceLaw {
    /// In the names of the other fields. Bin b reaches from position b − ½ to b + ½. Range walk is still in it: of a
    /// macropixel's peak it gives `peak_m`, of which `measured_m` is the correction.
    pub formula: &'static str,
    /// m/s.
    pub speed_of_light_m_per_s: f64,
    /// Period of CLK, s.
    pub bin_width_s: f64,
    /// For each start value in use: when bin 0 begins after the laser pulse, s.
    pub window_opens_s: BTreeMap<u16, f64>,
}

impl DistanceLaw {
    /// The law for macropixels with these start values. Those whose window never opens are left out.
    pub fn new(
        sensor: &SensorConfig,
        exposure: &Exposure,
        starts: impl IntoIterator<Item = u16>,
    ) -> Self {
        let law = WindowLaw::new(sensor, exposure);
        let mut window_opens_s = BTreeMap::new();
        for start in starts {
            if let Some(window) = law.window(start).open() {
                window_opens_s.insert(start, law.interval(&window).start.as_s());
            }
        }
        DistanceLaw {
            formula: "peak_m = speed_of_light_m_per_s / 2 * (window_opens_s[start] + (position_bins + 0.5) * bin_width_s)",
            speed_of_light_m_per_s: SPEED_OF_LIGHT_M_PER_S,
            bin_width_s: 1.0 / exposure.clock.as_hz(),
            window_opens_s,
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_formula_is_what_depths_are_taken_with() {
        let sensor = SensorConfig::default();
        let exposure = Exposure::new(&sensor, 520, 10);
        let window_law = WindowLaw::new(&sensor, &exposure);
        let law = DistanceLaw::new(&sensor, &exposure, [25, 300, 511, 25]);
        assert_eq!(law.window_opens_s.len(), 3);
        for (&start, opens_s) in &law.window_opens_s {
            let window = window_law.window(start).open().unwrap();
            for position_bins in [0.0, 3.25, 15.0] {
                let taken_m = window_law.time_of(&window, position_bins).as_range_m();
                let by_formula_m = law.speed_of_light_m_per_s / 2.0
                    * (opens_s + (position_bins + 0.5) * law.bin_width_s);
                // Times are whole femtoseconds, 0.15 um each.
                assert!(
                    (taken_m - by_formula_m).abs() < 1e-6,
                    "{taken_m} {by_formula_m}"
                );
            }
        }
    }
}
