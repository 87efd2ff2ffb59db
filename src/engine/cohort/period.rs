//! When in a CLK period photons come to one SPAD, in steps.
//!
//! ```text
//!   step            0        1        …      s−1
//!               ├────────┼────────┼───── … ┼────────┤
//!   photon with    p₀       p₁               pₛ₋₁
//!   first one      p₀    q₀ p₁      …    q₀ q₁ … pₛ₋₁         of those that get any
//! ```

use smallvec::SmallVec;

use super::blindness::Blindness;
use super::draw::binomial;
use super::spad_light::{DIM, absorbed, absorbed_dim};
use super::words::RandomWords;
use super::{FEW_STEPS, Steps};
use crate::photon::DeadTimeLaw;

/// What happens to a SPAD that fired lately and is hit in this period.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) struct Meeting {
    /// Whether it makes a pulse.
    pub pulses: bool,
    /// The step from which on it is blind anew, if it is.
    pub renewed: Option<usize>,
}

/// Photons on one SPAD in every CLK period of a window.
#[derive(Debug, Clone)]
pub(super) struct Photons(SmallVec<[Step; FEW_STEPS]>);

/// Probabilities of a photon in one step, and of any in its period from it on and up to it.
#[derive(Debug, Clone, Copy)]
struct Step {
    photon: f64,
    from: f64,
    until: f64,
}

impl Photons {
    /// Of the mean photons of all steps.
    #[inline(always)]
    pub(super) fn new(steps: &Steps) -> Self {
        let per_period = steps.per_period;
        let mut photons = steps.means.clone();
        if photons.iter().all(|&mean| mean < DIM) {
            for photon in &mut photons {
                *photon = absorbed_dim(*photon);
            }
        } else {
            for photon in &mut photons {
                *photon = absorbed(*photon);
            }
        }
        let alone = |&photon: &f64| Step {
            photon,
            from: photon,
            until: photon,
        };
        let mut steps: SmallVec<[Step; FEW_STEPS]> = photons.iter().map(alone).collect();
        for period in steps.chunks_mut(per_period) {
            for step in 1..per_period {
                period[step].until += (1.0 - period[step].photon) * period[step - 1].until;
                let step = per_period - 1 - step;
                period[step].from += (1.0 - period[step].photon) * period[step + 1].from;
            }
        }
        Photons(steps)
    }

    /// The period of each bin, which has `per_period` steps, in rows of `width`.
    #[inline(always)]
    pub(super) fn rows(
        &self,
        per_period: usize,
        width: usize,
    ) -> impl Iterator<Item = impl Iterator<Item = Period<'_>> + Clone> {
        let rows = self.0.chunks(per_period * width);
        rows.map(move |row| row.chunks_exact(per_period).map(Period))
    }
}

/// Photons on one SPAD in one CLK period.
#[derive(Debug, Clone, Copy)]
pub(super) struct Period<'p>(&'p [Step]);

impl Period<'_> {
    /// Its steps.
    pub(super) fn steps(&self) -> usize {
        self.0.len()
    }

    /// p/(1 − p) for the probability p of a photon.
    pub(super) fn odds(&self) -> f64 {
        self.0[0].from / (1.0 - self.0[0].from)
    }

    /// Splits `hit` SPADs that were ready, and get a photon in this period, by the step from which on they are blind:
    /// that of the first photon, or for paralysable ones that of the last. Calls `blind` with steps and SPADs.
    #[inline(always)]
    pub(super) fn split(
        &self,
        hit: u64,
        law: DeadTimeLaw,
        random: &mut RandomWords,
        mut blind: impl FnMut(usize, u64),
    ) {
        let steps = self.steps();
        let mut left = hit;
        for count in 1..=steps {
            // Steps are gone through from the end whose photon decides.
            let number = match law {
                DeadTimeLaw::NonParalysable => count - 1,
                DeadTimeLaw::Paralysable => steps - count,
            };
            let step = &self.0[number];
            let any = match law {
                DeadTimeLaw::NonParalysable => step.from,
                DeadTimeLaw::Paralysable => step.until,
            };
            let here = if count == steps {
                left
            } else {
                let p = (step.photon / any).min(1.0);
                binomial(left, p, 1.0 - p, random)
            };
            blind(number, here);
            left -= here;
        }
    }

    /// What becomes of a SPAD that fired `age` ≥ 1 steps before this period, which begins with step `first` of the window,
    /// and gets a photon in it.
    #[inline(always)]
    pub(super) fn meet(
        &self,
        first: usize,
        age: usize,
        blindness: &Blindness,
        random: &mut RandomWords,
    ) -> Meeting {
        let mut meeting = Meeting {
            pulses: false,
            renewed: None,
        };
        let mut is_hit = false;
        for (step, &Step { photon, from, .. }) in self.0.iter().enumerate() {
            let comes = match is_hit {
                true => random.coarse() < photon,
                false => step + 1 == self.steps() || random.coarse() * from < photon,
            };
            if !comes {
                continue;
            }
            is_hit = true;
            let since = meeting.renewed.map_or(age + step, |renewed| step - renewed);
            let able = blindness.able(first + step, since);
            let pulses = able > 0.0 && random.coarse() < able;
            meeting.pulses |= pulses;
            if pulses || blindness.law == DeadTimeLaw::Paralysable {
                meeting.renewed = Some(step);
            }
        }
        meeting
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    fn photons(means: &[f64]) -> Photons {
        Photons::new(&Steps {
            means: means.into(),
            per_period: means.len(),
        })
    }

    proptest! {
        #[test]
        fn probabilities_are_those_of_the_means(means in prop::collection::vec(1e-9f64..0.5, 1..9)) {
            // In the second of two periods.
            let both: Vec<f64> = means.iter().map(|mean| 0.5 * mean).chain(means.iter().copied()).collect();
            let photons = Photons::new(&Steps { means: both.into(), per_period: means.len() });
            let period = photons.rows(means.len(), 1).last().unwrap().next().unwrap();
            let odds = libm::expm1(means.iter().sum());
            prop_assert!((period.odds() / odds - 1.0).abs() < 1e-13);
            for step in 0..means.len() {
                let from = -libm::expm1(-means[step..].iter().sum::<f64>());
                let until = -libm::expm1(-means[..=step].iter().sum::<f64>());
                let photon = -libm::expm1(-means[step]);
                let found = &period.0[step];
                for (got, want) in [(found.from, from), (found.until, until), (found.photon, photon)] {
                    prop_assert!((got / want - 1.0).abs() < 1e-14, "{got} {want}");
                }
            }
        }
    }

    #[test]
    fn spads_are_split_by_their_first_or_their_last_photon() {
        let photons = photons(&[0.3, 0.1, 0.6]);
        let period = photons.rows(3, 1).next().unwrap().next().unwrap();
        let p = [0.3f64, 0.1, 0.6].map(|mean| -libm::expm1(-mean));
        let mut random = RandomWords::new(3, 0);
        for law in [DeadTimeLaw::NonParalysable, DeadTimeLaw::Paralysable] {
            let mut seen = [0u64; 3];
            let hit = 1_000_000;
            period.split(hit, law, &mut random, |step, spads| seen[step] += spads);
            assert_eq!(seen.iter().sum::<u64>(), hit);
            let others = |step: usize| match law {
                DeadTimeLaw::NonParalysable => 0..step,
                DeadTimeLaw::Paralysable => step + 1..3,
            };
            for (step, &count) in seen.iter().enumerate() {
                let none: f64 = others(step).map(|other| 1.0 - p[other]).product();
                let expected = hit as f64 * p[step] * none / -libm::expm1(-1.0);
                let off = (count as f64 - expected).abs();
                assert!(
                    off < 5.0 * expected.sqrt(),
                    "{law:?} {step}: {count} {expected}"
                );
            }
        }
    }

    /// Against photons thrown step by step.
    #[test]
    fn a_spad_that_fired_lately_does_as_its_photons_say() {
        let means = [0.4, 0.2, 0.5, 0.3];
        let photons = photons(&means);
        let period = photons.rows(means.len(), 1).next().unwrap().next().unwrap();
        let p = means.map(|mean: f64| -libm::expm1(-mean));
        let mut random = RandomWords::new(4, 0);
        const TRIALS: u32 = 400_000;
        for law in [DeadTimeLaw::NonParalysable, DeadTimeLaw::Paralysable] {
            let blindness = Blindness::new(law, 5.3);
            for age in [1, 3, 4, 5] {
                let mut told = [[0u32; 5]; 2];
                let mut thrown = told;
                let place = |renewed: Option<usize>| renewed.map_or(0, |step| step + 1);
                for _ in 0..TRIALS {
                    let meeting = period.meet(0, age, &blindness, &mut random);
                    told[usize::from(meeting.pulses)][place(meeting.renewed)] += 1;
                    loop {
                        let photons = p.map(|p| random.uniform() < p);
                        if !photons.contains(&true) {
                            continue;
                        }
                        let (mut since, mut pulses, mut renewed) = (age, false, None);
                        for (step, _) in photons.iter().enumerate().filter(|(_, comes)| **comes) {
                            let now = renewed.map_or(since + step, |from| step - from);
                            let fires = random.uniform() < blindness.able(0, now);
                            pulses |= fires;
                            if fires || law == DeadTimeLaw::Paralysable {
                                renewed = Some(step);
                                since = 0;
                            }
                        }
                        thrown[usize::from(pulses)][place(renewed)] += 1;
                        break;
                    }
                }
                for (told, thrown) in told.as_flattened().iter().zip(thrown.as_flattened()) {
                    let error = 5.0 * f64::from(told + thrown + 1).sqrt();
                    let off = (f64::from(*told) - f64::from(*thrown)).abs();
                    assert!(off < error, "{law:?}, {age}: {told} {thrown}");
                }
            }
        }
    }
}
