//! `gdtof range`: depths from histograms that are given.

mod frame;
mod tmf8820;

use std::path::PathBuf;

use clap::{Args, ValueEnum};

use self::tmf8820::Fit;
use crate::files::InputError;

#[derive(Clone, Copy, PartialEq, Eq, ValueEnum)]
enum Format {
    /// JSON captures of an ams TMF8820.
    Tmf8820,
    /// Counts of our sensors, rows x columns x bins (.npy), in windows that a frame.json names.
    Frame,
}

/// Arguments of `gdtof range`.
#[derive(Args)]
pub(super) struct RangeArgs {
    /// File of histograms.
    #[arg(long, value_name = "FILE")]
    histograms: PathBuf,
    /// What the file is.
    #[arg(long, value_enum)]
    format: Format,
    /// tmf8820: captures to calibrate on, by their true distances; depths and errors are those of the others. Without it, even.
    #[arg(long, value_enum, conflicts_with = "calibration")]
    fit: Option<Fit>,
    /// tmf8820: use the calibration in this file instead, on all captures. frame: the bin profile of the sensor's delay lines, as
    /// `gdtof calibrate` writes it.
    #[arg(long, value_name = "FILE")]
    calibration: Option<PathBuf>,
    /// tmf8820: keep the calibration (JSON).
    #[arg(long, value_name = "FILE", conflicts_with = "calibration")]
    save_calibration: Option<PathBuf>,
    /// frame: sensor, scene, exposure and start values, as `gdtof frame` writes them. Without it, the frame.json beside the
    /// histograms.
    #[arg(long, value_name = "FILE")]
    frame: Option<PathBuf>,
    /// frame: share of macropixels without an echo that may be given a depth. Without it, 0.001.
    #[arg(long, value_name = "P")]
    false_alarm_rate: Option<f64>,
    /// frame: leave the range walk of strong echoes in the depths.
    #[arg(long)]
    no_walk_correction: bool,
    /// Depths as CSV. tmf8820: capture,zone,true_m,depth_m,sensor_m; frame: row,col,start,true_m,guide_m,depth_m,bound_m,confidence,no_depth.
    #[arg(long, value_name = "FILE")]
    out: Option<PathBuf>,
    /// JSON instead of tables.
    #[arg(long)]
    json: bool,
}

/// Runs the command.
///
/// # Errors
/// Bad input, files that cannot be written.
pub(super) fn run(args: &RangeArgs) -> anyhow::Result<()> {
    let of_frames = [
        ("--frame", args.frame.is_some()),
        ("--false-alarm-rate", args.false_alarm_rate.is_some()),
        ("--no-walk-correction", args.no_walk_correction),
    ];
    let of_captures = [
        ("--fit", args.fit.is_some()),
        ("--save-calibration", args.save_calibration.is_some()),
    ];
    let (format, others) = match args.format {
        Format::Tmf8820 => ("tmf8820", &of_frames[..]),
        Format::Frame => ("frame", &of_captures[..]),
    };
    if let Some((option, _)) = others.iter().find(|(_, is_given)| *is_given) {
        let message = format!("is not for --format {format}; leave it out");
        return Err(InputError::new(option, message).into());
    }
    match args.format {
        Format::Tmf8820 => tmf8820::run(args),
        Format::Frame => frame::run(args),
    }
}
