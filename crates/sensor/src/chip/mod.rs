//! The circuits of the chip, as gates and flip-flops, each beside its plain-Rust reference model.
//!
//! ```text
//!                 ┌──────────────────────────── macropixel ─────────────────────────────┐
//!  SPAD_RAW ──────┼─► front_end ─SPAD_TIMED─► correlation ─SPAD_EVENT─► metdc ─HIT─► histogram
//!  CLK, STOP ─────┼─► p_counter_timing ─COUNTER_CLK/RESET─► p_counter ─LOCAL_STOP─┘     │
//!                 └──────────────────────────────────────────▲───────────────────────────┘
//!  COUNTER_INITS ─► deserialiser ─COUNTER_INIT_ROW───────────┤
//!                   row_scanner ──MEMORY_LOAD────────────────┘
//!  DATA_OUT ◄─ serialiser ◄─ column_bus ◄─ WORD of every macropixel ◄─ readout_scanner
//! ```
//!
//! [`window_law`] says which photons a start value selects; everything that aims or reads a window
//! asks it. [`probes`] says where nets are: nothing else knows the names of those inside the chip.

pub mod bin_edges;
mod bins;
mod blocks;
pub mod config;
pub mod empty_pixel;
pub mod exposure;
mod frame_time;
pub mod own_block;
pub mod probes;
pub mod race;
mod sensor_file;
pub mod sensors;
pub mod timing;
pub mod window_law;

pub use crate::photon::{MOST_SPADS, SIDES, SpadGrid, count_bits};
pub use bin_edges::BinEdges;
pub use blocks::{
    array, correlation, front_end, histogram, histogram_sums, load_path, macropixel,
    macropixel_model, metdc, metdc_counter, metdc_delay_line, p_counter, p_counter_timing,
    photon_line, readout, tdc,
};
pub use config::{
    AfterBorrow, EventType, FrontEnd, Mode, Overflow, PCounter, SensorConfig, Tap, Tdc,
};
pub use exposure::{Exposure, ExposureError};
pub use own_block::OwnBlock;
pub use probes::{LoadPins, LoadProbe, Probe, Probes, ReadPins, ReadProbe, SensorPins};
pub use race::{Conflict, Cure, Irregular, NoAim, Race};
pub use sensor_file::{CorrelationLines, NeverMet, SensorFault};
pub use sensors::{Sensor, hslidar, hslidar_delay_line, quantic4x4, vcsel_flash};
pub use timing::ChipTiming;
pub use timing::cell_library::{CellLibrary, FromFile};
pub use timing::library_files::{library_files, library_setting};
pub use timing::silicon::{Limits, Silicon, UnknownConditions};
pub use window_law::{WindowLaw, WindowOutcome};
