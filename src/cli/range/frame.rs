//! `gdtof range --format frame`: depths from counts in the windows of a frame: its own once more, or those of a real chip.

use std::path::Path;

use serde::Serialize;

use super::args::RangeArgs;
use super::returns::{number_text, write_further, write_further_head};
use crate::cli::quality;
use crate::cli::voice::{say_json, say_unless_quiet};
use crate::files::{InputError, OutputFile, read_counts};
use crate::ranging::DepthOptions;
use crate::report::Table;
use crate::request::{Spelling, check_false_alarm_rate, read_calibration};
use crate::system::{ArrayDepths, FrameSummary, PixelDepth, TakenFrame, check_counts};

/// What is printed with `--json`.
#[derive(Serialize)]
struct Report<'a> {
    summary: FrameSummary,
    bin_m: f64,
    macropixels: &'a [PixelDepth],
}

/// Runs the command.
///
/// # Errors
/// Bad input, files that cannot be written.
pub(super) fn run(args: &RangeArgs) -> anyhow::Result<()> {
    let beside = args.histograms.with_file_name("frame.json");
    let file = args.frame.as_deref().unwrap_or(&beside);
    if !file.exists() {
        let message = "does not exist; give the frame.json that belongs to the counts with --frame";
        return Err(InputError::new(file.display(), message).into());
    }
    let taken = TakenFrame::read(file)?;
    let sensor = &taken.settings.sensor;
    let default = DepthOptions::default();
    let rate = args.false_alarm_rate.unwrap_or(default.false_alarm_rate);
    check_false_alarm_rate(rate, Spelling::Options)?;
    let options = DepthOptions {
        false_alarm_rate: rate,
        correct_walk: !args.no_walk_correction,
        ..default
    };
    let calibration = match &args.calibration {
        Some(path) => Some(read_calibration(path, sensor)?),
        None => None,
    };
    let shape = [sensor.rows, sensor.cols, sensor.bins];
    let counts = read_counts(&args.histograms, &shape)?;
    let chip = (sensor, &taken.settings.exposure);
    check_counts(args.histograms.display(), chip, &counts)?;
    let ranged = taken.range(&counts, &options, calibration.as_ref())?;
    if let Some(path) = &args.out {
        write_csv(path, sensor.cols, &ranged)?;
    }
    if args.json {
        let report = Report {
            summary: ranged.summary(),
            bin_m: ranged.bin_m,
            macropixels: &ranged.pixels,
        };
        return say_json(&report);
    }
    let mut table = Table::new(format!("Depths of {}", args.histograms.display()));
    quality::rows(&mut table, &options, &ranged.summary());
    Ok(say_unless_quiet(table)?)
}

/// Photons of an echo in a laser cycle, as frame.json has them. Of other detectors they are those of the whole histogram.
const PHOTONS: &str = "photons_per_cycle";

fn write_csv(path: &Path, cols: usize, ranged: &ArrayDepths) -> anyhow::Result<()> {
    OutputFile::write_with(path, |out| {
        write!(
            out,
            "row,col,start,true_m,guide_m,depth_m,bound_m,spread_m,{PHOTONS},confidence,no_depth"
        )?;
        write_further_head(out, PHOTONS)?;
        writeln!(out)?;
        for (at, pixel) in ranged.pixels.iter().enumerate() {
            write!(
                out,
                "{},{},{},{},{},{},{},{},{},{},{}",
                at / cols,
                at % cols,
                pixel.start.map_or(String::new(), |s| s.to_string()),
                number_text(pixel.true_m),
                number_text(pixel.guide_m),
                number_text(pixel.measured_m),
                number_text(pixel.bound_m),
                number_text(pixel.spread_m),
                number_text(pixel.returns.get(0).map(|first| first.photons)),
                number_text(pixel.confidence),
                pixel.no_depth.map_or("", |why| why.name()),
            )?;
            write_further(out, |n| {
                let further = pixel.returns.get(n)?;
                Some((further.depth_m, further.bound_m, further.photons))
            })?;
            writeln!(out)?;
        }
        Ok(())
    })?;
    Ok(())
}
