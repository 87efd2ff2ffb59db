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
            WIDE_ECHO => self.local(light, self.response.chances_of::<4>(light, steps)),
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
mod tests {
    use super::*;
    use crate::chip::SensorConfig;
    use crate::units::Time;
    use proptest::prelude::*;

    const CYCLES: f64 = 1000.0;

    fn response(threshold: u8) -> Response {
        let config = SensorConfig {
            threshold,
            ..SensorConfig::default()
        };
        Response::new(&config, 1.0 / config.clk_hz, Time::from_ps(1_911))
    }

    fn likelihood<'a>(
        response: &'a Response,
        counts: &'a [f64],
        bins: Range<usize>,
        free: Free,
    ) -> Likelihood<'a> {
        Likelihood {
            response,
            counts,
            cycles: CYCLES,
            bins,
            free,
            most_background: 0.1,
        }
    }

    /// Parameters in their order.
    fn moved_by(light: &EchoLight, parameter: usize, by: f64) -> EchoLight {
        let mut light = *light;
        match parameter {
            0 => light.position_bins += by,
            1 => light.signal *= by.exp(),
            2 => light.background_per_bin *= by.exp(),
            _ => light.sigma_bins *= by.exp(),
        }
        light
    }

    prop_compose! {
        fn lights()(
            position_bins in 2f64..13.0, ln_signal in -2f64..3.0, ln_background in -6f64..-1.0, sigma_bins in 0.74f64..2.0,
        ) -> EchoLight {
            EchoLight { position_bins, signal: ln_signal.exp(), background_per_bin: ln_background.exp(), sigma_bins }
        }
    }

    fn counts() -> impl Strategy<Value = Vec<f64>> {
        let count = prop_oneof![8 => 0u32..1001, 1 => Just(0), 1 => Just(1000)];
        prop::collection::vec(count.prop_map(f64::from), 16)
    }

    fn bins() -> impl Strategy<Value = Range<usize>> {
        (0usize..6, 10usize..17).prop_map(|(first, end)| first..end)
    }

    /// Of the parameters that are free, the matrix's determinant, with column `swapped` by `column`.
    fn determinant(
        matrix: &[[f64; PARAMETERS]; PARAMETERS],
        free: &[usize],
        swapped: Option<(usize, &[f64])>,
    ) -> f64 {
        let at = |row: usize, col: usize| match swapped {
            Some((which, column)) if which == col => column[row],
            _ => matrix[row][col],
        };
        let Some((&row, rest)) = free.split_first() else {
            return 1.0;
        };
        // Along the first row: minors of the others, by permutations.
        fn minors(rows: &[usize], cols: &[usize], at: &dyn Fn(usize, usize) -> f64) -> f64 {
            let Some((&row, rows)) = rows.split_first() else {
                return 1.0;
            };
            let of_col = |(n, &col): (usize, &usize)| {
                let others: Vec<usize> =
                    cols.iter().copied().filter(|&other| other != col).collect();
                let sign = if n % 2 == 0 { 1.0 } else { -1.0 };
                sign * at(row, col) * minors(rows, &others, at)
            };
            cols.iter().enumerate().map(of_col).sum()
        }
        let rows: Vec<usize> = std::iter::once(row).chain(rest.iter().copied()).collect();
        minors(&rows, free, &at)
    }

    proptest! {
        #[test]
        fn the_deviance_is_what_is_missing_to_the_counts_own_shares(
            counts in counts(), bins in bins(), light in lights(), threshold in 0u8..3,
        ) {
            let response = response(threshold);
            let chances = response.chances_in(&light, Steps::Coarse);
            let ln = |count: f64, chance: f64| if count > 0.0 { count * chance.ln() } else { 0.0 };
            let ln_likelihood = |count: f64, chance: f64| ln(count, chance) + ln(CYCLES - count, 1.0 - chance);
            let missing: f64 = bins.clone().map(|bin| {
                let chance = chances[bin].clamp(1e-9, 1.0 - 1e-9);
                ln_likelihood(counts[bin], counts[bin] / CYCLES) - ln_likelihood(counts[bin], chance)
            }).sum();
            let found = likelihood(&response, &counts, bins, ECHO).deviance(&light);
            prop_assert!((found - 2.0 * missing).abs() < 1e-9 * (1.0 + found), "{found} {missing}");
        }

        #[test]
        fn score_and_information_are_those_of_the_chances_slopes(
            counts in counts(), bins in bins(), light in lights(), threshold in 0u8..3, is_wide: bool,
        ) {
            let response = response(threshold);
            let likelihood = likelihood(&response, &counts, bins.clone(), if is_wide { WIDE_ECHO } else { ECHO });
            let parameters = if is_wide { 4 } else { 3 };
            let chances = |light: &EchoLight| response.chances_in(light, Steps::Coarse);
            let slopes: Vec<Vec<f64>> = (0..parameters).map(|parameter| {
                const BY: f64 = 1e-4;
                let [more, less] = [BY, -BY].map(|by| chances(&moved_by(&light, parameter, by)));
                more.iter().zip(less).map(|(more, less)| (more - less) / (2.0 * BY)).collect()
            }).collect();
            let chances = chances(&light);
            let local = likelihood.at(&light, Steps::Coarse);
            let sum = |of: &dyn Fn(usize, f64) -> f64| -> f64 {
                bins.clone().map(|bin| of(bin, chances[bin].clamp(1e-9, 1.0 - 1e-9))).sum()
            };
            for i in 0..parameters {
                let score = |bin: usize, p: f64| (counts[bin] / p - (CYCLES - counts[bin]) / (1.0 - p)) * slopes[i][bin];
                let scale = sum(&|bin, p| score(bin, p).abs());
                prop_assert!((local.score[i] - sum(&score)).abs() < 1e-4 * scale + 1e-6, "score {i}");
                for j in 0..parameters {
                    let told = |bin: usize, p: f64| CYCLES * slopes[i][bin] * slopes[j][bin] / (p * (1.0 - p));
                    let scale = sum(&|bin, p| told(bin, p).abs());
                    prop_assert!((local.information[i][j] - sum(&told)).abs() < 1e-4 * scale + 1e-6, "told {i} {j}");
                }
            }
            prop_assert_eq!(local.background, light.background_per_bin);
        }

        /// By Cramer's rule.
        #[test]
        fn steps_and_bounds_solve_what_is_free(
            factors in prop::array::uniform4(prop::array::uniform4(-1f64..1.0)),
            score in prop::array::uniform4(-3f64..3.0),
            free in prop::array::uniform4(any::<bool>()),
            light in lights(),
            damping in prop::sample::select(vec![0.0, 0.5, 30.0]),
        ) {
            let mut information = [[0.0; PARAMETERS]; PARAMETERS];
            for (i, row) in information.iter_mut().enumerate() {
                for (j, of_row) in row.iter_mut().enumerate() {
                    *of_row = factors.iter().map(|row| row[i] * row[j]).sum();
                }
                row[i] += 0.2;
            }
            let (response, counts) = (response(0), [0.0; 16]);
            let likelihood = likelihood(&response, &counts, 0..16, free);
            let local = Local { background: light.background_per_bin, deviance: 0.0, score, information };
            let numbers: Vec<usize> = (0..PARAMETERS).filter(|&i| free[i]).collect();

            let mut damped = information;
            (0..PARAMETERS).for_each(|i| damped[i][i] += damping * information[i][i] + 1e-6);
            let step = likelihood.step(&light, &local, damping).unwrap();
            let whole: Vec<f64> = (0..PARAMETERS).map(|i| match free[i] {
                true => determinant(&damped, &numbers, Some((i, &score))) / determinant(&damped, &numbers, None),
                false => 0.0,
            }).collect();
            let most = [0.5 + 0.5 * response.pulse_sigma_bins, 1.0, 1.5, 0.5];
            let times = whole.iter().zip(most).map(|(step, most)| step.abs() / most).fold(1.0, f64::max);
            for (step, whole) in step.iter().zip(&whole) {
                prop_assert!((step - whole / times).abs() < 1e-6 * (1.0 + whole.abs()), "{step} {whole} {times}");
            }

            let mut known = information;
            if free[2] {
                // The variance of a number that may be anything between none and the most.
                known[2][2] += 12.0 * (light.background_per_bin / 0.1).powi(2);
            }
            let bound = likelihood.bound_bins(&local);
            let unit = [1.0, 0.0, 0.0, 0.0];
            let variance = match free[0] {
                true => determinant(&known, &numbers, Some((0, &unit))) / determinant(&known, &numbers, None),
                false => 1.0,
            };
            prop_assert!((bound / variance.sqrt() - 1.0).abs() < 1e-6, "{bound} {variance}");
        }
    }

    #[test]
    fn what_is_not_positive_has_no_solution() {
        let unit = [
            [1.0, 0.0, 0.0, 0.0],
            [0.0, 1.0, 0.0, 0.0],
            [0.0, 0.0, 1.0, 0.0],
            [0.0, 0.0, 0.0, 1.0],
        ];
        assert_eq!(
            solved(unit, [1.0, 2.0, 3.0, 4.0]),
            Some([1.0, 2.0, 3.0, 4.0])
        );
        for pivot in [0.0, -1.0, f64::NAN] {
            let mut matrix = unit;
            matrix[2][2] = pivot;
            assert_eq!(solved(matrix, [1.0; 4]), None);
        }
    }

    #[test]
    fn light_moves_within_what_light_can_be() {
        let response = response(0);
        let (counts, pulse) = ([0.0; 16], response.pulse_sigma_bins);
        let likelihood = likelihood(&response, &counts, 0..16, ECHO);
        let light = EchoLight {
            position_bins: 7.0,
            signal: 2.0,
            background_per_bin: 0.01,
            sigma_bins: 1.5,
        };
        let as_numbers = |light: EchoLight| {
            [
                light.position_bins,
                light.signal,
                light.background_per_bin,
                light.sigma_bins,
            ]
        };
        let moved = |by: f64| as_numbers(likelihood.moved(&light, [by; 4]));
        let near = |found: [f64; 4], expected: [f64; 4]| {
            let is_near = |(found, expected): (&f64, f64)| (found / expected - 1.0).abs() < 1e-12;
            assert!(
                found.iter().zip(expected).all(is_near),
                "{found:?} {expected:?}"
            );
        };
        let grown = 0.2f64.exp();
        near(moved(0.2), [7.2, 2.0 * grown, 0.01 * grown, 1.5 * grown]);
        // Three widths beside the bins, and a pulse as wide as they are.
        near(moved(100.0), [15.0 + 4.5, 1e7, 1e4, pulse + 15.0]);
        near(moved(-100.0), [-4.5, 1e-6, 1e-3 / (CYCLES * 15.0), pulse]);
    }

    #[test]
    fn one_in_30_000_right_fits_scatters_more_than_is_explained() {
        let with = |freedom: f64, deviance: f64| Fit {
            light: EchoLight {
                position_bins: 7.0,
                signal: 1.0,
                background_per_bin: 0.1,
                sigma_bins: 1.0,
            },
            deviance,
            freedom,
            has_converged: true,
            bound_bins: 1.0,
        };
        // Of chi-squared, which the cube root's normal law overestimates: by 4 % at 3 bins more than parameters.
        for (freedom, quantile) in [(3.0, 23.51), (13.0, 43.92), (100.0, 166.8)] {
            let (less, more) = (
                with(freedom, 0.99 * quantile),
                with(freedom, 1.06 * quantile),
            );
            assert!(less.explains() && !more.explains(), "{freedom}");
        }
        let unfinished = Fit {
            has_converged: false,
            ..with(13.0, 1.0)
        };
        assert!(unfinished.is_close() && !unfinished.explains());
    }
}
