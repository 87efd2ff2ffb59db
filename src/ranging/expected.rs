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
//! within it (paralysable). SPADs fire independently, so the number of those that fire in a bin is binomial.
//!
//! Time goes in steps, over which light and recovery are taken to be even; what a step's light does to a SPAD that is ready, or that
//! recovers within the step, is exact. So the rising edge of an echo is exact however strong it is, and what comes after
//! the dead time is as fine as the steps. A SPAD that fires twice within a bin toggles its flip-flop back (thesis 4.2), so with a dead time below a bin
//! it counts where it fired an odd number of times, which follows from a second, signed, state of the SPAD.
//!
//! A SPAD that recovers may have carriers trapped, which fire it once more if no photon does before. Where it is paralysable,
//! afterpulses come as further light, because what blinds them comes after the avalanche that they are of. Crosstalk
//! comes as further light from what fires now. Neither breeds, as in [`photon::spad`](crate::photon). This leaves out squares of the two chances.
//!
//! Assumed: SPADs alike, and recovered from the echo before the next laser cycle's.

use super::counting::Counting;
use super::edge::{share_before, share_slope};
use crate::chip::{EventType, SensorConfig};
use crate::numerics::Dual;
use crate::units::Time;

/// Steps to a bin, at least.
const STEPS: usize = 4;

/// Steps to a dead time, at least, and to the time in which light fires a SPAD, where SPADs fire again under a pulse; and most
/// steps to a bin.
const STEPS_OF_DEAD_TIME: f64 = 12.0;
const STEPS_OF_RATE: f64 = 8.0;
const MOST_STEPS: f64 = 96.0;

/// Standard deviations from its centre where a pulse begins and ends: 10⁻¹¹ of it is left out, less than a photon of 10¹⁰.
const PULSE_REACH: f64 = 6.7;

/// Parameters of the light: place, ln signal, ln background, ln width.
pub(super) const PARAMETERS: usize = 4;

/// A number and its slopes with the parameters of the light.
pub(super) type Slopes = Dual<PARAMETERS>;

/// Light on a macropixel, in mean photons that its SPADs would detect without dead time.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct EchoLight {
    /// Centre of the echo, bins.
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
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Response {
    bins: usize,
    dead_time_bins: f64,
    paralysable: bool,
    pulse_sigma_bins: f64,
    counting: Counting,
    afterpulses: f64,
    afterpulse_bins: f64,
    /// Avalanches of neighbours for each of a SPAD's, on average, if they are ready.
    crosstalk: f64,
}

impl Response {
    /// Of a sensor's macropixels, with bins of `bin_s` seconds each, to Gaussian pulses of standard deviation `pulse_sigma`,
    /// all jitter included.
    pub fn new(config: &SensorConfig, bin_s: f64, pulse_sigma: Time) -> Self {
        let grid = config.spad_grid();
        // Each of four directions is as likely; at an edge there is nobody.
        let neighbours = 2.0 * grid.neighbours() as f64 / (4 * grid.spads()) as f64;
        Response {
            bins: config.bins,
            dead_time_bins: config.dead_time().as_s() / bin_s,
            paralysable: config.paralysable,
            pulse_sigma_bins: pulse_sigma.as_s() / bin_s,
            counting: Counting {
                event_type: config.event_type,
                threshold: usize::from(config.threshold),
                spads: config.spads(),
            },
            afterpulses: config.afterpulse_probability,
            afterpulse_bins: config.afterpulse_time_ns * 1e-9 / bin_s,
            crosstalk: config.crosstalk_probability * neighbours,
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
        let mut other = *self;
        other.counting.event_type = EventType::Greater;
        other.counting.threshold = threshold;
        Some(other)
    }

    pub(super) fn counting(&self) -> &Counting {
        &self.counting
    }

    /// Histogram bins.
    pub fn bins(&self) -> usize {
        self.bins
    }

    /// Dead time, bins.
    pub fn dead_time_bins(&self) -> f64 {
        self.dead_time_bins
    }

    /// Standard deviation of the pulse, bins.
    pub fn pulse_sigma_bins(&self) -> f64 {
        self.pulse_sigma_bins
    }

    /// The chance of every bin to count in a laser cycle.
    pub fn chances(&self, light: &EchoLight) -> Vec<f64> {
        self.chances_in(light, Steps::Fine)
    }

    pub(super) fn chances_in(&self, light: &EchoLight, steps: Steps) -> Vec<f64> {
        let parameters = [Dual::<0>::ZERO; PARAMETERS];
        let chances = self.chances_of(light, parameters, steps);
        chances.iter().map(|chance| chance.value).collect()
    }

    /// The same with the slopes of each chance.
    pub(super) fn slopes(&self, light: &EchoLight, steps: Steps) -> Vec<Slopes> {
        let parameter = |of| Dual::parameter(0.0, of);
        self.chances_of(light, std::array::from_fn(parameter), steps)
    }

    /// Whether this light needs finer steps than the fewest.
    pub(super) fn needs_fine_steps(&self, light: &EchoLight) -> bool {
        self.steps(light, Steps::Fine) > self.steps(light, Steps::Coarse)
    }

    /// Steps to a bin.
    fn steps(&self, light: &EchoLight, steps: Steps) -> usize {
        let sigma = light.sigma_bins.max(1e-3);
        let fires_once = self.dead_time_bins >= 2.0 * PULSE_REACH * sigma;
        if steps == Steps::Coarse || fires_once && self.dead_time_bins >= 2.0 {
            return STEPS.max((2.0 / self.dead_time_bins).min(16.0).ceil() as usize);
        }
        // Within the pulse SPADs fire again, and each firing is as sharp as the light is strong.
        let rate = 0.4 * light.signal / (self.counting.spads as f64 * sigma);
        let of_dead_time = STEPS_OF_DEAD_TIME / self.dead_time_bins;
        let wanted = of_dead_time.max(STEPS_OF_RATE * rate).min(MOST_STEPS);
        (wanted.ceil() as usize).max(STEPS)
    }

    /// The chances, where `shifts` are what the parameters are more than those of `light`: zero, with slopes.
    fn chances_of<const K: usize>(
        &self,
        light: &EchoLight,
        shifts: [Dual<K>; PARAMETERS],
        steps: Steps,
    ) -> Vec<Dual<K>> {
        let [by_place, by_signal, by_background, by_width] = shifts;
        let per_spad = 1.0 / self.counting.spads as f64;
        let signal = light.signal * per_spad;
        let background = light.background_per_bin * per_spad;
        let background = by_background.chain(background, background);
        let sigma = light.sigma_bins.max(1e-6);
        let steps_per_bin = self.steps(light, steps);
        let h = 1.0 / steps_per_bin as f64;

        // Light of the pulse on a SPAD until a time.
        let centre = light.position_bins;
        let (starts, ends) = (centre - PULSE_REACH * sigma, centre + PULSE_REACH * sigma);
        let seen = |time: f64| -> Dual<K> {
            if time <= starts || time >= ends {
                let value = if time <= starts { 0.0 } else { signal };
                return by_signal.chain(value, value);
            }
            let z = (time - centre) / sigma;
            let (share, density) = (share_before(z), share_slope(z));
            let value = signal * share;
            let by_time = signal * density / sigma;
            by_signal.chain(value, value)
                + by_place.chain(0.0, -by_time)
                + by_width.chain(0.0, -by_time * z * sigma)
        };
        // Before the pulse the SPADs are as the background alone leaves them: nothing happens before it begins.
        let last = self.bins as f64 - 0.5;
        // Of an echo long before the first bin nothing is left.
        let forgotten = -8.0 - 2.0 * self.dead_time_bins - 4.0 * PULSE_REACH * sigma;
        let begin_bin = (starts + 0.5).clamp(forgotten, self.bins as f64).floor();
        let begin = begin_bin - 0.5;
        let mut chances = Vec::with_capacity(self.bins);
        let mut spad = Spad::steady(self, background, h);
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
        spad.reserve(steps);
        let mut seen_before = seen(begin);
        for step in 0..steps {
            let time = begin + (step + 1) as f64 * h;
            if step % steps_per_bin == 0 {
                spad.begin_bin();
            }
            let seen_after = seen(time);
            spad.step(background * h + (seen_after - seen_before));
            seen_before = seen_after;
            if (step + 1) % steps_per_bin == 0 && time > 0.0 {
                chances.push(spad.chance(&self.counting));
            }
        }
        chances
    }
}

/// The state of a SPAD, as chances.
#[derive(Clone)]
struct Spad<'r, const K: usize> {
    response: &'r Response,
    /// Step, bins.
    h: f64,
    /// That it is ready, with or without trapped carriers.
    ready: Dual<K>,
    /// What blinds: avalanches, or where it is paralysable all light.
    blinding: History<K>,
    /// Avalanches after which carriers are trapped; where it is paralysable, afterpulses to be released.
    trapping: History<K>,
    /// That it is ready and carriers are trapped; where it is paralysable, that they are.
    trapped: Dual<K>,
    /// The share of carriers that stay trapped for a dead time.
    kept: f64,
    /// Avalanches of the bin, and those of them by crosstalk.
    fired: Dual<K>,
    by_crosstalk: Dual<K>,
    parity: Option<Parity<K>>,
}

/// The same states, each with the sign of the SPAD's flip-flop since the bin began.
#[derive(Clone)]
struct Parity<const K: usize> {
    ready: Dual<K>,
    blind: Dual<K>,
    blinding: History<K>,
}

impl<'r, const K: usize> Spad<'r, K> {
    /// Under background alone, photons of a SPAD in a bin.
    fn steady(response: &'r Response, background: Dual<K>, h: f64) -> Self {
        let dead = response.dead_time_bins;
        let tau = response.afterpulse_bins.max(1e-9);
        let kept = (-dead / tau).exp();
        let (mut fired, mut ready, mut trapped) = (background, Dual::ZERO, Dual::ZERO);
        let mut light = background;
        // Afterpulses and crosstalk are few: each round has the next power of their chance.
        for _ in 0..6 {
            ready = match response.paralysable {
                false => Dual::constant(1.0) - fired * dead,
                true => (light * -dead).exp(),
            };
            let bred = background * ready;
            light = background + bred * response.crosstalk;
            let traps = bred * response.afterpulses;
            match response.paralysable {
                false => {
                    // A photon before it is released leaves it trapped for another dead time.
                    let lost = light * (1.0 - kept) + Dual::constant(1.0 / tau);
                    trapped = traps * lost.recip();
                    fired = (light + trapped * (1.0 / tau)) * (Dual::constant(1.0) + light * dead).recip();
                }
                true => {
                    trapped = traps * tau;
                    light += traps;
                    fired = light * ready;
                }
            }
        }
        if !response.paralysable {
            ready = Dual::constant(1.0) - fired * dead;
        }
        let traps = match response.paralysable {
            false => background * ready * response.afterpulses + trapped * light * kept,
            true => background * ready * response.afterpulses,
        };
        let blinding = match response.paralysable {
            false => fired,
            true => light,
        };
        let history = |of: Dual<K>| History::new(dead / h, of * h);
        Spad {
            response,
            h,
            ready,
            blinding: history(blinding),
            trapping: history(traps),
            trapped,
            kept,
            fired: Dual::ZERO,
            by_crosstalk: Dual::ZERO,
            parity: (dead < 1.0).then(|| Parity {
                ready,
                blind: Dual::constant(1.0) - ready,
                blinding: history(blinding),
            }),
        }
    }

    fn reserve(&mut self, steps: usize) {
        self.blinding.steps.reserve(steps);
    }

    fn begin_bin(&mut self) {
        (self.fired, self.by_crosstalk) = (Dual::ZERO, Dual::ZERO);
        if let Some(parity) = &mut self.parity {
            parity.ready = self.ready;
            parity.blind = Dual::constant(1.0) - self.ready;
            parity.blinding = self.blinding.recent();
        }
    }

    /// A step with so many photons on the SPAD.
    #[inline]
    fn step(&mut self, photons: Dual<K>) {
        let response = self.response;
        let recovering = self.blinding.ending();
        let has_traps = response.afterpulses > 0.0;
        let mut light = photons;
        if has_traps && response.paralysable {
            light += self.afterpulses();
        }
        let mut crosstalk = Dual::ZERO;
        if response.crosstalk > 0.0 {
            let own = self.avalanches(light, recovering) * photons * positive(light).recip();
            crosstalk = own * response.crosstalk;
            light += crosstalk;
        }
        let mut fired = self.avalanches(light, recovering);
        // Avalanches of light, without those of afterpulses that came first.
        let mut by_light = fired;
        if has_traps && !response.paralysable {
            let (released, lost) = self.released(light, photons, fired);
            fired += released - lost;
            by_light = fired - released;
        }
        if has_traps && response.paralysable {
            let bred = fired * photons * positive(light).recip();
            self.trapping.push(bred * response.afterpulses);
        }
        if let Some(parity) = &mut self.parity {
            let all = match fired.value > by_light.value {
                true => light * fired * positive(by_light).recip(),
                false => light,
            };
            parity.step(response.paralysable, all, self.ready);
        }
        match response.paralysable {
            false => {
                self.ready += recovering - fired;
                self.blinding.push(fired);
            }
            true => {
                self.ready = self.ready * (recovering - light).exp();
                self.blinding.push(light);
            }
        }
        if response.crosstalk > 0.0 {
            self.by_crosstalk += by_light * crosstalk * positive(light).recip();
        }
        self.fired += fired;
    }

    /// Avalanches under so much light, while so many recover (or, where it is paralysable, so much light is forgotten).
    #[inline]
    fn avalanches(&self, light: Dual<K>, recovering: Dual<K>) -> Dual<K> {
        match self.response.paralysable {
            false => {
                let missed = light.exprel_neg();
                self.ready * light * missed + recovering * (Dual::constant(1.0) - missed)
            }
            true => self.ready * light * (light - recovering).exprel_neg(),
        }
    }

    /// Afterpulses of this step, and avalanches of light that they are in place of.
    fn released(&mut self, light: Dual<K>, photons: Dual<K>, fired: Dual<K>) -> (Dual<K>, Dual<K>) {
        let response = self.response;
        let release = Dual::constant(self.h / response.afterpulse_bins.max(1e-9));
        let recovering = self.trapping.ending();
        let both = light + release;
        let (missed, missed_of_light) = (both.exprel_neg(), light.exprel_neg());
        let one = Dual::constant(1.0);
        // What fires those with trapped carriers, and what would have fired them without.
        let gone = self.trapped * both * missed + recovering * (one - missed);
        let of_light = self.trapped * light * missed_of_light + recovering * (one - missed_of_light);
        let released = gone * release * both.recip();
        let fired_trapped = gone - released;
        self.trapped += recovering - gone;
        // Photons, but not crosstalk, trap carriers anew.
        let photon_share = photons * positive(light).recip();
        let fresh = (fired - of_light + fired_trapped) * photon_share * response.afterpulses;
        let old = fired_trapped * self.kept;
        self.trapping.push(fresh + old * (one - photon_share * response.afterpulses));
        (released, of_light - fired_trapped)
    }

    /// Afterpulses of this step, where they come as light.
    fn afterpulses(&mut self) -> Dual<K> {
        let spent = self.h / self.response.afterpulse_bins.max(1e-9);
        let released = -(-spent).exp_m1();
        let fresh = self.trapping.ending();
        // Fresh ones come evenly over the step.
        let of_fresh = 1.0 - released / spent;
        let now = self.trapped * released + fresh * of_fresh;
        self.trapped += fresh - now;
        now
    }

    /// The chance of the bin that has ended to count.
    fn chance(&self, counting: &Counting) -> Dual<K> {
        let fired = match &self.parity {
            None => self.fired,
            Some(parity) => (Dual::constant(1.0) - parity.ready - parity.blind) * 0.5,
        };
        if self.response.crosstalk == 0.0 {
            return counting.chance(fired, Dual::ZERO);
        }
        let crosstalk = self.by_crosstalk * positive(self.fired).recip();
        let alone = fired * (Dual::constant(1.0) - crosstalk);
        let children = crosstalk * (Dual::constant(1.0) - crosstalk).recip();
        counting.chance(alone, children)
    }
}

/// The same, above zero, to divide by.
#[inline]
fn positive<const K: usize>(mut number: Dual<K>) -> Dual<K> {
    number.value = number.value.max(1e-300);
    number
}

impl<const K: usize> Parity<K> {
    /// A step with so much light on a SPAD that was ready with chance `was_ready`.
    fn step(&mut self, paralysable: bool, light: Dual<K>, was_ready: Dual<K>) {
        let missed = light.exprel_neg();
        let mut recovering = self.blinding.ending();
        if paralysable {
            // Those of them that no photon has blinded anew: as many as there are SPADs that are ready.
            recovering = recovering * was_ready;
        }
        let fired =
            self.ready * light * missed + recovering * (Dual::constant(1.0) - missed);
        let (ready, blind) = (self.ready, self.blind);
        self.ready += recovering - fired;
        self.blind = blind - recovering - fired;
        match paralysable {
            false => self.blinding.push(Dual::ZERO - fired),
            true => {
                let blind = (blind + self.blind) * 0.5;
                let ready = (ready + self.ready) * 0.5;
                self.blinding.push(light * (blind - ready));
            }
        }
    }
}

/// What happened step by step, and what of it ends a dead time later.
#[derive(Clone)]
struct History<const K: usize> {
    /// Dead time in whole steps, and the rest of it.
    whole: usize,
    part: f64,
    before: Dual<K>,
    steps: Vec<Dual<K>>,
}

impl<const K: usize> History<K> {
    /// `before` in every step until now.
    fn new(delay: f64, before: Dual<K>) -> Self {
        History {
            whole: delay as usize,
            part: delay.fract(),
            before,
            steps: Vec::new(),
        }
    }

    /// The same, as far as it still matters.
    fn recent(&self) -> Self {
        let kept = self.steps.len().saturating_sub(self.whole + 1);
        History {
            steps: self.steps[kept..].to_vec(),
            ..*self
        }
    }

    #[inline]
    fn push(&mut self, happened: Dual<K>) {
        self.steps.push(happened);
    }

    /// What ends during the step that comes next.
    #[inline]
    fn ending(&self) -> Dual<K> {
        let now = self.steps.len();
        let at = |ago: usize| match now.checked_sub(ago) {
            Some(step) => self.steps.get(step).copied().unwrap_or(self.before),
            None => self.before,
        };
        at(self.whole) * (1.0 - self.part) + at(self.whole + 1) * self.part
    }
}
