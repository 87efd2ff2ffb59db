//! Photons as numbers: cycle, SPAD and bin in one word.
//!
//! Bins have a row before them for photons that matter only as blinders, and one after them for those that do not
//! matter at all.
//!
//! ```text
//!   code    31        19     15         8 7      0         marks   31     15     0
//!          ┌─────────┬──────┬──┬─────────┬────────┐                ┌──────┬──────┐
//!          │ cycle   │ SPAD │  │doubtful │ row    │                │ bins │ SPADs│
//!          └─────────┴──────┴──┴─────────┴────────┘                └──────┴──────┘
//! ```
//!
//! Light of one layer on 16 SPADs is counted so (here, in `binning`, `tables` and `settling`), up to two photons a laser cycle.
//! A table of bits takes 2.3 times as long with 8 Mcounts/s and 0.1 signal photons a laser cycle, and 1.4 times with 26 Mcounts/s.

#![allow(
    unsafe_code,
    reason = "multiversion calls what the processor was asked for"
)]

use multiversion::multiversion;

use crate::photon::GROUP;

const DOUBTFUL: u32 = 1 << 8;
const PLACE_SHIFT: u32 = 16;

/// As many SPADs as a macropixel's have marks; photons of macropixels with other numbers of them are counted one laser cycle after
/// the other.
pub(super) const SPADS: usize = 16;

/// Bits of a SPAD.
pub(super) const SPAD_BITS: u32 = SPADS.trailing_zeros();

/// The marks of SPADs.
pub(super) const SPAD_MARKS: u32 = (1 << SPADS) - 1;

/// Bins that have a mark of their own.
pub(super) const MARKED_BINS: usize = u32::BITS as usize - SPADS;
const CYCLE_SHIFT: u32 = PLACE_SHIFT + SPAD_BITS;

/// Rows that a code can name.
pub(super) const ROWS: usize = 256;

/// Cycles that a code can name: those of a group, and more for photons that are none.
pub(super) const CYCLES: usize = 2 * GROUP as usize;

const _: () = assert!(CYCLES << CYCLE_SHIFT == 1 << u32::BITS);

/// A photon's row, cycle and SPAD.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) struct Code(u32);

impl Code {
    /// No photon, without marks. Padding: row and cycle out of range.
    pub(super) const NONE: Code = Code(GROUP << CYCLE_SHIFT | (ROWS as u32 - 1));

    /// Of a photon at `place`, in one of `bins` bins, and its mark.
    #[inline(always)]
    pub(super) fn new(place: u32, row: u32, is_doubtful: bool, bins: u32) -> (Code, u32) {
        let code = Code(place << PLACE_SHIFT | row).doubtful_if(is_doubtful);
        (code, spad_mark(place) | bin_mark(row, bins))
    }

    /// Moved on by a place, whose cycle may carry.
    #[inline(always)]
    pub(super) fn moved_by(self, place: u32) -> Code {
        Code(self.0 + (place << PLACE_SHIFT))
    }

    /// Also doubtful, if so.
    #[inline(always)]
    pub(super) fn doubtful_if(self, is_doubtful: bool) -> Code {
        Code(self.0 | (u32::from(is_doubtful) * DOUBTFUL))
    }

    /// Cycle within the group.
    #[inline]
    pub(super) fn cycle(self) -> usize {
        (self.0 >> CYCLE_SHIFT) as usize
    }

    /// SPAD.
    #[inline]
    pub(super) fn spad(self) -> u8 {
        (self.0 >> PLACE_SHIFT) as u8 % SPADS as u8
    }

    /// Bin + 1; 0 before the window.
    #[inline]
    pub(super) fn row(self) -> usize {
        self.0 as usize % ROWS
    }

    /// Whether the photon is too close to an edge.
    #[inline]
    pub(super) fn is_doubtful(self) -> bool {
        self.0 & DOUBTFUL != 0
    }
}

/// The mark of a place's SPAD.
#[inline(always)]
pub(super) fn spad_mark(place: u32) -> u32 {
    1 << (place % SPADS as u32)
}

/// The mark of a row, if it is one of `bins` bins.
#[inline(always)]
pub(super) fn bin_mark(row: u32, bins: u32) -> u32 {
    let is_in_bin = row.wrapping_sub(1) < bins;
    u32::from(is_in_bin) << (SPADS as u32 + row % MARKED_BINS as u32)
}

/// The codes of photons, and what to look for in a cycle's other photons: a bit for the SPAD and one for the bin. More
/// than 16 bins share bits.
#[derive(Debug, Default)]
pub(super) struct Codes {
    /// How many there are, those that are no photons among them.
    pub(super) len: usize,
    /// Longer than needed, so that what was there before need not be cleared.
    codes: Vec<Code>,
    marks: Vec<u32>,
}

impl Codes {
    /// Forgets all.
    pub(super) fn clear(&mut self) {
        self.len = 0;
    }

    /// The codes.
    pub(super) fn codes(&self) -> &[Code] {
        &self.codes[..self.len]
    }

    /// Their marks.
    pub(super) fn marks(&self) -> &[u32] {
        &self.marks[..self.len]
    }

    /// Photons that are too close to an edge.
    pub(super) fn doubtful(&self) -> impl Iterator<Item = usize> {
        // They are rare: most groups have none, which is quickly seen.
        const TOGETHER: usize = 64;
        let chunks = self.codes().chunks(TOGETHER).enumerate();
        chunks
            .filter(|(_, chunk)| chunk.iter().fold(0, |any, code| any | code.0) & DOUBTFUL != 0)
            .flat_map(|(at, chunk)| (TOGETHER * at..).zip(chunk))
            .filter_map(|(photon, code)| code.is_doubtful().then_some(photon))
    }

    /// Appends what is no photon until their number is a multiple of `multiple`.
    pub(super) fn fill_up(&mut self, multiple: usize) {
        let missing = self.len.next_multiple_of(multiple) - self.len;
        let (codes, marks) = self.append(missing);
        codes.fill(Code::NONE);
        marks.fill(0);
    }

    /// Makes none of those from the `first` one on whose place is `end` or more.
    pub(super) fn drop_from(&mut self, first: usize, end: u32) {
        let new = first..self.len;
        drop_from(&mut self.codes[new.clone()], &mut self.marks[new], end);
    }

    /// Room for more of them, to be written.
    pub(super) fn append(&mut self, more: usize) -> (&mut [Code], &mut [u32]) {
        let first = self.len;
        self.len += more;
        if self.len > self.codes.len() {
            self.codes.resize(2 * self.len, Code::NONE);
            self.marks.resize(2 * self.len, 0);
        }
        let new = first..self.len;
        (&mut self.codes[new.clone()], &mut self.marks[new])
    }
}

#[multiversion(targets("x86_64+avx512f+avx512bw+avx512dq+avx512vl", "x86_64+avx2"))]
fn drop_from(codes: &mut [Code], marks: &mut [u32], end: u32) {
    for (code, mark) in codes.iter_mut().zip(marks) {
        let is_wanted = code.0 >> PLACE_SHIFT < end;
        *code = if is_wanted { *code } else { Code::NONE };
        *mark = if is_wanted { *mark } else { 0 };
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn nobody_looks_at_what_is_no_photon() {
        assert_eq!(Code::NONE.cycle(), GROUP as usize);
        assert!(Code::NONE.row() > 64 + 1 && !Code::NONE.is_doubtful());
    }
}
