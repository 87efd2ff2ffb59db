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
//! The first three take the same start value and SPAD pulses and give the same histogram. `Cycle` and `Window` assume what
//! the window law can promise, and refuse a configuration in which two signals race. The macropixel's
//! plain-Rust reference model ([`crate::chip::macropixel::Model`]) is the tests' slow judge of all of them. `Window`
//! also refuses a P-counter that raises LOCAL_STOP more than once in a laser cycle.

mod cancelling;
pub mod cohort;
mod cycle;
mod exposing;
mod gate;
mod histograms;
mod lanes;
pub mod load;
mod timed;
pub mod waveform;
mod window;

pub use cancelling::Cancelling;
pub use cohort::{Cohort, CohortOptions};
pub use cycle::{Cycle, PackedPulses, Unlevelled};
pub use exposing::{
    Exposed, LitPixel, Work, expose, expose_without_skipping, full_stream, stream_config,
};
pub use gate::{Gate, GateSimulation};
pub use histograms::Histograms;
pub use lanes::LaneSimulation;
pub use timed::{ClosedFormCoverage, Runner, Timed, TimedHistograms};
pub use window::Window;

use crate::chip::front_end::PulseLimits;
use crate::chip::{Race, SensorConfig, WindowLaw};
use crate::photon::{PhotonStream, SpadEvent};

const _: () = assert!(crate::chip::SPADS == crate::photon::SPADS);

/// What every engine tells of itself. What it runs is in [`Replay`] and [`Expose`].
pub trait Engine: Sync {
    /// The window law of its sensor and exposure.
    fn law(&self) -> WindowLaw;

    /// Bins of a macropixel.
    fn bins(&self) -> usize;

    /// How many macropixels are best given to this engine at once.
    fn batch(&self) -> usize {
        crate::kernel::LANES
    }
}

/// Engines that run recorded pulses: pulses in, histograms out.
pub trait Replay: Engine {
    /// Counts of every bin, bin 0 earliest, for a start value and the rising edges of SPAD_RAW, sorted by
    /// time from the first STOP edge and thinned by the dead time.
    ///
    /// # Errors
    /// When this engine cannot tell what the circuit does.
    fn histogram(&self, start: u16, pulses: &[SpadEvent]) -> Result<Vec<u16>, EngineError>;

    /// Histograms of several macropixels, each with its start value and pulses. An engine that gains by
    /// it runs [`Engine::batch`] of them together; the results are the same.
    ///
    /// # Errors
    /// As [`Replay::histogram`], of the first macropixel concerned.
    fn histograms(
        &self,
        starts: &[u16],
        pulses: &[&[SpadEvent]],
    ) -> Result<Histograms, EngineError> {
        let mut histograms = Histograms::new(self.bins());
        for (&start, pulses) in starts.iter().zip(pulses) {
            histograms.push(&self.histogram(start, pulses)?);
        }
        Ok(histograms)
    }
}

/// Engines that expose macropixels to light: light in, histograms out.
pub trait Expose: Engine {
    /// Histograms of macropixels in the light of `stream`, in the order of `pixels`. For the same stream they are
    /// those of [`full_stream`], which draws every photon; an engine that needs fewer may leave the others out, and
    /// [`Cohort`] gives others of the same distribution.
    ///
    /// # Errors
    /// When this engine cannot tell what the circuit does in this light.
    fn expose(&self, stream: &PhotonStream, pixels: &[LitPixel]) -> Result<Exposed, EngineError>;
}

/// Whether the front end, with these limits, follows the pulses of this sensor's SPADs.
fn follows(config: &SensorConfig, limits: &PulseLimits) -> Result<(), EngineError> {
    let complaint = limits.complaint(config.dead_time_ns);
    complaint.map_or(Ok(()), |complaint| Err(EngineError::FrontEnd(complaint)))
}

/// Why an engine has no answer.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
pub enum EngineError {
    /// The window law finds two signals too close to call.
    #[error("{0}, so only the gate engine can tell what is counted; use --engine gate, or {cure}", cure = .0.cure)]
    Race(Race),
    /// The window law has no single window for this start value.
    #[error("{0}, so the window engine cannot tell what is counted; use --engine cycle or gate")]
    Irregular(&'static str),
    /// Pulses are shorter, or follow each other faster, than the front end's flip-flops.
    #[error("{0}")]
    FrontEnd(String),
    /// The cohort engine works without photons.
    #[error(
        "the cohort engine knows no single photons and cannot replay recorded ones; use --engine window"
    )]
    NoPhotons,
    /// The cohort engine's model of light and SPADs leaves this out.
    #[error("the cohort engine cannot follow {0}; use --engine window")]
    NotInCohorts(&'static str),
    /// Laser cycles depend on each other: a bound on the probability, over a macropixel's exposure.
    #[error(
        "SPADs may stay busy from one laser cycle's window to the next (probability up to {bound:.1e}), which the cohort engine cannot follow; use --engine window, a longer laser cycle or less light"
    )]
    CyclesNotIndependent {
        /// The bound.
        bound: f64,
    },
    /// The finest cells of the cohort engine do not keep its error.
    #[error(
        "the cohort engine, with {cells} cells to a CLK period, may put the mean of bin {bin} off by {off:.2e} counts where its counting noise is {noise:.2e}; use --engine window, or --sub-bins with less exactness"
    )]
    CoarseCohorts {
        /// First bin concerned.
        bin: usize,
        /// What its mean may be off, counts.
        off: f64,
        /// Standard deviation of its count.
        noise: f64,
        /// Cells of a CLK period at least.
        cells: u32,
    },
    /// Background light blinds SPADs more than half of the time, and there are too many such photons to follow.
    #[error(
        "background light of {:.1} Mcounts/s a SPAD keeps it blind for {:.0} % of the time, and the exposure has {photons:.1e} such photons, of which {most_photons:.0e} are simulated; give less than {:.1} Mcounts/s (less light, a smaller or darker lens, a narrower filter, a shorter dead time), or fewer macropixels or laser cycles",
        background_hz / 1e6,
        100.0 * background_hz / (background_hz + most_hz),
        most_hz / 1e6,
    )]
    Blinding {
        /// Background photons and dark counts of a SPAD, 1/s, where there are most.
        background_hz: f64,
        /// From that rate on a SPAD is blind more than half of the time, 1/s.
        most_hz: f64,
        /// Photons of all macropixels in such light in the exposure.
        photons: f64,
        /// As many are simulated.
        most_photons: f64,
    },
    /// A histogram bin of the netlist holds X.
    #[error("bin {bin} of {macropixel} is unknown (X) at the end of the exposure")]
    Unknown {
        /// Name of the macropixel, or its lane.
        macropixel: String,
        /// First unknown bin.
        bin: usize,
    },
}

impl EngineError {
    /// Whether the user asked for what this engine cannot do, and another can.
    pub fn is_refusal(&self) -> bool {
        !matches!(self, EngineError::Unknown { .. })
    }
}
