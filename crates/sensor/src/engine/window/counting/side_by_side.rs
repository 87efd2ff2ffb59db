//! Counting bright macropixels, many laser cycles at a time: which may be counted so, and what is drawn for them.
//!
//! Lanes that a [`Tile`](super::tile::Tile) leaves undecided are left to
//! [`count_bright_cycle`](super::Counting::count_bright_cycle).

use super::bright::Beginning;
use super::tile::{FRACTION_BITS, Layout, count_rows};
use super::{Counting, CycleWindow, Pixel};
use crate::engine::window::codes::SPADS;
use crate::engine::window::sight::ROUNDING_FS;
use crate::photon::{DeadTimeLaw, TILE, spad_of};
use crate::units::Time;

impl Counting<'_> {
    /// How windows of a macropixel are counted side by side; `None` where they are not.
    pub(super) fn layout(&self, pixel: &Pixel<'_>) -> Option<Layout> {
        let (config, light, sight) = (self.stream.config(), pixel.light, pixel.sight);
        let is_paralysable = config.spads.law == DeadTimeLaw::Paralysable;
        let last_cycle = config.laser_cycles.checked_sub(1)?;
        let is_alike = config.spads.dead_time_spread == 0.0;
        let is_packed = self.stream.spads() == SPADS && light.is_alone && is_alike;
        // Where one avalanche in a hundred causes another, counting side by side leaves many laser cycles to be counted alone, and takes longer.
        if !is_packed || light.has_listed_echo() || pixel.has_secondaries() {
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
            std::array::from_fn(|lane| {
                if lane < lanes {
                    start_fs + moved_fs(relative, lane)
                } else {
                    0
                }
            }),
        );
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
            let moved_fs: [i64; TILE] = std::array::from_fn(|lane| {
                if lane < lanes {
                    moved_fs(relative, lane)
                } else {
                    0
                }
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
                let window = CycleWindow {
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
