//! All SPADs of all laser cycles in one pool: the fast way in little light.
//!
//! ```text
//!   pool: all  SPADs ──┬─ fired 1, 2, … steps ago: the number of each
//!                      └─ free
//!   one CLK period: W₁ of N cycles see a photon at all, W₂ of those on a second SPAD, …     (binomial)
//!                   K of the SPADs that do are ones that fired lately                        (hypergeometric)
//!                   these are followed one by one; those without a pulse are taken off the cycles they fell into
//! ```
//!
//! What need not wait for the period before is drawn for many periods at once: all W, and the candidates for K.
//!
//! SPADs are independent of each other, so the pool's counts are exact, and so is each bin's distribution: which SPADs
//! of the pool fire in a period is a uniform choice. What the pool does not keep is which of them share a cycle. Two
//! bins' counts then lose the part of their correlation that passes through coincidences within a cycle: at most
//! ρ² of their variance, where ρ = p/(1 − p) for the probability p of a photon on a SPAD in a period.
//!
//! By histories ([`recent`](super::recent)) the scene `van` would take 2.5 times as long, `glass` 1.6 and the street 1.2 times.

#![allow(
    unsafe_code,
    reason = "multiversion calls what the processor was asked for"
)]

use multiversion::multiversion;
use smallvec::{SmallVec, smallvec};

use super::abreast::{LANES, binomials};
use super::blindness::{Ages, Blindness};
use super::cycles::LikeCycles;
use super::draw::binomial;
use super::events::EventTable;
use super::overlap::Overlap;
use super::spad_light::{DIM, absorbed, absorbed_dim};
use super::words::RandomWords;
use super::{Counts, Means};
use crate::chip::MOST_SPADS;
use crate::numerics::branchless::{VECTOR, count, real};
use crate::photon::DeadTimeLaw;

/// Most photons on a SPAD in a CLK period.
pub(super) fn largest(means: &Means) -> f64 {
    means.iter().copied().fold(0.0, f64::max)
}

/// Most photons on a SPAD in a CLK period with which [`draw_counts`] leaves out no larger correlations between two bins than this
/// `neglect`: ρ for it is eᵐ − 1 with m photons.
pub(super) fn most_photons(neglect: f64) -> f64 {
    libm::log1p(neglect.sqrt())
}

/// Mean number of SPADs in a period that [`draw_counts`] has to follow one by one, of `spads` in all laser cycles, with `photons` on a SPAD
/// in it at most.
pub(super) fn looked_at(blindness: &Blindness, photons: f64, spads: u64) -> f64 {
    spads as f64 * blindness.memory() as f64 * photons * photons
}

/// Counts of every bin after these laser cycles.
#[multiversion(targets("x86_64+avx512f+avx512bw+avx512dq+avx512vl", "x86_64+avx2"))]
pub(crate) fn draw_counts(
    like: &LikeCycles,
    is_event: &EventTable,
    random: &mut RandomWords,
) -> Counts {
    let odds = odds(&like.means);
    let cycles = like.cycles;
    let spads = is_event.spads() as u64 * cycles;
    let mut fired = fired_before(&like.ages, spads, random);
    fired.resize(fired.len() + odds.len(), 0);
    let pool = Pool::new(&like.blindness, spads, &mut fired);
    match is_event.spads() {
        // The same, for the compiler to unroll.
        16 => follow::<16>(16, &odds, pool, is_event, cycles, random),
        spads => follow::<MOST_SPADS>(spads, &odds, pool, is_event, cycles, random),
    }
}

/// `MOST` is no less than `spads`.
#[inline(always)]
fn follow<const MOST: usize>(
    spads: usize,
    odds: &[f64],
    mut pool: Pool,
    is_event: &EventTable,
    cycles: u64,
    random: &mut RandomWords,
) -> Counts {
    let mut counts = Counts::new();
    for odds in odds.chunks(LANES) {
        let mut seen = draw_hits::<MOST>(odds, spads, cycles, random);
        let sums = seen.hits();
        let (overlaps, candidates) = pool.candidates(&sums, random);
        for lane in 0..odds.len() {
            let hit = sums[lane];
            let blind = pool.go_blind(&overlaps[lane], candidates[lane], hit, random);
            take_off(blind, &mut seen.0, lane, hit, random);
        }
        counts.extend_from_slice(&seen.events(is_event)[..odds.len()]);
    }
    counts
}

/// p/(1 − p) for the probability p of a photon on a SPAD, by CLK period.
#[inline(always)]
fn odds(means: &Means) -> Means {
    let mut photons = means.clone();
    if photons.iter().all(|&mean| mean < DIM) {
        for photon in &mut photons {
            *photon = absorbed_dim(*photon);
        }
    } else {
        for photon in &mut photons {
            *photon = absorbed(*photon);
        }
    }
    for photon in &mut photons {
        *photon /= 1.0 - *photon;
    }
    photons
}

/// Rows of [`HitCycles`] that need no memory of their own.
const FEW_ROWS: usize = 5;

/// Cycles in which 0, 1, 2, … SPADs are hit at least, for each of several CLK periods, down to the first row of zeros.
struct HitCycles(SmallVec<[[u64; LANES]; FEW_ROWS]>);

impl HitCycles {
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

    /// Cycles in which enough SPADs are hit to make an event.
    #[inline(always)]
    fn events(&self, is_event: &EventTable) -> [u64; LANES] {
        let mut events = [0; LANES];
        let none = [0; LANES];
        let beyond = self.0[1..].iter().chain([&none]);
        for ((row, next), &is_event) in self.0.iter().zip(beyond).zip(&is_event.0) {
            let counts = if is_event { u64::MAX } else { 0 };
            for lane in 0..LANES {
                events[lane] += (row[lane] - next[lane]) & counts;
            }
        }
        events
    }
}

/// With o = p/(1 − p), of cycles in which k or more of n SPADs are hit it is k with probability 1/tₖ, where
/// tₖ = 1 + (n − k)/(k + 1) · o · tₖ₊₁ and tₙ = 1: every term is positive, so no digits are lost.
#[inline(always)]
fn draw_hits<const MOST: usize>(
    odds_of_periods: &[f64],
    spads: usize,
    cycles: u64,
    random: &mut RandomWords,
) -> HitCycles {
    let mut odds = [0.0; LANES];
    odds[..odds_of_periods.len()].copy_from_slice(odds_of_periods);
    // tₖ − 1
    let mut more = [[0.0; LANES]; MOST];
    let more = &mut more[..spads];
    let mut t = [1.0; LANES];
    for (hit, more) in more.iter_mut().enumerate().rev() {
        let ways = (spads - hit) as f64 / (hit + 1) as f64;
        for lane in 0..LANES {
            more[lane] = ways * odds[lane] * t[lane];
            t[lane] = 1.0 + more[lane];
        }
    }
    let mut at_least = [cycles; LANES];
    let mut seen = SmallVec::new();
    for more in more {
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
    // There always is a row of two SPADs.
    seen.resize(seen.len().max(3), [0; LANES]);
    HitCycles(seen)
}

/// Takes `count` of the `hits` SPADs with a pulse in the period of this lane off the cycles they fell into.
#[inline(always)]
fn take_off(
    count: u64,
    seen: &mut [[u64; LANES]],
    lane: usize,
    hits: u64,
    random: &mut RandomWords,
) {
    if count == 0 {
        return;
    }
    let mut left = real(hits);
    // Most cycles have one pulse.
    let mut alone = real(seen[1][lane] - seen[2][lane]);
    let mut emptied = 0;
    for _ in 0..count {
        let place = random.coarse() * left;
        if place < alone {
            alone -= 1.0;
            emptied += 1;
        } else {
            let with = take_off_others(place - alone, seen, lane);
            alone += if with == 2 { 1.0 } else { 0.0 };
        }
        left -= 1.0;
    }
    seen[1][lane] -= emptied;
}

/// Takes the pulse at `place`, of those in cycles with two and more, off its cycle, and says how many that had.
#[cold]
fn take_off_others(mut place: f64, seen: &mut [[u64; LANES]], lane: usize) -> usize {
    let mut with = 2;
    loop {
        let more = seen.get(with + 1).map_or(0, |row| row[lane]);
        let pulses = real(with as u64 * (seen[with][lane] - more));
        if place < pulses {
            break;
        }
        place -= pulses;
        with += 1;
    }
    seen[with][lane] -= 1;
    with
}

/// Steps that need no memory of their own.
const FEW: usize = 2 * LANES;

/// How many of all SPADs fired last in each step of a dead time before the window, the earliest first.
#[inline(always)]
fn fired_before(ages: &Ages, spads: u64, random: &mut RandomWords) -> SmallVec<[u64; FEW]> {
    let (mut left, mut share_left) = (spads, 1.0);
    let aged = ages.aged.iter().map(|&share| {
        let p = Ages::conditional_share(share, share_left);
        let count = binomial(left, p, 1.0 - p, random);
        left -= count;
        share_left -= share;
        count
    });
    let mut fired: SmallVec<_> = aged.collect();
    fired.reverse();
    fired
}

struct Pool<'a> {
    blindness: &'a Blindness,
    spads: u64,
    /// SPADs that fired last in each step, from a dead time before the window on.
    fired: &'a mut [u64],
    /// The step to come among them.
    now: usize,
    /// How many of the last ages before a period are surely blind in it, and how many SPADs are of these ages now.
    surely_blind: usize,
    idle: u64,
    /// SPADs hit in every period; in those before the window, SPADs that fired last then.
    hits: SmallVec<[u64; FEW]>,
}

impl<'a> Pool<'a> {
    /// `fired` has room for the window.
    fn new(blindness: &'a Blindness, spads: u64, fired: &'a mut [u64]) -> Self {
        let before = &fired[..blindness.memory()];
        let surely_blind = blindness.surely_blind();
        Pool {
            blindness,
            spads,
            now: before.len(),
            surely_blind,
            idle: before[before.len() - surely_blind..].iter().sum(),
            hits: before.into(),
            fired,
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
        let memory = self.blindness.memory();
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

    /// How many of the SPADs `hit` in a period are too blind for a pulse. All SPADs grow a period older.
    #[inline(always)]
    fn go_blind(
        &mut self,
        overlap: &Overlap,
        candidates: u64,
        hit: u64,
        random: &mut RandomWords,
    ) -> u64 {
        let (blindness, memory) = (self.blindness, self.blindness.memory());
        let groups = 1 + memory - self.surely_blind;
        let first = self.now - memory;
        // One vector is the common case, and stays in registers.
        let (mut few, mut many): ([_; 1], SmallVec<[[f64; VECTOR]; 4]>);
        let missed = if groups <= VECTOR {
            few = [[0.0; VECTOR]];
            self.draw_missed(overlap, candidates, &mut few, random);
            few.as_flattened()
        } else {
            many = smallvec![[0.0; VECTOR]; groups.div_ceil(VECTOR)];
            self.draw_missed(overlap, candidates, &mut many, random);
            many.as_flattened()
        };
        let mut without_pulse = self.idle - count(missed[0]);
        let mut others = hit - without_pulse;
        let (fired, renewed) = self.fired.split_at_mut(self.now);
        let may_fire = &mut fired[self.now - memory..self.now - self.surely_blind];
        for (step, (fired, missed)) in may_fire.iter_mut().zip(missed.windows(2)).enumerate() {
            let met = *fired - count(missed[1] - missed[0]);
            others -= met;
            for _ in 0..met {
                let able = blindness.firing_probability(first, memory - step);
                let pulses = able > 0.0 && random.coarse() < able;
                if pulses || blindness.law == DeadTimeLaw::Paralysable {
                    renewed[0] += 1;
                    *fired -= 1;
                }
                without_pulse += u64::from(!pulses);
            }
        }
        renewed[0] += others;
        self.idle += self.fired[self.now];
        self.idle -= self.fired[self.now - self.surely_blind];
        self.now += 1;
        without_pulse
    }

    /// Sets `missed` to how many SPADs are not met in this period: first the surely blind ones, then those and the oldest
    /// of the others, and so on to the youngest.
    #[inline(always)]
    fn draw_missed(
        &self,
        overlap: &Overlap,
        candidates: u64,
        missed: &mut [[f64; VECTOR]],
        random: &mut RandomWords,
    ) {
        let may_fire = self.now - self.blindness.memory()..self.now - self.surely_blind;
        let mut fired = self.fired[may_fire].iter();
        let mut up_to = self.idle;
        for group in missed.iter_mut().flatten() {
            *group = real(up_to);
            up_to += fired.next().unwrap_or(&0);
        }
        overlap.draw_marked(candidates, missed, random);
    }
}
