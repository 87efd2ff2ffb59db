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

#![allow(
    unsafe_code,
    reason = "multiversion calls what the processor was asked for"
)]

use std::ops::Range;

use multiversion::multiversion;
use smallvec::SmallVec;

use super::expected::{EchoLight, PARAMETERS, Response, Steps};
use crate::numerics::{Dual, branchless};

/// Bins of a histogram for which sums need no memory of their own.
const MOST_BINS: usize = 16;

/// Chances beyond which none is believed: a count that the model says never comes costs 21 in ln likelihood.
const LEAST_CHANCE: f64 = 1e-9;

/// Rounds at most. Nine of ten fits take four.
const ROUNDS: usize = 40;

/// Where the next step would be less than so much of the parameters' standard deviations, squared; as many times as much as counts
/// scatter more than they should, because a light that explains nothing need not be found exactly.
const CLOSE: f64 = 1e-4;

/// The same where only the deviance is asked for, and not the light.
const ROUGHLY: f64 = 0.01;

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
/// What is left where the place is given.
pub(super) const ONLY_SIGNAL: Free = [false, true, false, false];

/// Deviance that a width of its own must save (Akaike).
pub(super) const OF_A_WIDTH: f64 = 2.0;

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
    fn deviance_of<const K: usize>(&self, chances: &[Dual<K>]) -> f64 {
        let values = chances[self.bins.clone()].iter().map(|chance| chance.value);
        let values: SmallVec<[f64; MOST_BINS]> = values.collect();
        2.0 * missing(&self.counts[self.bins.clone()], &values, self.cycles)
    }

    /// The deviances of some lights.
    pub(super) fn deviances(&self, lights: &[EchoLight], steps: Steps) -> Vec<f64> {
        let mut deviances = Vec::with_capacity(lights.len());
        self.response
            .chances_of_each::<0>(lights, steps, |_, chances| {
                deviances.push(self.deviance_of(chances));
            });
        deviances
    }

    /// Tells what the histogram says at each of some lights, with their numbers, in order.
    fn at_each(&self, lights: &[EchoLight], steps: Steps, tell: impl FnMut(usize, Local)) {
        match self.free {
            WIDE_ECHO | WIDE_IN_REGION => self.locals::<4>(lights, steps, tell),
            ONLY_SIGNAL | IN_REGION => self.locals::<2>(lights, steps, tell),
            _ => self.locals::<3>(lights, steps, tell),
        }
    }

    fn locals<const K: usize>(
        &self,
        lights: &[EchoLight],
        steps: Steps,
        mut tell: impl FnMut(usize, Local),
    ) {
        self.response
            .chances_of_each::<K>(lights, steps, |number, chances| {
                tell(number, self.local(&lights[number], chances));
            });
    }

    /// What chances at `light` say, with their slopes with the first K parameters.
    fn local<const K: usize>(&self, light: &EchoLight, chances: &[Dual<K>]) -> Local {
        let mut local = Local {
            background: light.background_per_bin,
            deviance: self.deviance_of(chances),
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
        self.maximise_each(&[*start]).remove(0)
    }

    /// The same near each of some starts: first with the fewest steps.
    pub(super) fn maximise_each(&self, starts: &[EchoLight]) -> Vec<Fit> {
        self.refined_each(&self.near_each(starts, Steps::Coarse))
    }

    /// The same in such steps.
    pub(super) fn near_each(&self, starts: &[EchoLight], steps: Steps) -> Vec<Fit> {
        self.maximise_in(starts, steps, CLOSE)
    }

    /// The least deviance near a start, about, and a light that nearly has it: what is missing to it is reckoned from the slopes.
    pub(super) fn roughly_near(&self, start: &EchoLight) -> Fit {
        self.maximise_in(&[*start], Steps::Coarse, ROUGHLY)
            .remove(0)
    }

    /// The lights that [`Self::near_each`] found, as finely as they need.
    pub(super) fn refined_each(&self, near: &[Fit]) -> Vec<Fit> {
        let needs_fine = |fit: &&Fit| self.response.needs_fine_steps(&fit.light);
        let starts = near.iter().filter(needs_fine).map(|fit| fit.light);
        let starts: Vec<EchoLight> = starts.collect();
        let mut fine = self.maximise_in(&starts, Steps::Fine, CLOSE).into_iter();
        let refined = near.iter().map(|fit| {
            let of_fit = needs_fine(&fit).then(|| fine.next().expect("one of each start"));
            of_fit.unwrap_or(*fit)
        });
        refined.collect()
    }

    /// All climb side by side, because the chances of many lights cost little more than those of one.
    fn maximise_in(&self, starts: &[EchoLight], steps: Steps, close: f64) -> Vec<Fit> {
        let mut climbs: SmallVec<[Climb; 2]> = SmallVec::new();
        self.at_each(starts, steps, |number, there| {
            climbs.push(Climb::new(starts[number], there));
        });
        let mut under_way: SmallVec<[usize; 2]> = SmallVec::new();
        let mut lights: SmallVec<[EchoLight; 2]> = SmallVec::new();
        loop {
            under_way.clear();
            lights.clear();
            for (number, climb) in climbs.iter_mut().enumerate() {
                if let Some(next) = climb.next(self, close) {
                    lights.push(next);
                    under_way.push(number);
                }
            }
            if lights.is_empty() {
                break;
            }
            self.at_each(&lights, steps, |number, there| {
                climbs[under_way[number]].go_to(lights[number], there);
            });
        }
        climbs.into_iter().map(|climb| climb.fit(self)).collect()
    }

    fn freedom(&self) -> f64 {
        let fitted = self.free.iter().filter(|free| **free).count();
        (self.bins.len() as f64 - fitted as f64).max(1.0)
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
        let step = solved(matrix, wanted)?;
        let mut step = step.iter().all(|by| by.is_finite()).then_some(step)?;
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

/// A search for the most likely light, between two steps.
struct Climb {
    light: EchoLight,
    local: Local,
    damping: f64,
    rounds: usize,
    /// What the step that was asked for promises, and what is close enough.
    gain: f64,
    close: f64,
    has_converged: bool,
    is_over: bool,
}

impl Climb {
    fn new(light: EchoLight, local: Local) -> Self {
        Climb {
            light,
            local,
            damping: 0.0,
            rounds: 0,
            gain: 0.0,
            close: 0.0,
            has_converged: false,
            is_over: false,
        }
    }

    /// The light to look at next; `None` at the end.
    fn next(&mut self, likelihood: &Likelihood<'_>, close: f64) -> Option<EchoLight> {
        while !self.is_over && self.rounds < ROUNDS {
            self.rounds += 1;
            let Some(step) = likelihood.step(&self.light, &self.local, self.damping) else {
                self.damping = f64::max(10.0 * self.damping, 1e-3);
                continue;
            };
            let promised = step.iter().zip(self.local.score);
            self.gain = promised.map(|(step, score)| step * score).sum();
            self.close = close * (self.local.deviance / likelihood.freedom()).max(1.0);
            if self.damping == 0.0 && self.gain < self.close {
                self.has_converged = true;
                self.is_over = true;
                if close > CLOSE {
                    self.local.deviance -= self.gain;
                }
                break;
            }
            return Some(likelihood.moved(&self.light, step));
        }
        None
    }

    /// Goes to a light, if it is more likely.
    fn go_to(&mut self, light: EchoLight, there: Local) {
        // As far as rounding lets it be told.
        if there.deviance <= self.local.deviance + 1e-9 * (1.0 + self.local.deviance) {
            let gained = self.local.deviance - there.deviance;
            (self.light, self.local) = (light, there);
            if self.gain < self.close && gained < self.close {
                self.has_converged = true;
                self.is_over = true;
            }
            // Where much less was gained than promised, steps overshoot to and fro.
            self.damping = if gained < 0.3 * self.gain {
                (3.0 * self.damping).max(0.3)
            } else if self.damping > 1e-3 {
                self.damping / 10.0
            } else {
                0.0
            };
        } else {
            self.damping = f64::max(10.0 * self.damping, 1e-2);
            self.is_over = self.damping > 1e9;
        }
    }

    fn fit(self, likelihood: &Likelihood<'_>) -> Fit {
        Fit {
            light: self.light,
            deviance: self.local.deviance,
            freedom: likelihood.freedom(),
            has_converged: self.has_converged,
            bound_bins: likelihood.bound_bins(&self.local),
        }
    }
}

/// The ln likelihood that is missing at these chances.
#[multiversion(targets("x86_64+avx512f+avx512bw+avx512dq+avx512vl", "x86_64+avx2"))]
fn missing(counts: &[f64], chances: &[f64], cycles: f64) -> f64 {
    let mut terms: SmallVec<[f64; MOST_BINS]> = SmallVec::from_elem(0.0, counts.len());
    for ((term, &counts), &chance) in terms.iter_mut().zip(counts).zip(chances) {
        let chance = chance.clamp(LEAST_CHANCE, 1.0 - LEAST_CHANCE);
        let missed = cycles - counts;
        let of_counts = counts * branchless::ln(counts / (cycles * chance));
        let of_missed = missed * branchless::ln(missed / (cycles * (1.0 - chance)));
        let [counted, uncounted] = [(counts, of_counts), (missed, of_missed)]
            .map(|(part, share)| if part > 0.0 { share } else { 0.0 });
        *term = counted + uncounted;
    }
    // Of light beyond all measure no chance is known.
    if chances.iter().any(|chance| chance.is_nan()) {
        return f64::INFINITY;
    }
    terms.iter().sum()
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
