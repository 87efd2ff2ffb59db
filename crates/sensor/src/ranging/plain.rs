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
//! come as vectors, and what one step waits for of the one before is a product and a sum. Of lights side by side
//! each is a lane of the vectors: starts of a search, and fits that climb together.

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
    /// Those of `bins` bins: `steps` in each with light of a pulse, and in each where SPADs recover from it a dead time of `dead` bins later.
    pub(super) fn new(
        first_bin: f64,
        bins: usize,
        pulses: &[Pulse],
        steps: usize,
        dead: f64,
    ) -> Self {
        let is_lit = |begin: f64| {
            pulses.iter().any(|pulse| {
                let [from, to] = pulse.within(BEGINS, ENDS);
                begin + 1.0 > from && begin < to
            })
        };
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

/// What had fired a dead time before the end of each step: these parts of four sums in a row, from the first of these.
#[inline(always)]
fn parts_before(times: &[f64], dead: f64) -> Vec<(usize, [f64; 4])> {
    let mut parts = Vec::with_capacity(times.len());
    // The time before which a dead time ends.
    let mut at = 0;
    for step in 0..times.len() - 1 {
        let ends = times[step + 1] - dead;
        while times[at] < ends {
            at += 1;
        }
        parts.push(if at >= 2 && at < step {
            (at - 2, cubic(ends, &times[at - 2..at + 2]))
        } else if at >= 1 {
            let part = (ends - times[at - 1]) / (times[at] - times[at - 1]);
            (at - 1, [1.0 - part, part, 0.0, 0.0])
        } else {
            (0, [1.0 + (ends - times[0]) / dead, 0.0, 0.0, 0.0])
        });
    }
    parts
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
    let parts = parts_before(&times, dead);
    for ((step, law), (first, parts)) in laws.iter_mut().enumerate().zip(parts) {
        let of_pulse = until[step + 1] - until[step];
        let of_background = background * (times[step + 1] - times[step]);
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

/// Lights whose chances are found at once: numbers of a vector of 512 bits, and two of 256.
pub(super) const LANES: usize = 8;

/// A number of each of these lights.
type Lanes = [f64; LANES];

/// The same as [`fired`] for some lights at once, each with its own pulse and background, in the same steps.
#[multiversion(targets("x86_64+avx512f+avx512bw+avx512dq+avx512vl", "x86_64+avx2"))]
pub(super) fn fired_by_each<const K: usize>(
    (pulses, background): (&[Pulse; LANES], &Lanes),
    steps: &Steps,
    dead: f64,
) -> Vec<[Dual<K>; LANES]> {
    let times = steps.times();
    let count = times.len() - 1;
    let with_slopes = if K > 0 { count + 1 } else { 0 };
    let mut until = vec![[0.0; LANES]; count + 1];
    let mut by_place = vec![[0.0; LANES]; with_slopes];
    let mut by_width = vec![[0.0; LANES]; if K > 3 { count + 1 } else { 0 }];
    for (lane, pulse) in pulses.iter().enumerate() {
        pulse.until_each_in(&times, |at, values| {
            until[at][lane] = values[0];
            if K > 0 {
                by_place[at][lane] = values[1];
            }
            if K > 3 {
                by_width[at][lane] = values[2];
            }
        });
    }
    let start: [Dual<4>; LANES] = background.map(|background| steady(background, dead));
    let mut sums = vec![[0.0; LANES]; count + 4];
    let mut slopes = vec![[[0.0; LANES]; K]; if K > 0 { count + 4 } else { 1 }];
    let mut sum: Lanes = std::array::from_fn(|l| start[l].value * dead);
    let mut sum_slopes: [Lanes; K] =
        std::array::from_fn(|k| std::array::from_fn(|l| start[l].slope[k] * dead));
    let mut ready = sum.map(|sum| 1.0 - sum);
    let mut ready_slopes = sum_slopes.map(|slopes| slopes.map(|slope| -slope));
    let mut ended = [0.0; LANES];
    let mut ended_slopes = [[0.0; LANES]; K];
    sums[0] = sum;
    slopes[0] = sum_slopes;
    for (step, (first, [a, b, c, d])) in parts_before(&times, dead).into_iter().enumerate() {
        let length = times[step + 1] - times[step];
        let (from, to) = (&until[step], &until[step + 1]);
        let [w, x, y, z]: &[Lanes; 4] = sums[first..first + 4].try_into().expect("four");
        let mut more = [0.0; LANES];
        let mut of_ready = [[0.0; LANES]; 2];
        let mut of_ending = [[0.0; LANES]; 2];
        for l in 0..LANES {
            let photons = to[l] - from[l] + background[l] * length;
            let Hits {
                none,
                missed,
                falls,
            } = Hits::new(photons);
            let (hit, late) = (photons * missed, 1.0 - missed);
            let now = (w[l] * a + x[l] * b) + (y[l] * c + z[l] * d);
            let ending = now - ended[l];
            ended[l] = now;
            more[l] = ready[l] * none + ending * falls;
            sum[l] += ready[l] * hit + ending * late;
            ready[l] = ready[l] * none + ending * missed;
            of_ready[0][l] = hit;
            of_ready[1][l] = none;
            of_ending[0][l] = late;
            of_ending[1][l] = missed;
        }
        sums[step + 1] = sum;
        if K == 0 {
            continue;
        }
        let [w, x, y, z]: &[[Lanes; K]; 4] = slopes[first..first + 4].try_into().expect("four");
        for k in 0..K {
            for l in 0..LANES {
                // Place, ln signal, ln background and ln width.
                let photons = match k {
                    0 => by_place[step + 1][l] - by_place[step][l],
                    1 => to[l] - from[l],
                    2 => background[l] * length,
                    _ => by_width[step + 1][l] - by_width[step][l],
                };
                let now = (w[k][l] * a + x[k][l] * b) + (y[k][l] * c + z[k][l] * d);
                let ending = now - ended_slopes[k][l];
                ended_slopes[k][l] = now;
                let more = photons * more[l];
                let was_ready = ready_slopes[k][l];
                sum_slopes[k][l] += was_ready * of_ready[0][l] + ending * of_ending[0][l] + more;
                ready_slopes[k][l] = was_ready * of_ready[1][l] + ending * of_ending[1][l] - more;
            }
        }
        slopes[step + 1] = sum_slopes;
    }
    let mut from = 0;
    let of_bin = |&of_bin: &usize| {
        let to = from + of_bin;
        let of_lane = |l: usize| Dual {
            value: sums[to][l] - sums[from][l],
            slope: std::array::from_fn(|k| slopes[to][k][l] - slopes[from][k][l]),
        };
        let fired = std::array::from_fn(of_lane);
        from = to;
        fired
    };
    steps.of_bins.iter().map(of_bin).collect()
}
