//! Random words for the cohorts' draws.

use crate::photon::{Purpose, philox, philox_key};

/// Random words, made many at a time: a pure function of seed and macropixel.
pub struct RandomWords {
    key: [u32; 2],
    pixel: u32,
    next_block: u32,
    words: [u32; READY],
    /// How many of `words` are taken.
    taken: usize,
}

const READY: usize = 8 * philox::LANES;

impl RandomWords {
    /// The words of one macropixel.
    pub fn new(seed: u64, pixel: u32) -> Self {
        RandomWords {
            key: philox_key(seed),
            pixel,
            next_block: 0,
            words: [0; READY],
            taken: READY,
        }
    }

    #[inline]
    fn next_u32(&mut self) -> u32 {
        if self.taken == READY {
            self.refill();
        }
        let word = self.words[self.taken];
        self.taken += 1;
        word
    }

    fn refill(&mut self) {
        let others = [0, self.pixel, Purpose::Cohort as u32];
        let rows = philox::blocks_from(self.next_block, others, self.key);
        self.words.copy_from_slice(rows.as_flattened());
        self.next_block += READY as u32 / 4;
        self.taken = 0;
    }

    /// A number in [0, 1) with 53 random bits.
    #[inline]
    pub fn uniform(&mut self) -> f64 {
        let [low, high] = [self.next_u32(), self.next_u32()].map(u64::from);
        ((low | high << 32) >> 11) as f64 * (0.5f64).powi(53)
    }

    /// A number in [0, 1) with 32 random bits: enough to be compared with one of no great consequence.
    #[inline]
    pub fn coarse(&mut self) -> f64 {
        f64::from(self.next_u32()) * (0.5f64).powi(32)
    }

    /// A whole number below `n` > 0; uneven by less than n/2⁶⁴.
    #[inline]
    pub fn below(&mut self, n: u64) -> u64 {
        let wide = u128::from(self.next_u32()) << 32 | u128::from(self.next_u32());
        ((wide * u128::from(n)) >> 64) as u64
    }
}
