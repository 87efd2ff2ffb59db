//! A cell with its tables, as it is used: pins, delays, limits and energies.
//!
//! ```text
//!   every cell ─► Candidate: pins and function ─(the few that are chosen)─► CellModel: arcs, limits, capacitances
//! ```

use super::candidate::Role;
use super::remark::CellRemark;
use super::table::Table;
use crate::netlist::{CheckKind, Edge};

/// An input pin.
#[derive(Debug, Clone, PartialEq)]
pub(super) struct InputPin {
    pub name: String,
    /// Capacitance while it rises and falls, fF.
    pub load_ff: [f64; 2],
}

/// An output pin.
#[derive(Debug, Clone, PartialEq)]
pub(super) struct OutputPin {
    pub name: String,
    /// Its own capacitance while it rises and falls, which loads it besides its net, fF.
    pub load_ff: [f64; 2],
}

/// How an edge of an input makes one of an output.
#[derive(Debug, Clone, PartialEq)]
pub(super) struct CellArc {
    pub from: usize,
    pub to: usize,
    pub cause: Edge,
    pub effect: Edge,
    pub delay: Table,
    pub slew: Table,
}

/// A limit on a flip-flop's pins.
#[derive(Debug, Clone, PartialEq)]
pub(super) struct CellCheck {
    pub kind: CheckKind,
    pub pin: usize,
    /// Direction of the pin that is bound.
    pub edge: Edge,
    /// Over the slews of clock and pin; of the pin alone for a pulse's width.
    pub limit: Table,
}

/// Energy within a cell when a pin changes, besides that of the loads at its outputs.
#[derive(Debug, Clone, PartialEq)]
pub(super) struct CellEnergy {
    /// Output; none where an input takes it by itself.
    pub to: Option<usize>,
    /// The input that changes, or is behind the output's change; any where the file does not say.
    pub from: Option<usize>,
    /// Of the pin's rise and fall, fJ over the input's slew and the output's load.
    pub tables: [Table; 2],
}

/// A chosen cell with its tables.
#[derive(Debug, Clone, PartialEq)]
pub(super) struct CellModel {
    pub name: String,
    /// Where it stands: the file's name, if there is one, and the line.
    pub place: String,
    pub role: Role,
    pub area: f64,
    /// Leakage, W.
    pub leakage_w: f64,
    pub inputs: Vec<InputPin>,
    pub outputs: Vec<OutputPin>,
    pub arcs: Vec<CellArc>,
    pub checks: Vec<CellCheck>,
    pub energies: Vec<CellEnergy>,
    /// What it does not state, and what it states that is not used here.
    pub remarks: Vec<CellRemark>,
}
