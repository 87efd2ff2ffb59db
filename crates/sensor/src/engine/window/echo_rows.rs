//! The rows of an echo's photons by their ranks, without their times.
//!
//! Ranks rise with time ([`signal_rank`]), so edges in time become numbers to compare ranks with, two for each: between
//! them a photon may be on either side, and is marked as doubtful.
//!
//! ```text
//!   rank    ──────┬──╫──┬─────────────┬──╫──┬─────────────┬──╫──┬──────►
//!   row       0   ┊ ?  ┊       1      ┊ ?  ┊       2      ┊ ?  ┊   …
//! ```

#![allow(
    unsafe_code,
    reason = "multiversion calls what the processor was asked for"
)]

use std::ops::Range;

use multiversion::multiversion;

use super::codes::Code;
use super::photon_selection::PhotonSelection;
use super::sight::ROUNDING_FS;
use crate::photon::{LANES, PixelStream, RANKS, signal_rank};

/// Edges of rows, as ranks: the first that may be, and the first that is for certain, at the edge or after it.
#[derive(Debug, Clone)]
pub(super) struct EchoRows {
    bins: u32,
    /// Beginning and end of the drawn slots.
    ends: [[i16; 2]; 2],
    /// Edges of bins.
    edges: Vec<[i16; 2]>,
    /// How many edges come before those: a photon is after them or in doubt.
    first_row: i16,
}

/// Photons that are compared at once: no loop has a rest.
const TOGETHER: usize = 2 * LANES;

/// Room for what is found out about photons.
#[derive(Debug, Clone, Default)]
pub(super) struct PassedEdges {
    ranks: Vec<i16>,
    /// How many edges they have passed for certain.
    pub rows: Vec<i16>,
    /// How many they may have passed.
    pub possible: Vec<i16>,
}

impl PassedEdges {
    /// Finds out about photons with these random words, low and high, a multiple of [`LANES`], that have passed `first_row` edges
    /// before these.
    pub(super) fn compare(&mut self, first_row: i16, edges: &[[i16; 2]], words: [&[u32]; 2]) {
        let filled_up = words[0].len().next_multiple_of(TOGETHER);
        self.ranks.resize(filled_up, 0);
        for passed in [&mut self.rows, &mut self.possible] {
            passed.clear();
            passed.resize(filled_up, first_row);
        }
        compare(self, edges, words);
    }
}

/// Leaves out edges that no photon is on either side of for certain; returns how many came before those that are left. The echo is
/// shorter than most windows. Of the edges in either tail, the nearest one puts in doubt whatever may be on the wrong side of the
/// others.
pub(super) fn shorten(edges: &mut Vec<[i16; 2]>) -> i16 {
    let before = edges.partition_point(|edge| edge[0] < 0).saturating_sub(1);
    let after = edges.partition_point(|edge| edge[1] < RANKS);
    edges.truncate(after + 1);
    edges.drain(..before);
    before as i16
}

impl EchoRows {
    /// For `bins` bins of `period_fs` from `origin_fs` on, of what is drawn `within_fs`; all times after the start of the
    /// cycle. `None` where the pulse has no ranks.
    pub(super) fn new(
        light: &PixelStream<'_>,
        bins: usize,
        period_fs: f64,
        origin_fs: i64,
        within_fs: Range<i64>,
    ) -> Option<Self> {
        let edge = |bin: usize| {
            let time_fs = origin_fs as f64 + bin as f64 * period_fs;
            light.signal_ranks_at(time_fs, (ROUNDING_FS + 1) as f64)
        };
        let mut edges: Vec<[i16; 2]> = (0..=bins).map(edge).collect::<Option<_>>()?;
        let first_row = shorten(&mut edges);
        Some(EchoRows {
            bins: bins as u32,
            ends: [
                light.signal_ranks_at(within_fs.start as f64, 0.0)?,
                light.signal_ranks_at(within_fs.end as f64, 0.0)?,
            ],
            edges,
            first_row,
        })
    }

    /// Codes and marks of photons with these random words, low and high, a multiple of [`LANES`].
    pub(super) fn encode(
        &self,
        wanted: &PhotonSelection,
        place_shift: u32,
        [low, high]: [&[u32]; 2],
        passed: &mut PassedEdges,
        (codes, marks): (&mut [Code], &mut [u32]),
    ) {
        passed.compare(self.first_row, &self.edges, [low, high]);
        encode(self, wanted, place_shift, high, passed, codes, marks);
    }
}

#[multiversion(targets("x86_64+avx512f+avx512bw+avx512dq+avx512vl", "x86_64+avx2"))]
fn compare(passed: &mut PassedEdges, edges: &[[i16; 2]], [low, high]: [&[u32]; 2]) {
    for ((rank, &low), &high) in passed.ranks.iter_mut().zip(low).zip(high) {
        *rank = signal_rank(low, high);
    }
    for &[may, must] in edges {
        let out = passed.rows.iter_mut().zip(&mut passed.possible);
        for (&rank, (row, possible)) in passed.ranks.iter().zip(out) {
            *row += i16::from(rank >= must);
            *possible += i16::from(rank >= may);
        }
    }
}

#[multiversion(targets("x86_64+avx512f+avx512bw+avx512dq+avx512vl", "x86_64+avx2"))]
fn encode(
    rows: &EchoRows,
    wanted: &PhotonSelection,
    place_shift: u32,
    high: &[u32],
    passed: &PassedEdges,
    codes: &mut [Code],
    marks: &mut [u32],
) {
    let (bins, [from, until], wanted) = (rows.bins, rows.ends, *wanted);
    let photons = high.iter().zip(&passed.ranks);
    let found = passed.rows.iter().zip(&passed.possible);
    let out = codes.iter_mut().zip(marks);
    for (((&high, &rank), (&row, &possible)), (code, mark)) in photons.zip(found).zip(out) {
        let after = |edge: i16| i16::from(rank >= edge);
        let [begun, surely_begun] = from.map(after);
        let [over, surely_over] = until.map(after);
        let doubts = (possible - row) + (begun - surely_begun) + (over - surely_over);
        let own = |place| Code::new(place, row as u32, doubts != 0, bins);
        let (own, own_mark) = own(wanted.place(high >> place_shift));
        let is_drawn = begun > surely_over;
        *code = if is_drawn { own } else { Code::NONE };
        *mark = if is_drawn { own_mark } else { 0 };
    }
}
