//! Settling all SPADs of a laser cycle together: where avalanches cause others, where photons are many, where echoes of other
//! cycles are seen, and where photons drawn with their cycle do not tell what becomes of them.
//!
//! Of light whose avalanches cause others only laser cycles near such an avalanche are settled so. With all of them the street with 1 % of
//! afterpulses and of crosstalk would take 1.3 times as long.

use smallvec::SmallVec;

use super::{Counting, CycleWindow, Pixel};
use crate::chip::Tdc;
use crate::engine::window::past::Past;
use crate::engine::window::sight::{ROUNDING_FS, Spans};
use crate::photon::{CycleGroup, Draw, Photon, PhotonStream, PixelStream, Span};
use crate::units::Time;

impl Counting<'_> {
    /// Counts a group cycle by cycle.
    pub(super) fn count_whole(&mut self, pixel: &mut Pixel<'_>, group: CycleGroup, cycles: u32) {
        let mut by_cycle = std::mem::take(&mut self.by_cycle);
        by_cycle.clear();
        by_cycle.extend(self.plain.photons(pixel.light, self.stream, group, cycles));
        self.other_echoes(pixel, pixel.light, group, &mut by_cycle);
        if let Some(triggering) = pixel.triggering {
            let photons = self.triggering.of_group(group).iter();
            by_cycle.extend(photons.map(|&(cycle, photon)| (cycle - group.first_cycle(), photon)));
            self.other_echoes(pixel, triggering, group, &mut by_cycle);
        }
        self.settle_cycles(pixel, group, &mut by_cycle);
        self.by_cycle = by_cycle;
    }

    /// Counts a macropixel in light of several layers, cycle by cycle.
    pub(super) fn count_layers(&mut self, pixel: &mut Pixel<'_>) {
        let mut layers = std::mem::take(&mut self.layers);
        layers.resize_with(layers.len().max(pixel.parts.len()), ByWindow::default);
        layers.iter_mut().for_each(ByWindow::clear);
        let mut by_cycle = std::mem::take(&mut self.by_cycle);
        for group in self.stream.groups() {
            by_cycle.clear();
            for (layer, part) in layers.iter_mut().zip(pixel.parts) {
                let (first, spans) = (group.first_cycle(), pixel.spans(part));
                pixel.work.photons_drawn += layer.draw(part, self.stream, first, spans);
                let photons = layer.of_group(group).iter();
                by_cycle.extend(photons.map(|&(cycle, photon)| (cycle - first, photon)));
                self.other_echoes(pixel, part, group, &mut by_cycle);
            }
            self.settle_cycles(pixel, group, &mut by_cycle);
        }
        self.by_cycle = by_cycle;
        self.layers = layers;
    }

    /// Counts the windows of a group with these photons, by cycle of the group, in any order.
    fn settle_cycles(
        &mut self,
        pixel: &mut Pixel<'_>,
        group: CycleGroup,
        by_cycle: &mut Vec<(u32, Photon)>,
    ) {
        by_cycle.retain(|(_, photon)| photon.time >= Time::ZERO);
        by_cycle.sort_unstable_by_key(|&(cycle, _)| cycle);
        for photons in by_cycle.chunk_by(|a, b| a.0 == b.0) {
            self.photons.clear();
            self.photons
                .extend(photons.iter().map(|&(_, photon)| photon));
            self.settle_cycle(pixel, group.first_cycle() + photons[0].0);
        }
    }

    /// Appends photons of other cycles' echoes that the windows of a group may see.
    pub(super) fn other_echoes(
        &self,
        pixel: &Pixel<'_>,
        light: &PixelStream<'_>,
        group: CycleGroup,
        by_cycle: &mut Vec<(u32, Photon)>,
    ) {
        let config = self.stream.config();
        let from_fs = pixel.spans(light).own.within_fs.start;
        let until_fs = pixel.sight.until_fs;
        let cycles = group.cycles_in(config.laser_cycles);
        let mut draw = Draw::default();
        for later in light.echoes_within(&(from_fs..until_fs)) {
            if later == 0 {
                continue;
            }
            // The window's time in that of the echo's cycle, with room for rounding.
            let moved_fs = later * self.stream.cycle_fs();
            let room_fs = ROUNDING_FS + later.abs();
            let span = Span {
                slots: 0..0,
                within_fs: from_fs - moved_fs - room_fs..until_fs - moved_fs + room_fs,
            };
            let of_windows =
                i64::from(group.first_cycle())..i64::from(group.first_cycle() + cycles);
            let mut next = (of_windows.start + later).max(0);
            let end = (of_windows.end + later).min(i64::from(config.laser_cycles));
            while next < end {
                let other = light.group_of(next as u32);
                light.draw(other, &span, &mut draw);
                for (place, time_fs) in draw.photons(light, other.cycles()) {
                    let (cycle, spad) = other.split(place);
                    let cycle = other.first_cycle() + cycle;
                    let window = i64::from(cycle) - later;
                    if cycle < config.laser_cycles && of_windows.contains(&window) {
                        let photon = Photon::new(
                            self.stream.cycle_start(cycle) + Time::from_fs(time_fs),
                            spad,
                            light.has_secondaries(),
                        );
                        by_cycle.push(((window - of_windows.start) as u32, photon));
                    }
                }
                next = i64::from(other.first_cycle()) + i64::from(other.cycles());
            }
        }
    }

    /// Settles the cycles in which an avalanche that triggers others may matter. Their photons are in no table afterwards.
    pub(super) fn count_triggering_cycles(&mut self, pixel: &mut Pixel<'_>, group: CycleGroup) {
        let Some(light) = pixel.triggering else {
            return;
        };
        let triggering = std::mem::take(&mut self.triggering);
        for photons in triggering.of_group(group).chunk_by(|a, b| a.0 == b.0) {
            let laser_cycle = photons[0].0;
            let start = self.stream.cycle_start(laser_cycle);
            let from = start + Time::from_fs(pixel.sight.plain.from_fs);
            let until = start + Time::from_fs(pixel.sight.until_fs);
            let is_seen = |time: Time| time >= from && time < until;
            let matters = |photon: &Photon| {
                is_seen(photon.time) || light.children(*photon).any(|child| is_seen(child.time))
            };
            if !photons.iter().any(|(_, photon)| matters(photon)) {
                continue;
            }
            self.photons.clear();
            self.photons
                .extend(photons.iter().map(|&(_, photon)| photon));
            let cycle = laser_cycle - group.first_cycle();
            let last = self.tables.take_last(cycle as usize);
            self.take_cycle(pixel, last, laser_cycle);
            self.settle_cycle(pixel, laser_cycle);
        }
        self.triggering = triggering;
    }

    /// Takes the `last` photon of a cycle and those before it out of the tables, and appends them to `photons`.
    pub(super) fn take_cycle(&mut self, pixel: &Pixel<'_>, last: Option<usize>, laser_cycle: u32) {
        let start = self.stream.cycle_start(laser_cycle);
        let mut next = last;
        while let Some(photon) = next {
            let code = self.codes.codes()[photon];
            self.tables.remove(code.row());
            if self.is_drawn(pixel.light, photon) {
                let time = start + self.time_of(pixel.light, photon, laser_cycle);
                self.photons.push(Photon::new(time, code.spad(), false));
            }
            next = self.tables.previous_photon(photon);
        }
    }

    /// Counts the window of a laser cycle with `photons`, in any order.
    pub(super) fn settle_cycle(&mut self, pixel: &mut Pixel<'_>, laser_cycle: u32) {
        let window = self.window(pixel.sight, laser_cycle);
        let is_seen = |photon: &&Photon| window.is_seen(photon.time);
        let seen = self.photons.iter().filter(is_seen).count() as u64;
        self.detect(pixel, &window, u64::MAX);
        let pulses = self.count_events(pixel, &window);
        pixel.work.lost_to_dead_time += seen.saturating_sub(pulses);
    }

    /// Counts the `events` of one laser cycle. Returns how many are in its window.
    pub(super) fn count_events(&mut self, pixel: &mut Pixel<'_>, window: &CycleWindow<'_>) -> u64 {
        self.placed.clear();
        self.placed.extend(self.events.iter().map(|event| {
            let row = window.row_of(event.time).unwrap_or(0);
            (*event, row)
        }));
        let pulses = self.placed.iter().filter(|(_, row)| *row > 0).count() as u64;
        if pulses == 0 {
            return 0;
        }
        pixel.work.pulses += pulses;
        let is_line = self.engine.sensor.tdc == Tdc::DelayLine;
        if is_line {
            self.engine
                .keep_line_edges(&mut self.placed, |(event, _)| *event);
        }
        for &(event, row) in &self.placed {
            self.odd[row] ^= 1 << event.spad;
        }
        self.odd[0] = 0;
        let mut left = 0;
        for (hits, spads) in pixel.hits.iter_mut().zip(&mut self.odd[1..]) {
            let spads = std::mem::take(spads).count_ones();
            let adds = self.adds[spads as usize];
            *hits += adds;
            left += if is_line {
                adds as u64
            } else {
                u64::from(spads)
            };
            pixel.work.clk_periods_visited += u64::from(spads > 0 && !is_line);
        }
        pixel.work.cancelled += pulses - left;
        pulses
    }

    /// Turns `photons` of the SPADs of a set, in any order, and those before them as far as it takes, into `events`: all
    /// rising edges in the window of a laser cycle, and perhaps some before.
    pub(super) fn detect(&mut self, pixel: &mut Pixel<'_>, window: &CycleWindow<'_>, spads: u64) {
        let (wanted_from, until) = (window.wanted_from(), window.end());
        let past = |part| pixel.spans(part).past(self.stream, window.laser_cycle);
        let mut pasts: SmallVec<[Past<'_>; 2]> = pixel.parts.iter().map(past).collect();
        loop {
            // Photons that trigger others are known from earlier on.
            let known_from = pasts[0].known_from();
            self.photons.sort_unstable();
            let earlier =
                known_from.map_or(0, |from| self.photons.partition_point(|p| p.time < from));
            let later = self.photons.partition_point(|p| p.time < until);
            let triggering = self.photons[..earlier]
                .iter()
                .filter(|photon| photon.triggers);
            let mut avalanches = pixel.light.avalanches(known_from, triggering.copied());
            self.events.clear();
            let photons = &self.photons[earlier..later.max(earlier)];
            let known =
                avalanches.append_edges(photons, None, until, wanted_from, &mut self.events);
            if known.is_ok() {
                return;
            }
            let (draws, photons) = (&mut self.past, &mut self.photons);
            for (part, past) in pasts.iter_mut().enumerate() {
                let drawn = past.extend(pixel.parts, part, spads, draws, photons);
                pixel.work.photons_drawn += drawn;
            }
        }
    }
}

// Photons of one part of the light, kept by the laser cycle of their window: those that trigger others, which are few and drawn for
// many laser cycles at once, and all of light with several layers.
//
// ```text
//   groups of other photons    ├──┼──┼─────┼───────────┼─── … ──┤
//   groups of these            ├───────────────────────── … ──┤     (longer where they are rare)
// ```

/// Photons of one part of a macropixel's light.
#[derive(Debug, Default)]
pub(super) struct ByWindow {
    own: Draw,
    previous: Draw,
    /// Laser cycle of the window that a photon is drawn for, and the photon; by laser cycle.
    photons: Vec<(u32, Photon)>,
    /// Laser cycles drawn so far.
    until: u32,
}

impl ByWindow {
    /// Forgets all photons.
    pub(super) fn clear(&mut self) {
        self.photons.clear();
        self.until = 0;
    }

    /// Draws what the windows from laser cycle `first` on see, if that has not been done. Returns how many photons were
    /// drawn.
    pub(super) fn draw(
        &mut self,
        light: &PixelStream<'_>,
        stream: &PhotonStream,
        first: u32,
        spans: &Spans,
    ) -> u64 {
        if first < self.until {
            return 0;
        }
        let group = light.group_of(first);
        light.draw(group, &spans.own, &mut self.own);
        light.draw(group, &spans.previous, &mut self.previous);
        self.until = group.first_cycle().saturating_add(group.cycles());
        // Only what the windows of the group before left for this one.
        self.photons.retain(|&(window, _)| window >= first);
        for (draw, later) in [(&self.own, 0), (&self.previous, 1)] {
            let cycles = group.cycles_in(stream.config().laser_cycles.saturating_sub(later));
            for (place, time_fs) in draw.photons(light, cycles) {
                let (cycle, spad) = group.split(place);
                let cycle = group.first_cycle() + cycle;
                let photon = Photon::new(
                    stream.cycle_start(cycle) + Time::from_fs(time_fs),
                    spad,
                    light.has_secondaries(),
                );
                self.photons.push((cycle + later, photon));
            }
        }
        self.photons.sort_unstable_by_key(|&(window, _)| window);
        (self.own.len() + self.previous.len()) as u64
    }

    /// Photons for the windows of these laser cycles.
    pub(super) fn photons(&self, windows: std::ops::Range<u32>) -> &[(u32, Photon)] {
        let before = |cycle| self.photons.partition_point(|&(window, _)| window < cycle);
        &self.photons[before(windows.start)..before(windows.end)]
    }

    /// Photons for the windows of a group.
    pub(super) fn of_group(&self, group: CycleGroup) -> &[(u32, Photon)] {
        self.photons(group.first_cycle()..group.first_cycle().saturating_add(group.cycles()))
    }
}
