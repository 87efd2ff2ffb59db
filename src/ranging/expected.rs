//! The mean histogram of an echo: what dead time and one count a bin make of a known pulse.
//!
//! ```text
//!   light      signal·(Gaussian about the arrival) + background, shared evenly by the SPADs
//!   SPAD       fires with rate light × chance that it is ready; then it is blind for the dead time
//!   bin        counts in a laser cycle if as many SPADs fired in it as TYPE and THRESHOLD ask for
//! ```
//!
//! Bins are equal. Times are in bins: bin i reaches from i − ½ to i + ½, as positions of peaks do. A SPAD's chance to be ready follows
//! exactly from the light: it is, unless it fired within the last dead time (non-paralysable), or unless a photon came
//! within it (paralysable). SPADs fire independently, so the number of those that fire in a bin is binomial. The integral
//! over time takes steps of an eighth of a bin; tests find the means of simulated light to five standard deviations
//! and 10⁻³ of their value.
//!
//! Assumed: a dead time of at least a bin, so that no SPAD fires twice in one; SPADs that have recovered from the echo
//! before the next laser cycle's. Left out: afterpulses and crosstalk.

use crate::chip::{EventType, SensorConfig};
use crate::numerics::normal_above;
use crate::units::Time;

/// Steps to a bin.
const STEPS: usize = 8;

/// Standard deviations before its centre where a pulse begins: 10⁻⁹ of it is left out.
const PULSE_BEGINS: f64 = 6.0;

/// Light on a macropixel, in mean photons that its SPADs would detect without dead time.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct EchoLight {
    /// Centre of the echo, bins.
    pub position_bins: f64,
    /// Photons of the echo in a laser cycle.
    pub signal: f64,
    /// Background and dark counts in a bin and laser cycle.
    pub background_per_bin: f64,
}

/// How a macropixel answers to light.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Response {
    bins: usize,
    dead_time_bins: f64,
    paralysable: bool,
    pulse_sigma_bins: f64,
    event_type: EventType,
    threshold: u8,
    spads: usize,
}

impl Response {
    /// Of a sensor's macropixels, with bins of `bin_s` seconds each, to Gaussian pulses of standard deviation `pulse_sigma`,
    /// all jitter included.
    pub fn new(config: &SensorConfig, bin_s: f64, pulse_sigma: Time) -> Self {
        Response {
            bins: config.bins,
            dead_time_bins: config.dead_time().as_s() / bin_s,
            paralysable: config.paralysable,
            pulse_sigma_bins: pulse_sigma.as_s() / bin_s,
            event_type: config.event_type,
            threshold: config.threshold,
            spads: config.spads(),
        }
    }

    /// Dead time, bins.
    pub fn dead_time_bins(&self) -> f64 {
        self.dead_time_bins
    }

    /// Standard deviation of the pulse, bins.
    pub fn pulse_sigma_bins(&self) -> f64 {
        self.pulse_sigma_bins
    }

    /// The chance that a bin counts in which each SPAD fires with chance `fired`.
    pub fn counts_if_fired(&self, fired: f64) -> f64 {
        let fired = fired.clamp(0.0, 1.0);
        if (self.event_type, self.threshold) == (EventType::Greater, 0) {
            return -(self.spads as f64 * (-fired).ln_1p()).exp_m1();
        }
        let threshold = usize::from(self.threshold);
        let mut choices = 1.0;
        let mut chance = 0.0;
        for n in 0..=self.spads {
            let counts = match self.event_type {
                EventType::Less => n < threshold,
                EventType::Equal => n == threshold,
                EventType::Greater => n > threshold,
            };
            if counts {
                chance +=
                    choices * fired.powi(n as i32) * (1.0 - fired).powi((self.spads - n) as i32);
            }
            choices *= (self.spads - n) as f64 / (n + 1) as f64;
        }
        chance
    }

    /// The background, photons in a bin and laser cycle, under which a bin counts with `chance`; `None` where brighter light
    /// need not count more (TYPE other than greater) or no light counts so much.
    pub fn background_for(&self, chance: f64) -> Option<f64> {
        if self.event_type != EventType::Greater || usize::from(self.threshold) >= self.spads {
            return None;
        }
        // A SPAD that is blind for d bins after it fired, or after a photon, fires in a bin with at most this chance.
        let most = match self.paralysable {
            false => 1.0 / self.dead_time_bins.max(1.0),
            true => 1.0 / (self.dead_time_bins.max(1.0) * std::f64::consts::E),
        };
        if chance >= self.counts_if_fired(most) {
            return None;
        }
        let (mut low, mut high) = (0.0, most);
        for _ in 0..50 {
            let middle = 0.5 * (low + high);
            match self.counts_if_fired(middle) < chance {
                true => low = middle,
                false => high = middle,
            }
        }
        let fired = 0.5 * (low + high);
        let light = match self.paralysable {
            false => fired / (1.0 - fired * self.dead_time_bins),
            true => {
                // fired = light·e^(−d·light), on its rising side.
                let mut light = fired;
                for _ in 0..50 {
                    light = fired * (light * self.dead_time_bins).exp();
                }
                light
            }
        };
        Some(light * self.spads as f64)
    }

    /// The chance of every bin to count in a laser cycle.
    pub fn chances(&self, light: &EchoLight) -> Vec<f64> {
        let sigma = self.pulse_sigma_bins;
        let per_spad = 1.0 / self.spads as f64;
        let signal = light.signal * per_spad;
        let background = light.background_per_bin * per_spad;
        let h = 1.0 / STEPS as f64;
        // Before the pulse the SPADs are as the background alone leaves them.
        let before =
            (-0.5 - (light.position_bins - PULSE_BEGINS * sigma)).clamp(0.0, self.bins as f64);
        let lead = (before / h).ceil() as usize;
        let begin = -0.5 - lead as f64 * h;
        let steps = lead + self.bins * STEPS;

        // Light on a SPAD from `begin` to the end of each step.
        let seen = |time: f64| {
            background * (time - begin) + signal * share_before(time - light.position_bins, sigma)
        };
        let mut blinding = History::new(self.dead_time_bins / h);
        let steady = match self.paralysable {
            false => background / (1.0 + background * self.dead_time_bins),
            true => background,
        };
        let mut fired = vec![0.0; self.bins];
        let mut ready = match self.paralysable {
            false => 1.0 - steady * self.dead_time_bins,
            true => (-background * self.dead_time_bins).exp(),
        };
        blinding.begin(steady * h, steps);
        let mut seen_before = seen(begin);
        for step in 0..steps {
            let seen_after = seen(begin + (step + 1) as f64 * h);
            let photons = (seen_after - seen_before).max(0.0);
            seen_before = seen_after;
            let recovering = blinding.ending(step);
            let hit = -(-photons).exp_m1();
            let fires = match self.paralysable {
                false => {
                    // Those that recover during the step see half of it.
                    let late = 1.0
                        - if photons > 1e-6 {
                            hit / photons
                        } else {
                            1.0 - 0.5 * photons
                        };
                    let fires = ready * hit + recovering * late;
                    ready += recovering - fires;
                    blinding.push(fires);
                    fires
                }
                true => {
                    let fires = ready * (0.5 * recovering).exp() * hit;
                    ready *= (recovering - photons).exp();
                    blinding.push(photons);
                    fires
                }
            };
            if step >= lead {
                fired[(step - lead) / STEPS] += fires;
            }
        }
        fired
            .iter()
            .map(|&fired| self.counts_if_fired(fired))
            .collect()
    }
}

/// Share of a Gaussian pulse that comes before `time` relative to its centre.
fn share_before(time: f64, sigma: f64) -> f64 {
    let z = time / sigma;
    match z.abs() > 8.0 || sigma == 0.0 {
        true => f64::from(time > 0.0),
        false => normal_above(-z),
    }
}

/// What blinds, step by step, and what of it ends a dead time later.
struct History {
    /// Dead time in steps.
    delay: f64,
    before: f64,
    steps: Vec<f64>,
}

impl History {
    fn new(delay: f64) -> Self {
        History {
            delay,
            before: 0.0,
            steps: Vec::new(),
        }
    }

    /// `before` in every step until now; `steps` are to come.
    fn begin(&mut self, before: f64, steps: usize) {
        self.before = before;
        self.steps = Vec::with_capacity(steps);
    }

    fn push(&mut self, blinding: f64) {
        self.steps.push(blinding);
    }

    /// What ends during `step`.
    fn ending(&self, step: usize) -> f64 {
        let from = step as f64 - self.delay;
        let whole = from.floor();
        let at = |step: f64| match step >= 0.0 {
            true => self.steps.get(step as usize).copied().unwrap_or(0.0),
            false => self.before,
        };
        let part = from - whole;
        at(whole) * (1.0 - part) + at(whole + 1.0) * part
    }
}
