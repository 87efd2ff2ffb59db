//! Counting a macropixel's photons, a group of laser cycles at a time.
//!
//! ```text
//!   photon ──► cells: SPADs by row (bin) and cycle          ──► tally: events per bin
//!         └──► last photon by cycle and SPAD ── a second one? ──► history: dead time, one SPAD at a time
//! ```
//!
//! Nearly every photon is alone with its SPAD from the SPADs' memory before the window to its end: it makes a pulse
//! and adds one to its cell. Where a SPAD has several in one cycle, or a photon comes too close to an edge, its photons
//! are taken out again, and what the dead time leaves of them is put back. In the end each cell holds how many SPADs fired
//! in that CLK period.
//!
//! Where secondaries tie SPADs together, or photons are many, cycles are sorted and go through [`SpadModel::detect`]
//! one by one ([`Counting::count_sorted`]).
//!
//! [`SpadModel::detect`]: crate::photon::SpadModel::detect

use std::ops::Range;

use super::binning::{Binning, Code, ROW};
use super::history::{Photon, certain_from, split};
use super::sight::{ROUNDING_FS, Sight};
use super::tables::{MOST_PHOTONS, Tables};
use super::{Window, Work, taken};
use crate::chip::EventType;
use crate::photon::{
    Draw, GROUP, PhotonStream, PixelStream, Place, SLOT, SPADS, SpadEvent, time_in_slot_fs,
};
use crate::units::Time;

/// Which cycle's windows a draw is for, and from which cycle its photons are.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
enum Part {
    /// Photons of the window's own cycle.
    Own,
    /// Photons of the cycle before, in the same group.
    Previous,
    /// Photons of the last cycle of the group before, for the first cycle of this one.
    Carried,
}

const PARTS: [Part; 3] = [Part::Own, Part::Previous, Part::Carried];

const LAST_CYCLE: usize = GROUP as usize - 1;

impl Part {
    /// The cycle of the group whose window a photon of this part belongs to, if any.
    #[inline]
    fn window_cycle(self, cycle: usize) -> Option<usize> {
        match self {
            Part::Own => Some(cycle),
            Part::Previous => (cycle < LAST_CYCLE).then_some(cycle + 1),
            Part::Carried => (cycle == LAST_CYCLE).then_some(0),
        }
    }
}

/// Counts macropixels; keeps its tables from one to the next.
pub struct Counting<'a> {
    engine: &'a Window<'a>,
    stream: &'a PhotonStream,
    binning: Binning,
    /// What sizes of cells add to a bin, and how much.
    counted: (u8, u8),
    adds: i64,
    draws: [Draw; 3],
    extra: Draw,
    bases: Vec<u32>,
    /// Codes of all photons drawn for the group. Photons are known by their index here.
    codes: Vec<Code>,
    /// Where each part's codes begin.
    first_code: [usize; 3],
    tables: Tables,
    photons: Vec<Photon>,
    /// Photons by cycle, for those that are sorted.
    sorted: Vec<(usize, Photon)>,
    events: Vec<SpadEvent>,
}

/// One macropixel.
struct Pixel<'p> {
    sight: &'p Sight,
    light: &'p PixelStream<'p>,
    hits: Vec<i64>,
    work: Work,
}

impl<'a> Counting<'a> {
    /// For macropixels of `engine` in the light of `stream`.
    pub fn new(engine: &'a Window<'a>, stream: &'a PhotonStream) -> Self {
        let binning = Binning::new(engine.config.bins, engine.exposure.clock.as_hz());
        let threshold = engine.config.threshold;
        // Sizes of a cell, 1 to 16, that differ from the dark in what they add.
        let counted = match (engine.config.event_type, threshold) {
            (EventType::Greater, _) => (threshold + 1, u8::MAX),
            (EventType::Equal, 0) => (1, u8::MAX),
            (EventType::Equal, _) => (threshold, threshold),
            // Nothing is less than none; 17 SPADs there never are.
            (EventType::Less, 0) => (u8::MAX, u8::MAX),
            (EventType::Less, _) => (threshold, u8::MAX),
        };
        let adds = if engine.is_event(0) { -1 } else { 1 };
        Counting {
            engine,
            stream,
            binning,
            counted,
            adds,
            draws: Default::default(),
            extra: Draw::default(),
            bases: Vec::new(),
            codes: Vec::new(),
            first_code: [0; 3],
            tables: Tables::new(binning.rows()),
            photons: Vec::new(),
            sorted: Vec::new(),
            events: Vec::new(),
        }
    }

    /// Hits of every bin of a macropixel, and what they took.
    pub fn expose(&mut self, sight: &Sight, light: &PixelStream<'_>) -> (Vec<i64>, Work) {
        let mut pixel = Pixel {
            sight,
            light,
            hits: self.engine.dark_hits(sight.first_edge),
            work: Work::default(),
        };
        for group in 0..self.stream.groups() {
            self.draw(&mut pixel, group);
            let is_dense = self.codes.len() >= MOST_PHOTONS;
            if is_dense || self.stream.config().spads.has_secondaries() {
                self.count_sorted(&mut pixel, group);
            } else {
                self.count_cells(&mut pixel, group);
            }
        }
        (pixel.hits, pixel.work)
    }

    /// Cycles of a group that belong to the exposure.
    fn cycles_of(&self, group: u32) -> usize {
        (self.stream.config().laser_cycles - group * GROUP).min(GROUP) as usize
    }

    /// Draws and encodes all photons that the windows of a group may see.
    fn draw(&mut self, pixel: &mut Pixel<'_>, group: u32) {
        self.codes.clear();
        for (index, part) in PARTS.into_iter().enumerate() {
            let draw = &mut self.draws[index];
            let (slots, from_group, start_fs) = match part {
                Part::Own => (&pixel.sight.own, Some(group), 0),
                Part::Previous => (&pixel.sight.previous, Some(group), self.stream.cycle_fs()),
                Part::Carried => (
                    &pixel.sight.previous,
                    group.checked_sub(1),
                    self.stream.cycle_fs(),
                ),
            };
            self.first_code[index] = self.codes.len();
            match from_group {
                Some(group) if !slots.is_empty() => pixel.light.draw(group, slots.clone(), draw),
                _ => {
                    draw.clear();
                    continue;
                }
            }
            let shift_fs = start_fs + pixel.sight.first_fs;
            self.bases.clear();
            for run in draw.runs() {
                let base = self.binning.base(run.start_fs() - shift_fs);
                let blocks = run.blocks()[0].len();
                self.bases.resize(self.bases.len() + blocks, base);
                pixel.work.photons_drawn += u64::from(run.photons);
            }
            for [times, places] in draw.words() {
                self.binning
                    .encode(times, places, &self.bases, &mut self.codes);
            }
            pixel.work.photons_drawn += draw.signal().len() as u64;
            for photon in draw.signal() {
                let code = self
                    .binning
                    .encode_one(photon.time_fs - shift_fs, photon.place);
                self.codes.push(code);
            }
        }
    }

    fn count_cells(&mut self, pixel: &mut Pixel<'_>, group: u32) {
        self.tables.clear();
        for (index, part) in PARTS.into_iter().enumerate() {
            self.place(index, part);
        }
        let cycles = self.cycles_of(group);
        let mut index = 0;
        while let Some(photon) = self.tables.special(index) {
            let (cycle, spad) = split(self.codes[photon].place() as Place);
            if cycle < cycles {
                self.settle(pixel, group, cycle, spad);
            }
            index += 1;
        }
        let tallies = self.tables.tallies(cycles, self.counted);
        for (tally, hits) in tallies.zip(&mut pixel.hits) {
            *hits += self.adds * tally.within as i64;
            pixel.work.clk_periods_visited += tally.occupied;
            pixel.work.pulses += tally.spads;
        }
    }

    /// Puts the photons of one draw into their cells.
    fn place(&mut self, index: usize, part: Part) {
        let draw = &self.draws[index];
        let first = self.first_code[index];
        let blocks = draw.words()[0][0].len();
        let (codes, tables) = (&mut self.codes, &mut self.tables);
        let mut put = |photons: Range<usize>| {
            for (code, photon) in codes[photons.clone()].iter_mut().zip(photons) {
                if part != Part::Own {
                    let (cycle, _) = split(code.place() as Place);
                    let Some(window_cycle) = part.window_cycle(cycle) else {
                        continue;
                    };
                    *code = code.in_cycle(window_cycle);
                }
                tables.put(*code, photon);
            }
        };
        for run in draw.runs() {
            let left_fs = self.stream.cycle_fs() - run.start_fs();
            for (half, range) in run.blocks().into_iter().enumerate() {
                let first = first + half * blocks;
                if left_fs >= SLOT.as_fs() {
                    put(first + range.start..first + range.end);
                    continue;
                }
                // The slot outlasts the cycle.
                let times = draw.words()[half][0];
                range
                    .filter(|&block| i64::from(time_in_slot_fs(times[block])) < left_fs)
                    .for_each(|block| put(first + block..first + block + 1));
            }
        }
        let signal = first + 2 * blocks;
        put(signal..signal + draw.signal().len());
    }

    /// Settles all photons of one SPAD in the window of one cycle.
    fn settle(&mut self, pixel: &mut Pixel<'_>, group: u32, cycle: usize, spad: u8) {
        let place = cycle * SPADS + usize::from(spad);
        let mut next = self.tables.take_last(place);
        let laser_cycle = group * GROUP + cycle as u32;
        let window = Placed {
            engine: self.engine,
            binning: self.binning,
            sight: pixel.sight,
            laser_cycle,
        };
        self.photons.clear();
        let mut seen = 0;
        while let Some(photon) = next {
            self.tables.remove(self.codes[photon].cell());
            let time = self.time_of(photon, laser_cycle);
            seen += u64::from(window.row_of(time).is_some());
            self.photons.push((time, spad));
            next = self.tables.before(photon);
        }
        // None is in the window, or another special photon has brought us here before.
        if seen == 0 {
            return;
        }
        self.photons.sort_unstable();
        self.detect(pixel, laser_cycle, 1 << spad);
        let mut last = None;
        for event in &self.events {
            let Some(row) = window.row_of(event.time) else {
                continue;
            };
            seen -= 1;
            // Two pulses within one CLK period cancel.
            if last == Some(row) {
                self.tables.remove(row * ROW + cycle);
                last = None;
                pixel.work.pulses += 2;
            } else {
                self.tables.add(row * ROW + cycle);
                last = Some(row);
            }
        }
        pixel.work.lost_to_dead_time += seen;
    }

    /// Turns `photons` of the SPADs of a set, sorted, relative to the start of their window's laser cycle, into
    /// `events`: all rising edges in the window. Looks back as far as it takes.
    fn detect(&mut self, pixel: &mut Pixel<'_>, laser_cycle: u32, spads: u16) {
        let config = self.stream.config();
        let start = || config.cycle_start(laser_cycle);
        let seen_from = Time::from_fs(pixel.sight.first_fs - ROUNDING_FS);
        let mut past = pixel.sight.past(self.stream, laser_cycle);
        let mut known_from = match past.is_everything() {
            true => None,
            false => Some(Time::from_fs(pixel.sight.drawn_from_fs)),
        };
        let memory = config.spads.memory();
        let certain = loop {
            if let Some(index) = certain_from(&self.photons, memory, known_from, seen_from) {
                break index;
            }
            let drawn = past.extend(pixel.light, spads, &mut self.extra);
            self.photons
                .extend(drawn.map(|(time, spad)| (time - start(), spad)));
            pixel.work.photons_drawn += self.extra.len() as u64;
            self.photons.sort_unstable();
            known_from = past.known_from().map(|time| time - start());
        };
        self.events.clear();
        let photons = self.photons[certain..].iter();
        self.events
            .extend(photons.map(|&(time, spad)| SpadEvent { time, spad }));
        if config.spads.has_secondaries() {
            // Those are drawn from times of the exposure.
            let start = start();
            self.events.iter_mut().for_each(|event| event.time += start);
            pixel.light.detect(&mut self.events);
            self.events
                .iter_mut()
                .for_each(|event| event.time = event.time - start);
        } else {
            pixel.light.detect(&mut self.events);
        }
    }

    /// When a photon came, relative to the start of the laser cycle of its window.
    fn time_of(&self, photon: usize, laser_cycle: u32) -> Time {
        let index = self.first_code.partition_point(|&first| first <= photon) - 1;
        let draw = &self.draws[index];
        let blocks = draw.words()[0][0].len();
        let at = photon - self.first_code[index];
        let time_fs = match at.checked_sub(2 * blocks) {
            Some(signal) => draw.signal()[signal].time_fs,
            None => {
                let (half, block) = (at / blocks, at % blocks);
                let run = draw.run_of(block);
                run.start_fs() + i64::from(time_in_slot_fs(draw.words()[half][0][block]))
            }
        };
        let time = Time::from_fs(time_fs);
        match PARTS[index] {
            Part::Own => time,
            Part::Previous | Part::Carried => {
                let start = |cycle| self.stream.config().cycle_start(cycle);
                time + start(laser_cycle - 1) - start(laser_cycle)
            }
        }
    }

    /// Counts cycle by cycle what all SPADs make of the photons together.
    fn count_sorted(&mut self, pixel: &mut Pixel<'_>, group: u32) {
        let cycles = self.cycles_of(group);
        let mut sorted = std::mem::take(&mut self.sorted);
        sorted.clear();
        for (part, draw) in PARTS.into_iter().zip(&self.draws) {
            let start = |cycle: u32| self.stream.config().cycle_start(cycle);
            sorted.extend(draw.photons().filter_map(|(place, time_fs)| {
                let (cycle, spad) = split(place);
                let cycle = part.window_cycle(cycle).filter(|&cycle| cycle < cycles)?;
                let mut time = Time::from_fs(time_fs);
                if part != Part::Own {
                    let laser_cycle = group * GROUP + cycle as u32;
                    time += start(laser_cycle - 1) - start(laser_cycle);
                }
                Some((cycle, (time, spad)))
            }));
        }
        sorted.sort_unstable();
        for photons in sorted.chunk_by(|a, b| a.0 == b.0) {
            let laser_cycle = group * GROUP + photons[0].0 as u32;
            let window = Placed {
                engine: self.engine,
                binning: self.binning,
                sight: pixel.sight,
                laser_cycle,
            };
            self.photons.clear();
            self.photons
                .extend(photons.iter().map(|&(_, photon)| photon));
            let alive = self.photons.iter();
            let seen = alive
                .filter(|(time, _)| window.row_of(*time).is_some())
                .count() as u64;
            self.detect(pixel, laser_cycle, u16::MAX);
            let row_of = |event: &SpadEvent| window.row_of(event.time).unwrap_or(0) as i64;
            let mut pulses = 0;
            for (row, spads) in taken(&self.events, row_of).filter(|(row, _)| *row > 0) {
                pixel.hits[row as usize - 1] += self.engine.adds(spads);
                pixel.work.clk_periods_visited += 1;
            }
            pulses += self.events.iter().filter(|event| row_of(event) > 0).count() as u64;
            pixel.work.pulses += pulses;
            pixel.work.lost_to_dead_time += seen.saturating_sub(pulses);
        }
        self.sorted = sorted;
    }
}

/// The window of one laser cycle.
struct Placed<'w> {
    engine: &'w Window<'w>,
    binning: Binning,
    sight: &'w Sight,
    laser_cycle: u32,
}

impl Placed<'_> {
    /// Bin + 1 of a time relative to the start of the laser cycle, if it is within the window.
    fn row_of(&self, time: Time) -> Option<usize> {
        let code = self
            .binning
            .encode_one(time.as_fs() - self.sight.first_fs, 0);
        let bins = self.engine.config.bins;
        if !code.is_doubtful() {
            return Some(code.row()).filter(|row| (1..=bins).contains(row));
        }
        let exposure = self.engine.exposure;
        let cycle = i64::from(self.laser_cycle);
        let edge = self.engine.edge_of(exposure.stop(cycle) + time);
        let first_edge = self.sight.first_edge + cycle * i64::from(exposure.stop_periods);
        let bin = usize::try_from(edge - first_edge).ok()?;
        (bin < bins).then_some(bin + 1)
    }
}
