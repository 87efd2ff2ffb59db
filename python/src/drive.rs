//! Drives: a thread that goes on from frame to frame, asked for one at a time.

use std::sync::mpsc::{Receiver, Sender, SyncSender, channel, sync_channel};
use std::sync::{Mutex, MutexGuard, PoisonError};

use guided_dtof::request::{Spelling, check_drive_times};
use guided_dtof::scene::PinholeCamera;
use guided_dtof::system::{
    DriveFrame, DriveSettings, DriveSimulation as Frames, EngineKind, FrameClock, FrameSettings,
    Noise, WindowPolicy, drive_scale_m,
};
use pyo3::exceptions::PyRuntimeError;
use pyo3::prelude::*;
use pyo3::types::PyDict;

use crate::arrays::{cube, map};
use crate::background::{Outcome, Watch, guarded, spawn, wait};
use crate::failure::Failure;
use crate::frame::{Common, bin_edges_ns, request};
use crate::guide::Guide;
use crate::scene::Scene;
use crate::sensor::Sensor;
use crate::values::{by_json, to_table, typed};

/// What is asked of a drive beside its frames.
#[derive(serde::Deserialize)]
#[serde(deny_unknown_fields)]
struct DriveKeys {
    guide_latency_ms: f64,
    pipelined: bool,
    segments: u32,
    noise: String,
    reuse: bool,
    start_s: f64,
}

impl DriveKeys {
    fn check(&self) -> Result<Noise, Failure> {
        let segments = &self.segments;
        check_drive_times(self.guide_latency_ms, self.start_s, Spelling::Keys)?;
        if !(1..=64).contains(segments) {
            let message = format!("{segments} is impossible; give 1 to 64");
            return Err(Failure::argument("segments", message));
        }
        match self.noise.as_str() {
            "fresh" => Ok(Noise::Fresh),
            "still" => Ok(Noise::Still),
            other => {
                let message = format!("{other:?} is impossible; give fresh or still");
                Err(Failure::argument("noise", message))
            }
        }
    }
}

/// A frame and the edges of its bins.
type FrameAndEdges = (Box<DriveFrame>, Vec<f64>);

/// What the thread of a drive and its asker share.
struct Line {
    /// Asks for the next frame; closed when nobody will ask again.
    ask: Sender<()>,
    /// `None` while somebody waits for a frame.
    take: Option<Receiver<Outcome<FrameAndEdges>>>,
}

/// Frame after frame of a world in motion; see `gdtof.drive`.
#[pyclass(frozen, module = "gdtof._gdtof")]
pub(crate) struct Drive {
    /// `None` when the drive is over.
    line: Mutex<Option<Line>>,
    watch: Watch,
    shape: (usize, usize),
    camera: PinholeCamera,
    /// What all frames have in common.
    described: Described,
    /// From one frame to the next, s.
    #[pyo3(get)]
    period_s: f64,
    /// What load, exposure and readout take, s.
    #[pyo3(get)]
    chip_s: (f64, f64, f64),
}

/// The settings that all frames of a drive have in common.
struct Described {
    sensor: Py<Sensor>,
    scene: Py<Scene>,
    stop_periods: u32,
    laser_cycles: u32,
    seed: u64,
    engine: EngineKind,
    scale_m: (f32, f32),
}

impl Described {
    fn new(py: Python<'_>, scene_name: String, settings: FrameSettings) -> PyResult<Self> {
        let scale_m = drive_scale_m(&settings.scene);
        let (stop_periods, laser_cycles) = (
            settings.exposure.stop_periods,
            settings.exposure.laser_cycles,
        );
        let (chip, world) = (settings.sensor, settings.scene);
        Ok(Described {
            sensor: Py::new(py, Sensor { chip })?,
            scene: Py::new(
                py,
                Scene {
                    world,
                    name: scene_name,
                },
            )?,
            stop_periods,
            laser_cycles,
            seed: settings.seed,
            engine: settings.engine,
            scale_m,
        })
    }

    fn add_to(&self, dict: &Bound<'_, PyDict>) -> PyResult<()> {
        let py = dict.py();
        dict.set_item("sensor", &self.sensor)?;
        dict.set_item("scene", &self.scene)?;
        dict.set_item("stop_periods", self.stop_periods)?;
        dict.set_item("laser_cycles", self.laser_cycles)?;
        dict.set_item("seed", self.seed)?;
        dict.set_item("engine", by_json(py, &self.engine)?)?;
        dict.set_item("scale_m", self.scale_m)
    }
}

/// What is known of a drive before its first frame.
struct Beginning {
    settings: Box<FrameSettings>,
    shape: (usize, usize),
    camera: PinholeCamera,
    period_s: f64,
    chip_s: (f64, f64, f64),
}

#[pymethods]
impl Drive {
    #[new]
    #[pyo3(signature = (sensor, scene, guide, keys, tracking, drive_keys))]
    fn new(
        py: Python<'_>,
        sensor: Option<&Bound<'_, Sensor>>,
        scene: Option<&Bound<'_, Scene>>,
        guide: Option<&Bound<'_, Guide>>,
        keys: &Bound<'_, PyDict>,
        tracking: bool,
        drive_keys: &Bound<'_, PyDict>,
    ) -> PyResult<Self> {
        let request = request(keys)?;
        let (sensor, world) = (Sensor::or_default(sensor), Scene::or_default(scene));
        let scene_name = Scene::name_or_default(scene);
        let guide = Guide::or_default(guide);
        let drive_keys: DriveKeys = typed(to_table(drive_keys)?)?;
        let noise = drive_keys.check()?;
        let watch = Watch::default();
        let (begin, begun) = sync_channel(1);
        let (ask, asked) = channel::<()>();
        let (give, take) = sync_channel(1);
        let theirs = watch.clone();
        let settings = move || -> Result<DriveSettings, Failure> {
            let policy = if tracking {
                WindowPolicy::for_sequences()
            } else {
                WindowPolicy::default()
            };
            let policy = request.policy(policy)?;
            let frame = request.settings_by(sensor, world, guide, &policy)?;
            Ok(DriveSettings {
                policy,
                clock: FrameClock {
                    guide_latency_s: drive_keys.guide_latency_ms * 1e-3,
                    pipelined: drive_keys.pipelined,
                },
                segments: drive_keys.segments,
                noise,
                reuse: drive_keys.reuse,
                start_s: drive_keys.start_s,
                ..DriveSettings::new(frame)
            })
        };
        spawn(move || {
            let settings = match guarded(settings) {
                Ok(Ok(settings)) => settings,
                Ok(Err(failure)) => return drop(begin.send(Ok(Err(failure)))),
                Err(panic) => return drop(begin.send(Err(panic))),
            };
            take_frames(&settings, &theirs, &begin, &asked, &give);
        })?;
        let (_, beginning) = wait(py, begun, &watch, None);
        let Beginning {
            settings,
            shape,
            camera,
            period_s,
            chip_s,
        } = beginning?;
        Ok(Drive {
            line: Mutex::new(Some(Line {
                ask,
                take: Some(take),
            })),
            watch,
            shape,
            camera,
            described: Described::new(py, scene_name, *settings)?,
            period_s,
            chip_s,
        })
    }

    /// The next frame. After an error or a signal the drive is over.
    fn next_frame<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyDict>> {
        let over = || PyRuntimeError::new_err("this drive is over");
        let take = {
            let mut line = self.line();
            let line = line.as_mut().ok_or_else(over)?;
            let busy = || PyRuntimeError::new_err("another thread waits for a frame of this drive");
            let take = line.take.take().ok_or_else(busy)?;
            line.ask.send(()).map_err(|_| over())?;
            take
        };
        // Nobody holds the lock while a frame is awaited.
        let (take, taken) = wait(py, take, &self.watch, None);
        let mut line = self.line();
        match taken {
            Ok(taken) => {
                if let Some(line) = &mut *line {
                    line.take = Some(take);
                }
                drop(line);
                let dict = to_dict(py, (self.shape, self.camera), taken)?;
                self.described.add_to(&dict)?;
                Ok(dict)
            }
            Err(raised) => {
                *line = None;
                Err(raised)
            }
        }
    }

    /// Ends the drive.
    fn close(&self) {
        self.watch.stop();
        *self.line() = None;
    }
}

impl Drive {
    fn line(&self) -> MutexGuard<'_, Option<Line>> {
        self.line.lock().unwrap_or_else(PoisonError::into_inner)
    }
}

impl Drop for Drive {
    fn drop(&mut self) {
        self.watch.stop();
    }
}

/// Takes frames as long as they are asked for.
fn take_frames(
    settings: &DriveSettings,
    watch: &Watch,
    begin: &SyncSender<Outcome<Beginning>>,
    asked: &Receiver<()>,
    give: &SyncSender<Outcome<FrameAndEdges>>,
) {
    let mut drive = match Frames::new(settings) {
        Ok(drive) => drive,
        Err(failure) => return drop(begin.send(Ok(Err(failure.into())))),
    };
    let sensor = &settings.frame.sensor;
    let (rows, cols) = (sensor.rows as u32, sensor.cols as u32);
    let beginning = Beginning {
        settings: Box::new(settings.frame.clone()),
        shape: (sensor.rows, sensor.cols),
        camera: settings.frame.scene.lidar_camera(rows, cols),
        period_s: drive.period_s(),
        chip_s: drive.chip_s().into(),
    };
    if begin.send(Ok(Ok(beginning))).is_err() {
        return;
    }
    while asked.recv().is_ok() {
        let taken = guarded(|| {
            let frame = drive.frame(|macropixels| watch.done(macropixels))?;
            let starts: Vec<Option<u16>> = frame.pixels.iter().map(|p| p.start).collect();
            let edges_ns = bin_edges_ns(sensor, &settings.frame.exposure, &starts);
            Ok((Box::new(frame), edges_ns))
        });
        let is_over = !matches!(taken, Ok(Ok(_)));
        if give.send(taken).is_err() || is_over {
            return;
        }
    }
}

fn to_dict<'py>(
    py: Python<'py>,
    (shape, camera): ((usize, usize), PinholeCamera),
    (frame, edges_ns): FrameAndEdges,
) -> PyResult<Bound<'py, PyDict>> {
    let (rows, cols) = shape;
    let summary = by_json(py, &frame.summary())?;
    let DriveFrame {
        number,
        times,
        guide,
        histograms,
        pixels,
        windows_m,
        bin_m,
        work,
        reused,
        run_times,
        ..
    } = *frame;
    let dict = Common {
        shape,
        histograms: histograms.into_counts(),
        pixels,
        edges_ns,
        camera,
    }
    .into_dict(py)?;
    let ends = windows_m.iter().flat_map(|window| {
        let (from, to) = window.unwrap_or((f64::NAN, f64::NAN));
        [from, to]
    });
    dict.set_item("windows", cube(py, (rows, cols, 2), ends.collect()))?;
    dict.set_item("guide_sigma", map(py, shape, guide.sigma_m))?;
    dict.set_item("number", number)?;
    dict.set_item("times", by_json(py, &times)?)?;
    dict.set_item("summary", summary)?;
    dict.set_item("bin_m", bin_m)?;
    dict.set_item("work", by_json(py, &work)?)?;
    dict.set_item("reused", by_json(py, &reused)?)?;
    dict.set_item("run_times", by_json(py, &run_times)?)?;
    Ok(dict)
}
