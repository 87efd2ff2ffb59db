//! In which laser cycles another laser's pulses arrive, and when in them.
//!
//! ```text
//!   own laser cycles   ├────────────┤··├────────────┤·├────────────┤·····     after each of them a random wait (dither)
//!   sent               ▂          ▂          ▂          ▂
//!   arrived               ▂          ▂lost      ▂          ▂
//! ```
//!
//! The chip waits with its CLK stopped, as the engines see it: laser cycles follow each other without a gap, and what arrives in
//! a gap is lost.

use std::ops::Range;

use super::laser_cycles::LaserCycles;
use crate::photon::light::OtherLaser;
use crate::photon::random::{RandomPurpose, random_stream};

/// Pulses that were sent so long before an exposure may still arrive in it: 15 km away.
const LONGEST_DELAY_S: f64 = 50e-6;

/// The pulses of one laser in one exposure.
#[derive(Debug)]
pub(super) struct Schedule {
    /// Own laser cycles of the exposure.
    cycles: LaserCycles,
    /// When each is sent, waits included, rising; fs after the exposure begins.
    sent_fs: Vec<i64>,
    /// How long all waits before each laser cycle have been; empty without dither.
    waited_fs: Vec<i64>,
    longest_wait_fs: i64,
    /// When a pulse is sent after the start of its laser cycle, and its number; rising.
    by_offset: Vec<(i64, u32)>,
}

impl Schedule {
    /// That of `laser` beside the laser cycles of an exposure with this seed.
    pub(super) fn new(laser: &OtherLaser, seed: u64, cycles: LaserCycles) -> Self {
        let words =
            |number: u32, what: u32| random_stream(seed, RandomPurpose::OtherLaser, number, what);
        let unit = |word: u32| rand_philox::u32_to_unit_f64(word);
        let mut waited_fs = Vec::new();
        let longest_wait_fs = (laser.own_dither_s * 1e15) as i64;
        if longest_wait_fs > 0 {
            // One wait before each laser cycle, whichever laser it meets.
            let (mut random, mut all_fs) = (words(u32::MAX, 0), 0);
            waited_fs.extend((0..cycles.number).map(|_| {
                all_fs += (unit(random.next_u32()) * longest_wait_fs as f64) as i64;
                all_fs
            }));
        }
        let waited = waited_fs.last().copied().unwrap_or(0);
        let end_s = (cycles.start(cycles.number).as_fs() + waited) as f64 * 1e-15;
        let phase = laser
            .phase
            .unwrap_or_else(|| unit(words(laser.number, 0).next_u32()));
        let before = (LONGEST_DELAY_S / laser.period_s).ceil() + 1.0;
        let count = (end_s / laser.period_s + before).ceil() as u32;
        let mut random = words(laser.number, 1);
        let sent = (0..count).map(|pulse| {
            let late_s = if laser.dither_s > 0.0 {
                laser.dither_s * unit(random.next_u32())
            } else {
                0.0
            };
            (((f64::from(pulse) - before + phase) * laser.period_s + late_s) * 1e15).round() as i64
        });
        let mut sent_fs: Vec<i64> = sent.collect();
        sent_fs.sort_unstable();
        let mut schedule = Schedule {
            cycles,
            sent_fs,
            waited_fs,
            longest_wait_fs,
            by_offset: Vec::new(),
        };
        let offset = |(pulse, &sent_fs): (u32, &i64)| {
            let cycle = schedule.cycle_at(sent_fs);
            (sent_fs - schedule.start_fs(cycle), pulse)
        };
        let mut by_offset: Vec<_> = (0..).zip(&schedule.sent_fs).map(offset).collect();
        by_offset.sort_unstable();
        schedule.by_offset = by_offset;
        schedule
    }

    /// When a laser cycle begins, waits included.
    fn start_fs(&self, cycle: u32) -> i64 {
        let waited_fs = self.waited_fs.get(cycle as usize).or(self.waited_fs.last());
        self.cycles.start(cycle).as_fs() + waited_fs.copied().unwrap_or(0)
    }

    /// The last laser cycle of the exposure that has begun by a time; the first one if none has.
    fn cycle_at(&self, time_fs: i64) -> u32 {
        let (mut begun, mut not_begun) = (0, self.cycles.number.max(1));
        while not_begun - begun > 1 {
            let middle = begun + (not_begun - begun) / 2;
            if self.start_fs(middle) <= time_fs {
                begun = middle
            } else {
                not_begun = middle
            }
        }
        begun
    }

    /// The laser cycle in which a pulse arrives, and when after its start, fs; `None` before and after the exposure and in a wait.
    pub(super) fn arrival(&self, pulse: u32, delay_fs: i64) -> Option<(u32, i64)> {
        let time_fs = self.sent_fs[pulse as usize] + delay_fs;
        let cycle = self.cycle_at(time_fs);
        let since_fs = time_fs - self.start_fs(cycle);
        let length_fs = (self.cycles.start(cycle + 1) - self.cycles.start(cycle)).as_fs();
        (0..length_fs)
            .contains(&since_fs)
            .then_some((cycle, since_fs))
    }

    /// Pulses that may arrive between two times after the start of a laser cycle, of any laser cycle; some perhaps twice.
    pub(super) fn arriving_within(
        &self,
        within_fs: Range<i64>,
        delay_fs: i64,
    ) -> impl Iterator<Item = u32> {
        let cycle_fs = self.cycles.whole_fs;
        // A pulse may be sent some laser cycles, and as many waits, before the one in which it arrives.
        let most = delay_fs.div_euclid(cycle_fs) + 1;
        (0..=most).flat_map(move |before| {
            let (shortest_fs, longest_fs) = (cycle_fs, cycle_fs + 1 + self.longest_wait_fs);
            let from_fs = within_fs.start - delay_fs + before * shortest_fs;
            let until_fs = within_fs.end - delay_fs + before * longest_fs;
            let first = self.by_offset.partition_point(|(at, _)| *at < from_fs);
            let sent = self.by_offset[first..].iter();
            sent.take_while(move |(at, _)| *at < until_fs)
                .map(|(_, pulse)| *pulse)
        })
    }

    /// Pulses that may arrive in some laser cycles, or `reach_fs` before or after them.
    pub(super) fn arriving_in(
        &self,
        cycles: Range<u32>,
        delay_fs: i64,
        reach_fs: i64,
    ) -> Range<u32> {
        let last = cycles.end.min(self.cycles.number);
        let from_fs = self.start_fs(cycles.start) - reach_fs - delay_fs;
        let until_fs = self.start_fs(last) + reach_fs - delay_fs;
        let before =
            |time_fs: i64| self.sent_fs.partition_point(|&sent_fs| sent_fs < time_fs) as u32;
        before(from_fs)..before(until_fs + 1)
    }
}
