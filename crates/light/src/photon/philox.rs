//! Philox4x32-10 (Salmon et al., SC 2011) for many counters at once.
//!
//! One block of four words per counter, [`LANES`] counters side by side in plain arrays, so that the compiler can use
//! the widest vectors the machine has. The words are those of the crate `rand_philox`, which tests hold it to.

#![allow(
    unsafe_code,
    reason = "multiversion calls what the processor was asked for"
)]

use multiversion::multiversion;

/// Counters that go through the rounds together, and of which rows of blocks are filled up to a multiple.
pub const LANES: usize = 8;

const MULTIPLIERS: [u64; 2] = [0xD251_1F53, 0xCD9E_8D57];
const ROUNDS: usize = 10;
const LOW: u64 = 0xFFFF_FFFF;
const WEYL: [u32; 2] = [0x9E37_79B9, 0xBB67_AE85];

/// Random blocks in runs: a run is a row of blocks with successive first counter words from 0 on and one second
/// counter word.
#[derive(Debug, Clone, Default)]
pub(crate) struct Blocks {
    blocks: usize,
    /// Longer than needed, so that runs are written [`LANES`] at a time.
    first: Vec<u32>,
    second: Vec<u32>,
    words: [Vec<u32>; 4],
}

impl Blocks {
    /// Forgets all runs.
    pub(crate) fn clear(&mut self) {
        self.blocks = 0;
    }

    /// Asks for a run of `blocks` blocks with this second counter word.
    #[inline]
    pub(crate) fn push_run(&mut self, second: u32, blocks: u32) {
        let start = self.blocks;
        self.blocks += blocks as usize;
        let room = self.blocks + LANES;
        if room > self.first.len() {
            self.grow(room);
        }
        let mut block = 0;
        while block < blocks {
            let chunk = start + block as usize..start + block as usize + LANES;
            let firsts: [u32; LANES] = std::array::from_fn(|lane| block + lane as u32);
            self.first[chunk.clone()].copy_from_slice(&firsts);
            self.second[chunk].copy_from_slice(&[second; LANES]);
            block += LANES as u32;
        }
    }

    #[cold]
    fn grow(&mut self, room: usize) {
        self.first.resize(2 * room, 0);
        self.second.resize(2 * room, 0);
    }

    /// Blocks asked for.
    pub(crate) fn len(&self) -> usize {
        self.blocks
    }

    fn filled_up(&self) -> usize {
        self.blocks.next_multiple_of(LANES)
    }

    /// Generates all blocks with this key, third and fourth counter word.
    pub(crate) fn generate(&mut self, key: [u32; 2], third: u32, fourth: u32) {
        let filled_up = self.filled_up();
        let room = self.first.len();
        for words in &mut self.words {
            words.resize(room, 0);
        }
        let words = self.words.each_mut().map(|words| &mut words[..filled_up]);
        generate(
            &round_keys(key),
            [third, fourth],
            &self.first[..filled_up],
            &self.second[..filled_up],
            words,
        );
    }

    /// The four words of every block, a row for each; and of others that fill the rows up to a multiple of [`LANES`].
    #[inline]
    pub(crate) fn rows(&self) -> [&[u32]; 4] {
        let filled_up = self.filled_up();
        self.words.each_ref().map(|words| &words[..filled_up])
    }

    /// The second counter word of every block, filled up alike.
    #[inline]
    pub(crate) fn seconds(&self) -> &[u32] {
        &self.second[..self.filled_up()]
    }
}

/// Writes the words, by rows, of twice [`LANES`] blocks with first counter words from `first` on and these other ones.
pub fn blocks_from(first: u32, others: [u32; 3], key: [u32; 2], words: &mut [[u32; 2 * LANES]; 4]) {
    let [second, third, fourth] = others;
    let firsts: [u32; 2 * LANES] = std::array::from_fn(|block| first.wrapping_add(block as u32));
    let [row0, row1, row2, row3] = words;
    generate(
        &round_keys(key),
        [third, fourth],
        &firsts,
        &[second; 2 * LANES],
        [row0, row1, row2, row3],
    );
}

/// The key of every round.
fn round_keys(mut key: [u32; 2]) -> [[u64; 2]; ROUNDS] {
    std::array::from_fn(|_| {
        let round = key.map(u64::from);
        key = [key[0].wrapping_add(WEYL[0]), key[1].wrapping_add(WEYL[1])];
        round
    })
}

/// Words live in the low halves of 64-bit lanes, where vector units multiply them; high halves hold what is left over.
#[multiversion(targets(
    "x86_64+avx512f+avx512bw+avx512dq+avx512vl",
    "x86_64+avx2",
    "x86_64+sse4.1"
))]
fn generate(
    keys: &[[u64; 2]; ROUNDS],
    [third, fourth]: [u32; 2],
    first: &[u32],
    second: &[u32],
    words: [&mut [u32]; 4],
) {
    let counters = (first.as_chunks::<LANES>().0.iter()).zip(second.as_chunks::<LANES>().0);
    let [out0, out1, out2, out3] = words.map(|words| words.as_chunks_mut::<LANES>().0.iter_mut());
    let out = out0.zip(out1).zip(out2.zip(out3));
    for ((first, second), ((out0, out1), (out2, out3))) in counters.zip(out) {
        let mut c0 = [0; LANES];
        let mut c1 = [0; LANES];
        for lane in 0..LANES {
            c0[lane] = u64::from(first[lane]);
            c1[lane] = u64::from(second[lane]);
        }
        let mut c2 = [u64::from(third); LANES];
        let mut c3 = [u64::from(fourth); LANES];
        for &[key0, key1] in keys {
            for lane in 0..LANES {
                let product0 = MULTIPLIERS[0] * (c0[lane] & LOW);
                let product1 = MULTIPLIERS[1] * (c2[lane] & LOW);
                c0[lane] = (product1 >> 32) ^ c1[lane] ^ key0;
                c1[lane] = product1;
                c2[lane] = (product0 >> 32) ^ c3[lane] ^ key1;
                c3[lane] = product0;
            }
        }
        for (out, c) in [out0, out1, out2, out3].into_iter().zip([c0, c1, c2, c3]) {
            *out = c.map(|word| word as u32);
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    proptest! {
        #[test]
        fn the_words_are_those_of_rand_philox(
            key: [u32; 2],
            third: u32,
            fourth: u32,
            runs in prop::collection::vec((any::<u32>(), 0u32..40), 0..6),
        ) {
            let mut blocks = Blocks::default();
            // A second use must not see the first.
            blocks.push_run(7, 50);
            blocks.generate(key, 1, 2);
            blocks.clear();
            for &(second, count) in &runs {
                blocks.push_run(second, count);
            }
            blocks.generate(key, third, fourth);
            let counters: Vec<[u32; 4]> = runs
                .iter()
                .flat_map(|&(second, count)| (0..count).map(move |first| [first, second, third, fourth]))
                .collect();
            let mut rows = [[0; 2 * LANES]; 4];
            blocks_from(5, [6, third, fourth], key, &mut rows);
            for (at, first) in (5..5 + 2 * LANES as u32).enumerate() {
                let expected = rand_philox::philox4x32_10([first, 6, third, fourth], key);
                prop_assert_eq!(rows.map(|row| row[at]), expected);
            }
            prop_assert_eq!(blocks.len(), counters.len());
            for (at, counter) in counters.into_iter().enumerate() {
                let expected = rand_philox::philox4x32_10(counter, key);
                prop_assert_eq!(blocks.rows().map(|row| row[at]), expected);
            }
        }
    }
}
