//! A frame that was taken earlier, as its `frame.json` describes it: enough to give any macropixel the photons it had.

use std::path::Path;

use serde::Deserialize;

use super::aim::Aims;
use super::frame::EngineKind;
use crate::chip::{Exposure, SensorConfig};
use crate::engine::stream_config;
use crate::files::{InputError, parse_json, read_text};
use crate::guide::{BehaviouralStereo, Guide, GuideInput};
use crate::photon::{PhotonStream, SpadEvent};
use crate::scene::{GroundTruth, Scene};
use crate::settings::Document;

/// What a frame depended on.
#[derive(Debug, Clone)]
pub struct TakenFrame {
    source: String,
    /// The chip.
    pub sensor: SensorConfig,
    /// The world.
    pub scene: Scene,
    /// The exposure of `sensor`.
    pub exposure: Exposure,
    /// Seed of photons and stereo errors.
    pub seed: u64,
    /// Engine of the macropixels that were not probed.
    pub engine: EngineKind,
    /// Whether a tolerance chose engines instead.
    pub has_tolerance: bool,
    /// Whether its windows are those of the camera pair's estimates by the window law: not calibrated, no other guide or policy.
    is_plain: bool,
    /// What is known of each macropixel, row-major.
    pub(super) known: Vec<Macropixel>,
}

/// The part of `frame.json` that says what was asked for, and the start values.
#[derive(Deserialize)]
struct FrameFile {
    scene: toml::Table,
    sensor: toml::Table,
    stop_periods: u32,
    laser_cycles: u32,
    seed: u64,
    engine: EngineKind,
    tolerance: Option<serde::de::IgnoredAny>,
    calibration: Option<serde::de::IgnoredAny>,
    #[serde(default)]
    guides: Vec<String>,
    windows: Option<serde::de::IgnoredAny>,
    macropixels: Vec<Macropixel>,
}

/// What is known of a macropixel.
#[derive(Debug, Clone, Deserialize)]
pub(super) struct Macropixel {
    /// Start value; `None` where SPADs were off.
    pub(super) start: Option<u16>,
    /// The true distance, m.
    pub(super) true_m: Option<f64>,
    /// The guide's estimate, m.
    pub(super) guide_m: Option<f64>,
}

/// The version alone, which other versions have, too.
#[derive(Deserialize)]
struct Version {
    version: String,
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
        let ours = env!("CARGO_PKG_VERSION");
        let source = path.display().to_string();
        let complain = |message: String| Err(InputError::new(&source, message));
        let text = read_text(path)?;
        let wanted = "the frame.json of a frame that `gdtof frame` has taken";
        let Version { version } = parse_json(&source, &text, wanted)?;
        if version != ours {
            return complain(format!(
                "was written by version {version}, which may draw other photons than {ours}; take the frame anew"
            ));
        }
        let file: FrameFile = parse_json(&source, &text, wanted)?;
        let sensor = Document::of(format!("{source}, sensor"), file.sensor);
        let sensor = SensorConfig::read_document(&sensor)?;
        let scene = Scene::read(&Document::of(format!("{source}, scene"), file.scene))?;
        let exposure = match Exposure::checked(&sensor, file.stop_periods, file.laser_cycles) {
            Ok(exposure) => exposure,
            Err(fault) => return complain(format!("{fault}; take the frame anew")),
        };
        let known = file.macropixels;
        if known.len() != sensor.pixels() {
            return complain(format!(
                "has {} macropixels and a sensor of {}x{}; take the frame anew",
                known.len(),
                sensor.rows,
                sensor.cols
            ));
        }
        Ok(TakenFrame {
            sensor,
            scene,
            exposure,
            seed: file.seed,
            engine: file.engine,
            has_tolerance: file.tolerance.is_some(),
            is_plain: file.calibration.is_none()
                && file.guides.is_empty()
                && file.windows.is_none(),
            known,
            source,
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
        let (sensor, scene) = (&self.sensor, &self.scene);
        assert!(row < sensor.rows && col < sensor.cols);
        let pixel = row * sensor.cols + col;
        let (rows, cols) = (sensor.rows as u32, sensor.cols as u32);
        // What a calibration made of the guide's estimate is not known here, nor are other guides.
        let given = match self.is_plain {
            false => self.known[pixel].start,
            true => {
                let input = GuideInput::still(scene, rows, cols, self.seed);
                let guide = BehaviouralStereo.estimate(&input);
                let guide = guide.map_err(|why| InputError::new(&self.source, why.to_string()))?;
                Aims::new(sensor, &self.exposure, None).start_of(pixel, guide.range_m[pixel])
            }
        };
        if given != self.known[pixel].start {
            let shown = |start: Option<u16>| start.map_or("none".to_owned(), |s| s.to_string());
            let message = format!(
                "gives macropixel ({row}, {col}) the start value {}, where its sensor, scene and seed give {}; take the frame anew",
                shown(self.known[pixel].start),
                shown(given)
            );
            return Err(InputError::new(&self.source, message));
        }
        // A longer exposure begins with the same photons, but for an echo that falls into it from the next laser cycle.
        let exposure = Exposure {
            laser_cycles: laser_cycles
                .saturating_add(1)
                .min(self.exposure.laser_cycles),
            ..self.exposure
        };
        let stream = stream_config(sensor, &exposure, self.seed, scene.pulse_sigma());
        let stream = PhotonStream::new(&scene.with_pulse(stream));
        let light = given.map(|_| {
            let cycle_s = stream.config().cycle_s();
            let cycles = self.exposure.laser_cycles;
            let middle_s = 0.5 * f64::from(cycles) * cycle_s;
            let truth = GroundTruth::render(&scene.at(middle_s), rows, cols);
            let spads = &stream.config().spads;
            let mut light = scene.light_during(&truth, spads, cycles, cycle_s);
            light.swap_remove(pixel)
        });
        let photons = light.map(|light| stream.pixel_events(pixel as u32, &light));
        Ok(TakenPixel {
            start: given.unwrap_or(sensor.largest_start()),
            is_on: given.is_some(),
            pulses: photons.unwrap_or_default().events,
        })
    }
}
