//! The SPADs of a macropixel: rows and columns of a small rectangle (thesis 4.2: 4×4).
//!
//! ```text
//!    0  1  2  3        SPADs are numbered row by row; SPAD_RAW<n> is the wire of SPAD n
//!    4  5  6  7
//!    8  9 10 11
//!   12 13 14 15
//! ```
//!
//! Sides are powers of two, so that some bits of a random word choose a SPAD.

/// As many SPADs may a macropixel have at most: a bit of a 64-bit word for each.
pub const MOST_SPADS: usize = 64;

/// Sides that a grid may have.
pub const SIDES: [usize; 4] = [1, 2, 4, 8];

/// Bits of COUNT and THRESHOLD (thesis Fig. 47) for `spads` SPADs, at least 1. THRESHOLD can ask for more than all of
/// them.
pub const fn count_bits(spads: usize) -> usize {
    spads.ilog2() as usize + 1
}

/// Rows and columns of a macropixel's SPADs.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash)]
pub struct SpadGrid {
    row_bits: u8,
    col_bits: u8,
}

impl Default for SpadGrid {
    /// 4×4, the QuantIC4x4's and the HSLIDAR's.
    fn default() -> Self {
        SpadGrid::new(4, 4)
    }
}

impl SpadGrid {
    /// A grid of `rows` × `cols`.
    ///
    /// # Panics
    /// Where a side is none of [`SIDES`].
    pub const fn new(rows: usize, cols: usize) -> Self {
        assert!(rows.is_power_of_two() && rows <= 8 && cols.is_power_of_two() && cols <= 8);
        SpadGrid {
            row_bits: rows.trailing_zeros() as u8,
            col_bits: cols.trailing_zeros() as u8,
        }
    }

    /// Rows.
    pub const fn rows(self) -> usize {
        1 << self.row_bits
    }

    /// Columns.
    pub const fn cols(self) -> usize {
        1 << self.col_bits
    }

    /// SPADs, 1 to [`MOST_SPADS`].
    #[inline]
    pub const fn spads(self) -> usize {
        1 << self.bits()
    }

    /// Bits of a SPAD's number.
    #[inline]
    pub(crate) const fn bits(self) -> u32 {
        (self.row_bits + self.col_bits) as u32
    }

    /// The neighbour of a SPAD to the left (0), right (1), top (2) or bottom (3), if there is one.
    pub(crate) fn neighbour(self, spad: u8, direction: u32) -> Option<u8> {
        let (rows, cols) = (self.rows() as u8, self.cols() as u8);
        let (row, col) = (spad / cols, spad % cols);
        match direction {
            0 => (col > 0).then(|| spad - 1),
            1 => (col + 1 < cols).then(|| spad + 1),
            2 => (row > 0).then(|| spad - cols),
            _ => (row + 1 < rows).then(|| spad + cols),
        }
    }

    /// Pairs of direct neighbours, each counted once.
    pub const fn neighbours(self) -> usize {
        let (rows, cols) = (self.rows(), self.cols());
        rows * (cols - 1) + cols * (rows - 1)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn neighbours_are_mutual_and_counted() {
        for rows in SIDES {
            for cols in SIDES {
                let grid = SpadGrid::new(rows, cols);
                assert_eq!(grid.spads(), rows * cols);
                let mut found = 0;
                for spad in 0..grid.spads() as u8 {
                    for direction in 0..4 {
                        if let Some(other) = grid.neighbour(spad, direction) {
                            assert_eq!(grid.neighbour(other, direction ^ 1), Some(spad));
                            found += 1;
                        }
                    }
                }
                assert_eq!(found, 2 * grid.neighbours());
            }
        }
        assert_eq!(SpadGrid::default().neighbours(), 24);
    }
}
