//! One part of a macropixel's light before dead time: the photons of a layer whose avalanches trigger others, or the
//! rest.
//!
//! What a part's photons are follows from its key, its macropixel and what [`PixelStream`] knows of light and slots; nothing is
//! remembered between draws. A [`Draw`] takes a group of laser cycles and a span of each: first the Poisson numbers of all
//! slots and of the echo, then as many words as that makes photons. `limits` thins what was drawn at its greatest rate,
//! `ordered` and `bright` draw laser cycle by laser cycle instead.

use std::ops::Range;
use std::sync::Arc;

use super::draw::{Draw, Place};
use super::group::{FIRST, Group, PLACE_BITS};
use super::kind::Kind;
use super::limits::Limits;
use super::numbers::{Counts, Numbers};
use super::slot::Slots;
use super::{FAR_FS, PhotonStream, Span};
use crate::photon::avalanches::Avalanches;
use crate::photon::light::Layer;
use crate::photon::pulse::{PulseSampler, PulseShape};
use crate::photon::quantile::{NORMAL_BITS, NormalSampler};
use crate::photon::random::Purpose;
use crate::photon::spad::{Photon, SpadEvent};
use crate::units::Time;

/// Adding it to numbers up to ±2⁵¹ leaves no fraction, and the number in the low bits.
const ROUNDER: f64 = 6_755_399_441_055_744.0;

const _: () = assert!(PLACE_BITS + NORMAL_BITS <= u64::BITS);

/// Background photons that breed are rare if a slot of the shortest group has fewer of them on average: numbers that are
/// mostly 0 take longer to draw than the photons. Chosen; 8 Mcounts/s with 1 % of afterpulses and of crosstalk have 0.05.
const RARE: f64 = 1.0;

/// Second counter word of the number of signal photons; slots are below it.
const SIGNAL_RUN: u32 = u32::MAX;

/// The photons of one part of a macropixel's light before dead time: those of a layer whose avalanches trigger
/// others, or the rest.
#[derive(Debug, Clone)]
pub struct PixelStream<'a> {
    pub(super) stream: &'a PhotonStream,
    /// Of the layer.
    pub(super) key: [u32; 2],
    pub(super) pixel: u32,
    pub(super) kind: Kind,
    /// All parts of a macropixel's light are, or none is.
    pub(super) is_bright: bool,
    /// Whether the light has one layer, all photons of which are kept.
    pub(super) is_alone: bool,
    /// Which photons are kept, if not all.
    pub(super) limits: Option<Limits>,
    pub(super) gaussian: NormalSampler,
    pub(super) shape: Option<Arc<PulseSampler>>,
    pub(super) arrival_fs: i64,
    /// Earliest and latest time of a signal photon in its cycle.
    pub(super) echo_fs: (i64, i64),
    /// Photons in a slot.
    background: Numbers,
    /// Photons in all slots.
    pub(super) signal: Numbers,
    /// Mean time between background photons; infinite in the dark.
    pub(super) gap_fs: f64,
    /// Mean number of signal photons of a SPAD in a laser cycle.
    pub(super) signal_per_spad: f64,
    /// Whether all groups are of the longest kind.
    has_long_groups: bool,
    /// From when on an echo has hardly any photons left.
    pub(super) late_fs: i64,
}

impl PhotonStream {
    /// One part of a layer of light: the photons of `kind`, which are `share` of all. Of a light's only layer, in dim light;
    /// [`PhotonStream::parts`] says what else it is.
    pub(super) fn part(
        &self,
        pixel: u32,
        layer: &Layer<'_>,
        kind: Kind,
        share: f64,
    ) -> PixelStream<'_> {
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

impl PixelStream<'_> {
    /// The SPADs of this macropixel, where its photons are known from `time` on, or from the beginning. `breeding` are the
    /// photons before `time` that breed, since [`SpadModel::reach`](crate::photon::SpadModel::reach) at least.
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

    /// Whether these are the photons whose avalanches trigger others.
    pub fn breeds(&self) -> bool {
        self.kind == Kind::Breeding
    }

    /// The avalanches that a photon of the triggering kind causes, if it makes one itself.
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
    pub(crate) fn stays_in_its_cycle(&self) -> bool {
        let (echo_fs, ends_fs) = (self.echo_fs(), self.stream.ends_fs());
        echo_fs.is_empty() || (echo_fs.start >= ends_fs.start.max(0) && echo_fs.end <= ends_fs.end)
    }

    /// No photon comes earlier than that after the start of its cycle.
    pub(super) fn earliest(&self) -> Time {
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
        draw.count_exposure(group.cycles_in(self.stream.config().laser_cycles));
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
pub(super) fn nearest(value: f64) -> i64 {
    ((value + ROUNDER).to_bits() as i64) - ROUNDER.to_bits() as i64
}

/// Draws times of a measured pulse.
pub(super) fn sampler(shape: &PulseShape) -> Arc<PulseSampler> {
    Arc::new(PulseSampler::measured(shape))
}
