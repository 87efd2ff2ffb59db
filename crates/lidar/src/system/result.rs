//! What a frame gives: histograms, depths, errors against the ground truth, run times.

use serde::Serialize;

use super::pixel::PixelDepth;
use super::remark::DepthHint;
use super::summary::FrameSummary;
use super::tolerance::ToleranceResult;
use crate::engine::EngineWork;
use crate::units::Time;

/// Wall-clock seconds of each phase of the simulation.
#[derive(Debug, Clone, Copy, Default, PartialEq, Serialize)]
pub struct PhaseTimes {
    /// Ray casting of the ground truth.
    pub scene_s: f64,
    /// Stereo guide.
    pub guide_s: f64,
    /// Start values through the window law.
    pub windows_s: f64,
    /// Serial load at gate level, elaboration included.
    pub load_s: f64,
    /// Light on every macropixel.
    pub light_s: f64,
    /// Photon stream and engine. The load and probes take a processor each meanwhile.
    pub exposure_s: f64,
    /// Probed macropixels at gate level, waveforms included.
    pub probes_s: f64,
    /// Peak interpolation.
    pub ranging_s: f64,
    /// Load, probes, exposure and ranging together: they run beside each other as far as there are processors.
    pub together_s: f64,
}

impl PhaseTimes {
    /// From the first phase to the last, s.
    pub fn total_s(&self) -> f64 {
        self.scene_s + self.guide_s + self.windows_s + self.light_s + self.together_s
    }
}

/// A frame.
#[derive(Debug, Clone, PartialEq)]
pub struct Frame {
    /// Macropixel rows.
    pub rows: usize,
    /// Macropixel columns.
    pub cols: usize,
    /// Bins of each histogram.
    pub bins: usize,
    /// Light's way there and back in one bin, as a distance, m.
    pub bin_m: f64,
    /// Counts, rows × cols × bins, bin 0 earliest.
    pub histograms: Vec<u16>,
    /// Macropixels, row-major.
    pub pixels: Vec<PixelDepth>,
    /// Why most surfaces have no depth, where that is so.
    pub remark: Option<String>,
    /// What would help against other reasons for missing depths: one for each that settings can change.
    pub hints: Vec<DepthHint>,
    /// Depths that are light of fog or smoke itself: nearer than every surface that the macropixel sees, by more than a bin. 0 in clear air.
    pub depths_of_medium: usize,
    /// Macropixels that would get more light than is modelled: [`MOST_PER_ECHO`](crate::scene::MOST_PER_ECHO) photons of an echo a laser cycle,
    /// or [`MOST_BACKGROUND_HZ`](crate::scene::MOST_BACKGROUND_HZ) of background. What is beyond is left out.
    pub light_cut: usize,
    /// Photons and dark counts that the light makes of the whole array on average.
    pub photons_expected: f64,
    /// What the engine did, and did not have to do.
    pub work: EngineWork,
    /// Engines chosen by a depth tolerance, and the bound they keep.
    pub kept: Option<ToleranceResult>,
    /// Bits of the serial load.
    pub load_bits: usize,
    /// Time the chip needs for the load.
    pub load_time: Time,
    /// Time the chip needs to give its histograms away, a READ_CLK period for each bit of a pin.
    pub readout_time: Time,
    /// Time the chip exposes.
    pub exposure_time: Time,
    /// Macropixels that were also run at gate level and agreed to the count, with the `window` engine on the same
    /// photons where the frame's engine is `cohort`, which has none.
    pub probes: Vec<(usize, usize)>,
    /// Laser cycles that were simulated at gate level of each of them.
    pub probed_cycles: Vec<u32>,
    /// What the simulation took.
    pub times: PhaseTimes,
}

impl Frame {
    /// The frame in a few numbers.
    pub fn summary(&self) -> FrameSummary {
        FrameSummary::new(&self.pixels, self.bin_m)
    }
}
