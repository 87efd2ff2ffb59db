//! The test bench around the chip: what is driven into its pins, and what is watched there.
//!
//! ```text
//!   start values, SPAD events (CSV) ─► recording ─► plan ─┬─► the netlist in an engine ─► hardware_events
//!                                                         └─► verilog: the same for other simulators
//! ```

mod hardware_events;
mod plan;
pub mod recording;
mod verilog;

pub use hardware_events::{HardwareEvent, HardwareEventKind, HardwareEventReport, HardwareEvents};
pub use plan::{Schedule, Skip, StimulusPlan};
pub(crate) use plan::{load_stimulus, read_stimulus, reload_stimulus};
pub use verilog::{Export, export_verilog};
