//! One step of a partial histogram on the chip: a detection among coarse bins, or a measurement in a window.
//!
//! Detections are run with the laser cycles that the thesis reckons with, split into as many exposures as the counters need,
//! whose counts are added off the chip. How often the echo's bin wins is the measured P_D, with Wilson's interval. From the same
//! counts follow the laser cycles that the chip would need: a bin adds one hit a laser cycle at most, and laser cycles are
//! independent, so that counts are binomial, and P_D follows from the two chances of a hit. Measurements scale by the spread
//! of maximum-likelihood times, which falls with the square root of the laser cycles. Frames that take a peak of the background
//! for the echo have no part in it, and are counted apart.

use crate::chip::Sensor;
use crate::engine::EngineError;
use crate::numerics::intervals::{Estimate, Z_95, deviation, share};
use crate::numerics::{ln_normal_below, normal_density};
use crate::reproduce::measured::FRAMES;
use crate::reproduce::measured::detection::detection_share;
use crate::reproduce::measured::precision::{Estimator, errors_ns};
use crate::reproduce::measured::trial::Trial;
use crate::theory::partial::{ExposureStep, StepPurpose, System, largest_mean};
use crate::units::SPEED_OF_LIGHT_M_PER_S;

/// Photons that all frames of a detection take together at 300 frames: about half a second on one core.
const PHOTONS: f64 = 1e7;

/// Frames of a detection, at least, whatever they cost.
pub(super) const FEWEST: usize = 16;

/// Errors within this multiple of the wanted spread belong to the echo's peak; beyond it a peak of the background was
/// taken for the echo. Chosen: a Gaussian error of that spread is farther off one time in a million.
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

impl Measurement {
    /// From the errors of frames of `cycles` laser cycles, ns, and the spread that is wanted, ns.
    pub(super) fn from_errors(errors_ns: &[f64], cycles: u32, wanted_ns: f64) -> Self {
        let of_the_echo = errors_ns
            .iter()
            .filter(|e| e.abs() <= OF_THE_ECHO * wanted_ns);
        let of_the_echo: Vec<f64> = of_the_echo.copied().collect();
        let spread = deviation(&of_the_echo);
        Measurement {
            cycles: spread.map(|s| f64::from(cycles) * (s / wanted_ns).powi(2)),
            found: share(of_the_echo.len() as f64, errors_ns.len() as f64),
            frames: errors_ns.len(),
        }
    }
}

/// The standard deviation of a time that a system is to reach, ns.
pub(super) fn wanted_ns(system: &System) -> f64 {
    2e9 * system.goal.precision_m / SPEED_OF_LIGHT_M_PER_S
}

/// Laser cycles of the exposures by which a measurement is judged.
pub(super) fn measured_cycles(step: &ExposureStep) -> u32 {
    step.laser_cycles.max(FEWEST_CYCLES) as u32
}

/// Photon light at a range, on this macropixel.
fn trial_at(system: &System, sensor: &Sensor, range_m: f64, cycles: u32) -> Trial {
    Trial {
        sensor: sensor.clone(),
        ..Trial::of_link(&system.link, range_m, cycles)
    }
}

/// Seeds of a step that nothing else has.
pub(super) fn seed(step: &ExposureStep) -> u64 {
    (1e4 * step.range_m) as u64 * 100
}

/// A measurement on the guided chip, the echo in mid-window.
pub(super) fn measuring(
    system: &System,
    sensor: &Sensor,
    step: &ExposureStep,
    frames: usize,
) -> Result<Measurement, EngineError> {
    let wanted_ns = wanted_ns(system);
    let cycles = measured_cycles(step);
    let trial = Trial {
        echo_bins: f64::from(system.bins / 2),
        ..trial_at(system, sensor, step.range_m, cycles)
    };
    let trial = trial.with_sensor_change(|sensor| sensor.clk_hz = 1.0 / system.bin_s);
    let all = errors_ns(&trial, frames, seed(step) + 1, Estimator::Likelihood)?;
    Ok(Measurement::from_errors(&all, cycles, wanted_ns))
}

/// A detection on the chip with a slow CLK, in the conventional mode; `None` for a step that is none.
pub(super) fn detecting(
    system: &System,
    sensor: &Sensor,
    step: &ExposureStep,
    frames: usize,
) -> Result<Option<Detection>, EngineError> {
    let StepPurpose::Detect { candidates, bin_m } = step.purpose else {
        return Ok(None);
    };
    let reckoned = step.laser_cycles;
    let trial = trial_at(system, sensor, step.range_m, reckoned as u32);
    let trial = trial.in_coarse_bins(candidates, bin_m);

    let light = trial.per_cycle();
    let most_hits = reckoned * -libm::expm1(-(light.signal + light.background));
    let chance = 1.0 - system.goal.detection;
    let exposures = [12, 14].map(|bits| (most_hits / largest_mean(bits, chance)).ceil() as u32);
    // The macropixel's own counters.
    let split = match trial.sensor.bin_bits {
        12 => exposures[0],
        _ => exposures[1],
    };
    let in_window = light.signal + light.background * f64::from(candidates);
    let affordable = PHOTONS * frames as f64 / FRAMES as f64 / (reckoned * in_window);
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
        found: detection_share(&trial, &counts, true),
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
            if is_found(middle) {
                high = middle
            } else {
                low = middle
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
    let integrand = |k: usize| {
        let x = -8.0 + step * k as f64;
        let beaten = ln_normal_below((ahead + x * sigma(echo)) / sigma(other));
        normal_density(x) * libm::exp(rivals as f64 * beaten)
    };
    let inner: f64 = (1..STEPS)
        .map(|k| if k % 2 == 1 { 4.0 } else { 2.0 } * integrand(k))
        .sum();
    (integrand(0) + inner + integrand(STEPS)) * step / 3.0
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
