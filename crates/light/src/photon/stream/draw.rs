//! Photons of one macropixel in some slots of one group, as random words and sorted.

use std::ops::Range;

use super::PixelStream;
use super::group::{GROUP, Group};
use crate::photon::MOST_SPADS;
use crate::photon::philox::{Blocks, LANES};

/// Where in its group a photon falls: cycle within the group and, in the lowest bits, SPAD ([`Group::split`]).
pub type Place = u16;

/// Photons that one block of random words makes.
pub const PER_BLOCK: usize = 4;

/// Background photons of one slot: first those of its blocks' first words, then those of their second ones, and so on.
#[derive(Debug, Clone, Copy)]
pub struct Run {
    /// The slot.
    pub slot: u32,
    /// Its first block.
    pub first_block: u32,
    /// Its photons; the last block may make fewer than others.
    pub photons: u32,
}

impl Run {
    /// Its last block, and how many words of that make photons; any if there is no photon.
    #[inline]
    pub fn last_block(&self) -> (usize, usize) {
        let before_last = self.photons.saturating_sub(1);
        let block = self.first_block as usize + before_last as usize / PER_BLOCK;
        (block, 1 + before_last as usize % PER_BLOCK)
    }

    /// Blocks whose first, second, third and fourth words make photons.
    #[inline]
    pub(crate) fn blocks(&self) -> [Range<usize>; PER_BLOCK] {
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
    runs: Vec<Run>,
    /// Photons of the whole echo.
    echo_photons: usize,
    /// What the drawn slots are, fs after the start of the cycle.
    pub(super) within_fs: Range<i64>,
    pub(super) group: Group,
    photons: usize,
    /// Photons of the exposure.
    of_exposure: usize,
    /// Photons that were left when some were thinned out.
    kept: Vec<(Place, i64)>,
}

impl Draw {
    /// Forgets all photons, and makes room for those of a group.
    pub(super) fn begin(&mut self, group: Group) {
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
        self.runs.push(Run {
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

    /// The group.
    pub fn group(&self) -> Group {
        self.group
    }

    /// Background photons by slot.
    pub fn runs(&self) -> &[Run] {
        &self.runs
    }

    /// Blocks of random words of background photons.
    pub fn blocks(&self) -> usize {
        self.background.len()
    }

    /// A random word for every background photon, by rows of their blocks' first, second, … words: [`Slots::time_fs`] of
    /// the slot's number and the word, and [`Group::place`] of the word. Behind those of the last block comes what
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

    /// The random words of the echo's photons, low and high, by halves: [`Group::place`] of the high word, and
    /// [`PixelStream::signal_photon`]. Some may come outside [`Draw::within_fs`], and are no photons of these slots. Behind
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
    fn echo_numbers(&self) -> impl Iterator<Item = usize> {
        let [first, second] = self.echo_photons();
        let half = self.half_an_echo();
        (0..first).chain(half..half + second)
    }

    /// The half that an echo's photon belongs to, and its place there.
    #[inline]
    fn in_echo(&self, number: usize) -> (usize, usize) {
        let half = self.half_an_echo();
        match number < half {
            true => (0, number),
            false => (1, number - half),
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

    /// Every photon of the first `cycles` laser cycles of the group, as place and time after the start of its cycle in fs, in no
    /// particular order. `pixel` is whose they are. No background photon comes before the exposure.
    pub fn photons(
        &self,
        pixel: &PixelStream<'_>,
        cycles: u32,
    ) -> impl Iterator<Item = (Place, i64)> {
        let words = self.words();
        let slots = pixel.slots();
        // Short exposures need few of a group's photons; only of those the times are worked out.
        let is_wanted = move |word: u32| self.group.split(self.group.place(word)).0 < cycles;
        let background = self.runs.iter().flat_map(move |run| {
            let rows = run.blocks().into_iter().zip(words);
            rows.flat_map(move |(blocks, words)| {
                let photon =
                    move |&word: &u32| (self.group.place(word), slots.time_fs(run.slot, word));
                let wanted = words[blocks].iter().filter(move |word| is_wanted(**word));
                wanted.map(photon)
            })
        });
        let halves = self.echo().into_iter().zip(self.echo_photons());
        let signal = halves
            .enumerate()
            .flat_map(move |(half, ([_, high], photons))| {
                let wanted = (0..photons).filter(move |&at| is_wanted(high[at]));
                wanted.map(move |at| half * self.half_an_echo() + at)
            });
        let signal = signal
            .map(|photon| pixel.signal_photon(self, photon))
            .filter(|(_, time_fs)| self.within_fs.contains(time_fs));
        let is_first_group = self.group.first_cycle() == 0;
        let background = background.filter(move |&(place, time_fs)| {
            !is_first_group || time_fs >= 0 || self.group.split(place).0 > 0
        });
        let kept = self.kept.iter().copied();
        let kept = kept.filter(move |&(place, _)| self.group.split(place).0 < cycles);
        background.chain(signal).chain(kept)
    }

    /// Keeps only those photons that `pixel` keeps. They are worked out here, and are no words any more.
    pub(super) fn thin(&mut self, pixel: &PixelStream<'_>) {
        let mut kept = std::mem::take(&mut self.kept);
        let first_cycle = self.group.first_cycle();
        let slots = pixel.slots();
        for run in &self.runs {
            for (blocks, words) in run.blocks().into_iter().zip(self.words()) {
                for &word in &words[blocks] {
                    let (place, time_fs) = (self.group.place(word), slots.time_fs(run.slot, word));
                    let (cycle, spad) = self.group.split(place);
                    let cycle = first_cycle + cycle;
                    let is_before_exposure = cycle == 0 && time_fs < 0;
                    if !is_before_exposure
                        && pixel.keeps_background(cycle, spad, time_fs, [word, run.slot])
                    {
                        kept.push((place, time_fs));
                    }
                }
            }
        }
        for number in self.echo_numbers() {
            let (place, time_fs) = pixel.signal_photon(self, number);
            let (cycle, spad) = self.group.split(place);
            let word = self.echo_word(number);
            let words = [word as u32, (word >> 32) as u32];
            if self.within_fs.contains(&time_fs)
                && pixel.keeps_signal(first_cycle + cycle, spad, words)
            {
                kept.push((place, time_fs));
            }
        }
        self.runs.clear();
        (self.photons, self.echo_photons) = (0, 0);
        self.kept = kept;
    }
}

/// Bits of a SPAD's number below a time.
pub(super) const SPAD_SHIFT: u32 = MOST_SPADS.trailing_zeros();

/// Photons of a group sorted by cycle, then time, then SPAD.
#[derive(Debug, Clone, Default)]
pub(super) struct ByCycle {
    /// Time after the start of the cycle in fs and SPAD, as `time << SPAD_SHIFT | SPAD`.
    photons: Vec<i64>,
    /// Where each cycle's photons end.
    ends: Vec<usize>,
}

impl ByCycle {
    pub(super) fn sort(&mut self, draw: &Draw, pixel: &PixelStream<'_>) {
        self.ends.clear();
        self.ends.resize(GROUP as usize, 0);
        for (place, _) in draw.photons(pixel, GROUP) {
            self.ends[draw.group.split(place).0 as usize] += 1;
        }
        let mut total = 0;
        for end in &mut self.ends {
            // Where the cycle begins, until its photons have moved it to where it ends.
            total += std::mem::replace(end, total);
        }
        self.photons.clear();
        self.photons.resize(total, 0);
        for (place, time_fs) in draw.photons(pixel, GROUP) {
            let (cycle, spad) = draw.group.split(place);
            let end = &mut self.ends[cycle as usize];
            self.photons[*end] = time_fs << SPAD_SHIFT | i64::from(spad);
            *end += 1;
        }
        let mut start = 0;
        for &end in &self.ends {
            self.photons[start..end].sort_unstable();
            start = end;
        }
    }

    pub(super) fn of(&self, cycle: u32) -> &[i64] {
        let cycle = cycle as usize;
        let start = cycle.checked_sub(1).map_or(0, |before| self.ends[before]);
        &self.photons[start..self.ends[cycle]]
    }
}
