//! Bins of a delay line: the photons of a group as words that sort by laser cycle and time.
//!
//! ```text
//!   word    63          50                            6      0
//!          ┌────────────┬─────────────────────────────┬──────┐         alone in its cycle            ──► its bin
//!          │ cycle      │ time in it                  │ SPAD │ sorted  none decides another for sure ──► their bins
//!          └────────────┴─────────────────────────────┴──────┘         else, or one near an edge     ──► history
//! ```
//!
//! Most laser cycles have one photon, which makes a pulse where nobody of the SPADs' memory before it could blind its SPAD. Of
//! several, most are on SPADs of their own, and so far apart that each leaves an edge on the photon line. Only where the
//! photons drawn do not tell for certain what becomes of them, all of the cycle is settled with as much of the past as it takes
//! ([`settle_cycle`](super::Counting::settle_cycle)).

use std::cell::Cell;

use super::{Counting, Pixel};
use crate::engine::window::sight::ROUNDING_FS;
use crate::photon::{DeadTimeLaw, Draw, Group, Photon};
use crate::units::Time;

const SPAD_BITS: u32 = 6;
const CYCLE_SHIFT: u32 = 50;
const TIME_BITS: u32 = CYCLE_SHIFT - SPAD_BITS;

/// Photons of a laser cycle that are looked at together, at most. Beyond that, most are lost, and the others' history is sooner
/// followed than guessed at.
const MOST: usize = 32;

/// Photons begin no earlier than that before what is drawn begins, fs: cycles differ by rounding.
const ROOM_FS: i64 = 64;

/// The photons of a group of laser cycles.
#[derive(Debug, Default)]
struct Sorted {
    draw: Draw,
    words: Vec<u64>,
    /// Of the first window of the next group.
    next: Vec<u64>,
}

thread_local! {
    /// What this thread had last: sensors whose macropixels differ are counted one by one.
    static KEPT: Cell<Option<Box<Sorted>>> = const { Cell::new(None) };
}

/// What becomes of a photon.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
enum Fate {
    Fires,
    Lost,
    /// Its SPAD may be blind.
    Unknown,
}

/// A photon of a window.
#[derive(Debug, Clone, Copy)]
struct Seen {
    /// After the start of the window's cycle.
    time_fs: i64,
    spad: u8,
    /// Bin + 1; 0 outside.
    row: usize,
    fate: Fate,
}

/// Times in words.
#[derive(Debug, Clone, Copy)]
struct Words {
    /// What they are counted from.
    base_fs: i64,
}

impl Words {
    fn word(self, cycle: u32, time_fs: i64, spad: u8) -> u64 {
        let since_fs = time_fs - self.base_fs;
        debug_assert!((0..1 << TIME_BITS).contains(&since_fs));
        u64::from(cycle) << CYCLE_SHIFT | (since_fs as u64) << SPAD_BITS | u64::from(spad)
    }

    fn cycle(word: u64) -> u32 {
        (word >> CYCLE_SHIFT) as u32
    }

    fn time_fs(self, word: u64) -> i64 {
        self.base_fs + (word >> SPAD_BITS & ((1 << TIME_BITS) - 1)) as i64
    }

    fn spad(word: u64) -> u8 {
        word as u8 % (1 << SPAD_BITS)
    }
}

impl Counting<'_> {
    /// Whether the photons of a macropixel's windows are all drawn with those of their own cycle and the one before, and none
    /// breeds, so that they may be sorted.
    pub(super) fn can_sort(&self, pixel: &Pixel<'_>) -> bool {
        let span_fs = pixel.sight.until_fs - pixel.sight.plain.from_fs;
        span_fs < 1 << (TIME_BITS - 1)
            && pixel.parts.iter().all(|part| {
                let from_fs = pixel.sight.plain.from_fs;
                let mut echoes = part.echoes_within(&(from_fs..pixel.sight.until_fs));
                !part.breeds() && echoes.all(|later| later == 0)
            })
    }

    /// Counts a macropixel.
    pub(super) fn count_sorted(&mut self, pixel: &mut Pixel<'_>) {
        let mut kept = KEPT.take().unwrap_or_default();
        kept.next.clear();
        for group in self.stream.groups() {
            self.sort(pixel, group, &mut kept);
            let of_cycles = kept
                .words
                .chunk_by(|&a, &b| Words::cycle(a) == Words::cycle(b));
            for words in of_cycles {
                let cycle = group.first_cycle() + Words::cycle(words[0]);
                self.count_words(pixel, cycle, words);
            }
        }
        KEPT.set(Some(kept));
    }

    /// Draws and sorts what the windows of a group see.
    fn sort(&mut self, pixel: &mut Pixel<'_>, group: Group, kept: &mut Sorted) {
        let Sorted { draw, words, next } = kept;
        std::mem::swap(words, next);
        next.clear();
        let spans = &pixel.sight.plain;
        let times = words_of(pixel);
        let until_fs = pixel.sight.until_fs;
        let laser_cycles = self.stream.config().laser_cycles;
        let cycles = group.cycles_in(laser_cycles);
        let is_first = group.first_cycle() == 0;
        for part in pixel.parts {
            part.draw(group, &spans.own, draw);
            pixel.work.photons_drawn += draw.len() as u64;
            draw.photons(part, cycles).for_each(|(place, time_fs)| {
                let (cycle, spad) = group.split(place);
                let is_before_exposure = is_first && cycle == 0 && time_fs < 0;
                if time_fs < until_fs && !is_before_exposure {
                    words.push(times.word(cycle, time_fs, spad));
                }
            });
            if spans.previous.slots.is_empty() {
                continue;
            }
            part.draw(group, &spans.previous, draw);
            pixel.work.photons_drawn += draw.len() as u64;
            for (place, time_fs) in draw.photons(part, cycles) {
                let (cycle, spad) = group.split(place);
                let window = cycle + 1;
                let laser_cycle = group.first_cycle() + window;
                if laser_cycle >= laser_cycles {
                    continue;
                }
                let time_fs = time_fs - self.before(laser_cycle).as_fs();
                if time_fs >= until_fs {
                    continue;
                }
                match window < group.cycles() {
                    true => words.push(times.word(window, time_fs, spad)),
                    false => next.push(times.word(0, time_fs, spad)),
                }
            }
        }
        words.sort_unstable();
    }

    /// Counts the window of a laser cycle.
    #[inline]
    fn count_words(&mut self, pixel: &mut Pixel<'_>, laser_cycle: u32, words: &[u64]) {
        if let &[word] = words
            && let Some(row) = pixel.sight.rows.row_of(words_of(pixel).time_fs(word))
        {
            if row > 0 {
                pixel.hits[row - 1] += 1;
                pixel.work.pulses += 1;
            }
            return;
        }
        if self.count_apart(pixel, words).is_none() {
            let times = words_of(pixel);
            let start = self.stream.cycle_start(laser_cycle);
            self.photons.clear();
            self.photons.extend(words.iter().map(|&word| {
                Photon::new(
                    start + Time::from_fs(times.time_fs(word)),
                    Words::spad(word),
                    false,
                )
            }));
            self.settle_cycle(pixel, laser_cycle);
        }
    }

    /// Counts a window whose photons tell what becomes of them; `None`, and nothing counted, where they do not.
    fn count_apart(&self, pixel: &mut Pixel<'_>, words: &[u64]) -> Option<()> {
        if words.len() > MOST {
            return None;
        }
        let (spads, times) = (&self.stream.config().spads, words_of(pixel));
        let dead_fs = spads.dead_time.as_fs();
        let wanted_from_fs = pixel.sight.first_fs - ROUNDING_FS;
        let known_from_fs = pixel.sight.plain.from_fs + ROUNDING_FS + dead_fs;
        let nobody = Seen {
            time_fs: 0,
            spad: 0,
            row: 0,
            fate: Fate::Lost,
        };
        let mut seen = [nobody; MOST];
        let seen = &mut seen[..words.len()];
        for (at, &word) in words.iter().enumerate() {
            let (time_fs, spad) = (times.time_fs(word), Words::spad(word));
            let mut fate = match time_fs >= known_from_fs {
                true => Fate::Fires,
                false => Fate::Unknown,
            };
            for before in seen[..at].iter().rev().filter(|other| other.spad == spad) {
                let is_apart = time_fs - before.time_fs > dead_fs;
                fate = match before.fate {
                    // Who blinded that one decides.
                    Fate::Lost if spads.law == DeadTimeLaw::NonParalysable => continue,
                    _ if is_apart => Fate::Fires,
                    Fate::Unknown => Fate::Unknown,
                    Fate::Fires | Fate::Lost => Fate::Lost,
                };
                break;
            }
            let row = pixel.sight.rows.row_of(time_fs)?;
            if fate == Fate::Unknown && (row > 0 || time_fs >= wanted_from_fs) {
                return None;
            }
            seen[at] = Seen {
                time_fs,
                spad,
                row,
                fate,
            };
        }
        let stage_fs = self.engine.law.timing().photon_line_stage.as_fs();
        let mut pulses = seen.iter().filter(|photon| photon.fate != Fate::Lost);
        let mut last_fs = pulses.next().map_or(0, |photon| photon.time_fs);
        for pulse in pulses {
            // One of them may take the other's edge back.
            if pulse.time_fs - last_fs < stage_fs && pulse.time_fs >= wanted_from_fs {
                return None;
            }
            last_fs = pulse.time_fs;
        }
        let in_window = |photon: &&Seen| photon.row > 0;
        let all = seen.iter().filter(in_window).count() as u64;
        let mut pulses = seen
            .iter()
            .filter(|photon| photon.fate == Fate::Fires)
            .filter(in_window)
            .peekable();
        let (mut fired, mut counted) = (0, 0);
        while let Some(first) = pulses.next() {
            let mut edges = 1;
            while pulses.next_if(|other| other.row == first.row).is_some() {
                edges += 1;
            }
            fired += edges;
            counted += edges % 2;
            pixel.hits[first.row - 1] += (edges % 2) as i64;
        }
        pixel.work.pulses += fired;
        pixel.work.cancelled += fired - counted;
        pixel.work.lost_to_dead_time += all - fired;
        Some(())
    }
}

fn words_of(pixel: &Pixel<'_>) -> Words {
    Words {
        base_fs: pixel.sight.plain.from_fs - ROOM_FS,
    }
}
