//! The formulas of chapter 3 over columns of numbers.

use guided_dtof::theory::cycles::laser_cycles_for;
use guided_dtof::theory::design::{Design, StereoPair};
use guided_dtof::theory::detection::{self, DetectionModel, PerCycle, Ties};
use guided_dtof::theory::front_ends;
use guided_dtof::theory::partial::{Link, Models, RangingGoal, System};
use guided_dtof::theory::precision;
use guided_dtof::theory::significance::Scan;
use guided_dtof::units::SPEED_OF_LIGHT_M_PER_S;
use numpy::{PyArray1, PyReadonlyArray1, PyReadonlyArray2};
use pyo3::prelude::*;
use rayon::prelude::*;

use crate::background::run;
use crate::failure::Failure;

/// Rows between two looks at whether they are still wanted.
const CHUNK: usize = 16;

/// A formula, given a row of its arguments.
type Formula = Box<dyn Fn(&[f64]) -> f64 + Send + Sync>;

fn model(name: &str) -> Result<DetectionModel, Failure> {
    Ok(match name {
        "poisson" => DetectionModel::Poisson(Ties::Random),
        "poisson_strict" => DetectionModel::Poisson(Ties::Strict),
        "poisson_loose" => DetectionModel::Poisson(Ties::Loose),
        "bernoulli" => DetectionModel::Bernoulli(Ties::Random),
        "bernoulli_strict" => DetectionModel::Bernoulli(Ties::Strict),
        "bernoulli_loose" => DetectionModel::Bernoulli(Ties::Loose),
        "gaussian" => DetectionModel::Gaussian,
        "gaussian_as_printed" => DetectionModel::GaussianAsPrinted,
        _ => {
            let message = format!(
                "{name:?} is no model; give poisson, bernoulli (with _strict or _loose for ties), gaussian or gaussian_as_printed"
            );
            return Err(Failure::argument("model", message));
        }
    })
}

fn light(row: &[f64]) -> PerCycle {
    PerCycle {
        signal: row[0],
        background: row[1],
        bins: row[2] as u32,
    }
}

fn system(
    row: &[f64],
    detection: DetectionModel,
    precision: fn(f64, f64, f64, f64) -> f64,
) -> System {
    let &[
        _,
        signal,
        background_hz,
        pulse_sigma_s,
        precision_m,
        probability,
        bins,
        bin_s,
        ..,
    ] = row
    else {
        unreachable!("the package gives all columns")
    };
    let link = Link {
        signal,
        background_hz,
        pulse_sigma_s,
    };
    let goal = RangingGoal {
        precision_m,
        detection: probability,
    };
    let models = Models {
        precision,
        detection,
    };
    System::new(link, goal, models, bins as u32, bin_s)
}

/// A formula by its name, and how many arguments it takes.
fn formula(name: &str, words: &[String]) -> Result<(usize, Formula), Failure> {
    let word = |at: usize| words.get(at).map_or("", String::as_str);
    fn boxed(formula: impl Fn(&[f64]) -> f64 + Send + Sync + 'static) -> Formula {
        Box::new(formula)
    }
    Ok(match name {
        "detection_probability" => {
            let model = model(word(0))?;
            let probability =
                move |r: &[f64]| detection::probability(&light(r), r[3] as u64, model).probability;
            (4, boxed(probability))
        }
        "miss_probability" => {
            let model = model(word(0))?;
            let miss = move |r: &[f64]| detection::probability(&light(r), r[3] as u64, model).miss;
            (4, boxed(miss))
        }
        "laser_cycles_for" => {
            let model = model(word(0))?;
            let laser_cycles = move |r: &[f64]| {
                let cycles = laser_cycles_for(r[3], &light(r), model);
                cycles.map_or(f64::NAN, |cycles| cycles as f64)
            };
            (4, boxed(laser_cycles))
        }
        "thompson" => (4, boxed(|r| precision::thompson(r[0], r[1], r[2], r[3]))),
        "cramer_rao" => {
            // The library's is the greatest number where nothing is told, so that searches may go on.
            let bound = |r: &[f64]| match precision::cramer_rao(r[0], r[1], r[2], r[3]) {
                f64::MAX => f64::INFINITY,
                bound => bound,
            };
            (4, boxed(bound))
        }
        "thompson_best_ratio" => (2, boxed(|r| precision::thompson_best_ratio(r[0], r[1]))),
        "cramer_rao_laser_cycles" => (
            5,
            boxed(|r| precision::cramer_rao_laser_cycles(r[0], r[1], r[2], r[3], r[4])),
        ),
        "scheme_laser_cycles" => {
            let (scheme, detection) = (word(0).to_owned(), model(word(1))?);
            let precision = match word(2) {
                "thompson" => precision::thompson,
                "cramer_rao" => precision::cramer_rao,
                other => {
                    let message = format!("{other:?} is impossible; give thompson or cramer_rao");
                    return Err(Failure::argument("precision", message));
                }
            };
            if !["full", "zooming", "sliding"].contains(&scheme.as_str()) {
                let message = format!("{scheme:?} is no scheme; give full, zooming or sliding");
                return Err(Failure::argument("scheme", message));
            }
            let laser_cycles = move |r: &[f64]| {
                let system = system(r, detection, precision);
                let cost = match scheme.as_str() {
                    "full" => system.full(r[0]),
                    "zooming" => system.zooming(r[0]),
                    _ => system.sliding(r[0], r[8] as u32),
                };
                cost.laser_cycles()
            };
            (9, boxed(laser_cycles))
        }
        "tolerated_sigma_m" => {
            let tolerated_sigma_m = |r: &[f64]| {
                let design = Design {
                    counter_bits: 1,
                    bins: r[1] as u32,
                    clk_hz: r[0],
                    light_m_per_s: SPEED_OF_LIGHT_M_PER_S,
                };
                design.tolerated_sigma_m()
            };
            (2, boxed(tolerated_sigma_m))
        }
        "stereo_depth_error_m" => {
            let depth_error_m = |r: &[f64]| {
                let pair = StereoPair {
                    focal_px: r[2],
                    baseline_m: r[3],
                };
                pair.depth_error_m(r[0], r[1])
            };
            (4, boxed(depth_error_m))
        }
        "non_paralysable_hz" => (2, boxed(|r| front_ends::non_paralysable_hz(r[0], r[1]))),
        "paralysable_hz" => (2, boxed(|r| front_ends::paralysable_hz(r[0], r[1]))),
        "xor_edges_hz" => (2, boxed(|r| front_ends::xor_edges_hz(r[0], r[1]))),
        "any_periods_hz" => (
            3,
            boxed(|r| front_ends::any_periods_hz(r[0] as u32, r[1], r[2])),
        ),
        "odd_periods_hz" => (
            3,
            boxed(|r| front_ends::odd_periods_hz(r[0] as u32, r[1], r[2])),
        ),
        _ => {
            return Err(Failure::argument(
                "theory",
                format!("there is no formula {name:?}"),
            ));
        }
    })
}

/// A formula of the library over columns of equal length, with words that choose among its variants.
#[pyfunction]
pub(crate) fn theory<'py>(
    py: Python<'py>,
    name: &str,
    words: Vec<String>,
    columns: Vec<PyReadonlyArray1<'py, f64>>,
) -> PyResult<Bound<'py, PyArray1<f64>>> {
    let (arguments, formula) = formula(name, &words)?;
    let columns: Vec<Vec<f64>> = columns.iter().map(|c| c.as_array().to_vec()).collect();
    let rows = columns.first().map_or(0, Vec::len);
    if columns.len() != arguments || columns.iter().any(|column| column.len() != rows) {
        let message = format!("{name} takes {arguments} columns of equal length");
        return Err(Failure::argument("theory", message).into());
    }
    let results = run(py, None, move |watch| {
        let mut results = vec![0.0; rows];
        let chunks = results.par_chunks_mut(CHUNK).enumerate();
        chunks.try_for_each(|(chunk, results)| {
            watch.check()?;
            let mut row = vec![0.0; arguments];
            for (at, result) in (chunk * CHUNK..).zip(results) {
                for (value, column) in row.iter_mut().zip(&columns) {
                    *value = column[at];
                }
                *result = formula(&row);
            }
            Ok::<(), Failure>(())
        })?;
        Ok(results)
    })?;
    Ok(PyArray1::from_vec(py, results))
}

/// How sure it is that each histogram holds an echo: −log₁₀ of the chance that light without one makes as full a stretch.
#[pyfunction]
pub(crate) fn confidence<'py>(
    py: Python<'py>,
    histograms: PyReadonlyArray2<'py, u32>,
    pulse_sigma_bins: f64,
    laser_cycles: u32,
) -> PyResult<Bound<'py, PyArray1<f64>>> {
    let counts = histograms.as_array().to_owned();
    let results = py.detach(move || {
        let scan = Scan::matched(pulse_sigma_bins, counts.ncols(), laser_cycles);
        let confident = |row: numpy::ndarray::ArrayView1<'_, u32>| {
            let stretch = scan.fullest(&row.to_vec());
            -stretch.ln_false_alarm / std::f64::consts::LN_10
        };
        counts.outer_iter().map(confident).collect::<Vec<f64>>()
    });
    Ok(PyArray1::from_vec(py, results))
}
