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
//! Macropixels in bright light are drawn by laser cycle instead ([`bright`]). Photons whose avalanches trigger others
//! ([`SpadModel`]) are a stream of their own: parts of a Poisson process chosen by chance are independent.
//!
//! The photons under one key are a pure function of (seed, macropixel, slot, group): their Poisson number is drawn
//! first, then each takes 32 random bits for its cycle, SPAD and time (a signal photon 64, and 128 more for a measured
//! pulse). So any part can be drawn on any thread in any order, and all see the same light. Only dead time,
//! afterpulses and crosstalk tie slots and cycles together; they are applied afterwards ([`Avalanches`](super::Avalanches)).
//!
//! Timing jitter of a SPAD displaces the points of a Poisson process, which leaves it one: jitter of background changes
//! nothing, and that of the signal is part of the pulse.
//!
//! Light that is a list ([`PixelLight`]) is drawn layer by layer: each is such a stream with a key of its own, in some laser
//! cycles. A profile, or SPADs that differ, are drawn at their greatest rate and thinned by a random word that is a pure
//! function of the photon's own (`limits`); whatever SPADs there are, that leaves a Poisson process.
//!
//! Limits of the model: no spread of dead time between SPADs; background photons come at multiples of some 20 fs
//! ([`Slots`]).

use std::ops::Range;
use std::sync::Arc;

use smallvec::SmallVec;

use super::light::PixelLight;
use super::pulse::{PulseSampler, PulseShape};
use super::quantile::NormalSampler;
use super::random::{layer_key, philox_key};
use super::spad::{SpadEvent, SpadModel};
use crate::units::{Every, Frequency, Time};
pub use bright::{Background, TILE, spad_of};
pub use draw::{Draw, PER_BLOCK, Place, Run};
pub use group::{GROUP, Group, PLACE_BITS};
use kind::Kind;
pub use listed::ListedEchoes;
pub use ordered::{NEVER_FS, OrderedEchoes};
pub use part::{PixelStream, signal_rank};
use part::{nearest, sampler};
pub use slot::{Slots, TIME_BITS};

mod bright;
mod draw;
mod group;
mod kind;
mod limits;
mod listed;
mod numbers;
mod ordered;
mod part;
mod pulses;
mod slot;

/// Farther away than any photon comes in its cycle, fs.
const FAR_FS: i64 = 1 << 60;

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

/// The parts of a macropixel's light. The first has the photons that trigger no others. Light of one echo has that
/// part and one with those that do.
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
    pub(crate) fn span(&self, slots: Range<u32>) -> Span {
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
}

#[cfg(test)]
mod tests;
