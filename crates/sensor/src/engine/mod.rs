//! The ways to run an exposure: from gates and delays to nothing but the window.
//!
//! | engine | what it simulates | held to |
//! |---|---|---|
//! | [`Gate`] | every net of the netlist, with its delays | Icarus Verilog on the exported netlist |
//! | [`Cycle`] | every CLK period of the levelised netlist, 512 macropixels to a word | `Gate` |
//! | [`Window`] | only the CLK periods a start value can see, through the window law | `Cycle` |
//! | [`Cohort`] | no photons: laser cycles in the same state move together | `Window`, in distribution |
//! | [`Timed`] | `Window` or `Cycle` with each macropixel's own delays, `Gate` where these leave an order in doubt | `Gate` with the same delays |
//!
//! All but `Cohort` take the same start value and SPAD pulses ([`Replay`]) and, with the same delays, give the same histogram. `Cycle` and `Window` assume what
//! the window law can promise, and refuse a configuration in which two signals race. The macropixel's
//! plain-Rust reference model ([`crate::chip::macropixel_model::MacropixelModel`]) is the tests' slow judge of all of them. `Window`
//! also refuses a P-counter that raises LOCAL_STOP more than once in a laser cycle.

mod cancelling;
pub mod cohort;
mod cycle;
mod error;
mod exposing;
mod gate;
mod histograms;
mod lanes;
mod late_cycle;
pub mod load;
pub mod readout;
mod timed;
mod traits;
pub mod waveform;
mod window;

pub use cancelling::{Cancelling, cancelled};
pub use cohort::{Cohort, CohortOptions, variance_left_out};
pub use cycle::{Cycle, LevelisationError, PackedPulses};
pub use error::{EngineError, NotModelled};
pub use exposing::{
    Answer, expose, expose_without_skipping, full_stream, refuse_floods, stream_config,
};
pub use gate::{Gate, GateSimulation};
pub use histograms::Histograms;
pub use lanes::LaneSimulation;
pub use late_cycle::late_cycle;
pub use timed::{ClosedFormCoverage, Doubt, Runner, Timed};
pub use traits::{Engine, EngineWork, Expose, ExposureResult, LitPixel, PulsedPixel, Replay};
pub use window::Window;

use error::{follows, has_a_line_a_spad};
