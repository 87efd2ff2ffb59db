//! From random words to histogram bins, many photons at a time.
//!
//! A photon's place in the window is a number of CLK periods with 24 binary places, which decides its bin unless
//! it comes within a few femtoseconds of an edge; such photons are marked and settled exactly, one by one.
//! Bins have a row before them for photons that matter only as blinders, and one after them for those that do not
//! matter at all.
//!
//! ```text
//!   code    31        20         13           4        0
//!          ┌──────────┬──────────┬────────────┬────────┐
//!          │ doubtful │ row      │ cycle      │ SPAD   │      cell = row, cycle
//!          └──────────┴──────────┴────────────┴────────┘
//! ```

use multiversion::multiversion;

use super::sight::ROUNDING_FS;
use crate::photon::{GROUP, PLACE_BITS, SLOT, SPADS};

/// Binary places of a position in CLK periods.
const FRACTION_BITS: u32 = 24;
const FRACTION: u32 = (1 << FRACTION_BITS) - 1;

/// Whole CLK periods added to positions, so that a slot that reaches into the window starts above 0.
const BIAS: u32 = 32;

const DOUBTFUL: u32 = 1 << 31;
const SPAD_BITS: u32 = SPADS.trailing_zeros();

/// Cells of one row.
pub const ROW: usize = GROUP as usize;

/// A photon's row, cycle and SPAD.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Code(pub u32);

impl Code {
    /// Cycle within the group and SPAD.
    #[inline]
    pub fn place(self) -> usize {
        (self.0 & ((1 << PLACE_BITS) - 1)) as usize
    }

    /// Bin + 1; 0 before the window.
    #[inline]
    pub fn row(self) -> usize {
        ((self.0 & !DOUBTFUL) >> PLACE_BITS) as usize
    }

    /// Index of row and cycle in a table of [`ROW`] cycles.
    #[inline]
    pub fn cell(self) -> usize {
        ((self.0 & !DOUBTFUL) >> SPAD_BITS) as usize
    }

    /// The same in another cycle.
    #[inline]
    pub fn in_cycle(self, cycle: usize) -> Self {
        let place = (cycle * SPADS) as u32;
        let others = !(((GROUP - 1) << SPAD_BITS) & ((1 << PLACE_BITS) - 1));
        Code(self.0 & others | place)
    }

    /// Whether the photon is too close to an edge.
    #[inline]
    pub fn is_doubtful(self) -> bool {
        self.0 & DOUBTFUL != 0
    }
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

    /// Rows of the table of cells.
    pub fn rows(&self) -> usize {
        self.bins as usize + 2
    }

    /// The position of a slot that begins at `start_fs`.
    pub fn base(&self, start_fs: i64) -> u32 {
        let periods = start_fs as f64 * self.periods_per_fs;
        let last = f64::from(self.bins) + 1.0;
        if periods + self.periods_per_slot < -1.0 {
            return 0;
        }
        ((periods.min(last) + f64::from(BIAS)) * f64::from(FRACTION + 1)).round() as u32
    }

    /// Codes of photons from their random words for time and place, and their slots' bases.
    pub fn encode(&self, times: &[u32], places: &[u32], bases: &[u32], codes: &mut Vec<Code>) {
        let first = codes.len();
        codes.resize(first + times.len(), Code(0));
        encode(self, times, places, bases, &mut codes[first..]);
    }

    /// The code of one photon at `time_fs`.
    #[inline]
    pub fn encode_one(&self, time_fs: i64, place: u16) -> Code {
        let periods = time_fs as f64 * self.periods_per_fs;
        // Far outside, a position between two edges will do.
        let periods = periods.clamp(-1.5, f64::from(self.bins) + 1.5);
        let position = (periods + f64::from(BIAS)) * f64::from(FRACTION + 1);
        self.code(position as u32, u32::from(place))
    }

    #[inline(always)]
    fn code(&self, position: u32, place: u32) -> Code {
        let is_doubtful = position.wrapping_add(self.doubt) & FRACTION < 2 * self.doubt;
        let row = (position >> FRACTION_BITS).clamp(BIAS - 1, BIAS + self.bins) - (BIAS - 1);
        Code(u32::from(is_doubtful) << 31 | row << PLACE_BITS | place)
    }
}

#[multiversion(targets("x86_64+avx2", "x86_64+sse4.1"))]
fn encode(binning: &Binning, times: &[u32], places: &[u32], bases: &[u32], codes: &mut [Code]) {
    let words = times.iter().zip(places).zip(bases);
    for (((&time, &place), &base), code) in words.zip(codes) {
        let offset = (u64::from(time) * u64::from(binning.scale)) >> 32;
        let position = base.wrapping_add(offset as u32);
        *code = binning.code(position, place >> (32 - PLACE_BITS));
    }
}

/// What the cells of a row hold.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq)]
pub struct Tally {
    /// Cells with a number of SPADs from `least` to `most`.
    pub within: u64,
    /// Cells with any SPAD.
    pub occupied: u64,
    /// SPADs altogether.
    pub spads: u64,
}

/// Tallies numbers of SPADs (0 to 16 each), at most [`ROW`] of them.
#[multiversion(targets("x86_64+avx2", "x86_64+sse4.1"))]
pub fn tally(cells: &[u8], least: u8, most: u8) -> Tally {
    const LANES: usize = 64;
    // Eight times sixteen at most: a byte holds it.
    const { assert!(ROW / LANES * SPADS <= 255) };
    let span = most.wrapping_sub(least);
    let (mut within, mut occupied, mut spads) = ([0u8; LANES], [0u8; LANES], [0u8; LANES]);
    let (chunks, rest) = cells.as_chunks::<LANES>();
    for chunk in chunks {
        for lane in 0..LANES {
            within[lane] += u8::from(chunk[lane].wrapping_sub(least) <= span);
            occupied[lane] += u8::from(chunk[lane] != 0);
            spads[lane] += chunk[lane];
        }
    }
    for (lane, &cell) in rest.iter().enumerate() {
        within[lane] += u8::from(cell.wrapping_sub(least) <= span);
        occupied[lane] += u8::from(cell != 0);
        spads[lane] += cell;
    }
    let sum = |lanes: [u8; LANES]| lanes.iter().map(|&n| u64::from(n)).sum();
    Tally {
        within: sum(within),
        occupied: sum(occupied),
        spads: sum(spads),
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    proptest! {
        /// Whatever is not in doubt is in the bin that whole numbers say.
        #[test]
        fn codes_are_those_of_whole_numbers(
            bins in 1usize..=64,
            period_fs in 500_000i64..1_000_000_000,
            start_fs in -2_000_000_000i64..2_000_000_000,
            near in 0i64..65,
            off in -20i64..20,
            word: u32,
            place in 0u16..1 << 13,
            aimed: bool,
        ) {
            let binning = Binning::new(bins, 1e15 / period_fs as f64);
            // Half of the photons come close to an edge.
            let start_fs = if aimed { near * period_fs + off - i64::from(word >> 9) } else { start_fs };
            let time_fs = start_fs + i64::from(word >> 9);
            let row = (time_fs.div_euclid(period_fs) + 1).clamp(0, bins as i64 + 1) as usize;
            let off_edge = time_fs.rem_euclid(period_fs).min(period_fs - time_fs.rem_euclid(period_fs));
            let mut codes = Vec::new();
            binning.encode(&[word], &[u32::from(place) << 19], &[binning.base(start_fs)], &mut codes);
            for code in [codes[0], binning.encode_one(time_fs, place)] {
                prop_assert_eq!(code.place(), usize::from(place));
                prop_assert_eq!(code.cell(), code.row() * ROW + usize::from(place >> 4));
                if code.is_doubtful() {
                    let resolution = period_fs >> 22;
                    prop_assert!(off_edge <= 8 + resolution || !(1..=bins).contains(&row), "{off_edge}");
                } else {
                    prop_assert_eq!(code.row(), row);
                    prop_assert!(off_edge > ROUNDING_FS || row == 0 || row > bins);
                }
            }
        }

        #[test]
        fn tallies_count(cells in prop::collection::vec(0u8..=16, 0..=ROW), least in 0u8..20, more in 0u8..236) {
            let most = least + more;
            let expected = Tally {
                within: cells.iter().filter(|c| (least..=most).contains(c)).count() as u64,
                occupied: cells.iter().filter(|c| **c > 0).count() as u64,
                spads: cells.iter().map(|&c| u64::from(c)).sum(),
            };
            prop_assert_eq!(tally(&cells, least, most), expected);
        }
    }
}
