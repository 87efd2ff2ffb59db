//! The rows of a table: bins of the window, and CLK periods before it as far back as SPADs remember.

use crate::engine::window::sight::ROUNDING_FS;
use crate::photon::{DeadTimeLaw, SpadModel};
use crate::units::Time;

/// Most rows before the window. A longer memory has longer rows.
const MOST_BEFORE: usize = 16;

/// Rows of two laser cycles differ by less, fs.
const SLACK_FS: i64 = 4 * ROUNDING_FS;

/// What the rows are, and what a photon in one does to a later one of its SPAD.
#[derive(Debug, Clone)]
pub(in crate::engine::window) struct Layout {
    /// Where rows begin, and the last one ends, after the start of the window's cycle, within [`ROUNDING_FS`].
    pub edges_fs: Vec<i64>,
    /// Rows before the window.
    pub before: usize,
    /// By row: the first one whose photons blind it for certain, and the first one whose photons may.
    pub(super) reach: Vec<[usize; 2]>,
    /// By row of the window and the one after it: the first one whose photons may come less than a stage of the photon line before
    /// its photons. Empty where there is no such line.
    pub(super) meets: Vec<usize>,
    /// How many rows what came before the table may blind.
    pub(super) open: usize,
    /// Whether a SPAD may fire twice in a row.
    pub fires_twice: bool,
    pub(super) is_paralysable: bool,
    /// Lengths of rows before the window and in it, inverse.
    per_fs: [f64; 2],
}

impl Layout {
    /// Of a window whose bins have these edges; photons are known from `from_fs` on. `stage` is that of the photon line, if SPADs have one.
    pub(in crate::engine::window) fn new(
        bins_fs: &[i64],
        from_fs: i64,
        spads: &SpadModel,
        stage: Option<Time>,
    ) -> Self {
        let (first_fs, bins) = (bins_fs[0], bins_fs.len() - 1);
        let bin_fs = (bins_fs[bins] - first_fs) / bins as i64;
        let memory_fs = (first_fs - from_fs).max(1);
        let before = (memory_fs as u64).div_ceil(bin_fs as u64) as usize;
        let row_fs = if before > MOST_BEFORE {
            (memory_fs as u64).div_ceil(MOST_BEFORE as u64) as i64
        } else {
            bin_fs
        };
        let before = before.min(MOST_BEFORE);
        let earlier = (1..=before as i64).rev().map(|row| first_fs - row * row_fs);
        let edges_fs: Vec<i64> = earlier.chain(bins_fs.iter().copied()).collect();
        let rows = edges_fs.len() - 1;
        let dead_fs = spads.dead_time.as_fs();
        let blinds =
            |from: usize, row: usize| edges_fs[row + 1] - edges_fs[from] + SLACK_FS <= dead_fs;
        let may_blind =
            |from: usize, row: usize| edges_fs[row] - edges_fs[from + 1] - SLACK_FS <= dead_fs;
        // Both rise with the row.
        let (mut blind, mut may) = (0, 0);
        let mut reach = Vec::with_capacity(rows);
        for row in 0..rows {
            while blind < row && !blinds(blind, row) {
                blind += 1;
            }
            while may < row && !may_blind(may, row) {
                may += 1;
            }
            reach.push([blind, may]);
        }
        let meets = |stage: Time| {
            let first = |row: usize| {
                let far_fs = edges_fs[row] - SLACK_FS - stage.as_fs();
                edges_fs[1..=row].partition_point(|&end_fs| end_fs <= far_fs)
            };
            (before..=rows).map(first).collect()
        };
        Layout {
            before,
            reach,
            meets: stage.map_or_else(Vec::new, meets),
            open: (0..rows)
                .take_while(|&row| edges_fs[row] - SLACK_FS <= from_fs + dead_fs)
                .count(),
            fires_twice: !(0..rows).all(|row| blinds(row, row)),
            is_paralysable: spads.law == DeadTimeLaw::Paralysable,
            per_fs: [row_fs, bin_fs].map(|length_fs| 1.0 / length_fs as f64),
            edges_fs,
        }
    }

    /// How many rows there are.
    pub(in crate::engine::window) fn rows(&self) -> usize {
        self.reach.len()
    }

    /// How many edges come before a time: its row in the table. `None` where it may be on either side of one.
    #[inline]
    pub(in crate::engine::window) fn row_of(&self, time_fs: i64) -> Option<usize> {
        let (edges_fs, before) = (&self.edges_fs, self.before);
        let since_fs = (time_fs - edges_fs[before]) as f64;
        let length = self.per_fs[usize::from(since_fs >= 0.0)];
        let guess = (since_fs * length + before as f64) as i64;
        let guess = guess.clamp(0, self.rows() as i64) as usize;
        // Bins differ by a femtosecond or two, which moves a time into a neighbour.
        let mut row = guess;
        while row > 0 && time_fs < edges_fs[row] {
            row -= 1;
        }
        while row < self.rows() && time_fs >= edges_fs[row + 1] {
            row += 1;
        }
        if time_fs < edges_fs[0] {
            return Some(0);
        }
        let is_near = |edge: usize| {
            let edge_fs = edges_fs.get(edge);
            edge_fs.is_some_and(|edge_fs| (edge_fs - time_fs).abs() <= ROUNDING_FS)
        };
        let is_certain = !is_near(row) && !is_near(row + 1);
        is_certain.then_some(row + 1)
    }
}
