//! All SPADs of all laser cycles in one pool: the fast way in little light.
//!
//! ```text
//!   pool: 16 N SPADs ──┬─ fired 1, 2, … steps ago: so many of each
//!                      └─ free
//!   one CLK period: W₁ of N cycles see a photon at all, W₂ of those on a second SPAD, …     (binomial)
//!                   K of the SPADs that do are ones that fired lately                        (hypergeometric)
//!                   these are followed one by one, step by step; those without a pulse are taken off the
//!                   cycles they fell into
//!                   the others are split by the step in which they fire                      (binomial)
//! ```
//!
//! What need not wait for the period before is drawn for many periods at once: all W, and the candidates for K.
//!
//! SPADs are independent of each other, so the pool's counts are exact, and so is each bin's distribution: which SPADs
//! of the pool fire in a period is a uniform choice. What the pool does not keep is which of them share a cycle. Two
//! bins' counts then lose the part of their correlation that passes through coincidences within a cycle: at most
//! ρ² of their variance, where ρ = p/(1 − p) for p photons on a SPAD in a period. [`neglected`] gives it.

use multiversion::multiversion;
use smallvec::{SmallVec, smallvec};

use super::abreast::{LANES, binomials};
use super::blindness::{Ages, Blindness};
use super::draw::binomial;
use super::overlap::Overlap;
use super::period::{Period, Photons};
use super::words::RandomWords;
use super::{Counts, EventTable, Steps};
use crate::numerics::branchless::{count, floor, real};
use crate::photon::SPADS;

/// Most photons on a SPAD in a CLK period.
fn largest(steps: &Steps) -> f64 {
    let periods = steps.means.chunks(steps.per_period);
    let means = periods.map(|period| period.iter().sum());
    means.fold(0.0, f64::max)
}

/// Bound on the correlation between two bins that [`run`] leaves out.
pub fn neglected(steps: &Steps) -> f64 {
    libm::expm1(largest(steps)).powi(2)
}

/// Mean number of SPADs in a period that [`run`] has to follow one by one.
pub fn looked_at(blindness: &Blindness, steps: &Steps, cycles: u64) -> f64 {
    let periods = blindness.memory() as f64 / steps.per_period as f64;
    (SPADS as u64 * cycles) as f64 * periods * largest(steps).powi(2)
}

/// Counts of every bin after `cycles` laser cycles that begin in the state `ages`.
#[multiversion(targets("x86_64+avx2", "x86_64+sse4.1"))]
pub fn run(
    blindness: &Blindness,
    ages: &Ages,
    steps: &Steps,
    is_event: &EventTable,
    cycles: u64,
    random: &mut RandomWords,
) -> Counts {
    let photons = Photons::new(steps);
    let mut pool = Pool::new(blindness, ages, steps, cycles, random);
    let mut counts = Counts::new();
    for periods in photons.rows(LANES) {
        let mut seen = see(periods.clone(), cycles, random);
        let sums = seen.hits();
        let (overlaps, candidates) = pool.candidates(&sums, random);
        let mut number = 0;
        for (lane, period) in periods.enumerate() {
            let mut pulses = Pulses {
                seen: &mut seen,
                lane,
                sum: sums[lane],
            };
            pool.go_blind(
                &overlaps[lane],
                candidates[lane],
                sums[lane],
                &mut pulses,
                &period,
                random,
            );
            number += 1;
        }
        counts.extend_from_slice(&seen.events(is_event)[..number]);
    }
    counts
}

/// Rows of [`Seen`] that need no memory of their own.
const FEW_ROWS: usize = 5;

/// Cycles in which 0, 1, 2, … SPADs are hit at least, for each of several CLK periods, down to the first row of zeros.
struct Seen(SmallVec<[[u64; LANES]; FEW_ROWS]>);

impl Seen {
    /// SPADs that are hit.
    #[inline(always)]
    fn hits(&self) -> [u64; LANES] {
        let mut hits = [0; LANES];
        for row in &self.0[1..] {
            for lane in 0..LANES {
                hits[lane] += row[lane];
            }
        }
        hits
    }

    /// Cycles in which so many are hit that it makes an event.
    #[inline(always)]
    fn events(&self, is_event: &EventTable) -> [u64; LANES] {
        let mut events = [0; LANES];
        let none = [0; LANES];
        let beyond = self.0[1..].iter().chain([&none]);
        for ((row, next), &is_event) in self.0.iter().zip(beyond).zip(is_event) {
            let counts = if is_event { u64::MAX } else { 0 };
            for lane in 0..LANES {
                events[lane] += (row[lane] - next[lane]) & counts;
            }
        }
        events
    }
}

/// With o = p/(1 − p), of cycles in which k or more SPADs are hit it is k with probability 1/tₖ, where
/// tₖ = 1 + (16 − k)/(k + 1) · o · tₖ₊₁ and t₁₆ = 1: every term is positive, so no digits are lost.
#[inline(always)]
fn see<'p>(
    periods: impl Iterator<Item = Period<'p>>,
    cycles: u64,
    random: &mut RandomWords,
) -> Seen {
    let mut odds = [0.0; LANES];
    for (odds, period) in odds.iter_mut().zip(periods) {
        *odds = period.odds();
    }
    // tₖ − 1
    let mut more = [[0.0; LANES]; SPADS];
    let mut t = [1.0; LANES];
    for (hit, more) in more.iter_mut().enumerate().rev() {
        let ways = (SPADS - hit) as f64 / (hit + 1) as f64;
        for lane in 0..LANES {
            more[lane] = ways * odds[lane] * t[lane];
            t[lane] = 1.0 + more[lane];
        }
    }
    let mut at_least = [cycles; LANES];
    let mut seen = SmallVec::new();
    for more in &more {
        seen.push(at_least);
        let (mut p, mut exactly) = ([0.0; LANES], [0.0; LANES]);
        for lane in 0..LANES {
            exactly[lane] = 1.0 / (1.0 + more[lane]);
            p[lane] = more[lane] * exactly[lane];
        }
        at_least = binomials(&at_least, &p, &exactly, random);
        if at_least == [0; LANES] {
            break;
        }
    }
    seen.push(at_least);
    Seen(seen)
}

/// SPADs with a pulse in one CLK period: at first all that are hit.
struct Pulses<'s> {
    seen: &'s mut Seen,
    lane: usize,
    sum: u64,
}

impl Pulses<'_> {
    /// Takes one off the cycle it fell into.
    #[inline(always)]
    fn take_off(&mut self, random: &mut RandomWords) {
        let mut place = count(floor(random.coarse() * real(self.sum)));
        let rows = &mut self.seen.0[1..];
        let (mut row, mut with) = (0, 1);
        loop {
            let more = rows.get(row + 1).map_or(0, |row| row[self.lane]);
            let spads = with * (rows[row][self.lane] - more);
            if place < spads {
                break;
            }
            place -= spads;
            row += 1;
            with += 1;
        }
        rows[row][self.lane] -= 1;
        self.sum -= 1;
    }
}

/// Steps that need no memory of their own.
const FEW: usize = 2 * LANES;

struct Pool<'a> {
    blindness: &'a Blindness,
    per_period: usize,
    spads: u64,
    /// SPADs that fired last in each step, from a dead time before the window on.
    fired: SmallVec<[u64; FEW]>,
    /// The step to come among them.
    now: usize,
    /// SPADs hit in every period; in those before the window, SPADs that fired last then.
    hits: SmallVec<[u64; FEW]>,
    /// Blind SPADs that were hit in this period, in the order of those that may fire.
    kept: SmallVec<[u64; 8]>,
}

impl<'a> Pool<'a> {
    fn new(
        blindness: &'a Blindness,
        ages: &Ages,
        steps: &Steps,
        cycles: u64,
        random: &mut RandomWords,
    ) -> Self {
        let per_period = steps.per_period;
        let spads = SPADS as u64 * cycles;
        let (mut left, mut share_left) = (spads, 1.0);
        let aged = ages.aged.iter().map(|&share| {
            let p = if share > 0.0 {
                (share / share_left).min(1.0)
            } else {
                0.0
            };
            let count = binomial(left, p, 1.0 - p, random);
            left -= count;
            share_left -= share;
            count
        });
        let mut fired: SmallVec<[u64; FEW]> = aged.collect();
        let hits = fired.chunks(per_period).rev();
        let hits = hits.map(|period| period.iter().sum()).collect();
        fired.reverse();
        let now = fired.len();
        fired.resize(now + steps.means.len(), 0);
        Pool {
            blindness,
            per_period,
            spads,
            fired,
            now,
            hits,
            kept: smallvec![0; ages.aged.len()],
        }
    }

    /// How many of the SPADs hit in the next periods are candidates for having fired lately.
    #[inline(always)]
    fn candidates(
        &mut self,
        hits: &[u64; LANES],
        random: &mut RandomWords,
    ) -> ([Overlap; LANES], [u64; LANES]) {
        let now = self.hits.len();
        self.hits.extend_from_slice(hits);
        let memory = self.blindness.memory().div_ceil(self.per_period);
        // Who still is blind was hit within the memory.
        let mut bound: u64 = self.hits[now - memory..now].iter().sum();
        let overlaps = std::array::from_fn(|lane| {
            let overlap = Overlap::new(self.spads, hits[lane], bound);
            bound = bound + hits[lane] - self.hits[now + lane - memory];
            overlap
        });
        let (mut p, mut q) = ([0.0; LANES], [0.0; LANES]);
        for lane in 0..LANES {
            p[lane] = overlaps[lane].candidate;
            q[lane] = 1.0 - p[lane];
        }
        let candidates = binomials(hits, &p, &q, random);
        (overlaps, candidates)
    }

    /// Takes those of the SPADs `hit` in a period that are too blind for a pulse off its `pulses`, and lets all SPADs
    /// grow a period older.
    #[inline(always)]
    fn go_blind(
        &mut self,
        overlap: &Overlap,
        candidates: u64,
        hit: u64,
        pulses: &mut Pulses,
        period: &Period,
        random: &mut RandomWords,
    ) {
        let blindness = self.blindness;
        let (fired, renewed) = self.fired.split_at_mut(self.now);
        let matters = &mut fired[self.now - blindness.memory()..];
        self.now += self.per_period;
        let marked: u64 = matters.iter().sum();
        let may_fire = matters.len() - period.surely_blind(blindness);
        let (may_fire, surely_blind) = matters.split_at_mut(may_fire);
        let mut idle: u64 = surely_blind.iter().sum();
        let kept = &mut self.kept[..may_fire.len()];
        kept.fill(0);
        let mut met = 0;
        let mut all_met = overlap.met(candidates, marked);
        while let Some(place) = all_met.next(random) {
            met += 1;
            if place < idle {
                idle -= 1;
                pulses.take_off(random);
                continue;
            }
            let (step, age) = take(may_fire, place - idle, blindness.memory());
            let meeting = period.meet(age, blindness, random);
            match meeting.renewed {
                Some(step) => renewed[step] += 1,
                // It keeps its age, but is not met a second time.
                None => kept[step] += 1,
            }
            if !meeting.pulses {
                pulses.take_off(random);
            }
        }
        for (fired, kept) in may_fire.iter_mut().zip(kept) {
            *fired += *kept;
        }
        period.split(hit - met, blindness.law, random, |step, spads| {
            renewed[step] += spads
        });
    }
}

/// Takes the SPAD at `place` of all out of the step it fired in, the first of which is the `oldest` age. Gives step and
/// age.
#[inline(always)]
fn take(fired: &mut [u64], place: u64, oldest: usize) -> (usize, usize) {
    let (mut step, mut before) = (0, 0);
    // All steps are looked at: which one it is cannot be foreseen.
    for count in fired.iter() {
        before += count;
        step += usize::from(place >= before);
    }
    fired[step] -= 1;
    (step, oldest - step)
}
