//! `gdtof range`: depths from histograms that the user has.

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
    /// Counts of a sensor like ours, rows x columns x bins (.npy), in the windows of a frame.json.
    Frame,
}

/// Arguments of `gdtof range`.
#[derive(Args)]
pub(super) struct RangeArgs {
    /// File with the histograms.
    #[arg(long, value_name = "FILE")]
    histograms: PathBuf,
    /// Format of the file.
    #[arg(long, value_enum)]
    format: Format,
    /// tmf8820: captures to calibrate on, by their true distances; depths and errors are given for the others
    /// [default: even].
    #[arg(long, value_enum, conflicts_with = "calibration")]
    fit: Option<Fit>,
    /// tmf8820: calibration to use instead, on all captures. frame: bin profile of the sensor's delay lines, from
    /// `gdtof calibrate`.
    #[arg(long, value_name = "FILE")]
    calibration: Option<PathBuf>,
    /// tmf8820: file to save the calibration to (JSON).
    #[arg(long, value_name = "FILE", conflicts_with = "calibration")]
    save_calibration: Option<PathBuf>,
    /// frame: frame.json with sensor, scene, exposure and start values [default: the one beside the histograms].
    #[arg(long, value_name = "FILE")]
    frame: Option<PathBuf>,
    /// frame: share of macropixels without an echo that may get a depth [default: 0.001].
    #[arg(long, value_name = "P")]
    false_alarm_rate: Option<f64>,
    /// frame: do not correct depths for the range walk of strong echoes.
    #[arg(long)]
    no_walk_correction: bool,
    /// File for the depths (CSV). tmf8820: capture,zone,true_m,depth_m,sensor_m; frame:
    /// row,col,start,true_m,guide_m,depth_m,bound_m,confidence,no_depth.
    #[arg(long, value_name = "FILE")]
    out: Option<PathBuf>,
    /// Print JSON instead of tables.
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
