//! The test bench around the chip: what is driven into its pins, and what is watched there.
//!
//! ```text
//!   start values, SPAD events (CSV) ─► recording ─► stimulus ─┬─► the netlist in an engine ─► hardware_events
//!                                                            └─► verilog: the same for other simulators
//! ```

mod hardware_events;
pub mod recording;
mod stimulus;
mod verilog;

pub use hardware_events::{HardwareEvent, HardwareEventKind, HardwareEventReport, HardwareEvents};
pub use stimulus::{Schedule, Skip, StimulusPlan};
pub(crate) use stimulus::{load_stimulus, read_stimulus, reload_stimulus};
pub use verilog::{Export, export_annotated_verilog, export_netlist, export_verilog};
