//! The mean histogram of an echo: what dead time and one count a bin make of a known pulse.
//!
//! ```text
//!   light      signal·(Gaussian about the arrival, late avalanches behind it) + background, shared evenly by the SPADs
//!   SPAD       fires with rate light × chance that it is ready; then it is blind for the dead time
//!   bin        counts in a laser cycle if as many SPADs fired in it as TYPE and THRESHOLD ask for
//! ```
//!
//! Bins are equal. Times are in bins: bin i reaches from i − ½ to i + ½, as positions of peaks do. A SPAD's chance to be ready follows
//! exactly from the light: it is, unless it fired within the last dead time (non-paralysable), or unless a photon came
//! within it (paralysable). SPADs fire independently, so the number of those that fire in a bin is binomial.
//!
//! How a SPAD goes through a laser cycle is [`spad_state`](super::spad_state)'s.
//!
//! Assumed: SPADs and pulses alike ([`spreads`](super::spreads) says what it costs where they are not), and recovered from the echo before the next laser cycle's.

mod known_chances;
mod other_bins;

use std::sync::Arc;

use smallvec::smallvec;

use super::counting::Counting;
use super::plain::{self, LANES, OfBins};
use super::pulse::{PULSE_REACH, Pulse, Tail};
use super::spad_state::{Dead, Spad};
use crate::chip::{EventType, SensorConfig};
use crate::numerics::Dual;
use crate::photon::{EchoWidth, TAIL_REACH};

pub(super) use other_bins::{FiringTogether, OtherBins};

/// Steps to a bin, at least.
const STEPS: usize = 4;

/// Steps to a dead time, at least, and to the time in which light fires a SPAD, where SPADs fire again under a pulse; and most
/// steps to a bin.
const STEPS_OF_DEAD_TIME: f64 = 12.0;
const STEPS_OF_RATE: f64 = 8.0;
const MOST_STEPS: f64 = 96.0;

/// The same of plain SPADs, whose steps are better, and steps to a standard deviation of their pulse.
const PLAIN_STEPS: usize = 3;
const PLAIN_STEPS_OF_RATE: f64 = 16.0;
const MOST_PLAIN_STEPS: f64 = 32.0;
const STEPS_OF_SIGMA: f64 = 1.5;

/// Lights of plain SPADs from which on it pays to find the chances of all at once: with three, bright short pulses took a twentieth longer.
const WORTH_LANES: usize = 5;

/// Shortest pulse, bins: with one that takes no time, no place near the end of a bin explains a few counts in the next one.
const LEAST_SIGMA: f64 = 0.02;

/// Parameters of the light: place, ln signal, ln background, ln width.
pub(super) const PARAMETERS: usize = 4;

/// Share of laser cycles that is taken to reach a bin at least, so that counts there say something: chosen.
const LEAST_REACHED: f64 = 1e-3;

/// Light on a macropixel, in mean photons that its SPADs would detect without dead time.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct EchoLight {
    /// Centre of the echo, bins: the mean time of its photons.
    pub position_bins: f64,
    /// Photons of the echo in a laser cycle.
    pub signal: f64,
    /// Background and dark counts in a bin and laser cycle.
    pub background_per_bin: f64,
    /// Standard deviation of the echo, bins: that of the laser pulse with all jitter ([`Response::pulse_sigma_bins`]), or more.
    pub sigma_bins: f64,
}

/// How finely time goes.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum Steps {
    /// To find where to look.
    Coarse,
    /// As finely as the light needs.
    Fine,
}

/// How a macropixel answers to light.
#[derive(Debug, Clone, PartialEq)]
pub struct Response {
    /// Histogram bins.
    pub(crate) bins: usize,
    /// Standard deviation of the pulse, bins.
    pub pulse_sigma_bins: f64,
    tail: Option<Tail>,
    pub(super) counting: Counting,
    dead: Dead,
    /// Standard deviation of dead times, relative to their mean; that of pulses' energies, and of the SPADs' detection efficiencies.
    pub(super) dead_time_spread: f64,
    pub(super) energy_spread: f64,
    pub(super) pde_spread: f64,
    /// Of bins that count otherwise; dead time says nothing there.
    other_bins: Option<Arc<OtherBins>>,
}

impl Response {
    /// Of a sensor's macropixels, with bins of `bin_s` seconds each, to pulses of this width, all jitter included. A standard deviation below
    /// 0.02 bins is taken for 0.02.
    pub fn new(config: &SensorConfig, bin_s: f64, pulse: impl Into<EchoWidth>) -> Self {
        let pulse = pulse.into();
        let (afterpulses, afterpulse_s) = config.afterpulses();
        let grid = config.spad_grid();
        // Each of four directions is as likely; at an edge there is nobody.
        let neighbours = 2.0 * grid.neighbours() as f64 / (4 * grid.spads()) as f64;
        Response {
            bins: config.bins,
            pulse_sigma_bins: (pulse.sigma.as_s() / bin_s).max(LEAST_SIGMA),
            tail: pulse.tail.map(|tail| Tail {
                share: tail.share,
                bins: tail.time.as_s() / bin_s,
            }),
            counting: Counting {
                event_type: config.event_type,
                threshold: usize::from(config.threshold),
                spads: config.spads(),
            },
            dead: Dead {
                time_bins: config.dead_time().as_s() / bin_s,
                paralysable: config.paralysable,
                afterpulses,
                afterpulse_bins: (afterpulse_s / bin_s).max(1e-9),
                crosstalk: config.crosstalk_probability * neighbours,
            },
            dead_time_spread: config.dead_time_spread,
            energy_spread: pulse.energy_spread,
            pde_spread: pulse.pde_spread,
            other_bins: None,
        }
    }

    /// Of a sensor whose bins are not ours.
    pub(super) fn of_other_bins(pulse_sigma_bins: f64, law: OtherBins) -> Self {
        Response {
            bins: law.edges.len() - 1,
            pulse_sigma_bins: pulse_sigma_bins.max(LEAST_SIGMA),
            tail: None,
            counting: Counting {
                event_type: EventType::Greater,
                threshold: 0,
                spads: 1,
            },
            dead: Dead {
                time_bins: 1.0,
                paralysable: false,
                afterpulses: 0.0,
                afterpulse_bins: 1e-9,
                crosstalk: 0.0,
            },
            dead_time_spread: 0.0,
            energy_spread: 0.0,
            pde_spread: 0.0,
            other_bins: Some(Arc::new(law)),
        }
    }

    /// What counts where this does not, and the other way round; `None` where that is no TYPE and THRESHOLD. Of light that makes
    /// this count less, the other counts more.
    pub(super) fn complement(&self) -> Option<Self> {
        let threshold = match (self.counting.event_type, self.counting.threshold) {
            (EventType::Less, threshold @ 1..) => threshold - 1,
            (EventType::Equal, 0) => 0,
            _ => return None,
        };
        let mut other = self.clone();
        other.counting.event_type = EventType::Greater;
        other.counting.threshold = threshold;
        Some(other)
    }

    /// The same SPADs with dead times that are `factor` times as long.
    pub(super) fn with_dead_times(mut self, factor: f64) -> Self {
        self.dead.time_bins *= factor;
        self
    }

    /// The chances of bins that are not ours, without the echo of this light.
    pub(super) fn dark_chances(&self, light: &EchoLight) -> Option<Vec<f64>> {
        self.other_bins.as_ref()?;
        Some(self.chances(&EchoLight {
            signal: 0.0,
            ..*light
        }))
    }

    /// The light of a bin that counts with `chance`, photons in a bin and laser cycle, if SPADs are ready for it and more light makes it
    /// count more.
    pub(super) fn steady_light(&self, chance: f64) -> f64 {
        if let Some(law) = &self.other_bins {
            return law.steady_light(chance);
        }
        let fired = self.counting.fired_for(chance.min(0.999));
        -(self.counting.spads as f64) * libm::log1p(-fired)
    }

    /// Laser cycles, of `cycles`, that reach each bin: all, or of first events those without one before.
    pub(super) fn reached(&self, counts: &[f64], cycles: f64) -> Vec<f64> {
        let law = self.other_bins.as_ref().filter(|law| law.first_only);
        let mut left = cycles;
        let reached = counts.iter().map(|count| {
            let reached = left.max(LEAST_REACHED * cycles);
            left -= law.map_or(0.0, |law| count * law.parts);
            reached
        });
        reached.collect()
    }

    /// Dead time, bins.
    pub(crate) fn dead_time_bins(&self) -> f64 {
        self.dead.time_bins
    }

    /// The chance of every bin to count in a laser cycle.
    pub fn chances(&self, light: &EchoLight) -> Vec<f64> {
        self.chances_in(light, Steps::Fine)
    }

    /// The chance of every bin to count in a laser cycle, and what a laser cycle's count tells of the echo's place: Fisher's information,
    /// 1/bins². The least variance of a place after N laser cycles is 1 over N times their sum.
    pub fn information(&self, light: &EchoLight) -> Vec<(f64, f64)> {
        let of_bin = |chance: &Dual<1>| {
            let spread = chance.value * (1.0 - chance.value);
            let told = chance.slope[0] * chance.slope[0] / spread;
            (chance.value, if spread > 0.0 { told } else { 0.0 })
        };
        let chances = self.chances_of::<1>(light, Steps::Fine);
        chances.iter().map(of_bin).collect()
    }

    pub(super) fn chances_in(&self, light: &EchoLight, steps: Steps) -> Vec<f64> {
        let chances = self.chances_of::<0>(light, steps);
        chances.iter().map(|chance| chance.value).collect()
    }

    /// Whether this light needs finer steps than the fewest.
    pub(super) fn needs_fine_steps(&self, light: &EchoLight) -> bool {
        self.steps(light, Steps::Fine) > self.steps(light, Steps::Coarse)
    }

    /// How long late avalanches come after the Gaussian pulse.
    fn tail_bins(&self) -> f64 {
        self.tail.map_or(0.0, |tail| TAIL_REACH * tail.bins)
    }

    /// Steps to a bin; of plain SPADs in bins where the pulse or what recovers from it needs them.
    fn steps(&self, light: &EchoLight, steps: Steps) -> usize {
        if self.other_bins.is_some() {
            return 1;
        }
        let sigma = light.sigma_bins.max(1e-3);
        let (least, of_rate, most) = if self.dead.is_plain() {
            let of_pulse = (STEPS_OF_SIGMA / sigma).min(MOST_PLAIN_STEPS);
            let least = PLAIN_STEPS.max(of_pulse.ceil() as usize);
            (least, PLAIN_STEPS_OF_RATE, MOST_PLAIN_STEPS)
        } else {
            let of_dead_time = (2.0 / self.dead.time_bins).min(16.0);
            let least = STEPS.max(of_dead_time.ceil() as usize);
            (least, STEPS_OF_RATE, MOST_STEPS)
        };
        let fires_once = self.dead.time_bins >= 2.0 * PULSE_REACH * sigma + self.tail_bins();
        if steps == Steps::Coarse || fires_once && self.dead.time_bins >= 2.0 {
            return least;
        }
        // Within the pulse SPADs fire again, and each firing is as sharp as the light is strong.
        let rate = 0.4 * light.signal / (self.counting.spads as f64 * sigma);
        let of_dead_time = STEPS_OF_DEAD_TIME / self.dead.time_bins;
        let wanted = of_dead_time.max(of_rate * rate).min(most);
        (wanted.ceil() as usize).max(least)
    }

    /// The chances with their slopes with the first K parameters.
    pub(super) fn chances_of<const K: usize>(&self, light: &EchoLight, steps: Steps) -> OfBins<K> {
        if let Some(law) = &self.other_bins {
            return law.chances(self, light);
        }
        let steps = self.steps(light, steps);
        if self.dead.is_plain() {
            self.chances_of_plain(light, steps)
        } else {
            OfBins::from_vec(self.chances_by(light, steps))
        }
    }

    /// The same of some lights, told with their numbers, in order.
    pub(super) fn chances_of_each<const K: usize>(
        &self,
        lights: &[EchoLight],
        steps: Steps,
        mut tell: impl FnMut(usize, &[Dual<K>]),
    ) {
        let has_lanes = self.other_bins.is_none() && self.dead.is_plain();
        for (group, of_group) in lights.chunks(LANES).enumerate() {
            let first = group * LANES;
            if has_lanes && of_group.len() >= WORTH_LANES {
                let chances = self.chances_in_lanes(of_group, steps);
                let chances = chances.iter().take(of_group.len());
                chances
                    .enumerate()
                    .for_each(|(lane, of_light)| tell(first + lane, of_light));
            } else {
                for (number, light) in of_group.iter().enumerate() {
                    tell(first + number, &self.chances_of(light, steps));
                }
            }
        }
    }

    /// The same of plain SPADs and no more lights than lanes; of fewer, the last ones are the same.
    fn chances_in_lanes<const K: usize>(
        &self,
        lights: &[EchoLight],
        steps: Steps,
    ) -> [OfBins<K>; LANES] {
        let spads = self.counting.spads as f64;
        let of_lanes: [&EchoLight; LANES] =
            std::array::from_fn(|lane| &lights[lane.min(lights.len() - 1)]);
        let pulses = of_lanes.map(|light| self.pulse(light));
        let background = of_lanes.map(|light| light.background_per_bin / spads);
        let steps = of_lanes.map(|light| self.steps(light, steps));
        let most_steps = steps.into_iter().max().expect("a lane");
        let begins = pulses.iter().map(|pulse| self.begin_bin(pulse));
        let begin_bin = begins.fold(f64::INFINITY, f64::min);
        let unlit = begin_bin.max(0.0) as usize;
        let before = (-begin_bin).max(0.0) as usize;
        let bins = self.bins + before - unlit;
        let dead = self.dead.time_bins;
        let steps = plain::PlainSteps::for_pulses(begin_bin, bins, &pulses, most_steps, dead);
        let mut of_bins =
            background.map(|background| smallvec![plain::steady(background, dead); unlit]);
        plain::fired_by_each(&pulses, &background, &steps, &mut of_bins);
        for of_lane in &mut of_bins {
            self.as_chances(before, of_lane);
        }
        of_bins
    }

    /// Turns how often a SPAD fires in each bin, beginning `before` bins before those of the histogram, into their chances to count.
    fn as_chances<const K: usize>(&self, before: usize, of_bins: &mut OfBins<K>) {
        of_bins.drain(..before);
        for of_bin in of_bins {
            *of_bin = self.counting.chance(*of_bin, Dual::ZERO);
        }
    }

    /// Light of the echo on a SPAD.
    fn pulse(&self, light: &EchoLight) -> Pulse {
        Pulse::new(
            light.signal / self.counting.spads as f64,
            light.position_bins,
            light.sigma_bins.max(1e-6),
            self.tail,
        )
    }

    /// The bin with which a pulse begins; of one long before the first bin nothing is left.
    fn begin_bin(&self, pulse: &Pulse) -> f64 {
        let forgotten = -8.0 - 2.0 * self.dead.time_bins - 2.0 * (pulse.ends - pulse.starts);
        (pulse.starts + 0.5)
            .clamp(forgotten, self.bins as f64)
            .floor()
    }

    /// The same of plain SPADs.
    fn chances_of_plain<const K: usize>(&self, light: &EchoLight, steps: usize) -> OfBins<K> {
        if let Some(known) = known_chances::find(self, light, steps) {
            return known;
        }
        if K == 0 {
            let chances = self.chances_with::<0>(light, steps);
            let values = chances.iter().map(|chance| Dual::constant(chance.value));
            return values.collect();
        }
        // All slopes cost no more than some, and a fit with a width of its own begins where one without ends.
        let chances = self.chances_with::<4>(light, steps);
        known_chances::keep(self, light, steps, &chances);
        known_chances::first_slopes(&chances)
    }

    /// The same with no slopes, or with all.
    fn chances_with<const K: usize>(&self, light: &EchoLight, steps: usize) -> OfBins<K> {
        let (pulse, dead) = (self.pulse(light), self.dead.time_bins);
        let background = light.background_per_bin / self.counting.spads as f64;
        let begin_bin = self.begin_bin(&pulse);
        let unlit = begin_bin.max(0.0) as usize;
        let before = (-begin_bin).max(0.0) as usize;
        let bins = self.bins + before - unlit;
        let steps = plain::PlainSteps::for_pulses(begin_bin, bins, &[pulse], steps, dead);
        let mut of_bins = smallvec![plain::steady(background, dead); unlit];
        plain::fired(&pulse, background, &steps, &mut of_bins);
        self.as_chances(before, &mut of_bins);
        of_bins
    }

    fn chances_by<const K: usize>(&self, light: &EchoLight, steps_per_bin: usize) -> Vec<Dual<K>> {
        let dual = |value: f64, slopes: [f64; PARAMETERS]| Dual {
            value,
            slope: std::array::from_fn(|parameter| slopes[parameter]),
        };
        let background = light.background_per_bin / self.counting.spads as f64;
        let background = dual(background, [0.0, 0.0, background, 0.0]);
        let h = 1.0 / steps_per_bin as f64;
        let pulse = self.pulse(light);
        // Before the pulse the SPADs are as the background alone leaves them: nothing happens before it begins.
        let last = self.bins as f64 - 0.5;
        let begin_bin = self.begin_bin(&pulse);
        let begin = begin_bin - 0.5;
        let mut chances = Vec::with_capacity(self.bins);
        let mut spad = Spad::steady(&self.dead, background, h);
        let steady = {
            let mut of_bin = spad.clone();
            of_bin.begin_bin();
            for _ in 0..steps_per_bin {
                of_bin.step(background * h);
            }
            of_bin.chance(&self.counting)
        };
        for _ in 0..begin_bin.max(0.0) as usize {
            chances.push(steady);
        }
        let steps = ((last - begin) / h).round() as usize;
        let times: Vec<f64> = (0..=steps).map(|step| begin + step as f64 * h).collect();
        let [until, by_place, by_width] = pulse.until_each(&times);
        for step in 0..steps {
            let time = times[step + 1];
            if step % steps_per_bin == 0 {
                spad.begin_bin();
            }
            let growth = |row: &[f64]| row[step + 1] - row[step];
            let signal = growth(&until);
            let slopes = [growth(&by_place), signal, 0.0, growth(&by_width)];
            spad.step(background * h + dual(signal, slopes));
            if (step + 1) % steps_per_bin == 0 && time > 0.0 {
                chances.push(spad.chance(&self.counting));
            }
        }
        chances
    }
}

#[cfg(test)]
mod tests;
