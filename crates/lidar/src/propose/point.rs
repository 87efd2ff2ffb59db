//! A design of chip, laser and guide, and what it costs.

use serde::Serialize;

use crate::scene::EyeRule;
use crate::system::FrameError;

/// A chip, its laser and its guide.
#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
pub struct ChipDesign {
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
pub struct DesignPoint {
    /// The design.
    #[serde(flatten)]
    pub design: ChipDesign,
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

impl DesignPoint {
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
    pub fn ln_cost(&self) -> f64 {
        self.costs().iter().map(|cost| libm::log(*cost)).sum()
    }
}

/// A design by theory, and by how much it breaks what it has to keep; within up to 1.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Candidate {
    /// What it would be.
    pub point: DesignPoint,
    /// Emission over the limit of class 1, and the rule that is nearest.
    pub eye: (f64, EyeRule),
    /// Time of a frame over what the frame rate leaves.
    pub time: f64,
    /// Counts of the fullest bin over what it holds.
    pub counts: f64,
}

impl Candidate {
    /// What it breaks, if anything.
    pub fn limit(&self) -> Option<Limit> {
        let DesignPoint { design, .. } = self.point;
        let needed_uj = design.pulse_energy_uj;
        match self {
            Candidate { time: times, .. } if *times > 1.0 => Some(Limit::Time {
                times: *times,
                laser_cycles: design.laser_cycles,
            }),
            Candidate { counts: times, .. } if *times > 1.0 => Some(Limit::Counts {
                times: *times,
                bits: design.bin_bits,
            }),
            Candidate {
                eye: (times, rule), ..
            } if *times > 1.0 => Some(Limit::Eye {
                rule: rule.name(),
                allowed_uj: needed_uj / times,
                needed_uj,
                times: *times,
            }),
            _ => None,
        }
    }
}

/// Why no design will do: the limit of those that come nearest, and by how much.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
pub enum Limit {
    /// The P-counter does not reach so far.
    #[error(
        "a P-counter of {bits} bits ends {short_m:.1} m short of the target and its window; give more bits, a slower clock or a nearer target"
    )]
    Reach { bits: usize, short_m: f64 },
    /// The best window holds the target too seldom.
    #[error(
        "the guide: its error of {guide_sigma_m} m leaves the target in a window of {window_m:.1} m in {:.2} % of frames, where more than {:.2} % are asked for; give a better guide, more bins or a slower clock",
        100.0 * share, 100.0 * detection
    )]
    Guide {
        guide_sigma_m: f64,
        window_m: f64,
        share: f64,
        detection: f64,
    },
    /// No number of laser cycles finds the target.
    #[error(
        "light: {most} laser cycles do not find the target; give more energy, a wider lens or a nearer target"
    )]
    Light { most: u32 },
    /// A pulse blinds the SPADs.
    #[error(
        "light: {photons:.2} signal photons a pulse for each SPAD leave too few that see where the target is; give less energy"
    )]
    Blinding { photons: f64 },
    /// The chip is too slow, or its verdict says what else.
    #[error("static timing at {mhz} MHz {why}; give another clock")]
    Timing { mhz: f64, why: String },
    /// Eyes.
    #[error(
        "the safety of eyes: class 1 ({rule}) allows {allowed_uj:.3} uJ a pulse where {needed_uj:.3} uJ are needed, {times:.1} times as much; a wider lens (scene.lidar.lens_diameter_mm) needs less, and a wider source (scene.lidar.laser_source_mm) is allowed more"
    )]
    Eye {
        rule: &'static str,
        allowed_uj: f64,
        needed_uj: f64,
        times: f64,
    },
    /// Frames are too short.
    #[error(
        "time: a frame is {times:.1} times too short for {laser_cycles} laser cycles and the readout; give fewer frames a second"
    )]
    Time { times: f64, laser_cycles: u32 },
    /// Theory has designs, and engines see less.
    #[error(
        "the check on cohort: the nearest design is found in {:.2} % of frames to {precision_m:.4} m, where {:.2} % and {precision_goal_m} m are asked for; ask for less, or give a wider choice",
        100.0 * detection, 100.0 * detection_goal
    )]
    Unconfirmed {
        detection: f64,
        detection_goal: f64,
        precision_m: f64,
        precision_goal_m: f64,
    },
    /// Bins overflow.
    #[error(
        "bins: the fullest has {times:.1} times the counts that {bits} bits hold; give less energy or less light"
    )]
    Counts { times: f64, bits: usize },
}

/// Why nothing is found.
#[derive(Debug, thiserror::Error)]
pub enum NotFound {
    /// No design will do.
    #[error(transparent)]
    Limit(#[from] Limit),
    /// An engine refuses a design.
    #[error(transparent)]
    Engine(#[from] FrameError),
}
