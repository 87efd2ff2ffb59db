//! The tables in which photons of a group are counted. Their lengths are powers of two, so that an index needs no check.

use super::binning::{Code, ROW, Tally, tally};
use crate::photon::PLACE_BITS;

/// Rows of up to 64 bins, one before and one after them, by cycles.
const CELLS: usize = 128 * ROW;
const PLACES: usize = 1 << PLACE_BITS;
/// Most photons of a group, and one that is none.
pub const MOST_PHOTONS: usize = u16::MAX as usize;
const NONE: u16 = u16::MAX;

/// How many SPADs fired by row and cycle, and which photons share cycle and SPAD.
pub struct Tables {
    rows: usize,
    cells: Box<[u8; CELLS]>,
    /// Last photon by place.
    last: Box<[u16; PLACES]>,
    /// The photon before it at the same place, by photon.
    before: Box<[u16; MOST_PHOTONS + 1]>,
    /// Photons that need a closer look.
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
    /// Tables with this many rows.
    pub fn new(rows: usize) -> Self {
        Tables {
            rows,
            cells: table(0),
            last: table(NONE),
            before: table(0),
            special: table(0),
            specials: 0,
        }
    }

    /// Empties the tables.
    pub fn clear(&mut self) {
        self.cells[..self.rows * ROW].fill(0);
        self.last.fill(NONE);
        self.specials = 0;
    }

    /// Puts photon number `photon` (below [`MOST_PHOTONS`], each once) into its cell.
    #[inline(always)]
    pub fn put(&mut self, code: Code, photon: usize) {
        let cell = &mut self.cells[code.cell() % CELLS];
        *cell = cell.wrapping_add(1);
        let last = &mut self.last[code.place() % PLACES];
        let before = *last;
        *last = photon as u16;
        self.before[photon % (MOST_PHOTONS + 1)] = before;
        // Written always, kept if special: no branch to mispredict.
        self.special[self.specials % (MOST_PHOTONS + 1)] = photon as u16;
        self.specials += usize::from(before != NONE || code.is_doubtful());
    }

    /// The `index`-th photon that shares its cycle and SPAD with an earlier one or is doubtful.
    pub fn special(&self, index: usize) -> Option<usize> {
        (index < self.specials).then(|| usize::from(self.special[index]))
    }

    /// The last photon of a place; the place is empty afterwards.
    pub fn take_last(&mut self, place: usize) -> Option<usize> {
        let last = std::mem::replace(&mut self.last[place], NONE);
        (last != NONE).then_some(usize::from(last))
    }

    /// The photon of the same place before this one.
    pub fn before(&self, photon: usize) -> Option<usize> {
        let before = self.before[photon];
        (before != NONE).then_some(usize::from(before))
    }

    /// One more SPAD in a cell.
    pub fn add(&mut self, cell: usize) {
        self.cells[cell] = self.cells[cell].wrapping_add(1);
    }

    /// One SPAD less in a cell.
    pub fn remove(&mut self, cell: usize) {
        self.cells[cell] = self.cells[cell].wrapping_sub(1);
    }

    /// Tallies the first `cycles` cells of every bin.
    pub fn tallies(
        &self,
        cycles: usize,
        (least, most): (u8, u8),
    ) -> impl Iterator<Item = Tally> + '_ {
        (1..self.rows - 1).map(move |row| tally(&self.cells[row * ROW..][..cycles], least, most))
    }
}
