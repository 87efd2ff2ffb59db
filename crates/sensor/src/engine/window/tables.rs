//! The tables in which photons of a group are counted. Their lengths are powers of two, so that an index needs no check.

#![allow(
    unsafe_code,
    reason = "multiversion calls what the processor was asked for"
)]

use std::cell::Cell;

use multiversion::multiversion;

use super::codes::{CYCLES, Code, Codes, ROWS};

/// Most photons of a group.
pub(super) const MOST_PHOTONS: usize = PHOTONS - 1;
const PHOTONS: usize = 1 << 16;

/// Every photon may meet another one, and may be in doubt as well.
const SPECIALS: usize = 2 * PHOTONS;

/// Photons that are counted in different tables, so that none waits for the count of the one before.
pub(super) const SIDE_BY_SIDE: usize = 4;

/// How many photons came by row, which SPADs and rows have one by cycle, and all photons by cycle. Photons are kept by
/// their index + 1; 0 is none.
pub(super) struct Tables {
    /// What is taken out is taken out of the first one, which may fall below 0 and wrap; their sum is right.
    counts: [[u32; ROWS]; SIDE_BY_SIDE],
    /// By cycle: its last photon in the high half, marks of SPADs and bins in the low one, and its specials above both.
    cycles: Box<[u64; CYCLES]>,
    /// The photon before it in the same cycle, by index.
    before: Box<[u16; PHOTONS]>,
    /// Photons that need a closer look in the high half, why in the low one.
    special: Box<[u64; SPECIALS]>,
    specials: usize,
}

/// A special photon as `special` has it, and one more special of a cycle.
const PHOTON_SHIFT: u32 = 32;
const ONE_SPECIAL: u64 = 1 << 48;

const _: () = assert!(PHOTONS as u64 == ONE_SPECIAL >> PHOTON_SHIFT);

/// A photon that needs a closer look.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) struct Special {
    /// Which.
    pub photon: usize,
    /// Marks that earlier photons of its cycle have, too; all if it is doubtful.
    pub shared: u32,
    /// Whether it is the only one of its cycle.
    pub is_only: bool,
}

fn table<T: Copy + Default, const N: usize>() -> Box<[T; N]> {
    match vec![T::default(); N].into_boxed_slice().try_into() {
        Ok(table) => table,
        Err(_) => unreachable!("a vector of N elements has N elements"),
    }
}

thread_local! {
    /// Those that this thread had last. To make them anew for every batch of macropixels took 9 % of the instructions of a
    /// frame of 1600 laser cycles: they are 1.2 MB.
    static KEPT: Cell<Option<Tables>> = const { Cell::new(None) };
}

impl Tables {
    /// Tables to count in, whatever they hold.
    pub(super) fn from_pool() -> Self {
        KEPT.take().unwrap_or_default()
    }

    /// For this thread's next [`Tables::from_pool`].
    pub(super) fn keep(self) {
        KEPT.set(Some(self));
    }
}

impl Default for Tables {
    fn default() -> Self {
        Tables {
            counts: [[0; ROWS]; SIDE_BY_SIDE],
            cycles: table(),
            before: table(),
            special: table(),
            specials: 0,
        }
    }
}

impl Tables {
    /// Begins a macropixel.
    pub(super) fn clear_counts(&mut self) {
        self.counts = [[0; ROWS]; SIDE_BY_SIDE];
    }

    /// Photons of a row, without those that were taken out.
    pub(super) fn count(&self, row: usize) -> u32 {
        let parts = self.counts.iter().map(|counts| counts[row]);
        parts.fold(0, u32::wrapping_add)
    }

    /// More photons of a row.
    pub(super) fn add(&mut self, row: usize, photons: u32) {
        let count = &mut self.counts[0][row];
        *count = count.wrapping_add(photons);
    }

    /// Puts the photons of a group of `cycles` laser cycles, at most [`MOST_PHOTONS`], filled up to a multiple of
    /// [`SIDE_BY_SIDE`]. The first ones have been counted by row ([`Tables::add`]), the rest from `counted` on, a
    /// multiple as well, are counted here.
    pub(super) fn put_group(&mut self, codes: &Codes, cycles: usize, counted: usize) {
        debug_assert!(codes.len <= MOST_PHOTONS && codes.len.is_multiple_of(SIDE_BY_SIDE));
        debug_assert!(counted.is_multiple_of(SIDE_BY_SIDE));
        // The cycle of what is no photon need not be empty.
        self.cycles[..cycles].fill(0);
        let (first_codes, codes_to_count) = codes.codes().split_at(counted);
        let (first_marks, marks_to_count) = codes.marks().split_at(counted);
        let specials = put_photons::<false>(self, (first_codes, first_marks), 0, 0);
        self.specials =
            put_photons::<true>(self, (codes_to_count, marks_to_count), counted, specials);
        for photon in codes.doubtful() {
            self.special[self.specials] = (photon as u64 + 1) << PHOTON_SHIFT | u64::from(u32::MAX);
            self.specials += 1;
        }
        for special in &self.special[..self.specials] {
            let photon = (special >> PHOTON_SHIFT) as usize - 1;
            self.cycles[codes.codes()[photon].cycle()] += ONE_SPECIAL;
        }
    }

    /// The `index`-th photon that has its SPAD or its bin in common with an earlier one of its cycle, or is doubtful. A
    /// photon may come twice.
    pub(super) fn special(&self, index: usize, codes: &Codes) -> Option<Special> {
        let special = *self.special[..self.specials].get(index)?;
        Some(self.unpacked(special, codes.codes()))
    }

    #[inline(always)]
    fn unpacked(&self, special: u64, codes: &[Code]) -> Special {
        let photon = (special >> PHOTON_SHIFT) as usize - 1;
        let cycle = self.cycles[codes[photon].cycle()];
        Special {
            photon,
            shared: special as u32,
            is_only: cycle / ONE_SPECIAL == 1,
        }
    }

    /// The last photon of a cycle, which is empty afterwards.
    pub(super) fn take_last(&mut self, cycle: usize) -> Option<usize> {
        let word = std::mem::take(&mut self.cycles[cycle]);
        (((word % ONE_SPECIAL) >> PHOTON_SHIFT) as usize).checked_sub(1)
    }

    /// The photon of the same cycle before this one.
    pub(super) fn previous_photon(&self, photon: usize) -> Option<usize> {
        usize::from(self.before[photon]).checked_sub(1)
    }

    /// One photon less in a row.
    pub(super) fn remove(&mut self, row: usize) {
        let count = &mut self.counts[0][row];
        *count = count.wrapping_sub(1);
    }
}

/// Puts photons numbered from `number` + 1 on; counts them by row or not. Returns how many specials there are then.
#[multiversion(targets("x86_64+avx2+bmi1+bmi2"))]
fn put_photons<const COUNTED: bool>(
    tables: &mut Tables,
    (codes, marks): (&[Code], &[u32]),
    number: usize,
    specials: usize,
) -> usize {
    let before = &mut tables.before[number..];
    let mut specials = specials;
    let mut number = (number as u64) << PHOTON_SHIFT;
    let mut one = |code: Code, marks: u32, counts: &mut [u32; ROWS]| {
        let cycle = &mut tables.cycles[code.cycle()];
        let word = *cycle;
        let others = word as u32;
        let shared = others & marks;
        number += 1 << PHOTON_SHIFT;
        *cycle = number | u64::from(others | marks);
        // Written always, kept if special: no branch to mispredict.
        tables.special[specials % SPECIALS] = number | u64::from(shared);
        specials += usize::from(shared != 0);
        if COUNTED {
            let count = &mut counts[code.row()];
            *count = count.wrapping_add(1);
        }
        (word >> PHOTON_SHIFT) as u16
    };
    let (code_rows, _) = codes.as_chunks::<SIDE_BY_SIDE>();
    let (mark_rows, _) = marks.as_chunks::<SIDE_BY_SIDE>();
    let (before_rows, _) = before.as_chunks_mut::<SIDE_BY_SIDE>();
    for ((codes, marks), before) in code_rows.iter().zip(mark_rows).zip(before_rows) {
        for (side, counts) in tables.counts.iter_mut().enumerate() {
            before[side] = one(codes[side], marks[side], counts);
        }
    }
    specials
}
