//! Dim light but the least: the photons of a group of laser cycles in a table of bits, and exact times only where that does not decide.
//!
//! ```text
//!   random words ──► table ──► certain to fire ─────────────────────────────► counted by rows
//!                         └──► may fire ──► its SPAD's photons, by time ──► ┘
//!                                              └─ depend on what came before ──► history
//! ```
//!
//! Laser cycles with a photon whose avalanche causes others, or with one of those, are settled as a whole. On a photon line, those with
//! photons that may meet are counted by times, and settled as a whole where they do.

use std::cell::Cell;

use super::{Counting, CycleWindow, GroupDraws, Pixel};
use crate::engine::window::echo_rows::PassedEdges;
use crate::engine::window::row_ranks::RowRanks;
use crate::engine::window::sight::ROUNDING_FS;
use crate::engine::window::table::{Layout, Places, Table, WORD};
use crate::photon::{CycleGroup, Draw, GroupPlace, PER_BLOCK, Photon, PixelStream, TIME_BITS};
use crate::units::Time;

mod doubt;

/// Steps of a slot.
const STEPS: u32 = 1 << TIME_BITS;

/// What is kept from one macropixel to the next.
#[derive(Debug, Default)]
pub(super) struct TableScratch {
    table: Table,
    /// Of each part of the light.
    drawn: Vec<GroupDraws>,
    echoes: Vec<Option<RowRanks>>,
    passed: PassedEdges,
    unknown: Vec<u32>,
    /// Photons that are put one by one: place and time after the start of the window's cycle.
    listed: Vec<(u32, i64)>,
    /// Photons to be settled by their times, as words that sort by place and time.
    keys: Vec<u64>,
    /// Photons whose avalanches cause others, by laser cycle of the group.
    parents: Vec<(u32, Photon)>,
    /// Laser cycles of the group in which they matter.
    whole: Vec<u32>,
    /// Places and rows in which a SPAD fires.
    fired: Vec<(u32, usize)>,
}

thread_local! {
    /// Those that this thread had last: tables are large, and made anew for every batch of macropixels took 9 % of the instructions
    /// of a frame of 1600 laser cycles.
    static KEPT: Cell<Option<Box<TableScratch>>> = const { Cell::new(None) };
}

/// A group of laser cycles in a table.
struct Tabling<'t> {
    layout: &'t Layout,
    group: CycleGroup,
    spad_bits: u32,
    /// Places of the group's laser cycles that belong to the exposure.
    end: u32,
    /// Photons of bins.
    seen: u64,
    /// Pulses that are counted, but not in the table.
    pulses: u64,
    /// And those that cancel each other.
    cancelled: u64,
}

impl Tabling<'_> {
    /// Words of the laser cycles that belong to the exposure.
    fn words(&self) -> usize {
        self.end.div_ceil(WORD) as usize
    }

    /// Where photons go; those `later` cycles later are for windows of the cycle after theirs.
    fn places(&self, later: u32) -> Places {
        Places {
            shift: self.group.place_shift(),
            later: later << self.spad_bits,
            end: self.end,
        }
    }

    /// The laser cycle in the group, and the SPAD, of a place.
    fn split(&self, place: u32) -> (u32, u8) {
        let spad = place & ((1 << self.spad_bits) - 1);
        (place >> self.spad_bits, spad as u8)
    }

    fn is_in_bins(&self, row: usize) -> bool {
        row > self.layout.before && row <= self.layout.rows()
    }

    /// Puts the photons of a draw but those of the echo, which begin in slots that may have edges of rows in them.
    fn put_background(
        &mut self,
        counting: &Counting<'_>,
        pixel: &Pixel<'_>,
        light: &PixelStream<'_>,
        draw: &Draw,
        later: u32,
        kept: &mut TableScratch,
    ) {
        let (slots, places) = (light.slots(), self.places(later));
        let moved_fs = i64::from(later) * counting.stream.cycle_fs();
        let room_fs = ROUNDING_FS + 2 * i64::from(later);
        for run in draw.runs.iter().filter(|run| run.photons > 0) {
            let time_fs = |step: u32| slots.time_fs(run.slot, step) - moved_fs;
            let edges_fs = &self.layout.edges_fs;
            let (first_fs, last_fs) = (time_fs(0), time_fs(STEPS - 1));
            let passed = edges_fs.partition_point(|&edge_fs| edge_fs + room_fs < first_fs);
            let reached = edges_fs.partition_point(|&edge_fs| edge_fs - room_fs <= last_fs);
            let blocks = run.blocks();
            let rows = draw.words();
            let words: [&[u32]; PER_BLOCK] =
                std::array::from_fn(|row| &rows[row][blocks[row].clone()]);
            if passed == reached {
                let is_twice = self.layout.fires_twice;
                let seen = kept.table.put_words(passed, is_twice, places, words);
                self.seen += if self.is_in_bins(passed) { seen } else { 0 };
                continue;
            }
            // A step before, or after, which all are on one side of an edge for certain.
            let step = |from_fs: i64| {
                let (mut low, mut high) = (0, STEPS);
                while low < high {
                    let middle = (low + high) / 2;
                    if time_fs(middle) < from_fs {
                        low = middle + 1;
                    } else {
                        high = middle;
                    }
                }
                low
            };
            let edges = edges_fs[passed..reached].iter();
            let edges: smallvec::SmallVec<[[u32; 2]; 2]> = edges
                .map(|&edge_fs| [step(edge_fs - room_fs), step(edge_fs + room_fs + 1)])
                .collect();
            for words in words {
                for &word in words {
                    let place = places.place(word);
                    if place >= self.end {
                        continue;
                    }
                    let at = word % STEPS;
                    let may = edges.iter().filter(|edge| at >= edge[0]).count();
                    let must = edges.iter().filter(|edge| at >= edge[1]).count();
                    if may == must {
                        self.put_photon(passed + must, place, kept);
                    } else {
                        let (cycle, _) = self.split(place);
                        let own_fs = slots.time_fs(run.slot, word);
                        let laser_cycle = self.group.first_cycle() + cycle;
                        let time_fs = own_fs - counting.moved_fs(laser_cycle, later);
                        self.put_at(counting, pixel, place, time_fs, kept);
                    }
                }
            }
        }
    }

    #[inline]
    fn put_photon(&mut self, row: usize, place: u32, kept: &mut TableScratch) {
        kept.table.put_photon(row, place);
        self.seen += u64::from(self.is_in_bins(row));
    }

    /// Puts a photon of an exact time after the start of its window's cycle.
    fn put_at(
        &mut self,
        counting: &Counting<'_>,
        pixel: &Pixel<'_>,
        place: u32,
        time_fs: i64,
        kept: &mut TableScratch,
    ) {
        let row = self.layout.row_of(time_fs).unwrap_or_else(|| {
            let (cycle, _) = self.split(place);
            let window = counting.window(pixel.sight, self.group.first_cycle() + cycle);
            self.exact_row(&window, time_fs)
        });
        self.put_photon(row, place, kept);
    }

    /// The row of a photon in the window of a laser cycle.
    fn exact_row(&self, window: &CycleWindow<'_>, time_fs: i64) -> usize {
        let edges_fs = &self.layout.edges_fs;
        if let Some(bin) = window.row_of(window.start + Time::from_fs(time_fs)) {
            self.layout.before + bin
        } else if time_fs > edges_fs[self.layout.before] + ROUNDING_FS {
            edges_fs.len()
        } else {
            let passed = edges_fs.partition_point(|&edge_fs| edge_fs <= time_fs);
            passed.min(self.layout.before)
        }
    }

    /// Puts the photons of an echo, of which most are known by their ranks.
    fn put_echo(
        &mut self,
        counting: &Counting<'_>,
        pixel: &Pixel<'_>,
        light: &PixelStream<'_>,
        draw: &Draw,
        rows: &RowRanks,
        kept: &mut TableScratch,
    ) {
        let places = self.places(0);
        let halves = draw.echo().into_iter().zip(draw.echo_photons());
        for (half, (words, photons)) in halves.enumerate() {
            rows.compare(words, &mut kept.passed);
            let high = &words[1][..photons];
            let PassedEdges { rows, possible, .. } = &kept.passed;
            let [rows, possible] = [rows, possible].map(|rows| &rows[..photons]);
            let is_twice = self.layout.fires_twice;
            kept.unknown.clear();
            let (table, unknown) = (&mut kept.table, &mut kept.unknown);
            table.put_rows(is_twice, places, high, [rows, possible], unknown);
            let bins = self.layout.before as i16 + 1..=self.layout.rows() as i16;
            let seen = rows.iter().zip(possible).zip(high);
            let seen = seen.map(|((row, possible), &word)| {
                let is_known = (row == possible) & bins.contains(row);
                u32::from(is_known & (places.place(word) < places.end))
            });
            self.seen += u64::from(seen.sum::<u32>());
            let unknown = std::mem::take(&mut kept.unknown);
            for &number in &unknown {
                let number = half * draw.half_an_echo() + number as usize;
                let (place, time_fs) = light.signal_photon(draw, number);
                let place = u32::from(place);
                if place < self.end && draw.within_fs().contains(&time_fs) {
                    self.put_at(counting, pixel, place, time_fs, kept);
                }
            }
            kept.unknown = unknown;
        }
    }
}

impl Counting<'_> {
    /// By how much photons of a laser cycle or, `later`, of the one before it are counted from another start, fs.
    fn moved_fs(&self, laser_cycle: u32, later: u32) -> i64 {
        match later {
            0 => 0,
            _ => self.previous_cycle_length(laser_cycle).as_fs(),
        }
    }

    /// Counts a macropixel in dim light.
    pub(super) fn count_tabled(&mut self, pixel: &mut Pixel<'_>) {
        let mut kept = KEPT.take().unwrap_or_default();
        let config = self.stream.config();
        let spans = &pixel.sight.plain;
        let within_fs = &spans.own.within_fs;
        let law = &self.engine.law;
        let stage = (!law.has_clk_bins()).then(|| law.timing().photon_line_stage);
        let bins_fs = pixel.sight.rows.edges_fs();
        let layout = Layout::new(bins_fs, spans.from_fs, &config.spads, stage);
        // Of a line, rows have at most one SPAD of a laser cycle that is not settled as a whole.
        let adds = match stage {
            None => self.adds.clone(),
            Some(_) => vec![0, 1],
        };
        let parts = pixel.parts;
        kept.drawn
            .resize_with(kept.drawn.len().max(parts.len()), GroupDraws::default);
        kept.drawn
            .iter_mut()
            .for_each(|drawn| drawn.carried.clear());
        kept.echoes.clear();
        let echoes = parts
            .iter()
            .map(|part| RowRanks::new(part, &layout, within_fs));
        kept.echoes.extend(echoes);
        self.layers
            .resize_with(self.layers.len().max(parts.len()), Default::default);
        self.layers.iter_mut().for_each(|layer| layer.clear());
        for group in self.stream.groups() {
            let cycles = group.cycles_in(config.laser_cycles);
            let spad_bits = self.stream.spads().ilog2();
            let mut tabling = Tabling {
                layout: &layout,
                group,
                spad_bits,
                end: cycles << spad_bits,
                seen: 0,
                pulses: 0,
                cancelled: 0,
            };
            self.draw_table(pixel, &mut tabling, &mut kept);
            let words = tabling.words();
            if kept.table.settle(&layout, words) {
                if pixel.has_secondaries() || stage.is_some() {
                    kept.table.doubt_cycles(&layout, spad_bits, words);
                }
                tabling.collect(self, pixel, &mut kept);
                self.settle_keys(pixel, &mut tabling, &mut kept);
            }
            let mut pulses = tabling.pulses + tabling.cancelled;
            pixel.work.cancelled += tabling.cancelled;
            for (bin, hits) in pixel.hits.iter_mut().enumerate() {
                let row = layout.before + 1 + bin;
                let [adds, fired, visited] = kept.table.count(row, spad_bits, words, &adds);
                *hits += adds;
                pulses += fired as u64;
                pixel.work.clk_periods_visited += visited as u64;
            }
            pixel.work.pulses += pulses;
            pixel.work.lost_to_dead_time += tabling.seen.saturating_sub(pulses);
            for (part, drawn) in parts.iter().zip(&mut kept.drawn) {
                if !part.has_secondaries() {
                    drawn.carry(part, group);
                }
            }
        }
        KEPT.set(Some(kept));
    }

    /// Draws the photons of a group and puts them into the table.
    fn draw_table(
        &mut self,
        pixel: &mut Pixel<'_>,
        tabling: &mut Tabling<'_>,
        kept: &mut TableScratch,
    ) {
        let (group, parts) = (tabling.group, pixel.parts);
        let cycles = tabling.end >> tabling.spad_bits;
        let places = group.cycles() << tabling.spad_bits;
        kept.table
            .clear(tabling.layout, places.div_ceil(WORD) as usize);
        kept.listed.clear();
        kept.parents.clear();
        let mut drawn = std::mem::take(&mut kept.drawn);
        let echoes = std::mem::take(&mut kept.echoes);
        let mut others = std::mem::take(&mut self.by_cycle);
        others.clear();
        for (number, part) in parts.iter().enumerate() {
            let first = group.first_cycle();
            let spans = pixel.spans(part);
            if part.has_secondaries() {
                let layer = &mut self.layers[number];
                pixel.work.photons_drawn += layer.draw(part, self.stream, first, spans);
                let photons = layer.of_group(group).iter();
                let photons = photons.map(|&(cycle, photon)| (cycle - first, photon));
                kept.parents.extend(photons);
                self.other_echoes(pixel, part, group, &mut kept.parents);
                continue;
            }
            let (drawn, echo) = (&mut drawn[number], &echoes[number]);
            pixel.work.photons_drawn += drawn.draw(part, group, spans);
            self.other_echoes(pixel, part, group, &mut others);
            for (draw, later) in [(&drawn.own, 0), (&drawn.previous, 1)] {
                tabling.put_background(self, pixel, part, draw, later, kept);
                let place = tabling.places(later);
                let is_kept = draw.runs.is_empty() && draw.echo_photons() == [0; 2];
                let mut list = |(own, time_fs): (GroupPlace, i64)| {
                    let place = u32::from(own) + place.later;
                    let (cycle, _) = tabling.split(place);
                    if place < tabling.end {
                        let moved_fs = self.moved_fs(first + cycle, later);
                        kept.listed.push((place, time_fs - moved_fs));
                    }
                };
                if is_kept {
                    draw.photons(part, cycles).for_each(list);
                } else if echo.is_none() {
                    let [one, other] = draw.echo_photons();
                    let half = draw.half_an_echo();
                    let numbers = (0..one).chain(half..half + other);
                    numbers
                        .map(|number| part.signal_photon(draw, number))
                        .filter(|(_, time_fs)| draw.within_fs().contains(time_fs))
                        .for_each(&mut list);
                }
            }
            if let Some(rows) = echo {
                tabling.put_echo(self, pixel, part, &drawn.own, rows, kept);
            }
            let carried = drawn.carried.iter().map(|&(spad, time_fs)| {
                let moved_fs = self.moved_fs(first, 1);
                (u32::from(spad), time_fs - moved_fs)
            });
            kept.listed.extend(carried);
        }
        kept.listed.extend(others.drain(..).map(|(cycle, photon)| {
            let start = self.stream.cycle_start(group.first_cycle() + cycle);
            let place = cycle << tabling.spad_bits | u32::from(photon.spad);
            (place, (photon.time - start).as_fs())
        }));
        self.by_cycle = others;
        let listed = std::mem::take(&mut kept.listed);
        for &(place, time_fs) in &listed {
            tabling.put_at(self, pixel, place, time_fs, kept);
        }
        (kept.listed, kept.drawn, kept.echoes) = (listed, drawn, echoes);
        kept.parents.sort_unstable_by_key(|&(cycle, _)| cycle);
        kept.table.cut(tabling.layout, tabling.end);
        if group.first_cycle() == 0 {
            // Some may come before the exposure and be no photons.
            let from_fs = pixel.sight.plain.from_fs - ROUNDING_FS;
            let early = u32::from(from_fs <= 0) + u32::from(from_fs + self.stream.cycle_fs() <= 0);
            let places = 0..(early << tabling.spad_bits).min(tabling.end);
            places.for_each(|place| kept.table.doubt_place(place));
        }
        kept.whole.clear();
        for photons in kept.parents.chunk_by(|a, b| a.0 == b.0) {
            let cycle = photons[0].0;
            let matters = |(_, photon): &(u32, Photon)| {
                self.matters(pixel, group.first_cycle() + cycle, *photon)
            };
            if cycle < cycles && photons.iter().any(matters) {
                kept.whole.push(cycle);
            }
        }
        let in_word = WORD >> tabling.spad_bits;
        for word in kept.table.meeting(tabling.layout, tabling.words()) {
            let cycles = word * in_word..((word + 1) * in_word).min(cycles);
            kept.whole.extend(cycles);
        }
        kept.whole.sort_unstable();
        kept.whole.dedup();
        for cycle in &kept.whole {
            kept.table.doubt_place(cycle << tabling.spad_bits);
        }
    }

    /// Whether a photon whose avalanche causes others, or one of those, may be seen, or blind a SPAD that sees.
    fn matters(&self, pixel: &Pixel<'_>, laser_cycle: u32, photon: Photon) -> bool {
        let start = self.stream.cycle_start(laser_cycle);
        let from = start + Time::from_fs(pixel.sight.plain.from_fs);
        let until = start + Time::from_fs(pixel.sight.until_fs);
        let is_seen = |time: Time| time >= from && time < until;
        let light = pixel.parts.iter().find(|part| part.has_secondaries());
        is_seen(photon.time)
            || light.is_some_and(|light| light.children(photon).any(|child| is_seen(child.time)))
    }
}
