//! Delays of the paths that decide what a macropixel counts: the only place that measures them.
//!
//! ```text
//!   Silicon ─► delays of every cell ─┐
//!   macropixel's netlist ────────────┴─► static timing ─► MacropixelDelays ─┬─► ChipTiming: the latest of each
//!                                                                           ├─► the engine with each macropixel's own timing
//!                                                                           └─► `gdtof timing`: margins and paths
//! ```
//!
//! | file | what it has |
//! |---|---|
//! | [`cell_library`] | the cells, built in or of a Liberty file |
//! | [`library_files`] | the files of a library in a setting |
//! | `library_text` | the text of a Liberty file, packed or not |
//! | [`silicon`] | the cell library, conditions and mismatch |
//! | `chip_timing` | [`ChipTiming`]: delays as numbers |
//! | `measure` | what measures them |
//! | [`local_stop`] | when LOCAL_STOP rises, for each start value |
//! | `reset_chain` | how many buffers the reset pulse needs |
//! | `clk_skew` | the wires of CLK to every column |
//! | `delay_lines` | taps of the delay lines of every macropixel |
//! | [`macropixel`] | which edges start a path, where it is cut, and what is read off |
//!
//! Reference models and the window law use a sensor's [`ChipTiming`] instead of simulating cells.

pub mod cell_library;
pub(crate) mod chip_timing;
pub(crate) mod clk_skew;
pub(crate) mod delay_lines;
pub mod library_files;
mod library_text;
pub mod local_stop;
pub mod macropixel;
pub(crate) mod measure;
mod reset_chain;
pub mod silicon;

pub use chip_timing::{BlockTiming, ChipTiming, CounterTiming};
pub use local_stop::LocalStopDelays;
