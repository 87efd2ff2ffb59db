//! `gdtof range --format counts`: depths from the histograms of any sensor. No chip of ours is pretended.

use std::path::Path;

use rayon::prelude::*;
use serde::Serialize;

use super::args::{Counts, RangeArgs};
use crate::cli::voice::{say_json, tell};
use crate::files::{Histograms, InputError, OutputFile};
use crate::ranging::{Counted, DepthOptions, DetectedReturn, Detector, NoReturn};
use crate::report::Table;
use crate::request::{Spelling, check_false_alarm_rate};

/// Full width at half maximum of a Gaussian over its standard deviation.
const FWHM_PER_SIGMA: f64 = 2.354_820_045;

/// Returns that a table has columns for.
const RETURNS: usize = 4;

type Found = Result<Vec<DetectedReturn>, NoReturn>;

/// What is printed with `--json` of a zone.
#[derive(Serialize)]
struct Zone {
    returns: Vec<ZoneReturn>,
    #[serde(skip_serializing_if = "Option::is_none")]
    no_depth: Option<String>,
}

#[derive(Serialize)]
struct ZoneReturn {
    depth_m: f64,
    bound_m: Option<f64>,
    spread_m: Option<f64>,
    photons: f64,
    confidence: f64,
}

/// Runs the command.
///
/// # Errors
/// Bad input, files that cannot be written.
pub(super) fn run(args: &RangeArgs) -> anyhow::Result<()> {
    let rate = args
        .false_alarm_rate
        .unwrap_or(DepthOptions::default().false_alarm_rate);
    check_false_alarm_rate(rate, Spelling::Options)?;
    let options = DepthOptions {
        false_alarm_rate: rate,
        correct_walk: !args.no_walk_correction,
        ..DepthOptions::default()
    };
    let histograms = Histograms::read(&args.histograms)?;
    let detector = detector(args, histograms.bins)?;
    for (zone, counts) in histograms.zones().enumerate() {
        detector.check(counts).map_err(|error| {
            let message = format!("zone {zone} {error}; give more --laser-cycles, or --counts every");
            InputError::new(args.histograms.display(), message)
        })?;
    }
    let zones: Vec<&[u32]> = histograms.zones().collect();
    let found: Vec<Found> = zones
        .par_iter()
        .map(|counts| detector.returns(counts, &options))
        .collect();
    if let Some(path) = &args.out {
        write_csv(path, &found)?;
    }
    if args.json {
        let zones: Vec<Zone> = found.iter().map(as_json).collect();
        return say_json(&serde_json::json!({ "zones": zones }));
    }
    Ok(tell(table(args, &found))?)
}

/// The detector of the options, all of which are checked.
fn detector(args: &RangeArgs, bins: usize) -> Result<Detector, InputError> {
    let needed = |option: &str, value: Option<f64>| {
        value.ok_or_else(|| InputError::new(option, "is needed with --format counts; give it"))
    };
    let within = |option: &str, value: f64, least: f64, most: f64| {
        if (least..=most).contains(&value) {
            return Ok(value);
        }
        let message = format!("{value} is impossible; give {least} to {most}");
        Err(InputError::new(option, message))
    };
    let bin_ns = needed("--bin-width-ns", args.bin_width_ns)?;
    let bin_ns = within("--bin-width-ns", bin_ns, 1e-3, 1e6)?;
    let fwhm_ns = needed("--pulse-fwhm-ns", args.pulse_fwhm_ns)?;
    let fwhm_ns = within("--pulse-fwhm-ns", fwhm_ns, 0.0, 1e6)?;
    let begins_ns = within("--start-ns", args.start_ns.unwrap_or(0.0), -1e9, 1e9)?;
    let laser_cycles = needed("--laser-cycles", args.laser_cycles.map(f64::from))? as u32;
    if laser_cycles == 0 {
        return Err(InputError::new("--laser-cycles", "0 is impossible; give 1 or more"));
    }
    if fwhm_ns > 0.5 * bin_ns * bins as f64 {
        let message = format!(
            "{fwhm_ns} is more than half of a histogram of {bins} bins of {bin_ns} ns; give the width of the laser pulse"
        );
        return Err(InputError::new("--pulse-fwhm-ns", message));
    }
    Ok(Detector {
        bins,
        bin_s: 1e-9 * bin_ns,
        begins_s: 1e-9 * begins_ns,
        laser_cycles,
        pulse_sigma_s: 1e-9 * fwhm_ns / FWHM_PER_SIGMA,
        counted: match args.counts.unwrap_or(Counts::Every) {
            Counts::Every => Counted::EveryPhoton,
            Counts::First => Counted::FirstPhoton,
        },
    })
}

fn as_json(found: &Found) -> Zone {
    let as_return = |of: &DetectedReturn| ZoneReturn {
        depth_m: of.depth_m,
        bound_m: of.bound_m,
        spread_m: of.spread_m,
        photons: of.photons,
        confidence: of.confidence,
    };
    match found {
        Ok(returns) => Zone {
            returns: returns.iter().map(as_return).collect(),
            no_depth: None,
        },
        Err(why) => Zone {
            returns: Vec::new(),
            no_depth: Some(why.to_string()),
        },
    }
}

fn table(args: &RangeArgs, found: &[Found]) -> Table {
    let mut table = Table::new(format!("Depths of {}", args.histograms.display()));
    let all = found.len();
    let firsts: Vec<&DetectedReturn> = found.iter().flatten().filter_map(|of| of.first()).collect();
    table.push("zones with a depth", format!("{} of {all}", firsts.len()));
    let median = |mut values: Vec<f64>| {
        values.sort_by(f64::total_cmp);
        values.get(values.len() / 2).copied()
    };
    let metres = |value: Option<f64>| value.map_or("-".to_owned(), |m| format!("{m:.4} m"));
    let depths = firsts.iter().map(|first| first.depth_m).collect();
    table.push("median depth", metres(median(depths)));
    let bounds = firsts.iter().filter_map(|first| first.bound_m).collect();
    table.push("median bound, one standard deviation", metres(median(bounds)));
    let further = found.iter().flatten().filter(|of| of.len() > 1).count();
    table.push("zones with further returns", format!("{further} of {all}"));
    for why in [
        NoReturn::NoSignificantPeak,
        NoReturn::Saturated,
        NoReturn::BehindSensor,
    ] {
        let count = found.iter().filter(|of| **of == Err(why)).count();
        if count > 0 {
            table.push(format!("zones without a depth: {why}"), format!("{count} of {all}"));
        }
    }
    table
}

fn write_csv(path: &Path, found: &[Found]) -> Result<(), InputError> {
    let shown = |value: Option<f64>| value.map_or(String::new(), |v| format!("{v:.6}"));
    OutputFile::write_with(path, |out| {
        write!(out, "zone,depth_m,bound_m,spread_m,photons,confidence,no_depth")?;
        for n in 2..=RETURNS {
            write!(out, ",depth_{n}_m,bound_{n}_m,photons_{n}")?;
        }
        writeln!(out)?;
        for (zone, found) in found.iter().enumerate() {
            let returns = found.as_deref().unwrap_or_default();
            let first = returns.first();
            write!(
                out,
                "{zone},{},{},{},{},{},{}",
                shown(first.map(|of| of.depth_m)),
                shown(first.and_then(|of| of.bound_m)),
                shown(first.and_then(|of| of.spread_m)),
                shown(first.map(|of| of.photons)),
                shown(first.map(|of| of.confidence)),
                found.as_ref().err().map_or(String::new(), NoReturn::to_string),
            )?;
            for n in 1..RETURNS {
                let further = returns.get(n);
                write!(
                    out,
                    ",{},{},{}",
                    shown(further.map(|of| of.depth_m)),
                    shown(further.and_then(|of| of.bound_m)),
                    shown(further.map(|of| of.photons)),
                )?;
            }
            writeln!(out)?;
        }
        Ok(())
    })
}
