//! Counting macropixels in bright light, laser cycle by laser cycle.
//!
//! Each window begins some blocks of photons before its first bin, with SPADs of which nothing is known. Where that was
//! not enough to know them in the window, it begins anew twice as far back.
//!
//! The street with a lens of 20 mm takes a ninth of what it takes with every photon drawn.

use std::ops::Range;

use smallvec::SmallVec;

use super::super::sight::ROUNDING_FS;
use super::{Counting, CycleWindow, Pixel};
use crate::chip::MOST_SPADS;
use crate::photon::{ListedEchoes, Photon, PhotonStream, PixelStream, TILE, sort_photons};
use crate::units::Time;

/// Dead times before a window that are looked at for gaps.
const MOST_DEAD_TIMES: i64 = 64;

/// What a laser cycle costs beside its photons, in photons. Chosen.
const CYCLE_COST: f64 = 30.0;

/// So few SPADs that are not known, on average, are none.
const FEW_UNKNOWN: f64 = 1e-3;

/// How many dead times before a window its photons are drawn from at first, where twice as many are drawn if SPADs are not known then: `usual`, unless another number
/// costs less than half. A SPAD has `in_window` photons in the window on average, and `in_dead_time` of a number in that dead time before it. It is known
/// after a dead time without photons.
fn cheaper_look_back(
    usual: i64,
    in_window: f64,
    in_dead_time: impl Fn(i64) -> f64,
    spads: f64,
) -> i64 {
    // Cost of an attempt, and chance that it fails, by dead times from one on.
    let mut attempts = SmallVec::<[(f64, f64); MOST_DEAD_TIMES as usize]>::new();
    let (mut photons, mut gaps) = (in_window, 0.0);
    for back in 1..=MOST_DEAD_TIMES {
        let before = in_dead_time(back);
        photons += before;
        let none = libm::exp(-before);
        gaps += before * none - libm::log1p(-none.min(1.0 - 1e-9));
        let unknown = spads * libm::exp(-gaps);
        attempts.push((CYCLE_COST + spads * photons, unknown.min(1.0)));
        if unknown < FEW_UNKNOWN && back >= usual {
            break;
        }
    }
    let last = attempts.len() - 1;
    let (mut cheapest, mut least) = (last, attempts[last].0);
    for at in (0..last).rev() {
        let next = attempts[(2 * at + 1).min(last)].0;
        attempts[at].0 += attempts[at].1 * next;
        if attempts[at].0 < least {
            (cheapest, least) = (at, attempts[at].0);
        }
    }
    let of_usual = attempts[(usual as usize - 1).min(last)].0;
    if of_usual > 2.0 * least {
        cheapest as i64 + 1
    } else {
        usual
    }
}

/// The beginning of a block of photons.
#[derive(Debug, Clone, Copy)]
pub(super) struct Beginning {
    pub cycle: u32,
    pub block: u32,
    /// `None` where the exposure begins.
    time: Option<Time>,
}

impl Beginning {
    /// That of the block which is running at a time in or before `laser_cycle`.
    fn from_time(
        time: Time,
        laser_cycle: u32,
        stream: &PhotonStream,
        light: &PixelStream<'_>,
    ) -> Self {
        let ends_fs = stream.ends_fs();
        let first = |cycle| stream.cycle_start(cycle) + Time::from_fs(ends_fs.start);
        let mut cycle = laser_cycle;
        while cycle > 0 && time < first(cycle) {
            cycle -= 1;
        }
        let start = stream.cycle_start(cycle);
        // Where slots are short, whole blocks may come before the exposure.
        let block = if time > Time::ZERO {
            light.block_at((time - start).as_fs())
        } else {
            0
        };
        let time = start + Time::from_fs(light.block_fs(block).start);
        Beginning {
            cycle,
            block,
            time: (cycle > 0 || block > 0).then_some(time),
        }
    }

    /// When it is, fs after the start of `laser_cycle`.
    pub(super) fn begins_fs(
        &self,
        stream: &PhotonStream,
        light: &PixelStream<'_>,
        laser_cycle: u32,
    ) -> i64 {
        let start = |cycle| stream.cycle_start(cycle);
        (start(self.cycle) - start(laser_cycle)).as_fs() + light.block_fs(self.block).start
    }
}

impl Counting<'_> {
    /// Counts a macropixel.
    pub(super) fn count_bright(&mut self, pixel: &mut Pixel<'_>) {
        let laser_cycles = self.stream.config().laser_cycles;
        self.listed
            .resize_with(pixel.parts.len(), ListedEchoes::default);
        self.listed.iter_mut().for_each(ListedEchoes::clear);
        pixel.look_back = self.first_look_back(pixel);
        pixel.near = self.parts_near(pixel);
        let layout = self.layout(pixel);
        let alone = layout
            .as_ref()
            .map_or(laser_cycles, |layout| layout.first_cycle);
        for laser_cycle in 0..alone.min(laser_cycles) {
            self.count_bright_cycle(pixel, laser_cycle);
        }
        if let Some(layout) = layout {
            for first in (layout.first_cycle..laser_cycles).step_by(TILE) {
                self.count_tile(pixel, &layout, first);
            }
        }
    }

    /// Parts of the light that may have photons where windows are drawn at first: in fog most echoes are those of its first metres.
    fn parts_near(&self, pixel: &Pixel<'_>) -> SmallVec<[usize; 8]> {
        let all = 0..pixel.parts.len();
        let last_cycle = self.stream.config().laser_cycles.saturating_sub(1);
        let Some(begin) = self.beginning(pixel, last_cycle) else {
            return all.collect();
        };
        let begins_fs = begin.begins_fs(self.stream, pixel.light, last_cycle) - ROUNDING_FS;
        let within_fs = begins_fs..pixel.sight.until_fs + ROUNDING_FS;
        all.filter(|&part| pixel.parts[part].is_lit_within(&within_fs))
            .collect()
    }

    /// Where photons of the window of a laser cycle are drawn from at first; `None` if that is the whole exposure.
    pub(super) fn beginning(&self, pixel: &Pixel<'_>, laser_cycle: u32) -> Option<Beginning> {
        let window = self.window(pixel.sight, laser_cycle);
        let from = window.wanted_from() - pixel.look_back;
        let begin = self.beginning_before(pixel, from, &window);
        begin.time.is_some().then_some(begin)
    }

    /// How long before a window its photons are drawn from at first: two dead times, and more where gaps are rarer. With two
    /// alone, 1600 Mcounts/s took 24 s where 400 took 3.6; with this 17 and 4.0. Where light has several layers, the photons of
    /// each dead time may ask for another number ([`cheaper_look_back`]). Never nothing, which doubling would leave
    /// as it is: without a dead time, it is afterpulses that make the state unknown.
    fn first_look_back(&self, pixel: &Pixel<'_>) -> Time {
        let config = self.stream.config();
        let dead_time = config.spads.dead_time;
        let plain = pixel.parts.iter().filter(|part| !part.has_secondaries());
        // The rate near the window counts; ten dead times before it are near.
        let (first_fs, dead_fs) = (pixel.sight.first_fs, dead_time.as_fs());
        let within_fs = first_fs - 10 * dead_fs..pixel.sight.until_fs;
        let near = plain.clone().map(|part| part.per_dead_time(&within_fs));
        let mut dead_times = 2 + (8.0 * near.sum::<f64>()) as i64;
        if !pixel.light.is_alone {
            let photons = |within_fs: Range<i64>| {
                let photons = plain.clone().map(|part| part.photons_within(&within_fs));
                photons.sum::<f64>()
            };
            let before = |back: i64| first_fs - back * dead_fs..first_fs - (back - 1) * dead_fs;
            let in_window = photons(first_fs..pixel.sight.until_fs);
            let spads = self.stream.spads() as f64;
            let in_dead_time = |back| photons(before(back));
            dead_times = cheaper_look_back(dead_times, in_window, in_dead_time, spads);
        }
        (dead_time * dead_times).max(config.clock.period())
    }

    /// Counts the window of one laser cycle.
    pub(super) fn count_bright_cycle(&mut self, pixel: &mut Pixel<'_>, laser_cycle: u32) {
        let window = self.window(pixel.sight, laser_cycle);
        let (wanted_from, until) = (window.wanted_from(), window.end());
        let mut back = pixel.look_back;
        let near = std::mem::take(&mut pixel.near);
        let drawn = loop {
            let begin = self.beginning_before(pixel, wanted_from - back, &window);
            self.photons.clear();
            let parts = pixel.parts;
            let is_drawn = |part: usize| back > pixel.look_back || near.contains(&part);
            let of_kind = |triggers: bool| {
                (0..parts.len())
                    .filter(move |&n| parts[n].has_secondaries() == triggers && is_drawn(n))
            };
            for part in of_kind(true) {
                self.push_triggering(pixel, part, begin, &window);
            }
            // Mostly there are none, and nothing is allocated.
            let triggering_photons: Vec<_> = self.photons.drain(..).collect();
            for part in of_kind(false) {
                self.push_photons(pixel, part, begin, &window);
            }
            let known_from = begin.time.unwrap_or(Time::ZERO);
            let is_later = |photon: &&Photon| photon.time >= known_from;
            self.photons
                .extend(triggering_photons.iter().filter(is_later));
            let mut echoes = pixel.light.ordered_echoes();
            for cycle in self.echoes(pixel.light, known_from, &window) {
                echoes.add(cycle);
            }
            self.events.clear();
            let are_apart = triggering_photons.is_empty() && echoes.is_empty();
            if are_apart
                && self
                    .rows
                    .sort_in(pixel.light, &self.photons, known_from, until)
            {
                let mut ready = [Time::from_fs(-1); MOST_SPADS];
                let before = begin.time.is_none().then_some(&mut ready[..]);
                let (rows, events) = (&self.rows, &mut self.events);
                let known = rows.append_edges(pixel.light, known_from, before, wanted_from, events);
                if known.is_ok() {
                    break self.photons.len() as u64;
                }
                back = back * 2;
                continue;
            }
            sort_photons(&mut self.photons, known_from, &mut self.keys);
            let earlier = triggering_photons
                .iter()
                .filter(|photon| photon.time < known_from);
            let mut avalanches = pixel.light.avalanches(begin.time, earlier.copied());
            let (photons, events) = (&self.photons, &mut self.events);
            let seen = Some(&mut echoes).filter(|echoes| !echoes.is_empty());
            let known = avalanches.append_edges(photons, seen, until, wanted_from, events);
            if known.is_ok() {
                break self.photons.len() as u64 + echoes.drawn;
            }
            back = back * 2;
        };
        pixel.near = near;
        pixel.work.photons_drawn += drawn;
        let seen = window.count_seen(&self.photons);
        let pulses = self.count_events(pixel, &window);
        pixel.work.lost_to_dead_time += (seen as u64).saturating_sub(pulses);
    }

    /// Laser cycles whose echoes may have photons between a time and the end of a window.
    fn echoes(
        &self,
        light: &PixelStream<'_>,
        from: Time,
        window: &CycleWindow<'_>,
    ) -> impl Iterator<Item = u32> + use<> {
        let within_fs = (from - window.start).as_fs()..window.sight.until_fs;
        let cycles = self.stream.config().laser_cycles;
        let laser_cycle = window.laser_cycle;
        light.echoes_within(&within_fs).filter_map(move |later| {
            let cycle = u32::try_from(i64::from(laser_cycle) + later).ok()?;
            (cycle < cycles).then_some(cycle)
        })
    }

    /// Where photons have to be known from: `from` or before it, and before any ordered echo that is seen.
    fn beginning_before(
        &self,
        pixel: &Pixel<'_>,
        from: Time,
        window: &CycleWindow<'_>,
    ) -> Beginning {
        let echo_from = Time::from_fs(pixel.light.echo_fs().start);
        let mut from = from.max(Time::ZERO);
        loop {
            let begin = Beginning::from_time(from, window.laser_cycle, self.stream, pixel.light);
            let Some(known_from) = begin.time else {
                return begin;
            };
            if !pixel.light.has_ordered_echo() {
                return begin;
            }
            let echoes = self.echoes(pixel.light, known_from, window);
            let first = echoes.map(|cycle| self.stream.cycle_start(cycle) + echo_from);
            match first.min().filter(|&first| first < known_from) {
                Some(first) => from = first.max(Time::ZERO),
                None => return begin,
            }
        }
    }

    /// Appends the photons of a part of the light that trigger others since a beginning, and before it as far as what they cause may come later.
    fn push_triggering(
        &mut self,
        pixel: &Pixel<'_>,
        part: usize,
        begin: Beginning,
        window: &CycleWindow<'_>,
    ) {
        let since = begin.time.map_or(begin, |time| {
            let time = time - self.stream.config().spads.reach();
            Beginning::from_time(time, window.laser_cycle, self.stream, &pixel.parts[part])
        });
        self.push_photons(pixel, part, since, window);
    }

    /// Appends the photons of a part of the light since a beginning.
    fn push_photons(
        &mut self,
        pixel: &Pixel<'_>,
        part: usize,
        begin: Beginning,
        window: &CycleWindow<'_>,
    ) {
        let light = &pixel.parts[part];
        let (laser_cycles, until) = (self.stream.config().laser_cycles, window.end());
        // Of light that changes from laser cycle to laser cycle most layers are dark.
        if light.has_background_in(&(begin.cycle..window.laser_cycle + 2)) {
            let (mut cycle, mut block) = (begin.cycle, begin.block);
            let begins = |cycle, block| {
                self.stream.cycle_start(cycle) + Time::from_fs(light.block_fs(block).start)
            };
            while cycle < laser_cycles && begins(cycle, block) < until {
                let until_fs = (until - self.stream.cycle_start(cycle)).as_fs();
                light.push_block(cycle, block, until_fs, &mut self.photons);
                block += 1;
                if block == light.blocks() {
                    (cycle, block) = (cycle + 1, 0);
                }
            }
        }
        let from = begin.time.unwrap_or(Time::ZERO);
        // Photons that trigger others are asked for before `from`, too.
        let is_wanted = |photon: &&Photon| {
            (light.has_secondaries() || photon.time >= from) && photon.time < until
        };
        for cycle in self.echoes(light, from, window) {
            let echo = self.listed[part].photons(light, cycle).iter();
            self.photons.extend(echo.filter(is_wanted));
        }
    }
}
