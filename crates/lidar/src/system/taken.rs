//! A frame or a drive that was taken earlier, as its `frame.json` or `drive.json` describes it: enough to give any macropixel of a frame the
//! photons it had.

use std::path::{Path, PathBuf};

use serde::Deserialize;
use serde::de::{DeserializeOwned, IgnoredAny};

use super::aim::Aims;
use super::light::{light_in, photon_stream, truth_in};
use super::pixel::PixelDepth;
use super::settings::EngineKind;
use crate::chip::{Exposure, Sensor, SensorConfig};
use crate::files::{InputError, parse_json, read_text};
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

/// The version alone, which other versions have, too.
#[derive(Deserialize)]
struct Version {
    version: String,
}

/// What `frame.json` and `drive.json` have in common.
#[derive(Deserialize)]
struct RecordedRequest {
    scene_name: String,
    scene: toml::Table,
    sensor: toml::Table,
    stop_periods: u32,
    laser_cycles: u32,
    seed: u64,
    engine: EngineKind,
    calibration: Option<PathBuf>,
    false_alarm_rate: Option<f64>,
    walk_correction: Option<bool>,
}

#[derive(Deserialize)]
struct File<T> {
    #[serde(flatten)]
    asked: RecordedRequest,
    #[serde(flatten)]
    rest: T,
}

/// What `frame.json` alone has.
#[derive(Deserialize)]
struct FrameFile {
    tolerance: Option<IgnoredAny>,
    #[serde(default)]
    guides: Vec<String>,
    windows: Option<IgnoredAny>,
    #[serde(default)]
    probes: Vec<(usize, usize)>,
    summary: serde_json::Value,
    macropixels: Vec<PixelDepth>,
}

impl TakenSettings {
    /// Reads a `frame.json` or `drive.json`, and of what it says beside the settings whatever `T` has; `wanted` is what to give instead
    /// of a file that is none.
    ///
    /// # Errors
    /// When it cannot be read, is none, comes from another version of this program, or contradicts itself.
    pub(crate) fn read<T: DeserializeOwned>(
        path: &Path,
        wanted: &str,
    ) -> Result<(Self, T), InputError> {
        let ours = env!("CARGO_PKG_VERSION");
        let source = || path.display();
        let text = read_text(path)?;
        let Version { version } = parse_json(source(), &text, wanted)?;
        if version != ours {
            let message = format!(
                "was written by version {version}, which may draw other photons than {ours}; take it anew"
            );
            return Err(InputError::new(source(), message));
        }
        let File { asked, rest } = parse_json(source(), &text, wanted)?;
        Ok((asked.settings(path)?, rest))
    }
}

impl RecordedRequest {
    fn settings(self, path: &Path) -> Result<TakenSettings, InputError> {
        let source = path.display();
        let sensor = Document::from_table(format!("{source}, sensor"), self.sensor);
        let sensor = Sensor::from(SensorConfig::read_document(&sensor)?);
        let scene = Scene::read(&Document::from_table(
            format!("{source}, scene"),
            self.scene,
        ))?;
        let exposure = Exposure::checked(&sensor, self.stop_periods, self.laser_cycles)
            .map_err(|fault| InputError::new(source, format!("{fault}; take it anew")))?;
        let usual = DepthOptions::default();
        Ok(TakenSettings {
            scene_name: self.scene_name,
            scene,
            sensor,
            exposure,
            seed: self.seed,
            engine: self.engine,
            depth: DepthOptions {
                false_alarm_rate: self.false_alarm_rate.unwrap_or(usual.false_alarm_rate),
                correct_walk: self.walk_correction.unwrap_or(usual.correct_walk),
                ..usual
            },
            calibration: self.calibration,
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
        let (settings, file) = TakenSettings::read::<FrameFile>(path, wanted)?;
        let pixels = file.macropixels;
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
            has_tolerance: file.tolerance.is_some(),
            is_plain: settings.calibration.is_none()
                && file.guides.is_empty()
                && file.windows.is_none(),
            pixels,
            probes: file.probes,
            summary: file.summary,
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
