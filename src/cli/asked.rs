//! Options about the exposure that `gdtof frame` and `gdtof drive` share.

use std::ops::RangeInclusive;
use std::path::PathBuf;

use clap::Args;

use crate::chip::SensorConfig;
use crate::files::InputError;
use crate::guide::options;
use crate::request::{FrameRequest, Spelling};
use crate::settings::{Key, Settings};
use crate::system::{EngineKind, WindowPolicy};
use crate::waves::WaveFormat;

/// An exposure, and how its windows are guided.
#[derive(Args)]
pub(super) struct ExposureArgs {
    #[command(flatten)]
    pub(super) guiding: GuideArgs,
    /// CLK periods in a laser cycle.
    #[arg(long, value_name = "P", default_value_t = 520)]
    pub(super) stop_periods: u32,
    /// Laser cycles of an exposure.
    #[arg(long, value_name = "N", default_value_t = 1000)]
    pub(super) laser_cycles: u32,
    /// Seed of photons and guide errors.
    #[arg(long, default_value_t = 1)]
    pub(super) seed: u64,
    /// Engine that runs the macropixels.
    #[arg(long, value_enum, default_value_t)]
    pub(super) engine: EngineKind,
    /// Bins of the sensor's delay lines as `gdtof calibrate` has measured them. Without it all are taken to be equal.
    #[arg(long, value_name = "FILE")]
    pub(super) calibration: Option<PathBuf>,
}

impl ExposureArgs {
    /// The request with these options, and defaults for everything else.
    pub(super) fn request(&self) -> FrameRequest {
        let mut request = self.guiding.add_to(FrameRequest::default());
        request.stop_periods = self.stop_periods;
        request.laser_cycles = self.laser_cycles;
        request.seed = self.seed;
        request.engine = self.engine;
        request.calibration = self.calibration.clone();
        request.spelling = Spelling::Options;
        request
    }
}

/// How a waveform is written.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, clap::ValueEnum)]
pub(super) enum WaveFormatOption {
    /// Value change dump: text that every tool reads.
    #[default]
    Vcd,
    /// GTKWave's compressed format, several times smaller.
    Fst,
}

impl From<WaveFormatOption> for WaveFormat {
    fn from(option: WaveFormatOption) -> Self {
        match option {
            WaveFormatOption::Vcd => WaveFormat::Vcd,
            WaveFormatOption::Fst => WaveFormat::Fst,
        }
    }
}

/// The macropixel that an option names as row,col.
///
/// # Errors
/// When the array has no such macropixel.
pub(super) fn pixel(
    option: &str,
    text: &str,
    sensor: &SensorConfig,
) -> Result<(usize, usize), InputError> {
    let place = text
        .split_once(',')
        .and_then(|(row, col)| Some((row.trim().parse().ok()?, col.trim().parse().ok()?)));
    let message = match place {
        Some((row, col)) if row < sensor.rows && col < sensor.cols => return Ok((row, col)),
        Some((row, col)) => format!(
            "macropixel ({row}, {col}) is outside the {}x{} array; give rows 0 to {} and columns 0 to {}",
            sensor.rows,
            sensor.cols,
            sensor.rows - 1,
            sensor.cols - 1
        ),
        None => format!("{text:?} is not a macropixel; give row,col such as 10,20"),
    };
    Err(InputError::new(option, message))
}

/// Rows and columns of the macropixels that an option names as row,col, each a number or a range such as 8-11, of an array of these
/// rows and columns.
///
/// # Errors
/// When the array has no such macropixels.
pub(super) fn region(
    option: &str,
    text: &str,
    (rows, cols): (usize, usize),
) -> Result<[RangeInclusive<usize>; 2], InputError> {
    let range = |text: &str| {
        let (first, last) = text.split_once('-').unwrap_or((text, text));
        let (first, last) = (first.trim().parse().ok()?, last.trim().parse().ok()?);
        (first <= last).then_some(first..=last)
    };
    let region = text
        .split_once(',')
        .and_then(|(row, col)| Some([range(row)?, range(col)?]));
    let message = match region {
        Some([row, col]) if *row.end() < rows && *col.end() < cols => return Ok([row, col]),
        Some(_) => format!(
            "macropixel {text} is outside the {rows}x{cols} array; give rows 0 to {} and columns 0 to {}",
            rows - 1,
            cols - 1
        ),
        None => format!(
            "{text:?} is not a macropixel; give row,col such as 10,20, or ranges such as 8-11,20-23"
        ),
    };
    Err(InputError::new(option, message))
}

/// How windows are guided.
#[derive(Args)]
pub(super) struct GuideArgs {
    /// Guide for the windows, such as radar or radar:range_sigma_m=0.2,azimuth_beam_deg=4 [default: stereo, the
    /// scene's camera pair]. Several are fused by their variances. `--help` lists all guides with their keys.
    #[arg(long = "guide", value_name = "NAME[:KEY=VALUE,…]", long_help = guides_in_full())]
    pub(super) guides: Vec<String>,
    /// How windows are chosen, such as unguided=neighbour. `--help` lists all keys.
    #[arg(long, value_name = "KEY=VALUE,…", long_help = policy_in_full())]
    windows: Option<String>,
    /// Slow CLK down until windows are as long as the guide's reported uncertainty requires (`within` of --windows).
    /// The length of a laser cycle stays the same.
    #[arg(long)]
    bins_from_guide: bool,
}

impl GuideArgs {
    /// Adds guide and windows to a request.
    pub(super) fn add_to(&self, mut request: FrameRequest) -> FrameRequest {
        request.guides = self.guides.clone();
        request.windows = self.windows.clone().unwrap_or_default();
        request.bins_from_guide = self.bins_from_guide;
        request
    }
}

fn guides_in_full() -> String {
    let mut text = "Guide for the windows: a name, or a name with keys, such as \
        radar:range_sigma_m=0.2,azimuth_beam_deg=4 [default: stereo]. Several --guide are fused by their variances.\n"
        .to_owned();
    for kind in options::KINDS {
        text += &format!("\n{}: {}\n", kind.name, kind.what);
        text += &keys_in_full(kind.keys);
    }
    text
}

fn policy_in_full() -> String {
    let keys = keys_in_full(WindowPolicy::KEYS);
    format!("How windows are chosen, such as unguided=neighbour,overlap=0.3:\n{keys}")
}

fn keys_in_full(keys: &[Key]) -> String {
    let line = |key: &Key| {
        let unit = if key.unit.is_empty() { "" } else { " " };
        format!(
            "  {}: {}; {}{unit}{}\n",
            key.name, key.what, key.range, key.unit
        )
    };
    keys.iter().map(line).collect()
}
