//! What one SPAD does in a cell of time: photons, afterpulses, and crosstalk from its neighbours.
//!
//! An afterpulse is a carrier that a photon's avalanche leaves in a trap with some probability, and that is released at a
//! constant rate from the end of the dead time on: the exponential delay of [`SpadModel`]. One that is released while
//! the SPAD is blind is lost. So a ready SPAD is with a trap or without one, and nothing else has to be remembered. Left
//! out are two carriers in one SPAD, and that delays end at eight time constants (3·10⁻⁴ of all afterpulses).
//!
//! Crosstalk comes within 10 ps of a photon's avalanche in a neighbour, so in a CLK period in which there is an event
//! already: it blinds, and adds nothing to events of any SPAD. It is spread evenly over the SPADs, though those at the
//! edge get less of it.

use super::spad_light::absorbed;
use crate::photon::SpadModel;

/// The largest share of the variance of a macropixel's counts that cohorts leave out, where avalanches leave a carrier with probability
/// `afterpulse_probability` a: 2a/(1 + 3a).
///
/// A Poisson number of pulses that each bring another with probability a has (1 + 3a)/(1 + a) times its mean as variance, and cohorts give it
/// its mean. It is less where dead time thins pulses out, or where afterpulses come after the window. Of 5 % of afterpulses, of which
/// 8.7 % are left out at most, 7.5 % were measured in windows of 64 bins at 0.5 counts a window, 7 % in 16 bins at 0.3, and 4 to 5 % at 0.7 to 1.3.
pub fn variance_left_out(afterpulse_probability: f64) -> f64 {
    2.0 * afterpulse_probability / (1.0 + 3.0 * afterpulse_probability)
}

/// What a hazard in a cell does.
#[derive(Debug, Clone, Copy)]
pub(super) struct HazardCell {
    pub mean: f64,
    /// Probability of nothing.
    pub none: f64,
    /// Probability of anything.
    pub any: f64,
    /// Of those that come back to readiness in the cell, those still ready at its end.
    stay: f64,
    /// The others.
    fire: f64,
}

impl HazardCell {
    pub(super) fn new(mean: f64) -> Self {
        let any = absorbed(mean);
        // Where the quotient would lose its digits, a series.
        let fire = if mean < 1e-3 {
            mean * (0.5 - mean * (1.0 / 6.0 - mean * (1.0 / 24.0)))
        } else {
            1.0 - any / mean
        };
        HazardCell {
            mean,
            none: 1.0 - any,
            any,
            stay: 1.0 - fire,
            fire,
        }
    }

    /// As many more, for a reason of its own.
    fn and(self, more: f64) -> Self {
        if more > 0.0 {
            HazardCell::new(self.mean + more)
        } else {
            self
        }
    }

    /// Those of `ready` SPADs and of `returning` ones to which something happens, and those that are ready afterwards.
    pub(super) fn hit_and_ready(&self, ready: f64, returning: f64) -> [f64; 2] {
        let taken = ready * self.any + returning * self.fire;
        [taken, ready * self.none + returning * self.stay]
    }
}

/// SPADs without a trapped carrier and with one.
pub(super) type Traps = [f64; 2];

/// What avalanches cause besides pulses, for one SPAD among its neighbours.
#[derive(Debug, Clone, Copy)]
pub(super) struct Secondaries {
    /// Probability that a photon's avalanche leaves a carrier in a trap, to be released after the dead time.
    trapped: f64,
    /// Releases per femtosecond.
    released_per_fs: f64,
    /// Probability that a trap outlasts a dead time.
    outlasts: f64,
    /// Avalanches that one SPAD gets from others, by crosstalk, for each photon's avalanche of its own.
    pub crosstalk: f64,
}

impl Secondaries {
    pub(super) fn new(spads: &SpadModel) -> Self {
        let time_fs = spads.afterpulse_time.as_fs() as f64;
        let afterpulses = spads.afterpulse_probability > 0.0;
        // Of four neighbours that each SPAD would have without the edge of the macropixel: 3 of 4 in 4×4.
        let within = 2.0 * spads.grid.neighbours() as f64 / (4 * spads.grid.spads()) as f64;
        // Without a delay a carrier is released as soon as it can be.
        let released_per_fs = if afterpulses {
            1.0 / time_fs.max(1.0)
        } else {
            0.0
        };
        Secondaries {
            trapped: spads.afterpulse_probability,
            released_per_fs,
            outlasts: libm::exp(-released_per_fs * spads.dead_time.as_fs() as f64),
            crosstalk: within * spads.crosstalk_probability,
        }
    }

    pub(super) fn are_none(&self) -> bool {
        self.trapped == 0.0 && self.crosstalk == 0.0
    }

    /// What `ready` SPADs and those `returning` do in a cell, with its photons on each SPAD and `crossing` avalanches
    /// that come from others: what is ready afterwards, the pulses, by whether a carrier stays trapped, and
    /// avalanches that are no pulse of their own.
    pub(super) fn advance_cell(
        &self,
        photons: &HazardCell,
        crossing: f64,
        width_fs: f64,
        ready: &mut Traps,
        returning: Traps,
    ) -> Acts {
        let mut acts = Acts::default();
        if self.are_none() {
            [acts.pulses[0], ready[0]] = photons.hit_and_ready(ready[0], returning[0]);
            return acts;
        }
        let total = photons.and(crossing);
        let hazards = [total, total.and(self.released_per_fs * width_fs)];
        for trap in 0..2 {
            if ready[trap] == 0.0 && returning[trap] == 0.0 {
                continue;
            }
            let hazard = &hazards[trap];
            let [taken, left] = hazard.hit_and_ready(ready[trap], returning[trap]);
            ready[trap] = left;
            if taken == 0.0 {
                continue;
            }
            let fired = taken * photons.mean / hazard.mean;
            let crossed = taken * crossing / hazard.mean;
            let outlasts = if trap == 1 { self.outlasts } else { 0.0 };
            let trapped = 1.0 - (1.0 - self.trapped) * (1.0 - outlasts);
            acts.pulses[1] += fired * trapped;
            acts.pulses[0] += fired * (1.0 - trapped) + (taken - fired - crossed).max(0.0);
            acts.silent[1] += crossed * outlasts;
            acts.silent[0] += crossed * (1.0 - outlasts);
        }
        acts
    }

    /// The steady state under `rate` photons a femtosecond: ready SPADs, and pulses and silent avalanches a femtosecond.
    pub(super) fn steady(&self, rate: f64, dead_fs: f64) -> (Traps, Acts) {
        let mut ready = [1.0 / (1.0 + rate * dead_fs), 0.0];
        let mut acts = Acts::default();
        // Each round leaves a part of the error as small as the secondaries.
        for _ in 0..30 {
            let crossing = self.crosstalk * rate * (ready[0] + ready[1]);
            let trapped = 1.0 - (1.0 - self.trapped) * (1.0 - self.outlasts);
            let stay = trapped * rate + self.outlasts * crossing;
            let leave = rate + crossing + self.released_per_fs;
            let with_trap = if self.trapped > 0.0 {
                self.trapped * rate / (leave - stay)
            } else {
                0.0
            };
            let avalanches = rate + crossing + with_trap * leave;
            let free = 1.0 / (1.0 + with_trap + dead_fs * avalanches);
            ready = [free, free * with_trap];
            let [a, b] = ready;
            acts = Acts {
                pulses: [0.0, rate * (a * self.trapped + b * trapped)],
                silent: [0.0, crossing * b * self.outlasts],
            };
            acts.pulses[0] = rate * (a + b) + self.released_per_fs * b - acts.pulses[1];
            acts.silent[0] = crossing * (a + b) - acts.silent[1];
        }
        (ready, acts)
    }
}

/// Avalanches of one SPAD, in a cell or a femtosecond.
#[derive(Debug, Clone, Copy, Default)]
pub(super) struct Acts {
    /// Pulses.
    pub pulses: Traps,
    /// Crosstalk: it comes with an event that is there already.
    pub silent: Traps,
}

impl Acts {
    pub(super) fn times(self, factor: f64) -> Self {
        Acts {
            pulses: self.pulses.map(|part| part * factor),
            silent: self.silent.map(|part| part * factor),
        }
    }

    pub(super) fn pulse_sum(&self) -> f64 {
        self.pulses[0] + self.pulses[1]
    }
}
