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
//! of a world that has not moved stand, and of one that has those of macropixels that see nothing of it ([`worlds`]). What cameras see of it
//! but for noise stands, too. A histogram is a
//! pure function of start value, light, macropixel and the seed of photons: with [`Noise::Fresh`], where every frame has photons of its own,
//! none is reused; with [`Noise::Still`] a macropixel has the same photons in every frame, and is exposed anew only where its light or
//! start value has changed.

mod reuse;
mod self_calibration;
mod settings;
mod stages;
mod state;
#[cfg(test)]
mod tests;

pub use reuse::DriveReuse;
pub use settings::{DriveSettings, FrameClock, FrameTimes, Noise};
pub use state::DriveSimulation;

use rayon::prelude::*;

use self::reuse::{PreviousFrame, Spent, UnchangedPixels};
use super::error::FrameError;
use super::frame::check_not_stopped;
use super::pixel::PixelDepth;
use super::result::PhaseTimes;
use super::stopwatch::Stopwatch;
use super::summary::FrameSummary;
use crate::engine::{Answer, EngineWork, Histograms};
use crate::guide::{GuideMap, PastFrame};
use crate::scene::GroundTruth;
use crate::units::SPEED_OF_LIGHT_M_PER_S;

/// Frames that a guide may look back on.
const REMEMBERED: usize = 4;

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
    /// By how much the right camera was taken to have turned outwards since calibration, degrees; 0 without self-calibration.
    pub camera_turn_deg: f64,
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
    pub work: EngineWork,
    /// What was left out.
    pub reused: DriveReuse,
    /// What the simulation took.
    pub run_times: PhaseTimes,
}

impl DriveFrame {
    /// The frame in a few numbers.
    pub fn summary(&self) -> FrameSummary {
        FrameSummary::new(&self.pixels, self.bin_m)
    }
}

impl DriveSimulation<'_> {
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
        let same = UnchangedPixels::new(
            before.filter(|_| self.settings.noise == Noise::Still),
            &light,
        );
        check_not_stopped(exposed(same.number()))?;
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
        let camera_turn_deg = self.self_calibration.as_ref().map_or(0.0, |c| c.turn_deg());
        if let Some(calibration) = &mut self.self_calibration {
            calibration.learn(&pixels);
        }
        self.next += 1;
        let frame = DriveFrame {
            number: plan.number,
            times: plan.times,
            guide: plan.guide,
            camera_turn_deg,
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
        self.last = Some(PreviousFrame {
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
