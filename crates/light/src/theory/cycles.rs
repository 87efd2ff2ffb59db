//! How many laser cycles a probability of detection asks for (thesis 3.2.2, end).

use super::detection::{DetectionModel, PerCycle, Ties, probability};

/// Mean counts in a bin beyond which nobody integrates.
const MOST_COUNTS: f64 = 1e10;

/// The smallest number of laser cycles from which on P_D ≥ `target` (0 to 1, exclusive); `None` when it takes
/// more than 10¹⁰ counts in a bin, or for ever.
///
/// With ties drawn by lot more cycles never hurt: the peak is then the likeliest bin, and the best decision
/// cannot suffer from more data. There the search doubles and bisects. The other models start from its
/// answer: ties lost for certain need more cycles; ties won for certain, and the Gaussians, promise too much
/// where counts are few, so the search walks down, in steps of a sixteenth, to the last failure.
pub fn laser_cycles_for(target: f64, light: &PerCycle, model: DetectionModel) -> Option<u64> {
    if target >= 1.0 || target.is_nan() {
        return None;
    }
    let fair = match model {
        DetectionModel::Bernoulli(_) => DetectionModel::Bernoulli(Ties::Random),
        _ => DetectionModel::Poisson(Ties::Random),
    };
    let photons = light.signal + light.background;
    let fair_cycles = search(photons, |n| reaches(target, light, fair, n))?;
    if model == fair {
        return Some(fair_cycles);
    }
    let (_, mut enough) = double(fair_cycles, photons, |n| reaches(target, light, model, n))?;
    while enough > 1 {
        let fewer = enough - (enough / 16).max(1);
        if !reaches(target, light, model, fewer) {
            return Some(bisect(fewer, enough, |n| reaches(target, light, model, n)));
        }
        enough = fewer;
    }
    Some(1)
}

fn reaches(target: f64, light: &PerCycle, model: DetectionModel, cycles: u64) -> bool {
    probability(light, cycles, model).probability >= target
}

/// The smallest number of laser cycles that `is_enough`, if more of them stay enough; `None` beyond 10¹⁰ counts, at `photons` a laser cycle.
pub(super) fn search(photons: f64, is_enough: impl Fn(u64) -> bool) -> Option<u64> {
    let (failed, enough) = double(1, photons, &is_enough)?;
    Some(bisect(failed, enough, is_enough))
}

/// Doubles `cycles` until it `is_enough`: (the last failure or 0, the first success).
fn double(mut cycles: u64, photons: f64, is_enough: impl Fn(u64) -> bool) -> Option<(u64, u64)> {
    let mut failed = 0;
    let most = (MOST_COUNTS / photons).min(1e18);
    while !is_enough(cycles) {
        if cycles as f64 > most {
            return None;
        }
        failed = cycles;
        cycles *= 2;
    }
    Some((failed, cycles))
}

/// The smallest success, between a failure (or 0) and a success.
fn bisect(mut failed: u64, mut enough: u64, is_enough: impl Fn(u64) -> bool) -> u64 {
    while enough - failed > 1 {
        let middle = failed + (enough - failed) / 2;
        if is_enough(middle) {
            enough = middle;
        } else {
            failed = middle;
        }
    }
    enough
}
