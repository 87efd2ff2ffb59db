//! Cells of a library that cannot stand for any kind of cell here, and why: latches, buses, three-state drivers, fillers and so on.
//!
//! They are no fault of the library. Whoever misses a cell finds it in [`Liberty::passed_over`](super::Liberty::passed_over), and a
//! library from which nothing can be made is refused with the commonest reasons.

use super::error::LibertyError;
use super::group::Group;

/// A cell that is not used.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct PassedOver {
    /// Its name.
    pub cell: String,
    /// Line it begins in, from 1.
    pub line: usize,
    /// What keeps it from being used.
    pub why: String,
}

impl PassedOver {
    pub(super) fn new(group: &Group<'_>, why: String) -> Self {
        PassedOver {
            cell: group.name().to_owned(),
            line: group.line,
            why,
        }
    }
}

/// Cells that a message names.
const NAMED: usize = 3;

impl LibertyError {
    /// The same with the cells that were passed over: those that the message names, else the first ones.
    pub(super) fn with_passed_over(mut self, cells: &[PassedOver]) -> Self {
        let words = |text: &str| {
            let words = text.split([' ', ',', ';', ':']);
            words.map(str::to_owned).collect::<Vec<_>>()
        };
        let words = words(&self.message);
        let is_named = |cell: &&PassedOver| words.contains(&cell.cell);
        let named: Vec<&PassedOver> = cells.iter().filter(is_named).take(NAMED).collect();
        let told = if named.is_empty() {
            cells.iter().take(NAMED).collect()
        } else {
            named
        };
        for PassedOver { cell, line, why } in &told {
            self.message += &format!("; {cell} in line {line} is passed over: {why}");
        }
        match cells.len() - told.len() {
            0 => {}
            more => self.message += &format!("; and so are {more} more"),
        }
        self
    }
}
