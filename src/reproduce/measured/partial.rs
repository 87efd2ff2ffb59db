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
//! Detections are run with the laser cycles that the thesis reckons with, split into as many exposures as the counters need,
//! whose counts are added off the chip. How often the echo's bin wins is the measured P_D, with Wilson's interval. From the same
//! counts follow the laser cycles that the chip would need: a bin adds one hit a laser cycle at most, and laser cycles are
//! independent, so that counts are binomial, and P_D follows from the two chances of a hit. Measurements scale by the spread
//! of maximum-likelihood times, which falls with the square root of the laser cycles. Frames that take a peak of the background
//! for the echo have no part in it, and are counted apart.

use std::sync::OnceLock;

use super::Study;
use super::detection::judged;
use super::interval_text;
use super::penalty::{ratio, sum};
use super::precision::{Estimator, errors_ns};
use super::trial::Trial;
use crate::chip::{Mode, SensorConfig, hslidar};
use crate::engine::EngineError;
use crate::numerics::intervals::{Estimate, Z_95, deviation, share};
use crate::numerics::{ln_normal_below, normal_density};
use crate::report::Grid;
use crate::reproduce::penalty::{demonstrator, long_range};
use crate::theory::partial::{Purpose, Step, System, largest_mean};
use crate::units::SPEED_OF_LIGHT_M_PER_S;

/// Photons that all frames of a detection take together at 300 frames: about half a second on one core.
const PHOTONS: f64 = 1e7;

/// Frames of a detection, at least, whatever they cost.
const FEWEST: usize = 16;

/// Frames with which claims and figures are measured, half of a study's: a few seconds.
const FRAMES: usize = super::FRAMES / 2;

/// Errors within so many times the wanted spread are those of the echo's peak; others took one of the background for it.
/// Chosen: a Gaussian error of that spread is farther off one time in a million.
const OF_THE_ECHO: f64 = 5.0;

/// Laser cycles of an exposure at least, so that a spread means something where very few are needed.
const FEWEST_CYCLES: f64 = 20.0;

/// A detection among coarse bins.
#[derive(Debug, Clone)]
pub(crate) struct Detection {
    /// Bins to choose from, and how long each is, m.
    pub candidates: u32,
    /// See `candidates`.
    pub bin_m: f64,
    /// Laser cycles that the thesis reckons with.
    pub reckoned: f64,
    /// P_D of the chip in as many.
    pub found: Estimate,
    /// Frames behind it.
    pub frames: usize,
    /// Laser cycles of the chip; `None` where no number is seen to be enough.
    pub cycles: Option<Estimate>,
    /// Exposures into which `reckoned` is split, so that counters of 12 and 14 bits hold them.
    pub exposures: [u32; 2],
    /// Share of single exposures of `reckoned` laser cycles in which a bin of 12 or 14 bits is full.
    pub full: [f64; 2],
}

/// A measurement in a window.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Measurement {
    /// Laser cycles for the wanted spread of those frames that measure the echo.
    pub cycles: Estimate,
    /// Their share in the laser cycles that are reckoned with.
    pub found: Estimate,
    /// Frames behind it.
    pub frames: usize,
}

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
        match self.detections.is_empty() {
            true => Some(self.guided),
            false => Some(sum(&self.detecting()?, &self.guided)),
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
    pub(crate) fn at(&self, range_m: f64) -> &AtRange {
        let at = self.ranges.iter().find(|at| at.range_m == range_m);
        at.expect("a range that is measured")
    }

    fn measure(
        name: &'static str,
        system: System,
        sensor: &SensorConfig,
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
    let quantic4x4 = SensorConfig::default();
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
        ..quantic4x4
    };
    let short = OnChip::measure(
        "HSLIDAR, Table 15",
        demonstrator(),
        &eight,
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

/// Photon light at a range, on this macropixel.
fn lit(system: &System, sensor: &SensorConfig, range_m: f64, cycles: u32) -> Trial {
    let signal = system.link.signal / (range_m * range_m);
    let base = Trial::new(signal, system.link.background_hz, cycles);
    Trial {
        sensor: sensor.clone(),
        sigma_ns: 1e9 * system.link.pulse_sigma_s,
        ..base
    }
}

/// Seeds of a step that nothing else has.
fn seed(step: &Step) -> u64 {
    (1e4 * step.range_m) as u64 * 100
}

/// A measurement on the guided chip, the echo in mid-window.
fn measuring(
    system: &System,
    sensor: &SensorConfig,
    step: &Step,
    frames: usize,
) -> Result<Measurement, EngineError> {
    let wanted_ns = 2e9 * system.goal.precision_m / SPEED_OF_LIGHT_M_PER_S;
    let cycles = step.laser_cycles.max(FEWEST_CYCLES) as u32;
    let mut trial = lit(system, sensor, step.range_m, cycles);
    trial.sensor.clk_hz = 1.0 / system.bin_s;
    trial.echo_bins = f64::from(system.bins / 2);
    let all = errors_ns(&trial, frames, seed(step) + 1, Estimator::Likelihood)?;
    let of_the_echo = all.iter().filter(|e| e.abs() <= OF_THE_ECHO * wanted_ns);
    let of_the_echo: Vec<f64> = of_the_echo.copied().collect();
    let spread = deviation(&of_the_echo);
    Ok(Measurement {
        cycles: spread.map(|s| f64::from(cycles) * (s / wanted_ns).powi(2)),
        found: share(of_the_echo.len() as f64, all.len() as f64),
        frames: all.len(),
    })
}

/// A detection on the chip with a slow CLK, in the conventional mode; `None` for a step that is none.
fn detecting(
    system: &System,
    sensor: &SensorConfig,
    step: &Step,
    frames: usize,
) -> Result<Option<Detection>, EngineError> {
    let Purpose::Detect { candidates, bin_m } = step.purpose else {
        return Ok(None);
    };
    let reckoned = step.laser_cycles;
    let mut trial = lit(system, sensor, step.range_m, reckoned as u32);
    trial.stop_periods = candidates + 4;
    trial.echo_bins = f64::from(candidates) - 1.0;
    trial.sensor.mode = Mode::Conventional;
    trial.sensor.bins = candidates as usize;
    trial.sensor.clk_hz = SPEED_OF_LIGHT_M_PER_S / (2.0 * bin_m);

    let light = trial.per_cycle();
    let most_hits = reckoned * -(-(light.signal + light.background)).exp_m1();
    let chance = 1.0 - system.goal.detection;
    let exposures = [12, 14].map(|bits| (most_hits / largest_mean(bits, chance)).ceil() as u32);
    // The macropixel's own counters.
    let split = match trial.sensor.bin_bits {
        12 => exposures[0],
        _ => exposures[1],
    };
    let in_window = light.signal + light.background * f64::from(candidates);
    let affordable = PHOTONS * frames as f64 / super::FRAMES as f64 / (reckoned * in_window);
    let frames = (affordable as usize).clamp(FEWEST, frames);
    let mut counts = vec![vec![0; trial.sensor.bins]; frames];
    for exposure in 0..split {
        let from = |exposure: u32| (reckoned * f64::from(exposure) / f64::from(split)) as u32;
        let part = Trial {
            cycles: from(exposure + 1) - from(exposure),
            ..trial.clone()
        };
        let part = part.histograms(frames, seed(step) + 2 + u64::from(exposure), |_| 0.0)?;
        let bins = counts.iter_mut().flatten().zip(part.iter().flatten());
        bins.for_each(|(sum, &count): (&mut u32, _)| *sum += count);
    }
    let is_full = |bits: u32| {
        let full = counts.iter().filter(|c| c.iter().any(|&n| n >= 1 << bits));
        full.count() as f64 / frames as f64
    };
    Ok(Some(Detection {
        candidates,
        bin_m,
        reckoned,
        found: judged(&trial, &counts, true),
        frames,
        cycles: cycles_from(&counts, reckoned, system.goal.detection),
        exposures,
        full: [12, 14].map(is_full),
    }))
}

/// Laser cycles at which P_D is `wanted`, from counts of `cycles` of them whose last bin has the echo: with the chances of
/// a hit that they show, and at the ends of their difference's interval. Where that does not exclude that there is none,
/// there is no upper end; `None` where the echo's bin has no more hits than others.
fn cycles_from(counts: &[Vec<u32>], cycles: f64, wanted: f64) -> Option<Estimate> {
    let rivals = counts[0].len() - 1;
    let trials = cycles * counts.len() as f64;
    let total = |bins: std::ops::Range<usize>| -> f64 {
        let each = counts.iter().flat_map(|c| &c[bins.clone()]);
        each.map(|&n| f64::from(n)).sum()
    };
    let echo = share(total(rivals..rivals + 1), trials).value;
    let other = share(total(0..rivals), trials * rivals as f64).value;
    let spread = |p: f64| (p * (1.0 - p)).sqrt();
    let error =
        (spread(echo).powi(2) / trials + spread(other).powi(2) / (trials * rivals as f64)).sqrt();
    let needed = |difference: f64| {
        let chances = [other + difference, other];
        let is_found = |n: f64| won(n, chances, rivals) >= wanted;
        if difference <= 0.0 {
            return f64::INFINITY;
        }
        let (mut low, mut high) = (0.0, 1.0);
        while !is_found(high) {
            (low, high) = (high, 2.0 * high);
        }
        for _ in 0..40 {
            let middle = 0.5 * (low + high);
            match is_found(middle) {
                true => high = middle,
                false => low = middle,
            }
        }
        high
    };
    let difference = echo - other;
    (difference > 0.0).then(|| Estimate {
        value: needed(difference),
        low: needed(difference + Z_95 * error),
        high: needed(difference - Z_95 * error),
    })
}

/// The chance that a count of `n` laser cycles with the first chance of a hit exceeds those of `rivals` bins with the second:
/// of normal counts, as there are hundreds in every bin.
fn won(n: f64, [echo, other]: [f64; 2], rivals: usize) -> f64 {
    let sigma = |p: f64| (n * p * (1.0 - p)).sqrt().max(1e-9);
    let ahead = n * (echo - other);
    // Simpson's rule over ±8 σ of the echo's bin.
    const STEPS: usize = 400;
    let step = 16.0 / STEPS as f64;
    let at = |k: usize| {
        let x = -8.0 + step * k as f64;
        let beaten = ln_normal_below((ahead + x * sigma(echo)) / sigma(other));
        normal_density(x) * (rivals as f64 * beaten).exp()
    };
    let inner: f64 = (1..STEPS)
        .map(|k| if k % 2 == 1 { 4.0 } else { 2.0 } * at(k))
        .sum();
    (at(0) + inner + at(STEPS)) * step / 3.0
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
    let mut grid = Grid::new([
        "zooming's detection",
        "cycles reckoned",
        "P_D of the chip in them",
        "frames",
        "cycles of the chip",
        "exposures, 12 bit",
        "14 bit",
        "12-bit bin full in one",
        "14-bit",
    ]);
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
                shown(detection.cycles, 0),
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

fn schemes(all: &[OnChip]) -> Grid {
    let mut grid = Grid::new([
        "range and scheme",
        "cycles reckoned",
        "cycles of the chip",
        "penalty reckoned",
        "penalty of the chip",
        "measured within 0.5 m",
    ]);
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
                    shown(cycles, 0),
                    format!("{:.2}", reckoned / full),
                    match scheme {
                        "guided" => "1".to_owned(),
                        _ => shown(penalty, 2),
                    },
                    match scheme {
                        "guided" => with_interval(&at.measurement.found, 3),
                        _ => String::new(),
                    },
                ]);
            }
        }
    }
    grid
}

fn each(all: &[OnChip]) -> impl Iterator<Item = (&'static str, &AtRange)> {
    let ranges = |on_chip| {
        let OnChip { name, ranges, .. }: &OnChip = on_chip;
        ranges.iter().map(|at| (*name, at))
    };
    all.iter().flat_map(ranges)
}

fn shown(estimate: Option<Estimate>, decimals: usize) -> String {
    estimate.map_or("never".to_owned(), |e| with_interval(&e, decimals))
}

/// The study.
///
/// # Errors
/// Configurations that no engine can run.
pub(crate) fn study(frames: usize) -> Result<Study, EngineError> {
    let all = measure_both(frames)?;
    Ok(Study {
        notes: vec![
            format!("{frames} frames for each measurement, {FEWEST} at least for a detection; in brackets intervals at 95 %, those of P_D Wilson's."),
            "Sliding's windows are the guided mode's. Zooming's coarse bins are the conventional mode's on a CLK as slow as they are long, where a bin counts one hit a laser cycle and a SPAD fires several times in a CLK period, of which the toggle front end loses pairs."
                .into(),
            "Reckoned: Eq. 17 with every photon counted; Cramér-Rao for the QuantIC4x4, Thompson for HSLIDAR, as in the thesis. A detection is split into exposures that the counters hold, and added off the chip: so it is measured. HSLIDAR's bins are CLK periods of its delay line's mean."
                .into(),
        ],
        grids: vec![
            ("detections of zooming", detections(&all)),
            ("laser cycles and penalty of the schemes", schemes(&all)),
        ],
        charts: Vec::new(),
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_bin_without_an_echo_wins_its_share() {
        for rivals in [1, 3, 15] {
            let p = won(1e4, [0.3, 0.3], rivals);
            assert!(
                (p - 1.0 / (rivals as f64 + 1.0)).abs() < 1e-6,
                "{rivals}: {p}"
            );
        }
        // One rival: Φ(Δ/√(σ² + σ²)).
        let p = won(1e4, [0.31, 0.3], 1);
        let z = 100.0 / (1e4 * (0.31 * 0.69 + 0.3 * 0.7f64)).sqrt();
        assert!((p - ln_normal_below(z).exp()).abs() < 1e-6);
    }

    #[test]
    fn cycles_from_counts_are_those_at_which_the_echo_wins() {
        let counts = vec![vec![30_000, 30_000, 30_300]; 20];
        let cycles = cycles_from(&counts, 1e5, 0.9).unwrap();
        assert!((won(cycles.value, [0.303, 0.3], 2) - 0.9).abs() < 1e-6);
        assert!(cycles.low < cycles.value && cycles.value < cycles.high);
        assert!(cycles_from(&[vec![10, 10]], 100.0, 0.9).is_none());
        assert!(
            cycles_from(&[vec![10, 11]], 100.0, 0.9)
                .unwrap()
                .high
                .is_infinite()
        );
    }
}
