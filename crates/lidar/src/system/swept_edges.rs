//! Where bins begin and end, from a sweep of a short laser pulse over them (thesis 6.3.1): without bias, whatever the steps, the counts of
//! a step and the length of the pulse.
//!
//! ```text
//!   counts of a step   ▁▁▂▅█████▅▂▁▁                bin 0            half of the pulse is in either bin at their edge:
//!                             ▁▂▅█████▅▂▁▁          bin 1            each has the fullest bin as often as the other
//!   delay            ──m₀──╎─────╎─────╎──m₁──►
//!                    first edge      last edge       half of the pulse is in no bin: nothing to compare with
//! ```
//!
//! * **Edges between bins.** An edge lies where as many steps have a fuller bin before it as after it. A tie is half a step to either side; a
//!   step without counts says what the step before it said.
//! * **The first and the last edge.** A bin without a neighbour is the fullest wherever it has one count, which is far outside. So the
//!   pulse's counts are added up from outside until the pulse is within the bin for certain, and are divided by the counts of a step
//!   there: this is how many steps the bin reaches.
//! * **What photons do to each other.** Several photons of a laser cycle do not count in proportion, so that a pulse on an edge counts more or
//!   less than half. How much that adds up to is seen at the edges between bins, where both halves count, and is taken out at the first and last
//!   edge.

use std::ops::Range;

use crate::ranging::LineProfile;
use crate::units::Time;

/// Standard deviations of the laser pulse beyond which it is on one side of an edge.
const PULSE_REACH: f64 = 4.0;
/// The same from the first step with a count, which is up to three standard deviations outside.
const FIRST_REACH: f64 = 7.0;

/// Counts of the bins of one window in every step of a sweep.
pub(super) struct Swept<'a> {
    /// Of each step, by bin.
    pub counts: &'a [&'a [u16]],
    /// Delay of the first step.
    pub first: Time,
    /// From one step to the next.
    pub step: Time,
    /// Standard deviation of the laser pulse.
    pub pulse_sigma: Time,
}

impl Swept<'_> {
    /// Middle and length of every bin. All are zero where nothing was counted.
    pub(super) fn profile(&self) -> LineProfile {
        let bins = self.counts[0].len();
        let edges = self.edges_in_steps();
        let edges = edges.unwrap_or_else(|| vec![0.0; bins + 1]);
        let time_s = |steps: f64| self.first.as_s() + steps * self.step.as_s();
        let pairs = || edges.windows(2);
        LineProfile {
            middle_s: pairs()
                .map(|edge| time_s(0.5 * (edge[0] + edge[1])))
                .collect(),
            length_s: pairs()
                .map(|edge| (edge[1] - edge[0]) * self.step.as_s())
                .collect(),
        }
    }

    /// The edges, in steps after the first one; `None` where nothing was counted.
    fn edges_in_steps(&self) -> Option<Vec<f64>> {
        let sums: Vec<f64> = self.counts.iter().map(|counts| sum(counts)).collect();
        let first = sums.iter().position(|&n| n > 0.0)?;
        let last = sums.iter().rposition(|&n| n > 0.0)?;
        let lit = first..last + 1;
        let bins = self.counts[0].len();
        let between: Vec<f64> = (1..bins).map(|bin| self.edge_before(bin, &lit)).collect();

        let sigma_steps = self.pulse_sigma.as_s() / self.step.as_s();
        let reach = (FIRST_REACH * sigma_steps).ceil() as usize;
        // From and until when the pulse is in the window as a whole.
        let inside = (first + reach).min(last)..(last + 1).saturating_sub(reach).max(first + 1);
        let near = PULSE_REACH * sigma_steps;
        let is_apart = |step: &usize| {
            let place = *step as f64;
            between.iter().all(|edge| (place - edge).abs() > near)
        };
        let whole: Vec<usize> = inside.clone().filter(is_apart).collect();
        // Where no step is apart from all edges, all of the window tells what a step counts.
        let of_whole = if whole.is_empty() {
            mean(lit.clone().map(|step| sums[step]))
        } else {
            mean(whole.into_iter().map(|step| sums[step]))
        };
        let in_steps = |steps: Range<usize>| steps.map(|step| sums[step] / of_whole).sum::<f64>();
        // Steps too many at one side of an edge.
        let too_many = mean(between.iter().map(|edge| {
            let from = (edge - near).ceil().max(inside.start as f64) as usize;
            let until = ((edge + near).floor() + 1.0).min(inside.end as f64) as usize;
            let steps = from..until.max(from);
            let length = steps.len() as f64;
            0.5 * (in_steps(steps) - length)
        }));
        // A step stands for the half of it to either side.
        let begin = inside.start as f64 + 0.5 - (in_steps(first..inside.start + 1) - too_many);
        let end = inside.end as f64 - 1.5 + (in_steps(inside.end - 1..last + 1) - too_many);
        let edges = [begin].into_iter().chain(between).chain([end]);
        Some(edges.collect())
    }

    /// The edge before `bin`, among the steps that have counts.
    fn edge_before(&self, bin: usize, lit: &Range<usize>) -> f64 {
        let mut said = 1.0;
        let mut steps_before = 0.0;
        for counts in &self.counts[lit.clone()] {
            let [before, after] = [&counts[..bin], &counts[bin..]].map(|part| part.iter().max());
            if before.max(after) > Some(&0) {
                said = match before.cmp(&after) {
                    std::cmp::Ordering::Greater => 1.0,
                    std::cmp::Ordering::Equal => 0.5,
                    std::cmp::Ordering::Less => 0.0,
                };
            }
            steps_before += said;
        }
        lit.start as f64 - 0.5 + steps_before
    }
}

fn sum(counts: &[u16]) -> f64 {
    counts.iter().map(|&n| f64::from(n)).sum()
}

/// The mean; 0 of nothing.
fn mean(values: impl Iterator<Item = f64>) -> f64 {
    let (n, sum) = values.fold((0.0, 0.0), |(n, sum), value| (n + 1.0, sum + value));
    if n > 0.0 { sum / n } else { 0.0 }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::numerics::intervals::mean_and_sigma;
    use rand::{RngExt, SeedableRng, rngs::StdRng};

    /// Bins of the thesis's length and spread, ps after the first step.
    const EDGES_PS: [f64; 9] = [
        401.3, 2_900.0, 5_618.7, 7_900.4, 10_702.2, 13_399.9, 15_801.0, 18_504.6, 21_200.8,
    ];
    const SIGMA_PS: f64 = 30.0;

    /// How photons of a laser cycle count: probability of a count where a share of the pulse is in the bin.
    type Counting = fn(f64) -> f64;

    /// Off by how much each edge is on average over many sweeps, ps, and the standard error of that.
    fn bias_ps(counting: Counting, step_ps: f64, laser_cycles: u32) -> Vec<(f64, f64)> {
        // As few as tell a bias of some picoseconds: edges scatter less with more laser cycles.
        let sweeps = (3200 / laser_cycles as usize).max(40);
        let mut random = StdRng::seed_from_u64(u64::from(laser_cycles));
        let mut off = vec![Vec::new(); EDGES_PS.len()];
        for _ in 0..sweeps {
            // Where steps lie between edges is chance.
            let shift_ps = random.random_range(0.0..step_ps);
            let steps = (21_700.0 / step_ps) as usize;
            let counts: Vec<Vec<u16>> = (0..steps)
                .map(|step| {
                    let delay_ps = shift_ps + step as f64 * step_ps;
                    let below =
                        |edge: f64| 0.5 * libm::erfc((delay_ps - edge) / SIGMA_PS / 2f64.sqrt());
                    let share = |bin: usize| below(EDGES_PS[bin + 1]) - below(EDGES_PS[bin]);
                    let mut count = |bin: usize| {
                        let share = share(bin);
                        if share < 1e-9 {
                            return 0;
                        }
                        let likely = counting(share);
                        (0..laser_cycles)
                            .filter(|_| random.random::<f64>() < likely)
                            .count() as u16
                    };
                    (0..8).map(&mut count).collect()
                })
                .collect();
            let counts: Vec<&[u16]> = counts.iter().map(Vec::as_slice).collect();
            let swept = Swept {
                counts: &counts,
                first: Time::from_s(shift_ps * 1e-12),
                step: Time::from_s(step_ps * 1e-12),
                pulse_sigma: Time::from_s(SIGMA_PS * 1e-12),
            };
            let profile = swept.profile();
            let begin = |bin: usize| profile.middle_s[bin] - 0.5 * profile.length_s[bin];
            let end = |bin: usize| profile.middle_s[bin] + 0.5 * profile.length_s[bin];
            for (number, off) in off.iter_mut().enumerate() {
                let found_s = if number < 8 { begin(number) } else { end(7) };
                off.push(found_s * 1e12 - EDGES_PS[number]);
            }
        }
        off.iter()
            .map(|off| {
                let (mean, sigma) = mean_and_sigma(off);
                (mean, sigma / (sweeps as f64).sqrt())
            })
            .collect()
    }

    /// Where the fullest bin decides, the first and the last edge are 28 ps off, and 81 ps with 200 laser cycles.
    #[test]
    fn no_edge_is_off_on_average() {
        let half_a_photon: Counting = |share| -0.5 * libm::expm1(-2.0 * 0.5 * share);
        let in_proportion: Counting = |share| 0.3 * share;
        for (counting, step_ps, laser_cycles) in [
            (half_a_photon, 10.0, 16),
            (half_a_photon, 10.0, 200),
            (half_a_photon, 25.0, 40),
            (in_proportion, 10.0, 16),
            (in_proportion, 25.0, 200),
        ] {
            let found = bias_ps(counting, step_ps, laser_cycles);
            for (edge, (off_ps, error_ps)) in found.iter().enumerate() {
                assert!(
                    off_ps.abs() < 4.0 * error_ps + 0.5,
                    "edge {edge}: {off_ps} ± {error_ps} ps, {laser_cycles} cycles, {step_ps} ps"
                );
            }
        }
    }

    #[test]
    fn nothing_is_found_in_the_dark() {
        let dark: [&[u16]; 3] = [&[0, 0]; 3];
        let step = Time::from_ps(10);
        let swept = Swept {
            counts: &dark,
            first: Time::ZERO,
            step,
            pulse_sigma: step,
        };
        assert_eq!(swept.profile().length_s, [0.0, 0.0]);
    }
}
