//! `gdtof range`: depths from histograms that the user has.

mod args;
mod frame;
mod tmf8820;

pub(super) use self::args::RangeArgs;

use self::args::Format;
use crate::files::InputError;

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
