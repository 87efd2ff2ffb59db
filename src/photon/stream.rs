//! The photon stream: every avalanche of a macropixel in an exposure, drawn in any order.
//!
//! An exposure is a row of laser cycles. Cycle n spans the half-open time from `clock.periods(n · stop_periods)` to the
//! start of cycle n + 1; the laser fires at its start, with the rising edge of STOP. In each cycle a macropixel detects
//!
//! * a Poisson number of signal photons, spread around the arrival of the echo by the laser pulse and all jitter,
//! * a Poisson number of background photons and dark counts, uniform over the cycle,
//!
//! each on one of the 16 SPADs with equal chance. Photons outside their cycle are discarded.
//!
//! ```text
//!                 slot 0   slot 1   slot 2   …            a slot is 2²³ fs = 8.4 ns after the start of its cycle
//!   cycle 0     ┌────────┬────────┬────────┬──
//!   cycle 1     │ one    │        │        │             a group is 512 laser cycles
//!     …         │ draw   │        │        │
//!   cycle 511   ├────────┼────────┼────────┼──           background: one key per (macropixel, slot, group)
//!   cycle 512   │        │        │        │             signal:     one key per (macropixel, group)
//! ```
//!
//! The photons under one key are a pure function of (seed, macropixel, slot, group): their Poisson number is drawn
//! first, then each takes 64 random bits (a signal photon 128) for its cycle, SPAD and time. So any part can be drawn
//! on any thread in any order, and all see the same light. Only dead time, afterpulses and crosstalk tie slots and
//! cycles together; they are applied afterwards ([`SpadModel::detect`]).
//!
//! Timing jitter of a SPAD displaces the points of a Poisson process, which leaves it one: jitter of background changes
//! nothing, and that of the signal is part of the pulse.
//!
//! Limits of the model: rates are detection rates and constant within an exposure; no spread of dead time or dark counts
//! between SPADs; an echo that outlasts its cycle is cut off and not carried into the next one. Where a cycle is no
//! whole number of femtoseconds, its odd last one gets no photon.

use super::philox::Blocks;
use super::pulse::{PulseSampler, PulseShape};
use super::random::{Poisson, Purpose, philox_key};
use super::spad::{SPADS, SpadEvent, SpadModel};
use crate::units::{Frequency, Time};

/// Length of a time slot.
pub const SLOT: Time = Time::from_fs(1 << SLOT_BITS);
const SLOT_BITS: u32 = 23;

/// Laser cycles of a group.
pub const GROUP: u32 = 1 << GROUP_BITS;
const GROUP_BITS: u32 = 9;

const SPAD_BITS: u32 = SPADS.trailing_zeros();

/// Adding it leaves no fraction to numbers up to ±2⁵¹.
const ROUNDER: f64 = 6_755_399_441_055_744.0;

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

    /// Nominal length of a cycle, s.
    pub fn cycle_s(&self) -> f64 {
        f64::from(self.stop_periods) / self.clock.as_hz()
    }
}

/// The light on one macropixel.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct PixelLight {
    /// Mean number of detected signal photons per laser cycle, finite and ≥ 0.
    pub signal_per_cycle: f64,
    /// Centre of the echo (of a Gaussian pulse) after the start of its cycle.
    pub arrival: Time,
    /// Mean rate of detected background photons and dark counts of all SPADs, finite and ≥ 0.
    pub background_hz: f64,
}

impl PixelLight {
    /// Mean number of photons and dark counts in a laser cycle of `config`.
    pub fn photons_per_cycle(&self, config: &StreamConfig) -> f64 {
        self.signal_per_cycle + self.background_hz * config.cycle_s()
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
    cycle_fs: i64,
    gaussian: PulseSampler,
    shape: Option<PulseSampler>,
}

impl PhotonStream {
    /// Prepares the stream.
    pub fn new(config: &StreamConfig) -> Self {
        debug_assert!(config.stop_periods > 0, "a cycle needs a length");
        PhotonStream {
            key: philox_key(config.seed),
            cycle_fs: config.clock.whole_fs(i64::from(config.stop_periods)),
            gaussian: PulseSampler::gaussian(config.pulse_sigma),
            shape: config.pulse_shape.as_ref().map(PulseSampler::measured),
            config: config.clone(),
        }
    }

    /// What it was made of.
    pub fn config(&self) -> &StreamConfig {
        &self.config
    }

    /// The whole femtoseconds of a laser cycle: photons come before that.
    pub fn cycle_fs(&self) -> i64 {
        self.cycle_fs
    }

    /// Slots of a laser cycle; the last one may outlast it.
    pub fn slots(&self) -> u32 {
        (self.cycle_fs as u64).div_ceil(SLOT.as_fs() as u64) as u32
    }

    /// Groups of the exposure; the last one may outlast it.
    pub fn groups(&self) -> u32 {
        self.config.laser_cycles.div_ceil(GROUP)
    }

    /// Macropixel number `pixel` under `light`.
    pub fn pixel(&self, pixel: u32, light: &PixelLight) -> PixelStream<'_> {
        let (mut first_fs, mut last_fs) = self.gaussian.range_fs();
        if let Some(shape) = &self.shape {
            first_fs += shape.range_fs().0;
            last_fs += shape.range_fs().1;
        }
        let arrival_fs = light.arrival.as_fs();
        let slot_s = SLOT.as_s() * f64::from(GROUP);
        PixelStream {
            stream: self,
            pixel,
            arrival_fs,
            echo_fs: (
                arrival_fs.saturating_add(first_fs.floor() as i64),
                arrival_fs.saturating_add(last_fs.ceil() as i64),
            ),
            background: Poisson::new(light.background_hz * slot_s),
            signal: Poisson::new(light.signal_per_cycle * f64::from(GROUP)),
        }
    }

    /// All avalanches of macropixel number `pixel` under `light` in the exposure.
    pub fn pixel_events(&self, pixel: u32, light: &PixelLight) -> PixelPhotons {
        let stream = self.pixel(pixel, light);
        let expected = light.photons_per_cycle(&self.config) * f64::from(self.config.laser_cycles);
        // Five standard deviations of room; the cap keeps a huge request from failing up front.
        let room = (expected + 5.0 * expected.sqrt() + 16.0).min(1e7);
        let mut events = Vec::with_capacity(room as usize);
        let mut draw = Draw::default();
        let mut by_cycle = ByCycle::default();
        for group in 0..self.groups() {
            stream.draw(group, 0..self.slots(), &mut draw);
            by_cycle.sort(&draw);
            let first = group * GROUP;
            let cycles = (self.config.laser_cycles - first).min(GROUP);
            for cycle in 0..cycles {
                let start = self.config.cycle_start(first + cycle);
                events.extend(by_cycle.of(cycle).iter().map(|&photon| SpadEvent {
                    time: start + Time::from_fs((photon >> SPAD_BITS) as i64),
                    spad: (photon & (SPADS as u64 - 1)) as u8,
                }));
            }
        }
        let drawn = events.len() as u64;
        let lost_to_dead_time = stream.detect(&mut events);
        let end = self.config.cycle_start(self.config.laser_cycles);
        events.truncate(events.partition_point(|event| event.time < end));
        PixelPhotons {
            events,
            drawn,
            lost_to_dead_time,
        }
    }
}

/// The photons of one macropixel, before dead time.
#[derive(Debug, Clone)]
pub struct PixelStream<'a> {
    stream: &'a PhotonStream,
    pixel: u32,
    arrival_fs: i64,
    /// Earliest and latest time of a signal photon in its cycle.
    echo_fs: (i64, i64),
    /// Photons in a slot of a group.
    background: Poisson,
    /// Photons in a group.
    signal: Poisson,
}

impl PixelStream<'_> {
    /// Turns photons of this macropixel, sorted by (time, SPAD) and complete since a time when every SPAD was ready, into
    /// rising edges; returns how many avalanches met a blind SPAD.
    pub fn detect(&self, events: &mut Vec<SpadEvent>) -> u64 {
        let spads = &self.stream.config.spads;
        spads.detect(self.stream.key, self.pixel, events)
    }

    /// Draws all photons of group `group` in these slots.
    pub fn draw(&self, group: u32, slots: std::ops::Range<u32>, draw: &mut Draw) {
        let (key, cycle_fs) = (self.stream.key, self.stream.cycle_fs);
        let numbered = |purpose: Purpose| purpose as u32 | group << 8;
        draw.cycle_fs = cycle_fs;
        draw.clear();

        let from_fs = i64::from(slots.start) << SLOT_BITS;
        let until_fs = (i64::from(slots.end) << SLOT_BITS).min(cycle_fs);
        let has_echo =
            !self.signal.is_zero() && self.echo_fs.0 < until_fs && self.echo_fs.1 >= from_fs;
        draw.counts.clear();
        if has_echo {
            draw.counts
                .push_run(SIGNAL_RUN, self.signal.words().div_ceil(2));
        }
        let blocks = self.background.words().div_ceil(2);
        if !self.background.is_zero() {
            for slot in slots.clone() {
                draw.counts.push_run(slot, blocks);
            }
        }
        draw.counts
            .generate(key, self.pixel, numbered(Purpose::PhotonCounts));

        let mut at = 0;
        if has_echo {
            let photons = draw.count(&self.signal, &mut at);
            draw.echo.clear();
            draw.echo.push_run(0, photons);
            draw.echo
                .generate(key, self.pixel, numbered(Purpose::Signal));
            self.place_signal(from_fs..until_fs, draw);
        }
        if !self.background.is_zero() {
            for slot in slots {
                let photons = draw.count(&self.background, &mut at);
                draw.runs.push(Run {
                    slot,
                    first_block: draw.background.len() as u32,
                    photons,
                });
                draw.background.push_run(slot, photons.div_ceil(2));
            }
            draw.background
                .generate(key, self.pixel, numbered(Purpose::Photons));
        }
    }

    fn place_signal(&self, within_fs: std::ops::Range<i64>, draw: &mut Draw) {
        let words: [&[u32]; 4] = std::array::from_fn(|word| draw.echo.words(word));
        for (((&w0, &w1), &w2), &w3) in words[0].iter().zip(words[1]).zip(words[2]).zip(words[3]) {
            let mut after_fs = self.stream.gaussian.draw(w3, w2);
            if let Some(shape) = &self.stream.shape {
                // The low bits of word 1 are independent of the place in its high ones.
                after_fs += shape.draw(w0, w1 << PLACE_BITS);
            }
            // Rounds to the nearest femtosecond without a call.
            let rounded = (after_fs + ROUNDER) - ROUNDER;
            let time_fs = self.arrival_fs.saturating_add(rounded as i64);
            if within_fs.contains(&time_fs) {
                draw.signal.push(SignalPhoton {
                    place: place(w1),
                    time_fs,
                });
            }
        }
    }
}

/// Where in its group a photon falls: cycle within the group and SPAD, as `cycle << 4 | SPAD`.
pub type Place = u16;

/// Bits of a [`Place`].
pub const PLACE_BITS: u32 = GROUP_BITS + SPAD_BITS;

/// The place that a random word gives.
#[inline]
pub fn place(word: u32) -> Place {
    (word >> (32 - PLACE_BITS)) as Place
}

/// The time within its slot that a random word gives, fs.
#[inline]
pub fn time_in_slot_fs(word: u32) -> u32 {
    word >> (32 - SLOT_BITS)
}

/// Second counter word of the number of signal photons; slots are below it.
const SIGNAL_RUN: u32 = u32::MAX;

/// Background photons of one slot. Each block of random words makes two: first those of words 0 and 1 of its blocks,
/// then those of words 2 and 3.
#[derive(Debug, Clone, Copy)]
pub struct Run {
    /// The slot.
    pub slot: u32,
    /// Its first block.
    pub first_block: u32,
    /// Its photons; if odd, the last block makes only one.
    pub photons: u32,
}

impl Run {
    /// When the slot begins after the start of its cycle.
    #[inline]
    pub fn start_fs(&self) -> i64 {
        i64::from(self.slot) << SLOT_BITS
    }

    /// Blocks whose words 0 and 1, and whose words 2 and 3, make photons.
    #[inline]
    pub fn blocks(&self) -> [std::ops::Range<usize>; 2] {
        let first = self.first_block as usize;
        let photons = self.photons as usize;
        [
            first..first + photons.div_ceil(2),
            first..first + photons / 2,
        ]
    }
}

/// A photon of the echo.
#[derive(Debug, Clone, Copy)]
pub struct SignalPhoton {
    /// Cycle and SPAD.
    pub place: Place,
    /// After the start of its cycle.
    pub time_fs: i64,
}

/// Photons of one macropixel, in some slots of one group. Background photons stay random words until somebody wants
/// them; those of the last slot that outlast the cycle are no photons.
#[derive(Debug, Clone, Default)]
pub struct Draw {
    counts: Blocks,
    background: Blocks,
    echo: Blocks,
    runs: Vec<Run>,
    signal: Vec<SignalPhoton>,
    cycle_fs: i64,
}

impl Draw {
    /// Forgets all photons.
    pub fn clear(&mut self) {
        self.runs.clear();
        self.background.clear();
        self.signal.clear();
    }

    /// How many photons were drawn, those that outlast the cycle among them.
    pub fn len(&self) -> usize {
        let background = self.runs.iter().map(|run| run.photons as usize);
        background.sum::<usize>() + self.signal.len()
    }

    /// Whether there is none.
    pub fn is_empty(&self) -> bool {
        self.len() == 0
    }

    /// The run of a block.
    pub fn run_of(&self, block: usize) -> &Run {
        let runs = &self.runs;
        &runs[runs.partition_point(|run| run.first_block as usize <= block) - 1]
    }

    /// Background photons by slot.
    pub fn runs(&self) -> &[Run] {
        &self.runs
    }

    /// The random words of background photons: [`time_in_slot_fs`] of the first and [`place`] of the second of
    /// each pair.
    pub fn words(&self) -> [[&[u32]; 2]; 2] {
        let words = |word| self.background.words(word);
        [[words(0), words(1)], [words(2), words(3)]]
    }

    /// Signal photons.
    pub fn signal(&self) -> &[SignalPhoton] {
        &self.signal
    }

    /// Every photon, as place and time after the start of its cycle in fs, in no particular order.
    pub fn photons(&self) -> impl Iterator<Item = (Place, i64)> + '_ {
        let words = self.words();
        let background = self.runs.iter().flat_map(move |run| {
            let start_fs = run.start_fs();
            run.blocks()
                .into_iter()
                .zip(words)
                .flat_map(move |(blocks, [times, places])| {
                    let photons = times[blocks.clone()].iter().zip(&places[blocks]);
                    photons.map(move |(&time, &word)| {
                        (place(word), start_fs + i64::from(time_in_slot_fs(time)))
                    })
                })
        });
        let signal = self
            .signal
            .iter()
            .map(|photon| (photon.place, photon.time_fs));
        background
            .filter(|&(_, time_fs)| time_fs < self.cycle_fs)
            .chain(signal)
    }

    /// A Poisson number from the next words of `counts`.
    #[inline]
    fn count(&self, poisson: &Poisson, at: &mut usize) -> u32 {
        let mut total = 0;
        for part in 0..poisson.words() {
            let block = *at + (part / 2) as usize;
            let half = (part % 2) as usize * 2;
            let word = |word: usize| u64::from(self.counts.words(word)[block]);
            total += poisson.part(word(half) << 32 | word(half + 1));
        }
        *at += poisson.words().div_ceil(2) as usize;
        total
    }
}

/// Photons of a group sorted by cycle, then time, then SPAD.
#[derive(Debug, Clone, Default)]
struct ByCycle {
    /// Time after the start of the cycle in fs and SPAD, as `time << 4 | SPAD`.
    photons: Vec<u64>,
    /// Where each cycle's photons end.
    ends: Vec<usize>,
}

impl ByCycle {
    fn sort(&mut self, draw: &Draw) {
        self.ends.clear();
        self.ends.resize(GROUP as usize, 0);
        let cycle_of = |place: Place| usize::from(place >> SPAD_BITS);
        for (place, _) in draw.photons() {
            self.ends[cycle_of(place)] += 1;
        }
        let mut total = 0;
        for end in &mut self.ends {
            // Where the cycle begins, until its photons have moved it to where it ends.
            total += std::mem::replace(end, total);
        }
        self.photons.clear();
        self.photons.resize(total, 0);
        for (place, time_fs) in draw.photons() {
            let end = &mut self.ends[cycle_of(place)];
            let spad = u64::from(place) & (SPADS as u64 - 1);
            self.photons[*end] = (time_fs as u64) << SPAD_BITS | spad;
            *end += 1;
        }
        let mut start = 0;
        for &end in &self.ends {
            self.photons[start..end].sort_unstable();
            start = end;
        }
    }

    fn of(&self, cycle: u32) -> &[u64] {
        let cycle = cycle as usize;
        let start = cycle.checked_sub(1).map_or(0, |before| self.ends[before]);
        &self.photons[start..self.ends[cycle]]
    }
}

#[cfg(test)]
mod tests;
