//! What a folder of results holds, frame by frame: start values, truth, guide and histograms as recorded, and depths found in them again.

use std::path::{Path, PathBuf};

use serde::Deserialize;
use serde::de::DeserializeOwned;

use crate::chip::{Exposure, SensorConfig};
use crate::files::{InputError, parse_json, read_text};
use crate::ranging::{BinProfile, DepthOptions};
use crate::request::read_calibration;
use crate::scene::Scene;
use crate::settings::Document;
use crate::system::Known;

/// A frame, or a drive of many.
#[derive(Debug)]
pub(super) struct Recording {
    pub(super) scene_name: String,
    pub(super) scene: Scene,
    pub(super) sensor: SensorConfig,
    pub(super) exposure: Exposure,
    pub(super) seed: u64,
    pub(super) options: DepthOptions,
    pub(super) calibration: Option<BinProfile>,
    pub(super) is_drive: bool,
    /// Macropixels of which the folder has a waveform.
    pub(super) probes: Vec<(usize, usize)>,
    pub(super) frames: Vec<Recorded>,
}

/// A frame as it was recorded.
#[derive(Debug)]
pub(super) struct Recorded {
    pub(super) number: u32,
    /// The middle of the exposure on the scene's clock, s.
    pub(super) time_s: f64,
    pub(super) known: Vec<Known>,
    /// Macropixel by macropixel, bin by bin.
    pub(super) counts: Vec<u16>,
    /// The summary of the results, as it stands there.
    pub(super) summary: serde_json::Value,
}

/// What `frame.json` and `drive.json` have in common.
#[derive(Deserialize)]
struct Asked {
    scene_name: String,
    scene: toml::Table,
    sensor: toml::Table,
    stop_periods: u32,
    laser_cycles: u32,
    seed: u64,
    calibration: Option<PathBuf>,
    #[serde(default = "usual_rate")]
    false_alarm_rate: f64,
    #[serde(default = "usual_walk")]
    walk_correction: bool,
}

fn usual_rate() -> f64 {
    DepthOptions::default().false_alarm_rate
}

fn usual_walk() -> bool {
    DepthOptions::default().correct_walk
}

#[derive(Deserialize)]
struct FrameFile {
    #[serde(flatten)]
    asked: Asked,
    summary: serde_json::Value,
    #[serde(default)]
    probes: Vec<(usize, usize)>,
    macropixels: Vec<Macropixel>,
}

#[derive(Deserialize)]
struct Macropixel {
    true_m: Option<f64>,
    guide_m: Option<f64>,
    start: Option<u16>,
}

#[derive(Deserialize)]
struct DriveFile {
    #[serde(flatten)]
    asked: Asked,
    frames: u64,
}

#[derive(Deserialize)]
struct FrameLine {
    number: u32,
    times: Times,
    summary: serde_json::Value,
}

#[derive(Deserialize)]
struct Times {
    exposure_s: f64,
    readout_s: f64,
}

#[derive(Deserialize)]
struct Version {
    version: String,
}

const WANTED: &str = "a folder that gdtof frame or gdtof drive has written";

impl Recording {
    /// Reads `folder`; of a drive, each `every`-th frame.
    ///
    /// # Errors
    /// Neither a frame nor a drive of this version, or files that cannot be read or contradict each other.
    pub(super) fn read(folder: &Path, every: usize) -> Result<Self, InputError> {
        let (frame, drive) = (folder.join("frame.json"), folder.join("drive.json"));
        if frame.is_file() {
            return of_frame(folder, &frame);
        }
        if drive.is_file() {
            return of_drive(folder, &drive, every);
        }
        let message = format!("has neither frame.json nor drive.json; give {WANTED}");
        Err(InputError::new(folder.display(), message))
    }
}

fn of_frame(folder: &Path, path: &Path) -> Result<Recording, InputError> {
    let file: FrameFile = read_json(path)?;
    let mut recording = begun(path, file.asked, false)?;
    let sensor = &recording.sensor;
    if file.macropixels.len() != sensor.pixels() {
        let message = format!(
            "has {} macropixels and a sensor of {}x{}; take the frame anew",
            file.macropixels.len(),
            sensor.rows,
            sensor.cols
        );
        return Err(InputError::new(path.display(), message));
    }
    let shape = [sensor.rows, sensor.cols, sensor.bins].map(|n| n as u64);
    let counts = read_npy(&folder.join("histograms.npy"), &shape)?;
    let known = file.macropixels.iter().enumerate();
    let known = known.map(|(pixel, of)| Known {
        pixel,
        start: of.start,
        true_m: of.true_m,
        guide_m: of.guide_m,
    });
    let cycles = recording.exposure.laser_cycles;
    recording.frames.push(Recorded {
        number: 0,
        time_s: 0.5 * recording.exposure.stop(cycles.into()).as_s(),
        known: known.collect(),
        counts,
        summary: file.summary,
    });
    recording.probes = file.probes;
    Ok(recording)
}

fn of_drive(folder: &Path, path: &Path, every: usize) -> Result<Recording, InputError> {
    let file: DriveFile = read_json(path)?;
    let mut recording = begun(path, file.asked, true)?;
    let (pixels, bins) = (recording.sensor.pixels(), recording.sensor.bins);
    let [rows, cols] = [recording.sensor.rows, recording.sensor.cols].map(|n| n as u64);
    let map = [file.frames, rows, cols];
    let index = folder.join("frames.jsonl");
    let lines = read_text(&index)?;
    let lines: Vec<FrameLine> = lines
        .lines()
        .map(|line| parse_json(index.display(), line, WANTED))
        .collect::<Result<_, _>>()?;
    if lines.len() as u64 != file.frames {
        let message = format!(
            "has {} frames and drive.json {}; drive anew",
            lines.len(),
            file.frames
        );
        return Err(InputError::new(index.display(), message));
    }
    let metres = |name: &str| read_npy::<f32>(&folder.join(name), &map);
    let (truth, guide) = (metres("truth.npy")?, metres("guide.npy")?);
    let starts: Vec<i16> = read_npy(&folder.join("starts.npy"), &map)?;
    let all = [file.frames, rows, cols, bins as u64];
    let counts: Vec<u16> = read_npy(&folder.join("histograms.npy"), &all)?;
    let some = |m: f32| (!m.is_nan()).then_some(f64::from(m));
    for (at, line) in lines.into_iter().enumerate().step_by(every) {
        let first = at * pixels;
        let known = (0..pixels).map(|pixel| Known {
            pixel,
            start: u16::try_from(starts[first + pixel]).ok(),
            true_m: some(truth[first + pixel]),
            guide_m: some(guide[first + pixel]),
        });
        recording.frames.push(Recorded {
            number: line.number,
            time_s: 0.5 * (line.times.exposure_s + line.times.readout_s),
            known: known.collect(),
            counts: counts[first * bins..(first + pixels) * bins].to_vec(),
            summary: line.summary,
        });
    }
    Ok(recording)
}

/// A recording without frames.
fn begun(path: &Path, asked: Asked, is_drive: bool) -> Result<Recording, InputError> {
    let source = path.display();
    let sensor =
        SensorConfig::read_document(&Document::of(format!("{source}, sensor"), asked.sensor))?;
    let scene = Scene::read(&Document::of(format!("{source}, scene"), asked.scene))?;
    let exposure = Exposure::checked(&sensor, asked.stop_periods, asked.laser_cycles)
        .map_err(|fault| InputError::new(&source, fault.to_string()))?;
    let calibration = match &asked.calibration {
        Some(path) => Some(read_calibration(path, &sensor)?),
        None => None,
    };
    Ok(Recording {
        scene_name: asked.scene_name,
        scene,
        exposure,
        seed: asked.seed,
        options: DepthOptions {
            false_alarm_rate: asked.false_alarm_rate,
            correct_walk: asked.walk_correction,
            ..DepthOptions::default()
        },
        calibration,
        is_drive,
        probes: Vec::new(),
        frames: Vec::new(),
        sensor,
    })
}

/// Reads results of this version.
fn read_json<T: DeserializeOwned>(path: &Path) -> Result<T, InputError> {
    let text = read_text(path)?;
    let Version { version } = parse_json(path.display(), &text, WANTED)?;
    let ours = env!("CARGO_PKG_VERSION");
    if version != ours {
        let message =
            format!("was written by version {version}, and this is {ours}; take the frames anew");
        return Err(InputError::new(path.display(), message));
    }
    parse_json(path.display(), &text, WANTED)
}

/// An array of the shape that it must have.
fn read_npy<T: npyz::Deserialize>(path: &Path, shape: &[u64]) -> Result<Vec<T>, InputError> {
    let refused = |why: String| InputError::new(path.display(), format!("{why}; give {WANTED}"));
    let bytes = std::fs::read(path).map_err(|e| refused(e.to_string()))?;
    let file = npyz::NpyFile::new(&bytes[..]).map_err(|e| refused(e.to_string()))?;
    if file.shape() != shape || file.order() != npyz::Order::C {
        return Err(refused(format!(
            "has the shape {:?} where {shape:?} is expected",
            file.shape()
        )));
    }
    file.into_vec().map_err(|e| refused(e.to_string()))
}
