//! Photons of one macropixel in some slots of one group, as random words and sorted.

use super::SPAD_BITS;
use super::group::{GROUP, Group};
use crate::photon::philox::Blocks;
use crate::photon::random::Poisson;
use crate::photon::spad::SPADS;
use crate::units::Time;

/// Length of a time slot.
pub const SLOT: Time = Time::from_fs(1 << SLOT_BITS);
pub(super) const SLOT_BITS: u32 = 21;

/// Where in its group a photon falls: cycle within the group and SPAD, as `cycle << 4 | SPAD`.
pub type Place = u16;

/// The time within its slot that the random word of a photon gives, fs.
#[inline]
pub fn time_in_slot_fs(word: u64) -> u32 {
    word as u32 >> (32 - SLOT_BITS)
}

/// Background photons of one slot. Each block of random words makes two: first those of its blocks' low
/// halves, then those of the high halves.
#[derive(Debug, Clone, Copy)]
pub struct Run {
    /// The slot.
    pub slot: u32,
    /// Its first block.
    pub first_block: u32,
    /// Its photons; if odd, the last block makes only one.
    pub photons: u32,
}

impl Run {
    /// When the slot begins after the start of its cycle.
    #[inline]
    pub fn start_fs(&self) -> i64 {
        i64::from(self.slot) << SLOT_BITS
    }

    /// Blocks whose low and whose high halves make photons.
    #[inline]
    pub fn blocks(&self) -> [std::ops::Range<usize>; 2] {
        let first = self.first_block as usize;
        let photons = self.photons as usize;
        [
            first..first + photons.div_ceil(2),
            first..first + photons / 2,
        ]
    }
}

/// A photon of the echo.
#[derive(Debug, Clone, Copy, Default)]
pub struct SignalPhoton {
    /// Cycle and SPAD.
    pub place: Place,
    /// After the start of its cycle.
    pub time_fs: i64,
}

/// Photons of one macropixel, in some slots of one group. Background photons stay random words until somebody wants
/// them; those of the last slot that outlast the cycle are no photons.
#[derive(Debug, Clone, Default)]
pub struct Draw {
    pub(super) counts: Blocks,
    pub(super) background: Blocks,
    pub(super) echo: Blocks,
    runs: Vec<Run>,
    pub(super) signal: Vec<SignalPhoton>,
    pub(super) group: Group,
    cycle_fs: i64,
    photons: usize,
}

impl Draw {
    /// Forgets all photons.
    pub fn clear(&mut self) {
        self.runs.clear();
        self.counts.clear();
        self.background.clear();
        self.echo.clear();
        self.signal.clear();
        self.photons = 0;
    }

    /// Makes room for photons of a group, whose cycles have `cycle_fs`.
    pub(super) fn begin(&mut self, group: Group, cycle_fs: i64) {
        self.clear();
        self.group = group;
        self.cycle_fs = cycle_fs;
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
        self.background.push_run(slot, photons.div_ceil(2));
    }

    /// How many photons were drawn, those that outlast the cycle among them.
    pub fn len(&self) -> usize {
        self.photons + self.signal.len()
    }

    /// Whether there is none.
    pub fn is_empty(&self) -> bool {
        self.len() == 0
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

    /// A random word for every background photon, by halves of their blocks: [`time_in_slot_fs`] in the low 32 bits and
    /// [`Group::place`] in the high ones. Behind those of the last block comes what fills the rows up.
    pub fn words(&self) -> [&[u64]; 2] {
        self.background.rows()
    }

    /// The slot of every block, filled up like the words.
    pub fn slots(&self) -> &[u32] {
        self.background.seconds()
    }

    /// Background photons that outlast the cycle: half of the words and block.
    pub fn outlasting(&self) -> impl Iterator<Item = (usize, usize)> + '_ {
        let cut = |run: &&Run| run.start_fs() + SLOT.as_fs() > self.cycle_fs;
        self.runs
            .last()
            .filter(cut)
            .into_iter()
            .flat_map(move |run| {
                let late = move |word: u64| {
                    run.start_fs() + i64::from(time_in_slot_fs(word)) >= self.cycle_fs
                };
                let halves = run.blocks().into_iter().zip(self.words()).enumerate();
                halves.flat_map(move |(half, (blocks, words))| {
                    let photons = blocks.filter(move |&block| late(words[block]));
                    photons.map(move |block| (half, block))
                })
            })
    }

    /// When a background photon comes after the start of its cycle, fs.
    #[inline]
    pub fn time_fs(&self, half: usize, block: usize) -> i64 {
        let in_slot_fs = time_in_slot_fs(self.words()[half][block]);
        (i64::from(self.slots()[block]) << SLOT_BITS) + i64::from(in_slot_fs)
    }

    /// Signal photons.
    pub fn signal(&self) -> &[SignalPhoton] {
        &self.signal
    }

    /// Every photon, as place and time after the start of its cycle in fs, in no particular order.
    pub fn photons(&self) -> impl Iterator<Item = (Place, i64)> + '_ {
        let words = self.words();
        let background = self.runs.iter().flat_map(move |run| {
            let start_fs = run.start_fs();
            run.blocks()
                .into_iter()
                .zip(words)
                .flat_map(move |(blocks, words)| {
                    words[blocks].iter().map(move |&word| {
                        let time_fs = start_fs + i64::from(time_in_slot_fs(word));
                        (self.group.place(word), time_fs)
                    })
                })
        });
        let signal = self
            .signal
            .iter()
            .map(|photon| (photon.place, photon.time_fs));
        background
            .filter(|&(_, time_fs)| time_fs < self.cycle_fs)
            .chain(signal)
    }

    /// The sum of `draws` Poisson numbers from the next blocks of `counts`.
    #[inline]
    pub(super) fn count(&self, poisson: &Poisson, draws: u32, at: &mut usize) -> u32 {
        let words = self.counts.rows();
        let parts = (poisson.words() * draws) as usize;
        let part = |part: usize| poisson.part(words[part % 2][*at + part / 2]);
        let total = (0..parts).map(part).sum();
        *at += parts.div_ceil(2);
        total
    }
}

/// Photons of a group sorted by cycle, then time, then SPAD.
#[derive(Debug, Clone, Default)]
pub(super) struct ByCycle {
    /// Time after the start of the cycle in fs and SPAD, as `time << 4 | SPAD`.
    photons: Vec<u64>,
    /// Where each cycle's photons end.
    ends: Vec<usize>,
}

impl ByCycle {
    pub(super) fn sort(&mut self, draw: &Draw) {
        self.ends.clear();
        self.ends.resize(GROUP as usize, 0);
        let cycle_of = |place: Place| usize::from(place >> SPAD_BITS);
        for (place, _) in draw.photons() {
            self.ends[cycle_of(place)] += 1;
        }
        let mut total = 0;
        for end in &mut self.ends {
            // Where the cycle begins, until its photons have moved it to where it ends.
            total += std::mem::replace(end, total);
        }
        self.photons.clear();
        self.photons.resize(total, 0);
        for (place, time_fs) in draw.photons() {
            let end = &mut self.ends[cycle_of(place)];
            let spad = u64::from(place) & (SPADS as u64 - 1);
            self.photons[*end] = (time_fs as u64) << SPAD_BITS | spad;
            *end += 1;
        }
        let mut start = 0;
        for &end in &self.ends {
            self.photons[start..end].sort_unstable();
            start = end;
        }
    }

    pub(super) fn of(&self, cycle: u32) -> &[u64] {
        let cycle = cycle as usize;
        let start = cycle.checked_sub(1).map_or(0, |before| self.ends[before]);
        &self.photons[start..self.ends[cycle]]
    }
}
