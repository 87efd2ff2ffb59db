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

use super::blindness::{Ages, Blindness};
use super::draw::{Draws, binomial};
use super::words::RandomWords;
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
    random: &mut RandomWords,
) -> Vec<u64> {
    debug_assert_eq!(steps.per_period, 1);
    let mut pool = Pool::new(blindness, ages, cycles, random);
    let mut counts = Vec::with_capacity(steps.means.len());
    for means in steps.means.chunks(TOGETHER) {
        let further = Further::of(means);
        counts.extend((0..means.len()).map(|period| {
            let with = pool.period(&further, period, random);
            let counted = with.iter().zip(is_event).filter(|(_, event)| **event);
            counted.map(|(cycles, _)| cycles).sum::<u64>()
        }));
    }
    counts
}

/// CLK periods whose probabilities are computed side by side.
const TOGETHER: usize = 8;

/// Probabilities that a laser cycle in which 0, 1, 2, … SPADs are hit at least has one more, in every one of several
/// CLK periods.
///
/// With o = p/(1 − p), what is known to be k or more is k with probability 1/tₖ, where
/// tₖ = 1 + (16 − k)/(k + 1) · o · tₖ₊₁ and t₁₆ = 1: every term is positive, so no digits are lost.
struct Further {
    /// tₖ − 1.
    more: [[f64; TOGETHER]; SPADS],
}

impl Further {
    /// For `means` photons on a SPAD.
    fn of(means: &[f64]) -> Self {
        let mut odds = [0.0; TOGETHER];
        for (odds, &mean) in odds.iter_mut().zip(means) {
            // p/(1 − p) for 1 − p = exp(−mean).
            *odds = libm::expm1(mean);
        }
        let mut more = [[0.0; TOGETHER]; SPADS];
        let mut t = [1.0; TOGETHER];
        for (hit, more) in more.iter_mut().enumerate().rev() {
            let ways = (SPADS - hit) as f64 / (hit + 1) as f64;
            for period in 0..TOGETHER {
                more[period] = ways * odds[period] * t[period];
                t[period] = 1.0 + more[period];
            }
        }
        Further { more }
    }

    /// Of `cycles` in each of which at least `least` SPADs are hit in a period, those with one more at least.
    fn more(&self, cycles: u64, least: usize, period: usize, random: &mut RandomWords) -> u64 {
        let Some(more) = self.more.get(least) else {
            return 0;
        };
        let exactly = 1.0 / (1.0 + more[period]);
        binomial(cycles, more[period] * exactly, exactly, random)
    }
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
    fn new(blindness: &'a Blindness, ages: &Ages, cycles: u64, random: &mut RandomWords) -> Self {
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
    fn period(
        &mut self,
        further: &Further,
        period: usize,
        random: &mut RandomWords,
    ) -> [u64; SPADS + 1] {
        let mut with = [0; SPADS + 1];
        let mut at_least = self.cycles;
        let mut hit = 0;
        for (least, exactly) in with.iter_mut().enumerate() {
            let more = further.more(at_least, least, period, random);
            *exactly = at_least - more;
            hit += more;
            at_least = more;
            if more == 0 {
                break;
            }
        }
        self.go_blind(hit, &mut with, random);
        with
    }

    /// Of `hit` SPADs, of which `with` cycles have 0, 1, 2, …, takes those too blind for a pulse off the cycles they
    /// fell into.
    fn go_blind(&mut self, hit: u64, with: &mut [u64; SPADS + 1], random: &mut RandomWords) {
        let mut marked: u64 = self.aged.iter().sum();
        let draws = Draws {
            total: SPADS as u64 * self.cycles,
            marked,
            draws: hit,
        };
        let mut pulses = hit;
        draws.meet(random, |random| {
            let age = self.meet(marked, random);
            marked -= 1;
            let able = self.blindness.able(age + 1);
            if able > 0.0 && random.coarse() < able {
                return;
            }
            if self.blindness.law == DeadTimeLaw::NonParalysable {
                // It keeps its age, but is not hit a second time.
                self.blind.push(age);
            }
            take_off(with, pulses, random);
            pulses -= 1;
        });
        for age in self.blind.drain(..) {
            self.aged[age] += 1;
        }
        let renewed = match self.blindness.law {
            DeadTimeLaw::NonParalysable => pulses,
            DeadTimeLaw::Paralysable => hit,
        };
        grow_older(&mut self.aged, renewed);
    }

    /// Takes one of the `marked` SPADs that fired lately out of its age.
    fn meet(&mut self, marked: u64, random: &mut RandomWords) -> usize {
        let place = random.below(marked);
        let (mut age, mut younger) = (0, 0);
        // All ages are looked at: which one it is cannot be foreseen.
        for count in &self.aged {
            younger += count;
            age += usize::from(place >= younger);
        }
        self.aged[age] -= 1;
        age
    }
}

/// SPADs that fired one, two, … periods ago become a period older, and `renewed` ones join them.
fn grow_older(aged: &mut [u64], renewed: u64) {
    if let Some(older) = aged.len().checked_sub(1) {
        aged.copy_within(..older, 1);
        aged[0] = renewed;
    }
}

/// Takes one of `hits` off the cycle it fell into, `with[f]` of which have f of them.
fn take_off(with: &mut [u64; SPADS + 1], hits: u64, random: &mut RandomWords) {
    let mut place = random.below(hits);
    let mut of = 1;
    while place >= of as u64 * with[of] {
        place -= of as u64 * with[of];
        of += 1;
    }
    with[of] -= 1;
    with[of - 1] += 1;
}
