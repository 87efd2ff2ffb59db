//! Laser cycles of a bright macropixel side by side.
//!
//! ```text
//!   lane         0    1    2   …  15         a lane is a laser cycle; all draw the same block of photons at a time
//!   block        ├────┼────┼── … ──┤
//!   SPAD 0…15    blind until …               within a lane photons come in their order, so that one pass decides them
//!   row          which SPADs fired
//! ```
//!
//! Where bins are not CLK periods, rows are not kept but the pulses themselves, and each lane's are counted in the end.
//!
//! A lane that depends on what came before its first block, or has a photon within a few femtoseconds of a bin's edge, is undecided:
//! left to who counts laser cycle by laser cycle.
//!
//! 400 Mcounts/s take 4.2 times as long cycle by cycle, the street with a lens of 20 mm 1.7 times.

#![allow(
    unsafe_code,
    reason = "multiversion calls what the processor was asked for"
)]

use multiversion::multiversion;

use crate::engine::window::codes::{ROWS, SPADS};
use crate::photon::{NEVER_FS, PixelStream, SpadEvent, TILE};
use crate::units::Time;

/// Binary places of a position in CLK periods.
pub(super) const FRACTION_BITS: u32 = 20;

/// What the windows of all laser cycles but the first ones have in common. Times are fs after the start of the window's
/// cycle.
pub(super) struct Layout {
    /// Blocks of photons that are drawn, in their order, with their laser cycle relative to the window's.
    pub blocks: Vec<(i64, u32)>,
    /// The first laser cycle that is like that.
    pub first_cycle: u32,
    pub until_fs: i64,
    pub dead_fs: i64,
    /// From then on what is not known matters.
    pub wanted_from_fs: i64,
    pub is_paralysable: bool,
    /// A CLK period before bin 0 begins.
    pub origin_fs: i64,
    /// CLK periods of a femtosecond, in 2⁻⁶⁴.
    pub periods_per_fs: u64,
    /// Distance from an edge that leaves a position in doubt.
    pub doubt: u64,
    pub rows: usize,
    /// Whether bins are CLK periods.
    pub has_clk_bins: bool,
}

/// The state of all lanes. Times are fs after the start of the lane's laser cycle.
pub(super) struct Tile {
    blind_until_fs: [[i64; SPADS]; TILE],
    /// SPADs that may be ready before that.
    unknown: [u16; TILE],
    /// The next photon of the echo.
    pub next_fs: [[i64; TILE]; SPADS],
    /// Random words for the photon after that.
    pub second_words: [[u32; TILE]; SPADS],
    /// How many random words have been used.
    drawn: [[u32; SPADS]; TILE],
    /// SPADs that fired, by row; twice is not at all.
    pub fired: [[u16; ROWS]; TILE],
    /// Pulses of each lane, after the start of its laser cycle, where bins are not CLK periods; in no particular order.
    pub pulses: [Vec<SpadEvent>; TILE],
    /// Lanes that are left to others.
    pub undecided: u16,
    /// Of each lane.
    pub tally: [Tally; TILE],
}

/// What became of photons in a window.
#[derive(Debug, Clone, Copy, Default)]
pub(super) struct Tally {
    pub pulses: u32,
    pub cancelled: u32,
    pub lost: u32,
}

impl Default for Tile {
    fn default() -> Self {
        Tile {
            blind_until_fs: [[0; SPADS]; TILE],
            unknown: [0; TILE],
            next_fs: [[NEVER_FS; TILE]; SPADS],
            second_words: [[0; TILE]; SPADS],
            drawn: [[0; SPADS]; TILE],
            fired: [[0; ROWS]; TILE],
            pulses: Default::default(),
            undecided: 0,
            tally: [Tally::default(); TILE],
        }
    }
}

impl Tile {
    /// Begins a tile; `known_from_fs` is when the first block of each lane begins.
    #[inline]
    pub(super) fn begin(&mut self, layout: &Layout, known_from_fs: [i64; TILE]) {
        for (spads, from_fs) in self.blind_until_fs.iter_mut().zip(known_from_fs) {
            *spads = [from_fs - 1 + layout.dead_fs; SPADS];
        }
        self.unknown = [u16::MAX; TILE];
        self.drawn = [[1; SPADS]; TILE];
        for fired in &mut self.fired {
            fired[..=layout.rows].fill(0);
        }
        self.pulses.iter_mut().for_each(Vec::clear);
        self.undecided = 0;
        self.tally = [Tally::default(); TILE];
    }

    /// A background photon.
    #[inline(always)]
    pub(super) fn photon(
        &mut self,
        layout: &Layout,
        light: &PixelStream<'_>,
        cycle: u32,
        lane: usize,
        spad: usize,
        time_fs: i64,
    ) {
        if self.next_fs[spad][lane] <= time_fs {
            self.echo_until(layout, light, cycle, lane, spad, time_fs);
        }
        let blind_until_fs = &mut self.blind_until_fs[lane][spad];
        if time_fs > *blind_until_fs {
            self.fire(layout, lane, spad, time_fs);
        } else {
            let is_unknown = self.unknown[lane] >> spad & 1 != 0;
            if is_unknown | layout.is_paralysable {
                *blind_until_fs = (*blind_until_fs).max(time_fs + layout.dead_fs);
            }
            let matters = is_unknown & (time_fs >= layout.wanted_from_fs);
            self.undecided |= u16::from(matters) << lane;
            self.tally[lane].lost += u32::from(time_fs >= layout.wanted_from_fs);
        }
    }

    #[inline(always)]
    fn fire(&mut self, layout: &Layout, lane: usize, spad: usize, time_fs: i64) {
        self.blind_until_fs[lane][spad] = time_fs + layout.dead_fs;
        self.unknown[lane] &= !(1 << spad);
        if !layout.has_clk_bins {
            if time_fs >= layout.wanted_from_fs {
                let (time, spad) = (Time::from_fs(time_fs), spad as u8);
                self.pulses[lane].push(SpadEvent { time, spad });
            }
            return;
        }
        let into_fs = time_fs - layout.origin_fs;
        if into_fs < 0 {
            return;
        }
        let position = ((into_fs as u128 * u128::from(layout.periods_per_fs))
            >> (u64::BITS - FRACTION_BITS)) as u64;
        let is_doubtful =
            position.wrapping_add(layout.doubt) % (1 << FRACTION_BITS) < 2 * layout.doubt;
        let row = (position >> FRACTION_BITS) as usize;
        if row <= layout.rows {
            self.undecided |= u16::from(is_doubtful) << lane;
            let fired = &mut self.fired[lane][row % ROWS];
            let tally = &mut self.tally[lane];
            tally.cancelled += u32::from(*fired >> spad & 1) * 2 * u32::from(row > 0);
            tally.pulses += u32::from(row > 0);
            *fired ^= 1 << spad;
        }
    }

    /// The photons of the echo on a SPAD until a time.
    #[inline]
    pub(super) fn echo_until(
        &mut self,
        layout: &Layout,
        light: &PixelStream<'_>,
        cycle: u32,
        lane: usize,
        spad: usize,
        until_fs: i64,
    ) {
        loop {
            let time_fs = self.next_fs[spad][lane];
            if time_fs > until_fs {
                return;
            }
            if time_fs > self.blind_until_fs[lane][spad] {
                self.fire(layout, lane, spad, time_fs);
            } else if self.unknown[lane] >> spad & 1 != 0 {
                self.undecided |= 1 << lane;
                self.next_fs[spad][lane] = NEVER_FS;
                return;
            }
            let after_fs = self.blind_until_fs[lane][spad];
            if light.is_over(after_fs) {
                self.next_fs[spad][lane] = NEVER_FS;
                return;
            }
            let drawn = &mut self.drawn[lane][spad];
            let word = match *drawn {
                1 => {
                    *drawn = 2;
                    self.second_words[spad][lane]
                }
                _ => light.echo_word(cycle, spad, drawn),
            };
            self.next_fs[spad][lane] = light.next_arrival_fs(after_fs, word);
        }
    }
}

/// Adds what each row's SPADs add to its hits; returns how many rows have a SPAD.
#[multiversion(targets("x86_64+avx2+popcnt"))]
pub(super) fn count_rows(fired: &[u16], adds: &[i64], hits: &mut [i64]) -> u64 {
    let mut visited = 0;
    for (hits, spads) in hits.iter_mut().zip(fired) {
        *hits += adds[spads.count_ones() as usize];
        visited += u64::from(*spads != 0);
    }
    visited
}
