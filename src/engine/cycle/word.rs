//! One bit of 512 macropixels.
//!
//! Plain arrays and loops that the compiler turns into the widest vectors it may use; the tapes' inner loops are
//! compiled once for each vector extension and chosen when the program runs.

/// Macropixels in a word, and in a block of them.
pub const WORD_LANES: usize = 512;
const PARTS: usize = WORD_LANES / 64;

/// A bit of every macropixel of a block, aligned to cache lines.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
#[repr(align(64))]
pub struct Word(pub [u64; PARTS]);

impl Word {
    /// 0 in every lane.
    pub const ZERO: Word = Word([0; PARTS]);

    /// The same value in every lane.
    pub const fn all(value: bool) -> Self {
        Word([if value { u64::MAX } else { 0 }; PARTS])
    }

    /// Applies a bitwise function.
    #[inline(always)]
    pub fn map(self, f: impl Fn(u64) -> u64) -> Self {
        Word(std::array::from_fn(|i| f(self.0[i])))
    }

    /// Applies a bitwise function of two.
    #[inline(always)]
    pub fn map2(self, b: Self, f: impl Fn(u64, u64) -> u64) -> Self {
        Word(std::array::from_fn(|i| f(self.0[i], b.0[i])))
    }

    /// Applies a bitwise function of three.
    #[inline(always)]
    pub fn map3(self, b: Self, c: Self, f: impl Fn(u64, u64, u64) -> u64) -> Self {
        Word(std::array::from_fn(|i| f(self.0[i], b.0[i], c.0[i])))
    }

    /// Whether any lane is 1.
    #[inline(always)]
    pub fn any(self) -> bool {
        self.0.iter().fold(0, |all, part| all | part) != 0
    }

    /// One lane.
    pub fn lane(&self, lane: usize) -> bool {
        self.0[lane / 64] >> (lane % 64) & 1 == 1
    }

    /// Sets one lane.
    pub fn set(&mut self, lane: usize, value: bool) {
        self.0[lane / 64] |= u64::from(value) << (lane % 64);
    }

    /// Inverts one lane.
    #[inline(always)]
    pub fn flip(&mut self, lane: usize) {
        self.0[lane / 64] ^= 1 << (lane % 64);
    }
}

/// All ones to invert, or nothing: for `^`.
pub const fn inversion(inverted: bool) -> u64 {
    if inverted { u64::MAX } else { 0 }
}
