//! Cells of a library that cannot stand for any kind of cell here, and why: latches, buses, three-state drivers, fillers and so on.
//!
//! They are no fault of the library. Whoever misses a cell finds it in [`Liberty::passed_over`](super::Liberty::passed_over), and a
//! library from which nothing can be made is refused with the commonest reasons.

use super::error::LibertyError;
use super::group::Group;
use crate::netlist::CellKind;

/// A cell that is not used.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct PassedOver {
    /// Its name.
    pub cell: String,
    /// Line it begins in, from 1.
    pub line: usize,
    /// What keeps it from being used.
    pub why: String,
    is_flip_flop: bool,
}

impl PassedOver {
    pub(super) fn new(group: &Group<'_>, why: String) -> Self {
        PassedOver {
            cell: group.name().to_owned(),
            line: group.line,
            is_flip_flop: group.of_kind("ff").next().is_some(),
            why,
        }
    }
}

/// Cells that a message names.
const NAMED: usize = 3;

impl LibertyError {
    /// The same with the cells that were passed over and that this may be about: those that it names, or else flip-flops or gates.
    pub(super) fn with_passed_over(mut self, cells: &[PassedOver]) -> Self {
        let words: Vec<String> = (self.message.split([' ', ',', ';', ':']))
            .map(str::to_owned)
            .collect();
        let is_named = |cell: &&PassedOver| words.contains(&cell.cell);
        let misses_flip_flop = (CellKind::ALL.iter())
            .any(|kind| kind.is_flip_flop() && words.iter().any(|word| word == kind.name()));
        let mut told: Vec<&PassedOver> = cells.iter().filter(is_named).collect();
        if told.is_empty() {
            let alike = cells
                .iter()
                .filter(|cell| cell.is_flip_flop == misses_flip_flop);
            told = alike.collect();
        }
        for PassedOver {
            cell, line, why, ..
        } in told.iter().take(NAMED)
        {
            self.message += &format!("; {cell} in line {line} is passed over: {why}");
        }
        if told.len() > NAMED {
            self.message += &format!("; and so are {} more", told.len() - NAMED);
        }
        self
    }
}
