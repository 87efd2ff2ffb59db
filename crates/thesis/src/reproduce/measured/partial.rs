//! Partial histograms on the chip (thesis 2.5.2, 3.4, 6.4.2): zooming and sliding with the macropixel's own bins and counters.
//!
//! ```text
//!   sliding   guided mode, CLK of the measurement:  window 1, 2, 3, … up to the target, as many laser cycles in each as its far end needs
//!   zooming   conventional mode, CLK as slow as the coarse bins are long:  which bin before STOP is the fullest?
//!             then guided mode in that bin's window:                       the measurement
//! ```
//!
//! What is to be reached, which light a step reckons with and which bins it has to choose from are those of
//! [`theory::partial`](crate::theory::partial): a detection has the whole range in as many bins as lead up to the target, with
//! the echo in the last of them.
//!
//! HSLIDAR slides in the bins of its delay lines, too, as the demonstrator ran it (`delay_line`).

mod delay_line;
mod steps;

use std::sync::OnceLock;

use self::delay_line::OnDelayLines;
use self::steps::{Detection, FEWEST, Measurement, detecting, measuring};
use super::MeasuredStudy;
use super::interval_text;
use super::penalty::{ratio, sum};
use crate::chip::{Sensor, SensorConfig, hslidar};
use crate::engine::EngineError;
use crate::numerics::intervals::Estimate;
use crate::report::Grid;
use crate::reproduce::delay_line::calibrated as delay_line_calibration;
use crate::reproduce::parameters::{TABLE_15_KLUX, demonstrator, demonstrator_photons, long_range};
use crate::reproduce::thesis::measurement;
use crate::theory::partial::System;

/// Frames with which claims and figures are measured, half of a study's: a few seconds.
const FRAMES: usize = super::FRAMES / 2;

/// What the schemes take up to one range.
#[derive(Debug, Clone)]
pub(crate) struct AtRange {
    /// The range, m.
    pub range_m: f64,
    /// Zooming's detections, coarsest first.
    pub detections: Vec<Detection>,
    /// Laser cycles of the measurement: what a guided histogram takes, and zooming after its detections.
    pub guided: Estimate,
    /// That measurement.
    pub measurement: Measurement,
    /// Laser cycles of all windows of sliding.
    pub sliding: Estimate,
}

impl AtRange {
    /// Laser cycles of all detections.
    pub(crate) fn detecting(&self) -> Option<Estimate> {
        let cycles = self.detections.iter().map(|detection| detection.cycles);
        cycles.reduce(|a, b| Some(sum(&a?, &b?)))?
    }

    /// Laser cycles of zooming; `None` where a detection never succeeds.
    pub(crate) fn zooming(&self) -> Option<Estimate> {
        if self.detections.is_empty() {
            Some(self.guided)
        } else {
            Some(sum(&self.detecting()?, &self.guided))
        }
    }

    /// Those over the guided histogram's.
    pub(crate) fn penalty_of_zooming(&self) -> Option<Estimate> {
        self.detecting().map(|cycles| {
            let over = ratio(&cycles, &self.guided);
            over.map(|r| 1.0 + r)
        })
    }

    /// Those over the guided histogram's.
    pub(crate) fn penalty_of_sliding(&self) -> Estimate {
        ratio(&self.sliding, &self.guided)
    }
}

/// A system, the macropixel that runs it, and what was measured.
#[derive(Debug, Clone)]
pub(crate) struct OnChip {
    /// What is measured.
    pub name: &'static str,
    /// The reckoning that it is held against.
    pub system: System,
    /// Sliding's windows: end, m, and laser cycles.
    pub windows: Vec<(f64, Estimate)>,
    /// By range.
    pub ranges: Vec<AtRange>,
}

impl OnChip {
    /// What was measured at a range.
    pub(crate) fn result(&self, range_m: f64) -> &AtRange {
        let at = self.ranges.iter().find(|at| at.range_m == range_m);
        at.expect("a range that is measured")
    }

    fn measure(
        name: &'static str,
        system: System,
        sensor: &Sensor,
        ranges_m: &[f64],
        frames: usize,
    ) -> Result<Self, EngineError> {
        let farthest_m = ranges_m.iter().copied().fold(0.0, f64::max);
        let steps = system.sliding(farthest_m, 0).steps;
        let windows = steps.iter().map(|step| {
            Ok((
                step.range_m,
                measuring(&system, sensor, step, frames / 2)?.cycles,
            ))
        });
        let windows: Vec<(f64, Estimate)> = windows.collect::<Result<_, EngineError>>()?;
        let ranges = ranges_m.iter().map(|&range_m| {
            let visited = system.sliding(range_m, 0).steps.len();
            let cycles = windows[..visited].iter().map(|(_, cycles)| *cycles);
            let steps = system.zooming(range_m).steps;
            let detections = steps
                .iter()
                .filter_map(|step| detecting(&system, sensor, step, frames).transpose());
            let measurement = measuring(&system, sensor, &system.measure(range_m), 4 * frames)?;
            Ok(AtRange {
                range_m,
                measurement,
                detections: detections.collect::<Result<_, EngineError>>()?,
                guided: measurement.cycles,
                sliding: cycles.reduce(|a, b| sum(&a, &b)).expect("a window"),
            })
        });
        Ok(OnChip {
            name,
            ranges: ranges.collect::<Result<_, EngineError>>()?,
            windows,
            system,
        })
    }
}

/// Ranges at which the schemes are measured, m.
const LONG_RANGES_M: [f64; 4] = [50.0, 100.0, 150.0, 200.0];
const DEMONSTRATOR_RANGES_M: [f64; 3] = [24.0, 74.0, 75.0];

fn measure_both(frames: usize) -> Result<[OnChip; 2], EngineError> {
    let quantic4x4 = Sensor::default();
    let long = OnChip::measure(
        "QuantIC4x4, Table 6",
        long_range(),
        &quantic4x4,
        &LONG_RANGES_M,
        frames,
    )?;
    // Its delay line's bins as CLK periods of their mean length; its P-counter has no part in what is counted.
    let eight = SensorConfig {
        bins: hslidar().bins,
        bin_bits: hslidar().bin_bits,
        ..SensorConfig::clone(&quantic4x4)
    };
    let short = OnChip::measure(
        "HSLIDAR, Table 15",
        demonstrator(),
        &eight.into(),
        &DEMONSTRATOR_RANGES_M,
        frames,
    )?;
    Ok([long, short])
}

fn measured() -> &'static [OnChip; 2] {
    static MEASURED: OnceLock<[OnChip; 2]> = OnceLock::new();
    MEASURED.get_or_init(|| measure_both(FRAMES).expect("configurations that the engines run"))
}

/// The QuantIC4x4 in Table 6's light, up to 200 m. Measured once.
pub(crate) fn long_range_on_chip() -> &'static OnChip {
    &measured()[0]
}

/// HSLIDAR's macropixel in Table 15's light, up to 75 m. Measured once.
pub(crate) fn demonstrator_on_chip() -> &'static OnChip {
    &measured()[1]
}

/// Up to the same 75 m in HSLIDAR's delay-line bins, on the rows that claim 20 calibrates.
fn measure_on_delay_lines(frames: usize) -> Result<OnDelayLines, EngineError> {
    let range_m = DEMONSTRATOR_RANGES_M[2];
    OnDelayLines::measure(
        &demonstrator_photons(TABLE_15_KLUX),
        delay_line_calibration(),
        range_m,
        frames / 2,
    )
}

/// The same, measured once.
pub(crate) fn demonstrator_on_delay_lines() -> &'static OnDelayLines {
    static MEASURED: OnceLock<OnDelayLines> = OnceLock::new();
    MEASURED.get_or_init(|| measure_on_delay_lines(FRAMES).expect("what the engine runs"))
}

/// An estimate with its interval, for a remark.
pub(crate) fn with_interval(estimate: &Estimate, decimals: usize) -> String {
    format!(
        "{:.decimals$} ({})",
        estimate.value,
        interval_text(estimate, decimals)
    )
}

fn detections(all: &[OnChip]) -> Grid {
    let mut grid = measurement(4).grid(0);
    for (name, at) in each(all) {
        for detection in &at.detections {
            let mut cells = vec![
                format!(
                    "{name}, {} m: {} bins of {:.2} m",
                    at.range_m, detection.candidates, detection.bin_m
                ),
                format!("{:.0}", detection.reckoned),
                with_interval(&detection.found, 3),
                detection.frames.to_string(),
                estimate_text(detection.cycles, 0),
            ];
            cells.extend(detection.exposures.map(|n| n.to_string()));
            cells.extend(
                detection
                    .full
                    .map(|share| format!("{:.0} %", 100.0 * share)),
            );
            grid.push(cells);
        }
    }
    grid
}

fn schemes(all: &[OnChip], lines: &OnDelayLines) -> Grid {
    let mut grid = measurement(4).grid(1);
    for on_chip in all {
        let system = &on_chip.system;
        for at in &on_chip.ranges {
            let full = system.full(at.range_m).laser_cycles();
            let lines = [
                ("guided", full, Some(at.guided), None),
                (
                    "zooming",
                    system.zooming(at.range_m).laser_cycles(),
                    at.zooming(),
                    at.penalty_of_zooming(),
                ),
                (
                    "sliding",
                    system.sliding(at.range_m, 0).laser_cycles(),
                    Some(at.sliding),
                    Some(at.penalty_of_sliding()),
                ),
            ];
            for (scheme, reckoned, cycles, penalty) in lines {
                grid.push([
                    format!("{}, {} m, {scheme}", on_chip.name, at.range_m),
                    format!("{reckoned:.0}"),
                    estimate_text(cycles, 0),
                    format!("{:.2}", reckoned / full),
                    match scheme {
                        "guided" => "1".to_owned(),
                        _ => estimate_text(penalty, 2),
                    },
                    match scheme {
                        "guided" => with_interval(&at.measurement.found, 3),
                        _ => String::new(),
                    },
                ]);
            }
        }
    }
    let system = demonstrator_photons(TABLE_15_KLUX);
    let (name, range_m) = ("HSLIDAR, delay lines", lines.range_m);
    let full = system.full(range_m).laser_cycles();
    grid.push([
        format!("{name}, {range_m} m, guided"),
        format!("{full:.0}"),
        with_interval(&lines.guided.cycles, 0),
        "1.00".to_owned(),
        "1".to_owned(),
        with_interval(&lines.guided.found, 3),
    ]);
    grid.push([
        format!("{name}, {range_m} m, sliding"),
        format!("{:.0}", lines.reckoned),
        with_interval(&lines.sliding(), 0),
        format!("{:.2}", lines.reckoned / full),
        with_interval(&lines.penalty_of_sliding(), 2),
        String::new(),
    ]);
    grid
}

fn each(all: &[OnChip]) -> impl Iterator<Item = (&'static str, &AtRange)> {
    let ranges = |on_chip| {
        let OnChip { name, ranges, .. }: &OnChip = on_chip;
        ranges.iter().map(|at| (*name, at))
    };
    all.iter().flat_map(ranges)
}

fn estimate_text(estimate: Option<Estimate>, decimals: usize) -> String {
    estimate.map_or("never".to_owned(), |e| with_interval(&e, decimals))
}

/// The study.
///
/// # Errors
/// Configurations that no engine can run.
pub(crate) fn study(frames: usize) -> Result<MeasuredStudy, EngineError> {
    let all = measure_both(frames)?;
    let lines = measure_on_delay_lines(frames)?;
    let grids = [detections(&all), schemes(&all, &lines)];
    Ok(measurement(4).study(&[("frames", frames), ("fewest", FEWEST)], grids, None))
}
