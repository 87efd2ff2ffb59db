//! What a folder of results holds, frame by frame: start values, truth, guide and histograms as recorded, and depths found in them again.

use std::path::Path;

use crate::files::{InputError, parse_json, read_array, read_counts, read_text};
use crate::ranging::BinProfile;
use crate::request::read_calibration;
use crate::system::{
    DriveConfiguration, DriveLine, DriveResult, PixelContext, ReadExposure, RunReport, TakenFrame,
    TakenSettings,
};

/// A frame, or a drive of many.
#[derive(Debug)]
pub(super) struct Recording {
    pub(super) settings: TakenSettings,
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
    pub(super) known: Vec<PixelContext>,
    /// Macropixel by macropixel, bin by bin.
    pub(super) counts: Vec<u16>,
    /// The summary of the results, as it stands there.
    pub(super) summary: serde_json::Value,
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
        let what = if folder.is_file() {
            "is a file"
        } else {
            "has neither frame.json nor drive.json"
        };
        Err(InputError::new(
            folder.display(),
            format!("{what}; give {WANTED}"),
        ))
    }
}

fn of_frame(folder: &Path, path: &Path) -> Result<Recording, InputError> {
    let taken = TakenFrame::read(path)?;
    let sensor = &taken.settings.sensor;
    let shape = [sensor.rows, sensor.cols, sensor.bins];
    let counts = read_counts(&folder.join("histograms.npy"), &shape)?;
    let known = taken.pixels.iter().enumerate();
    let known = known.map(|(pixel, depth)| PixelContext::new(pixel, depth));
    let exposure = &taken.settings.exposure;
    let frame = Recorded {
        number: 0,
        time_s: 0.5 * exposure.end().as_s(),
        known: known.collect(),
        counts,
        summary: taken.summary,
    };
    Ok(Recording {
        calibration: calibration_of(&taken.settings)?,
        settings: taken.settings,
        is_drive: false,
        probes: taken.probes,
        frames: vec![frame],
    })
}

fn of_drive(folder: &Path, path: &Path, every: usize) -> Result<Recording, InputError> {
    let RunReport::<DriveConfiguration<ReadExposure>, DriveResult> {
        configuration,
        result,
        ..
    } = RunReport::read(path, WANTED)?;
    let settings = (configuration.exposed).settings(path, configuration.calibration)?;
    let number = result.frames as usize;
    let sensor = &settings.sensor;
    let (pixels, bins) = (sensor.pixels(), sensor.bins);
    let index = folder.join("frames.jsonl");
    let lines = read_text(&index)?;
    let lines: Vec<DriveLine<serde_json::Value>> = lines
        .lines()
        .map(|line| parse_json(index.display(), line, WANTED))
        .collect::<Result<_, _>>()?;
    if lines.len() != number {
        let message = format!(
            "has {} frames and drive.json {number}; drive anew",
            lines.len()
        );
        return Err(InputError::new(index.display(), message));
    }
    let map = [number, sensor.rows, sensor.cols];
    let metres = |name: &str| read_array::<f32>(&folder.join(name), &map);
    let (truth, guide) = (metres("truth.npy")?, metres("guide.npy")?);
    let starts: Vec<i16> = read_array(&folder.join("starts.npy"), &map)?;
    let all = [number, sensor.rows, sensor.cols, bins];
    let counts = read_counts(&folder.join("histograms.npy"), &all)?;
    let some = |m: f32| (!m.is_nan()).then_some(f64::from(m));
    let mut frames = Vec::new();
    for (at, line) in lines.into_iter().enumerate().step_by(every) {
        let first = at * pixels;
        let known = (0..pixels).map(|pixel| PixelContext {
            pixel,
            start: u16::try_from(starts[first + pixel]).ok(),
            true_m: some(truth[first + pixel]),
            guide_m: some(guide[first + pixel]),
        });
        frames.push(Recorded {
            number: line.number,
            time_s: line.times.middle_s(),
            known: known.collect(),
            counts: counts[first * bins..(first + pixels) * bins].to_vec(),
            summary: line.summary,
        });
    }
    Ok(Recording {
        calibration: calibration_of(&settings)?,
        settings,
        is_drive: true,
        probes: Vec::new(),
        frames,
    })
}

fn calibration_of(settings: &TakenSettings) -> Result<Option<BinProfile>, InputError> {
    let path = settings.calibration.as_ref();
    path.map(|path| read_calibration(path, &settings.sensor))
        .transpose()
}
