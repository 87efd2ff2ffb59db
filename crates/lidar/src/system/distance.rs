//! How positions in histograms become distances, for those who read them without this program.

use std::collections::BTreeMap;

use serde::Serialize;

use crate::chip::WindowLaw;
use crate::units::SPEED_OF_LIGHT_M_PER_S;

/// The law of an exposure's distances, with its numbers.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct DistanceLaw {
    /// In the names of the other fields. Bin b reaches from position b − ½ to b + ½. Range walk is still in it: of a
    /// macropixel's peak it gives `peak_m`, of which `measured_m` is the correction.
    pub formula: &'static str,
    /// m/s.
    pub speed_of_light_m_per_s: f64,
    /// Length of a bin, s; `None` where bins differ.
    pub bin_width_s: Option<f64>,
    /// For each start value in use: when bin 0 begins after the laser pulse, s.
    pub window_opens_s: BTreeMap<u16, f64>,
    /// Where bins differ, for each start value in use: when they begin after the laser pulse, and when the last one ends, s.
    #[serde(skip_serializing_if = "BTreeMap::is_empty")]
    pub bin_edges_s: BTreeMap<u16, Vec<f64>>,
}

/// How a position becomes a distance.
const OF_EQUAL_BINS: &str = "peak_m = speed_of_light_m_per_s / 2 * (window_opens_s[start] + (position_bins + 0.5) * bin_width_s), where position_bins is 0 in the middle of the first bin";
const OF_EDGES: &str = "peak_m = speed_of_light_m_per_s / 2 * (bin_edges_s[start][b] + f * (bin_edges_s[start][b + 1] - bin_edges_s[start][b])), where position_bins is 0 in the middle of the first bin, and b the whole number and f the rest of position_bins + 0.5";

impl DistanceLaw {
    /// The law for macropixels with these start values. Those whose window never opens are left out.
    pub(crate) fn new(law: &WindowLaw, starts: impl IntoIterator<Item = u16>) -> Self {
        let bin_width_s = law.bin_width_s();
        let (mut window_opens_s, mut bin_edges_s) = (BTreeMap::new(), BTreeMap::new());
        for start in starts {
            if let Some(window) = law.window(start).open() {
                window_opens_s.insert(start, law.interval(&window).start.as_s());
                if bin_width_s.is_none() {
                    let edges = law.edges(&window, 0);
                    let edges_s = edges.edges().iter().map(|edge| edge.as_s());
                    bin_edges_s.insert(start, edges_s.collect());
                }
            }
        }
        DistanceLaw {
            formula: match bin_width_s {
                Some(_) => OF_EQUAL_BINS,
                None => OF_EDGES,
            },
            speed_of_light_m_per_s: SPEED_OF_LIGHT_M_PER_S,
            bin_width_s,
            window_opens_s,
            bin_edges_s,
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::chip::{Exposure, SensorConfig};
    use crate::units::{Time, TimeOfFlight};

    fn window_law() -> WindowLaw {
        let sensor = SensorConfig::default();
        WindowLaw::new(&sensor, &Exposure::new(&sensor, 520, 10))
    }

    /// Times are whole femtoseconds, 0.15 um each.
    fn assert_close(taken_m: f64, by_formula_m: f64) {
        assert!(
            (taken_m - by_formula_m).abs() < 1e-6,
            "{taken_m} {by_formula_m}"
        );
    }

    #[test]
    fn the_formula_is_what_depths_are_taken_with() {
        let window_law = window_law();
        let law = DistanceLaw::new(&window_law, [25, 300, 511, 25]);
        assert_eq!((law.window_opens_s.len(), law.bin_edges_s.len()), (3, 0));
        for (&start, opens_s) in &law.window_opens_s {
            let window = window_law.window(start).open().unwrap();
            for position_bins in [0.0, 3.25, 15.0] {
                let taken_m = window_law.time_of(&window, position_bins).as_range_m();
                let after_s = (position_bins + 0.5) * law.bin_width_s.unwrap();
                let by_formula_m = law.speed_of_light_m_per_s / 2.0 * (opens_s + after_s);
                assert_close(taken_m, by_formula_m);
            }
        }
    }

    #[test]
    fn unequal_bins_come_with_their_edges() {
        let taps: Vec<_> = (0..17).map(|n| Time::from_ps(100 * n * (n + 3))).collect();
        let window_law = window_law().with_taps(&[taps]);
        let law = DistanceLaw::new(&window_law, [300]);
        assert_eq!((law.bin_width_s, law.formula), (None, OF_EDGES));
        let window = window_law.window(300).open().unwrap();
        let edges_s = &law.bin_edges_s[&300];
        for position_bins in [0.0f64, 3.25, 14.6] {
            let bin = (position_bins + 0.5).floor();
            let (part, bin) = (position_bins + 0.5 - bin, bin as usize);
            let time_s = edges_s[bin] + part * (edges_s[bin + 1] - edges_s[bin]);
            let taken_m = window_law.time_of(&window, position_bins).as_range_m();
            assert_close(taken_m, law.speed_of_light_m_per_s / 2.0 * time_s);
        }
    }
}
