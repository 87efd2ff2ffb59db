//! Eq. 20 and the Cramér-Rao bound against the chip: how far measured times scatter.

use super::trial::{Effect, Trial};
use super::{MeasuredStudy, interval_text};
use rayon::prelude::*;

use crate::engine::EngineError;
use crate::numerics::intervals::{Estimate, deviation, mean};
use crate::ranging::{PeakOptions, interpolate};
use crate::report::{Chart, Grid};
use crate::reproduce::parameters::sigma_over_fwhm;
use crate::reproduce::thesis::measurement;
use crate::theory::Pulse;
use crate::theory::estimators::ExpectedHistogram;
use crate::theory::precision::{cramer_rao, thompson};

/// How a histogram becomes a time.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Estimator {
    /// Maximum likelihood under the formulas' kind of histogram: Gaussian pulse, flat background, Poisson counts.
    Likelihood,
    /// Eq. 28 around the fullest bin, as the chip's host does it.
    Peak,
}

/// Errors of the measured time, ns.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Scatter {
    /// Standard deviation.
    pub spread: Estimate,
    /// Mean.
    pub bias: Estimate,
}

/// How far the times of `frames` frames of `trial` scatter about the truth. Echoes lie anywhere within their bin.
///
/// # Errors
/// Configurations that no engine can run.
pub fn scatter(
    trial: &Trial,
    frames: usize,
    seed: u64,
    estimator: Estimator,
) -> Result<Scatter, EngineError> {
    let errors = errors_ns(trial, frames, seed, estimator)?;
    Ok(Scatter {
        spread: deviation(&errors),
        bias: mean(&errors),
    })
}

/// Errors of the times of `frames` frames of `trial`, or as many as are affordable, ns.
///
/// # Errors
/// Configurations that no engine can run.
pub(super) fn errors_ns(
    trial: &Trial,
    frames: usize,
    seed: u64,
    estimator: Estimator,
) -> Result<Vec<f64>, EngineError> {
    let frames = trial.affordable(frames);
    // The same places for every frame count, each as often, in an order that has nothing to do with the frame's light.
    let shift = |frame: usize| (frame as f64 + 0.5) / frames as f64 - 0.5;
    let histograms = trial.histograms(frames, seed, shift)?;
    let (background, signal) = levels(trial, &histograms);
    let expected = ExpectedHistogram {
        pulse: Pulse::Gaussian {
            sigma_ns: trial.sigma_ns,
        },
        bin_ns: trial.bin_ns(),
        background,
        signal,
    };
    let errors = histograms.par_iter().enumerate().map(|(frame, counts)| {
        let truth_bins = trial.echo_bins + shift(frame);
        let bins = match estimator {
            Estimator::Likelihood => expected.maximum_likelihood(counts) / expected.bin_ns - 0.5,
            Estimator::Peak => interpolate(counts, &PeakOptions::default())
                .map_or(0.5 * (counts.len() as f64 - 1.0), |peak| peak.position_bins),
        };
        (bins - truth_bins) * expected.bin_ns
    });
    Ok(errors.collect())
}

/// Mean counts of a bin without echo, and of the whole echo, over all histograms: what a host knows after some frames.
/// Told the formulas' own counts instead, a likelihood takes the background that single hits swallow for an echo beyond
/// the window's edge.
fn levels(trial: &Trial, histograms: &[Vec<u32>]) -> (f64, f64) {
    let reach = 4.0 * trial.sigma_ns / trial.bin_ns() + 1.0;
    let is_dark = |bin: usize| (bin as f64 - trial.echo_bins).abs() > reach;
    let (mut dark, mut dark_bins, mut all) = (0.0, 0.0, 0.0);
    for (bin, &count) in histograms
        .iter()
        .flat_map(|counts| counts.iter().enumerate())
    {
        all += f64::from(count);
        if is_dark(bin) {
            dark += f64::from(count);
            dark_bins += 1.0;
        }
    }
    let frames = histograms.len() as f64;
    let background = dark / f64::max(dark_bins, 1.0);
    let signal = all / frames - trial.sensor.bins as f64 * background;
    (background, signal.max(1.0))
}

/// Laser cycles of the exposures.
const CYCLES: u32 = 2_000;

/// Signal photons per pulse.
const SIGNALS: [f64; 8] = [0.02, 0.05, 0.15, 0.5, 1.0, 2.0, 4.0, 10.0];

/// The demonstrator's pulse in the QuantIC4x4's bins, in daylight.
fn trial(signal: f64) -> Trial {
    Trial {
        sigma_ns: 4.5 * sigma_over_fwhm(),
        ..Trial::new(signal, 20e6, CYCLES)
    }
}

/// Thompson and the bound for a trial's counts, ns.
pub fn by_formula(trial: &Trial) -> (f64, f64) {
    let cycles = f64::from(trial.cycles);
    let (background, signal) = (cycles * trial.background(), cycles * trial.signal);
    let bound = |formula: fn(f64, f64, f64, f64) -> f64| {
        formula(trial.bin_ns(), trial.sigma_ns, background, signal)
    };
    (bound(thompson), bound(cramer_rao))
}

fn sweep(frames: usize) -> Result<(Grid, Chart), EngineError> {
    let mut grid = measurement(2).grid(0);
    let mut points: [Vec<(f64, f64)>; 7] = Default::default();
    for (number, signal) in SIGNALS.into_iter().enumerate() {
        let trial = trial(signal);
        let seed = 200 + number as u64;
        let (thompson, bound) = by_formula(&trial);
        let likelihood = scatter(&trial, frames, seed, Estimator::Likelihood)?;
        let peak = scatter(&trial, frames, seed, Estimator::Peak)?;
        let thin = scatter(&trial.in_thin_light(), frames, seed, Estimator::Likelihood)?;
        let all = signal * f64::from(CYCLES);
        grid.push([
            signal.to_string(),
            format!("{all:.0}"),
            format!("{thompson:.4}"),
            format!("{bound:.4}"),
            format!("{:.4}", likelihood.spread.value),
            interval_text(&likelihood.spread, 4),
            format!("{:.3}", likelihood.spread.value / bound),
            format!("{:+.4}", likelihood.bias.value),
            format!("{:.4}", peak.spread.value),
            interval_text(&peak.spread, 4),
            format!("{:.3}", peak.spread.value / thompson),
            format!("{:+.4}", peak.bias.value),
            format!("{:.4}", thin.spread.value),
            interval_text(&thin.spread, 4),
        ]);
        let ends = |e: Estimate| [(all, e.low), (all, e.high)];
        points[0].push((all, thompson));
        points[1].push((all, bound));
        points[2].push((all, likelihood.spread.value));
        points[3].extend(ends(likelihood.spread));
        points[4].push((all, peak.spread.value));
        points[5].extend(ends(peak.spread));
        points[6].push((all, likelihood.bias.value.abs()));
    }
    let [
        thompson,
        bound,
        likelihood,
        likelihood_ends,
        peak,
        peak_ends,
        bias,
    ] = points;
    let chart = measurement(2)
        .chart()
        .dashed("Thompson", thompson)
        .line("Cramér-Rao", bound)
        .points("chip, likelihood", likelihood)
        .whiskers("", likelihood_ends)
        .points("chip, Eq. 28", peak)
        .whiskers("", peak_ends)
        .dashed("chip, likelihood: bias", bias);
    Ok((grid, chart))
}

/// Spread and bias of the likelihood estimate with each effect taken out alone.
fn failures(frames: usize) -> Result<Grid, EngineError> {
    let effects = [Effect::DeadTime, Effect::OneHit, Effect::Overflow];
    let mut grid = measurement(2).grid(1);
    let narrow = trial(4.0).with_sensor_change(|sensor| sensor.bin_bits = 10);
    let wide = Trial {
        sigma_ns: 8.0 * sigma_over_fwhm(),
        ..trial(2.0)
    };
    let dazzled = Trial {
        background_hz: 300e6,
        ..trial(0.5)
    };
    let cases = [
        ("0.05 photons a pulse", trial(0.05)),
        ("1 photon a pulse", trial(1.0)),
        ("4 photons a pulse", trial(4.0)),
        ("10 photons a pulse", trial(10.0)),
        ("2 photons in a pulse of 8 ns", wide),
        ("0.5 photons a pulse, 15 x daylight", dazzled),
        ("4 photons a pulse, counters of 10 bits", narrow),
    ];
    for (number, (name, trial)) in cases.into_iter().enumerate() {
        let seed = 300 + number as u64;
        let measure = |trial: &Trial| scatter(trial, frames, seed, Estimator::Likelihood);
        let texts = |s: Scatter| {
            [
                format!("{:.4}", s.spread.value),
                format!("{:+.4}", s.bias.value),
            ]
        };
        let mut cells = vec![name.to_owned(), format!("{:.4}", by_formula(&trial).1)];
        cells.extend(texts(measure(&trial)?));
        for effect in effects {
            match trial.without_effect(effect) {
                Some(trial) => cells.extend(texts(measure(&trial)?)),
                None => cells.extend(["-".to_owned(), "-".to_owned()]),
            }
        }
        cells.extend(texts(measure(&trial.in_thin_light())?));
        grid.push(cells);
    }
    Ok(grid)
}

/// The study.
///
/// # Errors
/// Configurations that no engine can run.
pub(crate) fn study(frames: usize) -> Result<MeasuredStudy, EngineError> {
    let (sweep, chart) = sweep(frames)?;
    let grids = [sweep, failures(frames)?];
    Ok(measurement(2).study(&[("frames", frames)], grids, Some(chart)))
}
