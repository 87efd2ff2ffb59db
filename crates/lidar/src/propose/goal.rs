//! What is asked of a chip, and over what designs.

use serde::Serialize;
use toml::Table;

use super::point::DesignPoint;
use crate::settings::Range::{Above, Within};
use crate::settings::{Settings, keys};

keys! {
    /// What a chip has to do. [`Goal::fault`] checks it.
    #[derive(Copy)]
    pub struct Goal {
        /// Range of the target.
        range_m: f64 ["m"] = 100.0, in Within(0.5, 1e4);
        /// Its reflectivity.
        reflectivity: f64 = 0.1, in Above(0.0, 1.0);
        /// Sunlight on it.
        illuminance_klux: f64 ["klux"] = 100.0, in Within(0.0, 200.0);
        /// Frames per second.
        fps: f64 ["Hz"] = 25.0, in Within(0.2, 1e5);
        /// Probability that the target is in the window and found.
        detection: f64 = 0.99, in Within(0.5, 0.999_999);
        /// Standard deviation of its distance.
        precision_m: f64 ["m"] = 0.1, in Within(1e-4, 100.0);
    }
}

keys! {
    /// What may be chosen of chip, laser and guide; laser cycles follow from it. [`Choice::fault`] checks it.
    #[derive(Copy)]
    pub struct Choice {
        /// Histogram bins.
        bins: usize = 16, in Within(2.0, 64.0);
        /// Bits of a bin; as few as hold the counts, if left out.
        bin_bits: Option<usize> = None, in Within(1.0, 16.0);
        /// Bits of the P-counter; as few as reach the target, if left out.
        counter_bits: Option<usize> = None, in Within(2.0, 12.0);
        /// CLK.
        clk_hz: f64 ["Hz"] = 384e6, in Within(1e6, 2e9);
        /// THRESHOLD.
        threshold: u8 = 0, in Within(0.0, 15.0);
        /// Energy of a laser pulse over the whole field of view.
        pulse_energy_uj: f64 ["uJ"] = 1.0, in Above(0.0, 1e6);
        /// Laser pulses a second during an exposure; as many as the range allows, if that is fewer.
        rate_hz: f64 ["Hz"] = 80e3, in Above(0.0, 1e9);
        /// Standard deviation of the guide's estimate.
        guide_sigma_m: f64 ["m"] = 0.5, in Within(1e-3, 1000.0);
    }
}

/// The first value that is not within its key's range, and what to give.
fn fault<S: Settings + Serialize>(settings: &S) -> Option<String> {
    let values = Table::try_from(settings).expect("numbers");
    let given = S::KEYS
        .iter()
        .filter_map(|key| Some((key, values.get(key.name)?)));
    given.filter_map(|(key, value)| key.fault(value)).next()
}

impl Goal {
    /// The first value that is impossible, in a sentence.
    pub fn fault(&self) -> Option<String> {
        fault(self)
    }
}

impl Choice {
    /// The choices of a design, with `times` its energy; its bits too, if they are to stay.
    pub(super) fn from_point(point: &DesignPoint, times: f64, keeps_bits: bool) -> Self {
        let design = &point.design;
        Choice {
            bins: design.bins,
            bin_bits: keeps_bits.then_some(design.bin_bits),
            counter_bits: keeps_bits.then_some(design.counter_bits),
            clk_hz: design.clk_hz,
            threshold: design.threshold,
            pulse_energy_uj: times * design.pulse_energy_uj,
            // Within the last of its periods.
            rate_hz: design.clk_hz / (f64::from(design.stop_periods) - 0.5),
            guide_sigma_m: design.guide_sigma_m,
        }
    }

    /// The first value that is impossible, in a sentence.
    pub fn fault(&self) -> Option<String> {
        fault(self)
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
        let mhz = [150, 200, 250, 300, 350, 384, 450, 500, 600, 700, 800];
        Space {
            bins: vec![4, 8, 12, 16, 24, 32, 48, 64],
            clk_hz: mhz.map(|mhz| f64::from(mhz) * 1e6).into(),
            thresholds: vec![0, 1, 2],
            guide_sigma_m: vec![0.1, 0.2, 0.3, 0.5, 0.7, 1.0, 1.5, 2.0, 3.0, 5.0],
        }
    }
}

impl Space {
    /// The first value that is impossible, in a sentence.
    pub fn fault(&self) -> Option<String> {
        let usual = Choice::default;
        let bins = self.bins.iter().map(|&bins| Choice { bins, ..usual() });
        let clk = self
            .clk_hz
            .iter()
            .map(|&clk_hz| Choice { clk_hz, ..usual() });
        let thresholds = self.thresholds.iter();
        let thresholds = thresholds.map(|&threshold| Choice {
            threshold,
            ..usual()
        });
        let guides = self.guide_sigma_m.iter();
        let guides = guides.map(|&guide_sigma_m| Choice {
            guide_sigma_m,
            ..usual()
        });
        let mut all = bins.chain(clk).chain(thresholds).chain(guides);
        all.find_map(|choice| choice.fault())
    }
}
