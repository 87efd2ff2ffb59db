//! A frame's results as files: what `gdtof frame` writes, and Python's `Frame.save`.
//!
//! ```text
//!   FrameRequest ──┐
//!   FrameSettings ─┼─► FrameReport ─► frame.json ─► depth.png
//!   Frame ─────────┴──────────────► histograms.npy
//! ```

use std::collections::BTreeMap;
use std::path::{Path, PathBuf};

use serde::{Deserialize, Serialize};

use super::FrameRequest;
use crate::analysis::VerdictReport;
use crate::chip::{Mode, SensorConfig, WindowLaw, library_files};
use crate::engine::{EngineWork, variance_left_out};
use crate::files::{InputError, OutputFile, file_hash, parse_json};
use crate::report::{DepthImage, ImageCell, write_npy_u16};
use crate::scene::{EyeSafety, Scene, Train};
use crate::system::{
    DepthHint, DistanceLaw, EngineKind, Frame, FrameSettings, FrameSummary, NoDepth, PhaseTimes,
    PixelDepth, ToleranceResult, frame_scale_m,
};

/// What frame.json and drive.json say of an exposure alike, first of all.
#[derive(Debug, Serialize)]
pub struct ExposureReport<'a> {
    /// What reports call the scene.
    pub scene_name: String,
    scene: &'a Scene,
    sensor: &'a SensorConfig,
    /// SHA-256 of the library and netlists that the sensor names, by their files.
    #[serde(skip_serializing_if = "BTreeMap::is_empty")]
    sha256: BTreeMap<String, String>,
    stop_periods: u32,
    /// Laser cycles of the exposure.
    pub laser_cycles: u32,
    seed: u64,
    engine: EngineKind,
}

/// What was asked for: in frame.json and in the manifest.
#[derive(Debug, Serialize)]
pub struct FrameConfiguration<'a> {
    #[serde(flatten)]
    exposed: ExposureReport<'a>,
    false_alarm_rate: f64,
    walk_correction: bool,
    #[serde(skip_serializing_if = "Option::is_none")]
    calibration: Option<String>,
    #[serde(skip_serializing_if = "<[String]>::is_empty")]
    guides: &'a [String],
    #[serde(skip_serializing_if = "str::is_empty")]
    windows: &'a str,
}

/// The contents of frame.json; `P` is what there is to say of a pair of pictures in the place of the scene.
#[derive(Debug, Serialize)]
pub struct FrameReport<'a, P = ()> {
    version: &'static str,
    /// What was asked for.
    #[serde(flatten)]
    pub configuration: FrameConfiguration<'a>,
    summary: FrameSummary,
    remark: Option<&'a str>,
    hints: &'a [DepthHint],
    photons_expected: f64,
    work: EngineWork,
    timing: &'a VerdictReport,
    tolerance: Option<&'a ToleranceResult>,
    #[serde(skip_serializing_if = "Option::is_none")]
    variance_left_out: Option<f64>,
    distance: DistanceLaw,
    load_bits: usize,
    load_time_s: f64,
    readout_time_s: f64,
    exposure_time_s: f64,
    frame_time_s: f64,
    eye_safety: Option<EyeSafety>,
    exposure_run_time_s: f64,
    run_time_s: f64,
    run_times: PhaseTimes,
    #[serde(skip_serializing_if = "Option::is_none")]
    pair: Option<&'a P>,
    probes: &'a [(usize, usize)],
    histograms_shape: [usize; 3],
    macropixels: &'a [PixelDepth],
}

impl FrameRequest {
    /// What reports say of an exposure, with the scene and the sensor that `settings` made of this request.
    pub fn exposed<'a>(
        &self,
        scene_name: String,
        settings: &'a FrameSettings,
    ) -> ExposureReport<'a> {
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
        FrameReport {
            version: env!("CARGO_PKG_VERSION"),
            configuration: FrameConfiguration {
                exposed: request.exposed(scene_name, settings),
                false_alarm_rate: request.false_alarm_rate,
                walk_correction: request.correct_walk,
                calibration: request
                    .calibration
                    .as_ref()
                    .map(|p| p.display().to_string()),
                guides: &request.guides,
                windows: &request.windows,
            },
            summary: frame.summary(),
            remark: frame.remark.as_deref(),
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
            probes: &frame.probes,
            histograms_shape: [frame.rows, frame.cols, frame.bins],
            macropixels: &frame.pixels,
        }
    }
}

impl<P: Serialize> FrameReport<'_, P> {
    /// Writes frame.json, histograms.npy and depth.png into `out`: `histograms` are rows x cols x bins.
    ///
    /// # Errors
    /// When they cannot be written, or there are fewer or more counts than macropixels have.
    pub fn write(&self, out: &Path, histograms: &[u16]) -> Result<(), InputError> {
        let text = serde_json::to_string(self).expect("numbers and words");
        let exposed = &self.configuration.exposed;
        let drawn = FramePictures {
            mode: exposed.sensor.mode,
            laser_cycles: exposed.laser_cycles,
            shape: self.histograms_shape,
            macropixels: self.macropixels,
        };
        drawn.write(out, &text, histograms)
    }
}

/// The same of a report that has become text: `report` is a [`FrameReport`] as JSON.
///
/// # Errors
/// As [`FrameReport::write`], and when `report` is none.
pub fn write_frame(out: &Path, report: &str, histograms: &[u16]) -> Result<(), InputError> {
    let read: ReadReport = parse_json("frame.json", report, "the report of a frame")?;
    let drawn = FramePictures {
        mode: read.sensor.mode,
        laser_cycles: read.laser_cycles,
        shape: read.histograms_shape,
        macropixels: &read.macropixels,
    };
    drawn.write(out, report, histograms)
}

/// What frame.json says that is also in the other files.
#[derive(Deserialize)]
struct ReadReport {
    sensor: Chip,
    laser_cycles: u32,
    histograms_shape: [usize; 3],
    macropixels: Vec<PixelDepth>,
}

#[derive(Deserialize)]
struct Chip {
    mode: Mode,
}

/// What files beside frame.json show of a frame.
struct FramePictures<'a> {
    mode: Mode,
    laser_cycles: u32,
    shape: [usize; 3],
    macropixels: &'a [PixelDepth],
}

impl FramePictures<'_> {
    fn write(&self, out: &Path, report: &str, histograms: &[u16]) -> Result<(), InputError> {
        let [rows, cols, bins] = self.shape;
        if histograms.len() != rows * cols * bins {
            let message = format!(
                "{} counts of a frame of {rows}x{cols} macropixels with {bins} bins; give one of each",
                histograms.len()
            );
            return Err(InputError::new("histograms", message));
        }
        write_npy_u16(&out.join("histograms.npy"), &self.shape, histograms)?;
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
    let [rows, cols, _] = drawn.shape;
    let cells: Vec<ImageCell> = (drawn.macropixels.iter())
        .map(|pixel| match (pixel.measured_m, pixel.no_depth) {
            (_, Some(reason)) => ImageCell::Category(reason as usize),
            (depth_m, None) => ImageCell::Depth(depth_m.unwrap_or_default() as f32),
        })
        .collect();
    let map = DepthImage {
        title: &format!("Depth, {mode}, {} laser cycles", drawn.laser_cycles),
        cols,
        cells: &cells,
        range_m: frame_scale_m(
            drawn
                .macropixels
                .iter()
                .filter_map(|pixel| pixel.measured_m),
        ),
        unit: "m",
        categories: &NoDepth::categories(),
        scale: (512 / rows.max(cols)).max(1),
    };
    map.write_png(&out.join("depth.png"))
}
