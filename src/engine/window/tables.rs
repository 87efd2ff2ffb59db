//! The tables in which photons of a group are counted. Their lengths are powers of two, so that an index needs no check.

use multiversion::multiversion;

use super::binning::{CYCLES, Code, ROWS};
use crate::photon::GROUP;

/// Most photons of a group, and one that is none.
pub const MOST_PHOTONS: usize = u16::MAX as usize;
const NONE: u16 = u16::MAX;

/// SPADs and rows of a cycle, below its last photon.
const LAST_BITS: u32 = 48;
const ROW_BITS: u32 = 16;
/// Rows share bits where there are more of them.
const ROWS_APART: usize = (LAST_BITS - ROW_BITS) as usize;
const EMPTY: u64 = (NONE as u64) << LAST_BITS;

/// How many photons came by row, which SPADs and rows have one by cycle, and all photons by cycle.
pub struct Tables {
    counts: [u32; ROWS],
    /// A bit for every row of a bin.
    row_bit: [u64; ROWS],
    /// By cycle: its last photon, rows and SPADs.
    cycles: Box<[u64; CYCLES]>,
    /// The photon before it in the same cycle, by photon.
    before: Box<[u16; MOST_PHOTONS + 1]>,
    /// Cycles that need a closer look.
    special: Box<[u16; MOST_PHOTONS + 1]>,
    specials: usize,
}

fn table<T: Copy, const N: usize>(value: T) -> Box<[T; N]> {
    match vec![value; N].into_boxed_slice().try_into() {
        Ok(table) => table,
        Err(_) => unreachable!("a vector of N elements has N elements"),
    }
}

impl Tables {
    /// Tables for windows of `bins` bins.
    pub fn new(bins: usize) -> Self {
        let bit = |row: usize| 1 << (ROW_BITS as usize + row % ROWS_APART);
        Tables {
            counts: [0; ROWS],
            row_bit: std::array::from_fn(|row| match (1..=bins).contains(&row) {
                true => bit(row),
                false => 0,
            }),
            cycles: table(EMPTY),
            before: table(NONE),
            special: table(0),
            specials: 0,
        }
    }

    /// Begins a macropixel.
    pub fn clear_counts(&mut self) {
        self.counts.fill(0);
    }

    /// Photons by row, without those that were taken out.
    pub fn counts(&self) -> &[u32; ROWS] {
        &self.counts
    }

    /// Counts the photons of a group, at most [`MOST_PHOTONS`].
    pub fn put(&mut self, codes: &[Code]) {
        debug_assert!(codes.len() <= MOST_PHOTONS);
        self.specials = put(self, codes);
    }

    /// The `index`-th cycle that has two photons in one SPAD or one bin, or a doubtful one. A cycle may come several
    /// times.
    pub fn special(&self, index: usize) -> Option<usize> {
        (index < self.specials).then(|| usize::from(self.special[index]))
    }

    /// The last photon of a cycle, which is empty afterwards.
    pub fn take_last(&mut self, cycle: usize) -> Option<usize> {
        let word = std::mem::replace(&mut self.cycles[cycle], EMPTY);
        known((word >> LAST_BITS) as u16)
    }

    /// The photon of the same cycle before this one.
    pub fn before(&self, photon: usize) -> Option<usize> {
        known(self.before[photon])
    }

    /// One photon less in a row.
    pub fn remove(&mut self, row: usize) {
        self.counts[row] -= 1;
    }
}

fn known(photon: u16) -> Option<usize> {
    (photon != NONE).then_some(usize::from(photon))
}

#[multiversion(targets("x86_64+avx2+bmi1+bmi2"))]
fn put(tables: &mut Tables, codes: &[Code]) -> usize {
    // The cycle of what is no photon need not be empty.
    tables.cycles[..GROUP as usize].fill(EMPTY);
    let mut specials = 0;
    for (photon, &code) in codes.iter().enumerate() {
        let bits = 1 << code.spad() | tables.row_bit[code.row()];
        let cycle = &mut tables.cycles[code.cycle()];
        let word = *cycle;
        let others = word & !(u64::from(NONE) << LAST_BITS);
        *cycle = others | bits | (photon as u64) << LAST_BITS;
        tables.before[photon % (MOST_PHOTONS + 1)] = (word >> LAST_BITS) as u16;
        // Written always, kept if special: no branch to mispredict.
        tables.special[specials % (MOST_PHOTONS + 1)] = code.cycle() as u16;
        specials += usize::from(word & bits != 0 || code.is_doubtful());
        tables.counts[code.row()] += 1;
    }
    specials
}
