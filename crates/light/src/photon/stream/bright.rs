//! The photons of bright macropixels, drawn laser cycle by laser cycle.
//!
//! In bright light nearly every SPAD of every laser cycle has photons that must be compared with each other, and a SPAD's
//! state is rarely known without a look at what was before. So photons are drawn in the order in which they come, and
//! of those that meet a blind SPAD as few as possible:
//!
//! ```text
//!   background   one key per (macropixel, laser cycle, block of 16 slots); gaps are exponential
//!                ├──┼──────┼─┼────────┼───┤
//!   echo         one key per (macropixel, laser cycle, SPAD); each photon is the first one after its SPAD is ready
//!                      ▁▂▅█▅▂▁
//!                SPAD 0  │▔▔▔▔▔▔▔▔▔  no photon of the dead time is drawn
//!                SPAD 1   │▔▔▔▔▔▔▔▔▔
//! ```
//!
//! The k-th photon of an echo that a SPAD can see comes where the cumulated intensity has grown by an exponential
//! number since the SPAD became ready: a Poisson process has no memory. So an echo costs what is detected, not what
//! shines. Which photon is the next one depends on the SPAD's state; code that draws an echo has to know it from the
//! echo's beginning on ([`Avalanches`](crate::photon::Avalanches) tells where it does not).
//!
//! Echoes of measured pulses or of half a laser cycle, those of light with several layers, and photons whose
//! avalanches trigger others, are drawn photon by photon (`listed`).

#![allow(
    unsafe_code,
    reason = "multiversion calls what the processor was asked for"
)]

use std::ops::Range;

use multiversion::multiversion;

use super::part::{PhotonKind, PixelStream};
use crate::numerics::branchless;
use crate::photon::philox::{LANES, blocks_from};
use crate::photon::spad::Photon;
use crate::units::Time;

/// Slots of a block of background photons.
const BLOCK_SLOTS: u32 = 16;

/// Laser cycles that are drawn side by side.
pub const TILE: usize = 2 * LANES;

/// Photons that one block of random words makes.
pub(super) const PER_BLOCK: usize = 4;

/// Second counter word of a block's k-th chunk of photons: k has its low bits below the block's and the others above. A block
/// has room for 65 536 photons; at 200 Gcounts/s, where other limits are long passed, 16 slots of 4 ns have 13 000.
fn chunk_word(block: u32, chunk: u32) -> u32 {
    const LOW_BITS: u32 = 10;
    const BLOCK_BITS: u32 = 18;
    chunk >> LOW_BITS << (LOW_BITS + BLOCK_BITS)
        | block << LOW_BITS
        | (chunk & ((1 << LOW_BITS) - 1))
}

/// Random words of a gap: the highest 28 bits make a number strictly between 0 and 1, the lowest ones the SPAD: 4, or a few
/// more where there are more SPADs, which then share what hardly moves the gap.
#[inline(always)]
fn gap_in_means(word: u32) -> f64 {
    -branchless::ln(uniform(word))
}

#[inline(always)]
fn uniform(word: u32) -> f64 {
    (branchless::real(u64::from(word >> 4)) + 0.5) * 0.5f64.powi(28)
}

/// A block of background photons of [`TILE`] successive laser cycles, some photons of each at a time.
pub struct BackgroundBlock<'a> {
    pixel: &'a PixelStream<'a>,
    first_cycle: u32,
    block: u32,
    chunk: u32,
    start_fs: i64,
    length: f64,
    /// Photons from then on are not asked for, fs after the start of the block.
    until: f64,
    /// When the last photon of each cycle came, fs after the start of the block.
    at: [f64; TILE],
    /// Times after the start of the cycle, fs, photon by photon; those from the end of the block on are none.
    pub times_fs: [[i64; TILE]; PER_BLOCK],
    /// Their SPADs in the lowest bits ([`spad_of`]).
    pub words: [[u32; TILE]; PER_BLOCK],
}

/// The SPAD of a background photon's random word, in a macropixel of `spads`, a power of two.
#[inline(always)]
pub fn spad_of(word: u32, spads: usize) -> usize {
    word as usize & (spads - 1)
}

impl BackgroundBlock<'_> {
    /// Draws the next photons of all cycles. False where none of them has another one; then there are no photons.
    #[inline]
    pub fn draw(&mut self) -> bool {
        if self.at.iter().all(|&at| at >= self.until) {
            return false;
        }
        let second = chunk_word(self.block, self.chunk);
        self.chunk += 1;
        let others = [
            second,
            self.pixel.pixel,
            self.pixel.kind.bright_background(),
        ];
        blocks_from(self.first_cycle, others, self.pixel.key, &mut self.words);
        add_gaps(
            &mut self.at,
            self.pixel.gap_fs,
            self.start_fs,
            &self.words,
            &mut self.times_fs,
        );
        true
    }

    /// When the block ends, fs after the start of the cycle.
    pub fn end_fs(&self) -> i64 {
        self.start_fs + self.length as i64
    }
}

#[multiversion(targets(
    "x86_64+avx512f+avx512bw+avx512dq+avx512vl",
    "x86_64+avx2",
    "x86_64+sse4.1"
))]
fn add_gaps(
    at: &mut [f64; TILE],
    gap_fs: f64,
    start_fs: i64,
    words: &[[u32; TILE]; PER_BLOCK],
    times_fs: &mut [[i64; TILE]; PER_BLOCK],
) {
    let mut lns = [0.0; PER_BLOCK * TILE];
    for (number, &word) in lns.iter_mut().zip(words.as_flattened()) {
        *number = uniform(word);
    }
    branchless::ln_of_all(&mut lns);
    for (lns, times_fs) in lns.chunks_exact(TILE).zip(times_fs) {
        for ((at, ln), time_fs) in at.iter_mut().zip(lns).zip(times_fs) {
            *at = (*at - ln * gap_fs).min(FARTHEST);
            *time_fs = start_fs + branchless::count(branchless::floor(*at)) as i64;
        }
    }
}

/// Times are cut off there, fs: far beyond any block, and small enough to be counted.
const FARTHEST: f64 = (1u64 << 50) as f64;

impl<'a> PixelStream<'a> {
    /// Mean number of background photons of a SPAD in a dead time, within a time after the start of a laser cycle: the greatest.
    pub fn per_dead_time(&self, within_fs: &Range<i64>) -> f64 {
        self.greatest_share(within_fs) * self.stream.config.spads.dead_time.as_fs() as f64
            / (self.gap_fs * self.stream.spads() as f64)
    }

    /// Mean number of photons of a SPAD within a time after the start of a laser cycle, averaged over the exposure. Those of an ordered echo, and of other
    /// lasers, are left out; a measured pulse is taken for even.
    pub fn photons_within(&self, within_fs: &Range<i64>) -> f64 {
        let cycle_fs = self.stream.cycle_fs();
        let profile = self.limits.as_ref().and_then(|l| l.profile.as_ref());
        let background = match profile {
            None => (within_fs.end - within_fs.start) as f64 / self.gap_fs,
            Some(profile) => {
                let (from_fs, until_fs) = (within_fs.start as f64, within_fs.end as f64);
                let before_fs = cycle_fs as f64;
                profile.photons(from_fs, until_fs)
                    + profile.photons(from_fs + before_fs, until_fs.min(0.0) + before_fs)
            }
        };
        let mut photons = background / self.stream.spads() as f64;
        if self.has_listed_echo() && self.foreign.is_none() {
            let until = |time_fs: i64| match self.shape {
                None => self.passed_until(time_fs),
                Some(_) => {
                    let (first_fs, last_fs) = self.echo_fs;
                    let passed = (time_fs - first_fs) as f64 / (last_fs - first_fs).max(1) as f64;
                    self.signal_per_spad * passed.clamp(0.0, 1.0)
                }
            };
            for later in self.echoes_within(within_fs) {
                let moved_fs = later * cycle_fs;
                photons += until(within_fs.end - moved_fs) - until(within_fs.start - moved_fs);
            }
        }
        let laser_cycles = self.stream.config.laser_cycles;
        let lit = self.limits.as_ref().map(|limits| limits.cycles.len());
        photons * lit.map_or(1.0, |lit| lit as f64 / f64::from(laser_cycles))
    }

    /// Whether photons of the echo are drawn only where their SPAD is ready ([`OrderedEchoes`](super::OrderedEchoes)).
    ///
    /// Such an echo has to be followed from its beginning. Where echoes come one upon the other, that would be from the
    /// beginning of the exposure, for each window.
    pub fn has_ordered_echo(&self) -> bool {
        let is_gaussian = self.shape.is_none();
        let is_short = self.echo_fs.1 - self.echo_fs.0 < self.stream.cycle_fs() / 2;
        let is_plain = self.kind == PhotonKind::Plain;
        let is_drawn_so = self.is_bright && self.is_alone && is_plain;
        is_drawn_so && is_gaussian && is_short && self.signal_per_spad > 0.0
    }

    /// Whether there is an echo whose photons are drawn one by one, whatever the SPADs do.
    pub fn has_listed_echo(&self) -> bool {
        let is_echo = self.signal_per_spad > 0.0 && !self.has_ordered_echo();
        is_echo || self.foreign.is_some()
    }

    /// Photons of a laser cycle's echo that are held in memory at once for each of [`TILE`] laser cycles, on average.
    pub fn listed_photons(&self) -> f64 {
        if self.has_listed_echo() && self.foreign.is_none() {
            self.signal_per_spad * self.stream.spads() as f64
        } else {
            0.0
        }
    }

    /// The block of background photons that is running `time_fs` after the start of a cycle.
    pub fn block_at(&self, time_fs: i64) -> u32 {
        let ends_fs = self.stream.ends_fs();
        let slots = self.stream.slots;
        let slot = slots.slot_at(time_fs.clamp(ends_fs.start, ends_fs.end - 1));
        slot.min(slots.count - 1) / BLOCK_SLOTS
    }

    /// Blocks of a laser cycle.
    pub fn blocks(&self) -> u32 {
        self.stream.slots.count.div_ceil(BLOCK_SLOTS)
    }

    /// When a block begins and ends, fs after the start of its cycle.
    pub fn block_fs(&self, block: u32) -> Range<i64> {
        let slots = self.stream.slots;
        let end = (block + 1) * BLOCK_SLOTS;
        let end_fs = if end >= slots.count {
            self.stream.ends_fs().end
        } else {
            slots.start_fs(end)
        };
        slots.start_fs(block * BLOCK_SLOTS)..end_fs
    }

    /// A block of background photons in [`TILE`] laser cycles from `first_cycle` on; those that come later than `until_fs`
    /// after the start of the cycle may be missing.
    pub fn background(&self, first_cycle: u32, block: u32, until_fs: i64) -> BackgroundBlock<'_> {
        let block_fs = self.block_fs(block);
        let length = (block_fs.end - block_fs.start) as f64;
        BackgroundBlock {
            pixel: self,
            first_cycle,
            block,
            chunk: 0,
            start_fs: block_fs.start,
            length,
            until: length.min((until_fs - block_fs.start) as f64),
            at: if self.gap_fs.is_finite() {
                [0.0; TILE]
            } else {
                [f64::INFINITY; TILE]
            },
            times_fs: [[0; TILE]; PER_BLOCK],
            words: [[0; TILE]; PER_BLOCK],
        }
    }

    /// Appends the background photons of one block of one laser cycle that come before `until_fs` after the start of the cycle, in their order; those
    /// before the exposure are none.
    pub fn push_block(&self, cycle: u32, block: u32, until_fs: i64, photons: &mut Vec<Photon>) {
        if !self.gap_fs.is_finite() || !self.draws_background_in(cycle) {
            return;
        }
        let block_fs = self.block_fs(block);
        let share = self.greatest_share(&block_fs);
        if share == 0.0 {
            return;
        }
        let gap_fs = self.gap_fs / share;
        let length = (block_fs.end.min(until_fs) - block_fs.start) as f64;
        let start = self.stream.cycle_start(cycle);
        let mut at = 0.0;
        for chunk in 0.. {
            let second = chunk_word(block, chunk);
            let counter = [cycle, second, self.pixel, self.kind.bright_background()];
            for word in rand_philox::philox4x32_10(counter, self.key) {
                at += gap_in_means(word) * gap_fs;
                if at >= length {
                    return;
                }
                let time_fs = block_fs.start + at as i64;
                let (time, spad) = (
                    start + Time::from_fs(time_fs),
                    spad_of(word, self.stream.spads()) as u8,
                );
                let is_kept = self.limits.is_none() || {
                    let words = [word, second.rotate_left(16) ^ cycle];
                    self.keeps_background(cycle, spad, time_fs, share, words)
                };
                if time >= Time::ZERO && is_kept {
                    photons.push(Photon::new(time, spad, self.kind == PhotonKind::Triggering));
                }
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn no_two_chunks_have_one_word() {
        let chunks = (0..40).flat_map(|block| (0..16_384).map(move |chunk| (block, chunk)));
        let far = (262_100..262_144).flat_map(|block| (0..16_384).map(move |chunk| (block, chunk)));
        let words: std::collections::HashSet<u32> = chunks
            .chain(far)
            .map(|(block, chunk)| chunk_word(block, chunk))
            .collect();
        assert_eq!(words.len(), (40 + 44) * 16_384);
    }
}
