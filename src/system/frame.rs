//! One guided frame, from the scene to a depth map (thesis 6.3.3, Fig. 97).
//!
//! ```text
//!   scene ─► ground truth ─► light per macropixel ─► photon stream ─────────┐
//!     └────► stereo guide ─► start values ─► serial stream ─► load path ─► exposure ─► histograms ─► depth
//!                                            (gate level)    (any engine, probes also at gate level)
//! ```

use rayon::prelude::*;

use super::error::FrameError;
use super::light::{light_in, lit, photon_stream, starts_of, truth_in};
use super::policy::{Pointing, WindowPolicy};
use super::ranger::{Known, Ranger};
use super::remark::Circumstances;
use super::result::{Frame, PhaseTimes};
use super::settings::{EngineKind, FrameSettings, Probe};
use super::stopwatch::{Stopwatch, timed};
use super::tolerance::{Kept, Tolerance};
use crate::chip::{Exposure, Sensor, SensorConfig};
use crate::engine::waveform::{self, View};
use crate::engine::{
    Answer, Cohort, EngineError, Exposed, GateSimulation, LitPixel, Replay, Window, expose,
    expose_without_skipping, load,
};
use crate::guide::{GuideInput, GuideMap};
use crate::netlist::Netlist;
use crate::photon::{PhotonStream, SpadEvent};
use crate::units::SPEED_OF_LIGHT_M_PER_S;
use crate::waves::WaveFormat;

/// Takes a frame, every window in the middle of the guide's estimate. `probes` chooses the macropixels to run at gate level once the
/// guide is known; `exposed` is told of macropixels as they are done, of none between the steps of the frame, and may stop it by its
/// [`Answer`].
///
/// # Errors
/// A guide without a map, and what [`take_guided_frame`] reports.
pub fn take_frame<A: Answer>(
    settings: &FrameSettings,
    probes: impl FnOnce(&GuideMap) -> Vec<Probe>,
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
    probes: impl FnOnce(&GuideMap) -> Vec<Probe>,
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
    go_on(exposed(0))?;
    let mut pointing = Pointing::new(policy, sensor, exposure, calibration.as_ref());
    let wanted = pointing.windows(&guide, &[]);
    let windows_s = clock.lap();
    let mut frame = take_guided_frame(settings, &guide, &wanted, probes, exposed)?;
    (frame.times.guide_s, frame.times.windows_s) = (guide_s, windows_s);
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
    probes: impl FnOnce(&GuideMap) -> Vec<Probe>,
    exposed: impl Fn(usize) -> A + Sync,
) -> Result<Frame, FrameError> {
    let FrameSettings {
        sensor,
        scene,
        exposure,
        seed,
        engine: engine_kind,
        depth,
        calibration,
        guide: source,
        ..
    } = settings;
    assert_eq!(wanted.len(), sensor.pixels());
    assert_eq!(guide.range_m.len(), sensor.pixels());
    let mut clock = Stopwatch::new();
    let mut times = PhaseTimes::default();

    let truth = truth_in(sensor, exposure, scene);
    times.scene_s = clock.lap();

    let stream = photon_stream(sensor, exposure, *seed, scene);
    let light = light_in(exposure, scene, &truth, &stream);
    let pixels = lit(sensor, wanted, &light);
    let photons_expected = light
        .iter()
        .map(|light| {
            stream.config().most_photons_per_cycle(light) * f64::from(exposure.laser_cycles)
        })
        .sum();
    times.light_s = clock.lap();

    // A probe keeps one processor busy about as long as load, engine and ranging keep the others.
    let probes = probes(guide);
    let done = exposed;
    let by_gates = || {
        let run = |probe| {
            go_on(done(0))?;
            AtGates::run(sensor, exposure, &stream, &pixels, probe)
        };
        timed(|| probes.par_iter().map(run).collect::<Result<Vec<_>, _>>())
    };
    let by_load_path = || {
        let starts = starts_of(sensor, wanted);
        timed(|| load_starts(sensor, &load::load_netlist(sensor), &starts))
    };
    let by_engine = || {
        let mut clock = Stopwatch::new();
        let (exposed, kept) = expose_array(settings, &stream, &pixels, &done)?;
        let exposure_s = clock.lap();
        let ranger = Ranger::new(sensor, exposure, scene, depth, calibration.as_ref())?;
        let depths = ranger.of_array(exposed.histograms.counts(), |pixel, counts| {
            let known = Known {
                pixel,
                start: wanted[pixel],
                true_m: truth.range_m[pixel],
                guide_m: guide.range_m[pixel],
            };
            ranger.depth(&known, counts)
        });
        let circumstances = Circumstances {
            sensor,
            exposure,
            bin_s: ranger.bin_s(),
            scene,
            guide: &**source,
            light: &light,
            pixels: &depths,
        };
        let remark = circumstances.remark();
        let ranged = (depths, ranger.bin_s(), remark);
        Ok::<_, FrameError>((exposed, kept, ranged, [exposure_s, clock.lap()]))
    };
    let loaded_and_exposed = || rayon::join(by_load_path, by_engine);
    let ((probed, probes_s), ((load, load_s), exposed)) = rayon::join(by_gates, loaded_and_exposed);
    times.together_s = clock.lap();
    let load = load?;
    times.load_s = load_s;
    let (exposed, kept, (depths, bin_s, remark), took_s) = exposed?;
    [times.exposure_s, times.ranging_s] = took_s;
    times.probes_s = probes_s;
    for probed in probed? {
        let engine = engine_kind.of_probes(kept.is_some());
        let model = match kept.is_some() || engine != *engine_kind {
            true => Window::new(sensor, exposure).histogram(probed.start, &probed.events)?,
            false => exposed.histograms[probed.pixel].to_vec(),
        };
        if probed.counts != model {
            return Err(FrameError::Disagreement {
                row: probed.pixel / sensor.cols,
                col: probed.pixel % sensor.cols,
                engine,
                gate: probed.counts,
                model,
            });
        }
    }

    Ok(Frame {
        rows: sensor.rows,
        cols: sensor.cols,
        bins: sensor.bins,
        bin_m: bin_s * SPEED_OF_LIGHT_M_PER_S / 2.0,
        histograms: exposed.histograms.into_counts(),
        pixels: depths,
        remark,
        photons_expected,
        work: exposed.work,
        kept,
        load_bits: sensor.load_bits(),
        load_time: load.duration,
        readout_time: sensor.readout_time(),
        exposure_time: exposure.end(),
        probes: probes.iter().map(|p| (p.row, p.col)).collect(),
        times,
    })
}

/// Whether a frame is still wanted.
///
/// # Errors
/// When it is not.
pub(super) fn go_on(answer: impl Answer) -> Result<(), EngineError> {
    match answer.stops() {
        true => Err(EngineError::Stopped),
        false => Ok(()),
    }
}

/// Sends start values through the serial pin of the load path, at gate level.
///
/// # Errors
/// Another start value in the array than was sent.
pub(super) fn load_starts(
    sensor: &SensorConfig,
    load_netlist: &Netlist,
    starts: &[u16],
) -> Result<load::Load, FrameError> {
    let load = load::load(sensor, load_netlist, starts, &mut ());
    let mut arrived = starts.iter().zip(&load.starts).enumerate();
    let wrong = arrived.find(|(_, (sent, found))| **found != Some(**sent));
    match wrong {
        None => Ok(load),
        Some((pixel, (&sent, &found))) => Err(FrameError::Load {
            row: pixel / sensor.cols,
            col: pixel % sensor.cols,
            sent,
            found,
        }),
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

/// The histograms of all macropixels by the engine that the settings ask for, and what a tolerance kept to.
fn expose_array<A: Answer>(
    settings: &FrameSettings,
    stream: &PhotonStream,
    pixels: &[LitPixel],
    done: &(impl Fn(usize) -> A + Sync),
) -> Result<(Exposed, Option<Kept>), FrameError> {
    let FrameSettings {
        sensor,
        exposure,
        engine,
        cohort,
        ..
    } = settings;
    match (settings.tolerance_m, settings.skip) {
        (Some(tolerance_m), _) => {
            let tolerance = Tolerance {
                tolerance_m,
                sensor,
                exposure,
                peak: &settings.depth.peak,
            };
            let (exposed, kept) = tolerance.expose(stream, pixels, done)?;
            Ok((exposed, Some(kept)))
        }
        (None, true) if *engine == EngineKind::Cohort => {
            let cohort = Cohort::new(sensor, exposure, *cohort);
            let refused = |why| refused_by(&cohort, stream, pixels, why);
            let exposed = expose(&cohort, stream, pixels, done).map_err(refused)?;
            Ok((exposed, None))
        }
        (None, true) => {
            let engine = engine.expose(sensor, exposure, *cohort);
            Ok((expose(&*engine, stream, pixels, done)?, None))
        }
        (None, false) => {
            let engine = engine.replay(sensor, exposure)?;
            let exposed = expose_without_skipping(&*engine, stream, pixels, done)?;
            Ok((exposed, None))
        }
    }
}

/// A macropixel as its gates counted.
struct AtGates {
    pixel: usize,
    start: u16,
    events: Vec<SpadEvent>,
    counts: Vec<u16>,
}

impl AtGates {
    /// Runs a probe, and writes its waveform.
    fn run(
        sensor: &Sensor,
        exposure: &Exposure,
        stream: &PhotonStream,
        pixels: &[LitPixel],
        probe: &Probe,
    ) -> Result<Self, FrameError> {
        let at = (probe.row, probe.col);
        let pixel = probe.row * sensor.cols + probe.col;
        let LitPixel {
            number,
            start,
            light,
        } = &pixels[pixel];
        let photons = light.as_ref();
        let photons = photons.map(|light| stream.pixel_events(*number, light));
        let events = photons.unwrap_or_default().events;
        let start = *start;
        let mut simulation =
            GateSimulation::new(sensor, exposure, at, (1, 1), &[start], &[&events]);
        let view = View::of_pixel(at, sensor, exposure, start, &events, probe.wave_cycles);
        let format = WaveFormat::of(&probe.waves);
        waveform::record(&mut simulation, &probe.waves, format, &view, &mut ())?;
        Ok(AtGates {
            pixel,
            start,
            counts: simulation.histograms()?.into_counts(),
            events,
        })
    }
}

#[cfg(test)]
mod tests {
    use std::ops::ControlFlow;
    use std::sync::atomic::{AtomicUsize, Ordering};

    use super::*;
    use crate::scene::Scene;
    use crate::system::range_counts;

    fn settings() -> FrameSettings {
        let sensor = SensorConfig {
            rows: 16,
            cols: 16,
            ..SensorConfig::default()
        };
        let exposure = Exposure::new(&sensor, 520, 200);
        FrameSettings::new(sensor, Scene::outdoor(), exposure)
    }

    #[test]
    fn a_frame_that_is_no_longer_wanted_begins_no_other_batch() {
        let settings = settings();
        let exposed = AtomicUsize::new(0);
        let stop_at_first = |macropixels| {
            let before = exposed.fetch_add(macropixels, Ordering::Relaxed);
            match before + macropixels > 0 {
                true => ControlFlow::Break(()),
                false => ControlFlow::Continue(()),
            }
        };
        let alone = rayon::ThreadPoolBuilder::new().num_threads(1).build();
        let refused = alone
            .unwrap()
            .install(|| take_frame(&settings, |_| Vec::new(), stop_at_first));
        assert!(matches!(
            refused,
            Err(FrameError::Engine(EngineError::Stopped))
        ));
        let engine = Window::new(&settings.sensor, &settings.exposure);
        assert_eq!(
            exposed.load(Ordering::Relaxed),
            crate::engine::Engine::batch(&engine)
        );
        // Nobody's cohorts were at fault.
        let cohort = FrameSettings {
            engine: EngineKind::Cohort,
            ..settings
        };
        let refused = take_frame(&cohort, |_| Vec::new(), |_| ControlFlow::Break(()));
        assert!(matches!(
            refused,
            Err(FrameError::Engine(EngineError::Stopped))
        ));
    }

    #[test]
    fn a_frames_own_counts_have_its_depths() {
        let settings = settings();
        let frame = take_frame(&settings, |_| Vec::new(), |_| {}).unwrap();
        let starts: Vec<Option<u16>> = frame.pixels.iter().map(|pixel| pixel.start).collect();
        let readings = range_counts(
            (&settings.sensor, &settings.exposure),
            &settings.scene,
            &settings.depth,
            None,
            &starts,
            &frame.histograms,
        )
        .unwrap();
        assert!(readings.iter().any(|reading| reading.no_depth.is_none()));
        for (reading, pixel) in readings.iter().zip(&frame.pixels) {
            assert_eq!(reading.measured_m, pixel.measured_m);
            assert_eq!(reading.peak_m, pixel.peak_m);
            assert_eq!(reading.confidence, pixel.confidence);
            assert_eq!(reading.no_depth.is_none(), pixel.no_depth.is_none());
            let is_off = reading.no_depth == Some(crate::system::NoDepth::NoGuide);
            assert!(!is_off || pixel.start.is_none());
        }
    }
}
