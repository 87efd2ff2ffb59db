//! The photon stream: every avalanche of a macropixel in an exposure, drawn in any order.
//!
//! An exposure is a row of laser cycles. Cycle n spans the half-open time from `clock.periods(n · stop_periods)` to the
//! start of cycle n + 1; the laser fires at its start, with the rising edge of STOP. In each cycle a macropixel detects
//!
//! * a Poisson number of signal photons, spread around the arrival of the echo by the laser pulse and all jitter,
//! * a Poisson number of background photons and dark counts, uniform over the cycle,
//!
//! each on one of the macropixel's SPADs with equal chance. No echo is cut: what overruns its laser cycle, at either end, falls into
//! its neighbours ([`EchoLaw`](super::EchoLaw)). Only what comes before the first cycle or
//! after the last one is no photon.
//!
//! ```text
//!                  slot 0   slot 1   slot 2   …            a slot is a CLK period, or a 2ᵏ-th of a long one
//!   cycle 0      ┌────────┬────────┬────────┬──
//!   cycle 1      │ one    │        │        │             a group is 2048 laser cycles; the first are shorter, so
//!     …          │ draw   │        │        │             that a short exposure draws no long group: 128, 128, 256 …
//!   cycle 127    ├────────┼────────┼────────┼──
//!   cycle 128    │        │        │        │             background: one key per (macropixel, slot, group)
//!     …          │        │        │        │             signal:     one key per (macropixel, group)
//! ```
//!
//! The background photons of a cycle may begin a little before it ([`StreamConfig::lead`]), and then end as much before the
//! next one; none comes before the exposure.
//!
//! Macropixels in bright light are drawn by laser cycle instead ([`bright`]). Photons that breed ([`SpadModel`]) are a
//! stream of their own: parts of a Poisson process chosen by chance are independent.
//!
//! The photons under one key are a pure function of (seed, macropixel, slot, group): their Poisson number is drawn
//! first, then each takes 32 random bits for its cycle, SPAD and time (a signal photon 64, and 128 more for a measured
//! pulse). So any part can be drawn on any thread in any order, and all see the same light. Only dead time,
//! afterpulses and crosstalk tie slots and cycles together; they are applied afterwards ([`Avalanches`]).
//!
//! Timing jitter of a SPAD displaces the points of a Poisson process, which leaves it one: jitter of background changes
//! nothing, and that of the signal is part of the pulse.
//!
//! Light that is a list ([`PixelLight`]) is drawn layer by layer: each is such a stream with a key of its own, in some laser
//! cycles. A profile, or SPADs that differ, are drawn at their greatest rate and thinned by a random word that is a pure
//! function of the photon's own ([`Limits`]); whatever SPADs there are, that leaves a Poisson process.
//!
//! Limits of the model: no spread of dead time between SPADs; background photons come at multiples of some 20 fs
//! ([`Slots`]).

use std::ops::Range;
use std::sync::Arc;

use smallvec::SmallVec;

use super::avalanches::Avalanches;
use super::light::{Layer, PixelLight};
use super::pulse::{PulseSampler, PulseShape};
use super::quantile::{NORMAL_BITS, NormalSampler};
use super::random::{Purpose, layer_key, philox_key};
use super::spad::{Photon, SpadEvent, SpadModel};
use crate::units::{Every, Frequency, Time};
pub use bright::{Background, TILE, spad_of};
pub use draw::{Draw, PER_BLOCK, Place, Run};
use group::FIRST;
pub use group::{GROUP, Group, PLACE_BITS};
use kind::Kind;
use limits::Limits;
use numbers::{Counts, Numbers};
pub use ordered::{NEVER_FS, OrderedEchoes};
pub use slot::{Slots, TIME_BITS};

mod bright;
mod draw;
mod group;
mod kind;
mod limits;
mod numbers;
mod ordered;
mod pulses;
mod slot;

/// Adding it to numbers up to ±2⁵¹ leaves no fraction, and the number in the low bits.
const ROUNDER: f64 = 6_755_399_441_055_744.0;

/// Farther away than any photon comes in its cycle, fs.
const FAR_FS: i64 = 1 << 60;

const _: () = assert!(PLACE_BITS + NORMAL_BITS <= u64::BITS);

/// Background photons that breed are rare if a slot of the shortest group has fewer of them on average: numbers that are
/// mostly 0 take longer to draw than the photons. Chosen; 8 Mcounts/s with 1 % of afterpulses and of crosstalk have 0.05.
const RARE: f64 = 1.0;

/// Second counter word of the number of signal photons; slots are below it.
const SIGNAL_RUN: u32 = u32::MAX;

/// A part of every laser cycle.
#[derive(Debug, Clone, PartialEq, Eq, Default)]
pub struct Span {
    /// Whose background photons belong to it.
    pub slots: Range<u32>,
    /// When photons of the cycle's own echo belong to it, fs after the start of the cycle; that may be outside the cycle.
    pub within_fs: Range<i64>,
}

/// What all macropixels of an exposure share.
#[derive(Debug, Clone, PartialEq)]
pub struct StreamConfig {
    /// Equal seeds give equal photons.
    pub seed: u64,
    /// The chip's CLK.
    pub clock: Frequency,
    /// CLK periods from one STOP edge to the next, at least 1.
    pub stop_periods: u32,
    /// Laser cycles of the exposure.
    pub laser_cycles: u32,
    /// How much before their laser cycle the photons of a cycle begin, at least 0 and less than a CLK period. Where it
    /// puts slots on a chip's bins, those are counted fastest.
    pub lead: Time,
    /// Standard deviation of a signal photon's time: a Gaussian laser pulse and all jitter.
    pub pulse_sigma: Time,
    /// A measured laser pulse, whose times add to those of the Gaussian; its time 0 comes at the echo's arrival.
    pub pulse_shape: Option<PulseShape>,
    /// How the SPADs answer.
    pub spads: SpadModel,
}

impl StreamConfig {
    /// Start of laser cycle `cycle`, exact to the femtosecond.
    #[inline]
    pub fn cycle_start(&self, cycle: u32) -> Time {
        self.clock
            .periods(i64::from(cycle) * i64::from(self.stop_periods))
    }

    /// Rising edges of a macropixel's SPADs to be expected in the exposure, at most: as many as photons, and as dead times.
    pub fn most_edges(&self, light: &PixelLight) -> f64 {
        let causes = 1.0 + self.spads.afterpulse_probability + self.spads.crosstalk_probability;
        let photons = self.most_photons_per_cycle(light) * causes;
        let dead_times =
            self.spads.grid.spads() as f64 * (self.cycle_s() / self.spads.dead_time.as_s() + 1.0);
        photons.min(dead_times) * f64::from(self.laser_cycles)
    }

    /// Mean number of photons and dark counts that are drawn for a laser cycle, at most: of the brightest segment, and before
    /// any are thinned.
    pub fn most_photons_per_cycle(&self, light: &PixelLight) -> f64 {
        light.signal_per_cycle() + light.background_hz() * self.cycle_s()
    }

    /// Nominal length of a cycle, s.
    pub fn cycle_s(&self) -> f64 {
        f64::from(self.stop_periods) / self.clock.as_hz()
    }
}

/// The avalanches of one macropixel in one exposure.
#[derive(Debug, Clone, PartialEq, Eq, Default)]
pub struct PixelPhotons {
    /// Rising edges of the SPAD wires, sorted by (time, SPAD).
    pub events: Vec<SpadEvent>,
    /// Photons and dark counts that fell into the exposure, seen or not.
    pub drawn: u64,
    /// Avalanches, afterpulses and crosstalk among them, that met a blind SPAD.
    pub lost_to_dead_time: u64,
}

/// The photons of a whole array in an exposure.
#[derive(Debug, Clone)]
pub struct PhotonStream {
    config: StreamConfig,
    key: [u32; 2],
    starts: Every,
    cycle_fs: i64,
    slots: Slots,
    gaussian: NormalSampler,
    shape: Option<Arc<PulseSampler>>,
}

/// The parts of a macropixel's light: one that does not breed comes first. Light of one echo has no more than that, and one
/// that breeds.
pub type LightParts<'a> = SmallVec<[PixelStream<'a>; 2]>;

impl PhotonStream {
    /// Prepares the stream.
    pub fn new(config: &StreamConfig) -> Self {
        debug_assert!(config.stop_periods > 0, "a cycle needs a length");
        PhotonStream {
            key: philox_key(config.seed),
            starts: config.clock.every(config.stop_periods),
            cycle_fs: config.clock.whole_fs(i64::from(config.stop_periods)),
            slots: Slots::new(config.clock, config.stop_periods, config.lead),
            gaussian: NormalSampler::new(config.pulse_sigma.as_fs() as f64),
            shape: config.pulse_shape.as_ref().map(sampler),
            config: config.clone(),
        }
    }

    /// What it was made of.
    pub fn config(&self) -> &StreamConfig {
        &self.config
    }

    /// SPADs of a macropixel.
    #[inline]
    pub fn spads(&self) -> usize {
        self.config.spads.grid.spads()
    }

    /// [`StreamConfig::cycle_start`].
    #[inline]
    pub fn cycle_start(&self, cycle: u32) -> Time {
        self.starts.at(cycle)
    }

    /// The whole femtoseconds of a laser cycle.
    pub fn cycle_fs(&self) -> i64 {
        self.cycle_fs
    }

    /// Slots of a laser cycle.
    pub fn slots(&self) -> Slots {
        self.slots
    }

    /// When the photons of a cycle begin and end, fs after its start.
    pub fn ends_fs(&self) -> Range<i64> {
        -self.slots.lead_fs()..self.cycle_fs - self.slots.lead_fs()
    }

    /// What these slots are. Of the cycle's own echo, all that comes before the cycle begins with the first slot, and all
    /// that comes after it ends with the last one.
    pub fn span(&self, slots: Range<u32>) -> Span {
        let from_fs = match slots.start {
            0 => -FAR_FS,
            first => self.slots.start_fs(first),
        };
        let until_fs = match slots.end == self.slots.count() {
            true => FAR_FS,
            false => self.slots.start_fs(slots.end),
        };
        Span {
            within_fs: from_fs..until_fs,
            slots,
        }
    }

    /// Groups of the exposure; the last one may outlast it.
    pub fn groups(&self) -> impl Iterator<Item = Group> + use<> {
        Group::until(self.config.laser_cycles, self.config.spads.grid)
    }

    /// The photons of macropixel number `pixel` under `light`, by parts that are drawn independently.
    pub fn parts(&self, pixel: u32, light: &PixelLight) -> LightParts<'_> {
        debug_assert!(
            light
                .spads()
                .is_none_or(|spads| spads.spads() == self.spads()),
            "engines refuse light for other SPADs"
        );
        let breeding = self.config.spads.breeding_probability();
        let is_bright = bright::is_bright(light, &self.config);
        let mut parts = LightParts::new();
        for (number, layer) in (0..).zip(light.layers()) {
            let key = layer_key(self.key, number);
            // The first layer is there even if it is dark: it is what SPADs are asked of.
            if number > 0 && layer.background_hz == 0.0 && layer.signal_per_cycle == 0.0 {
                continue;
            }
            for (kind, share) in [(Kind::Plain, 1.0 - breeding), (Kind::Breeding, breeding)] {
                if kind == Kind::Plain || share > 0.0 {
                    let mut part = self.part(pixel, &layer, kind, share);
                    (part.key, part.is_bright, part.is_alone) = (key, is_bright, light.is_plain());
                    parts.push(part);
                }
            }
        }
        parts
    }

    fn part(&self, pixel: u32, layer: &Layer<'_>, kind: Kind, share: f64) -> PixelStream<'_> {
        let echo = layer.echo;
        let gaussian = match echo.and_then(|echo| echo.sigma) {
            Some(sigma) => {
                debug_assert!(sigma >= Time::ZERO, "a standard deviation");
                NormalSampler::new(sigma.as_fs() as f64)
            }
            None => self.gaussian,
        };
        let shape = match echo.and_then(|echo| echo.shape.as_ref()) {
            Some(shape) => Some(sampler(shape)),
            None => self.shape.clone(),
        };
        let reach_fs = gaussian.reach();
        let (mut first_fs, mut last_fs) = (-reach_fs, reach_fs);
        if let Some(shape) = &shape {
            first_fs += shape.range_fs().0;
            last_fs += shape.range_fs().1;
        }
        // What is so far away is in no cycle, and may be displaced without overflow.
        let arrival_fs = echo.map_or(0, |echo| echo.arrival.as_fs());
        let arrival_fs = arrival_fs.clamp(-FAR_FS / 2, FAR_FS / 2);
        let background_hz = layer.background_hz * share;
        let mut part = PixelStream {
            stream: self,
            key: self.key,
            pixel,
            kind,
            is_bright: false,
            is_alone: true,
            limits: Limits::of(layer, self),
            gaussian,
            shape,
            arrival_fs,
            echo_fs: (
                arrival_fs + first_fs.floor() as i64,
                arrival_fs + last_fs.ceil() as i64,
            ),
            background: Numbers::new(background_hz * self.slots.length_s()),
            signal: Numbers::new(layer.signal_per_cycle * share),
            gap_fs: 1e15 / background_hz,
            signal_per_spad: layer.signal_per_cycle * share / self.spads() as f64,
            has_long_groups: kind == Kind::Breeding
                && background_hz * self.slots.length_s() * f64::from(FIRST) < RARE,
            late_fs: 0,
        };
        part.late_fs = part.late_fs();
        part
    }
}

fn sampler(shape: &PulseShape) -> Arc<PulseSampler> {
    Arc::new(PulseSampler::measured(shape))
}

/// The photons of one part of a macropixel's light, before dead time: those of a layer that breed, or the others.
#[derive(Debug, Clone)]
pub struct PixelStream<'a> {
    stream: &'a PhotonStream,
    /// Of the layer.
    key: [u32; 2],
    pixel: u32,
    kind: Kind,
    /// All parts of a macropixel's light are, or none is.
    is_bright: bool,
    /// Whether the light has one layer, all photons of which are kept.
    is_alone: bool,
    /// Which photons are kept, if not all.
    limits: Option<Limits>,
    gaussian: NormalSampler,
    shape: Option<Arc<PulseSampler>>,
    arrival_fs: i64,
    /// Earliest and latest time of a signal photon in its cycle.
    echo_fs: (i64, i64),
    /// Photons in a slot.
    background: Numbers,
    /// Photons in all slots.
    signal: Numbers,
    /// Mean time between background photons; infinite in the dark.
    gap_fs: f64,
    /// Mean number of signal photons of a SPAD in a laser cycle.
    signal_per_spad: f64,
    /// Whether all groups are of the longest kind.
    has_long_groups: bool,
    /// From when on an echo has hardly any photons left.
    late_fs: i64,
}

impl PixelStream<'_> {
    /// The SPADs of this macropixel, where its photons are known from `time` on, or from the beginning. `breeding` are the
    /// photons before `time` that breed, since [`SpadModel::reach`] at least.
    pub fn avalanches(
        &self,
        time: Option<Time>,
        breeding: impl Iterator<Item = Photon>,
    ) -> Avalanches<'_> {
        let (model, key) = (&self.stream.config.spads, self.stream.key);
        match time {
            Some(time) => Avalanches::known_from(model, key, self.pixel, time, breeding),
            None => Avalanches::in_the_dark(model, key, self.pixel),
        }
    }

    /// The group of a laser cycle.
    pub fn group_of(&self, cycle: u32) -> Group {
        let grid = self.stream.config.spads.grid;
        match self.has_long_groups {
            true => Group::long(cycle, grid),
            false => Group::of_cycle(cycle, grid),
        }
    }

    /// Start of a laser cycle.
    pub fn cycle_start(&self, cycle: u32) -> Time {
        self.stream.cycle_start(cycle)
    }

    /// Whether the light has no other layer, and all that is drawn is kept: only then random words tell all of it.
    pub fn is_alone(&self) -> bool {
        self.is_alone
    }

    /// Whether these are the photons that breed.
    pub fn breeds(&self) -> bool {
        self.kind == Kind::Breeding
    }

    /// The avalanches that a photon which breeds causes, if it makes one itself.
    pub fn children(&self, photon: Photon) -> impl Iterator<Item = SpadEvent> {
        let parent = SpadEvent {
            time: photon.time,
            spad: photon.spad,
        };
        let spads = &self.stream.config.spads;
        spads.children(self.stream.key, self.pixel, parent)
    }

    /// Earliest time of a photon of the echo and later than the last one, fs after the start of its cycle; both 0 where there
    /// is none.
    pub fn echo_fs(&self) -> Range<i64> {
        match self.signal_per_spad > 0.0 {
            true => self.echo_fs.0..self.echo_fs.1 + 1,
            false => 0..0,
        }
    }

    /// Laser cycles, relative to one of them, whose echoes may have photons `within_fs` after its start.
    pub fn echoes_within(&self, within_fs: &Range<i64>) -> Range<i64> {
        let (echo_fs, cycle_fs) = (self.echo_fs(), self.stream.cycle_fs);
        if echo_fs.is_empty() || within_fs.is_empty() {
            return 0..0;
        }
        // Starts of cycles are rounded: a cycle n later starts up to n + 1 fs later than n whole cycles.
        let room_fs = 2 + within_fs.start.abs().max(within_fs.end.abs()) / cycle_fs;
        let first = (within_fs.start - echo_fs.end - room_fs).div_euclid(cycle_fs) + 1;
        let last = (within_fs.end - echo_fs.start + room_fs - 1).div_euclid(cycle_fs);
        first..last + 1
    }

    /// Whether no photon of an echo leaves the time of its own cycle's background photons.
    pub fn stays_in_its_cycle(&self) -> bool {
        let (echo_fs, ends_fs) = (self.echo_fs(), self.stream.ends_fs());
        echo_fs.is_empty() || (echo_fs.start >= ends_fs.start.max(0) && echo_fs.end <= ends_fs.end)
    }

    /// No photon comes earlier than that after the start of its cycle.
    fn earliest(&self) -> Time {
        let background_fs = self.stream.ends_fs().start;
        Time::from_fs(self.echo_fs().start.min(background_fs))
    }

    /// Draws all photons of `group` in a part of its cycles.
    pub fn draw(&self, group: Group, span: &Span, draw: &mut Draw) {
        let key = self.key;
        let numbered = |purpose: Purpose| purpose as u32 | group.number() << 8;
        debug_assert!(!self.is_bright, "bright light is drawn by laser cycle");
        draw.begin(group);
        if self
            .limits
            .as_ref()
            .is_some_and(|limits| limits.is_outside(group))
        {
            return;
        }

        draw.within_fs = span.within_fs.clone();
        let (background, parts) = self.background.of(group);
        let (signal, signal_parts) = self.signal.of(group);
        let has_echo = !signal.is_zero()
            && !draw.within_fs.is_empty()
            && self.echo_fs.0 < draw.within_fs.end
            && self.echo_fs.1 >= draw.within_fs.start;
        if has_echo {
            let words = signal.words() * signal_parts;
            draw.counts.push_run(SIGNAL_RUN, words.div_ceil(2));
        }
        let words = background.words() * parts;
        if !background.is_zero() {
            for slot in span.slots.clone() {
                draw.counts.push_run(slot, words.div_ceil(2));
            }
        }
        let mut numbers = std::mem::take(&mut draw.counts);
        numbers.generate(key, self.pixel, numbered(self.kind.counts()));

        let mut counts = Counts::new(&numbers);
        if has_echo {
            let photons = counts.next(signal, signal_parts);
            draw.push_echo(photons, self.shape.is_some());
            draw.echo
                .generate(key, self.pixel, numbered(self.kind.echo()));
        }
        if !background.is_zero() {
            for slot in span.slots.clone() {
                let photons = counts.next(background, parts);
                draw.push_run(slot, photons);
            }
            draw.background
                .generate(key, self.pixel, numbered(self.kind.background()));
        }
        draw.counts = numbers;
        if self
            .limits
            .as_ref()
            .is_some_and(|limits| !limits.keep_all_of(group, self.stream))
        {
            draw.thin(self);
        }
    }

    /// The slots of the stream.
    pub fn slots(&self) -> Slots {
        self.stream.slots
    }

    /// Place of an echo's photon of this number in `draw` ([`Draw::half_an_echo`]), and its time after the start of its
    /// cycle, fs.
    #[inline]
    pub fn signal_photon(&self, draw: &Draw, number: usize) -> (Place, i64) {
        let word = draw.echo_word(number);
        let mut after_fs = self.gaussian.draw(word);
        if let Some(shape) = &self.shape {
            after_fs += shape.draw(draw.echo_words(number));
        }
        let place = draw.group.place((word >> 32) as u32);
        (place, self.arrival_fs + nearest(after_fs))
    }

    /// The first rank ([`signal_rank`]) of signal photons that may come within `tolerance_fs` of `time_fs` or later, and
    /// the first of those that come later for certain; `None` if the pulse is no Gaussian.
    pub fn signal_ranks_at(&self, time_fs: f64, tolerance_fs: f64) -> Option<[i16; 2]> {
        let after_fs = time_fs - self.arrival_fs as f64;
        // Times are rounded.
        let tolerance_fs = tolerance_fs + 1.0;
        let gaussian = &self.gaussian;
        (self.shape.is_none()).then(|| gaussian.ranks_at(after_fs, tolerance_fs))
    }
}

/// Bits of a signal photon's words that rise with its time, if the pulse is a Gaussian.
#[inline]
pub fn signal_rank(low: u32, high: u32) -> i16 {
    NormalSampler::rank(low, high)
}

/// The nearest whole number, without a call; `value` is within ±2⁵¹.
#[inline]
fn nearest(value: f64) -> i64 {
    ((value + ROUNDER).to_bits() as i64) - ROUNDER.to_bits() as i64
}

#[cfg(test)]
mod tests;
