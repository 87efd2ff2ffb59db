//! A frame's results as files: what `gdtof frame` writes, and Python's `Frame.save`.
//!
//! ```text
//!   FrameRequest ──┐
//!   FrameSettings ─┼─► FrameReport ─► frame.json ─► depth.png
//!   Frame ─────────┴──────────────► histograms.npy
//! ```

use std::borrow::Cow;
use std::collections::BTreeMap;
use std::path::{Path, PathBuf};

use serde::de::IgnoredAny;
use serde::{Deserialize, Serialize};

use super::frame::FrameRequest;
use crate::analysis::VerdictReport;
use crate::chip::{Mode, SensorConfig, WindowLaw, library_files};
use crate::engine::variance_left_out;
use crate::files::{InputError, OutputFile, file_hash, parse_json};
use crate::report::{DepthImage, ImageCell, write_npy_u16};
use crate::scene::{EyeSafety, Scene, Train};
use crate::system::{
    DistanceLaw, EngineKind, ExposureReport, Frame, FrameArray, FrameConfiguration, FrameResult,
    FrameSettings, NoDepth, RunReport, WrittenExposure, frame_scale_m,
};

/// The contents of frame.json; `P` is what there is to say of a pair of pictures in the place of the scene.
pub type FrameReport<'a, P = ()> =
    RunReport<FrameConfiguration<WrittenExposure<'a>>, FrameResult<'a, P>>;

impl FrameRequest {
    /// What reports say of an exposure, with the scene and the sensor that `settings` made of this request.
    pub fn exposed<'a>(
        &self,
        scene_name: String,
        settings: &'a FrameSettings,
    ) -> WrittenExposure<'a> {
        ExposureReport {
            scene_name,
            scene: &settings.scene,
            sensor: &settings.sensor,
            sha256: hashes(&settings.sensor),
            stop_periods: settings.exposure.stop_periods,
            laser_cycles: self.laser_cycles,
            seed: self.seed,
            engine: self.engine,
        }
    }
}

/// Hashes of the files that a sensor is made of.
fn hashes(sensor: &SensorConfig) -> BTreeMap<String, String> {
    let libraries = [&sensor.liberty, &sensor.liberty_slow, &sensor.liberty_fast];
    let libraries = libraries
        .into_iter()
        .flat_map(|setting| library_files(setting));
    let blocks = sensor.own_files().map(|(_, own)| own.path().to_owned());
    let files = libraries.chain(blocks);
    let hash = |file: PathBuf| Some((file.display().to_string(), file_hash(&file).ok()?.1));
    files.filter_map(hash).collect()
}

/// The share of the variance of counts that may be missing, where cohorts made them of SPADs with afterpulses.
pub fn variance_left_out_of(settings: &FrameSettings, frame: &Frame) -> Option<f64> {
    let is_by_cohort = match &frame.kept {
        Some(kept) => kept.on_cohort > 0,
        None => settings.engine == EngineKind::Cohort,
    };
    let probability = settings.sensor.afterpulse_probability;
    (is_by_cohort && probability > 0.0).then(|| variance_left_out(probability))
}

/// From the beginning of a frame to that of the next one, s.
pub fn frame_s(sensor: &SensorConfig, scene: &Scene, frame: &Frame) -> f64 {
    let chip_s = sensor.frame_time(frame.exposure_time).as_s();
    scene.lidar.frame_s(chip_s)
}

/// The laser beside class 1, frame after frame: pulses come once a laser cycle, and none between exposures.
pub fn eye_safety_of(
    sensor: &SensorConfig,
    scene: &Scene,
    laser_cycles: u32,
    frame: &Frame,
) -> Option<EyeSafety> {
    let pulses = f64::from(laser_cycles);
    let train = Train {
        rate_hz: pulses / frame.exposure_time.as_s(),
        pulses,
        frame_s: frame_s(sensor, scene, frame),
    };
    let emission = scene.emission(frame.rows as u32, frame.cols as u32, train);
    emission.beside_class_1()
}

impl<'a, P> FrameReport<'a, P> {
    /// Of a frame that was taken with the settings that `request` made.
    pub fn new(
        scene_name: String,
        request: &'a FrameRequest,
        settings: &'a FrameSettings,
        timing: &'a VerdictReport,
        frame: &'a Frame,
        pair: Option<&'a P>,
    ) -> Self {
        let calibration = request.calibration.as_ref();
        let configuration = FrameConfiguration {
            exposed: request.exposed(scene_name, settings),
            false_alarm_rate: Some(request.false_alarm_rate),
            walk_correction: Some(request.correct_walk),
            calibration: calibration.map(|path| path.display().to_string()),
            guides: request.guides.clone(),
            windows: request.windows.clone(),
        };
        let result = FrameResult {
            summary: frame.summary(),
            remark: frame.remark.as_deref(),
            depths_of_medium: frame.depths_of_medium,
            light_cut: frame.light_cut,
            hints: &frame.hints,
            photons_expected: frame.photons_expected,
            work: frame.work,
            timing,
            tolerance: frame.kept.as_ref(),
            variance_left_out: variance_left_out_of(settings, frame),
            distance: DistanceLaw::new(
                // One law for all macropixels.
                &WindowLaw::new(settings.sensor.alike(), &settings.exposure),
                frame.pixels.iter().filter_map(|pixel| pixel.start),
            ),
            load_bits: frame.load_bits,
            load_time_s: frame.load_time.as_s(),
            readout_time_s: frame.readout_time.as_s(),
            exposure_time_s: frame.exposure_time.as_s(),
            frame_time_s: settings.sensor.frame_time(frame.exposure_time).as_s(),
            eye_safety: eye_safety_of(
                &settings.sensor,
                &settings.scene,
                request.laser_cycles,
                frame,
            ),
            exposure_run_time_s: frame.times.exposure_s,
            run_time_s: frame.times.total_s(),
            run_times: frame.times,
            pair,
            array: FrameArray {
                probes: Cow::from(&frame.probes),
                histograms_shape: [frame.rows, frame.cols, frame.bins],
                macropixels: Cow::from(&frame.pixels),
            },
        };
        RunReport::from_parts(configuration, result)
    }
}

impl<P: Serialize> FrameReport<'_, P> {
    /// Writes frame.json, histograms.npy and depth.png into `out`: `histograms` are rows x cols x bins. `scale_m` are the ends of the picture's
    /// colours, m, instead of the shortest and the longest depth.
    ///
    /// # Errors
    /// When they cannot be written, or there are fewer or more counts than macropixels have.
    pub fn write(
        &self,
        out: &Path,
        histograms: &[u16],
        scale_m: Option<(f32, f32)>,
    ) -> Result<(), InputError> {
        let text = serde_json::to_string(self).expect("numbers and words");
        let exposed = &self.configuration.exposed;
        let drawn = FramePictures {
            scene_name: &exposed.scene_name,
            mode: exposed.sensor.mode,
            laser_cycles: exposed.laser_cycles,
            array: &self.result.array,
            scale_m,
        };
        drawn.write(out, &text, histograms)
    }
}

/// The same of a report that has become text: `report` is a [`FrameReport`] as JSON.
///
/// # Errors
/// As [`FrameReport::write`], and when `report` is none.
pub fn write_frame(out: &Path, report: &str, histograms: &[u16]) -> Result<(), InputError> {
    let read: RunReport<ExposureReport<IgnoredAny, Chip>, FrameArray<'_>> =
        parse_json("frame.json", report, "the report of a frame")?;
    let drawn = FramePictures {
        scene_name: &read.configuration.scene_name,
        mode: read.configuration.sensor.mode,
        laser_cycles: read.configuration.laser_cycles,
        array: &read.result,
        scale_m: None,
    };
    drawn.write(out, report, histograms)
}

/// What the picture says of a sensor.
#[derive(Deserialize)]
struct Chip {
    mode: Mode,
}

/// What files beside frame.json show of a frame.
struct FramePictures<'a> {
    scene_name: &'a str,
    mode: Mode,
    laser_cycles: u32,
    array: &'a FrameArray<'a>,
    scale_m: Option<(f32, f32)>,
}

impl FramePictures<'_> {
    fn write(&self, out: &Path, report: &str, histograms: &[u16]) -> Result<(), InputError> {
        let shape = self.array.histograms_shape;
        let [rows, cols, bins] = shape;
        if histograms.len() != rows * cols * bins {
            let message = format!(
                "{} counts of a frame of {rows}x{cols} macropixels with {bins} bins; give one of each",
                histograms.len()
            );
            return Err(InputError::new("histograms", message));
        }
        write_npy_u16(&out.join("histograms.npy"), &shape, histograms)?;
        depth_map(out, self)?;
        OutputFile::write_with(&out.join("frame.json"), |file| writeln!(file, "{report}"))
    }
}

/// Writes `depth.png` into `out`.
///
/// # Errors
/// When it cannot be written.
fn depth_map(out: &Path, drawn: &FramePictures<'_>) -> Result<(), InputError> {
    let mode = match drawn.mode {
        Mode::Guided => "guided",
        Mode::Conventional => "conventional",
    };
    let [rows, cols, _] = drawn.array.histograms_shape;
    let pixels = &drawn.array.macropixels;
    let cells: Vec<ImageCell> = (pixels.iter())
        .map(|pixel| match (pixel.measured_m, pixel.no_depth) {
            (_, Some(reason)) => ImageCell::Category(reason as usize),
            (depth_m, None) => ImageCell::Depth(depth_m.unwrap_or_default() as f32),
        })
        .collect();
    let depths_m = pixels.iter().filter_map(|pixel| pixel.measured_m);
    let range_m = drawn.scale_m.unwrap_or_else(|| frame_scale_m(depths_m));
    // A path is too long for a title.
    let scene = Path::new(drawn.scene_name).file_name();
    let scene = scene.map_or(drawn.scene_name.into(), |name| name.to_string_lossy());
    let title = format!(
        "{scene}, {} to {} m, {mode}, {} laser cycles",
        range_m.0, range_m.1, drawn.laser_cycles
    );
    let map = DepthImage {
        title: &title,
        cols,
        cells: &cells,
        range_m,
        unit: "m",
        categories: &NoDepth::categories(),
        scale: (512 / rows.max(cols)).max(1),
    };
    map.write_png(&out.join("depth.png"))
}
