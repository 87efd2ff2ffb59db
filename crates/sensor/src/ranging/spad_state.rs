//! Probabilities of a SPAD's states through a laser cycle: ready, blind, carriers trapped, and how often it fired in
//! a bin.
//!
//! Time goes in steps, over which light and recovery are taken to be even; what a step's light does to a SPAD that is ready, or that
//! recovers within the step, is exact. So the rising edge of an echo is exact however strong it is, and what comes after
//! the dead time is as fine as the steps. A SPAD that fires twice within a bin toggles its flip-flop back (thesis 4.2), so with a dead time below a bin
//! it counts where it fired an odd number of times, which follows from a second, signed, state of the SPAD.
//!
//! A SPAD that recovers may have carriers trapped, which fire it once more if no photon does before. Where it is paralysable,
//! afterpulses come as further light, because what blinds them comes after the avalanche that they are of. Crosstalk
//! comes as further light from what fires now. Neither triggers others, as in [`photon::spad`](crate::photon). This leaves out squares of the two chances.

use super::counting::Counting;
use crate::numerics::Dual;

/// What blinds SPADs and what avalanches cause; times in bins.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct Dead {
    pub(super) time_bins: f64,
    pub(super) paralysable: bool,
    /// Afterpulses of an avalanche by light, and their time constant.
    pub(super) afterpulses: f64,
    pub(super) afterpulse_bins: f64,
    /// Avalanches of neighbours for each by light, on average, if they are ready.
    pub(super) crosstalk: f64,
}

impl Dead {
    /// Whether a SPAD fires by light alone, at most once in a bin, and is ready a dead time later.
    pub(super) fn is_plain(&self) -> bool {
        let is_alone = self.afterpulses == 0.0 && self.crosstalk == 0.0;
        is_alone && !self.paralysable && self.time_bins >= 1.0
    }
}

/// The state of a SPAD, as chances.
#[derive(Clone)]
pub(super) struct Spad<'r, const K: usize> {
    dead: &'r Dead,
    /// That it is ready, with or without trapped carriers.
    ready: Dual<K>,
    /// What blinds: avalanches, or where it is paralysable all light.
    blinding: History<K>,
    traps: Traps<K>,
    /// Avalanches of the bin, and those of them by crosstalk.
    fired: Dual<K>,
    by_crosstalk: Dual<K>,
    parity: Option<Parity<K>>,
    /// Whether a SPAD fires by light alone, and at most once in a bin.
    is_plain: bool,
}

/// Carriers that avalanches leave behind.
#[derive(Clone)]
struct Traps<const K: usize> {
    /// Avalanches after which carriers are trapped; where the SPAD is paralysable, afterpulses to be released.
    trapping: History<K>,
    /// That it is ready and carriers are trapped; where it is paralysable, that they are.
    trapped: Dual<K>,
    /// The share of carriers that stay trapped for a dead time.
    kept: f64,
    /// A step over the time constant with which they are released.
    release: f64,
}

/// The same states, each with the sign of the SPAD's flip-flop since the bin began.
#[derive(Clone)]
struct Parity<const K: usize> {
    ready: Dual<K>,
    blind: Dual<K>,
    blinding: History<K>,
    /// Where afterpulses are not light, but avalanches of their own that turn the flip-flop.
    traps: Option<Traps<K>>,
}

impl<'r, const K: usize> Spad<'r, K> {
    /// Under background alone, photons of a SPAD in a bin.
    pub(super) fn steady(law: &'r Dead, background: Dual<K>, h: f64) -> Self {
        let dead = law.time_bins;
        let tau = law.afterpulse_bins;
        let kept = libm::exp(-dead / tau);
        let (mut fired, mut ready, mut trapped) = (background, Dual::ZERO, Dual::ZERO);
        let mut light = background;
        // Afterpulses and crosstalk are few: each round has the next power of their chance.
        for _ in 0..6 {
            ready = if !law.paralysable {
                Dual::constant(1.0) - fired * dead
            } else {
                (light * -dead).exp()
            };
            let bred = background * ready;
            light = background + bred * law.crosstalk;
            let traps = bred * law.afterpulses;
            if !law.paralysable {
                // Light before they are released keeps them trapped for another dead time, beside those that it traps anew.
                let lost = light * (1.0 - kept)
                    + background * (law.afterpulses * kept)
                    + Dual::constant(1.0 / tau);
                trapped = traps * lost.recip();
                fired =
                    (light + trapped * (1.0 / tau)) * (Dual::constant(1.0) + light * dead).recip();
            } else {
                trapped = traps * tau;
                light += traps;
                fired = light * ready;
            }
        }
        if !law.paralysable {
            ready = Dual::constant(1.0) - fired * dead;
        }
        let traps = if !law.paralysable {
            let still = (light - background * law.afterpulses) * kept;
            background * ready * law.afterpulses + trapped * still
        } else {
            background * ready * law.afterpulses
        };
        let blinding = if !law.paralysable { fired } else { light };
        let history = |rate: Dual<K>| History::new(dead / h, rate * h);
        let traps = Traps {
            trapping: history(traps),
            trapped,
            kept,
            release: h / tau,
        };
        Spad {
            dead: law,
            ready,
            blinding: history(blinding),
            fired: Dual::ZERO,
            by_crosstalk: Dual::ZERO,
            is_plain: law.is_plain(),
            parity: None,
            traps,
        }
    }

    pub(super) fn begin_bin(&mut self) {
        (self.fired, self.by_crosstalk) = (Dual::ZERO, Dual::ZERO);
        let has_traps = self.dead.afterpulses > 0.0 && !self.dead.paralysable;
        self.parity = (self.dead.time_bins < 1.0).then(|| Parity {
            ready: self.ready,
            blind: Dual::constant(1.0) - self.ready,
            blinding: self.blinding.clone(),
            traps: has_traps.then(|| self.traps.clone()),
        });
    }

    /// A step with `photons` photons on the SPAD.
    #[inline]
    pub(super) fn step(&mut self, photons: Dual<K>) {
        if !self.is_plain {
            return self.step_bred(photons);
        }
        let (hit, late) = photons.hits();
        let fired = self.ready * hit + self.blinding.ending() * late;
        self.ready += self.blinding.ending() - fired;
        self.blinding.push(fired);
        self.fired += fired;
    }

    /// The same where avalanches may trigger others, where light blinds, or where a flip-flop may toggle back.
    fn step_bred(&mut self, photons: Dual<K>) {
        let dead = self.dead;
        let recovering = self.blinding.ending();
        let has_traps = dead.afterpulses > 0.0;
        let mut light = photons;
        if has_traps && dead.paralysable {
            light += self.traps.afterpulses();
        }
        let mut crosstalk = Dual::ZERO;
        if dead.crosstalk > 0.0 {
            let own = self.avalanches(light, recovering) * photons * positive(light).recip();
            crosstalk = own * dead.crosstalk;
            light += crosstalk;
        }
        let mut fired = self.avalanches(light, recovering);
        // Avalanches of light, without those of afterpulses that came first.
        let mut by_light = fired;
        // The share of what light fires that traps carriers.
        let mut triggering = Dual::ZERO;
        if has_traps && !dead.paralysable {
            triggering = photons * positive(light).recip() * dead.afterpulses;
            let (released, lost) = self.traps.released(light, triggering, fired, 1.0);
            fired += released - lost;
            by_light = fired - released;
        }
        if has_traps && dead.paralysable {
            let bred = fired * photons * positive(light).recip();
            self.traps.trapping.push(bred * dead.afterpulses);
        }
        if let Some(parity) = &mut self.parity {
            parity.step(dead.paralysable, light, triggering, self.ready);
        }
        if !dead.paralysable {
            self.ready += recovering - fired;
            self.blinding.push(fired);
        } else {
            self.ready = self.ready * (recovering - light).exp();
            self.blinding.push(light);
        }
        if dead.crosstalk > 0.0 {
            self.by_crosstalk += by_light * crosstalk * positive(light).recip();
        }
        self.fired += fired;
    }

    /// Avalanches under `light` while `recovering` SPADs recover; if the SPAD is paralysable, `recovering` is the
    /// light that is forgotten.
    #[inline]
    fn avalanches(&self, light: Dual<K>, recovering: Dual<K>) -> Dual<K> {
        if !self.dead.paralysable {
            let (hit, late) = light.hits();
            self.ready * hit + recovering * late
        } else {
            self.ready * light * (light - recovering).exprel_neg()
        }
    }

    /// The chance of the bin that has ended to count.
    pub(super) fn chance(&self, counting: &Counting) -> Dual<K> {
        let fired = match &self.parity {
            None => self.fired,
            Some(parity) => (Dual::constant(1.0) - parity.ready - parity.blind) * 0.5,
        };
        if self.dead.crosstalk == 0.0 {
            return counting.chance(fired, Dual::ZERO);
        }
        let crosstalk = self.by_crosstalk * positive(self.fired).recip();
        let alone = fired * (Dual::constant(1.0) - crosstalk);
        let children = crosstalk * (Dual::constant(1.0) - crosstalk).recip();
        counting.chance(alone, children)
    }
}

impl<const K: usize> Traps<K> {
    /// Afterpulses of this step, and avalanches of light that they are in place of, where light would have `fired` so many. A share
    /// `triggering` of what light fires traps carriers anew. What fires becomes blind with the sign `turn`.
    fn released(
        &mut self,
        light: Dual<K>,
        triggering: Dual<K>,
        fired: Dual<K>,
        turn: f64,
    ) -> (Dual<K>, Dual<K>) {
        let release = Dual::constant(self.release);
        let recovering = self.trapping.ending();
        let both = light + release;
        let (missed, missed_of_light) = (both.exprel_neg(), light.exprel_neg());
        let one = Dual::constant(1.0);
        // What fires those with trapped carriers, and what would have fired them without.
        let gone = self.trapped * both * missed + recovering * (one - missed);
        let of_light =
            self.trapped * light * missed_of_light + recovering * (one - missed_of_light);
        let released = gone * release * both.recip();
        let fired_trapped = gone - released;
        self.trapped += recovering - gone;
        let fresh = (fired - of_light + fired_trapped) * triggering;
        let old = fired_trapped * self.kept;
        self.trapping
            .push((fresh + old * (one - triggering)) * turn);
        (released, of_light - fired_trapped)
    }

    /// Afterpulses of this step, where they come as light.
    fn afterpulses(&mut self) -> Dual<K> {
        let released = -libm::expm1(-self.release);
        let fresh = self.trapping.ending();
        // Fresh ones come evenly over the step.
        let of_fresh = 1.0 - released / self.release;
        let now = self.trapped * released + fresh * of_fresh;
        self.trapped += fresh - now;
        now
    }
}

/// The same, above zero, to divide by.
#[inline]
fn positive<const K: usize>(mut number: Dual<K>) -> Dual<K> {
    number.value = number.value.max(1e-300);
    number
}

impl<const K: usize> Parity<K> {
    /// A step with so much light, a share `triggering` of whose avalanches traps carriers, on a SPAD that was ready with chance `was_ready`.
    fn step(&mut self, paralysable: bool, light: Dual<K>, triggering: Dual<K>, was_ready: Dual<K>) {
        let missed = light.exprel_neg();
        let mut recovering = self.blinding.ending();
        if paralysable {
            // Those of them that no photon has blinded anew: as many as there are SPADs that are ready.
            recovering = recovering * was_ready;
        }
        let mut fired = self.ready * light * missed + recovering * (Dual::constant(1.0) - missed);
        if let Some(traps) = &mut self.traps {
            let (released, lost) = traps.released(light, triggering, fired, -1.0);
            fired += released - lost;
        }
        let (ready, blind) = (self.ready, self.blind);
        self.ready += recovering - fired;
        self.blind = blind - recovering - fired;
        if !paralysable {
            self.blinding.push(Dual::ZERO - fired)
        } else {
            let blind = (blind + self.blind) * 0.5;
            let ready = (ready + self.ready) * 0.5;
            self.blinding.push(light * (blind - ready));
        }
    }
}

/// What happened step by step for a dead time, and what of it ends.
#[derive(Clone)]
struct History<const K: usize> {
    /// The rest of the dead time beside whole steps, of which there is at least one.
    part: f64,
    /// In a ring, whose oldest entry is the next to be overwritten.
    steps: Vec<Dual<K>>,
    oldest: usize,
}

impl<const K: usize> History<K> {
    /// `before` in every step until now.
    fn new(delay: f64, before: Dual<K>) -> Self {
        let delay = delay.max(1.0);
        History {
            part: delay.fract(),
            steps: vec![before; delay as usize + 1],
            oldest: 0,
        }
    }

    #[inline]
    fn push(&mut self, happened: Dual<K>) {
        self.steps[self.oldest] = happened;
        self.oldest = self.second();
    }

    /// What ends during the step that comes next.
    #[inline]
    fn ending(&self) -> Dual<K> {
        self.steps[self.second()] * (1.0 - self.part) + self.steps[self.oldest] * self.part
    }

    #[inline]
    fn second(&self) -> usize {
        match self.oldest + 1 {
            end if end == self.steps.len() => 0,
            next => next,
        }
    }
}

#[cfg(test)]
mod by_states;
