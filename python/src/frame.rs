//! Frames: requests in, arrays out.

use std::path::PathBuf;

use guided_dtof::chip::{Exposure, Sensor as Chip, WindowLaw};
use guided_dtof::engine::waveform::WaveCycles;
use guided_dtof::ranging::WalkLeft;
use guided_dtof::request::FrameRequest;
use guided_dtof::scene::PinholeCamera;
use guided_dtof::system::{
    Frame, FrameSettings, GateProbe, NoDepth, PixelDepth, WindowPolicy, take_frame_by,
    take_guided_frame,
};
use guided_dtof::{guide::GuideInput, units::Time};
use numpy::PyReadonlyArrayDyn;
use pyo3::prelude::*;
use pyo3::types::{PyDict, PyList};
use rayon::prelude::*;

use crate::arrays::{cube, map, of_start, set_returns, starts as start_values};
use crate::background::run;
use crate::failure::Failure;
use crate::guide::Guide;
use crate::scene::Scene;
use crate::sensor::Sensor;
use crate::taken::FrameRecord;
use crate::values::{by_json, to_table, typed};

/// The library's request from keys of its own; None is a key that is left out.
///
/// # Errors
/// Unknown keys, and values of other types.
pub(crate) fn request(keys: &Bound<'_, PyDict>) -> PyResult<FrameRequest> {
    Ok(typed(to_table(keys)?)?)
}

/// Edges of the bins of every macropixel in its laser cycle, ns after STOP: one more than there are bins, NaN where its window
/// does not open.
pub(crate) fn bin_edges_ns(sensor: &Chip, exposure: &Exposure, starts: &[Option<u16>]) -> Vec<f64> {
    let law = WindowLaw::new(sensor, exposure);
    let has_own = law.sensor().has_own_laws();
    let nothing = || vec![f64::NAN; sensor.bins + 1];
    let edges = starts
        .par_iter()
        .enumerate()
        .flat_map_iter(|(pixel, start)| {
            let own = has_own.then(|| law.of_macropixel(pixel as u32));
            let law = own.as_ref().unwrap_or(&law);
            let open = start.and_then(|start| law.window(start).open());
            open.map_or_else(nothing, |open| {
                let edges = law.edges(&open, 0);
                edges.edges().iter().map(|edge| edge.as_ns()).collect()
            })
        });
    edges.collect()
}

/// What a frame and a frame of a drive have in common.
pub(crate) struct Common {
    pub(crate) shape: (usize, usize),
    pub(crate) histograms: Vec<u16>,
    pub(crate) pixels: Vec<PixelDepth>,
    pub(crate) edges_ns: Vec<f64>,
    pub(crate) camera: PinholeCamera,
}

impl Common {
    /// As arrays of their shapes.
    ///
    /// # Errors
    /// When there is no memory for them.
    pub(crate) fn into_dict<'py>(self, py: Python<'py>) -> PyResult<Bound<'py, PyDict>> {
        let Common {
            shape,
            histograms,
            pixels,
            edges_ns,
            camera,
        } = self;
        let (rows, cols) = shape;
        let bins = histograms.len() / (rows * cols);
        let metres = |distance: fn(&PixelDepth) -> Option<f64>| {
            let values = pixels
                .iter()
                .map(|pixel| distance(pixel).unwrap_or(f64::NAN));
            map(py, shape, values.collect())
        };
        let point = |(at, pixel): (usize, &PixelDepth)| {
            let towards = camera.direction((at / cols, at % cols));
            pixel.measured_m.map(|m| (towards * m).to_array())
        };
        let points: Vec<[f64; 3]> = pixels.iter().enumerate().filter_map(point).collect();
        let dict = PyDict::new(py);
        let shape_of_points = (points.len(), 3);
        let points = map(py, shape_of_points, points.into_flattened());
        dict.set_item("points", points)?;
        dict.set_item("histograms", cube(py, (rows, cols, bins), histograms))?;
        dict.set_item("bin_edges_ns", cube(py, (rows, cols, bins + 1), edges_ns))?;
        dict.set_item("depth", metres(|p| p.measured_m))?;
        dict.set_item("bound", metres(|p| p.bound_m))?;
        dict.set_item("spread", metres(|p| p.spread_m))?;
        set_returns(&dict, shape, || pixels.iter().map(|p| &p.returns))?;
        dict.set_item("guide", metres(|p| p.guide_m))?;
        dict.set_item("truth", metres(|p| p.true_m))?;
        dict.set_item("peak", metres(|p| p.peak_m))?;
        dict.set_item("confidence", metres(|p| p.confidence))?;
        let reasons = pixels.iter().map(|p| NoDepth::number(p.no_depth)).collect();
        dict.set_item("reason", map(py, shape, reasons))?;
        let walk_left = pixels.iter().map(|p| WalkLeft::number(p.walk_left));
        dict.set_item("walk_left", map(py, shape, walk_left.collect()))?;
        let starts = pixels.iter().map(|p| of_start(p.start)).collect();
        dict.set_item("start", map(py, shape, starts))?;
        let in_window = pixels.iter().map(|p| p.in_window).collect();
        dict.set_item("in_window", map(py, shape, in_window))?;
        Ok(dict)
    }
}

/// Macropixels to run at gate level, and where their waveforms go.
#[derive(FromPyObject)]
#[pyo3(from_item_all)]
struct Probes {
    places: Vec<(usize, usize)>,
    folder: PathBuf,
    format: String,
    /// Number of laser cycles from the first; −1 keeps all, and without it those about the first count are kept.
    cycles: Option<i64>,
}

impl Probes {
    fn probes(&self, sensor: &Chip) -> Result<Vec<GateProbe>, Failure> {
        let wave_cycles = match self.cycles {
            None => WaveCycles::FirstHits,
            Some(-1) => WaveCycles::All,
            Some(cycles) => WaveCycles::First(u32::try_from(cycles).map_err(|_| {
                let message =
                    format!("{cycles} is impossible; give a number of laser cycles, or \"all\"");
                Failure::argument("wave_cycles", message)
            })?),
        };
        let probe = |&(row, col): &(usize, usize)| {
            if row >= sensor.rows || col >= sensor.cols {
                let message = format!(
                    "macropixel ({row}, {col}) is outside the {}x{} array; give rows 0 to {} and columns 0 to {}",
                    sensor.rows,
                    sensor.cols,
                    sensor.rows - 1,
                    sensor.cols - 1
                );
                return Err(Failure::argument("probes", message));
            }
            let name = format!("probe_r{row}_c{col}.{}", self.format);
            Ok(GateProbe {
                row,
                col,
                waves: self.folder.join(name),
                wave_cycles,
            })
        };
        self.places.iter().map(probe).collect()
    }
}

/// Takes a frame; `keys` are those of the library's request. See `gdtof.frame`.
#[pyfunction]
#[pyo3(signature = (sensor, scene, guide, keys, tracking, starts, probes, progress))]
#[expect(
    clippy::too_many_arguments,
    reason = "gdtof.frame gives them their names"
)]
pub(crate) fn frame<'py>(
    py: Python<'py>,
    sensor: Option<&Bound<'py, Sensor>>,
    scene: Option<&Bound<'py, Scene>>,
    guide: Option<&Bound<'py, Guide>>,
    keys: &Bound<'py, PyDict>,
    tracking: bool,
    starts: Option<PyReadonlyArrayDyn<'py, i64>>,
    probes: Option<&Bound<'py, PyAny>>,
    progress: Option<&Bound<'py, PyAny>>,
) -> PyResult<Bound<'py, PyDict>> {
    let (mut request, sensor) = (request(keys)?, Sensor::or_default(sensor));
    let (scene_name, world) = (Scene::name_or_default(scene), Scene::or_default(scene));
    let guides = guide.map_or_else(Vec::new, |guide| guide.get().texts());
    let guide = Guide::or_default(guide);
    let starts = starts.map(|starts| {
        let shape = [sensor.rows, sensor.cols];
        start_values(&starts, &shape, sensor.largest_start())
    });
    let starts = starts.transpose()?;
    let probes = probes
        .map(|probes| probes.extract::<Probes>())
        .transpose()?;
    let probes = probes
        .map(|probes| probes.probes(&sensor))
        .transpose()?
        .unwrap_or_default();
    let taken = run(py, progress, move |watch| {
        let policy = if tracking {
            WindowPolicy::for_sequences()
        } else {
            WindowPolicy::default()
        };
        let policy = request.policy(policy)?;
        let settings = request.settings_by(sensor, world, guide, &policy)?;
        watch.check()?;
        let done = |macropixels| watch.done(macropixels);
        let frame = match &starts {
            None => take_frame_by(&settings, policy, |_| probes, done)?,
            Some(starts) => {
                let map = settings.guide.estimate(&input(&settings))?;
                take_guided_frame(&settings, &map, starts, |_| probes, done)?
            }
        };
        // How windows were chosen, where the policy's keys do not say it all.
        let chosen = match (&starts, tracking) {
            (Some(_), _) => "start values of one's own".into(),
            (None, true) => format!("tracking,{}", request.windows),
            (None, false) => request.windows.clone(),
        };
        let starts: Vec<Option<u16>> = frame.pixels.iter().map(|pixel| pixel.start).collect();
        let edges_ns = bin_edges_ns(&settings.sensor, &settings.exposure, &starts);
        request.guides = guides;
        request.windows = chosen;
        Ok((frame, request, settings, edges_ns))
    })?;
    let (mut frame, request, settings, edges_ns) = taken;
    let exposure = settings.exposure;
    let summary = by_json(py, &frame.summary())?;
    let dict = Common {
        shape: (frame.rows, frame.cols),
        histograms: std::mem::take(&mut frame.histograms),
        pixels: frame.pixels.clone(),
        edges_ns,
        camera: settings
            .scene
            .lidar_camera(frame.rows as u32, frame.cols as u32),
    }
    .into_dict(py)?;
    let seconds = |time: Time| time.as_s();
    dict.set_item("summary", summary)?;
    let chip = settings.sensor.clone();
    dict.set_item("sensor", Sensor { chip })?;
    let scene = Scene {
        world: settings.scene.clone(),
        name: scene_name.clone(),
    };
    dict.set_item("scene", scene)?;
    dict.set_item("seed", request.seed)?;
    dict.set_item("engine", by_json(py, &request.engine)?)?;
    dict.set_item("stop_periods", exposure.stop_periods)?;
    dict.set_item("laser_cycles", exposure.laser_cycles)?;
    dict.set_item("bin_m", frame.bin_m)?;
    dict.set_item("remark", frame.remark.as_deref())?;
    dict.set_item("hints", hints(py, &frame)?)?;
    dict.set_item("work", by_json(py, &frame.work)?)?;
    dict.set_item("kept", by_json(py, &frame.kept)?)?;
    dict.set_item("run_times", by_json(py, &frame.times)?)?;
    dict.set_item("probes", frame.probes.clone())?;
    dict.set_item("load_s", seconds(frame.load_time))?;
    dict.set_item("exposure_s", seconds(frame.exposure_time))?;
    dict.set_item("readout_s", seconds(frame.readout_time))?;
    dict.set_item(
        "_taken",
        FrameRecord::new(scene_name, request, settings, frame),
    )?;
    Ok(dict)
}

/// Hints as their fields, with the numbers of `gdtof.Reason`.
fn hints<'py>(py: Python<'py>, frame: &Frame) -> PyResult<Bound<'py, PyList>> {
    let fields = frame.hints.iter().map(|hint| {
        let number = NoDepth::number(Some(hint.reason));
        (number, hint.surfaces, hint.sentence.as_str())
    });
    PyList::new(py, fields.collect::<Vec<_>>())
}

/// What the guide of a single frame looks at.
fn input(settings: &FrameSettings) -> GuideInput<'_> {
    let FrameSettings {
        sensor,
        scene,
        seed,
        ..
    } = settings;
    GuideInput::still(scene, sensor.rows as u32, sensor.cols as u32, *seed)
}
