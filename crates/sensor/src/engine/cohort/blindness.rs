//! How long one SPAD stays blind, in steps of a CLK period.
//!
//! ```text
//!   step         0        1       …       m−1       m        m+1
//!            ───┼────────┼─── … ───┼─────────┼─────────┼─────────┼──
//!   fires       ^ somewhere in step 0
//!   blind       ══════════════════════════════════════░░░░         for δ = m + f steps
//!   P(blind)         1        1         1    1−(1−f)²/2   f²/2
//! ```
//!
//! A pulse is spread over its step, and so is the end of its dead time. A photon in a later step finds the SPAD
//! blind with the probability drawn above: the exact one for even light, to first order in the photons per step.
//! What is left is of second order, and of the light's unevenness within a step (`fine.rs`).

use smallvec::{SmallVec, smallvec};

use super::spad_light::{DIM, absorbed};
use crate::photon::DeadTimeLaw;

/// Steps of dead time that need no memory of their own.
const FEW: usize = 8;

/// Blindness of one SPAD by the steps since the avalanche that blinded it.
#[derive(Debug, Clone, PartialEq)]
pub(super) struct Blindness {
    pub law: DeadTimeLaw,
    /// Probability of being able to fire one, two, … steps after; certain beyond.
    able: SmallVec<[f64; FEW]>,
    /// The same for each step of a window in turn, where it has been computed from the light.
    by_step: Vec<f64>,
}

impl Blindness {
    /// A dead time of `steps` ≥ 1.
    pub(super) fn new(law: DeadTimeLaw, steps: f64) -> Self {
        debug_assert!(steps >= 1.0, "{steps} steps");
        let whole = steps.floor();
        let rest = steps - whole;
        let mut able = smallvec![0.0; whole as usize - 1];
        able.push(0.5 * (1.0 - rest) * (1.0 - rest));
        able.push(1.0 - 0.5 * rest * rest);
        while able.last().is_some_and(|&able| able == 1.0) {
            able.pop();
        }
        Blindness {
            law,
            able,
            by_step: Vec::new(),
        }
    }

    /// A dead time in unequal steps: `longest` is its length in the longest steps, `shortest` in the shortest.
    /// [`Blindness::in_light`] decides about ages in between.
    pub(super) fn of_unequal(law: DeadTimeLaw, longest: f64, shortest: f64) -> Self {
        debug_assert!(
            1.0 <= longest && longest <= shortest,
            "steps are no longer than a dead time"
        );
        let certain = longest.floor() as usize - 1;
        let able = (1..=shortest.ceil() as usize).map(|age| if age <= certain { 0.0 } else { 0.5 });
        Blindness {
            law,
            able: able.collect(),
            by_step: Vec::new(),
        }
    }

    /// The same dead time in light that makes SPADs able to fire so, by step and age.
    pub(super) fn in_light(&self, by_step: Vec<f64>) -> Self {
        Blindness {
            by_step,
            ..self.clone()
        }
    }

    /// Steps after which an avalanche is forgotten.
    pub(super) fn memory(&self) -> usize {
        self.able.len()
    }

    /// How many of the ages 1, 2, … leave a SPAD unchanged in a step, whatever photons come: no pulse, and no new age.
    pub(super) fn surely_blind(&self) -> usize {
        let certain = self.able.iter().take_while(|&&able| able == 0.0);
        match self.law {
            DeadTimeLaw::NonParalysable => certain.count(),
            DeadTimeLaw::Paralysable => 0,
        }
    }

    /// Probability of being able to fire in step `step` of the window, `age` ≥ 1 steps after the last avalanche.
    #[inline]
    pub(super) fn firing_probability(&self, step: usize, age: usize) -> f64 {
        match self.able.get(age - 1) {
            None => 1.0,
            Some(&able) if self.by_step.is_empty() => able,
            Some(_) => self.by_step[step * self.able.len() + age - 1],
        }
    }

    /// How far [`Blindness::firing_probability`] may be from what it is in even light, `age` steps after, where photons come up to three
    /// times as densely as on average in either step.
    pub(super) fn most_uneven(&self, age: usize) -> f64 {
        let able = self.able[age - 1];
        (9.0 * able.min(1.0 - able)).min(able.max(1.0 - able))
    }

    /// Probabilities that a photon, present with probability `p`, takes a SPAD of `age` back to age 0, and that it makes a pulse.
    #[inline(always)]
    pub(super) fn hit(&self, step: usize, age: usize, p: f64) -> (f64, f64) {
        let pulses = p * self.firing_probability(step, age);
        match self.law {
            DeadTimeLaw::NonParalysable => (pulses, pulses),
            DeadTimeLaw::Paralysable => (p, pulses),
        }
    }

    /// The complement of the first of [`Blindness::hit`]; `q` is 1 − `p`.
    fn keeps(&self, step: usize, age: usize, p: f64, q: f64) -> f64 {
        match self.law {
            DeadTimeLaw::NonParalysable => q + p * (1.0 - self.firing_probability(step, age)),
            DeadTimeLaw::Paralysable => q,
        }
    }
}

/// Probabilities of a photon and of none where `mean` are expected.
fn photon_or_none(mean: f64) -> (f64, f64) {
    let p = absorbed(mean);
    let q = if mean < DIM {
        1.0 - p
    } else {
        libm::exp(-mean)
    };
    (p, q)
}

/// One SPAD with its dead time, in even light.
#[derive(Debug, Clone, PartialEq)]
pub struct BlindSpad(Blindness);

impl BlindSpad {
    /// A SPAD with a dead time of `steps` ≥ 1.
    pub fn new(law: DeadTimeLaw, steps: f64) -> Self {
        BlindSpad(Blindness::new(law, steps))
    }

    /// Mean pulses a step in the steady state under `mean` photons a step. Relative error below 10⁻¹¹ from
    /// 10⁻¹⁵ to 10³ photons, for dead times to a thousand steps.
    pub fn steady_pulse(&self, mean: f64) -> f64 {
        Ages::steady(&self.0, mean).pulse(&self.0, 0, mean)
    }
}

/// Probability of each age of one SPAD at the start of a step. For the paralysable law an age counts from the last
/// avalanche, seen or not.
#[derive(Debug, Clone, PartialEq)]
pub(super) struct Ages {
    /// Entry a: last avalanche a + 1 steps ago.
    pub aged: SmallVec<[f64; FEW]>,
    /// No avalanche that still matters.
    pub free: f64,
}

impl Ages {
    /// A SPAD that has seen nothing yet.
    pub(super) fn rested(blindness: &Blindness) -> Self {
        Ages {
            aged: smallvec![0.0; blindness.memory()],
            free: 1.0,
        }
    }

    /// The probability `share` of an age, in one of those SPADs, the part `left`, that are of no age looked at before.
    pub(super) fn conditional_share(share: f64, left: f64) -> f64 {
        if share > 0.0 {
            (share / left).min(1.0)
        } else {
            0.0
        }
    }

    /// Makes those free that have no age.
    pub(super) fn fill_up(&mut self) {
        self.free = (1.0 - self.aged.iter().sum::<f64>()).max(0.0);
    }

    /// The steady state under `mean` photons a step.
    pub(super) fn steady(blindness: &Blindness, mean: f64) -> Self {
        let (p, q) = photon_or_none(mean);
        let mut aged = SmallVec::with_capacity(blindness.memory());
        let (mut survives, mut sum) = (1.0, 0.0);
        for age in 1..=blindness.memory() {
            aged.push(survives);
            sum += survives;
            survives *= blindness.keeps(0, age, p, q);
        }
        // What leaves the free state, p · free, is what returns to it, renewals · survives.
        let renewals = p / (p * sum + survives);
        aged.iter_mut().for_each(|age| *age *= renewals);
        Ages {
            aged,
            free: survives / (p * sum + survives),
        }
    }

    /// Step `step` of the window, with `mean` photons.
    pub(super) fn step(&mut self, blindness: &Blindness, step: usize, mean: f64) {
        let (p, q) = photon_or_none(mean);
        let mut renewed = p * self.free;
        self.free *= q;
        for (index, age) in self.aged.iter_mut().enumerate() {
            let (renews, _) = blindness.hit(step, index + 1, p);
            renewed += *age * renews;
            *age *= blindness.keeps(step, index + 1, p, q);
        }
        match self.aged.last_mut() {
            Some(oldest) => {
                self.free += std::mem::replace(oldest, renewed);
                self.aged.rotate_right(1);
            }
            None => self.free += renewed,
        }
    }

    /// Probability of a pulse in step `step` of the window, with `mean` photons.
    pub(super) fn pulse(&self, blindness: &Blindness, step: usize, mean: f64) -> f64 {
        let aged = self.aged.iter().enumerate();
        let able: f64 = aged
            .map(|(index, age)| age * blindness.firing_probability(step, index + 1))
            .sum();
        absorbed(mean) * (self.free + able)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    const LAWS: [DeadTimeLaw; 2] = [DeadTimeLaw::NonParalysable, DeadTimeLaw::Paralysable];

    #[test]
    fn blindness_adds_up_to_the_dead_time_less_half_a_step() {
        for steps in [1.0, 1.3, 3.072, 7.999, 40.5] {
            let blindness = Blindness::new(DeadTimeLaw::NonParalysable, steps);
            let sum: f64 = (1..100)
                .map(|age| 1.0 - blindness.firing_probability(0, age))
                .sum();
            assert!((sum - (steps - 0.5)).abs() < 1e-12, "{steps}: {sum}");
        }
    }

    proptest! {
        #[test]
        fn the_steady_state_stays(steps in 1.0f64..20.0, mean in 1e-6f64..5.0, law in 0usize..2) {
            let blindness = Blindness::new(LAWS[law], steps);
            let steady = Ages::steady(&blindness, mean);
            prop_assert!((steady.aged.iter().sum::<f64>() + steady.free - 1.0).abs() < 1e-12);
            let mut later = steady.clone();
            later.step(&blindness, 0, mean);
            for (a, b) in steady.aged.iter().zip(&later.aged) {
                prop_assert!((a - b).abs() < 1e-12, "{steady:?} {later:?}");
            }
        }

        /// Whole steps of dead time: blind in the rest of the first step and in `whole` − 1 more, from a rested start.
        #[test]
        fn pulses_follow_the_closed_forms(
            whole in 1usize..6,
            means in prop::collection::vec(0.0f64..3.0, 1..20),
        ) {
            for law in LAWS {
                let mut able = vec![0.0; whole - 1];
                able.truncate(whole - 1);
                let able = able.into();
                let blindness = Blindness { law, able, by_step: Vec::new() };
                let mut ages = Ages::rested(&blindness);
                let mut pulses: Vec<f64> = Vec::new();
                for (i, &mean) in means.iter().enumerate() {
                    let before = i.saturating_sub(whole - 1)..i;
                    let expected = -libm::expm1(-mean) * match law {
                        DeadTimeLaw::NonParalysable => 1.0 - pulses[before].iter().sum::<f64>(),
                        DeadTimeLaw::Paralysable => libm::exp(-means[before].iter().sum::<f64>()),
                    };
                    let pulse = ages.pulse(&blindness, 0, mean);
                    prop_assert!((pulse - expected).abs() < 1e-12, "{law:?} {i}: {pulse} {expected}");
                    pulses.push(pulse);
                    ages.step(&blindness, 0, mean);
                }
            }
        }
    }
}
