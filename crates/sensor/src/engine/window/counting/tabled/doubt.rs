//! The SPADs that a table leaves in doubt: their photons by exact times, and by history where these depend on what came before.

use super::{TableScratch, Tabling};
use crate::engine::window::counting::{Counting, CycleWindow, Pixel};
use crate::engine::window::sight::ROUNDING_FS;
use crate::engine::window::table::{Places, Table, WORD};
use crate::photon::Photon;
use crate::units::Time;

/// A key has the place above, and below it the time since the table begins, fs.
const PLACE_SHIFT: u32 = 46;

impl Tabling<'_> {
    /// Notes the photons in doubt.
    pub(super) fn collect(
        &self,
        counting: &Counting<'_>,
        pixel: &Pixel<'_>,
        kept: &mut TableScratch,
    ) {
        let TableScratch {
            table,
            drawn,
            echoes,
            listed,
            keys,
            unknown,
            ..
        } = kept;
        let doubt = &table.doubt[..];
        let is_in_doubt = |place: u32| doubt[(place / WORD) as usize] >> (place % WORD) & 1 != 0;
        let key = |place: u32, time_fs: i64| self.key(place, time_fs);
        keys.clear();
        let numbers = |places: Places, words: &[u32], unknown: &mut Vec<u32>| {
            unknown.resize(unknown.len().max(words.len() + 1), 0);
            let mut found = 0;
            for (number, &word) in (0..).zip(words) {
                // Written always, kept if so: no branch to mispredict.
                unknown[found] = number;
                found += usize::from(is_in_doubt(places.place(word)));
            }
            found
        };
        for ((part, drawn), echo) in pixel.parts.iter().zip(&*drawn).zip(&*echoes) {
            if part.has_secondaries() {
                continue;
            }
            for (draw, later) in [(&drawn.own, 0), (&drawn.previous, 1)] {
                let places = self.places(later);
                for run in &draw.runs {
                    for (blocks, words) in run.blocks().into_iter().zip(draw.words()) {
                        let words = &words[blocks];
                        let found = numbers(places, words, unknown);
                        keys.extend(unknown[..found].iter().map(|&number| {
                            let word = words[number as usize];
                            let place = places.place(word);
                            let cycle = self.group.first_cycle() + self.split(place).0;
                            let time_fs = part.slots().time_fs(run.slot, word);
                            key(place, time_fs - counting.moved_fs(cycle, later))
                        }));
                    }
                }
            }
            if echo.is_none() {
                continue;
            }
            let draw = &drawn.own;
            let halves = draw.echo().into_iter().zip(draw.echo_photons());
            for (half, ([_, high], photons)) in halves.enumerate() {
                let found = numbers(self.places(0), &high[..photons], unknown);
                keys.extend(unknown[..found].iter().filter_map(|&number| {
                    let number = half * draw.half_an_echo() + number as usize;
                    let (place, time_fs) = part.signal_photon(draw, number);
                    let is_drawn = draw.within_fs().contains(&time_fs);
                    is_drawn.then(|| key(u32::from(place), time_fs))
                }));
            }
        }
        let listed = listed.iter().filter(|(place, _)| is_in_doubt(*place));
        keys.extend(listed.map(|&(place, time_fs)| key(place, time_fs)));
        keys.sort_unstable();
    }

    fn key(&self, place: u32, time_fs: i64) -> u64 {
        let since_fs = time_fs - self.base_fs();
        debug_assert!((0..1 << PLACE_SHIFT).contains(&since_fs));
        u64::from(place) << PLACE_SHIFT | since_fs as u64
    }

    /// The place and time of a key.
    fn of_key(&self, key: u64) -> (u32, i64) {
        let since_fs = key & ((1 << PLACE_SHIFT) - 1);
        (
            (key >> PLACE_SHIFT) as u32,
            self.base_fs() + since_fs as i64,
        )
    }

    /// The photons of keys in their window.
    fn photons(&self, window: &CycleWindow<'_>, keys: &[u64]) -> impl Iterator<Item = Photon> {
        keys.iter().map(|&key| {
            let (place, time_fs) = self.of_key(key);
            Photon::new(
                window.start + Time::from_fs(time_fs),
                self.split(place).1,
                false,
            )
        })
    }

    /// Notes in which rows SPADs fire, by SPAD and time. Two pulses in one cancel.
    fn note(&mut self, fired: &[(u32, usize)], table: &mut Table) {
        let mut last = None;
        for &one in fired {
            table.toggle(one.1, one.0);
            self.cancelled += 2 * u64::from(last == Some(one));
            last = Some(one).filter(|_| last != Some(one));
        }
    }

    /// No photon comes so early.
    fn base_fs(&self) -> i64 {
        self.layout.edges_fs[0] - 64
    }
}

impl Counting<'_> {
    /// Settles the photons in doubt by their times.
    pub(super) fn settle_keys(
        &mut self,
        pixel: &mut Pixel<'_>,
        tabling: &mut Tabling<'_>,
        kept: &mut TableScratch,
    ) {
        let mut keys = std::mem::take(&mut kept.keys);
        let first = tabling.group.first_cycle();
        if first == 0 {
            kept.parents.retain(|(_, photon)| photon.time >= Time::ZERO);
            keys.retain(|&key| {
                let (place, time_fs) = tabling.of_key(key);
                let window = self.window(pixel.sight, tabling.split(place).0);
                let time = window.start + Time::from_fs(time_fs);
                tabling.seen -= u64::from(time < Time::ZERO && window.is_seen(time));
                time >= Time::ZERO
            });
        }
        let place_of = |key: u64| (key >> PLACE_SHIFT) as u32;
        let spad_bits = tabling.spad_bits;
        let cycle_of = |key: u64| place_of(key) >> spad_bits;
        let mut by_cycle = keys
            .chunk_by(|&a, &b| cycle_of(a) == cycle_of(b))
            .peekable();
        let (parents, whole) = (
            std::mem::take(&mut kept.parents),
            std::mem::take(&mut kept.whole),
        );
        let mut whole_cycles = whole.iter().copied().peekable();
        let is_line = !self.engine.law.has_clk_bins();
        loop {
            let next = by_cycle.peek().map(|keys| cycle_of(keys[0]));
            let next_whole = whole_cycles.peek().copied();
            let Some(cycle) = next.into_iter().chain(next_whole).min() else {
                break;
            };
            let keys = by_cycle.next_if(|_| next == Some(cycle)).unwrap_or(&[]);
            let is_whole = whole_cycles.next_if_eq(&cycle).is_some();
            let window = self.window(pixel.sight, first + cycle);
            let first_parent = parents.partition_point(|&(other, _)| other < cycle);
            let own = parents[first_parent..].iter();
            let mut own = own.take_while(|(other, _)| *other == cycle).peekable();
            let is_on_line = is_whole && is_line && own.peek().is_none();
            if is_on_line && self.count_line(pixel, tabling, &window, keys) {
                continue;
            }
            kept.fired.clear();
            let of_spads = keys.chunk_by(|&a, &b| place_of(a) == place_of(b));
            let mut is_known = !is_whole;
            for keys in of_spads {
                is_known = is_known && {
                    let times_fs = keys.iter().map(|&key| tabling.of_key(key).1);
                    let place = place_of(keys[0]);
                    let fire = |_: usize, time_fs: i64| {
                        let row = tabling.layout.row_of(time_fs);
                        let row = row.unwrap_or_else(|| tabling.exact_row(&window, time_fs));
                        if tabling.is_in_bins(row) {
                            kept.fired.push((place, row));
                        }
                    };
                    self.fire_by_times(pixel.sight, times_fs, fire).is_some()
                };
                if is_known || is_whole || pixel.has_secondaries() {
                    continue;
                }
                let place = place_of(keys[0]);
                kept.fired.retain(|&(other, _)| other != place);
                self.photons.clear();
                self.photons.extend(tabling.photons(&window, keys));
                self.detect(pixel, &window, 1 << tabling.split(place).1);
                let rows = self
                    .events
                    .iter()
                    .filter_map(|event| window.row_of(event.time));
                let fired = rows.map(|bin| (place, tabling.layout.before + bin));
                kept.fired.extend(fired);
                is_known = true;
            }
            if is_known {
                tabling.note(&kept.fired, &mut kept.table);
                continue;
            }
            self.photons.clear();
            self.photons.extend(tabling.photons(&window, keys));
            let seen = self
                .photons
                .iter()
                .filter(|photon| window.is_seen(photon.time));
            tabling.seen -= seen.count() as u64;
            self.photons.extend(own.map(|&(_, photon)| photon));
            self.settle_cycle(pixel, first + cycle);
        }
        (kept.keys, kept.parents, kept.whole) = (keys, parents, whole);
    }

    /// Counts a laser cycle of SPADs on a photon line by the times of its photons. Returns whether it did: not where pulses may meet on the
    /// line, or depend on what came before.
    fn count_line(
        &mut self,
        pixel: &mut Pixel<'_>,
        tabling: &mut Tabling<'_>,
        window: &CycleWindow<'_>,
        keys: &[u64],
    ) -> bool {
        let mut pulses_fs = std::mem::take(&mut self.pulses_fs);
        pulses_fs.clear();
        let mut of_spads = keys.chunk_by(|a, b| a >> PLACE_SHIFT == b >> PLACE_SHIFT);
        let are_known = of_spads.all(|keys| {
            let times_fs = keys.iter().map(|&key| tabling.of_key(key).1);
            let fire = |_: usize, time_fs: i64| pulses_fs.push(time_fs);
            self.fire_by_times(pixel.sight, times_fs, fire).is_some()
        });
        pulses_fs.sort_unstable();
        let stage_fs = self.engine.law.timing().photon_line_stage.as_fs();
        let wanted_from_fs = pixel.sight.first_fs - ROUNDING_FS;
        let mut pairs = pulses_fs.windows(2);
        let is_counted = are_known
            && pairs.all(|pair| pair[1] - pair[0] >= stage_fs || pair[1] < wanted_from_fs);
        if is_counted {
            for &time_fs in &pulses_fs {
                let row = tabling.layout.row_of(time_fs);
                let row = row.unwrap_or_else(|| tabling.exact_row(window, time_fs));
                if tabling.is_in_bins(row) {
                    self.odd[row - tabling.layout.before] ^= 1;
                    tabling.cancelled += 1;
                }
            }
            for (hits, odd) in pixel.hits.iter_mut().zip(&mut self.odd[1..]) {
                let edge = std::mem::take(odd);
                *hits += edge as i64;
                tabling.pulses += edge;
                tabling.cancelled -= edge;
            }
        }
        self.pulses_fs = pulses_fs;
        is_counted
    }
}
