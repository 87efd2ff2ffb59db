//! The ways to run an exposure: from gates and delays to nothing but the window.
//!
//! | engine | what it simulates | held to |
//! |---|---|---|
//! | [`Gate`] | every net of the netlist, with its delays | Icarus Verilog on the exported netlist |
//! | [`Cycle`] | every CLK period, through the blocks' reference models | `Gate` |
//! | [`Window`] | only the CLK periods a start value can see, through the window law | `Cycle` |
//!
//! All take the same start value and SPAD pulses and give the same histogram. `Cycle` and `Window` assume what
//! the window law can promise, and refuse a configuration in which two signals race.

mod cycle;
mod gate;
mod lanes;
pub mod load;
pub mod recording;
mod stimulus;
mod testbench;
pub mod timing;
pub mod waveform;
mod window;

pub use cycle::Cycle;
pub use gate::{Gate, GateSimulation};
pub use lanes::LaneSimulation;
pub use stimulus::{LoadPins, Pins, Schedule, StimulusPlan};
pub use testbench::{export_annotated_verilog, export_verilog};
pub use window::Window;

use crate::photon::SpadEvent;

const _: () = assert!(crate::chip::SPADS == crate::photon::SPADS);

/// Runs one macropixel through an exposure.
pub trait Engine: Sync {
    /// Counts of every bin, bin 0 earliest, for a start value and the rising edges of SPAD_RAW, sorted by
    /// time from the first STOP edge and thinned by the dead time.
    ///
    /// # Errors
    /// When this engine cannot tell what the circuit does.
    fn histogram(&self, start: u16, pulses: &[SpadEvent]) -> Result<Vec<u16>, EngineError>;

    /// Histograms of several macropixels, each with its start value and pulses. An engine that gains by
    /// it runs [`BATCH`] of them together; the results are the same.
    ///
    /// # Errors
    /// As [`Engine::histogram`], of the first macropixel concerned.
    fn histograms(
        &self,
        starts: &[u16],
        pulses: &[&[SpadEvent]],
    ) -> Result<Vec<Vec<u16>>, EngineError> {
        let macropixels = starts.iter().zip(pulses);
        macropixels
            .map(|(&start, pulses)| self.histogram(start, pulses))
            .collect()
    }
}

/// How many macropixels are best given to [`Engine::histograms`] at once.
pub const BATCH: usize = crate::kernel::LANES;

/// Why an engine has no answer.
#[derive(Debug, Clone, PartialEq, Eq, thiserror::Error)]
pub enum EngineError {
    /// The window law finds two signals too close to call.
    #[error(
        "{0}, so only the gate engine can tell what is counted; use --engine gate or change clk_hz, stop_phase_ps or corner"
    )]
    Race(&'static str),
    /// A histogram bin of the netlist holds X.
    #[error("bin {bin} of {macropixel} is unknown (X) at the end of the exposure")]
    Unknown {
        /// Name of the macropixel, or its lane.
        macropixel: String,
        /// First unknown bin.
        bin: usize,
    },
}
