//! Random words for the cohorts' draws.

use crate::photon::{RandomPurpose, philox, philox_key};

/// Random words, made many at a time: a pure function of seed and macropixel.
pub(super) struct RandomWords {
    key: [u32; 2],
    pixel: u32,
    next_block: u32,
    words: [[u32; 2 * philox::LANES]; 4],
    /// How many of `words` are taken.
    taken: usize,
}

const READY: usize = 8 * philox::LANES;

impl RandomWords {
    /// The words of one macropixel.
    pub(super) fn new(seed: u64, pixel: u32) -> Self {
        RandomWords {
            key: philox_key(seed),
            pixel,
            next_block: 0,
            words: [[0; 2 * philox::LANES]; 4],
            taken: READY,
        }
    }

    /// The next `N` ≤ [`READY`] words.
    #[inline(always)]
    fn next_words<const N: usize>(&mut self) -> [u32; N] {
        let mut words = [0; N];
        let ready = &self.words.as_flattened()[self.taken..];
        match ready.first_chunk() {
            Some(chunk) => {
                words = *chunk;
                self.taken += N;
            }
            None => {
                let (now, later) = words.split_at_mut(ready.len());
                now.copy_from_slice(ready);
                self.refill();
                self.taken = later.len();
                later.copy_from_slice(&self.words.as_flattened()[..self.taken]);
            }
        }
        words
    }

    #[cold]
    fn refill(&mut self) {
        let others = [0, self.pixel, RandomPurpose::Cohort as u32];
        philox::blocks_from(self.next_block, others, self.key, &mut self.words);
        self.next_block += READY as u32 / 4;
    }

    /// A number in [0, 1) with 52 random bits.
    #[inline(always)]
    pub(super) fn uniform(&mut self) -> f64 {
        unit(self.next_words())
    }

    /// As many numbers in [0, 1), with 52 random bits each.
    #[inline(always)]
    pub(super) fn uniforms<const N: usize>(&mut self) -> [f64; N] {
        let (low, high) = (self.next_words::<N>(), self.next_words::<N>());
        std::array::from_fn(|i| unit([low[i], high[i]]))
    }

    /// A number in [0, 1) with 32 random bits: enough where 2⁻³² of a draw is of no consequence.
    #[inline(always)]
    pub(super) fn coarse(&mut self) -> f64 {
        let [coarse] = self.coarses();
        coarse
    }

    /// As many of these.
    #[inline(always)]
    pub(super) fn coarses<const N: usize>(&mut self) -> [f64; N] {
        self.next_words::<N>()
            .map(|word| f64::from(word) * (0.5f64).powi(32))
    }

    /// A whole number below `n` > 0; uneven by less than n/2⁶⁴.
    #[inline(always)]
    pub(super) fn whole_below(&mut self, n: u64) -> u64 {
        let [high, low] = self.next_words().map(u128::from);
        (((high << 32 | low) * u128::from(n)) >> 64) as u64
    }
}

#[inline(always)]
fn unit(words: [u32; 2]) -> f64 {
    const ONE: u64 = 1f64.to_bits();
    let [low, high] = words.map(u64::from);
    f64::from_bits(ONE | (low | high << 32) >> 12) - 1.0
}
