//! What a drive depends on, and when the parts of its frames begin and end.

use std::ops::Range;

use crate::system::policy::WindowPolicy;
use crate::system::settings::FrameSettings;

/// Where the photons of a frame come from.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, serde::Serialize)]
#[cfg_attr(feature = "cli", derive(clap::ValueEnum))]
#[serde(rename_all = "lowercase")]
#[non_exhaustive]
pub enum Noise {
    /// Every frame has its own photons and guide errors.
    #[default]
    Fresh,
    /// A macropixel has the same photons in every frame, as long as its light and start value stay the same.
    Still,
}

/// When the parts of a frame begin and end.
#[derive(Debug, Clone, Copy, PartialEq, serde::Serialize)]
pub struct FrameClock {
    /// From the cameras' exposure to the guide's map, s.
    pub guide_latency_s: f64,
    /// The guide works on the next frame while this one is loaded, exposed and read out.
    pub pipelined: bool,
}

impl Default for FrameClock {
    /// The demonstrator's: 145 ms for everything before the exposure, one after the other (Fig. 106).
    fn default() -> Self {
        FrameClock {
            guide_latency_s: 0.145,
            pipelined: false,
        }
    }
}

/// When what happened in a frame, s on the scene's clock.
#[derive(Debug, Clone, Copy, PartialEq, serde::Serialize, serde::Deserialize)]
pub struct FrameTimes {
    /// The cameras see the world.
    pub images_s: f64,
    /// The guide's map is there, and the load begins.
    pub load_s: f64,
    /// The first laser cycle begins.
    pub exposure_s: f64,
    /// The last one has ended, and the readout begins.
    pub readout_s: f64,
    /// The histograms are out.
    pub end_s: f64,
}

impl FrameTimes {
    /// From when until when it is exposed, s.
    pub(crate) fn exposed_s(&self) -> Range<f64> {
        self.exposure_s..self.readout_s
    }

    /// The middle of the exposure, for which depths hold, s.
    pub fn middle_s(&self) -> f64 {
        0.5 * (self.exposure_s + self.readout_s)
    }
}

/// Everything that a drive depends on.
#[derive(Debug, Clone)]
pub struct DriveSettings {
    /// What each frame depends on; its scene is the one at time 0, its seed that of the drive.
    pub frame: FrameSettings,
    /// How windows follow from the guide.
    pub policy: WindowPolicy,
    /// How long the parts of a frame take.
    pub clock: FrameClock,
    /// Parts of an exposure in which the world stands still, at least 1.
    pub segments: u32,
    /// Where photons come from.
    pub noise: Noise,
    /// Leave out what is provably the same as in the frame before; without it everything is simulated anew, for the same pictures.
    pub reuse: bool,
    /// Learn from depths how far the right camera has turned, and rectify the guide's images by it from frame to frame.
    pub self_calibrates: bool,
    /// Macropixels whose SPADs may be on, row-major; `None` for all.
    pub only: Option<Vec<bool>>,
    /// The time of the scene at which the first images are taken, s.
    pub start_s: f64,
}

impl DriveSettings {
    /// A drive of such frames from time 0 on, all macropixels lit, windows in the middle of the guide's estimates and the demonstrator's
    /// clock; exposures have four segments, every frame its own photons, and what is the same as before is not simulated again.
    pub fn new(frame: FrameSettings) -> Self {
        DriveSettings {
            frame,
            policy: WindowPolicy::default(),
            clock: FrameClock::default(),
            segments: 4,
            noise: Noise::default(),
            reuse: true,
            self_calibrates: false,
            only: None,
            start_s: 0.0,
        }
    }
}
