//! `gdtof range`: depths from histograms that the user has.

mod args;
mod counts;
mod crosstalk;
mod detector;
mod frame;
mod returns;
mod tmf8820;

pub(super) use self::args::RangeArgs;

use self::args::Format;
use clap::ValueEnum;

use crate::files::{HistogramFormat, InputError};

/// Runs the command.
///
/// # Errors
/// Bad input, files that cannot be written.
pub(super) fn run(args: &RangeArgs) -> anyhow::Result<()> {
    use Format::{Cnh, Counts, Frame, Tmf882x, Tmf8820, Tmf8829};
    // What each option is for.
    const ANY: &[Format] = &[Counts, Tmf882x, Tmf8829, Cnh];
    const SEEN: &[Format] = &[Frame, Counts, Tmf882x, Tmf8829, Cnh];
    let options: [(&str, bool, &[Format]); 15] = [
        ("--fit", args.fit.is_some(), &[Tmf8820]),
        (
            "--save-calibration",
            args.save_calibration.is_some(),
            &[Tmf8820],
        ),
        (
            "--calibration",
            args.calibration.is_some(),
            &[Tmf8820, Frame],
        ),
        ("--frame", args.frame.is_some(), &[Frame]),
        ("--false-alarm-rate", args.false_alarm_rate.is_some(), SEEN),
        ("--no-walk-correction", args.no_walk_correction, SEEN),
        ("--detector", args.detector.is_some(), ANY),
        ("--crosstalk", args.crosstalk.is_some(), ANY),
        ("--bin-width-ns", args.bin_width_ns.is_some(), ANY),
        ("--pulse-fwhm-ns", args.pulse_fwhm_ns.is_some(), ANY),
        ("--start-ns", args.start_ns.is_some(), ANY),
        ("--bins", args.bins.is_some(), ANY),
        ("--counts", args.counts.is_some(), ANY),
        ("--laser-cycles", args.laser_cycles.is_some(), ANY),
        (
            "--counts-per-unit",
            args.counts_per_unit.is_some(),
            &[Counts, Cnh],
        ),
    ];
    let is_other = |(_, is_given, formats): &&(&str, bool, &[Format])| {
        *is_given && !formats.contains(&args.format)
    };
    if let Some((option, ..)) = options.iter().find(is_other) {
        let value = args.format.to_possible_value();
        let format = value.expect("no format is hidden");
        let format = format.get_name();
        let message = format!("is not for --format {format}; leave it out");
        return Err(InputError::new(option, message).into());
    }
    let format = match args.format {
        Tmf8820 => return tmf8820::run(args),
        Frame => return frame::run(args),
        Counts => HistogramFormat::Table,
        Tmf882x => HistogramFormat::Tmf882x,
        Tmf8829 => HistogramFormat::Tmf8829,
        Cnh => HistogramFormat::Cnh,
    };
    counts::run(args, format)
}
