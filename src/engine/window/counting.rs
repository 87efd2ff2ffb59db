//! Counting a macropixel's photons, a group of laser cycles at a time.
//!
//! ```text
//!   photon ──► counts by row (bin)                             ──► hits
//!         └──► SPADs and rows by cycle ── one of them twice? ──► history: the cycle's photons, dead time
//! ```
//!
//! Nearly every photon is alone in its cycle with its SPAD, from the SPADs' memory before the window to its end, and with
//! its bin: it makes a pulse, and its CLK period has one. Where two photons of a cycle share a SPAD or a bin, or one comes
//! too close to an edge, photons are taken out again, and what the dead time leaves of them is counted bin by bin. The
//! times of photons are worked out only there.
//!
//! Where secondaries tie SPADs together, or photons are many, cycles are sorted and go through [`SpadModel::detect`]
//! one by one ([`Counting::count_sorted`]).
//!
//! [`SpadModel::detect`]: crate::photon::SpadModel::detect

use super::binning::{Binning, Scratch, Wanted};
use super::codes::{Code, Codes, ROWS};
use super::echo::EchoRows;
use super::history::{Photon, certain_from, split};
use super::sight::{ROUNDING_FS, Sight};
use super::tables::{MOST_PHOTONS, SIDE_BY_SIDE, Spacing, Tables};
use super::{Window, Work, taken};
use crate::photon::{
    Draw, Group, PER_BLOCK, PhotonStream, PixelStream, Place, SPADS, SpadEvent, Span,
};
use crate::units::Time;

mod settling;

/// Counts macropixels; keeps its tables from one to the next.
pub struct Counting<'a> {
    engine: &'a Window<'a>,
    stream: &'a PhotonStream,
    binning: Binning,
    /// What a CLK period with so many SPADs adds to its bin.
    adds: [i64; SPADS + 1],
    spacing: Spacing,
    /// Photons of the windows' own cycles.
    own: Draw,
    /// Photons of the group's cycles for the windows of the next cycles.
    previous: Draw,
    /// Photons of the last cycle of the group before, for the window of the first cycle; all in cycle 0.
    carried: Vec<(Place, i64)>,
    extra: Draw,
    /// Codes of all photons drawn for the group. Photons are known by their index here.
    codes: Codes,
    scratch: Scratch,
    /// Where the codes of `previous` and `carried` begin.
    first_code: [usize; 2],
    tables: Tables,
    /// Photons of one cycle: index, row and SPAD.
    together: Vec<(usize, Code)>,
    /// SPADs that fired by row, in one cycle.
    fired: [u8; ROWS],
    photons: Vec<Photon>,
    /// Photons by cycle, for those that are sorted.
    sorted: Vec<(u32, Photon)>,
    events: Vec<SpadEvent>,
}

/// One macropixel.
struct Pixel<'p> {
    sight: &'p Sight,
    light: &'p PixelStream<'p>,
    /// Photons of `own` and `previous`.
    wanted: [Wanted; 2],
    echo: [Option<EchoRows>; 2],
    hits: Vec<i64>,
    work: Work,
}

impl<'a> Counting<'a> {
    /// For macropixels of `engine` in the light of `stream`.
    pub fn new(engine: &'a Window<'a>, stream: &'a PhotonStream) -> Self {
        let bins = engine.config.bins;
        let memory_s = stream.config().spads.memory().as_s();
        let memory_rows = (memory_s * engine.exposure.clock.as_hz()) as usize;
        Counting {
            engine,
            stream,
            binning: Binning::new(bins, engine.exposure.clock.as_hz(), stream.slots()),
            spacing: Spacing {
                bins,
                far: memory_rows + 2,
                blind: memory_rows,
            },
            adds: std::array::from_fn(|spads| engine.adds(((1u32 << spads) - 1) as u16)),
            own: Draw::default(),
            previous: Draw::default(),
            carried: Vec::new(),
            extra: Draw::default(),
            codes: Codes::default(),
            scratch: Scratch::default(),
            first_code: [0; 2],
            tables: Tables::default(),
            together: Vec::new(),
            fired: [0; ROWS],
            photons: Vec::new(),
            sorted: Vec::new(),
            events: Vec::new(),
        }
    }

    /// Hits of every bin of a macropixel, and what they took.
    pub fn expose(&mut self, sight: &Sight, light: &PixelStream<'_>) -> (Vec<i64>, Work) {
        let origins_fs = [sight.first_fs, sight.first_fs + self.stream.cycle_fs()];
        let origin_slots = origins_fs.map(|origin_fs| self.binning.slot_of(origin_fs));
        let has_slots_for_bins = origin_slots.iter().all(Option::is_some);
        let wanted = [0, 1].map(|later| Wanted {
            cycles: 0,
            later,
            origin_fs: origins_fs[later as usize],
            origin_slot: origin_slots[later as usize].unwrap_or(0),
        });
        let echo = |span: &Span, origin_fs| {
            let (bins, clk_hz) = (self.engine.config.bins, self.engine.exposure.clock.as_hz());
            let within_fs = span.within_fs.clone();
            (!within_fs.is_empty())
                .then(|| EchoRows::new(light, bins, 1e15 / clk_hz, origin_fs, within_fs))
                .flatten()
        };
        let mut pixel = Pixel {
            sight,
            light,
            wanted,
            echo: [
                echo(&sight.own, origins_fs[0]),
                echo(&sight.previous, origins_fs[1]),
            ],
            hits: self.engine.dark_hits(sight.first_edge),
            work: Work::default(),
        };
        self.carried.clear();
        self.tables.clear_counts();
        for group in self.stream.groups() {
            let cycles = group.cycles_in(self.stream.config().laser_cycles);
            light.draw(group, &sight.own, &mut self.own);
            light.draw(group, &sight.previous, &mut self.previous);
            pixel.work.photons_drawn += (self.own.len() + self.previous.len()) as u64;
            // Photons that come before the exposure are left out there.
            let is_first = group.first_cycle() == 0 && sight.sees_the_beginning();
            if has_slots_for_bins && !is_first && !self.stream.config().spads.has_secondaries() {
                self.encode(&mut pixel, cycles);
                if self.codes.len() <= MOST_PHOTONS {
                    self.count_cells(&mut pixel, group);
                } else {
                    self.count_sorted(&mut pixel, group, cycles);
                }
            } else {
                self.count_sorted(&mut pixel, group, cycles);
            }
            self.carry(light, group);
        }
        for (row, hits) in (1..).zip(&mut pixel.hits) {
            let photons = u64::from(self.tables.count(row));
            let pairs = u64::from(self.tables.pairs(row));
            *hits += self.adds[1] * photons as i64 + self.adds[2] * pairs as i64;
            pixel.work.clk_periods_visited += photons + pairs;
            pixel.work.pulses += photons + 2 * pairs;
        }
        (pixel.hits, pixel.work)
    }

    /// Encodes all photons that the windows of a group may see.
    fn encode(&mut self, pixel: &mut Pixel<'_>, cycles: u32) {
        self.codes.clear();
        let [own, previous] = &mut pixel.wanted;
        own.cycles = cycles;
        previous.cycles = cycles - 1;
        let draws = [&self.own, &self.previous];
        for (part, draw) in draws.into_iter().enumerate() {
            let (wanted, echo) = (&pixel.wanted[part], pixel.echo[part].as_ref());
            let scratch = &mut self.scratch;
            self.binning
                .encode(pixel.light, draw, wanted, echo, scratch, &mut self.codes);
            self.first_code[part] = self.codes.len();
        }
        let wanted = Wanted {
            cycles: 1,
            later: 0,
            ..pixel.wanted[1]
        };
        for &photon in &self.carried {
            self.binning.push(&wanted, Some(photon), &mut self.codes);
        }
        self.codes.fill_up(SIDE_BY_SIDE);
    }

    /// Keeps what the first window of the next group may see.
    fn carry(&mut self, light: &PixelStream<'_>, group: Group) {
        self.carried.clear();
        if self.previous.is_empty() {
            return;
        }
        let photons = self.previous.photons(light).filter_map(|(place, time_fs)| {
            let (cycle, spad) = split(place);
            (cycle + 1 == group.cycles()).then_some((Place::from(spad), time_fs))
        });
        self.carried.extend(photons);
    }

    fn count_cells(&mut self, pixel: &mut Pixel<'_>, group: Group) {
        let own = &pixel.wanted[0];
        // Where all background photons of the cycles are wanted, their slots tell how many there are in each bin.
        let mut counted = 0;
        if own.cycles == group.cycles() {
            counted = self.own.words()[0].len() * PER_BLOCK;
            for run in self.own.runs() {
                let row = self.binning.row_of(own, run.slot);
                self.tables.add(row, run.photons);
            }
        }
        self.tables
            .put(&self.codes, group.cycles() as usize, counted);
        pixel.work.lost_to_dead_time += self.tables.settle_by_rows(&self.codes, &self.spacing);
        let mut index = 0;
        while let Some(special) = self.tables.special(index, &self.codes) {
            self.settle(pixel, special, group);
            index += 1;
        }
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
    fn time_of(&self, light: &PixelStream<'_>, photon: usize, laser_cycle: u32) -> Time {
        let time_fs = if photon < self.first_code[0] {
            return Time::from_fs(in_draw(light, &self.own, photon));
        } else if photon < self.first_code[1] {
            in_draw(light, &self.previous, photon - self.first_code[0])
        } else {
            self.carried[photon - self.first_code[1]].1
        };
        Time::from_fs(time_fs) - self.before(laser_cycle)
    }

    /// Whether a photon, perhaps of the echo, is one of the drawn slots.
    fn is_drawn(&self, light: &PixelStream<'_>, photon: usize) -> bool {
        let (draw, at) = match photon {
            _ if photon < self.first_code[0] => (&self.own, photon),
            _ if photon < self.first_code[1] => (&self.previous, photon - self.first_code[0]),
            _ => return true,
        };
        draw.within_fs().contains(&in_draw(light, draw, at))
    }

    /// The window of a laser cycle.
    fn window<'w>(&self, sight: &'w Sight, laser_cycle: u32) -> Placed<'w>
    where
        'a: 'w,
    {
        Placed {
            engine: self.engine,
            binning: self.binning,
            sight,
            laser_cycle,
        }
    }

    /// How long before a laser cycle the one before it starts.
    fn before(&self, laser_cycle: u32) -> Time {
        let start = |cycle| self.stream.config().cycle_start(cycle);
        start(laser_cycle) - start(laser_cycle - 1)
    }

    /// Counts cycle by cycle what all SPADs make of the photons together.
    fn count_sorted(&mut self, pixel: &mut Pixel<'_>, group: Group, cycles: u32) {
        let mut sorted = std::mem::take(&mut self.sorted);
        sorted.clear();
        let own = self.own.photons(pixel.light).map(|(place, time_fs)| {
            let (cycle, spad) = split(place);
            (cycle, (Time::from_fs(time_fs), spad))
        });
        sorted.extend(own.filter(|&(cycle, _)| cycle < cycles));
        let earlier = |cycle: u32, time_fs: i64| {
            Time::from_fs(time_fs) - self.before(group.first_cycle() + cycle)
        };
        let previous = self
            .previous
            .photons(pixel.light)
            .filter_map(|(place, time_fs)| {
                let (cycle, spad) = split(place);
                let cycle = Some(cycle + 1).filter(|&cycle| cycle < cycles)?;
                Some((cycle, (earlier(cycle, time_fs), spad)))
            });
        sorted.extend(previous);
        let carried = self.carried.iter();
        sorted.extend(carried.map(|&(spad, time_fs)| (0, (earlier(0, time_fs), spad as u8))));
        sorted.sort_unstable();
        for photons in sorted.chunk_by(|a, b| a.0 == b.0) {
            let laser_cycle = group.first_cycle() + photons[0].0;
            let window = self.window(pixel.sight, laser_cycle);
            self.photons.clear();
            self.photons
                .extend(photons.iter().map(|&(_, photon)| photon));
            let alive = self.photons.iter();
            let seen = alive
                .filter(|(time, _)| window.row_of(*time).is_some())
                .count() as u64;
            self.detect(pixel, laser_cycle, u16::MAX);
            let row_of = |event: &SpadEvent| window.row_of(event.time).unwrap_or(0) as i64;
            let mut alone = 0;
            for (row, spads) in taken(&self.events, row_of).filter(|(row, _)| *row > 0) {
                alone += u64::from(spads.count_ones());
                pixel.hits[row as usize - 1] += self.engine.adds(spads);
                pixel.work.clk_periods_visited += 1;
            }
            let pulses = self.events.iter().filter(|event| row_of(event) > 0).count() as u64;
            pixel.work.pulses += pulses;
            pixel.work.cancelled += pulses - alone;
            pixel.work.lost_to_dead_time += seen.saturating_sub(pulses);
        }
        self.sorted = sorted;
    }
}

/// When the photon of the `at`-th code of a draw came after the start of its cycle, fs.
fn in_draw(light: &PixelStream<'_>, draw: &Draw, at: usize) -> i64 {
    let blocks = draw.slots().len();
    match at.checked_sub(PER_BLOCK * blocks) {
        Some(signal) => light.signal_photon(draw, signal).1,
        None => {
            let row = (1..PER_BLOCK).filter(|row| at >= row * blocks).count();
            let block = at - row * blocks;
            let word = draw.words()[row][block];
            light.slots().time_fs(draw.slots()[block], word)
        }
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
        let code = self.binning.encode_one(time.as_fs() - self.sight.first_fs);
        let bins = self.engine.config.bins;
        if !code.is_doubtful() {
            return Some(code.row()).filter(|row| (1..=bins).contains(row));
        }
        let exposure = self.engine.exposure;
        let cycle = i64::from(self.laser_cycle);
        let edge = self.engine.law.edge_of(exposure.stop(cycle) + time);
        let first_edge = self.sight.first_edge + cycle * i64::from(exposure.stop_periods);
        let bin = usize::try_from(edge - first_edge).ok()?;
        (bin < bins).then_some(bin + 1)
    }
}
