//! Bin profiles: when the bins of every macropixel begin and end, for a TDC with delay lines (thesis 6.3.1, Eq. 29,
//! Fig. 88 to 93).
//!
//! ```text
//!   laser trigger │                C_0   C_1    C_2        C_i: middle of bin i
//!                 ├─────────────── · ┼── · ──┼── · ──┼ …   even windows; odd ones have a line of their own
//! ```
//!
//! A profile is measured on one window of either kind; others come a whole number of steps later. What a calibration does not know
//! is [`BinProfile::ideal`]: elements that are all alike, and a CLK that comes everywhere at once.

use serde::{Deserialize, Serialize};

use crate::chip::{Exposure, Sensor, SensorConfig, WindowLaw};

/// Bins of one delay line.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct LineProfile {
    /// Middle of each bin after the laser trigger, s: C_i of Eq. 29.
    pub middle_s: Vec<f64>,
    /// Length of each bin, s.
    pub length_s: Vec<f64>,
}

/// Bins of a whole sensor.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct BinProfile {
    /// The sensor that they belong to.
    pub sensor: SensorConfig,
    /// The start values of the windows that were measured, an even and an odd one.
    pub starts: [u16; 2],
    /// The lines of every macropixel, row-major: that of even start values, that of odd ones.
    pub macropixels: Vec<[LineProfile; 2]>,
}

/// A profile that is another sensor's.
#[derive(Debug, Clone, PartialEq, Eq, thiserror::Error)]
#[error(
    "it was measured on a sensor with {key} = {calibrated}, but this one has {key} = {present}"
)]
pub struct OtherSensor {
    /// The first key that differs.
    pub key: String,
    /// What the profile's sensor has.
    pub calibrated: String,
    /// What this one has.
    pub present: String,
}

/// Keys on which bins do not depend.
const FREE: [&str; 16] = [
    "bin_bits",
    "overflow",
    "dead_time_ns",
    "dead_time_spread",
    "dead_time_seed",
    "paralysable",
    "afterpulse_probability",
    "afterpulse_time_ns",
    "afterpulse_activation_ev",
    "crosstalk_probability",
    "event_type",
    "threshold",
    "load_clk_hz",
    "reset_to_load",
    "readout_pins",
    "read_clk_hz",
];

impl BinProfile {
    /// What is assumed without a calibration: elements of the mean delay, and no skew.
    pub fn ideal(sensor: &Sensor, exposure: &Exposure) -> Self {
        let law = WindowLaw::new(sensor.alike(), exposure);
        let opens = |parity: u16| {
            let mut starts = (parity..=sensor.largest_start()).step_by(2);
            starts.find_map(|start| law.window(start).open())
        };
        let windows = [0, 1].map(opens);
        let line = |window: &Option<_>| match window {
            Some(window) => {
                let edges = law.edges(window, 0);
                let bins = (0..edges.bins()).map(|bin| edges.bin(bin));
                let length = |bin: usize| edges.width(bin).as_s();
                LineProfile {
                    middle_s: bins
                        .map(|b| (b.start.as_s() + b.end.as_s()) / 2.0)
                        .collect(),
                    length_s: (0..edges.bins()).map(length).collect(),
                }
            }
            None => LineProfile {
                middle_s: vec![0.0; sensor.bins],
                length_s: vec![sensor.delay_element().as_s(); sensor.bins],
            },
        };
        let lines = [line(&windows[0]), line(&windows[1])];
        BinProfile {
            sensor: SensorConfig::clone(sensor),
            starts: [0, 1].map(|parity| windows[parity].map_or(parity as u16, |w| w.start)),
            macropixels: vec![lines; sensor.pixels()],
        }
    }

    /// Whether it is of this sensor, at this control voltage.
    ///
    /// # Errors
    /// The first key on which bins depend and that differs.
    pub fn check(&self, sensor: &SensorConfig) -> Result<(), OtherSensor> {
        let table = |config| toml::Table::try_from(config).expect("numbers and words");
        let (calibrated, present) = (table(&self.sensor), table(sensor));
        let differs =
            |key: &&String| !FREE.contains(&key.as_str()) && calibrated[*key] != present[*key];
        match present.keys().find(differs) {
            None => Ok(()),
            Some(key) => Err(OtherSensor {
                key: key.clone(),
                calibrated: calibrated[key].to_string(),
                present: present[key].to_string(),
            }),
        }
    }

    /// Middles of the bins of a macropixel (by its number, row-major) in the window of a start value, after the laser trigger, s.
    pub fn middles_s(&self, number: usize, start: u16) -> Vec<f64> {
        let parity = usize::from(start % 2);
        let step_s = self.sensor.step_periods as f64 / self.sensor.clk_hz;
        let later_s = (f64::from(start) - f64::from(self.starts[parity])) * step_s;
        let middles = self.macropixels[number][parity].middle_s.iter();
        middles.map(|middle| middle + later_s).collect()
    }

    /// Where the bins of a macropixel (by its number, row-major) begin in the window of a start value, and where the last one ends, after
    /// the laser trigger, s.
    pub fn edges_s(&self, number: usize, start: u16) -> Vec<f64> {
        let lengths = &self.macropixels[number][usize::from(start % 2)].length_s;
        let middles = self.middles_s(number, start);
        let begins = middles.iter().zip(lengths);
        let mut edges: Vec<f64> = begins
            .map(|(middle, length)| middle - 0.5 * length)
            .collect();
        let last = middles.last().zip(lengths.last());
        edges.extend(last.map(|(middle, length)| middle + 0.5 * length));
        edges
    }

    /// Lengths of the bins of a macropixel over their mean, in windows of a start value.
    pub fn shares(&self, number: usize, start: u16) -> Vec<f64> {
        let lengths = &self.macropixels[number][usize::from(start % 2)].length_s;
        let mean_s = lengths.iter().sum::<f64>() / lengths.len() as f64;
        lengths.iter().map(|length| length / mean_s).collect()
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::chip::Tdc;
    use crate::units::{Frequency, Time};

    /// Two lines whose elements differ.
    fn profile() -> BinProfile {
        let line = |first_s: f64, longer_s: f64| {
            let length_s: Vec<f64> = (0..16).map(|n| 1e-9 + longer_s * f64::from(n)).collect();
            let begins = length_s.iter().scan(first_s, |at, length| {
                *at += length;
                Some(*at - length)
            });
            let middle_s = begins
                .zip(&length_s)
                .map(|(begins, length)| begins + 0.5 * length);
            LineProfile {
                middle_s: middle_s.collect(),
                length_s,
            }
        };
        BinProfile {
            sensor: SensorConfig::default(),
            starts: [20, 31],
            macropixels: vec![[line(20e-9, 1e-11), line(30e-9, 3e-11)]],
        }
    }

    /// Bins of a delay line lie one after the other, each about an element long.
    #[test]
    fn ideal_bins_adjoin() {
        let config = SensorConfig {
            tdc: Tdc::DelayLine,
            ..SensorConfig::default()
        };
        let exposure = Exposure {
            clock: Frequency::from_hz_f64(config.clk_hz).expect("a frequency"),
            stop_phase: Time::ZERO,
            stop_periods: 520,
            laser_cycles: 100,
        };
        let profile = BinProfile::ideal(&Sensor::from(&config), &exposure);
        let element_s = config.delay_element().as_s();
        for line in &profile.macropixels[5] {
            for bin in 1..config.bins {
                let apart_s = line.middle_s[bin] - line.middle_s[bin - 1];
                let wanted_s = (line.length_s[bin] + line.length_s[bin - 1]) / 2.0;
                assert!(
                    (apart_s - wanted_s).abs() < 1e-15,
                    "{bin}: {apart_s} {wanted_s}"
                );
                assert!((apart_s / element_s - 1.0).abs() < 0.2);
            }
        }
    }

    #[test]
    fn a_window_has_the_bins_of_its_parity_steps_later() {
        let profile = profile();
        let step_s = 1.0 / profile.sensor.clk_hz;
        for start in 0..512 {
            let parity = usize::from(start % 2);
            let later_s = (f64::from(start) - [20.0, 31.0][parity]) * step_s;
            let edges_s = profile.edges_s(0, start);
            assert_eq!(edges_s.len(), 17);
            assert!((edges_s[0] - [20e-9, 30e-9][parity] - later_s).abs() < 1e-18);
            let shares = profile.shares(0, start);
            assert_eq!(shares.len(), 16);
            let mean_s = 1e-9 + [1e-11, 3e-11][parity] * 7.5;
            for (n, share) in shares.iter().enumerate() {
                let length_s = 1e-9 + [1e-11, 3e-11][parity] * n as f64;
                assert!(
                    (edges_s[n + 1] - edges_s[n] - length_s).abs() < 1e-18,
                    "{start} {n}"
                );
                assert!((share * mean_s - length_s).abs() < 1e-20, "{start} {n}");
            }
        }
    }

    #[test]
    fn a_profile_is_of_sensors_with_the_same_bins() {
        let (profile, sensor) = (profile(), SensorConfig::default);
        assert_eq!(profile.check(&sensor()), Ok(()));
        let free = SensorConfig {
            dead_time_ns: 3.0,
            threshold: 2,
            bin_bits: 12,
            readout_pins: 4,
            ..sensor()
        };
        assert_eq!(profile.check(&free), Ok(()));
        let other = profile
            .check(&SensorConfig {
                clk_hz: 2e8,
                ..free
            })
            .unwrap_err();
        let said = (
            other.key.as_str(),
            other.calibrated.as_str(),
            other.present.as_str(),
        );
        assert_eq!(said, ("clk_hz", "384000000.0", "200000000.0"));
    }
}
