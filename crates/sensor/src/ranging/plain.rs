//! Plain SPADs through a laser cycle: non-paralysable, blind for a bin at least, and fired by light alone.
//!
//! ```text
//!   light of a step     x photons ─► stays ready e⁻ˣ, recovers in it and stays ready (1 − e⁻ˣ)/x       for all steps at once
//!   step after step     ready' = ready·e⁻ˣ + ending·(1 − e⁻ˣ)/x        ending: what fired a dead time before, from its running sum
//! ```
//!
//! These are the sums of [`spad_state`](super::spad_state), with steps that may differ in length: time goes finely only under the pulse and a
//! dead time later. What had fired by a time between two steps comes from a cubic, so that fewer steps do: of 256 places in 10³ to 10⁴ photons,
//! with 32 steps of a bin 6 are more than a tenth of their bound beside those of very fine steps (180 more than a hundredth), and with straight
//! lines and 96 steps in all bins 4 (55). A histogram takes some fifty to three hundred steps, and a fit some ten histograms; therefore exponentials
//! come as vectors, and what one step waits for of the one before is a product and a sum.

#![allow(
    unsafe_code,
    reason = "multiversion calls what the processor was asked for"
)]

use multiversion::multiversion;

use super::pulse::Pulse;
use crate::numerics::{Dual, branchless};

/// Steps to a bin away from the pulse.
const STEPS_BESIDE: usize = 2;

/// Standard deviations before and after its centre in which a pulse needs its own steps: 3·10⁻⁷ of it comes before, 3·10⁻⁶ after.
const BEGINS: f64 = 5.0;
const ENDS: f64 = 4.5;

/// Steps in which time goes, of one length within a bin.
#[derive(Debug, Clone)]
pub(super) struct Steps {
    /// The first bin, which may lie before those of the histogram.
    first_bin: f64,
    /// Steps of each bin from there.
    of_bins: Vec<usize>,
}

impl Steps {
    /// Those of `bins` bins: `steps` in each with light of the pulse, and in each where SPADs recover from it a dead time of `dead` bins later.
    pub(super) fn new(first_bin: f64, bins: usize, pulse: &Pulse, steps: usize, dead: f64) -> Self {
        let [from, to] = pulse.within(BEGINS, ENDS);
        let is_lit = |begin: f64| begin + 1.0 > from && begin < to;
        let of_bin = |bin| {
            let begin = first_bin - 0.5 + bin as f64;
            if is_lit(begin) || is_lit(begin - dead) {
                steps
            } else {
                STEPS_BESIDE
            }
        };
        Steps {
            first_bin,
            of_bins: (0..bins).map(of_bin).collect(),
        }
    }

    /// Times between steps, bins.
    fn times(&self) -> Vec<f64> {
        let mut times = Vec::with_capacity(self.of_bins.iter().sum::<usize>() + 1);
        let mut begin = self.first_bin - 0.5;
        for &steps in &self.of_bins {
            let length = 1.0 / steps as f64;
            times.extend((0..steps).map(|step| begin + step as f64 * length));
            begin += 1.0;
        }
        times.push(begin);
        times
    }
}

/// What the light of a step does to SPADs.
struct Hits {
    /// That no photon comes to one that is ready.
    none: f64,
    /// That none comes after one has recovered, and how fast this falls with the photons.
    missed: f64,
    falls: f64,
}

impl Hits {
    /// Of x photons: e⁻ˣ, (1 − e⁻ˣ)/x and its slope.
    #[inline(always)]
    fn new(x: f64) -> Self {
        let none = branchless::exp(-x);
        let inverse = 1.0 / x;
        let missed = (1.0 - none) * inverse;
        let falls = (missed - none) * inverse;
        // Σ (−x)ⁿ/(n+1)!; the next term is below 10⁻¹³.
        let of_few = 1.0 - x * (0.5 - x * (1.0 / 6.0 - x * (1.0 / 24.0 - x / 120.0)));
        let falls_of_few = 0.5 - x * (1.0 / 3.0 - x * (1.0 / 8.0 - x / 30.0));
        let is_few = x < 1e-2;
        Hits {
            none,
            missed: if is_few { of_few } else { missed },
            falls: if is_few { falls_of_few } else { falls },
        }
    }
}

/// How often a SPAD with a dead time of `dead` bins fires in a bin under `background` photons alone.
pub(super) fn steady<const K: usize>(background: f64, dead: f64) -> Dual<K> {
    let ready = 1.0 / (1.0 + background * dead);
    let slopes = [0.0, 0.0, background * ready * ready, 0.0];
    Dual {
        value: background * ready,
        slope: std::array::from_fn(|parameter| slopes[parameter]),
    }
}

/// Weights of values at four times in the cubic through them.
#[inline(always)]
fn cubic(time: f64, times: &[f64]) -> [f64; 4] {
    let [a, b, c, d] = [times[0], times[1], times[2], times[3]];
    let (to_a, to_b, to_c, to_d) = (time - a, time - b, time - c, time - d);
    let (ab, ac, ad, bc, bd, cd) = (b - a, c - a, d - a, c - b, d - b, d - c);
    [
        -to_b * to_c * to_d / (ab * ac * ad),
        to_a * to_c * to_d / (ab * bc * bd),
        -to_a * to_b * to_d / (ac * bc * cd),
        to_a * to_b * to_c / (ad * bd * cd),
    ]
}

/// What comes of a step.
#[derive(Debug, Clone, Copy, Default)]
struct Step {
    /// Of SPADs that are ready, and of those that recover: the share that fires and the share that stays ready.
    hit: f64,
    none: f64,
    late: f64,
    missed: f64,
    falls: f64,
    /// Slopes of the photons with place, ln signal, ln background and ln width.
    slopes: [f64; 4],
    /// What had fired a dead time before the end: these parts of four sums in a row.
    first: usize,
    parts: [f64; 4],
}

/// Puts behind `of_bins` the chance of a SPAD with a dead time of `dead` bins to fire in each bin of `steps`, with its slopes with the first K of
/// place, ln signal, ln background and ln width. Before the first step there is background alone, `background` photons a bin.
#[multiversion(targets("x86_64+avx512f+avx512bw+avx512dq+avx512vl", "x86_64+avx2"))]
pub(super) fn fired<const K: usize>(
    (pulse, background): (&Pulse, f64),
    steps: &Steps,
    dead: f64,
    of_bins: &mut Vec<Dual<K>>,
) {
    let times = steps.times();
    let count = times.len() - 1;
    let [until, by_place, by_width] = pulse.until_each(&times);
    let mut rows = vec![0.0; 3 * count];
    let (none, rest) = rows.split_at_mut(count);
    let (missed, falls) = rest.split_at_mut(count);
    for step in 0..count {
        let of_step = until[step + 1] - until[step] + background * (times[step + 1] - times[step]);
        let hits = Hits::new(of_step);
        none[step] = hits.none;
        missed[step] = hits.missed;
        falls[step] = hits.falls;
    }
    let mut laws = vec![Step::default(); count];
    // The time before which a dead time ends.
    let mut at = 0;
    for (step, law) in laws.iter_mut().enumerate() {
        let ends = times[step + 1] - dead;
        while times[at] < ends {
            at += 1;
        }
        let of_pulse = until[step + 1] - until[step];
        let of_background = background * (times[step + 1] - times[step]);
        let (first, parts) = if at >= 2 && at < step {
            (at - 2, cubic(ends, &times[at - 2..at + 2]))
        } else if at >= 1 {
            let part = (ends - times[at - 1]) / (times[at] - times[at - 1]);
            (at - 1, [1.0 - part, part, 0.0, 0.0])
        } else {
            (0, [1.0 + (ends - times[0]) / dead, 0.0, 0.0, 0.0])
        };
        *law = Step {
            hit: (of_pulse + of_background) * missed[step],
            none: none[step],
            late: 1.0 - missed[step],
            missed: missed[step],
            falls: falls[step],
            slopes: [
                by_place[step + 1] - by_place[step],
                of_pulse,
                of_background,
                by_width[step + 1] - by_width[step],
            ],
            first,
            parts,
        };
    }
    let Dual { value, slope } = steady::<4>(background, dead);
    // Sums of what has fired since a dead time before the first step.
    let mut sums = vec![0.0; count + 4];
    let mut slopes = vec![[0.0; 4]; if K > 0 { count + 4 } else { 0 }];
    sums[0] = value * dead;
    let mut sum = sums[0];
    let mut ready = 1.0 - sum;
    let mut sum_slopes = slope.map(|slope| slope * dead);
    let mut ready_slopes = sum_slopes.map(|slope| -slope);
    if K > 0 {
        slopes[0] = sum_slopes;
    }
    let (mut ended, mut ended_slopes) = (0.0, [0.0; 4]);
    for (step, law) in laws.iter().enumerate() {
        let Step {
            hit,
            none,
            late,
            missed,
            ..
        } = *law;
        let [a, b, c, d] = law.parts;
        let of: &[f64; 4] = sums[law.first..law.first + 4].try_into().expect("four");
        let now = (of[0] * a + of[1] * b) + (of[2] * c + of[3] * d);
        let ending = now - ended;
        ended = now;
        if K > 0 {
            let more = ready * none + ending * law.falls;
            let of: &[[f64; 4]; 4] = slopes[law.first..law.first + 4].try_into().expect("four");
            for k in 0..4 {
                let now = (of[0][k] * a + of[1][k] * b) + (of[2][k] * c + of[3][k] * d);
                let ending = now - ended_slopes[k];
                ended_slopes[k] = now;
                let more = law.slopes[k] * more;
                sum_slopes[k] += ready_slopes[k] * hit + ending * late + more;
                ready_slopes[k] = ready_slopes[k] * none + ending * missed - more;
            }
            slopes[step + 1] = sum_slopes;
        }
        sum += ready * hit + ending * late;
        ready = ready * none + ending * missed;
        sums[step + 1] = sum;
    }
    let mut from = 0;
    for &of_bin in &steps.of_bins {
        let to = from + of_bin;
        of_bins.push(Dual {
            value: sums[to] - sums[from],
            slope: std::array::from_fn(|k| slopes[to][k] - slopes[from][k]),
        });
        from = to;
    }
}
