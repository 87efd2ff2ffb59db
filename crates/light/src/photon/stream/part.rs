//! One part of a macropixel's light before dead time: the photons of a layer whose avalanches trigger others, or the
//! rest.
//!
//! What a part's photons are follows from its key, its macropixel and what [`PixelStream`] knows of light and slots; nothing is
//! remembered between draws. `dim` draws groups of laser cycles, `bright`, `ordered` and `listed` draw laser cycle by laser cycle.

use std::ops::Range;
use std::sync::Arc;

use smallvec::SmallVec;

use super::exposure::{FAR_FS, PhotonStream, Span, sampler};
use super::foreign::Foreign;
use super::group::{CycleGroup, FIRST, PLACE_BITS};
use super::limits::Limits;
use super::numbers::Numbers;
use super::slot::Slots;
use crate::photon::light::{Layer, PixelLight};
use crate::photon::pulse::PulseSampler;
use crate::photon::quantile::{NORMAL_BITS, NormalSampler};
use crate::photon::random::{RandomPurpose, layer_key};
use crate::photon::spad::{FEW_SPADS, Photon, SpadEvent};
use crate::units::Time;

/// Adding it to numbers up to ±2⁵¹ leaves no fraction, and the number in the low bits.
const ROUNDER: f64 = 6_755_399_441_055_744.0;

const _: () = assert!(PLACE_BITS + NORMAL_BITS <= u64::BITS);

/// Background photons that trigger others are rare if a slot of the shortest group has fewer of them on average: numbers that are
/// mostly 0 take longer to draw than the photons. Chosen; 8 Mcounts/s with 1 % of afterpulses and of crosstalk have 0.05.
const RARE: f64 = 1.0;

/// So few photons left in an echo, on average, are mostly none.
pub(super) const LATE: f64 = 0.01;

/// The photons of one part of a macropixel's light before dead time: those of a layer whose avalanches trigger
/// others, or the rest.
#[derive(Debug, Clone)]
pub struct PixelStream<'a> {
    pub(in crate::photon) stream: &'a PhotonStream,
    /// Of the layer.
    pub(super) key: [u32; 2],
    pub(in crate::photon) pixel: u32,
    /// Of its SPADs, where they differ.
    pub(in crate::photon) dead_times: SmallVec<[Time; FEW_SPADS]>,
    pub(super) kind: PhotonKind,
    /// All parts of a macropixel's light are, or none is.
    pub is_bright: bool,
    /// Whether the light has one layer, all photons of which are kept.
    pub is_alone: bool,
    /// Which photons are kept, if not all.
    pub(super) limits: Option<Limits>,
    pub(super) gaussian: NormalSampler,
    pub(super) shape: Option<Arc<PulseSampler>>,
    /// Pulses of another laser, which are its signal.
    pub(super) foreign: Option<Foreign>,
    pub(super) arrival_fs: i64,
    /// Earliest and latest time of a signal photon in its cycle.
    pub(in crate::photon) echo_fs: (i64, i64),
    /// Photons in a slot.
    pub(super) background: Numbers,
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

/// Whether two ranges have something in common.
fn overlap(a: &Range<u32>, b: &Range<u32>) -> bool {
    a.start.max(b.start) < a.end.min(b.end)
}

/// The parts of a macropixel's light. The first has the photons that trigger no others. Light of one echo has that
/// part and one with those that do.
pub type LightParts<'a> = SmallVec<[PixelStream<'a>; 2]>;

impl PhotonStream {
    /// The photons of macropixel number `pixel` under `light`, by parts that are drawn independently.
    pub fn parts(&self, pixel: u32, light: &PixelLight) -> LightParts<'_> {
        debug_assert!(
            light
                .spads()
                .is_none_or(|spads| spads.spads() == self.spads()),
            "engines refuse light for other SPADs"
        );
        let triggering = self.config.spads.triggering_probability();
        let is_bright = self.config.is_bright(light);
        let mut parts = LightParts::new();
        for (number, layer) in (0..).zip(light.layers()) {
            let key = layer_key(self.key, number);
            // The first layer is there even if it is dark: it is what SPADs are asked of.
            if number > 0 && layer.background_hz == 0.0 && layer.signal_per_cycle == 0.0 {
                continue;
            }
            for (kind, share) in [
                (PhotonKind::Plain, 1.0 - triggering),
                (PhotonKind::Triggering, triggering),
            ] {
                if kind == PhotonKind::Plain || share > 0.0 {
                    let mut part = self.part(pixel, &layer, kind, share);
                    (part.key, part.is_bright) = (key, is_bright);
                    part.is_alone = light.is_plain() && self.config.energy_spread == 0.0;
                    parts.push(part);
                }
            }
        }
        parts
    }

    /// One part of a layer of light: the photons of `kind`, which are `share` of all. Of a light's only layer, in dim light;
    /// [`PhotonStream::parts`] says what else it is.
    fn part(&self, pixel: u32, layer: &Layer<'_>, kind: PhotonKind, share: f64) -> PixelStream<'_> {
        let echo = layer.echo;
        let sigma = match layer.train {
            Some(train) => Some(train.sigma),
            None => echo.and_then(|echo| echo.sigma),
        };
        let gaussian = match sigma {
            Some(sigma) => {
                debug_assert!(sigma >= Time::ZERO, "a standard deviation");
                NormalSampler::new(sigma.as_fs() as f64)
            }
            None => self.gaussian,
        };
        let shape = match echo.and_then(|echo| echo.shape.as_ref()) {
            Some(shape) => Some(sampler(shape)),
            None if layer.train.is_some() => None,
            None => self.shape.clone(),
        };
        let reach_fs = gaussian.reach();
        let greatest_energy = match layer.train {
            Some(_) => 1.0,
            None => self.config.greatest_energy(),
        };
        let photons = layer.signal_per_cycle * greatest_energy * share;
        let foreign = layer
            .train
            .map(|train| Foreign::new(train, self, photons, reach_fs));
        let per_spad = match foreign {
            Some(_) => 0.0,
            None => photons / self.spads() as f64,
        };
        let (foreign, drawn) = foreign.unzip();
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
            dead_times: self.config.spads.dead_times(pixel),
            kind,
            is_bright: false,
            is_alone: true,
            limits: Limits::from_layer(layer, self),
            gaussian,
            shape,
            foreign,
            arrival_fs,
            echo_fs: (
                arrival_fs + first_fs.floor() as i64,
                arrival_fs + last_fs.ceil() as i64,
            ),
            background: Numbers::new(background_hz * self.slots.length_s),
            signal: Numbers::new(drawn.unwrap_or(photons)),
            gap_fs: 1e15 / background_hz,
            signal_per_spad: per_spad,
            has_long_groups: kind == PhotonKind::Triggering
                && background_hz * self.slots.length_s * f64::from(FIRST) < RARE,
            late_fs: 0,
        };
        if part.foreign.is_some() {
            let ends_fs = self.ends_fs();
            part.echo_fs = (ends_fs.start, ends_fs.end);
        }
        part.late_fs = part.late_fs();
        part
    }
}

impl PixelStream<'_> {
    /// The group of a laser cycle.
    pub fn group_of(&self, cycle: u32) -> CycleGroup {
        let grid = self.stream.config.spads.grid;
        if self.has_long_groups {
            CycleGroup::long(cycle, grid)
        } else {
            CycleGroup::of_cycle(cycle, grid)
        }
    }

    /// Photons that are drawn of a span of a laser cycle on average, those of an echo whole.
    pub fn expected(&self, span: &Span) -> f64 {
        let sees_echo = !span.within_fs.is_empty();
        let echo = if sees_echo { self.signal.mean() } else { 0.0 };
        echo + self.background.mean() * span.slots.len() as f64
    }

    /// Whether these are the photons whose avalanches trigger others.
    pub fn has_secondaries(&self) -> bool {
        self.kind == PhotonKind::Triggering
    }

    /// The avalanches that a photon of the triggering kind causes, if it makes one itself.
    pub fn children(&self, photon: Photon) -> impl Iterator<Item = SpadEvent> {
        let parent = SpadEvent::new(photon.time, photon.spad);
        let spads = &self.stream.config.spads;
        let dead_time = spads.dead_time_among(&self.dead_times, photon.spad);
        spads.children(self.stream.key, self.pixel, dead_time, parent)
    }

    /// Earliest time of a photon of the echo and later than the last one, fs after the start of its cycle; both 0 where there
    /// is none. Other lasers' photons are background, and in bright light a list for each laser cycle.
    pub fn echo_fs(&self) -> Range<i64> {
        if self.foreign.is_some() && self.is_bright {
            return self.stream.ends_fs();
        }
        if self.signal_per_spad > 0.0 {
            self.echo_fs.0..self.echo_fs.1 + 1
        } else {
            0..0
        }
    }

    /// Laser cycles, relative to one of them, whose echoes may have photons `within_fs` after its start.
    pub fn echoes_within(&self, within_fs: &Range<i64>) -> Range<i64> {
        let (echo_fs, cycle_fs) = (self.echo_fs(), self.stream.cycle_fs());
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
    pub(in crate::photon) fn earliest(&self) -> Time {
        let background_fs = self.stream.ends_fs().start;
        Time::from_fs(self.echo_fs().start.min(background_fs))
    }

    /// From when on a SPAD's part of an echo has no more than [`LATE`] photons left, fs after the start of its cycle.
    fn late_fs(&self) -> i64 {
        if self.signal_per_spad > LATE {
            let after_fs = self.gaussian.quantile(1.0 - LATE / self.signal_per_spad);
            self.arrival_fs + after_fs.ceil() as i64
        } else {
            i64::MIN
        }
    }

    /// The slots of the stream.
    pub fn slots(&self) -> Slots {
        self.stream.slots
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

// Photons whose avalanches trigger others (afterpulses, crosstalk), and the rest: separate streams with their own
// random numbers.

/// Which photons of a macropixel.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum PhotonKind {
    /// Those whose avalanches cause no others.
    Plain,
    /// Those whose avalanches do.
    Triggering,
}

impl PhotonKind {
    pub(super) fn counts(self) -> RandomPurpose {
        match self {
            PhotonKind::Plain => RandomPurpose::PhotonCounts,
            PhotonKind::Triggering => RandomPurpose::TriggeringCounts,
        }
    }

    pub(super) fn background(self) -> RandomPurpose {
        match self {
            PhotonKind::Plain => RandomPurpose::Photons,
            PhotonKind::Triggering => RandomPurpose::TriggeringPhotons,
        }
    }

    pub(super) fn echo(self) -> RandomPurpose {
        match self {
            PhotonKind::Plain => RandomPurpose::Signal,
            PhotonKind::Triggering => RandomPurpose::TriggeringSignal,
        }
    }

    pub(super) fn bright_background(self) -> u32 {
        match self {
            PhotonKind::Plain => RandomPurpose::BrightPhotons as u32,
            PhotonKind::Triggering => RandomPurpose::BrightTriggeringPhotons as u32,
        }
    }

    pub(super) fn bright_echo(self) -> u32 {
        match self {
            PhotonKind::Plain => RandomPurpose::BrightSignal as u32,
            PhotonKind::Triggering => RandomPurpose::BrightTriggeringSignal as u32,
        }
    }
}

// Which photons of a part are kept: those within its [`Limits`](super::limits::Limits), by random words of their own.
//
// ```text
//   drawn     ↓ ↓  ↓   ↓ ↓  ↓ ↓ ↓    ↓  ↓↓     at the greatest rate
//   profile   ▇▇▇▇▇▅▅▅▅▅▃▃▃▃▃▁▁▁▁▁             a photon is kept with the rate at its time, relative to the greatest
//   kept      ↓ ↓  ↓     ↓    ↓                by a random word of its own
// ```

impl PixelStream<'_> {
    /// Whether the slots of a laser cycle may have photons that are kept.
    pub(super) fn draws_background_in(&self, cycle: u32) -> bool {
        let limits = self.limits.as_ref();
        limits.is_none_or(|limits| limits.drawn().contains(&cycle))
    }

    /// Whether photons may come within a time after the start of a laser cycle, whichever it is.
    pub fn is_lit_within(&self, within_fs: &Range<i64>) -> bool {
        let has_background = self.gap_fs.is_finite() && self.greatest_share(within_fs) > 0.0;
        has_background || !self.echoes_within(within_fs).is_empty()
    }

    /// Whether some of these laser cycles may have background photons that are kept.
    pub fn has_background_in(&self, cycles: &Range<u32>) -> bool {
        let limits = self.limits.as_ref();
        self.gap_fs.is_finite() && limits.is_none_or(|limits| overlap(&limits.drawn(), cycles))
    }

    /// Whether photons of the echoes of some of these laser cycles may be kept.
    pub(super) fn has_echo_in(&self, cycles: &Range<u32>) -> bool {
        let limits = self.limits.as_ref();
        limits.is_none_or(|limits| overlap(&limits.cycles, cycles))
    }

    /// Whether photons of the echo of a laser cycle may be kept.
    pub(super) fn sends_echo_in(&self, cycle: u32) -> bool {
        let limits = self.limits.as_ref();
        limits.is_none_or(|limits| limits.cycles.contains(&cycle))
    }

    /// The greatest rate of background within a time after the start of a laser cycle, as a share of the layer's.
    pub(super) fn greatest_share(&self, within_fs: &Range<i64>) -> f64 {
        let limits = self.limits.as_ref();
        limits.map_or(1.0, |limits| {
            limits.greatest_share(within_fs, self.stream.cycle_fs())
        })
    }

    /// Whether a background photon is kept that comes `time_fs` after the start of its laser cycle and was drawn at `share` of the layer's rate. `words` are random ones
    /// that no other photon has, unless it comes at the same time on the same SPAD.
    #[inline(never)]
    pub(super) fn keeps_background(
        &self,
        cycle: u32,
        spad: u8,
        time_fs: i64,
        share: f64,
        words: [u32; 2],
    ) -> bool {
        let Some(limits) = &self.limits else {
            return true;
        };
        let time = self.stream.cycle_start(cycle) + Time::from_fs(time_fs);
        if !limits.lit.contains(&time) {
            return false;
        }
        let mut chance = limits.chance(spad);
        if let Some(profile) = &limits.profile {
            let since_fs = match cycle.checked_sub(1) {
                Some(before) if time_fs < 0 => (time - self.stream.cycle_start(before)).as_fs(),
                _ => time_fs,
            };
            chance *= profile.rate_hz(since_fs) / (share * profile.greatest_hz);
        }
        self.is_kept(chance, words)
    }

    /// Whether a photon of a laser cycle's echo is kept, with random words that no other photon has.
    #[inline]
    pub(super) fn keeps_signal(&self, cycle: u32, spad: u8, words: [u32; 2]) -> bool {
        match &self.limits {
            None => true,
            Some(limits) => {
                limits.cycles.contains(&cycle)
                    && self.is_kept(
                        limits.chance(spad) * limits.energy(cycle, self.stream),
                        words,
                    )
            }
        }
    }

    fn is_kept(&self, chance: f64, [first, second]: [u32; 2]) -> bool {
        if chance >= 1.0 {
            return true;
        }
        let counter = [first, second, self.pixel, RandomPurpose::Thinning as u32];
        let word = rand_philox::philox4x32_10(counter, self.key)[0];
        f64::from(word) < chance * 2f64.powi(32)
    }
}
