//! From random words to histogram bins, many photons at a time.
//!
//! A photon's place in the window is a number of CLK periods with 24 binary places, which decides its bin unless
//! it comes within a few femtoseconds of an edge; such photons are marked and settled exactly, one by one.
//! Bins have a row before them for photons that matter only as blinders, and one after them for those that do not
//! matter at all.
//!
//! ```text
//!   code    31        23         15           4        0
//!          ┌──────────┬──────────┬────────────┬────────┐
//!          │ doubtful │ row      │ cycle      │ SPAD   │
//!          └──────────┴──────────┴────────────┴────────┘
//! ```

use multiversion::multiversion;

use super::sight::ROUNDING_FS;
use crate::photon::{Draw, GROUP, Place, SLOT, SPADS};

/// Binary places of a position in CLK periods.
const FRACTION_BITS: u32 = 24;
const FRACTION: u32 = (1 << FRACTION_BITS) - 1;

/// Whole CLK periods added to positions, so that a slot that reaches into the window starts above 0.
const BIAS: u32 = 32;

/// Adding it to a number below 2³² leaves its nearest integer in the low half.
const INTEGER: f64 = (1u64 << 52) as f64;

const DOUBTFUL: u32 = 1 << 31;
const ROW_BITS: u32 = 16;
const SPAD_BITS: u32 = SPADS.trailing_zeros();

/// Rows that a code can name.
pub const ROWS: usize = 256;

/// Cycles that a code can name: those of a group, and more for photons that are none.
pub const CYCLES: usize = 2 * GROUP as usize;

const _: () = assert!(CYCLES << SPAD_BITS <= 1 << ROW_BITS);

/// A photon's row, cycle and SPAD.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Code(u32);

impl Code {
    /// No photon. It has a row and a cycle that nobody looks at.
    pub const NONE: Code = Code((ROWS as u32 - 1) << ROW_BITS | GROUP << SPAD_BITS);

    /// Cycle within the group.
    #[inline]
    pub fn cycle(self) -> usize {
        (self.0 >> SPAD_BITS) as usize % CYCLES
    }

    /// SPAD.
    #[inline]
    pub fn spad(self) -> u8 {
        (self.0 % SPADS as u32) as u8
    }

    /// Bin + 1; 0 before the window.
    #[inline]
    pub fn row(self) -> usize {
        (self.0 >> ROW_BITS) as usize % ROWS
    }

    /// Whether the photon is too close to an edge.
    #[inline]
    pub fn is_doubtful(self) -> bool {
        self.0 & DOUBTFUL != 0
    }
}

/// Which photons of a draw are wanted, and what for.
#[derive(Debug, Clone, Copy)]
pub struct Wanted {
    /// Those of cycles before this one of the group.
    pub cycles: u32,
    /// By how many cycles their windows come after them.
    pub later: u32,
    /// When bin 0 begins, counted from the start of their own cycle, fs.
    pub origin_fs: i64,
}

/// Bins of one window. Times are relative to the start of bin 0.
#[derive(Debug, Clone, Copy)]
pub struct Binning {
    bins: u32,
    /// CLK periods of a femtosecond.
    periods_per_fs: f64,
    /// CLK periods of a slot.
    periods_per_slot: f64,
    /// What makes a position out of a random word for the time in a slot.
    scale: u32,
    /// Distance from an edge that leaves a position in doubt.
    doubt: u32,
}

impl Binning {
    /// For `bins` bins (1 to 64) of a CLK of at most 2 GHz.
    pub fn new(bins: usize, clk_hz: f64) -> Self {
        let periods_per_fs = clk_hz * 1e-15;
        let one = f64::from(FRACTION + 1);
        let periods_per_slot = SLOT.as_fs() as f64 * periods_per_fs;
        // One more femtosecond for the bits of the word beyond whole femtoseconds, a little for the arithmetic.
        let doubt_fs = (ROUNDING_FS + 1) as f64;
        Binning {
            bins: bins as u32,
            periods_per_fs,
            periods_per_slot,
            scale: (periods_per_slot * one).round() as u32,
            doubt: (doubt_fs * periods_per_fs * one).ceil() as u32 + 3,
        }
    }

    /// Appends the codes of a draw, those of its background photons (by halves, as [`Draw::words`] has them) before those
    /// of its signal. `bases` is for intermediate results.
    pub fn encode(
        &self,
        draw: &Draw,
        wanted: &Wanted,
        bases: &mut Vec<u32>,
        codes: &mut Vec<Code>,
    ) {
        let first = codes.len();
        let filled_up = draw.slots().len();
        codes.resize(first + 2 * filled_up, Code::NONE);
        let (low, high) = codes[first..].split_at_mut(filled_up);
        let shift = draw.group().place_shift();
        bases.resize(filled_up.max(bases.len()), 0);
        let bases = &mut bases[..filled_up];
        find_bases(self, wanted.origin_fs, draw.slots(), bases);
        for (words, codes) in draw.words().into_iter().zip([&mut *low, &mut *high]) {
            encode(self, wanted, shift, words, bases, codes);
        }
        low[draw.blocks()..].fill(Code::NONE);
        high[draw.blocks()..].fill(Code::NONE);
        for run in draw.runs() {
            let [_, second] = run.blocks();
            if run.photons % 2 == 1 {
                codes[first + filled_up + second.end] = Code::NONE;
            }
        }
        for (half, block) in draw.outlasting() {
            codes[first + half * filled_up + block] = Code::NONE;
        }
        let (end, later) = (wanted.cycles << SPAD_BITS, wanted.later << SPAD_BITS);
        codes.extend(draw.signal().iter().map(|photon| {
            let place = u32::from(photon.place);
            let position = self.position(photon.time_fs - wanted.origin_fs);
            let wanted = self.code(position, place + later);
            if place < end { wanted } else { Code::NONE }
        }));
    }

    /// The code of one photon at `time_fs`.
    #[inline]
    pub fn encode_one(&self, time_fs: i64, place: Place) -> Code {
        self.code(self.position(time_fs), u32::from(place))
    }

    #[inline(always)]
    fn position(&self, time_fs: i64) -> u32 {
        let periods = time_fs as f64 * self.periods_per_fs;
        // Far outside, a position between two edges will do.
        let (first, last) = (-1.5, f64::from(self.bins) + 1.5);
        let periods = if periods > first { periods } else { first };
        let periods = if periods < last { periods } else { last };
        ((periods + f64::from(BIAS)) * f64::from(FRACTION + 1) + INTEGER).to_bits() as u32
    }

    #[inline(always)]
    fn code(&self, position: u32, place: u32) -> Code {
        let is_doubtful = position.wrapping_add(self.doubt) & FRACTION < 2 * self.doubt;
        let row = (position >> FRACTION_BITS).clamp(BIAS - 1, BIAS + self.bins) - (BIAS - 1);
        Code(u32::from(is_doubtful) << 31 | row << ROW_BITS | place)
    }
}

/// The positions at which slots begin.
#[multiversion(targets("x86_64+avx2", "x86_64+sse4.1"))]
fn find_bases(binning: &Binning, origin_fs: i64, slots: &[u32], bases: &mut [u32]) {
    let one = f64::from(FRACTION + 1);
    let origin = origin_fs as f64 * binning.periods_per_fs;
    let last = f64::from(binning.bins) + 1.0;
    for (&slot, base) in slots.iter().zip(bases) {
        let periods = f64::from(slot) * binning.periods_per_slot - origin;
        // No slot is as long.
        let periods = if periods > -16.0 { periods } else { -16.0 };
        let periods = if periods < last { periods } else { last };
        *base = ((periods + f64::from(BIAS)) * one + INTEGER).to_bits() as u32;
    }
}

#[multiversion(targets("x86_64+avx2", "x86_64+sse4.1"))]
fn encode(
    binning: &Binning,
    wanted: &Wanted,
    place_shift: u32,
    words: &[u64],
    bases: &[u32],
    codes: &mut [Code],
) {
    let (binning, wanted) = (*binning, *wanted);
    let (end, later) = (wanted.cycles << SPAD_BITS, wanted.later << SPAD_BITS);
    for ((&word, &base), code) in words.iter().zip(bases).zip(codes) {
        let offset = ((word & 0xFFFF_FFFF) * u64::from(binning.scale)) >> 32;
        let position = base.wrapping_add(offset as u32);
        let place = (word >> place_shift) as u32;
        let wanted = binning.code(position, place + later);
        *code = if place < end { wanted } else { Code::NONE };
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::photon::{Group, time_in_slot_fs};
    use proptest::prelude::*;

    proptest! {
        /// Whatever is not in doubt is in the bin that whole numbers say.
        #[test]
        fn codes_are_those_of_whole_numbers(
            bins in 1usize..=64,
            period_fs in 500_000i64..1_000_000_000,
            slot in 0u32..6000,
            start_fs in -2_000_000_000i64..2_000_000_000,
            near in 0i64..65,
            off in -20i64..20,
            word: u32,
            place: u32,
            cycles in 1u32..=GROUP,
            later in 0u32..2,
            aimed: bool,
        ) {
            let binning = Binning::new(bins, 1e15 / period_fs as f64);
            let in_slot_fs = i64::from(time_in_slot_fs(u64::from(word)));
            // Half of the photons come close to an edge.
            let start_fs = if aimed { near * period_fs + off - in_slot_fs } else { start_fs };
            let time_fs = start_fs + in_slot_fs;
            let origin_fs = i64::from(slot) * SLOT.as_fs() - start_fs;
            let row = (time_fs.div_euclid(period_fs) + 1).clamp(0, bins as i64 + 1) as usize;
            let off_edge = time_fs.rem_euclid(period_fs).min(period_fs - time_fs.rem_euclid(period_fs));
            let wanted = Wanted { cycles, later, origin_fs };
            let shift = Group::of_cycle(GROUP).place_shift();
            let photon = u64::from(place) << 32 | u64::from(word);
            let (mut base, mut codes) = ([0], [Code::NONE]);
            find_bases(&binning, origin_fs, &[slot], &mut base);
            encode(&binning, &wanted, shift, &[photon], &base, &mut codes);
            let place = (photon >> shift) as u32;
            if place / 16 >= cycles {
                prop_assert_eq!(codes[0], Code::NONE);
                return Ok(());
            }
            let place = place + 16 * later;
            for code in [codes[0], binning.encode_one(time_fs, place as Place)] {
                prop_assert_eq!(code.cycle() as u32, place / 16);
                prop_assert_eq!(u32::from(code.spad()), place % 16);
                if code.is_doubtful() {
                    let resolution = period_fs >> 22;
                    prop_assert!(off_edge <= 8 + resolution || !(1..=bins).contains(&row), "{off_edge}");
                } else {
                    prop_assert_eq!(code.row(), row);
                    prop_assert!(off_edge > ROUNDING_FS || row == 0 || row > bins);
                }
            }
        }
    }

    #[test]
    fn nobody_looks_at_what_is_no_photon() {
        assert_eq!(Code::NONE.cycle(), GROUP as usize);
        assert!(Code::NONE.row() > 64 + 1 && !Code::NONE.is_doubtful());
    }
}
