//! The rows of a table that an echo's photons come to, by their ranks.

use std::ops::Range;

use super::echo_rows::{PassedEdges, shorten};
use super::sight::ROUNDING_FS;
use super::table::Layout;
use crate::photon::PixelStream;

/// Edges of rows, as ranks: the first that may be, and the first that is for certain, at the edge or after it.
#[derive(Debug, Clone)]
pub(super) struct RowRanks {
    edges: Vec<[i16; 2]>,
    /// How many edges come before those: a photon is after them or in doubt.
    first_row: i16,
}

impl RowRanks {
    /// For the rows of a table, of what is drawn `within_fs` after the start of the cycle. `None` where the pulse has no ranks.
    pub(super) fn new(
        light: &PixelStream<'_>,
        layout: &Layout,
        within_fs: &Range<i64>,
    ) -> Option<Self> {
        let rows = layout.edges_fs[1..].iter();
        let rows = rows.map(|&edge_fs| (edge_fs, ROUNDING_FS + 1));
        let edges = std::iter::once((within_fs.start, 0)).chain(rows);
        let ranks = |(edge_fs, room_fs)| light.signal_ranks_at(edge_fs as f64, room_fs as f64);
        let mut edges: Vec<[i16; 2]> = edges.map(ranks).collect::<Option<_>>()?;
        let first_row = shorten(&mut edges);
        Some(RowRanks { edges, first_row })
    }

    /// The rows of photons with these random words, low and high, a multiple of [`LANES`](crate::photon::LANES): 0 is before all of
    /// them.
    pub(super) fn compare(&self, words: [&[u32]; 2], passed: &mut PassedEdges) {
        passed.compare(self.first_row, &self.edges, words);
    }
}
