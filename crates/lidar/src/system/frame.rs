//! One guided frame, from the scene to a depth map (thesis 6.3.3, Fig. 97).
//!
//! ```text
//!   scene ─► ground truth ─► light per macropixel ─► photon stream ─────────┐
//!     └────► stereo guide ─► start values ─► serial stream ─► load path ─► exposure ─► histograms ─► depth
//!                                            (gate level)    (any engine, probes also at gate level)
//! ```

use std::sync::Arc;

use rayon::prelude::*;

use self::at_gates::AtGates;
use super::circumstances::Circumstances;
use super::error::FrameError;
use super::light::{light_in, lit_pixels, photon_stream, starts_of, truth_in};
use super::load::load_starts;
use super::pixel::PixelDepth;
use super::policy::{Pointing, WindowPolicy};
use super::ranger::{PixelContext, Ranger};
use super::remark::DepthHint;
use super::result::{Frame, PhaseTimes};
use super::settings::{EngineKind, FrameSettings, GateProbe};
use super::shared::{SharedView, SharedWork};
use super::stopwatch::{Stopwatch, timed};
use super::tolerance::{Tolerance, ToleranceResult};
use crate::chip::Exposure;
use crate::engine::{
    Answer, Cohort, EngineError, ExposureResult, LitPixel, PulsedPixel, Replay, Window, expose,
    expose_without_skipping, load,
};
use crate::guide::{GuideInput, GuideMap};
use crate::photon::{PhotonStream, PixelLight, SpadEvent};
use crate::scene::{GroundTruth, is_beyond_model};
use crate::units::{SPEED_OF_LIGHT_M_PER_S, Time};

mod at_gates;
#[cfg(test)]
mod tests;

/// Takes a frame, every window in the middle of the guide's estimate. `probes` chooses the macropixels to run at gate
/// level once the guide is known; `exposed` is called with the number of macropixels as they are done, with none
/// between the steps of the frame, and may stop it by its [`Answer`].
///
/// # Errors
/// A guide without a map, and what [`take_guided_frame`] reports.
pub fn take_frame<A: Answer>(
    settings: &FrameSettings,
    probes: impl FnOnce(&GuideMap) -> Vec<GateProbe>,
    exposed: impl Fn(usize) -> A + Sync,
) -> Result<Frame, FrameError> {
    take_frame_by(settings, WindowPolicy::default(), probes, exposed)
}

/// As [`take_frame`], with windows that a policy chooses; nothing came before the frame.
///
/// # Errors
/// As those of [`take_frame`].
pub fn take_frame_by<A: Answer>(
    settings: &FrameSettings,
    policy: WindowPolicy,
    probes: impl FnOnce(&GuideMap) -> Vec<GateProbe>,
    exposed: impl Fn(usize) -> A + Sync,
) -> Result<Frame, FrameError> {
    let FrameSettings {
        sensor,
        scene,
        exposure,
        seed,
        calibration,
        ..
    } = settings;
    let (rows, cols) = (sensor.rows as u32, sensor.cols as u32);
    let mut clock = Stopwatch::new();
    let input = GuideInput::still(scene, rows, cols, *seed);
    let guide = settings.guide.estimate(&input)?;
    let guide_s = clock.lap();
    check_not_stopped(exposed(0))?;
    let mut pointing = Pointing::new(policy, sensor, exposure, calibration.as_ref());
    let wanted = pointing.windows(&guide, &[]);
    let windows_s = clock.lap();
    let mut frame = take_guided_frame(settings, &guide, &wanted, probes, exposed)?;
    (frame.times.guide_s, frame.times.windows_s) = (guide_s, windows_s);
    Ok(frame)
}

/// As [`take_frame_by`] without probes, with the work that frames share.
///
/// # Errors
/// As those of [`take_frame`].
pub(crate) fn take_shared_frame<A: Answer>(
    settings: &FrameSettings,
    policy: WindowPolicy,
    shared: &SharedWork,
    exposed: impl Fn(usize) -> A + Sync,
) -> Result<Frame, FrameError> {
    let mut clock = Stopwatch::new();
    let look = shared.shared_look(settings);
    let Some(guided) = look.windows(settings, policy)? else {
        return take_frame_by(settings, policy, |_| Vec::new(), exposed);
    };
    let guide_s = clock.lap();
    let (guide, wanted) = &*guided;
    let plan = Plan {
        settings,
        guide,
        wanted,
        shared: Some((shared, &look)),
    };
    let mut frame = plan.expose(|_| Vec::new(), exposed)?;
    frame.times.guide_s = guide_s;
    Ok(frame)
}

/// Takes a frame through windows that are given: `wanted` has a start value for every macropixel, row-major, `None` for one whose
/// SPADs are off. `guide` is what they were chosen by, for the reasons why macropixels have no depth; the settings' own guide is not asked.
///
/// # Errors
/// Configurations that the engine refuses, waveforms that cannot be written, and disagreement between
/// netlist and models, which would be a fault of this program.
///
/// # Panics
/// When guide or start values are not one for each macropixel.
pub fn take_guided_frame<A: Answer>(
    settings: &FrameSettings,
    guide: &GuideMap,
    wanted: &[Option<u16>],
    probes: impl FnOnce(&GuideMap) -> Vec<GateProbe>,
    exposed: impl Fn(usize) -> A + Sync,
) -> Result<Frame, FrameError> {
    let sensor = &settings.sensor;
    assert_eq!(wanted.len(), sensor.pixels());
    assert_eq!(guide.range_m.len(), sensor.pixels());
    let plan = Plan {
        settings,
        guide,
        wanted,
        shared: None,
    };
    plan.expose(probes, exposed)
}

/// A frame whose windows are chosen.
struct Plan<'a> {
    settings: &'a FrameSettings,
    guide: &'a GuideMap,
    wanted: &'a [Option<u16>],
    /// What frames share, and what of it those with this look do.
    shared: Option<(&'a SharedWork, &'a Arc<SharedView>)>,
}

/// What is there, and what of it falls on the array.
struct Light {
    truth: Arc<GroundTruth>,
    stream: PhotonStream,
    each: Arc<Vec<PixelLight>>,
    pixels: Vec<LitPixel>,
}

/// What an engine counted, what a tolerance kept to, and how long it took.
struct FrameCounts {
    exposed: ExposureResult,
    kept: Option<ToleranceResult>,
    took_s: f64,
}

/// What the counts say, and how long it took to tell.
struct FrameDepths {
    depths: Vec<PixelDepth>,
    bin_s: f64,
    remark: Option<String>,
    hints: Vec<DepthHint>,
    depths_of_medium: usize,
    light_cut: usize,
    took_s: f64,
}

impl Light {
    /// Photons and dark counts of the whole array on average.
    fn photons_expected(&self, exposure: &Exposure) -> f64 {
        let config = self.stream.config();
        let cycles = f64::from(exposure.laser_cycles);
        let photons = |light| config.most_photons_per_cycle(light) * cycles;
        self.each.iter().map(photons).sum()
    }
}

impl Plan<'_> {
    fn expose<A: Answer>(
        &self,
        probes: impl FnOnce(&GuideMap) -> Vec<GateProbe>,
        exposed: impl Fn(usize) -> A + Sync,
    ) -> Result<Frame, FrameError> {
        let (sensor, exposure) = (&self.settings.sensor, &self.settings.exposure);
        let mut clock = Stopwatch::new();
        let truth = match self.shared {
            Some((_, look)) => look.truth(),
            None => Arc::new(truth_in(sensor, exposure, &self.settings.scene)),
        };
        let scene_s = clock.lap();
        let light = self.light(truth);
        let light_s = clock.lap();

        // A probe keeps one processor busy about as long as load, engine and ranging keep the others.
        let probes = probes(self.guide);
        let by_gates = || timed(|| self.probe(&light, &probes, &exposed));
        let by_load_path = || timed(|| self.load());
        let by_engine = || {
            let counted = self.count(&light, &exposed)?;
            let ranged = self.range(&light, &counted)?;
            Ok::<_, FrameError>((counted, ranged))
        };
        let ((probed, probes_s), ((load_time, load_s), measured)) =
            rayon::join(by_gates, || rayon::join(by_load_path, by_engine));
        let together_s = clock.lap();
        let load_time = load_time?;
        let (counted, ranged) = measured?;
        let probed = probed?;
        self.compare_probes(&counted, &probed)?;

        Ok(Frame {
            rows: sensor.rows,
            cols: sensor.cols,
            bins: sensor.bins,
            bin_m: ranged.bin_s * SPEED_OF_LIGHT_M_PER_S / 2.0,
            histograms: counted.exposed.histograms.into_counts(),
            pixels: ranged.depths,
            remark: ranged.remark,
            hints: ranged.hints,
            depths_of_medium: ranged.depths_of_medium,
            light_cut: ranged.light_cut,
            photons_expected: light.photons_expected(exposure),
            work: counted.exposed.work,
            kept: counted.kept,
            load_bits: sensor.load_bits(),
            load_time,
            readout_time: sensor.readout_time(),
            exposure_time: exposure.end(),
            probes: probes.iter().map(|p| (p.row, p.col)).collect(),
            probed_cycles: probed.iter().map(|p| p.exposure.laser_cycles).collect(),
            times: PhaseTimes {
                scene_s,
                load_s,
                light_s,
                exposure_s: counted.took_s,
                probes_s,
                ranging_s: ranged.took_s,
                together_s,
                ..PhaseTimes::default()
            },
        })
    }

    fn light(&self, truth: Arc<GroundTruth>) -> Light {
        let s = self.settings;
        let stream = photon_stream(&s.sensor, &s.exposure, s.seed, &s.scene);
        let each = match self.shared {
            Some((_, look)) => look.light(&s.scene, &stream),
            None => Arc::new(light_in(&s.exposure, &s.scene, &truth, &stream)),
        };
        Light {
            truth,
            pixels: lit_pixels(&s.sensor, self.wanted, &each),
            stream,
            each,
        }
    }

    /// Loads the start values at gate level, and tells how long the chip takes for it.
    fn load(&self) -> Result<Time, FrameError> {
        let sensor = &self.settings.sensor;
        let starts = starts_of(sensor, self.wanted);
        match self.shared {
            Some((shared, _)) => shared.load(sensor, starts),
            None => {
                let load_path = load::load_netlist(sensor);
                Ok(load_starts(sensor, &load_path, &starts)?.duration)
            }
        }
    }

    /// The histograms of all macropixels by the engine that the settings ask for.
    fn count<A: Answer>(
        &self,
        light: &Light,
        done: &(impl Fn(usize) -> A + Sync),
    ) -> Result<FrameCounts, FrameError> {
        let FrameSettings {
            sensor,
            exposure,
            engine,
            cohort,
            depth,
            tolerance_m,
            skip,
            ..
        } = self.settings;
        let (stream, pixels) = (&light.stream, &light.pixels[..]);
        let mut clock = Stopwatch::new();
        let mut kept = None;
        let exposed = match (tolerance_m, skip) {
            (Some(tolerance_m), _) => {
                let tolerance = Tolerance {
                    tolerance_m: *tolerance_m,
                    sensor,
                    exposure,
                    peak: &depth.peak,
                };
                let (exposed, bound) = tolerance.expose(stream, pixels, done)?;
                kept = Some(bound);
                exposed
            }
            (None, true) if *engine == EngineKind::Cohort => {
                let cohort = match self.shared {
                    Some((shared, look)) => shared.cohort(look, self.settings),
                    None => Arc::new(Cohort::new(sensor, exposure, *cohort)),
                };
                let refused = |why| refused_by(&cohort, stream, pixels, why);
                expose(&*cohort, stream, pixels, done).map_err(refused)?
            }
            (None, true) => {
                let engine = engine.expose(sensor, exposure, *cohort);
                expose(&*engine, stream, pixels, done)?
            }
            (None, false) => {
                let engine = engine.replay(sensor, exposure)?;
                expose_without_skipping(&*engine, stream, pixels, done)?
            }
        };
        Ok(FrameCounts {
            exposed,
            kept,
            took_s: clock.lap(),
        })
    }

    fn range(&self, light: &Light, counted: &FrameCounts) -> Result<FrameDepths, FrameError> {
        let s = self.settings;
        let mut clock = Stopwatch::new();
        let calibration = s.calibration.as_ref();
        let ranger = Ranger::new(&s.sensor, &s.exposure, &s.scene, &s.depth, calibration)?;
        let counts = counted.exposed.histograms.counts();
        let depths = ranger.of_array(counts, |pixel, counts| {
            let known = PixelContext {
                pixel,
                start: self.wanted[pixel],
                true_m: light.truth.range_m[pixel],
                guide_m: self.guide.range_m[pixel],
            };
            ranger.depth(&known, counts)
        });
        let circumstances = Circumstances {
            sensor: &s.sensor,
            exposure: &s.exposure,
            bin_s: ranger.bin_s(),
            scene: &s.scene,
            guide: &*s.guide,
            light: &light.each,
            pixels: &depths,
        };
        Ok(FrameDepths {
            remark: circumstances.remark(),
            hints: circumstances.hints(),
            depths_of_medium: self.depths_of_medium(light, &depths, ranger.bin_s()),
            light_cut: light
                .each
                .iter()
                .filter(|light| is_beyond_model(light))
                .count(),
            bin_s: ranger.bin_s(),
            depths,
            took_s: clock.lap(),
        })
    }

    /// Depths of what fog or smoke sends back itself.
    fn depths_of_medium(&self, light: &Light, depths: &[PixelDepth], bin_s: f64) -> usize {
        if !self.settings.scene.medium.sends_light_back() {
            return 0;
        }
        let bin_m = 0.5 * SPEED_OF_LIGHT_M_PER_S * bin_s;
        let is_of_medium = |(pixel, depth): &(usize, &PixelDepth)| {
            let seen = &light.truth.surfaces[*pixel];
            let is_before_all = |m: f64| seen.iter().all(|surface| m < surface.range_m - bin_m);
            depth.measured_m.is_some_and(is_before_all)
        };
        depths.iter().enumerate().filter(is_of_medium).count()
    }

    fn probe<A: Answer>(
        &self,
        light: &Light,
        probes: &[GateProbe],
        done: &(impl Fn(usize) -> A + Sync),
    ) -> Result<Vec<AtGates>, FrameError> {
        let s = self.settings;
        let run = |probe| {
            check_not_stopped(done(0))?;
            AtGates::run(s, &light.stream, &light.pixels, probe)
        };
        probes.par_iter().map(run).collect()
    }

    /// Compares every probe with the frame's counts, or with those of the `window` engine where the frame's engine has no photons, or the
    /// probe simulates a part of the exposure. That engine is then compared with the frame.
    ///
    /// # Errors
    /// The first disagreement.
    fn compare_probes(&self, counted: &FrameCounts, probed: &[AtGates]) -> Result<(), FrameError> {
        let s = self.settings;
        let has_tolerance = counted.kept.is_some();
        let engine = s.engine.of_probes(has_tolerance);
        for probed in probed {
            let agree = |gate: Vec<u16>, model: Vec<u16>| {
                if gate == model {
                    return Ok(());
                }
                Err(FrameError::Disagreement {
                    row: probed.pixel / s.sensor.cols,
                    col: probed.pixel % s.sensor.cols,
                    engine,
                    gate,
                    model,
                })
            };
            let by_window = |exposure: &Exposure, events: &[SpadEvent]| {
                let pixel = PulsedPixel {
                    number: probed.pixel as u32,
                    start: probed.start,
                    pulses: events,
                };
                let histograms = Window::new(&s.sensor, exposure).replay(&[pixel])?;
                Ok::<_, EngineError>(histograms.into_counts())
            };
            let counted = counted.exposed.histograms[probed.pixel].to_vec();
            if engine != EngineKind::Window {
                agree(probed.counts.clone(), counted)?;
                continue;
            }
            let simulated = by_window(&probed.exposure, probed.simulated())?;
            agree(probed.counts.clone(), simulated)?;
            if s.engine == engine && !has_tolerance {
                agree(by_window(&s.exposure, &probed.events)?, counted)?;
            }
        }
        Ok(())
    }
}

/// Whether a frame is still wanted.
///
/// # Errors
/// When it is not.
pub(super) fn check_not_stopped(answer: impl Answer) -> Result<(), EngineError> {
    if answer.stops() {
        Err(EngineError::Stopped)
    } else {
        Ok(())
    }
}

/// The refusal of a frame by the cohort engine, with how much of the frame it is about.
fn refused_by(
    cohort: &Cohort,
    stream: &PhotonStream,
    pixels: &[LitPixel],
    why: EngineError,
) -> FrameError {
    if why == EngineError::Stopped {
        return why.into();
    }
    let is_refused = |pixel: &&LitPixel| {
        let light = pixel.light.as_ref();
        light.is_some_and(|light| {
            let cohort = cohort.of_macropixel(pixel.number);
            let cohorts = cohort.cohorts_in_steps(stream.config(), pixel.start, light);
            cohorts.is_err()
        })
    };
    FrameError::Refused {
        why,
        refused: pixels.par_iter().filter(is_refused).count(),
        pixels: pixels.len(),
    }
}
