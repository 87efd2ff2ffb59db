//! All SPADs of all laser cycles in one pool: the fast way in little light.
//!
//! ```text
//!   pool: 16 N SPADs ──┬─ fired 1, 2, … CLK periods ago: so many of each
//!                      └─ free
//!   one CLK period: W₁ of N cycles see a photon at all, W₂ of those on a second SPAD, …     (binomial)
//!                   K of those photons meet SPADs that fired lately                          (hypergeometric)
//!                   blind ones are taken off the cycles they fell into
//! ```
//!
//! SPADs are independent of each other, so the pool's counts are exact, and so is each bin's distribution: which SPADs
//! of the pool fire in a period is a uniform choice. What the pool does not keep is which of them share a cycle. Two
//! bins' counts then lose the part of their correlation that passes through coincidences within a cycle: at most
//! ρ² of their variance, where ρ = p/(1 − p) for p photons on a SPAD in a period. [`neglected`] gives it.

use rand_philox::Philox;

use super::blindness::{Ages, Blindness};
use super::draw::{below, binomial, overlap, uniform};
use super::hits::Hits;
use super::{EventTable, Steps};
use crate::photon::{DeadTimeLaw, SPADS};

/// Bound on the correlation between two bins that [`run`] leaves out.
pub fn neglected(steps: &Steps) -> f64 {
    let largest = steps.means.iter().fold(0.0, |a: f64, &b| a.max(b));
    libm::expm1(largest).powi(2)
}

/// Mean number of photons in a period that [`run`] has to look at one by one.
pub fn looked_at(blindness: &Blindness, steps: &Steps, cycles: u64) -> f64 {
    let largest = steps.means.iter().fold(0.0, |a: f64, &b| a.max(b));
    (SPADS as u64 * cycles) as f64 * blindness.memory() as f64 * largest * largest
}

/// Counts of every bin after `cycles` laser cycles that begin in the state `ages`; one step is a CLK period.
pub fn run(
    blindness: &Blindness,
    ages: &Ages,
    steps: &Steps,
    is_event: &EventTable,
    cycles: u64,
    random: &mut Philox,
) -> Vec<u64> {
    debug_assert_eq!(steps.per_period, 1);
    let mut pool = Pool::new(blindness, ages, cycles, random);
    let mut last: Option<(f64, Hits)> = None;
    steps
        .means
        .iter()
        .map(|&mean| {
            let hits = match last {
                Some((before, hits)) if before == mean => hits,
                _ => Hits::new(SPADS, -libm::expm1(-mean), libm::exp(-mean)),
            };
            last = Some((mean, hits));
            let with = pool.period(&hits, random);
            let counted = with.iter().zip(is_event).filter(|(_, event)| **event);
            counted.map(|(cycles, _)| cycles).sum()
        })
        .collect()
}

struct Pool<'a> {
    blindness: &'a Blindness,
    cycles: u64,
    /// SPADs that fired one, two, … periods ago.
    aged: Vec<u64>,
    /// Ages of blind SPADs that were hit in this period.
    blind: Vec<usize>,
}

impl<'a> Pool<'a> {
    fn new(blindness: &'a Blindness, ages: &Ages, cycles: u64, random: &mut Philox) -> Self {
        let (mut left, mut share_left) = (SPADS as u64 * cycles, 1.0);
        let counts = ages.aged.iter().map(|&share| {
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
        Pool {
            blindness,
            cycles,
            aged: counts.collect(),
            blind: Vec::new(),
        }
    }

    /// One CLK period: how many cycles have pulses of exactly 0, 1, 2, … SPADs.
    fn period(&mut self, hits: &Hits, random: &mut Philox) -> [u64; SPADS + 1] {
        let mut with = [0; SPADS + 1];
        let mut at_least = self.cycles;
        let mut hit = 0;
        for (least, exactly) in with.iter_mut().enumerate() {
            let more = hits.more(at_least, least, random);
            *exactly = at_least - more;
            hit += more;
            at_least = more;
            if more == 0 {
                break;
            }
        }
        let blind = self.meet_blind(hit, random);
        drop_hits(&mut with, hit, blind, random);
        let renewed = match self.blindness.law {
            DeadTimeLaw::NonParalysable => hit - blind,
            DeadTimeLaw::Paralysable => hit,
        };
        if self.aged.pop().is_some() {
            self.aged.insert(0, renewed);
        }
        with
    }

    /// Of `hit` SPADs, how many are too blind for a pulse. Those that the hit renews leave their age.
    fn meet_blind(&mut self, hit: u64, random: &mut Philox) -> u64 {
        let mut left: u64 = self.aged.iter().sum();
        let met = overlap(SPADS as u64 * self.cycles, left, hit, random);
        let mut blind = 0;
        for _ in 0..met {
            let mut place = below(left, random);
            let mut age = 0;
            while place >= self.aged[age] {
                place -= self.aged[age];
                age += 1;
            }
            left -= 1;
            self.aged[age] -= 1;
            if uniform(random) < self.blindness.able(age + 1) {
                continue;
            }
            blind += 1;
            if self.blindness.law == DeadTimeLaw::NonParalysable {
                // It keeps its age, but is not hit a second time.
                self.blind.push(age);
            }
        }
        for age in self.blind.drain(..) {
            self.aged[age] += 1;
        }
        blind
    }
}

/// Takes `blind` of `hit` hits off the cycles they fell into, `with[f]` of which have f of them.
fn drop_hits(with: &mut [u64; SPADS + 1], hit: u64, blind: u64, random: &mut Philox) {
    for dropped in 0..blind {
        let mut place = below(hit - dropped, random);
        let mut hits = 1;
        while place >= hits as u64 * with[hits] {
            place -= hits as u64 * with[hits];
            hits += 1;
        }
        with[hits] -= 1;
        with[hits - 1] += 1;
    }
}
