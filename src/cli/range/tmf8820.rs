//! `gdtof range --format tmf8820`: depths from a real sensor's histograms, beside those it computed itself.
//!
//! Without true distances there are depths alone, and a calibration must be given. Without depths of the sensor, as where it gives 0
//! everywhere, there is nothing beside.

use serde::Serialize;

use super::args::{Fit, RangeArgs};
use super::returns::number_text;
use crate::cli::voice::{say_json, say_unless_quiet};
use crate::files::{InputError, OutputFile, other_kind, parse_json, read_text};
use crate::ranging::tmf8820::{self, Capture};
use crate::ranging::{ArrivalOptions, Calibration, ZoneEcho, arrival};
use crate::report::Grid;
use crate::system::median;

/// Fewest counts above background that are taken for a pulse.
const LEAST_SIGNAL: f64 = 100.0;

/// One zone of one capture that sees the plane.
struct Sighting {
    capture: usize,
    echo: ZoneEcho,
    true_m: Option<f64>,
    sensor_m: Option<f64>,
}

/// Readings, a zone of a capture each, that no depth is taken from, by the first cause.
#[derive(Default, Serialize)]
struct LeftOut {
    /// The capture's reference histogram has no pulse to count from.
    no_reference_pulse: usize,
    /// The sensor itself reports no target.
    no_target_reported: usize,
    /// The histogram has no pulse of [`LEAST_SIGNAL`] counts.
    no_pulse: usize,
}

impl LeftOut {
    fn causes(&self) -> [(usize, String); 3] {
        [
            (
                self.no_reference_pulse,
                "whose capture has no pulse in its reference histogram".into(),
            ),
            (
                self.no_target_reported,
                "where the sensor reports no target".into(),
            ),
            (
                self.no_pulse,
                format!("without a pulse of {LEAST_SIGNAL} counts above background"),
            ),
        ]
    }

    fn all(&self) -> usize {
        self.causes().iter().map(|(count, _)| count).sum()
    }
}

/// Every zone that sees the plane: the sensor reports a target there if it does anywhere, and there is a pulse. Both criteria are
/// about the same zones, so that the two depths are compared on equal terms.
fn sightings(captures: &[Capture]) -> (Vec<Sighting>, LeftOut) {
    let options = ArrivalOptions::default();
    let mut found = Vec::new();
    let mut left_out = LeftOut::default();
    let reports = |capture: &Capture| capture.on_chip_depths_mm.iter().any(|&mm| mm > 0.0);
    let sensor_reports = captures.iter().any(reports);
    for (index, capture) in captures.iter().enumerate() {
        let Some(reference) = arrival(&capture.reference_hist, &options) else {
            left_out.no_reference_pulse += capture.hists.len();
            continue;
        };
        for (zone, counts) in capture.hists.iter().enumerate() {
            let sensor_mm = capture.on_chip_depths_mm.get(zone).filter(|mm| **mm > 0.0);
            if sensor_reports && sensor_mm.is_none() {
                left_out.no_target_reported += 1;
                continue;
            }
            let pulse = arrival(counts, &options).filter(|p| p.signal_counts >= LEAST_SIGNAL);
            let Some(pulse) = pulse else {
                left_out.no_pulse += 1;
                continue;
            };
            found.push(Sighting {
                capture: index,
                echo: ZoneEcho {
                    zone,
                    arrival_bins: pulse.position_bins - reference.position_bins,
                    signal_counts: pulse.signal_counts,
                },
                true_m: capture.dist_to_plane_m,
                sensor_m: sensor_mm.map(|mm| 1e-3 * mm),
            });
        }
    }
    (found, left_out)
}

/// Is each capture one to fit on?
fn fitted_on(captures: &[Capture], fit: Fit) -> Vec<bool> {
    let mut order: Vec<usize> = (0..captures.len()).collect();
    order.sort_by(|&a, &b| {
        let distance = |i: usize| captures[i].dist_to_plane_m.unwrap_or(0.0);
        distance(a).total_cmp(&distance(b))
    });
    let mut fitted = vec![false; captures.len()];
    for (rank, &index) in order.iter().enumerate() {
        fitted[index] = match fit {
            Fit::Even => index % 2 == 0,
            Fit::Odd => index % 2 == 1,
            Fit::Near => 2 * rank < captures.len(),
            Fit::Far => 2 * rank >= captures.len(),
        };
    }
    fitted
}

fn calibrate(
    args: &RangeArgs,
    zones: usize,
    sightings: &[&Sighting],
) -> Result<Calibration, InputError> {
    let known = sightings.iter().filter_map(|s| Some((s.echo, s.true_m?)));
    let known: Vec<(ZoneEcho, f64)> = known.collect();
    Calibration::fit(zones, &known).map_err(|error| {
        let message = format!("{error}; calibrate on other or more captures (--fit)");
        InputError::new(args.histograms.display(), message)
    })
}

fn read_calibration(path: &std::path::Path, zones: usize) -> Result<Calibration, InputError> {
    let wanted = "a file made by --save-calibration";
    let calibration: Calibration = parse_json(path.display(), &read_text(path)?, wanted)?;
    if calibration.zones.len() == zones {
        return Ok(calibration);
    }
    let message = format!(
        "is for {} zones, not {zones}; give the calibration of this sensor",
        calibration.zones.len()
    );
    Err(InputError::new(path.display(), message))
}

/// Errors of one set of depths.
#[derive(Serialize)]
struct Errors {
    rms_mm: f64,
    mean_mm: f64,
    largest_mm: f64,
}

impl Errors {
    /// `None` without any.
    fn new(errors_m: impl Iterator<Item = f64>) -> Option<Self> {
        let (mut n, mut sum, mut squares, mut largest) = (0.0, 0.0, 0.0, 0f64);
        for error in errors_m {
            n += 1.0;
            sum += error;
            squares += error * error;
            largest = largest.max(error.abs());
        }
        (n > 0.0).then(|| Errors {
            rms_mm: 1e3 * f64::sqrt(squares / n),
            mean_mm: 1e3 * sum / n,
            largest_mm: 1e3 * largest,
        })
    }

    fn row(&self, name: &str) -> [String; 4] {
        let mm = |value: f64| format!("{value:.2}");
        [
            name.into(),
            mm(self.rms_mm),
            mm(self.mean_mm),
            mm(self.largest_mm),
        ]
    }
}

/// What is printed.
#[derive(Serialize)]
struct Report {
    captures: usize,
    zones: usize,
    /// Zones that see the plane, in all captures.
    sightings: usize,
    /// The other readings of all captures.
    left_out: LeftOut,
    /// Those that errors are about.
    reported: usize,
    fit: Option<Fit>,
    calibration: Calibration,
    /// Median of all depths that are reported, m.
    median_m: f64,
    /// Of depths whose truth is known.
    depths: Option<Errors>,
    /// The sensor's own depths as it gives them.
    sensor: Option<Errors>,
    /// The sensor's own depths after a straight line for every zone, fitted on the same captures as ours.
    sensor_refitted: Option<Errors>,
}

/// Runs the command.
///
/// # Errors
/// Bad input, files that cannot be written.
pub(super) fn run(args: &RangeArgs) -> anyhow::Result<()> {
    let fit = args.fit.unwrap_or(Fit::Even);
    let name_kind = |error| other_kind(&args.histograms, "tmf8820").unwrap_or(error);
    let captures = tmf8820::read(&args.histograms).map_err(name_kind)?;
    let zones = captures[0].hists.len();
    let without_truth = captures
        .iter()
        .find(|capture| capture.dist_to_plane_m.is_none());
    if let (None, Some(capture)) = (&args.calibration, without_truth) {
        let message = format!(
            "capture {} has no dist_to_plane_m to calibrate on; give it in metres, or a calibration with --calibration",
            capture.capture
        );
        return Err(InputError::new(args.histograms.display(), message).into());
    }
    let (sightings, left_out) = sightings(&captures);
    let on = match args.calibration {
        Some(_) => vec![false; captures.len()],
        None => fitted_on(&captures, fit),
    };
    let (fitted, reported): (Vec<_>, Vec<_>) = sightings.iter().partition(|s| on[s.capture]);
    if reported.is_empty() {
        let message = "no zone of the captures to report on sees the plane; give more captures";
        return Err(InputError::new(args.histograms.display(), message).into());
    }
    let calibration = match &args.calibration {
        Some(path) => read_calibration(path, zones)?,
        None => calibrate(args, zones, &fitted)?,
    };
    let sensor_refitted = match args.calibration {
        Some(_) => None,
        None => {
            // Counts left out: the sensor has had them, and says nothing of a walk that is left.
            let own = |s: &Sighting| {
                let echo = ZoneEcho {
                    zone: s.echo.zone,
                    arrival_bins: s.sensor_m?,
                    signal_counts: 0.0,
                };
                Some((echo, s.true_m?))
            };
            let known: Vec<(ZoneEcho, f64)> = fitted.iter().filter_map(|s| own(s)).collect();
            let line = Calibration::fit(zones, &known).ok();
            line.and_then(|line| {
                let known = reported.iter().filter_map(|s| own(s));
                Errors::new(known.map(|(echo, true_m)| line.depth_m(&echo) - true_m))
            })
        }
    };
    let depth = |s: &Sighting| calibration.depth_m(&s.echo);
    let mut files = Vec::new();
    if let Some(path) = &args.save_calibration {
        files.push(OutputFile::prepared(path, |out| {
            serde_json::to_writer_pretty(&mut *out, &calibration)?;
            writeln!(out)
        })?);
    }
    if let Some(path) = &args.out {
        files.push(OutputFile::prepared(path, |out| {
            writeln!(out, "capture,zone,true_m,depth_m,sensor_m")?;
            for s in &reported {
                let (capture, zone) = (captures[s.capture].capture, s.echo.zone);
                let (true_m, depth_m) = (number_text(s.true_m), depth(s));
                let sensor_m = number_text(s.sensor_m);
                writeln!(out, "{capture},{zone},{true_m},{depth_m:.6},{sensor_m}")?;
            }
            Ok(())
        })?);
    }
    files.into_iter().try_for_each(OutputFile::commit)?;
    let report = Report {
        captures: captures.len(),
        zones,
        sightings: sightings.len(),
        left_out,
        reported: reported.len(),
        fit: args.calibration.is_none().then_some(fit),
        median_m: median(reported.iter().map(|s| depth(s))).unwrap_or(f64::NAN),
        depths: Errors::new(reported.iter().filter_map(|s| Some(depth(s) - s.true_m?))),
        sensor: Errors::new(
            reported
                .iter()
                .filter_map(|s| Some(s.sensor_m? - s.true_m?)),
        ),
        sensor_refitted,
        calibration,
    };
    if args.json {
        return say_json(&report);
    }
    say_unless_quiet(table(&report))?;
    Ok(())
}

fn table(report: &Report) -> String {
    let mut errors = Grid::headed("depth to the plane | RMS (mm) | mean (mm) | largest (mm)");
    for (name, of) in [
        ("gdtof", &report.depths),
        ("the sensor's own", &report.sensor),
        (
            "the sensor's own, a line fitted to each zone",
            &report.sensor_refitted,
        ),
    ] {
        if let Some(of) = of {
            errors.push(of.row(name));
        }
    }
    let errors = if report.depths.is_some() {
        errors.to_string()
    } else {
        format!(
            "true distances are not known; the median depth is {:.4} m\n",
            report.median_m
        )
    };
    let mut lines = Grid::new(["zone", "mm a bin", "offset (mm)"]);
    for (zone, line) in report.calibration.zones.iter().enumerate() {
        lines.push([
            zone.to_string(),
            format!("{:.3}", 1e3 * line.scale_m),
            format!("{:.2}", 1e3 * line.offset_m),
        ]);
    }
    let mut left_out = format!(
        "{} of {} readings are left out\n",
        report.left_out.all(),
        report.captures * report.zones
    );
    for (count, cause) in report.left_out.causes() {
        if count > 0 {
            left_out += &format!("  {count} {cause}\n");
        }
    }
    format!(
        "{} captures of {} zones; {} times a zone sees the plane, {} of them reported here\n{left_out}\n{errors}\n{lines}walk {:.3} mm for a million counts\n",
        report.captures,
        report.zones,
        report.sightings,
        report.reported,
        1e9 * report.calibration.walk_m_per_count,
    )
}
