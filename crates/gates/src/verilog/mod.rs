//! Structural Verilog: the same cells, nets and hierarchy for other tools.
//!
//! | file | cells | for |
//! |---|---|---|
//! | `exact_cells` | every edge as the event kernel has it, also where events meet in one instant | differential tests in Icarus Verilog |
//! | `standard_cells` | `specify` blocks, timing checks, notifiers; takes SDF | other simulators, linters, synthesis |
//!
//! Both have the cells and pins that `modules` instantiates. Time unit and precision are one femtosecond.

mod exact_cells;
mod modules;
mod standard_cells;

pub use exact_cells::{write_cells, write_delays, write_parametric_cells};
pub use modules::write_modules;
pub use standard_cells::write_standard_cells;
#[cfg(feature = "liberty")]
pub(super) use standard_cells::{DFFSR_STATE, HEAD};

use crate::netlist::CellKind;

const TIMESCALE: &str = "`timescale 1fs/1fs\n";

/// The Verilog primitive with a cell's function; none for multiplexer and flip-flops.
const fn primitive(kind: CellKind) -> Option<&'static str> {
    match kind {
        CellKind::Inv => Some("not"),
        CellKind::Buf => Some("buf"),
        CellKind::Nand2 => Some("nand"),
        CellKind::Nor2 => Some("nor"),
        CellKind::And2 => Some("and"),
        CellKind::Or2 => Some("or"),
        CellKind::Xor2 => Some("xor"),
        CellKind::Xnor2 => Some("xnor"),
        CellKind::Mux2 | CellKind::Dffr | CellKind::Dffsr => None,
    }
}
