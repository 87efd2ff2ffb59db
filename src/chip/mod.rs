//! The circuits of the chip, as gates and flip-flops, each beside its plain-Rust reference model.
//!
//! ```text
//!                 ┌──────────────────────────── macropixel ─────────────────────────────┐
//!  SPAD_RAW ──────┼─► front_end ─SPAD_TIMED─► correlation ─SPAD_EVENT─► metdc ─HIT─► histogram
//!  CLK, STOP ─────┼─► p_counter_timing ─COUNTER_CLK/RESET─► p_counter ─LOCAL_STOP─┘     │
//!                 └──────────────────────────────────────────▲───────────────────────────┘
//!  COUNTER_INITS ─► deserialiser ─COUNTER_INIT_ROW───────────┤
//!                   row_scanner ──MEMORY_LOAD────────────────┘
//! ```
//!
//! [`window_law`] says which photons a start value selects; everything that aims or reads a window
//! asks it. [`probes`] says where nets are: nothing else knows the names of those inside the chip.

pub mod bin_edges;
pub mod config;
mod config_keys;
pub mod correlation;
pub mod exposure;
pub mod front_end;
pub mod histogram;
pub mod load_path;
pub mod macropixel;
pub mod metdc;
pub mod p_counter;
pub mod p_counter_timing;
pub mod probes;
pub mod race;
pub mod sensor;
pub mod timing;
pub mod window_law;

pub use config::{
    AfterBorrow, EventType, Mode, Overflow, PCounter, SensorConfig, THRESHOLD_BITS, Tap,
};
pub use exposure::Exposure;
pub use probes::{LoadPins, LoadProbe, Probe, Probes, SensorPins};
pub use race::{Cure, Race};
pub use timing::ChipTiming;
pub use timing::silicon::{Limits, Silicon};
pub use window_law::{Window, WindowLaw};

/// SPADs of one macropixel, 4×4 (thesis 4.2).
pub const SPADS: usize = 16;

use crate::netlist::{Module, NetlistError};
use std::sync::Arc;

/// Unwraps a circuit of this crate, whose correctness is ours to guarantee.
fn finished(module: Result<Arc<Module>, NetlistError>) -> Arc<Module> {
    module.unwrap_or_else(|error| panic!("a circuit of this crate is malformed: {error}"))
}
