//! `gdtof range`: depths from histograms that the user has.

mod args;
mod counts;
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
    use Format::{Counts, Frame, Tmf8820};
    // What each option is for.
    let options: [(&str, bool, &[Format]); 11] = [
        ("--fit", args.fit.is_some(), &[Tmf8820]),
        ("--save-calibration", args.save_calibration.is_some(), &[Tmf8820]),
        ("--calibration", args.calibration.is_some(), &[Tmf8820, Frame]),
        ("--frame", args.frame.is_some(), &[Frame]),
        ("--false-alarm-rate", args.false_alarm_rate.is_some(), &[Frame, Counts]),
        ("--no-walk-correction", args.no_walk_correction, &[Frame, Counts]),
        ("--bin-width-ns", args.bin_width_ns.is_some(), &[Counts]),
        ("--start-ns", args.start_ns.is_some(), &[Counts]),
        ("--laser-cycles", args.laser_cycles.is_some(), &[Counts]),
        ("--pulse-fwhm-ns", args.pulse_fwhm_ns.is_some(), &[Counts]),
        ("--counts", args.counts.is_some(), &[Counts]),
    ];
    let is_other = |(_, is_given, formats): &&(&str, bool, &[Format])| {
        *is_given && !formats.contains(&args.format)
    };
    if let Some((option, ..)) = options.iter().find(is_other) {
        let format = match args.format {
            Tmf8820 => "tmf8820",
            Frame => "frame",
            Counts => "counts",
        };
        let message = format!("is not for --format {format}; leave it out");
        return Err(InputError::new(option, message).into());
    }
    match args.format {
        Format::Tmf8820 => tmf8820::run(args),
        Format::Frame => frame::run(args),
        Format::Counts => counts::run(args),
    }
}
