//! Settling the few laser cycles in which counting every photon is wrong.
//!
//! ```text
//!   one special photon  ── shares its bin               ──► the bin's CLK period has two SPADs
//!        │              ── shares its SPAD, farther apart than the memory ──► both count
//!        │              ── shares its SPAD, closer      ──► the second is lost, if the first was seen for certain
//!        ╰─ else, more of them, or one near an edge     ──► SPAD by SPAD by exact times, with as much of the past as it takes
//! ```
//!
//! What other photons the cycle has does not matter in the first three cases: whoever shared a SPAD or a bin with
//! them, too, would be special as well.
//!
//! With every laser cycle in doubt settled as a whole, 8 Mcounts/s and 0.1 signal photons would take 1.9 times as long, 26 Mcounts/s 2.8 times.

use smallvec::SmallVec;

use super::{Counting, Pixel, in_draw};
use crate::engine::window::codes::{Code, SPAD_MARKS};
use crate::engine::window::tables::Special;
use crate::photon::{CycleGroup, Photon};
use crate::units::Time;

impl Counting<'_> {
    /// Settles the cycle of a special photon.
    pub(super) fn settle(&mut self, pixel: &mut Pixel<'_>, special: Special, group: CycleGroup) {
        let Special { photon, shared, .. } = special;
        let code = self.codes.codes()[photon];
        let is_settled = special.is_only
            && match (shared & SPAD_MARKS != 0, shared & !SPAD_MARKS != 0) {
                (false, _) => {
                    self.settle_bin(pixel, photon, code);
                    true
                }
                (true, false) => self.settle_partner(pixel, photon, code),
                (true, true) => false,
            };
        if is_settled {
            return;
        }
        if let Some(last) = self.tables.take_last(code.cycle()) {
            self.settle_all(pixel, last, group.first_cycle() + code.cycle() as u32);
        }
    }

    /// Settles a photon that shares its bin's mark, and where several bins have one mark perhaps its bin, with one of
    /// another SPAD.
    fn settle_bin(&mut self, pixel: &mut Pixel<'_>, photon: usize, code: Code) {
        let row = code.row();
        if self
            .find_before(photon, |other| other.row() == row)
            .is_some()
        {
            self.tables.remove(row);
            self.tables.remove(row);
            self.fire(pixel, row, 2);
        }
    }

    /// Settles a photon that shares its SPAD with one of another bin, if what was before them does not matter, as it
    /// mostly does not. Returns whether it did.
    fn settle_partner(&mut self, pixel: &mut Pixel<'_>, photon: usize, code: Code) -> bool {
        let Some(partner) = self.find_before(photon, |other| other.spad() == code.spad()) else {
            debug_assert!(false, "a photon that shares its SPAD has a partner");
            return false;
        };
        let photons = [partner, (photon, code)];
        let Some(fired) = self.pair(pixel, photons) else {
            return false;
        };
        for ((_, code), fired) in photons.into_iter().zip(fired) {
            if fired == 0 {
                self.tables.remove(code.row());
            }
        }
        true
    }

    /// The last photon of the same cycle before this one that is like that.
    fn find_before(&self, photon: usize, is_like: impl Fn(Code) -> bool) -> Option<(usize, Code)> {
        let before = std::iter::successors(self.tables.previous_photon(photon), |&photon| {
            self.tables.previous_photon(photon)
        });
        before
            .map(|photon| (photon, self.codes.codes()[photon]))
            .find(|&(_, code)| is_like(code))
    }

    /// Settles the `last` photon of a cycle and those before it.
    fn settle_all(&mut self, pixel: &mut Pixel<'_>, last: usize, laser_cycle: u32) {
        self.together.clear();
        let (mut once, mut several, mut is_doubtful) = (0u64, 0u64, false);
        let mut next = Some(last);
        while let Some(photon) = next {
            let code = self.codes.codes()[photon];
            let spad = 1 << code.spad();
            several |= once & spad;
            if code.is_doubtful() {
                several |= spad;
                is_doubtful = true;
            }
            once |= spad;
            self.together.push((photon, code));
            next = self.tables.previous_photon(photon);
        }
        let work = pixel.work;
        let mut left = several;
        while left != 0 {
            let spad = left.trailing_zeros() as u8;
            left &= left - 1;
            if !self.settle_spad(pixel, laser_cycle, spad) {
                // Photons that cause others did not matter to the window so far, but may when it is looked back.
                pixel.work = work;
                self.fired[..=pixel.hits.len()].fill(0);
                let photons = self.triggering.photons(laser_cycle..laser_cycle + 1).iter();
                self.photons.clear();
                self.photons.extend(photons.map(|&(_, photon)| photon));
                self.take_cycle(pixel, Some(last), laser_cycle);
                self.settle_cycle(pixel, laser_cycle);
                return;
            }
        }
        for (_, code) in &self.together {
            self.tables.remove(code.row());
            let alone = several >> code.spad() & 1 == 0;
            self.fired[code.row()] += u8::from(alone);
        }
        if is_doubtful {
            for row in 0..=pixel.hits.len() {
                self.count_fired(pixel, row);
            }
        }
        for index in 0..self.together.len() {
            let row = self.together[index].1.row();
            self.count_fired(pixel, row);
        }
    }

    /// Adds what fired in a CLK period to its bin.
    fn count_fired(&mut self, pixel: &mut Pixel<'_>, row: usize) {
        let spads = std::mem::take(&mut self.fired[row]);
        self.fire(pixel, row, spads);
    }

    /// Adds a CLK period in which `spads` SPADs fired to its bin.
    #[inline]
    fn fire(&self, pixel: &mut Pixel<'_>, row: usize, spads: u8) {
        if let Some(hits) = pixel.hits.get_mut(row.wrapping_sub(1)) {
            *hits += self.adds[usize::from(spads)];
            pixel.work.clk_periods_visited += u64::from(spads > 0);
            pixel.work.pulses += u64::from(spads);
        }
    }

    /// Which of a SPAD's only two photons make pulses that are counted, if what was before them does not matter, as it
    /// mostly is; neither is doubtful.
    #[inline]
    fn pair(&self, pixel: &mut Pixel<'_>, photons: [(usize, Code); 2]) -> Option<[u8; 2]> {
        let [(photon, code), (other, other_code)] = photons;
        let (row, other_row) = (code.row(), other_code.row());
        let bins = pixel.hits.len();
        let (first, second) = (row.min(other_row), row.max(other_row));
        if self.spacing.both_fire(first, second) {
            return Some([1; 2]);
        }
        if self.spacing.one_fires(first, second) {
            pixel.work.lost_to_dead_time += 1;
            let is_first = u8::from(row < other_row);
            return Some([is_first, 1 - is_first]);
        }
        if photon.max(other) >= self.first_code[0] {
            return None;
        }
        let time_fs = |photon| in_draw(pixel.light, &self.plain.own, photon);
        let times_fs = [time_fs(photon), time_fs(other)];
        let memory_fs = self.stream.config().spads.dead_time.as_fs();
        let is_blind = (times_fs[0] - times_fs[1]).abs() <= memory_fs;
        let is_seen = u64::from((1..=bins).contains(&second));
        if is_blind {
            // A photon in the window has been preceded by all the memory, in which there was none.
            let first_fs = times_fs[0].min(times_fs[1]);
            if first == 0 && first_fs - pixel.sight.plain.from_fs <= memory_fs {
                return None;
            }
            pixel.work.lost_to_dead_time += is_seen;
            let is_first = u8::from(times_fs[0] <= times_fs[1]);
            return Some([is_first, 1 - is_first]);
        } else if first == second {
            // Two pulses within one CLK period cancel.
            pixel.work.pulses += 2 * is_seen;
            pixel.work.cancelled += 2 * is_seen;
            return Some([0; 2]);
        }
        Some([1; 2])
    }

    /// Settles the photons of one SPAD among those `together`. Returns whether it did: not where it takes a look back and photons may cause others.
    fn settle_spad(&mut self, pixel: &mut Pixel<'_>, laser_cycle: u32, spad: u8) -> bool {
        let window = self.window(pixel.sight, laser_cycle);
        let bins = pixel.hits.len();
        // Times after the start of the window's cycle, and rows; 0 outside the window.
        let mut photons = SmallVec::<[(i64, usize); 8]>::new();
        for &(photon, code) in &self.together {
            if code.spad() == spad && self.is_drawn(pixel.light, photon) {
                let time = self.time_of(pixel.light, photon, laser_cycle);
                let row = if code.is_doubtful() {
                    window.row_of(window.start + time).unwrap_or(0)
                } else {
                    code.row() % (bins + 1)
                };
                photons.push((time.as_fs(), row));
            }
        }
        photons.sort_unstable();
        let seen = photons.iter().filter(|(_, row)| *row > 0).count();
        if seen == 0 {
            return true;
        }
        let mut rows = SmallVec::<[usize; 8]>::new();
        let times_fs = photons.iter().map(|&(time_fs, _)| time_fs);
        let fire = |number: usize, _: i64| rows.push(photons[number].1);
        let known = self.fire_by_times(pixel.sight, times_fs, fire);
        if known.is_none() {
            if pixel.triggering.is_some() {
                return false;
            }
            let photons = photons.iter().map(|&(time_fs, _)| {
                Photon::new(window.start + Time::from_fs(time_fs), spad, false)
            });
            self.photons.clear();
            self.photons.extend(photons);
            self.detect(pixel, &window, 1 << spad);
            let events = self.events.iter();
            rows = events
                .filter_map(|event| window.row_of(event.time))
                .collect();
        }
        rows.retain(|row| *row > 0);
        pixel.work.lost_to_dead_time += (seen - rows.len()) as u64;
        for rows in rows.chunk_by(|a, b| a == b) {
            // Two pulses within one CLK period cancel.
            let cancelled = rows.len() as u64 / 2 * 2;
            self.fired[rows[0]] += (rows.len() % 2) as u8;
            pixel.work.pulses += cancelled;
            pixel.work.cancelled += cancelled;
        }
        true
    }
}
