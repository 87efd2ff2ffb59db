//! What is asked of a chip, and over what designs.

use serde::Serialize;

/// What a chip has to do. Checked by [`Goal::fault`].
#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
pub struct Goal {
    /// Range of the target, m.
    pub range_m: f64,
    /// Its reflectivity, 0 to 1.
    pub reflectivity: f64,
    /// Sunlight on it, klux.
    pub illuminance_klux: f64,
    /// Frames per second.
    pub fps: f64,
    /// Probability that the target is in the window and found, 0 to 1.
    pub detection: f64,
    /// Standard deviation of its distance, m.
    pub precision_m: f64,
}

impl Goal {
    /// The first value that is impossible: its name, itself, and what to give. Ranges are those of the keys that scenes and studies have.
    pub fn fault(&self) -> Option<(&'static str, f64, &'static str)> {
        let within = |value: f64, least: f64, most: f64| (least..=most).contains(&value);
        let cases = [
            (
                "range",
                self.range_m,
                within(self.range_m, 0.5, 10_000.0),
                "0.5 to 10000 m",
            ),
            (
                "reflectivity",
                self.reflectivity,
                self.reflectivity > 0.0 && self.reflectivity <= 1.0,
                "a number above 0, up to 1",
            ),
            (
                "klux",
                self.illuminance_klux,
                within(self.illuminance_klux, 0.0, 200.0),
                "0 to 200 klux",
            ),
            (
                "fps",
                self.fps,
                within(self.fps, 0.2, 100_000.0),
                "0.2 to 100000 frames per second",
            ),
            (
                "detection",
                self.detection,
                within(self.detection, 0.5, 0.999_999),
                "0.5 to 0.999999",
            ),
            (
                "precision",
                self.precision_m,
                within(self.precision_m, 1e-4, 100.0),
                "0.0001 to 100 m",
            ),
        ];
        let wrong = cases.into_iter().find(|case| !case.2);
        wrong.map(|(name, value, _, give)| (name, value, give))
    }
}

/// The designs that are tried. Energies and repetition rates follow from the safety of eyes and the range.
#[derive(Debug, Clone, PartialEq)]
pub struct Space {
    /// Histogram bins.
    pub bins: Vec<usize>,
    /// CLK, Hz.
    pub clk_hz: Vec<f64>,
    /// THRESHOLD: SPADs that must be exceeded.
    pub thresholds: Vec<u8>,
    /// Standard deviations of the guide, m.
    pub guide_sigma_m: Vec<f64>,
}

impl Default for Space {
    /// From what is small and slow to the most that sensors may have; CLK to where the built-in cells give up (867 MHz).
    fn default() -> Self {
        Space {
            bins: vec![4, 8, 12, 16, 24, 32, 48, 64],
            clk_hz: [150, 200, 250, 300, 350, 384, 450, 500, 600, 700, 800]
                .map(|mhz| f64::from(mhz) * 1e6)
                .into(),
            thresholds: vec![0, 1, 2],
            guide_sigma_m: vec![0.1, 0.2, 0.3, 0.5, 0.7, 1.0, 1.5, 2.0, 3.0, 5.0],
        }
    }
}
