//! The penalty of partial histograms (3.4) against the chip: laser cycles that it takes to find and to measure an echo.
//!
//! The chip zooms as it can: a slow CLK makes its bins coarse, and the conventional mode shows the last CLK periods
//! before STOP. The cycles of a step are found where the measured P_D crosses the wanted one (probit regression
//! on √cycles), those of a measurement by scaling the measured spread, which falls with √cycles.

use super::detection::detected;
use super::precision::{Estimator, by_formula, scatter};
use super::trial::Trial;
use super::{MeasuredStudy, interval_text};
use crate::engine::EngineError;
use crate::numerics::intervals::Estimate;
use crate::numerics::probit::{ProbitPoint, crossing};
use crate::report::Grid;
use crate::reproduce::parameters::long_range;
use crate::reproduce::thesis::measurement;
use crate::theory::cycles::laser_cycles_for;
use crate::theory::detection::{DetectionModel, PerCycle, Ties};
use crate::theory::partial::{StepPurpose, System};
use crate::units::SPEED_OF_LIGHT_M_PER_S;

/// Exposures around the crossing, relative to where the formula that counts one hit a bin and cycle puts it.
const LADDER: [f64; 5] = [0.4, 0.55, 0.7, 0.85, 1.05];

/// Laser cycles at which the chip's P_D crosses `wanted`; `None` when no number is enough.
///
/// # Errors
/// Configurations that no engine can run.
pub(crate) fn cycles_to_detect(
    trial: &Trial,
    wanted: f64,
    frames: usize,
    seed: u64,
) -> Result<Option<Estimate>, EngineError> {
    let Some(formula) = laser_cycles_for(wanted, &trial.per_cycle(), ONE_HIT) else {
        return Ok(None);
    };
    let mut points = Vec::new();
    for step in LADDER {
        let cycles = (formula as f64 * step).round().max(1.0) as u32;
        let trial = Trial {
            cycles,
            ties_by_lot: true,
            ..trial.clone()
        };
        let trials = trial.affordable(frames) as f64;
        let share = detected(&trial, frames, seed + u64::from(cycles))?.value;
        points.push(ProbitPoint {
            x: f64::from(cycles).sqrt(),
            trials,
            successes: share * trials,
        });
    }
    points.dedup_by_key(|point| point.x);
    Ok(crossing(&points, wanted).map(|root| root.map(|r| r * r)))
}

/// Laser cycles for a spread of `wanted_ns`, from the spread at `trial`'s own.
fn cycles_to_measure(
    trial: &Trial,
    wanted_ns: f64,
    frames: usize,
    seed: u64,
) -> Result<Estimate, EngineError> {
    let spread = scatter(trial, frames, seed, Estimator::Likelihood)?.spread;
    Ok(spread.map(|s| f64::from(trial.cycles) * (s / wanted_ns).powi(2)))
}

/// The chip with bins of `bin_m`, showing an echo at the end of `system`'s range in the conventional mode.
fn coarse(system: &System, bin_m: f64, candidates: u32, range_m: f64) -> Trial {
    Trial::of_link(&system.link, range_m, 1).in_coarse_bins(candidates, bin_m)
}

/// The guided chip with bins of the system's measurement, an echo of `range_m` in mid-window.
fn fine(system: &System, range_m: f64, cycles: u32) -> Trial {
    Trial::of_link(&system.link, range_m, cycles)
        .with_sensor_change(|sensor| sensor.clk_hz = 1.0 / system.bin_s)
}

/// Eq. 17 with every photon counted, ties by lot.
const EQ_17: DetectionModel = DetectionModel::Poisson(Ties::Random);
/// The same with one hit per bin and cycle.
const ONE_HIT: DetectionModel = DetectionModel::Bernoulli(Ties::Random);

/// A detection, by formula and on the chip.
struct Detection {
    name: String,
    light: PerCycle,
    chip: Option<Estimate>,
}

/// One range: what the three schemes take by formula and on the chip.
struct Schemes {
    range_m: f64,
    /// Zooming's coarse steps.
    coarse: Vec<Detection>,
    /// Formula of all of them together.
    detecting: f64,
    /// Formula and chip of the measurement, which is all that a guided histogram takes.
    measuring: (f64, Estimate),
    /// Formula and chip of all windows of sliding.
    sliding: (f64, Estimate),
}

impl Schemes {
    fn measure(system: &System, range_m: f64, frames: usize) -> Result<Self, EngineError> {
        let seed = 1_000_000 * range_m as u64;
        let wanted_ns = 2e9 * system.goal.precision_m / SPEED_OF_LIGHT_M_PER_S;
        let zooming = system.zooming(range_m);
        let (mut coarse_steps, mut detecting) = (Vec::new(), 0.0);
        for step in &zooming.steps {
            if let StepPurpose::Detect { candidates, bin_m } = step.purpose {
                let trial = coarse(system, bin_m, candidates, step.range_m);
                coarse_steps.push(Detection {
                    name: format!("zooming, {candidates} bins of {bin_m} m at {range_m} m"),
                    light: trial.per_cycle(),
                    chip: cycles_to_detect(&trial, system.goal.detection, frames, seed)?,
                });
                detecting += step.laser_cycles;
            }
        }
        let on_chip_measuring = |range_m: f64| {
            let formula = system.measure(range_m).laser_cycles;
            let trial = fine(system, range_m, (formula as u32).max(20));
            debug_assert!(by_formula(&trial).1.is_finite());
            Ok::<_, EngineError>((
                formula,
                cycles_to_measure(&trial, wanted_ns, frames, seed + 1)?,
            ))
        };
        let mut sliding = (0.0, exactly(0.0));
        for step in &system.sliding(range_m, 0).steps {
            let (formula, chip) = on_chip_measuring(step.range_m)?;
            sliding = (sliding.0 + formula, sum(&sliding.1, &chip));
        }
        Ok(Schemes {
            range_m,
            coarse: coarse_steps,
            detecting,
            measuring: on_chip_measuring(range_m)?,
            sliding,
        })
    }
}

fn exactly(value: f64) -> Estimate {
    Estimate {
        value,
        low: value,
        high: value,
    }
}

/// Independent errors add in squares.
pub(super) fn sum(a: &Estimate, b: &Estimate) -> Estimate {
    let value = a.value + b.value;
    let down = libm::hypot(a.value - a.low, b.value - b.low);
    let up = libm::hypot(a.high - a.value, b.high - b.value);
    Estimate {
        value,
        low: value - down,
        high: value + up,
    }
}

/// a/b with relative errors in squares.
pub(super) fn ratio(a: &Estimate, b: &Estimate) -> Estimate {
    let value = a.value / b.value;
    let down = libm::hypot(1.0 - a.low / a.value, b.high / b.value - 1.0);
    let up = libm::hypot(a.high / a.value - 1.0, 1.0 - b.low / b.value);
    Estimate {
        value,
        low: value * (1.0 - down).max(0.0),
        high: value * (1.0 + up),
    }
}

/// Ranges of the table, m. Farther, zooming's detection takes more photons than are worth drawing.
const RANGES_M: [f64; 3] = [50.0, 75.0, 100.0];

fn schemes(measured: &[Schemes]) -> Grid {
    let mut grid = measurement(3).grid(1);
    for schemes in measured {
        let (guided_formula, guided) = schemes.measuring;
        let zooming = schemes.coarse.iter().try_fold(guided, |all, step| {
            step.chip.as_ref().map(|cycles| sum(&all, cycles))
        });
        let lines = [
            ("guided", guided_formula, Some(guided)),
            ("zooming", guided_formula + schemes.detecting, zooming),
            ("sliding", schemes.sliding.0, Some(schemes.sliding.1)),
        ];
        for (name, formula, chip) in lines {
            let mut cells = vec![
                format!("{} m, {name}", schemes.range_m),
                format!("{formula:.0}"),
            ];
            let penalty = chip.map(|chip| match name {
                "guided" => exactly(1.0),
                _ => ratio(&chip, &guided),
            });
            let texts = |estimate: Option<Estimate>, decimals: usize| match estimate {
                Some(e) => [
                    format!("{:.decimals$}", e.value),
                    interval_text(&e, decimals),
                ],
                None => ["never".to_owned(), String::new()],
            };
            cells.extend(texts(chip, 0));
            cells.push(format!("{:.2}", formula / guided_formula));
            cells.extend(texts(penalty, 2));
            grid.push(cells);
        }
    }
    grid
}

/// Detections in a guided window.
fn guided(wanted: f64, frames: usize) -> Result<Vec<Detection>, EngineError> {
    let cases = [
        ("guided window, daylight", Trial::new(0.05, 20e6, 1)),
        ("guided window, 15 x daylight", Trial::new(0.3, 300e6, 1)),
    ];
    let measure = |(name, trial): (&str, Trial)| {
        Ok(Detection {
            name: name.to_owned(),
            light: trial.per_cycle(),
            chip: cycles_to_detect(&trial, wanted, frames, 500)?,
        })
    };
    cases.into_iter().map(measure).collect()
}

/// Laser cycles to the wanted P_D.
fn detections<'a>(wanted: f64, all: impl Iterator<Item = &'a Detection>) -> Grid {
    let mut grid = measurement(3).grid(0);
    for Detection { name, light, chip } in all {
        let by = |model| {
            laser_cycles_for(wanted, light, model).map_or(f64::INFINITY, |cycles| cycles as f64)
        };
        let every = by(EQ_17);
        let [chip, interval, ratio] = match chip {
            Some(e) => [
                format!("{:.0}", e.value),
                interval_text(e, 0),
                format!("{:.3}", e.value / every),
            ],
            None => ["never".to_owned(), String::new(), String::new()],
        };
        grid.push([
            name.clone(),
            wanted.to_string(),
            format!("{every:.0}"),
            format!("{:.0}", by(ONE_HIT)),
            chip,
            interval,
            ratio,
        ]);
    }
    grid
}

/// The study.
///
/// # Errors
/// Configurations that no engine can run.
pub(crate) fn study(frames: usize) -> Result<MeasuredStudy, EngineError> {
    let system = long_range();
    let wanted = system.goal.detection;
    let measure = |range_m: f64| Schemes::measure(&system, range_m, frames);
    let measured: Vec<Schemes> = RANGES_M
        .into_iter()
        .map(measure)
        .collect::<Result<_, _>>()?;
    let guided = guided(wanted, frames)?;
    let zooming = measured.iter().flat_map(|schemes| &schemes.coarse);
    let detections = detections(wanted, guided.iter().chain(zooming));
    let grids = [detections, schemes(&measured)];
    Ok(measurement(3).study(&[("frames", frames)], grids, None))
}
