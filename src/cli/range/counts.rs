//! `gdtof range` of any sensor's histograms: tables, arrays, and logs of evaluation kits.

use std::ops::Range;
use std::path::Path;

use rayon::prelude::*;
use serde::Serialize;

use super::args::RangeArgs;
use super::crosstalk;
use super::detector::{check_within, described_detector, description};
use super::returns::{number_text, write_further, write_further_head};
use crate::cli::settings::note_unusual;
use crate::cli::voice::{note, say_json, say_unless_quiet};
use crate::files::{HistogramFormat, InputError, OutputFile, ZoneCounts, ZoneHistograms};
use crate::ranging::{DepthOptions, DetectedReturn, Detector, NoReturn, WalkLeft};
use crate::report::Table;
use crate::request::{Spelling, check_false_alarm_rate};
use crate::system::median;
use crate::units::SPEED_OF_LIGHT_M_PER_S;

/// Counts that two histograms do not share by chance.
const TOO_MANY_FOR_CHANCE: u64 = 200;

/// A zone of a capture.
#[derive(Serialize)]
struct Zone {
    capture: usize,
    zone: usize,
    /// The clearest first.
    returns: Vec<DetectedReturn>,
    #[serde(skip_serializing_if = "Option::is_none")]
    no_depth: Option<NoReturn>,
    /// What the sensor itself made of it, m.
    #[serde(skip_serializing_if = "Option::is_none")]
    sensor_m: Option<f64>,
}

/// Runs the command.
///
/// # Errors
/// Bad input, files that cannot be written.
pub(super) fn run(args: &RangeArgs, format: HistogramFormat) -> anyhow::Result<()> {
    let default = DepthOptions::default();
    let rate = args.false_alarm_rate.unwrap_or(default.false_alarm_rate);
    check_false_alarm_rate(rate, Spelling::Options)?;
    let options = DepthOptions {
        false_alarm_rate: rate,
        correct_walk: !args.no_walk_correction,
        ..default
    };
    if let Some(per_unit) = args.counts_per_unit {
        check_within("--counts-per-unit", per_unit, (1e-9, 1e9))?;
    }
    let kept = args.bins.as_deref().map(bins).transpose()?;
    let described = description(args)?;
    let mut histograms = ZoneHistograms::read(&args.histograms, format, args.counts_per_unit)?;
    let whole = described_detector(args, &described, histograms.bins)?;
    note_unusual("the detector", &described.remarks());
    let kept = kept.unwrap_or(0..histograms.bins);
    if kept.end > histograms.bins {
        let message = format!(
            "ends at bin {}, and {} has bins 0 to {}; give bins that it has",
            kept.end - 1,
            args.histograms.display(),
            histograms.bins - 1
        );
        return Err(InputError::new("--bins", message).into());
    }
    histograms.keep_bins(kept.clone());
    if histograms.cut_short > 0 {
        let (cut, all) = (histograms.cut_short, histograms.captures.len());
        note(format_args!(
            "{cut} captures without all histograms are left out, {all} are whole"
        ));
    }
    let repeated = repeated(&histograms);
    if repeated > 0 {
        let all = histograms.histograms().count();
        note(format_args!(
            "{repeated} of {all} zones have the counts of the zone before them, each of which has {TOO_MANY_FOR_CHANCE} or more; the logger may have repeated one zone"
        ));
    }
    let has_start = whole.has_start;
    let detectors = (histograms.captures.iter().enumerate())
        .map(|(number, capture)| {
            let begins_s = if has_start {
                0.0
            } else {
                begins_s(args, &whole.detector, (number, capture))?
            };
            Ok(whole.detector.later(begins_s).with_bins(kept.clone()))
        })
        .collect::<Result<Vec<Detector>, InputError>>()?;
    let glass = match &args.crosstalk {
        Some(source) => crosstalk::light(args, (source, format), (&histograms, kept), &detectors)?,
        None => Vec::new(),
    };
    let zones: Vec<Zone> = (histograms.captures.par_iter().zip(&detectors).enumerate())
        .map(|(number, (capture, detector))| {
            range(args, (detector, &glass), &options, (number, capture))
        })
        .collect::<Result<Vec<Vec<Zone>>, InputError>>()?
        .into_iter()
        .flatten()
        .collect();
    if let Some(detector) = detectors.first()
        && let Some(remark) = detector.remark_on_echoes(histograms.histograms())
    {
        note(remark);
    }
    if let Some(path) = &args.out {
        write_csv(path, &zones)?;
    }
    if args.json {
        return say_json(&serde_json::json!({ "zones": zones }));
    }
    let mut table = table(args, detectors.first(), &zones);
    if args.crosstalk.is_some() {
        let lit = glass.iter().filter(|light| !light.is_empty()).count();
        let row = format!("{lit} of {}", glass.len());
        table.push("zones with light of a cover glass", row);
    }
    Ok(say_unless_quiet(table)?)
}

/// Zones whose histogram is that of the zone before them.
fn repeated(histograms: &ZoneHistograms) -> usize {
    let of_capture = |capture: &ZoneCounts| {
        let zones: Vec<&[u32]> = capture.counts.chunks_exact(histograms.bins).collect();
        let is_repeated = |pair: &&[&[u32]]| {
            pair[0] == pair[1]
                && pair[0].iter().map(|&n| u64::from(n)).sum::<u64>() >= TOO_MANY_FOR_CHANCE
        };
        zones.windows(2).filter(is_repeated).count()
    };
    histograms.captures.iter().map(of_capture).sum()
}

/// The zones of one capture.
fn range(
    args: &RangeArgs,
    (detector, glass): (&Detector, &[Vec<f64>]),
    options: &DepthOptions,
    (number, capture): (usize, &ZoneCounts),
) -> Result<Vec<Zone>, InputError> {
    let range_zone = |(zone, counts): (usize, &[u32])| {
        let crosstalk = glass.get(zone).cloned().unwrap_or_default();
        let detector = Detector {
            crosstalk,
            ..detector.clone()
        };
        detector.check(counts).map_err(|error| {
            let message = format!("zone {zone} {error}; correct the description of the detector");
            InputError::new(args.histograms.display(), message)
        })?;
        let found = detector.returns(counts, options);
        Ok(Zone {
            capture: number,
            zone,
            no_depth: found.as_ref().err().copied(),
            returns: found.unwrap_or_default(),
            sensor_m: capture.own_depths_m.get(zone).copied().flatten(),
        })
    };
    let zones = capture.counts.par_chunks_exact(detector.bins());
    zones.enumerate().map(range_zone).collect()
}

/// When bin 0 begins after the laser pulse has left, as the reference histogram of a capture shows; 0 without one.
fn begins_s(
    args: &RangeArgs,
    detector: &Detector,
    (number, capture): (usize, &ZoneCounts),
) -> Result<f64, InputError> {
    let Some(reference) = &capture.reference else {
        return Ok(0.0);
    };
    let complain = |what: String| {
        let message = format!("capture {number} has {what}; say when bin 0 begins with --start-ns");
        InputError::new(args.histograms.display(), message)
    };
    if reference.len() != detector.bins() {
        let (bins, zones) = (reference.len(), detector.bins());
        let what = format!("a reference histogram of {bins} bins beside zones of {zones}");
        return Err(complain(what));
    }
    let begins_s = detector.begins_after_reference_s(reference);
    begins_s.ok_or_else(|| complain("no pulse in its reference histogram".into()))
}

/// The bins of `4-50`, both of them included.
fn bins(text: &str) -> Result<Range<usize>, InputError> {
    let ends = text.split_once('-');
    let ends = ends.and_then(|(a, b)| Some((a.parse().ok()?, b.parse::<usize>().ok()?)));
    match ends {
        Some((first, last)) if first < last && last < usize::MAX => Ok(first..last + 1),
        _ => {
            let message =
                format!("`{text}` is no range of bins; give the first and the last, as in 4-50");
            Err(InputError::new("--bins", message))
        }
    }
}

fn table(args: &RangeArgs, detector: Option<&Detector>, zones: &[Zone]) -> Table {
    let mut table = Table::new(format!("Depths of {}", args.histograms.display()));
    let all = zones.len();
    let firsts: Vec<&DetectedReturn> = zones.iter().filter_map(|z| z.returns.first()).collect();
    if let Some(detector) = detector {
        let ends_s = [detector.edges_s[0], detector.edges_s[detector.bins()]];
        let [from_m, until_m] = ends_s.map(|s| 0.5 * SPEED_OF_LIGHT_M_PER_S * s);
        let bins = detector.bins();
        table.push(
            "bins of a zone",
            format!("{bins}, from {from_m:.2} to {until_m:.2} m"),
        );
    }
    let captures = zones.last().map_or(0, |zone| 1 + zone.capture);
    if captures > 1 {
        table.push("captures", captures.to_string());
    }
    table.push("zones with a depth", format!("{} of {all}", firsts.len()));
    let metres = |value: Option<f64>| value.map_or("-".to_owned(), |m| format!("{m:.4} m"));
    let depths = firsts.iter().map(|first| first.depth_m);
    table.push("median depth", metres(median(depths)));
    let bounds = firsts.iter().filter_map(|first| first.bound_m);
    table.push(
        "median bound, one standard deviation",
        metres(median(bounds)),
    );
    for why in WalkLeft::ALL {
        let count = (firsts.iter().filter(|first| first.bound_m.is_none()))
            .filter(|first| first.no_bound == Some(why))
            .count();
        if count > 0 {
            let name = format!("zones without a bound: {}", why.name());
            table.push(name, format!("{count} of {all}"));
        }
    }
    let further = zones.iter().filter(|zone| zone.returns.len() > 1).count();
    table.push("zones with further returns", format!("{further} of {all}"));
    let beside: Vec<f64> = (zones.iter())
        .filter_map(|zone| Some(zone.returns.first()?.depth_m - zone.sensor_m?))
        .collect();
    if !beside.is_empty() {
        let count = beside.len();
        let name = format!("median depth less the sensor's own, {count} zones that have both");
        table.push(name, metres(median(beside.into_iter())));
    }
    for why in NoReturn::ALL {
        let count = zones
            .iter()
            .filter(|zone| zone.no_depth == Some(why))
            .count();
        if count > 0 {
            table.push(
                format!("zones without a depth: {why}"),
                format!("{count} of {all}"),
            );
        }
    }
    table
}

fn write_csv(path: &Path, zones: &[Zone]) -> Result<(), InputError> {
    OutputFile::write_with(path, |out| {
        write!(
            out,
            "capture,zone,depth_m,bound_m,no_bound,spread_m,photons,confidence,no_depth,sensor_m"
        )?;
        write_further_head(out, "photons")?;
        writeln!(out)?;
        for zone in zones {
            let first = zone.returns.first();
            write!(
                out,
                "{},{},{},{},{},{},{},{},{},{}",
                zone.capture,
                zone.zone,
                number_text(first.map(|of| of.depth_m)),
                number_text(first.and_then(|of| of.bound_m)),
                first.and_then(|of| of.no_bound).map_or("", WalkLeft::name),
                number_text(first.and_then(|of| of.spread_m)),
                number_text(first.map(|of| of.photons)),
                number_text(first.map(|of| of.confidence)),
                zone.no_depth.map_or(String::new(), |why| why.to_string()),
                number_text(zone.sensor_m),
            )?;
            let returns = &zone.returns;
            write_further(out, |n| {
                let further = returns.get(n)?;
                Some((further.depth_m, further.bound_m, further.photons))
            })?;
            writeln!(out)?;
        }
        Ok(())
    })
}
