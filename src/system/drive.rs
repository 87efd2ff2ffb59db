//! A drive: frame after frame while the world moves (thesis 6.3.3, Fig. 97; 6.4.2, Fig. 106).
//!
//! ```text
//!   images        guide's map       start values   laser cycles              histograms
//!     ├── latency ────┼───── load ──────┼── exposure ─────┼──── readout ────────┤ depths
//!   world at this     │                 │ world in segments of the exposure
//!     time            └ world has moved on
//! ```
//!
//! The guide sees the world when its images are taken, and windows open a latency and a load later. Frames follow one another, or the
//! guide works on the next one while this one is exposed ([`FrameClock::pipelined`]). The load stands in the time of its own frame, also
//! where the chip could take it during the exposure before
//! ([`SensorConfig::frame_time`](crate::chip::SensorConfig::frame_time)): windows follow from the latest images there are.
//!
//! **What is simulated again.** Only work whose result is provably the one of the frame before is left out, so pictures are the same
//! without ([`DriveSettings::reuse`]). Start values that are those of the frame before need no load at gate level. Ray casting and light
//! of a world that has not moved stand, and of one that has those of macropixels that see nothing of it ([`worlds`]). A histogram is a
//! pure function of start value, light, macropixel and the seed of photons: with [`Noise::Fresh`], where every frame has photons of its own,
//! none is reused; with [`Noise::Still`] a macropixel has the same photons in every frame, and is exposed anew only where its light or
//! start value has changed.

use rayon::prelude::*;

use super::error::FrameError;
use super::frame::go_on;
use super::pixel::PixelDepth;
use super::policy::{Pointing, WindowPolicy};
use super::ranger::Ranger;
use super::result::PhaseTimes;
use super::settings::FrameSettings;
use super::stopwatch::Stopwatch;
use super::summary::Summary;
use crate::engine::{Answer, Histograms, Work, load};
use crate::guide::{GuideMap, PastFrame};
use crate::netlist::Netlist;
use crate::scene::GroundTruth;
use crate::units::{SPEED_OF_LIGHT_M_PER_S, Time};

mod stages;
#[cfg(test)]
mod tests;

use self::stages::{Light, Same, Spent};

/// Frames that a guide may look back on.
const REMEMBERED: usize = 4;

/// Where the photons of a frame come from.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, clap::ValueEnum, serde::Serialize)]
#[serde(rename_all = "lowercase")]
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
#[derive(Debug, Clone, Copy, PartialEq, serde::Serialize)]
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
    /// The middle of the exposure, for which depths hold, s.
    pub(crate) fn middle_s(&self) -> f64 {
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
            only: None,
            start_s: 0.0,
        }
    }
}

/// What was not simulated again in a frame.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq, serde::Serialize)]
pub struct Reused {
    /// The load at gate level.
    pub load: bool,
    /// Ray casting and light of all of the exposure.
    pub world: bool,
    /// Of the views of [`DriveFrame::worlds`] from every macropixel, those that stood.
    pub views: usize,
    /// Macropixels with the histogram and depth of the frame before.
    pub macropixels: usize,
}

/// A frame of a drive.
#[derive(Debug, Clone, PartialEq)]
pub struct DriveFrame {
    /// Its number, from 0.
    pub number: u32,
    /// When what happened.
    pub times: FrameTimes,
    /// The guide's map.
    pub guide: GuideMap,
    /// What is there in the middle of the exposure.
    pub truth: GroundTruth,
    /// Worlds, each standing still, that the exposure was taken of.
    pub worlds: usize,
    /// Counts.
    pub histograms: Histograms,
    /// Macropixels, row-major.
    pub pixels: Vec<PixelDepth>,
    /// Window of each macropixel, m, where it opens.
    pub windows_m: Vec<Option<(f64, f64)>>,
    /// Light's way there and back in one bin, as a distance, m.
    pub bin_m: f64,
    /// What the engine did, without what was reused.
    pub work: Work,
    /// What was left out.
    pub reused: Reused,
    /// What the simulation took.
    pub run_times: PhaseTimes,
}

impl DriveFrame {
    /// The frame in a few numbers.
    pub fn summary(&self) -> Summary {
        Summary::new(&self.pixels, self.bin_m)
    }
}

/// A drive that goes on from frame to frame; its memory does not grow.
#[derive(Debug)]
pub struct Drive<'a> {
    settings: &'a DriveSettings,
    pointing: Pointing<'a>,
    ranger: Ranger<'a>,
    load_netlist: Netlist,
    next: u32,
    past: Vec<PastFrame>,
    last: Option<Last>,
}

/// What the next frame may reuse.
#[derive(Debug)]
struct Last {
    starts: Vec<u16>,
    light: Light,
    histograms: Histograms,
    pixels: Vec<PixelDepth>,
}

impl<'a> Drive<'a> {
    /// Before the first frame.
    ///
    /// # Errors
    /// Bins in which no depths are found.
    pub fn new(settings: &'a DriveSettings) -> Result<Self, FrameError> {
        debug_assert!(settings.segments > 0);
        let FrameSettings {
            sensor,
            scene,
            exposure,
            depth,
            calibration,
            ..
        } = &settings.frame;
        let calibration = calibration.as_ref();
        Ok(Drive {
            settings,
            pointing: Pointing::new(settings.policy, sensor, exposure, calibration),
            ranger: Ranger::new(sensor, exposure, scene, depth, calibration)?,
            load_netlist: load::load_netlist(sensor),
            next: 0,
            past: Vec::new(),
            last: None,
        })
    }

    /// From one frame to the next, s.
    pub fn period_s(&self) -> f64 {
        let FrameClock {
            guide_latency_s,
            pipelined,
        } = self.settings.clock;
        let chip_s = self.chip_s().iter().sum::<f64>();
        match pipelined {
            true => guide_latency_s.max(chip_s),
            false => guide_latency_s + chip_s,
        }
    }

    /// What load, exposure and readout take, s.
    pub fn chip_s(&self) -> [f64; 3] {
        let FrameSettings {
            sensor, exposure, ..
        } = &self.settings.frame;
        [sensor.load_time(), exposure.end(), sensor.readout_time()].map(Time::as_s)
    }

    fn times(&self, number: u32) -> FrameTimes {
        let [load_s, exposure_s, readout_s] = self.chip_s();
        let images = self.settings.start_s + f64::from(number) * self.period_s();
        let loads = images + self.settings.clock.guide_latency_s;
        let exposes = loads + load_s;
        let reads = exposes + exposure_s;
        FrameTimes {
            images_s: images,
            load_s: loads,
            exposure_s: exposes,
            readout_s: reads,
            end_s: reads + readout_s,
        }
    }

    /// Takes the next frame; `exposed` is called with macropixels as they are done, and may stop the frame by its
    /// answer. After a frame that fails, the next one has nothing to reuse.
    ///
    /// # Errors
    /// What the guide, the engine and the load path report, and that it was stopped.
    pub fn frame<A: Answer>(
        &mut self,
        exposed: impl Fn(usize) -> A + Sync,
    ) -> Result<DriveFrame, FrameError> {
        let last = self.last.take();
        let before = last.as_ref().filter(|_| self.settings.reuse);
        let mut spent = Spent::default();
        let plan = self.plan(last.as_ref(), &exposed, &mut spent)?;
        let light = self.light(&plan, before, &mut spent);

        let mut clock = Stopwatch::new();
        let same = Same::of(
            before.filter(|_| self.settings.noise == Noise::Still),
            &light,
        );
        go_on(exposed(same.number()))?;
        spent.reused.load = before.is_some_and(|last| last.starts == plan.starts);
        spent.reused.macropixels = same.number();
        let (histograms, work) =
            self.load_and_expose(&plan, &light, &same, &exposed, &mut spent)?;
        let mut ranging = Stopwatch::new();
        let pixels = self.range(&plan, &light, &same, &histograms);
        let windows_m = (plan.wanted.par_iter().enumerate())
            .map(|(pixel, start)| self.ranger.window_m(pixel, (*start)?))
            .collect();
        spent.run.ranging_s = ranging.lap();
        spent.run.together_s = clock.lap();

        self.remember(&plan.times, &pixels, &histograms);
        self.next += 1;
        let frame = DriveFrame {
            number: plan.number,
            times: plan.times,
            guide: plan.guide,
            truth: light.truth.clone(),
            worlds: light.worlds.len(),
            histograms: histograms.clone(),
            pixels: pixels.clone(),
            windows_m,
            bin_m: self.ranger.bin_s() * SPEED_OF_LIGHT_M_PER_S / 2.0,
            work,
            reused: spent.reused,
            run_times: spent.run,
        };
        self.last = Some(Last {
            starts: plan.starts,
            light,
            histograms,
            pixels,
        });
        Ok(frame)
    }

    fn remember(&mut self, times: &FrameTimes, pixels: &[PixelDepth], histograms: &Histograms) {
        if self.past.len() == REMEMBERED {
            self.past.remove(0);
        }
        self.past.push(PastFrame {
            time_s: times.exposure_s,
            range_m: pixels.iter().map(|p| p.measured_m).collect(),
            counts: (histograms.iter())
                .map(|counts| counts.iter().map(|&n| u32::from(n)).sum())
                .collect(),
        });
    }
}

/// The seed of a frame's photons and guide errors: SplitMix64 of the drive's, so that no frame has those of another drive's next one.
fn seed_of(seed: u64, frame: u32) -> u64 {
    let mut z = seed ^ u64::from(frame).wrapping_mul(0x9e37_79b9_7f4a_7c15);
    z = (z ^ (z >> 30)).wrapping_mul(0xbf58_476d_1ce4_e5b9);
    z = (z ^ (z >> 27)).wrapping_mul(0x94d0_49bb_1331_11eb);
    z ^ (z >> 31)
}
