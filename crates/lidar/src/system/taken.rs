//! A frame or a drive that was taken earlier, as its `frame.json` or `drive.json` describes it: enough to give any macropixel of a frame the
//! photons it had.

use std::path::{Path, PathBuf};

use super::aim::Aims;
use super::light::{light_in, photon_stream, truth_in};
use super::pixel::PixelDepth;
use super::reports::{ExposureReport, FrameConfiguration, ReadFrame, RunReport};
use super::settings::EngineKind;
use crate::chip::{Exposure, Sensor, SensorConfig};
use crate::files::InputError;
use crate::guide::{BehaviouralStereo, Guide, GuideInput};
use crate::photon::SpadEvent;
use crate::ranging::DepthOptions;
use crate::scene::Scene;
use crate::settings::Document;

/// What a frame or a drive was asked for.
#[derive(Debug, Clone)]
#[non_exhaustive]
pub struct TakenSettings {
    /// What reports call the scene.
    pub scene_name: String,
    /// The world.
    pub scene: Scene,
    /// The chip.
    pub sensor: Sensor,
    /// The exposure of `sensor`.
    pub exposure: Exposure,
    /// Seed of photons and guide errors.
    pub seed: u64,
    /// Engine of the macropixels that were not probed.
    pub engine: EngineKind,
    /// How depths were found.
    pub depth: DepthOptions,
    /// File of the bin profile, if there was one.
    pub calibration: Option<PathBuf>,
}

/// What a frame depended on, and what became of it.
#[derive(Debug, Clone)]
pub struct TakenFrame {
    source: String,
    /// What was asked for.
    pub settings: TakenSettings,
    /// Whether a tolerance chose engines instead.
    pub has_tolerance: bool,
    /// Whether its windows are those of the camera pair's estimates by the window law: not calibrated, no other guide or policy.
    is_plain: bool,
    /// Every macropixel, row-major.
    pub pixels: Vec<PixelDepth>,
    /// Macropixels that were also run at gate level, with a waveform.
    pub(crate) probes: Vec<(usize, usize)>,
    /// The frame in a few numbers, as the file has it.
    pub(crate) summary: serde_json::Value,
}

/// An exposure that was read.
pub(crate) type ReadExposure = ExposureReport<toml::Table, toml::Table>;

impl ReadExposure {
    /// What was asked for, with this calibration.
    ///
    /// # Errors
    /// When the file at `path` contradicts itself.
    pub(crate) fn settings(
        self,
        path: &Path,
        calibration: Option<PathBuf>,
    ) -> Result<TakenSettings, InputError> {
        let source = path.display();
        let sensor = Document::from_table(format!("{source}, sensor"), self.sensor);
        let sensor = Sensor::from(SensorConfig::read_document(&sensor)?);
        let scene = Scene::read(&Document::from_table(
            format!("{source}, scene"),
            self.scene,
        ))?;
        let exposure = Exposure::checked(&sensor, self.stop_periods, self.laser_cycles)
            .map_err(|fault| InputError::new(source, format!("{fault}; take it anew")))?;
        Ok(TakenSettings {
            scene_name: self.scene_name,
            scene,
            sensor,
            exposure,
            seed: self.seed,
            engine: self.engine,
            depth: DepthOptions::default(),
            calibration,
        })
    }
}

/// What a macropixel was given.
#[derive(Debug, Clone)]
pub struct TakenPixel {
    /// The start value in its P-counter.
    pub start: u16,
    /// Whether its SPADs were on.
    pub is_on: bool,
    /// Rising edges of its SPADs, sorted by time.
    pub pulses: Vec<SpadEvent>,
}

impl TakenFrame {
    /// Reads a `frame.json`.
    ///
    /// # Errors
    /// When it cannot be read, is none, comes from another version of this program, or contradicts itself.
    pub fn read(path: &Path) -> Result<Self, InputError> {
        let wanted = "the frame.json of a frame that `gdtof frame` has taken";
        let RunReport {
            configuration,
            result,
            ..
        } = RunReport::<FrameConfiguration<ReadExposure>, ReadFrame>::read(path, wanted)?;
        let calibration = configuration.calibration.map(PathBuf::from);
        let mut settings = configuration.exposed.settings(path, calibration)?;
        let depth = &mut settings.depth;
        depth.false_alarm_rate = (configuration.false_alarm_rate).unwrap_or(depth.false_alarm_rate);
        depth.correct_walk = (configuration.walk_correction).unwrap_or(depth.correct_walk);
        let pixels = result.array.macropixels.into_owned();
        let sensor = &settings.sensor;
        if pixels.len() != sensor.pixels() {
            let message = format!(
                "has {} macropixels and a sensor of {}x{}; take it anew",
                pixels.len(),
                sensor.rows,
                sensor.cols
            );
            return Err(InputError::new(path.display(), message));
        }
        Ok(TakenFrame {
            source: path.display().to_string(),
            has_tolerance: result.tolerance.is_some(),
            is_plain: settings.calibration.is_none()
                && configuration.guides.is_empty()
                && configuration.windows.is_empty(),
            pixels,
            probes: result.array.probes.into_owned(),
            summary: result.summary,
            settings,
        })
    }

    /// The macropixel at a row and column in the first `laser_cycles`: the photons that it had.
    ///
    /// # Errors
    /// When scene, sensor and seed do not give its start value: the file has been changed.
    ///
    /// # Panics
    /// When the array has no such macropixel.
    pub fn pixel(
        &self,
        (row, col): (usize, usize),
        laser_cycles: u32,
    ) -> Result<TakenPixel, InputError> {
        let TakenSettings {
            sensor,
            scene,
            exposure,
            seed,
            ..
        } = &self.settings;
        assert!(row < sensor.rows && col < sensor.cols);
        let pixel = row * sensor.cols + col;
        let (rows, cols) = (sensor.rows as u32, sensor.cols as u32);
        // What a calibration made of the guide's estimate is not known here, nor are other guides.
        let given = if !self.is_plain {
            self.pixels[pixel].start
        } else {
            let input = GuideInput::still(scene, rows, cols, *seed);
            let guide = BehaviouralStereo.estimate(&input);
            let guide = guide.map_err(|why| InputError::new(&self.source, why.to_string()))?;
            Aims::new(sensor, exposure, None).start_of(pixel, guide.range_m[pixel])
        };
        if given != self.pixels[pixel].start {
            let shown = |start: Option<u16>| start.map_or("none".to_owned(), |s| s.to_string());
            let message = format!(
                "gives macropixel ({row}, {col}) the start value {}, where its sensor, scene and seed give {}; take the frame anew",
                shown(self.pixels[pixel].start),
                shown(given)
            );
            return Err(InputError::new(&self.source, message));
        }
        // A longer exposure begins with the same photons, but for an echo that falls into it from the next laser cycle.
        let beginning = Exposure {
            laser_cycles: laser_cycles.saturating_add(1).min(exposure.laser_cycles),
            ..*exposure
        };
        let stream = photon_stream(sensor, &beginning, *seed, scene);
        let light = given.map(|_| {
            let truth = truth_in(sensor, exposure, scene);
            light_in(exposure, scene, &truth, &stream).swap_remove(pixel)
        });
        let photons = light.map(|light| stream.pixel_events(pixel as u32, &light));
        Ok(TakenPixel {
            start: given.unwrap_or(sensor.largest_start()),
            is_on: given.is_some(),
            pulses: photons.unwrap_or_default().events,
        })
    }
}
