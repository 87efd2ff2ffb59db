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
//! A lane that depends on what came before its first block, has a photon within a few femtoseconds of a bin's edge, or one that
//! breeds, is left to [`count_bright_cycle`](super::Counting::count_bright_cycle).

use multiversion::multiversion;

use super::bright::Beginning;
use super::{Counting, Pixel, Placed};
use crate::engine::window::codes::{ROWS, SPADS};
use crate::engine::window::sight::ROUNDING_FS;
use crate::photon::{DeadTimeLaw, NEVER_FS, PixelStream, SpadEvent, TILE, spad_of};
use crate::units::Time;

/// Binary places of a position in CLK periods.
const FRACTION_BITS: u32 = 20;

/// What the windows of all laser cycles but the first ones have in common. Times are fs after the start of the window's
/// cycle.
pub(super) struct Layout {
    /// Blocks of photons that are drawn, in their order, with their laser cycle relative to the window's.
    blocks: Vec<(i64, u32)>,
    /// The first laser cycle that is like that.
    pub first_cycle: u32,
    until_fs: i64,
    dead_fs: i64,
    /// From then on what is not known matters.
    wanted_from_fs: i64,
    is_paralysable: bool,
    /// A CLK period before bin 0 begins.
    origin_fs: i64,
    /// CLK periods of a femtosecond, in 2⁻⁶⁴.
    periods_per_fs: u64,
    /// Distance from an edge that leaves a position in doubt.
    doubt: u64,
    rows: usize,
    /// Whether bins are CLK periods.
    has_clk_bins: bool,
}

/// The state of all lanes. Times are fs after the start of the lane's laser cycle.
pub(super) struct Tile {
    blind_until_fs: [[i64; SPADS]; TILE],
    /// SPADs that may be ready before that.
    unknown: [u16; TILE],
    /// The next photon of the echo.
    next_fs: [[i64; TILE]; SPADS],
    /// Random words for the photon after that.
    second_words: [[u32; TILE]; SPADS],
    /// How many random words have been used.
    drawn: [[u32; SPADS]; TILE],
    /// SPADs that fired, by row; twice is not at all.
    fired: [[u16; ROWS]; TILE],
    /// Pulses of each lane, after the start of its laser cycle, where bins are not CLK periods; in no particular order.
    pulses: [Vec<SpadEvent>; TILE],
    /// Lanes that are left to others.
    undecided: u16,
    /// Of each lane.
    tally: [Tally; TILE],
}

/// What became of photons in a window.
#[derive(Debug, Clone, Copy, Default)]
struct Tally {
    pulses: u32,
    cancelled: u32,
    lost: u32,
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
    fn begin(&mut self, layout: &Layout, known_from_fs: [i64; TILE]) {
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
    fn photon(
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
    fn echo_until(
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
fn count_rows(fired: &[u16], adds: &[i64; SPADS + 1], hits: &mut [i64]) -> u64 {
    let mut visited = 0;
    for (hits, spads) in hits.iter_mut().zip(fired) {
        *hits += adds[spads.count_ones() as usize % (SPADS + 1)];
        visited += u64::from(*spads != 0);
    }
    visited
}

impl Counting<'_> {
    /// How windows of a macropixel are counted side by side; `None` where they are not.
    pub(super) fn layout(&self, pixel: &Pixel<'_>) -> Option<Layout> {
        let (config, light, sight) = (self.stream.config(), pixel.light, pixel.sight);
        let is_paralysable = config.spads.law == DeadTimeLaw::Paralysable;
        let last_cycle = config.laser_cycles.checked_sub(1)?;
        let is_packed = self.stream.spads() == SPADS && light.is_alone();
        if !is_packed || light.has_listed_echo() {
            return None;
        }
        let begin = self.beginning(pixel, last_cycle)?;
        let begins_fs = begin.begins_fs(self.stream, light, last_cycle);
        let echoes = light.echoes_within(&(begins_fs - ROUNDING_FS..sight.until_fs + ROUNDING_FS));
        let has_echo = !echoes.is_empty();
        if (has_echo && is_paralysable) || echoes.into_iter().any(|later| later != 0) {
            return None;
        }
        let relative = |cycle: u32| i64::from(cycle) - i64::from(last_cycle);
        let first_cycle = u32::try_from(1 - relative(begin.cycle)).ok()?;
        let mut blocks = Vec::new();
        let Beginning {
            mut cycle,
            mut block,
            ..
        } = begin;
        while cycle < last_cycle || light.block_fs(block).start < sight.until_fs {
            blocks.push((relative(cycle), block));
            block += 1;
            if block == light.blocks() {
                (cycle, block) = (cycle + 1, 0);
                if cycle > last_cycle {
                    break;
                }
            }
        }
        let period_fs = 1e15 / self.engine.exposure.clock.as_hz();
        let doubt = (ROUNDING_FS + 3) as f64 / period_fs * f64::from(1 << FRACTION_BITS);
        Some(Layout {
            blocks,
            first_cycle,
            until_fs: sight.until_fs,
            dead_fs: config.spads.dead_time.as_fs(),
            wanted_from_fs: sight.first_fs - ROUNDING_FS,
            is_paralysable,
            origin_fs: sight.first_fs - period_fs as i64,
            periods_per_fs: (2f64.powi(64) / period_fs) as u64,
            doubt: doubt.ceil() as u64 + 3,
            rows: self.engine.sensor.bins,
            has_clk_bins: self.engine.law.has_clk_bins(),
        })
    }

    /// Counts the windows of [`TILE`] laser cycles, or those that are left of the exposure.
    pub(super) fn count_tile(&mut self, pixel: &mut Pixel<'_>, layout: &Layout, first_cycle: u32) {
        let config = self.stream.config();
        let light = pixel.light;
        let lanes = (config.laser_cycles - first_cycle).min(TILE as u32) as usize;
        let cycle = |lane: usize| first_cycle + lane as u32;
        let moved_fs = |relative: i64, lane: usize| match relative {
            0 => 0,
            _ => {
                let own = cycle(lane);
                let other = (i64::from(own) + relative) as u32;
                (self.stream.cycle_start(other) - self.stream.cycle_start(own)).as_fs()
            }
        };
        let mut tile = self.tile.take().unwrap_or_default();
        let (relative, block) = layout.blocks[0];
        let start_fs = light.block_fs(block).start;
        tile.begin(
            layout,
            std::array::from_fn(|lane| match lane < lanes {
                true => start_fs + moved_fs(relative, lane),
                false => 0,
            }),
        );
        for lane in 0..lanes {
            tile.undecided |= u16::from(self.breeds_about(pixel, cycle(lane))) << lane;
        }
        light.first_arrivals(first_cycle, &mut tile.next_fs);
        if !light.echo_fs().is_empty() {
            light.echo_words(first_cycle, 1, &mut tile.second_words);
        }
        let mut drawn = 0;
        for &(relative, block) in &layout.blocks {
            let first_other = (i64::from(first_cycle) + relative) as u32;
            let mut background = light.background(
                first_other,
                block,
                layout.until_fs - relative * self.stream.cycle_fs() + ROUNDING_FS,
            );
            let end_fs = background.end_fs();
            let moved_fs: [i64; TILE] = std::array::from_fn(|lane| match lane < lanes {
                true => moved_fs(relative, lane),
                false => 0,
            });
            while background.draw() {
                for lane in 0..lanes {
                    for (times_fs, words) in background.times_fs.iter().zip(&background.words) {
                        let time_fs = times_fs[lane];
                        if time_fs >= end_fs {
                            break;
                        }
                        drawn += 1;
                        let time_fs = time_fs + moved_fs[lane];
                        if time_fs < layout.until_fs {
                            tile.photon(
                                layout,
                                light,
                                cycle(lane),
                                lane,
                                spad_of(words[lane], SPADS),
                                time_fs,
                            );
                        }
                    }
                }
            }
        }
        for spad in 0..SPADS {
            for lane in 0..lanes {
                if tile.next_fs[spad][lane] < layout.until_fs {
                    tile.echo_until(layout, light, cycle(lane), lane, spad, layout.until_fs - 1);
                }
            }
        }
        pixel.work.photons_drawn += drawn;
        for lane in 0..lanes {
            if tile.undecided >> lane & 1 != 0 {
                self.count_bright_cycle(pixel, cycle(lane));
                continue;
            }
            if !layout.has_clk_bins {
                std::mem::swap(&mut self.events, &mut tile.pulses[lane]);
                self.events.sort_unstable();
                let window = Placed {
                    start: Time::ZERO,
                    ..self.window(pixel.sight, cycle(lane))
                };
                self.count_events(pixel, &window);
                pixel.work.lost_to_dead_time += u64::from(tile.tally[lane].lost);
                continue;
            }
            pixel.work.pulses += u64::from(tile.tally[lane].pulses);
            pixel.work.cancelled += u64::from(tile.tally[lane].cancelled);
            pixel.work.lost_to_dead_time += u64::from(tile.tally[lane].lost);
            let fired = &tile.fired[lane][1..=layout.rows];
            pixel.work.clk_periods_visited += count_rows(fired, &self.adds, &mut pixel.hits);
        }
        self.tile = Some(tile);
    }
}
