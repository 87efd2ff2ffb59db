//! Photons of one macropixel in some slots of one group, as random words and sorted.

use std::ops::Range;

use super::group::{CycleGroup, GroupPlace};
use crate::photon::philox::{Blocks, LANES};

/// Photons that one block of random words makes.
pub const PER_BLOCK: usize = 4;

/// Background photons of one slot: first those of its blocks' first words, then those of their second ones, and so on.
#[derive(Debug, Clone, Copy)]
pub struct SlotRun {
    /// The slot.
    pub slot: u32,
    /// Its first block.
    pub first_block: u32,
    /// Its photons; the last block may make fewer than others.
    pub photons: u32,
}

impl SlotRun {
    /// Its last block, and how many words of that make photons; any if there is no photon.
    #[inline]
    pub fn last_block(&self) -> (usize, usize) {
        let before_last = self.photons.saturating_sub(1);
        let block = self.first_block as usize + before_last as usize / PER_BLOCK;
        (block, 1 + before_last as usize % PER_BLOCK)
    }

    /// Blocks whose first, second, third and fourth words make photons.
    #[inline]
    pub fn blocks(&self) -> [Range<usize>; PER_BLOCK] {
        let first = self.first_block as usize;
        let photons = self.photons as usize;
        std::array::from_fn(|row| first..first + (photons + PER_BLOCK - 1 - row) / PER_BLOCK)
    }
}

/// Photons of one macropixel, in some slots of one group. Background photons stay random words until somebody wants
/// them.
#[derive(Debug, Clone, Default)]
pub struct Draw {
    pub(super) counts: Blocks,
    pub(super) background: Blocks,
    pub(super) echo: Blocks,
    /// Background photons by slot.
    pub runs: Vec<SlotRun>,
    /// Photons of the whole echo.
    pub(super) echo_photons: usize,
    /// What the drawn slots are, fs after the start of the cycle.
    pub(super) within_fs: Range<i64>,
    /// The group.
    pub group: CycleGroup,
    pub(super) photons: usize,
    /// Photons of the exposure.
    of_exposure: usize,
    /// Photons that were left when some were thinned out.
    pub(super) kept: Vec<(GroupPlace, i64)>,
}

impl Draw {
    /// Forgets all photons, and makes room for those of a group.
    pub(super) fn begin(&mut self, group: CycleGroup) {
        self.runs.clear();
        self.counts.clear();
        self.background.clear();
        self.echo.clear();
        self.echo_photons = 0;
        self.photons = 0;
        self.of_exposure = 0;
        self.kept.clear();
        self.group = group;
    }

    /// Asks for the photons of the echo. Two share a block: first come those of their blocks' first two words, then those
    /// of the other two. With a measured pulse they have another block each.
    pub(super) fn push_echo(&mut self, photons: u32, is_measured: bool) {
        self.echo_photons = photons as usize;
        self.echo.push_run(0, photons.div_ceil(2));
        if is_measured {
            self.echo.push_run(1, photons);
        }
    }

    /// Asks for background photons of a slot.
    #[inline]
    pub(super) fn push_run(&mut self, slot: u32, photons: u32) {
        self.runs.push(SlotRun {
            slot,
            first_block: self.background.len() as u32,
            photons,
        });
        self.photons += photons as usize;
        self.background
            .push_run(slot, photons.div_ceil(PER_BLOCK as u32));
    }

    /// How many photons of the exposure there are.
    pub fn len(&self) -> usize {
        self.of_exposure
    }

    /// Whether there is none.
    pub fn is_empty(&self) -> bool {
        self.of_exposure == 0
    }

    /// Counts the photons of the first `cycles` laser cycles: the exposure may end within the group, and others are none of its photons.
    pub(super) fn count_exposure(&mut self, cycles: u32) {
        if cycles >= self.group.cycles() {
            self.of_exposure = self.photons + self.echo_photons + self.kept.len();
            return;
        }
        let is_in = |word: &&u32| self.group.split(self.group.place(**word)).0 < cycles;
        let background = self.runs.iter().flat_map(|run| {
            let rows = run.blocks().into_iter().zip(self.words());
            rows.map(|(blocks, words)| words[blocks].iter().filter(is_in).count())
        });
        let halves = self.echo().into_iter().zip(self.echo_photons());
        let echo = halves.map(|([_, high], photons)| high[..photons].iter().filter(is_in).count());
        let kept = self.kept.iter();
        let kept = kept.filter(|&&(place, _)| self.group.split(place).0 < cycles);
        self.of_exposure = background.chain(echo).sum::<usize>() + kept.count();
    }

    /// Blocks of random words of background photons.
    pub fn blocks(&self) -> usize {
        self.background.len()
    }

    /// A random word for every background photon, by rows of their blocks' first, second, … words: [`Slots::time_fs`] of
    /// the slot's number and the word, and [`CycleGroup::place`] of the word. Behind those of the last block comes what
    /// fills the rows up.
    ///
    /// [`Slots::time_fs`]: super::Slots::time_fs
    pub fn words(&self) -> [&[u32]; PER_BLOCK] {
        self.background.rows()
    }

    /// The slot of every block, filled up like the words.
    pub fn slots(&self) -> &[u32] {
        self.background.seconds()
    }

    /// The random words of the echo's photons, low and high, by halves: [`CycleGroup::place`] of the high word, and
    /// [`PixelStream::signal_photon`](super::PixelStream::signal_photon). Some may come outside [`Draw::within_fs`], and are no photons of these slots. Behind
    /// [`Draw::echo_photons`] of either half comes what fills it up to a multiple of [`LANES`].
    pub fn echo(&self) -> [[&[u32]; 2]; 2] {
        let filled_up = self.half_an_echo();
        let [a, b, c, d] = self.echo.rows().map(|row| &row[..filled_up]);
        [[a, b], [c, d]]
    }

    /// Photons of the whole echo, by halves.
    pub fn echo_photons(&self) -> [usize; 2] {
        [self.echo_photons.div_ceil(2), self.echo_photons / 2]
    }

    /// Words of half an echo. Its photons are known by numbers: those of the second half begin with this one.
    pub fn half_an_echo(&self) -> usize {
        self.echo_photons.div_ceil(2).next_multiple_of(LANES)
    }

    /// Numbers of the echo's photons.
    pub(super) fn echo_numbers(&self) -> impl Iterator<Item = usize> {
        let [first, second] = self.echo_photons();
        let half = self.half_an_echo();
        (0..first).chain(half..half + second)
    }

    /// The half that an echo's photon belongs to, and its place there.
    #[inline]
    fn in_echo(&self, number: usize) -> (usize, usize) {
        let half = self.half_an_echo();
        if number < half {
            (0, number)
        } else {
            (1, number - half)
        }
    }

    /// The random word of a photon of the echo.
    #[inline]
    pub(super) fn echo_word(&self, number: usize) -> u64 {
        let (half, at) = self.in_echo(number);
        let [low, high] = self.echo()[half];
        u64::from(low[at]) | u64::from(high[at]) << 32
    }

    /// The other random words of a photon of the echo of a measured pulse.
    pub(super) fn echo_words(&self, number: usize) -> [u32; 4] {
        let [first, _] = self.echo_photons();
        let (half, at) = self.in_echo(number);
        let block = first * (1 + half) + at;
        self.echo.rows().map(|row| row[block])
    }

    /// From when until when the drawn slots last, fs after the start of their cycle.
    pub fn within_fs(&self) -> Range<i64> {
        self.within_fs.clone()
    }
}
