//! The light that makes a histogram most likely, and how precisely the histogram determines it.
//!
//! ```text
//!   counts ~ binomial(laser cycles, chance of the bin)        chance: response to position, signal, background, width
//!   score       Σ (counts − cycles·chance)·slope / (chance·(1 − chance))
//!   information Σ cycles·slope·slopeᵀ / (chance·(1 − chance))        its inverse is the Cramér-Rao bound
//! ```
//!
//! A bin counts at most once a laser cycle, so that its counts are binomial. Bins of one laser cycle are not independent: SPADs
//! that fired in one are blind in the next. With 16 SPADs that ties them so little that the errors of fits are those of
//! the bound; with one SPAD it makes the bound too small by up to the share of SPADs that fired.
//!
//! The maximum is found by Fisher scoring, damped where it overshoots (Levenberg and Marquardt).

use std::ops::Range;

use super::expected::{EchoLight, PARAMETERS, Response, Steps};
use crate::numerics::Dual;

/// Chances beyond which none is believed: a count that the model says never comes costs 21 in ln likelihood.
const LEAST_CHANCE: f64 = 1e-9;

/// Rounds at most. Nine of ten fits take four.
const ROUNDS: usize = 40;

/// Where the next step would be less than so much of the parameters' standard deviations, squared; as many times as much as counts
/// scatter more than they should, because a light that explains nothing need not be found exactly.
const CLOSE: f64 = 1e-4;

/// Standard deviations by which an echo's centre may lie beside the bins.
pub(super) const BESIDE: f64 = 3.0;

/// Which parameters are fitted: position, signal, background, width.
pub(super) type Free = [bool; PARAMETERS];

/// Position, signal and background.
pub(super) const ECHO: Free = [true, true, true, false];
/// Width besides.
pub(super) const WIDE_ECHO: Free = [true, true, true, true];
/// What bins of the peak alone can tell, where the background is known from others.
pub(super) const IN_REGION: Free = [true, true, false, false];
/// Width besides.
pub(super) const WIDE_IN_REGION: Free = [true, true, false, true];

/// A histogram, and what may have made it.
#[derive(Debug, Clone)]
pub(super) struct Likelihood<'a> {
    pub(super) response: &'a Response,
    /// Counts of every bin.
    pub(super) counts: &'a [f64],
    /// Laser cycles.
    pub(super) cycles: f64,
    /// The bins that are looked at.
    pub(super) bins: Range<usize>,
    pub(super) free: Free,
    /// The most background that the bins beside an echo allow, photons in a bin and laser cycle.
    pub(super) most_background: f64,
}

/// The most likely light.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct Fit {
    pub(super) light: EchoLight,
    /// Twice the ln likelihood that is missing to bins that are each as likely as can be.
    pub(super) deviance: f64,
    /// Bins less parameters, at least 1.
    pub(super) freedom: f64,
    pub(super) has_converged: bool,
    /// Cramér-Rao bound of the position, bins.
    pub(super) bound_bins: f64,
}

impl Fit {
    /// Whether counts scatter about this light's as they should: less than one in 30 000 right fits would scatter more. The
    /// deviance is χ², whose cube root is normal (Wilson and Hilferty), and four standard deviations of that are allowed.
    pub(super) fn explains(&self) -> bool {
        self.has_converged && self.is_close()
    }

    /// The same of a light that need not be the most likely one.
    pub(super) fn is_close(&self) -> bool {
        let variance = 2.0 / (9.0 * self.freedom);
        let most = self.freedom * (1.0 - variance + 4.0 * variance.sqrt()).powi(3);
        self.deviance <= most
    }
}

/// What the histogram says at some light.
struct Local {
    background: f64,
    deviance: f64,
    score: [f64; PARAMETERS],
    information: [[f64; PARAMETERS]; PARAMETERS],
}

impl Likelihood<'_> {
    /// Twice the ln likelihood that is missing at these chances.
    fn deviance_of(&self, chances: impl Iterator<Item = f64>) -> f64 {
        let bins = self.counts.iter().zip(chances).enumerate();
        let seen = bins.filter(|(bin, _)| self.bins.contains(bin));
        2.0 * seen
            .map(|(_, (&counts, chance))| {
                let chance = chance.clamp(LEAST_CHANCE, 1.0 - LEAST_CHANCE);
                let missed = self.cycles - counts;
                let share = |part: f64, chance: f64| match part > 0.0 {
                    true => part * libm::log(part / (self.cycles * chance)),
                    false => 0.0,
                };
                share(counts, chance) + share(missed, 1.0 - chance)
            })
            .sum::<f64>()
    }

    /// The deviance of some light, about.
    pub(super) fn deviance(&self, light: &EchoLight) -> f64 {
        let chances = self.response.chances_in(light, Steps::Coarse);
        self.deviance_of(chances.into_iter())
    }

    fn at(&self, light: &EchoLight, steps: Steps) -> Local {
        match self.free {
            WIDE_ECHO | WIDE_IN_REGION => {
                self.local(light, self.response.chances_of::<4>(light, steps))
            }
            _ => self.local(light, self.response.chances_of::<3>(light, steps)),
        }
    }

    /// What chances at `light` say, with their slopes with the first K parameters.
    fn local<const K: usize>(&self, light: &EchoLight, chances: Vec<Dual<K>>) -> Local {
        let mut local = Local {
            background: light.background_per_bin,
            deviance: self.deviance_of(chances.iter().map(|chance| chance.value)),
            score: [0.0; PARAMETERS],
            information: [[0.0; PARAMETERS]; PARAMETERS],
        };
        for bin in self.bins.clone() {
            let Dual { value, slope } = chances[bin];
            let chance = value.clamp(LEAST_CHANCE, 1.0 - LEAST_CHANCE);
            let weight = 1.0 / (chance * (1.0 - chance));
            let off = (self.counts[bin] - self.cycles * chance) * weight;
            for (i, by) in slope.into_iter().enumerate() {
                local.score[i] += off * by;
                for (j, other) in slope.into_iter().enumerate() {
                    local.information[i][j] += self.cycles * weight * by * other;
                }
            }
        }
        local
    }

    /// The most likely light near `start`.
    pub(super) fn maximise(&self, start: &EchoLight) -> Fit {
        self.refined(&self.near(start))
    }

    /// The same, about: with the fewest steps.
    pub(super) fn near(&self, start: &EchoLight) -> Fit {
        self.maximise_in(start, Steps::Coarse)
    }

    /// The light that [`Self::near`] found, as finely as it needs.
    pub(super) fn refined(&self, near: &Fit) -> Fit {
        match self.response.needs_fine_steps(&near.light) {
            true => self.maximise_in(&near.light, Steps::Fine),
            false => *near,
        }
    }

    fn maximise_in(&self, start: &EchoLight, steps: Steps) -> Fit {
        let mut light = *start;
        let mut local = self.at(&light, steps);
        let mut damping = 0.0;
        let mut has_converged = false;
        let fitted = self.free.iter().filter(|free| **free).count();
        let freedom = (self.bins.len() as f64 - fitted as f64).max(1.0);
        for _ in 0..ROUNDS {
            let Some(step) = self.step(&light, &local, damping) else {
                damping = f64::max(10.0 * damping, 1e-3);
                continue;
            };
            let gain: f64 = step
                .iter()
                .zip(local.score)
                .map(|(step, score)| step * score)
                .sum();
            let next = self.moved(&light, step);
            let close = CLOSE * (local.deviance / freedom).max(1.0);
            if damping == 0.0 && gain < close {
                has_converged = true;
                break;
            }
            let there = self.at(&next, steps);
            // As far as rounding lets it be told.
            if there.deviance <= local.deviance + 1e-9 * (1.0 + local.deviance) {
                let gained = local.deviance - there.deviance;
                let enough = gain < close && gained < close;
                (light, local) = (next, there);
                if enough {
                    has_converged = true;
                    break;
                }
                // Where much less was gained than promised, steps overshoot to and fro.
                damping = match gained < 0.3 * gain {
                    true => (3.0 * damping).max(0.3),
                    false if damping > 1e-3 => damping / 10.0,
                    false => 0.0,
                };
            } else {
                damping = f64::max(10.0 * damping, 1e-2);
                if damping > 1e9 {
                    break;
                }
            }
        }
        Fit {
            light,
            deviance: local.deviance,
            freedom,
            has_converged,
            bound_bins: self.bound_bins(&local),
        }
    }

    /// The step that the score asks for.
    fn step(&self, light: &EchoLight, local: &Local, damping: f64) -> Option<[f64; PARAMETERS]> {
        let mut matrix = local.information;
        let mut wanted = local.score;
        // What would leave its limits stays at them.
        let slight = self.moved(light, wanted.map(|score| 1e-6 * score.signum()));
        let stays = [
            slight.position_bins == light.position_bins,
            slight.signal == light.signal,
            slight.background_per_bin == light.background_per_bin,
            slight.sigma_bins == light.sigma_bins,
        ];
        for i in 0..PARAMETERS {
            if self.free[i] && !stays[i] {
                // What nothing is known of stays as it is.
                matrix[i][i] += damping * matrix[i][i] + 1e-6;
                continue;
            }
            wanted[i] = 0.0;
            leave_out(&mut matrix, i);
        }
        let mut step = solved(matrix, wanted)?;
        // No farther than the slopes can be trusted: half a bin or pulse, and factors of e.
        let most = [0.5 + 0.5 * self.response.pulse_sigma_bins, 1.0, 1.5, 0.5];
        // Under a THRESHOLD bins say next to nothing of the background, which would hold back everything else.
        if self.response.counting.threshold > 0 {
            step[2] = step[2].clamp(-most[2], most[2]);
        }
        let scale = step
            .iter()
            .zip(most)
            .map(|(step, most)| (most / step.abs()).min(1.0))
            .fold(1.0, f64::min);
        step.iter_mut().for_each(|s| *s *= scale);
        Some(step)
    }

    /// `light` after a step, within what light can be.
    fn moved(&self, light: &EchoLight, step: [f64; PARAMETERS]) -> EchoLight {
        let reach = BESIDE * light.sigma_bins;
        let last = self.response.bins as f64 - 1.0;
        let pulse = self.response.pulse_sigma_bins;
        let least = 1e-3 / (self.cycles * last.max(1.0));
        EchoLight {
            position_bins: (light.position_bins + step[0]).clamp(-reach, last + reach),
            signal: (light.signal * libm::exp(step[1])).clamp(1e-6, 1e7),
            background_per_bin: (light.background_per_bin * libm::exp(step[2])).clamp(least, 1e4),
            sigma_bins: (light.sigma_bins * libm::exp(step[3])).clamp(pulse, pulse + last),
        }
    }

    /// Cramér-Rao bound of the position with everything else that is free unknown.
    fn bound_bins(&self, local: &Local) -> f64 {
        let mut matrix = local.information;
        for (i, _) in self.free.iter().enumerate().filter(|(_, free)| !**free) {
            leave_out(&mut matrix, i);
        }
        // Background that is too little to count is known to be between none and the most: a twelfth of its square.
        if self.free[2] {
            matrix[2][2] += 12.0 * (local.background / self.most_background).powi(2);
        }
        let variance = solved(matrix, [1.0, 0.0, 0.0, 0.0]).map(|column| column[0]);
        variance
            .filter(|variance| *variance > 0.0)
            .map_or(f64::INFINITY, f64::sqrt)
    }
}

/// Makes parameter `i` of a symmetric matrix one that stays as it is.
fn leave_out(matrix: &mut [[f64; PARAMETERS]; PARAMETERS], i: usize) {
    matrix[i] = [0.0; PARAMETERS];
    matrix.iter_mut().for_each(|row| row[i] = 0.0);
    matrix[i][i] = 1.0;
}

/// The solution of a symmetric system; `None` where it is not positive.
fn solved(
    mut matrix: [[f64; PARAMETERS]; PARAMETERS],
    mut wanted: [f64; PARAMETERS],
) -> Option<[f64; PARAMETERS]> {
    for i in 0..PARAMETERS {
        let pivot = matrix[i][i];
        if pivot.is_nan() || pivot <= 1e-200 {
            return None;
        }
        let of_pivot = matrix[i];
        for row in i + 1..PARAMETERS {
            let factor = matrix[row][i] / pivot;
            for (of_row, of_pivot) in matrix[row].iter_mut().zip(of_pivot) {
                *of_row -= factor * of_pivot;
            }
            wanted[row] -= factor * wanted[i];
        }
    }
    for i in (0..PARAMETERS).rev() {
        for col in i + 1..PARAMETERS {
            wanted[i] -= matrix[i][col] * wanted[col];
        }
        wanted[i] /= matrix[i][i];
    }
    Some(wanted)
}

#[cfg(test)]
mod tests;
