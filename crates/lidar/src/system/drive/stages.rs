//! The stages of a frame of a drive: plan, light, load and exposure, ranging.

use std::sync::Arc;

use super::reuse::{ExposureLight, PreviousFrame, Spent, UnchangedPixels};
use super::settings::{DriveSettings, FrameTimes, Noise};
use super::state::DriveSimulation;
use crate::engine::{Answer, EngineWork, Histograms, LitPixel, expose};
use crate::guide::{GuideInput, GuideMap};
use crate::scene::DVec3;
use crate::system::error::FrameError;
use crate::system::frame::check_not_stopped;
use crate::system::light::{lit_pixels, photon_stream, starts_of};
use crate::system::load::load_starts;
use crate::system::pixel::PixelDepth;
use crate::system::ranger::PixelContext;
use crate::system::settings::FrameSettings;
use crate::system::stopwatch::{Stopwatch, timed};
use crate::system::worlds::{self, LastWorld};

/// A frame whose windows are chosen.
pub(super) struct Plan {
    pub(super) number: u32,
    pub(super) times: FrameTimes,
    pub(super) seed: u64,
    pub(super) guide: GuideMap,
    pub(super) wanted: Vec<Option<u16>>,
    pub(super) starts: Vec<u16>,
}

impl DriveSimulation<'_> {
    /// Asks the guide, and points the windows.
    pub(super) fn plan<A: Answer>(
        &mut self,
        last: Option<&PreviousFrame>,
        exposed: &impl Fn(usize) -> A,
        spent: &mut Spent,
    ) -> Result<Plan, FrameError> {
        let DriveSettings {
            frame, noise, only, ..
        } = self.settings;
        let FrameSettings { sensor, scene, .. } = frame;
        let number = self.next;
        let times = self.times(number);
        let seed = match noise {
            Noise::Fresh => seed_of(frame.seed, number),
            Noise::Still => frame.seed,
        };
        let mut clock = Stopwatch::new();
        let mut world = scene.snapshot(times.images_s);
        if let Some(calibration) = &self.self_calibration {
            world = calibration.rectified(world);
        }
        let input = GuideInput {
            scene: &world,
            rows: sensor.rows as u32,
            cols: sensor.cols as u32,
            seed,
            time_s: times.middle_s(),
            earlier: &self.past,
            velocity_m_s: DVec3::ZERO,
            views: self.settings.reuse.then_some(&self.views),
        };
        let guide = frame.guide.estimate(&input)?;
        spent.run.guide_s = clock.lap();
        check_not_stopped(exposed(0))?;

        let seen: Vec<Option<f64>> = last
            .map(|last| last.pixels.iter().map(|p| p.measured_m).collect())
            .unwrap_or_default();
        let aimed = (self.self_calibration.as_ref()).map(|c| c.aimed(&guide, number));
        let mut wanted = (self.pointing).windows(aimed.as_ref().unwrap_or(&guide), &seen);
        for (start, is_on) in wanted.iter_mut().zip(only.iter().flatten()) {
            *start = start.filter(|_| *is_on);
        }
        let starts = starts_of(sensor, &wanted);
        spent.run.windows_s = clock.lap();
        Ok(Plan {
            number,
            times,
            seed,
            guide,
            wanted,
            starts,
        })
    }

    /// The worlds of the exposure and their light, anew where they are not those of `before`.
    pub(super) fn light(
        &self,
        plan: &Plan,
        before: Option<&PreviousFrame>,
        spent: &mut Spent,
    ) -> ExposureLight {
        let FrameSettings {
            sensor,
            scene,
            exposure,
            ..
        } = &self.settings.frame;
        let reuse = self.settings.reuse;
        let mut clock = Stopwatch::new();
        let stream = photon_stream(sensor, exposure, plan.seed, scene);
        let worlds = worlds::worlds(scene, plan.times.exposed_s(), self.settings.segments);
        let before = before.map(|last| &last.light);
        let (truth, each, newest) = match before.filter(|last| last.worlds == worlds) {
            Some(last) => {
                spent.reused.world = true;
                spent.reused.views = worlds.len() * last.pixels.len();
                (
                    last.truth.clone(),
                    last.each.clone(),
                    Arc::clone(&last.newest),
                )
            }
            None => {
                let known = before.map(|last| &*last.newest);
                let array = (sensor.rows as u32, sensor.cols as u32);
                let (truths, views) = worlds::truths(&worlds, array, known, reuse);
                spent.reused.views = views;
                spent.run.scene_s = clock.lap();
                let lights = worlds::lights(&worlds, &truths, &stream, known, reuse);
                let each = worlds::light_of(&lights, exposure);
                let truth = truths[truths.len() / 2].clone();
                (truth, each, LastWorld::new(&worlds, truths, lights))
            }
        };
        let pixels = lit_pixels(sensor, &plan.wanted, &each);
        spent.run.light_s = clock.lap();
        ExposureLight {
            stream,
            worlds,
            newest,
            truth,
            each,
            pixels,
        }
    }

    /// The histograms of all macropixels, beside the load of their start values where they are other ones.
    pub(super) fn load_and_expose<A: Answer>(
        &self,
        plan: &Plan,
        light: &ExposureLight,
        same: &UnchangedPixels,
        exposed: &(impl Fn(usize) -> A + Sync),
        spent: &mut Spent,
    ) -> Result<(Histograms, EngineWork), FrameError> {
        let FrameSettings {
            sensor,
            exposure,
            engine,
            cohort,
            ..
        } = &self.settings.frame;
        let changed = light.pixels.iter().enumerate();
        let changed = changed.filter(|(pixel, _)| same.last_of(*pixel).is_none());
        let changed: Vec<LitPixel> = changed.map(|(_, lit)| lit.clone()).collect();
        let engine = engine.expose(sensor, exposure, *cohort);
        // The gates of the load path are one processor's work, and tell nothing that the exposure waits for.
        let load = || load_starts(sensor, &self.load_netlist, &plan.starts).map(drop);
        let is_loaded = spent.reused.load;
        let by_load_path = || timed(|| if is_loaded { Ok(()) } else { load() });
        let by_engine = || timed(|| expose(&*engine, &light.stream, &changed, exposed));
        let ((loaded, load_s), (taken, exposure_s)) = rayon::join(by_load_path, by_engine);
        (spent.run.load_s, spent.run.exposure_s) = (load_s, exposure_s);
        loaded?;
        let taken = taken?;
        let mut histograms = Histograms::empty(light.pixels.len(), sensor.bins);
        let mut new = taken.histograms.iter();
        for pixel in 0..light.pixels.len() {
            let counts = match same.last_of(pixel) {
                Some(last) => &last.histograms[pixel],
                None => new.next().expect("one for each that has changed"),
            };
            histograms[pixel].copy_from_slice(counts);
        }
        Ok((histograms, taken.work))
    }

    /// Depths, those of the frame before where nothing of what they follow from is new.
    pub(super) fn range(
        &self,
        plan: &Plan,
        light: &ExposureLight,
        same: &UnchangedPixels,
        histograms: &Histograms,
    ) -> Vec<PixelDepth> {
        self.ranger.of_array(histograms.counts(), |pixel, counts| {
            let known = PixelContext {
                pixel,
                start: plan.wanted[pixel],
                true_m: light.truth.range_m[pixel],
                guide_m: plan.guide.range_m[pixel],
            };
            match same.last_of(pixel).map(|last| last.pixels[pixel]) {
                Some(before) if known.is_of(&before) => before,
                _ => self.ranger.depth(&known, counts),
            }
        })
    }
}

/// The seed of a frame's photons and guide errors: SplitMix64 of the drive's, so that no frame has those of another drive's next one.
fn seed_of(seed: u64, frame: u32) -> u64 {
    let mut z = seed ^ u64::from(frame).wrapping_mul(0x9e37_79b9_7f4a_7c15);
    z = (z ^ (z >> 30)).wrapping_mul(0xbf58_476d_1ce4_e5b9);
    z = (z ^ (z >> 27)).wrapping_mul(0x94d0_49bb_1331_11eb);
    z ^ (z >> 31)
}
