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
//! SPADs are independent of each other, so the pool's counts are exact, and so is each bin's distribution: which SPADs
//! of the pool fire in a period is a uniform choice. What the pool does not keep is which of them share a cycle. Two
//! bins' counts then lose the part of their correlation that passes through coincidences within a cycle: at most
//! ρ² of their variance, where ρ = p/(1 − p) for p photons on a SPAD in a period. [`neglected`] gives it.

use super::blindness::{Ages, Blindness};
use super::draw::{Draws, binomial};
use super::period::{Period, Photons};
use super::words::RandomWords;
use super::{EventTable, Steps};
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
pub fn run(
    blindness: &Blindness,
    ages: &Ages,
    steps: &Steps,
    is_event: &EventTable,
    cycles: u64,
    random: &mut RandomWords,
) -> Vec<u64> {
    let mut pool = Pool::new(blindness, ages, cycles, random);
    let photons = Photons::new(steps);
    let mut further = Further::default();
    let mut ahead = photons.periods();
    photons
        .periods()
        .enumerate()
        .map(|(number, period)| {
            let number = number % TOGETHER;
            if number == 0 {
                further = Further::of(ahead.by_ref().take(TOGETHER));
            }
            let with = pool.period(&further, number, &period, random);
            let counted = with.iter().zip(is_event).filter(|(_, event)| **event);
            counted.map(|(cycles, _)| cycles).sum::<u64>()
        })
        .collect()
}

/// CLK periods whose probabilities are computed side by side.
const TOGETHER: usize = 8;

/// Probabilities that a laser cycle in which 0, 1, 2, … SPADs are hit at least has one more, in every one of several
/// CLK periods.
///
/// With o = p/(1 − p), what is known to be k or more is k with probability 1/tₖ, where
/// tₖ = 1 + (16 − k)/(k + 1) · o · tₖ₊₁ and t₁₆ = 1: every term is positive, so no digits are lost.
#[derive(Default)]
struct Further {
    /// tₖ − 1.
    more: [[f64; TOGETHER]; SPADS],
}

impl Further {
    fn of<'p>(periods: impl Iterator<Item = Period<'p>>) -> Self {
        let mut odds = [0.0; TOGETHER];
        for (odds, period) in odds.iter_mut().zip(periods) {
            *odds = period.odds();
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
    /// SPADs that fired one, two, … steps ago.
    aged: Vec<u64>,
    /// SPADs that are blind from each step of this period on.
    renewed: Vec<u64>,
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
            renewed: Vec::new(),
            blind: Vec::new(),
        }
    }

    /// One CLK period: how many cycles have pulses of exactly 0, 1, 2, … SPADs.
    fn period(
        &mut self,
        further: &Further,
        number: usize,
        period: &Period,
        random: &mut RandomWords,
    ) -> [u64; SPADS + 1] {
        let mut with = [0; SPADS + 1];
        let mut at_least = self.cycles;
        let mut hit = 0;
        for (least, exactly) in with.iter_mut().enumerate() {
            let more = further.more(at_least, least, number, random);
            *exactly = at_least - more;
            hit += more;
            at_least = more;
            if more == 0 {
                break;
            }
        }
        self.go_blind(hit, &mut with, period, random);
        with
    }

    /// Of `hit` SPADs, of which `with` cycles have 0, 1, 2, …, takes those too blind for a pulse off the cycles they
    /// fell into, and lets all grow a period older.
    fn go_blind(
        &mut self,
        hit: u64,
        with: &mut [u64; SPADS + 1],
        period: &Period,
        random: &mut RandomWords,
    ) {
        self.renewed.clear();
        self.renewed.resize(period.steps(), 0);
        let mut marked: u64 = self.aged.iter().sum();
        let (mut met, mut pulses) = (0, hit);
        let draws = Draws {
            total: SPADS as u64 * self.cycles,
            marked,
            draws: hit,
        };
        draws.meet(random, |random| {
            let age = self.meet(marked, random);
            marked -= 1;
            met += 1;
            let meeting = period.meet(age + 1, self.blindness, random);
            match meeting.renewed {
                Some(step) => self.renewed[step] += 1,
                // It keeps its age, but is not met a second time.
                None => self.blind.push(age),
            }
            if !meeting.pulses {
                take_off(with, pulses, random);
                pulses -= 1;
            }
        });
        for age in self.blind.drain(..) {
            self.aged[age] += 1;
        }
        let renewed = &mut self.renewed;
        period.split(hit - met, self.blindness.law, random, |step, spads| {
            renewed[step] += spads;
        });
        let younger = self.renewed.len().min(self.aged.len());
        let older = self.aged.len() - younger;
        self.aged.copy_within(..older, younger);
        for (aged, renewed) in self.aged.iter_mut().zip(self.renewed.iter().rev()) {
            *aged = *renewed;
        }
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
