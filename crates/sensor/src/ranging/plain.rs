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
//!
//! Lights of one fit have the same steps again and again, so a thread keeps its latest steps, and the memory for its sums.

#![allow(
    unsafe_code,
    reason = "multiversion calls what the processor was asked for"
)]

use std::cell::RefCell;
use std::rc::Rc;

use multiversion::multiversion;
use smallvec::SmallVec;

use super::pulse::Pulse;
use crate::numerics::{Dual, branchless};

/// Steps to a bin away from the pulse.
const STEPS_BESIDE: u8 = 2;

/// Standard deviations before and after its centre in which a pulse needs its own steps: 3·10⁻⁷ of it comes before, 3·10⁻⁶ after.
const BEGINS: f64 = 5.0;
const ENDS: f64 = 4.5;

/// Steps that a thread keeps.
const MOST_KEPT: usize = 64;

thread_local! {
    /// The latest steps that differ, the last first.
    static LATEST: RefCell<Vec<Rc<PlainSteps>>> = const { RefCell::new(Vec::new()) };
    static ROWS: RefCell<Rows> = RefCell::default();
}

/// Steps in which time goes, of one length within a bin, and what follows from them alone.
#[derive(Debug)]
pub(super) struct PlainSteps {
    /// The first bin, which may lie before those of the histogram.
    first_bin: f64,
    /// Steps of each bin from there.
    of_bins: SmallVec<[u8; 32]>,
    /// Dead time, bins.
    dead: f64,
    /// Times between steps, bins.
    times: Vec<f64>,
    /// From one time to the next.
    lengths: Vec<f64>,
    /// What had fired a dead time before the end of each step: these parts of four sums in a row, from the first of these.
    parts: Vec<(usize, [f64; 4])>,
}

impl PlainSteps {
    /// Those of `bins` bins: `steps` in each with light of a pulse, and in each where SPADs recover from it a dead time of `dead` bins later.
    pub(super) fn for_pulses(
        first_bin: f64,
        bins: usize,
        pulses: &[Pulse],
        steps: usize,
        dead: f64,
    ) -> Rc<Self> {
        let steps = u8::try_from(steps).expect("few steps");
        let lit = pulses.iter().map(|pulse| pulse.extent(BEGINS, ENDS));
        let lit: SmallVec<[[f64; 2]; LANES]> = lit.collect();
        let is_lit = |begin: f64| {
            lit.iter()
                .any(|&[from, to]| begin + 1.0 > from && begin < to)
        };
        let of_bin = |bin| {
            let begin = first_bin - 0.5 + bin as f64;
            if is_lit(begin) || is_lit(begin - dead) {
                steps
            } else {
                STEPS_BESIDE
            }
        };
        let of_bins: SmallVec<[u8; 32]> = (0..bins).map(of_bin).collect();
        LATEST.with_borrow_mut(|latest| {
            let is_same = |known: &Rc<Self>| {
                known.first_bin == first_bin && known.dead == dead && known.of_bins == of_bins
            };
            if let Some(at) = latest.iter().position(is_same) {
                latest[..=at].rotate_right(1);
            } else {
                latest.truncate(MOST_KEPT - 1);
                latest.insert(0, Rc::new(Self::new(first_bin, of_bins, dead)));
            }
            Rc::clone(&latest[0])
        })
    }

    fn new(first_bin: f64, of_bins: SmallVec<[u8; 32]>, dead: f64) -> Self {
        let mut times = Vec::new();
        let mut begin = first_bin - 0.5;
        for &steps in &of_bins {
            let length = 1.0 / f64::from(steps);
            times.extend((0..steps).map(|step| begin + f64::from(step) * length));
            begin += 1.0;
        }
        times.push(begin);
        PlainSteps {
            first_bin,
            of_bins,
            dead,
            lengths: times.windows(2).map(|ends| ends[1] - ends[0]).collect(),
            parts: parts_before(&times, dead),
            times,
        }
    }

    /// The first and the last of the times of each bin, by their numbers.
    fn ends_of_bins(&self) -> impl Iterator<Item = (usize, usize)> {
        self.of_bins.iter().scan(0, |from, &of_bin| {
            let ends = (*from, *from + usize::from(of_bin));
            *from = ends.1;
            Some(ends)
        })
    }
}

/// Memory for numbers of each step, which fits take again and again.
#[derive(Debug, Default)]
struct Rows {
    until: Vec<f64>,
    by_place: Vec<f64>,
    by_width: Vec<f64>,
    none: Vec<f64>,
    missed: Vec<f64>,
    falls: Vec<f64>,
    sums: Vec<f64>,
    slopes: Vec<[f64; 4]>,
    lanes: LaneRows,
}

/// The same for lights side by side.
#[derive(Debug, Default)]
struct LaneRows {
    until: Vec<Lanes>,
    by_place: Vec<Lanes>,
    by_width: Vec<Lanes>,
    sums: Vec<Lanes>,
    /// K numbers to a time.
    slopes: Vec<Lanes>,
}

/// As many zeros.
fn zeros<T: Copy + Default>(row: &mut Vec<T>, length: usize) -> &mut [T] {
    row.clear();
    row.resize(length, T::default());
    row
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

/// Chances of bins, and their slopes.
pub(super) type OfBins<const K: usize> = SmallVec<[Dual<K>; 16]>;

/// Puts behind `of_bins` the chance of a SPAD to fire in each bin of `steps`, with its slopes with place, ln signal, ln background and ln width where
/// `K` is 4; they are none where it is 0. Before the first step there is background alone, `background` photons a bin.
pub(super) fn fired<const K: usize>(
    pulse: &Pulse,
    background: f64,
    steps: &PlainSteps,
    of_bins: &mut OfBins<K>,
) {
    const { assert!(K == 0 || K == 4, "slopes come all together") };
    ROWS.with_borrow_mut(|rows| fired_in(pulse, background, steps, rows, of_bins));
}

#[multiversion(targets("x86_64+avx512f+avx512bw+avx512dq+avx512vl", "x86_64+avx2"))]
fn fired_in<const K: usize>(
    pulse: &Pulse,
    background: f64,
    steps: &PlainSteps,
    rows: &mut Rows,
    of_bins: &mut OfBins<K>,
) {
    let (times, count) = (&steps.times[..], steps.lengths.len());
    let (lengths, parts) = (&steps.lengths[..count], &steps.parts[..count]);
    let until = zeros(&mut rows.until, count + 1);
    let with_slopes = if K > 0 { count + 1 } else { 0 };
    let by_place = zeros(&mut rows.by_place, with_slopes);
    let by_width = zeros(&mut rows.by_width, with_slopes);
    pulse.until_each_in(times, |at, values| {
        until[at] = values[0];
        if K > 0 {
            by_place[at] = values[1];
            by_width[at] = values[2];
        }
    });
    // Lengths that the compiler knows save it from checking each place.
    let until = &until[..count + 1];
    let (by_place, by_width) = (&by_place[..with_slopes], &by_width[..with_slopes]);
    let none = &mut zeros(&mut rows.none, count)[..count];
    let missed = &mut zeros(&mut rows.missed, count)[..count];
    let falls = &mut zeros(&mut rows.falls, count)[..count];
    for step in 0..count {
        let hits = Hits::new(until[step + 1] - until[step] + background * lengths[step]);
        none[step] = hits.none;
        missed[step] = hits.missed;
        falls[step] = hits.falls;
    }
    let Dual { value, slope } = steady::<4>(background, steps.dead);
    // Sums of what has fired since a dead time before the first step.
    let sums = &mut zeros(&mut rows.sums, count + 4)[..count + 4];
    let slopes = zeros(&mut rows.slopes, if K > 0 { count + 4 } else { 0 });
    sums[0] = value * steps.dead;
    let mut sum = sums[0];
    let mut ready = 1.0 - sum;
    let mut sum_slopes = slope.map(|slope| slope * steps.dead);
    let mut ready_slopes = sum_slopes.map(|slope| -slope);
    if K > 0 {
        slopes[0] = sum_slopes;
    }
    let (mut ended, mut ended_slopes) = (0.0, [0.0; 4]);
    for step in 0..count {
        let (first, [a, b, c, d]) = parts[step];
        let (none, missed) = (none[step], missed[step]);
        let of_pulse = until[step + 1] - until[step];
        let of_background = background * lengths[step];
        let (hit, late) = ((of_pulse + of_background) * missed, 1.0 - missed);
        let around: &[f64; 4] = sums[first..first + 4].try_into().expect("four");
        let now = (around[0] * a + around[1] * b) + (around[2] * c + around[3] * d);
        let ending = now - ended;
        ended = now;
        if K > 0 {
            let more = ready * none + ending * falls[step];
            let photons = [
                by_place[step + 1] - by_place[step],
                of_pulse,
                of_background,
                by_width[step + 1] - by_width[step],
            ];
            let [w, x, y, z]: &[[f64; 4]; 4] = slopes[first..first + 4].try_into().expect("four");
            for k in 0..4 {
                let now = (w[k] * a + x[k] * b) + (y[k] * c + z[k] * d);
                let ending = now - ended_slopes[k];
                ended_slopes[k] = now;
                let more = photons[k] * more;
                sum_slopes[k] += ready_slopes[k] * hit + ending * late + more;
                ready_slopes[k] = ready_slopes[k] * none + ending * missed - more;
            }
            slopes[step + 1] = sum_slopes;
        }
        sum += ready * hit + ending * late;
        ready = ready * none + ending * missed;
        sums[step + 1] = sum;
    }
    of_bins.reserve(steps.of_bins.len());
    for (from, to) in steps.ends_of_bins() {
        of_bins.push(Dual {
            value: sums[to] - sums[from],
            slope: std::array::from_fn(|k| slopes[to][k] - slopes[from][k]),
        });
    }
}

/// Lights whose chances are found at once: numbers of a vector of 512 bits, and two of 256.
pub(super) const LANES: usize = 8;

/// A number of each of these lights.
type Lanes = [f64; LANES];

/// The same as [`fired`] for some lights at once, each with its own pulse and background, in the same steps; slopes are the first K.
pub(super) fn fired_by_each<const K: usize>(
    pulses: &[Pulse; LANES],
    background: &Lanes,
    steps: &PlainSteps,
    of_bins: &mut [OfBins<K>; LANES],
) {
    ROWS.with_borrow_mut(|rows| {
        fired_by_each_in(pulses, background, steps, &mut rows.lanes, of_bins);
    });
}

#[multiversion(targets("x86_64+avx512f+avx512bw+avx512dq+avx512vl", "x86_64+avx2"))]
fn fired_by_each_in<const K: usize>(
    pulses: &[Pulse; LANES],
    background: &Lanes,
    steps: &PlainSteps,
    rows: &mut LaneRows,
    of_bins: &mut [OfBins<K>; LANES],
) {
    let (times, count) = (&steps.times[..], steps.lengths.len());
    let until = zeros(&mut rows.until, count + 1);
    let by_place = zeros(&mut rows.by_place, if K > 0 { count + 1 } else { 0 });
    let by_width = zeros(&mut rows.by_width, if K > 3 { count + 1 } else { 0 });
    for (lane, pulse) in pulses.iter().enumerate() {
        pulse.until_each_in(times, |at, values| {
            until[at][lane] = values[0];
            if K > 0 {
                by_place[at][lane] = values[1];
            }
            if K > 3 {
                by_width[at][lane] = values[2];
            }
        });
    }
    let start: [Dual<4>; LANES] = background.map(|background| steady(background, steps.dead));
    let sums = zeros(&mut rows.sums, count + 4);
    let slopes = zeros(&mut rows.slopes, K * (count + 4));
    let mut sum: Lanes = std::array::from_fn(|l| start[l].value * steps.dead);
    let mut sum_slopes: [Lanes; K] =
        std::array::from_fn(|k| std::array::from_fn(|l| start[l].slope[k] * steps.dead));
    let mut ready = sum.map(|sum| 1.0 - sum);
    let mut ready_slopes = sum_slopes.map(|slopes| slopes.map(|slope| -slope));
    let mut ended = [0.0; LANES];
    let mut ended_slopes = [[0.0; LANES]; K];
    sums[0] = sum;
    slopes[..K].copy_from_slice(&sum_slopes);
    for (step, &(first, [a, b, c, d])) in steps.parts.iter().enumerate() {
        let length = steps.lengths[step];
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
        for k in 0..K {
            let [w, x, y, z] = [0, 1, 2, 3].map(|sum| &slopes[K * (first + sum) + k]);
            for l in 0..LANES {
                // Place, ln signal, ln background and ln width.
                let photons = match k {
                    0 => by_place[step + 1][l] - by_place[step][l],
                    1 => to[l] - from[l],
                    2 => background[l] * length,
                    _ => by_width[step + 1][l] - by_width[step][l],
                };
                let now = (w[l] * a + x[l] * b) + (y[l] * c + z[l] * d);
                let ending = now - ended_slopes[k][l];
                ended_slopes[k][l] = now;
                let more = photons * more[l];
                let was_ready = ready_slopes[k][l];
                sum_slopes[k][l] += was_ready * of_ready[0][l] + ending * of_ending[0][l] + more;
                ready_slopes[k][l] = was_ready * of_ready[1][l] + ending * of_ending[1][l] - more;
            }
        }
        slopes[K * (step + 1)..K * (step + 2)].copy_from_slice(&sum_slopes);
    }
    for (l, of_bins) in of_bins.iter_mut().enumerate() {
        of_bins.reserve(steps.of_bins.len());
        for (from, to) in steps.ends_of_bins() {
            of_bins.push(Dual {
                value: sums[to][l] - sums[from][l],
                slope: std::array::from_fn(|k| slopes[K * to + k][l] - slopes[K * from + k][l]),
            });
        }
    }
}
