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
//! That is for little light of one layer. Other dim light goes into a table of bits, where dead time is decided for many laser
//! cycles at once ([`tabled`]). Where photons decide about each other that are not on one SPAD, laser cycles are settled as a whole
//! ([`whole`]). Bright light is counted many laser cycles side by side ([`side_by_side`]), or one after the other ([`bright`]).

use smallvec::SmallVec;

use super::binning::{Binning, Scratch};
use super::codes::{Code, Codes, ROWS, SPADS};
use super::echo_rows::EchoRows;
use super::past::PastDraws;
use super::photon_selection::PhotonSelection;
use super::pulses::Window;
use super::sight::{ROUNDING_FS, Sight, Spans};
use super::table;
use super::tables::{MOST_PHOTONS, SIDE_BY_SIDE, Tables};
use crate::engine::EngineWork;
use crate::photon::{
    CycleGroup, DeadTimeLaw, Draw, GroupPlace, ListedEchoes, PER_BLOCK, Photon, PhotonStream,
    PixelStream, SpadEvent, SpadRows,
};
use crate::units::Time;
use cycle_window::CycleWindow;
use spacing::Spacing;
use tile::Tile;
use whole::ByWindow;

mod bright;
mod cycle_window;
mod settling;
mod side_by_side;
mod spacing;
mod tabled;
mod tile;
mod whole;

/// Counts macropixels; keeps its tables from one to the next.
pub(super) struct Counting<'a> {
    engine: &'a Window,
    stream: &'a PhotonStream,
    binning: Binning,
    /// What a CLK period adds to its bin, by the number of SPADs that fired.
    adds: Vec<i64>,
    spacing: Spacing,
    plain: GroupDraws,
    triggering: ByWindow,
    /// Photons of parts of the light that are kept by window.
    layers: Vec<ByWindow>,
    past: PastDraws,
    /// Codes of all photons drawn for the group that cause no others. Photons are known by their index here.
    codes: Codes,
    scratch: Scratch,
    /// Where the codes of `plain.previous` and `plain.carried` begin.
    first_code: [usize; 2],
    tables: Tables,
    /// Photons of one cycle: index, row and SPAD.
    together: Vec<(usize, Code)>,
    /// SPADs that fired by row, in one cycle.
    fired: [u8; ROWS],
    /// When pulses on its photon line come, fs after the start of the window's cycle.
    pulses_fs: Vec<i64>,
    /// Photons of one cycle's window.
    photons: Vec<Photon>,
    /// The same as words that sort by time.
    keys: Vec<u64>,
    /// Photons by cycle of the group, where whole cycles are settled.
    by_cycle: Vec<(u32, Photon)>,
    events: Vec<SpadEvent>,
    /// The same with their bin + 1; 0 outside the window.
    placed: Vec<(SpadEvent, usize)>,
    /// SPADs with an odd number of events by row, in one cycle.
    odd: Vec<u64>,
    /// Of each part of bright light.
    listed: Vec<ListedEchoes>,
    /// Photons of one cycle of bright light, by SPAD and time.
    rows: SpadRows,
    /// Laser cycles side by side, in bright light.
    tile: Option<Box<Tile>>,
}

/// What was drawn of a group.
#[derive(Debug, Default)]
struct GroupDraws {
    /// Photons of the windows' own cycles.
    own: Draw,
    /// Photons of the group's cycles for the windows of the next cycles.
    previous: Draw,
    /// Photons of the last cycle of the group before, for the window of the first cycle; all in cycle 0.
    carried: Vec<(GroupPlace, i64)>,
}

impl GroupDraws {
    fn draw(&mut self, light: &PixelStream<'_>, group: CycleGroup, spans: &Spans) -> u64 {
        light.draw(group, &spans.own, &mut self.own);
        light.draw(group, &spans.previous, &mut self.previous);
        (self.own.len() + self.previous.len()) as u64
    }

    /// Keeps what the first window of the next group may see.
    fn carry(&mut self, light: &PixelStream<'_>, group: CycleGroup) {
        self.carried.clear();
        if self.previous.is_empty() {
            return;
        }
        let photons =
            self.previous
                .photons(light, group.cycles())
                .filter_map(|(place, time_fs)| {
                    let (cycle, spad) = group.split(place);
                    (cycle + 1 == group.cycles()).then_some((GroupPlace::from(spad), time_fs))
                });
        self.carried.extend(photons);
    }

    /// All photons by the cycle of the group whose window they are drawn for, the first `cycles` of them.
    fn photons<'d>(
        &'d self,
        light: &'d PixelStream<'d>,
        stream: &'d PhotonStream,
        group: CycleGroup,
        cycles: u32,
    ) -> impl Iterator<Item = (u32, Photon)> + 'd {
        let first = group.first_cycle();
        let photon = move |cycle: u32, spad: u8, time_fs: i64| {
            Photon::new(
                stream.cycle_start(cycle) + Time::from_fs(time_fs),
                spad,
                light.has_secondaries(),
            )
        };
        let own = self
            .own
            .photons(light, cycles)
            .map(move |(place, time_fs)| {
                let (cycle, spad) = group.split(place);
                (cycle, photon(first + cycle, spad, time_fs))
            });
        let previous = self.previous.photons(light, cycles.saturating_sub(1));
        let previous = previous.map(move |(place, time_fs)| {
            let (cycle, spad) = group.split(place);
            (cycle + 1, photon(first + cycle, spad, time_fs))
        });
        let carried = self.carried.iter();
        let carried =
            carried.map(move |&(spad, time_fs)| (0, photon(first - 1, spad as u8, time_fs)));
        own.chain(previous).chain(carried)
    }
}

/// Photons of a laser cycle, on average, up to which each is counted on its own. In ns for a laser cycle, so and in a table of bits:
/// 8 Mcounts/s and 0.1 signal photons 4.4 and 11, 26 and 0.1 15 and 20, 26 and 1 39 and 33, 26 and 7.9 464 and 92 (0.5, 1.5, 2.4
/// and 9.3 photons).
const LITTLE: f64 = 2.0;

/// The same with afterpulses or crosstalk: 26 Mcounts/s and 1 signal photon 83 and 91, 26 and 3 218 and 159 (2.7 and 4.7 photons).
const LITTLE_WITH_SECONDARIES: f64 = 3.0;

/// Which part of a light of one layer causes other avalanches, if one does.
const TRIGGERING: usize = 1;

/// One macropixel.
struct Pixel<'p> {
    sight: &'p Sight,
    /// All parts of the light.
    parts: &'p [PixelStream<'p>],
    /// The first of them, which causes no other avalanches.
    light: &'p PixelStream<'p>,
    /// The photons that do, where there is but one layer.
    triggering: Option<&'p PixelStream<'p>>,
    /// Photons of `plain.own` and `plain.previous`.
    wanted: [PhotonSelection; 2],
    echo: Option<EchoRows>,
    hits: Vec<i64>,
    work: EngineWork,
    /// In bright light: how long before a window its photons are drawn from at first.
    look_back: Time,
    /// And the parts of the light that may have photons there.
    near: SmallVec<[usize; 8]>,
}

impl<'a> Counting<'a> {
    /// For macropixels of `engine` in the light of `stream`.
    pub(super) fn new(engine: &'a Window, stream: &'a PhotonStream) -> Self {
        let bins = engine.sensor.bins;
        let dead_s = stream.config().spads.dead_time.as_s();
        let dead_rows = (dead_s * engine.exposure.clock.as_hz()) as usize;
        let adds = |spads: usize| engine.adds(((1u128 << spads) - 1) as u64);
        Counting {
            engine,
            stream,
            binning: Binning::new(bins, engine.exposure.clock.as_hz(), stream.slots),
            spacing: Spacing {
                bins,
                far: dead_rows + 2,
                blind: dead_rows,
            },
            adds: (0..=stream.spads()).map(adds).collect(),
            plain: GroupDraws::default(),
            triggering: ByWindow::default(),
            layers: Vec::new(),
            past: PastDraws::default(),
            codes: Codes::default(),
            scratch: Scratch::default(),
            first_code: [0; 2],
            tables: Tables::from_pool(),
            together: Vec::new(),
            fired: [0; ROWS],
            pulses_fs: Vec::new(),
            photons: Vec::new(),
            keys: Vec::new(),
            by_cycle: Vec::new(),
            events: Vec::new(),
            placed: Vec::new(),
            odd: vec![0; bins + 1],
            listed: Vec::new(),
            rows: SpadRows::default(),
            tile: None,
        }
    }

    /// Keeps its tables for who counts next on this thread.
    pub(super) fn finish(self) {
        self.tables.keep();
    }

    /// Hits of every bin of a macropixel, and what they took. `parts` are those of its light ([`PhotonStream::parts`]).
    pub(super) fn expose(
        &mut self,
        sight: &Sight,
        parts: &[PixelStream<'_>],
    ) -> (Vec<i64>, EngineWork) {
        let light = &parts[0];
        let triggering = parts.get(TRIGGERING).filter(|_| light.is_alone);
        let origins_fs = [sight.first_fs, sight.first_fs + self.stream.cycle_fs()];
        let origin_slots = origins_fs.map(|origin_fs| self.binning.slot_of(origin_fs));
        let has_slots_for_bins = origin_slots.iter().all(Option::is_some);
        let has_marks = self.stream.spads() == SPADS;
        let wanted = [0, 1].map(|later| PhotonSelection {
            cycles: 0,
            later,
            origin_fs: origins_fs[later as usize],
            origin_slot: origin_slots[later as usize].unwrap_or(0),
        });
        let (bins, clk_hz) = (self.engine.sensor.bins, self.engine.exposure.clock.as_hz());
        let has_clk_bins = self.engine.law.has_clk_bins();
        let within_fs = sight.plain.own.within_fs.clone();
        let mut pixel = Pixel {
            sight,
            parts,
            light,
            triggering,
            wanted,
            echo: has_clk_bins
                .then(|| EchoRows::new(light, bins, 1e15 / clk_hz, origins_fs[0], within_fs))
                .flatten(),
            hits: self.engine.law.empty_hits(&sight.window),
            work: EngineWork::default(),
            look_back: Time::ZERO,
            near: SmallVec::new(),
        };
        self.plain.carried.clear();
        self.past.clear();
        self.triggering.clear();
        if light.is_bright {
            self.count_bright(&mut pixel);
            return (pixel.hits, pixel.work);
        }
        let shares_words = self.stream.spads() <= table::WORD as usize;
        if self.stream.config().spads.dead_time_spread > 0.0 || !(has_clk_bins || shares_words) {
            // The other methods take one dead time, and a table the laser cycles of a delay line that are in one word.
            self.count_layers(&mut pixel);
            return (pixel.hits, pixel.work);
        }
        let expected = light.expected(&sight.plain.own) + light.expected(&sight.plain.previous);
        let little = match triggering {
            Some(_) => LITTLE_WITH_SECONDARIES,
            None => LITTLE,
        };
        let is_little = light.is_alone && has_clk_bins && expected <= little;
        if !(is_little && has_marks && has_slots_for_bins && pixel.sees_own_echo_only()) {
            self.count_tabled(&mut pixel);
            return (pixel.hits, pixel.work);
        }
        self.tables.clear_counts();
        let before_exposure_fs = sight
            .triggering
            .own
            .within_fs
            .start
            .min(light.echo_fs().start);
        let sees_before = sight.sees_the_beginning() || before_exposure_fs < 0;
        for group in self.stream.groups() {
            let cycles = group.cycles_in(self.stream.config().laser_cycles);
            pixel.work.photons_drawn += self.plain.draw(light, group, &sight.plain);
            if let Some(triggering) = triggering {
                let (first, spans) = (group.first_cycle(), &sight.triggering);
                pixel.work.photons_drawn +=
                    self.triggering.draw(triggering, self.stream, first, spans);
            }
            // Photons that come before the exposure are left out there.
            let is_first = group.first_cycle() == 0 && sees_before;
            if !is_first && self.encode(&mut pixel, cycles) <= MOST_PHOTONS {
                self.count_cells(&mut pixel, group);
            } else {
                self.count_whole(&mut pixel, group, cycles);
            }
            self.plain.carry(light, group);
        }
        for (row, hits) in (1..).zip(&mut pixel.hits) {
            let photons = u64::from(self.tables.count(row));
            *hits += self.adds[1] * photons as i64;
            pixel.work.clk_periods_visited += photons;
            pixel.work.pulses += photons;
        }
        (pixel.hits, pixel.work)
    }

    /// Encodes all photons that the windows of a group may see and that cause no others; returns how many codes there are.
    fn encode(&mut self, pixel: &mut Pixel<'_>, cycles: u32) -> usize {
        self.codes.clear();
        let [own, previous] = &mut pixel.wanted;
        own.cycles = cycles;
        previous.cycles = cycles - 1;
        let draws = [&self.plain.own, &self.plain.previous];
        for (part, draw) in draws.into_iter().enumerate() {
            let (wanted, echo) = (&pixel.wanted[part], pixel.echo.as_ref());
            let scratch = &mut self.scratch;
            self.binning
                .encode(pixel.light, draw, wanted, echo, scratch, &mut self.codes);
            self.first_code[part] = self.codes.len;
        }
        let wanted = PhotonSelection {
            cycles: 1,
            later: 0,
            ..pixel.wanted[1]
        };
        for &photon in &self.plain.carried {
            self.binning.push(&wanted, Some(photon), &mut self.codes);
        }
        self.codes.fill_up(SIDE_BY_SIDE);
        self.codes.len
    }

    fn count_cells(&mut self, pixel: &mut Pixel<'_>, group: CycleGroup) {
        let own = pixel.wanted[0];
        // Where all background photons of the cycles are wanted, their slots tell how many there are in each bin.
        let mut counted = 0;
        if own.cycles == group.cycles() {
            counted = self.plain.own.words()[0].len() * PER_BLOCK;
            for run in &self.plain.own.runs {
                let row = self.binning.row_of(&own, run.slot);
                self.tables.add(row, run.photons);
            }
        }
        self.tables
            .put_group(&self.codes, group.cycles() as usize, counted);
        if pixel.triggering.is_some() {
            self.count_triggering_cycles(pixel, group);
        }
        let mut index = 0;
        while let Some(special) = self.tables.special(index, &self.codes) {
            self.settle(pixel, special, group);
            index += 1;
        }
    }

    /// When a photon came, relative to the start of the laser cycle of its window.
    fn time_of(&self, light: &PixelStream<'_>, photon: usize, laser_cycle: u32) -> Time {
        let GroupDraws {
            own,
            previous,
            carried,
        } = &self.plain;
        let time_fs = if photon < self.first_code[0] {
            return Time::from_fs(in_draw(light, own, photon));
        } else if photon < self.first_code[1] {
            in_draw(light, previous, photon - self.first_code[0])
        } else {
            carried[photon - self.first_code[1]].1
        };
        Time::from_fs(time_fs) - self.previous_cycle_length(laser_cycle)
    }

    /// Whether a photon, perhaps of the echo, is one of those drawn.
    fn is_drawn(&self, light: &PixelStream<'_>, photon: usize) -> bool {
        let own = &self.plain.own;
        let is_of_echo = photon < self.first_code[0] && photon >= PER_BLOCK * own.slots().len();
        !is_of_echo || own.within_fs().contains(&in_draw(light, own, photon))
    }

    /// Calls `fire` with number and time of each photon that fires its SPAD, of those of one SPAD that come at `times_fs`, rising, after the start
    /// of the window's cycle; `None` where that depends on what came before them.
    #[inline]
    fn fire_by_times(
        &self,
        sight: &Sight,
        times_fs: impl Iterator<Item = i64>,
        mut fire: impl FnMut(usize, i64),
    ) -> Option<()> {
        let spads = &self.stream.config().spads;
        let dead_fs = spads.dead_time.as_fs();
        let wanted_from_fs = sight.first_fs - ROUNDING_FS;
        let known_from_fs = sight.plain.from_fs + ROUNDING_FS;
        let mut blind_until_fs = known_from_fs - 1 + dead_fs;
        let mut is_unknown = true;
        for (number, time_fs) in times_fs.enumerate() {
            if time_fs > blind_until_fs {
                is_unknown = false;
                blind_until_fs = time_fs + dead_fs;
                fire(number, time_fs);
            } else if is_unknown && time_fs >= wanted_from_fs {
                return None;
            } else if is_unknown || spads.law == DeadTimeLaw::Paralysable {
                blind_until_fs = blind_until_fs.max(time_fs + dead_fs);
            }
        }
        Some(())
    }

    /// The window of a laser cycle.
    fn window<'w>(&self, sight: &'w Sight, laser_cycle: u32) -> CycleWindow<'w>
    where
        'a: 'w,
    {
        CycleWindow {
            engine: self.engine,
            sight,
            laser_cycle,
            start: self.stream.cycle_start(laser_cycle),
        }
    }

    /// How long before a laser cycle the one before it starts.
    fn previous_cycle_length(&self, laser_cycle: u32) -> Time {
        let start = |cycle| self.stream.cycle_start(cycle);
        start(laser_cycle) - start(laser_cycle - 1)
    }
}

impl Pixel<'_> {
    /// What is drawn of a part of the light.
    fn spans(&self, part: &PixelStream<'_>) -> &Spans {
        if part.has_secondaries() {
            &self.sight.triggering
        } else {
            &self.sight.plain
        }
    }

    /// Whether avalanches cause others.
    fn has_secondaries(&self) -> bool {
        self.parts.iter().any(PixelStream::has_secondaries)
    }

    /// Whether windows see no echo of another cycle than their own.
    fn sees_own_echo_only(&self) -> bool {
        let sees_own_only = |light: &PixelStream<'_>, spans: &Spans| {
            light
                .echoes_within(&(spans.from_fs..self.sight.until_fs))
                .all(|later| later == 0)
        };
        let triggering = self.triggering;
        sees_own_only(self.light, &self.sight.plain)
            && triggering.is_none_or(|light| sees_own_only(light, &self.sight.triggering))
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
