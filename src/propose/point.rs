//! A design of chip, laser and guide, and what it costs.

use serde::Serialize;

use crate::scene::EyeRule;

/// What may be chosen; laser cycles and counter bits follow from it.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Choice {
    /// Histogram bins.
    pub bins: usize,
    /// Bits of a bin; as few as hold the counts, if left out.
    pub bin_bits: Option<usize>,
    /// CLK, Hz.
    pub clk_hz: f64,
    /// THRESHOLD.
    pub threshold: u8,
    /// Energy of a laser pulse over the whole field of view, uJ.
    pub pulse_energy_uj: f64,
    /// Laser pulses a second during an exposure; as many as the range allows, if that is fewer.
    pub rate_hz: f64,
    /// Standard deviation of the guide's estimate, m.
    pub guide_sigma_m: f64,
}

/// A chip, its laser and its guide.
#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
pub struct Design {
    /// Histogram bins.
    pub bins: usize,
    /// Bits of a bin.
    pub bin_bits: usize,
    /// Bits of the P-counter: as few as reach the target.
    pub counter_bits: usize,
    /// CLK, Hz.
    pub clk_hz: f64,
    /// THRESHOLD.
    pub threshold: u8,
    /// Energy of a laser pulse, uJ.
    pub pulse_energy_uj: f64,
    /// CLK periods in a laser cycle.
    pub stop_periods: u32,
    /// Laser cycles of a frame: as few as do.
    pub laser_cycles: u32,
    /// Standard deviation of the guide's estimate, m.
    pub guide_sigma_m: f64,
}

/// What is to be little, in this order: laser power, area, data, time of a frame, and how exact the guide has to be.
pub type Costs = [f64; 5];

/// A design and what theory says of it.
#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
pub struct Point {
    /// The design.
    #[serde(flatten)]
    pub design: Design,
    /// Mean power of the laser at the wanted frame rate, W.
    pub power_w: f64,
    /// Area of a macropixel: um² in a cell library, transistors without one.
    pub area: f64,
    /// Histogram bits a second at the wanted frame rate.
    pub data_bit_s: f64,
    /// Frames a second that chip and class 1 allow.
    pub fps: f64,
    /// Probability that the target is in the window and found.
    pub detection: f64,
    /// Share of windows that hold the target.
    pub in_window: f64,
    /// Standard deviation of the distance, m.
    pub precision_m: f64,
    /// Accessible emission over the limit of class 1, at the wanted frame rate.
    pub times_class_1: f64,
}

impl Point {
    /// What is to be little.
    pub fn costs(&self) -> Costs {
        let guide = 1.0 / self.design.guide_sigma_m;
        [
            self.power_w,
            self.area,
            self.data_bit_s,
            1.0 / self.fps,
            guide,
        ]
    }

    /// All costs as one number, each as a ratio: the least is the balanced choice.
    pub(crate) fn ln_cost(&self) -> f64 {
        self.costs().iter().map(|cost| cost.ln()).sum()
    }
}

/// A design by theory, and by how much it breaks what it has to keep; within up to 1.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Candidate {
    /// What it would be.
    pub point: Point,
    /// Emission over the limit of class 1, and the rule that is nearest.
    pub eye: (f64, EyeRule),
    /// Time of a frame over what the frame rate leaves.
    pub time: f64,
    /// Counts of the fullest bin over what it holds.
    pub counts: f64,
}

impl Candidate {
    /// Whether it keeps everything.
    pub fn is_possible(&self) -> bool {
        self.eye.0 <= 1.0 && self.time <= 1.0 && self.counts <= 1.0
    }
}

/// Why no design will do: the limit of those that come nearest, and by how much.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
pub enum Limit {
    /// The P-counter does not reach so far.
    #[error("a P-counter of {bits} bits ends at {reach_m:.1} m, {:.1} m short of the target and its window", needed_m - reach_m)]
    Reach {
        /// Its bits.
        bits: usize,
        /// Where its last window ends, m.
        reach_m: f64,
        /// Where it would have to, m.
        needed_m: f64,
    },
    /// The best window holds the target too seldom.
    #[error(
        "the guide: its error of {guide_sigma_m} m leaves the target in a window of {window_m:.1} m in {:.2} % of frames where more than {:.2} % are asked for",
        100.0 * share, 100.0 * detection
    )]
    Guide {
        /// The smallest error that is tried, m.
        guide_sigma_m: f64,
        /// The longest window, m.
        window_m: f64,
        /// Share of frames in which it holds the target.
        share: f64,
        /// Probability of detection that is wanted.
        detection: f64,
    },
    /// No number of laser cycles finds the target.
    #[error(
        "light: {most} laser cycles of any energy up to 1000 times class 1 do not find the target"
    )]
    Light {
        /// Laser cycles that were tried.
        most: u32,
    },
    /// No CLK that is tried meets the timing.
    #[error("static timing: CLK {mhz:.0} MHz, the slowest of those tried, {why}")]
    Timing {
        /// The slowest CLK, MHz.
        mhz: f64,
        /// The verdict.
        why: String,
    },
    /// Eyes.
    #[error(
        "the safety of eyes: class 1 ({rule}) allows {allowed_uj:.3} uJ a pulse where {needed_uj:.3} uJ are needed, {times:.1} times as much ({power_mw:.0} mW on average); a wider lens (scene.lidar.lens_diameter_mm) needs less, and a wider source (scene.lidar.laser_source_mm, {source_mm} now) is allowed more"
    )]
    Eye {
        /// The rule that limits.
        rule: &'static str,
        /// Energy of a pulse that it allows, uJ.
        allowed_uj: f64,
        /// Energy of a pulse that is needed, uJ.
        needed_uj: f64,
        /// One over the other.
        times: f64,
        /// Mean power that is needed, mW.
        power_mw: f64,
        /// Width of the laser's source, mm.
        source_mm: f64,
    },
    /// Frames are too short.
    #[error(
        "time: a frame of {frame_ms:.3} ms is {times:.1} times too short for the {laser_cycles} laser cycles and the readout of the quickest design, {:.3} ms",
        times * frame_ms
    )]
    Time {
        /// What the frame rate leaves, ms.
        frame_ms: f64,
        /// By how much that is too little.
        times: f64,
        /// Laser cycles.
        laser_cycles: u32,
    },
    /// Bins overflow.
    #[error("bins: the fullest has {times:.1} times the counts that {bits} bits hold")]
    Counts {
        /// By how much.
        times: f64,
        /// Bits of a bin.
        bits: usize,
    },
}
