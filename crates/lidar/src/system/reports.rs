//! `frame.json`, `drive.json` and `frames.jsonl`: the one declaration of their keys, for those who write and those who read them.
//!
//! ```text
//!   frame.json   version, FrameConfiguration (ExposureReport, …), FrameResult (…, FrameArray)
//!   drive.json   version, DriveConfiguration (ExposureReport, …), DriveResult
//!   frames.jsonl DriveLine, one a frame
//! ```
//!
//! Writers borrow scene and sensor (`S` and `C`); readers have them as tables, whose keys they can name. Keys that nobody reads back
//! are not looked at in a file.

use std::borrow::Cow;
use std::collections::BTreeMap;
use std::path::{Path, PathBuf};

use serde::de::{DeserializeOwned, IgnoredAny};
use serde::{Deserialize, Serialize};

use super::distance::DistanceLaw;
use super::drive::{DriveReuse, FrameClock, FrameTimes, Noise};
use super::pixel::PixelDepth;
use super::policy::WindowPolicy;
use super::remark::DepthHint;
use super::result::PhaseTimes;
use super::settings::EngineKind;
use super::summary::FrameSummary;
use super::tolerance::ToleranceResult;
use crate::analysis::VerdictReport;
use crate::chip::SensorConfig;
use crate::engine::EngineWork;
use crate::files::{InputError, parse_json, read_text};
use crate::scene::{EyeSafety, Scene};

/// Of the program: files of another version may mean other photons.
const VERSION: &str = env!("CARGO_PKG_VERSION");

/// The whole of `frame.json` or `drive.json`: what was asked for, and what came of it.
#[derive(Debug, Serialize, Deserialize)]
pub struct RunReport<Q, R> {
    version: Cow<'static, str>,
    /// What was asked for, which is in the manifest, too.
    #[serde(flatten)]
    pub configuration: Q,
    /// What came of it.
    #[serde(flatten)]
    pub result: R,
}

/// The version alone, which files of other versions have, too.
#[derive(Deserialize)]
struct Version {
    version: String,
}

impl<Q, R> RunReport<Q, R> {
    /// Of this version.
    pub fn from_parts(configuration: Q, result: R) -> Self {
        RunReport {
            version: VERSION.into(),
            configuration,
            result,
        }
    }

    /// Reads a file; `wanted` is what to give instead of one that is none.
    ///
    /// # Errors
    /// When it cannot be read, is none, or comes from another version of this program.
    pub(crate) fn read(path: &Path, wanted: &str) -> Result<Self, InputError>
    where
        Self: DeserializeOwned,
    {
        let source = || path.display();
        let text = read_text(path)?;
        let Version { version } = parse_json(source(), &text, wanted)?;
        if version != VERSION {
            let message = format!(
                "was written by version {version}, which may draw other photons than {VERSION}; take it anew"
            );
            return Err(InputError::new(source(), message));
        }
        parse_json(source(), &text, wanted)
    }
}

/// What frame.json and drive.json say of an exposure alike, first of all.
#[derive(Debug, Serialize, Deserialize)]
pub struct ExposureReport<S, C> {
    /// What reports call the scene.
    pub scene_name: String,
    pub(crate) scene: S,
    pub(crate) sensor: C,
    /// SHA-256 of the library and netlists that the sensor names, by their files.
    #[serde(default, skip_serializing_if = "BTreeMap::is_empty")]
    pub(crate) sha256: BTreeMap<String, String>,
    pub(crate) stop_periods: u32,
    /// Laser cycles of the exposure.
    pub laser_cycles: u32,
    pub(crate) seed: u64,
    pub(crate) engine: EngineKind,
}

/// An exposure that is written.
pub type WrittenExposure<'a> = ExposureReport<&'a Scene, &'a SensorConfig>;

/// What a frame was asked for.
#[derive(Debug, Serialize, Deserialize)]
pub struct FrameConfiguration<E> {
    #[serde(flatten)]
    pub(crate) exposed: E,
    pub(crate) false_alarm_rate: Option<f64>,
    pub(crate) walk_correction: Option<bool>,
    #[serde(skip_serializing_if = "Option::is_none")]
    pub(crate) calibration: Option<String>,
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub(crate) guides: Vec<String>,
    #[serde(default, skip_serializing_if = "String::is_empty")]
    pub(crate) windows: String,
}

/// What came of a frame; `P` is what there is to say of a pair of pictures in the place of the scene.
#[derive(Debug, Serialize)]
pub struct FrameResult<'a, P = ()> {
    pub(crate) summary: FrameSummary,
    pub(crate) remark: Option<&'a str>,
    pub(crate) hints: &'a [DepthHint],
    #[serde(skip_serializing_if = "is_zero")]
    pub(crate) depths_of_medium: usize,
    #[serde(skip_serializing_if = "is_zero")]
    pub(crate) light_cut: usize,
    pub(crate) photons_expected: f64,
    pub(crate) work: EngineWork,
    pub(crate) timing: &'a VerdictReport,
    pub(crate) tolerance: Option<&'a ToleranceResult>,
    #[serde(skip_serializing_if = "Option::is_none")]
    pub(crate) variance_left_out: Option<f64>,
    pub(crate) distance: DistanceLaw,
    pub(crate) load_bits: usize,
    pub(crate) load_time_s: f64,
    pub(crate) readout_time_s: f64,
    pub(crate) exposure_time_s: f64,
    pub(crate) frame_time_s: f64,
    pub(crate) eye_safety: Option<EyeSafety>,
    pub(crate) exposure_run_time_s: f64,
    pub(crate) run_time_s: f64,
    pub(crate) run_times: PhaseTimes,
    #[serde(skip_serializing_if = "Option::is_none")]
    pub(crate) pair: Option<&'a P>,
    #[serde(flatten)]
    pub(crate) array: FrameArray<'a>,
}

fn is_zero(number: &usize) -> bool {
    *number == 0
}

/// A frame's macropixels, last in its file.
#[derive(Debug, Serialize, Deserialize)]
pub(crate) struct FrameArray<'a> {
    #[serde(default)]
    pub(crate) probes: Cow<'a, [(usize, usize)]>,
    #[serde(default)]
    pub(crate) histograms_shape: [usize; 3],
    pub(crate) macropixels: Cow<'a, [PixelDepth]>,
}

/// What is read of a [`FrameResult`]. Its summary is shown as it stands there.
#[derive(Deserialize)]
pub(super) struct ReadFrame {
    pub(super) tolerance: Option<IgnoredAny>,
    pub(super) summary: serde_json::Value,
    #[serde(flatten)]
    pub(super) array: FrameArray<'static>,
}

/// What a drive was asked for; see [`DriveSettings`](super::DriveSettings).
#[derive(Debug, Serialize, Deserialize)]
pub struct DriveConfiguration<E> {
    #[serde(flatten)]
    pub exposed: E,
    /// As they were asked for; none for the camera pair.
    #[serde(skip_deserializing)]
    pub guides: Vec<String>,
    #[serde(skip_deserializing)]
    pub windows: WindowPolicy,
    pub calibration: Option<PathBuf>,
    #[serde(skip_deserializing)]
    pub start_s: f64,
    #[serde(skip_deserializing)]
    pub clock: FrameClock,
    #[serde(skip_deserializing)]
    pub segments: u32,
    #[serde(skip_deserializing)]
    pub noise: Noise,
    #[serde(skip_deserializing)]
    pub skip: bool,
    #[serde(skip_deserializing)]
    pub self_calibrates: bool,
}

/// What came of a drive.
#[derive(Debug, Serialize, Deserialize)]
pub struct DriveResult {
    pub frames: u32,
    #[serde(flatten, skip_deserializing)]
    pub totals: DriveTotals,
}

/// A drive in numbers: times in seconds, and sums over its frames.
#[derive(Debug, Default, Serialize)]
pub struct DriveTotals {
    pub frame_period_s: f64,
    pub frames_per_s: f64,
    pub load_s: f64,
    pub exposure_s: f64,
    pub readout_s: f64,
    pub macropixels: u64,
    pub macropixels_reused: u64,
    pub loads_reused: u32,
    pub worlds_reused: u32,
    pub views: u64,
    pub views_reused: u64,
    pub depths: u64,
    pub outliers: u64,
    pub work: EngineWork,
    pub run_time_s: f64,
}

/// A line of `frames.jsonl`, a [`DriveFrame`](super::DriveFrame). A summary is read as it stands there.
#[derive(Debug, Serialize, Deserialize)]
pub struct DriveLine<M = FrameSummary> {
    pub number: u32,
    pub times: FrameTimes,
    pub summary: M,
    #[serde(skip_deserializing)]
    pub reused: DriveReuse,
    #[serde(skip_deserializing)]
    pub work: EngineWork,
    #[serde(skip_deserializing)]
    pub run_times: PhaseTimes,
    /// How far the right camera is thought to have turned, degrees outwards.
    #[serde(skip_deserializing, skip_serializing_if = "Option::is_none")]
    pub camera_turn_deg: Option<f64>,
    /// File of its depths as a picture.
    #[serde(skip_deserializing, skip_serializing_if = "Option::is_none")]
    pub picture: Option<String>,
}
