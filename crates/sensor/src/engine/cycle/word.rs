//! One bit of 512 macropixels.
//!
//! Plain arrays and loops that the compiler turns into the widest vectors it may use; the tapes' inner loops are
//! compiled once for each vector extension and chosen when the program runs. Operators and not functions of
//! closures: a closure belongs to the vector extension of the loop it is written in, and cannot be inlined
//! into a function that does not.

use std::ops::{BitAnd, BitOr, BitXor, Not};

/// Macropixels in a word, and in a block of them.
pub(super) const WORD_LANES: usize = 512;
const PARTS: usize = WORD_LANES / 64;

/// A bit of every macropixel of a block, aligned to cache lines.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
#[repr(align(64))]
pub(super) struct Word(pub [u64; PARTS]);

impl Word {
    /// 0 in every lane.
    pub(super) const ZERO: Word = Word([0; PARTS]);

    /// The same value in every lane.
    pub(super) const fn all(value: bool) -> Self {
        Word([if value { u64::MAX } else { 0 }; PARTS])
    }

    /// Whether any lane is 1.
    #[inline(always)]
    pub(super) fn any(self) -> bool {
        let mut any = 0;
        for i in 0..PARTS {
            any |= self.0[i];
        }
        any != 0
    }

    /// One lane.
    pub(super) fn lane(&self, lane: usize) -> bool {
        self.0[lane / 64] >> (lane % 64) & 1 == 1
    }

    /// Sets one lane.
    pub(super) fn set(&mut self, lane: usize, value: bool) {
        self.0[lane / 64] |= u64::from(value) << (lane % 64);
    }

    /// Inverts one lane.
    #[inline(always)]
    pub(super) fn flip(&mut self, lane: usize) {
        self.0[lane / 64] ^= 1 << (lane % 64);
    }
}

impl BitAnd for Word {
    type Output = Self;

    #[inline(always)]
    fn bitand(mut self, other: Self) -> Self {
        for i in 0..PARTS {
            self.0[i] &= other.0[i];
        }
        self
    }
}

impl BitOr for Word {
    type Output = Self;

    #[inline(always)]
    fn bitor(mut self, other: Self) -> Self {
        for i in 0..PARTS {
            self.0[i] |= other.0[i];
        }
        self
    }
}

impl BitXor for Word {
    type Output = Self;

    #[inline(always)]
    fn bitxor(mut self, other: Self) -> Self {
        for i in 0..PARTS {
            self.0[i] ^= other.0[i];
        }
        self
    }
}

/// With the same 64 bits for every 64 lanes: an [`inversion`].
impl BitXor<u64> for Word {
    type Output = Self;

    #[inline(always)]
    fn bitxor(mut self, inversion: u64) -> Self {
        for i in 0..PARTS {
            self.0[i] ^= inversion;
        }
        self
    }
}

impl BitAnd<u64> for Word {
    type Output = Self;

    #[inline(always)]
    fn bitand(mut self, mask: u64) -> Self {
        for i in 0..PARTS {
            self.0[i] &= mask;
        }
        self
    }
}

impl Not for Word {
    type Output = Self;

    #[inline(always)]
    fn not(self) -> Self {
        self ^ u64::MAX
    }
}

/// All ones to invert, or nothing: for `^`.
pub(super) const fn inversion(inverted: bool) -> u64 {
    if inverted { u64::MAX } else { 0 }
}
