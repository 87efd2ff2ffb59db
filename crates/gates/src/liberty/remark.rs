//! What a user should know of a library that is read: what was put together from its cells, and what is odd about them.

use std::fmt;

use super::error::PassedOver;
use crate::netlist::{CellKind, CheckKind};

/// A kind that several cells of a library stand for together.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct MadeOf {
    /// The kind.
    pub kind: CellKind,
    /// Names of the weakest cells that stand for it, in order of the signal.
    pub cells: Vec<String>,
}

impl fmt::Display for MadeOf {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(
            f,
            "{} is made of {}",
            self.kind.name(),
            self.cells.join(" + ")
        )
    }
}

/// Something that is odd about a library and matters here.
#[derive(Debug, Clone, PartialEq)]
#[non_exhaustive]
pub enum LibraryRemark {
    /// A cell that would fit and lacks something.
    NotUsed(PassedOver),
    /// A flip-flop of which the library does not say whether clear or preset wins.
    OpenState {
        /// Name of the cell.
        cell: String,
    },
    /// A flip-flop that stands for a kind with some of its pins tied.
    TiedPins {
        /// The kind.
        kind: CellKind,
        /// Name of the cell.
        cell: String,
        /// Names of the pins, and whether they are tied to 1.
        pins: Vec<(String, bool)>,
    },
    /// A flip-flop that stands for a kind though the library says not to use it.
    DontUse {
        /// The kind.
        kind: CellKind,
        /// Name of the cell.
        cell: String,
    },
    /// Cells that leave something out, or state something that is not used.
    Cells {
        /// What it is.
        remark: CellRemark,
        /// Names of the cells.
        cells: Vec<String>,
    },
    /// A library that does not state its supply.
    NoSupply,
    /// A library that does not state its unit of time.
    NoTimeUnit,
    /// Cells that a file has more than once.
    Duplicates {
        /// Their names.
        cells: Vec<String>,
    },
}

impl fmt::Display for LibraryRemark {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let no_other = "the library has no other that would do";
        match self {
            LibraryRemark::NotUsed(cell) => write!(f, "{cell}"),
            LibraryRemark::OpenState { cell } => write!(
                f,
                "the library leaves open what {cell} does while clear and preset are both active (clear_preset_var1); the clear is taken to win"
            ),
            LibraryRemark::TiedPins { kind, cell, pins } => {
                let kind = kind.name();
                let pins = pins.iter();
                let pins = pins.map(|(pin, level)| format!("{pin} = {}", u8::from(*level)));
                let pins = pins.collect::<Vec<_>>().join(", ");
                write!(
                    f,
                    "{kind} is made of {cell} with pins tied ({pins}): {no_other}"
                )
            }
            LibraryRemark::DontUse { kind, cell } => {
                let kind = kind.name();
                write!(
                    f,
                    "{kind} is made of {cell}, which the library says not to use: {no_other}"
                )
            }
            LibraryRemark::Cells { remark, cells } => remark.write(f, &few_names(cells)),
            LibraryRemark::NoSupply => f.write_str(
                "no supply (nom_voltage) is stated; energies of loads are those at an assumed one",
            ),
            LibraryRemark::NoTimeUnit => {
                f.write_str("no time_unit is stated; times are taken for nanoseconds")
            }
            LibraryRemark::Duplicates { cells } => {
                let cells = few_names(cells);
                write!(
                    f,
                    "{cells}: a file has such a cell more than once; the first one counts"
                )
            }
        }
    }
}

/// Up to three names, or the first one and how many more there are.
fn few_names(cells: &[String]) -> String {
    match cells {
        [first, _, _, _, ..] => format!("{first} and {} more cells", cells.len() - 1),
        few => few.join(", "),
    }
}

/// What a cell leaves out, or states in vain.
#[derive(Debug, Clone, PartialEq, Eq)]
#[non_exhaustive]
pub enum CellRemark {
    /// No area.
    NoArea,
    /// No leakage.
    NoLeakage,
    /// No internal power.
    NoEnergy,
    /// A flip-flop without these limits.
    NoLimits(Vec<CheckKind>),
    /// Internal power that is no table over a slew and a load.
    EnergyNotUsed,
    /// A shortest period of the clock.
    PeriodNotUsed,
}

impl CellRemark {
    /// Writes it of some cells.
    fn write(&self, f: &mut fmt::Formatter<'_>, cells: &str) -> fmt::Result {
        match self {
            CellRemark::NoArea => write!(f, "no area is stated for {cells}; it counts as 0"),
            CellRemark::NoLeakage => write!(f, "no leakage is stated for {cells}; it counts as 0"),
            CellRemark::NoEnergy => {
                write!(f, "no internal_power is stated for {cells}; it counts as 0")
            }
            CellRemark::NoLimits(kinds) => {
                let names = kinds.iter().map(|kind| kind.name().replace('_', " "));
                let names = names.collect::<Vec<_>>().join(", ");
                write!(
                    f,
                    "no limits of {names} are stated for {cells}; they count as 0"
                )
            }
            CellRemark::EnergyNotUsed => write!(
                f,
                "internal_power that is no table over a slew and a load is not used, in {cells}"
            ),
            CellRemark::PeriodNotUsed => write!(
                f,
                "the shortest period of the clock is not used, in {cells}; widths of its pulses are"
            ),
        }
    }
}
