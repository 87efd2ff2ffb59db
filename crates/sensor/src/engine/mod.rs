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
//! plain-Rust reference model ([`crate::chip::macropixel::Model`]) is the tests' slow judge of all of them. `Window`
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
mod own_clk;
pub mod readout;
mod timed;
pub mod waveform;
mod window;

pub use cancelling::{Cancelling, cancelled};
pub use cohort::{Cohort, CohortOptions, variance_left_out};
pub use cycle::{Cycle, PackedPulses, Unlevelled};
pub use error::{EngineError, NotModelled};
pub use exposing::{
    Answer, Exposed, LitPixel, Work, expose, expose_without_skipping, full_stream, stream_config,
};
pub use gate::{Gate, GateSimulation};
pub use histograms::Histograms;
pub use lanes::LaneSimulation;
pub use late_cycle::late_cycle;
pub use timed::{ClosedFormCoverage, Doubt, Runner, Timed};
pub use window::Window;

use std::borrow::Cow;

use crate::chip::WindowLaw;
use crate::photon::{PhotonStream, SpadEvent};
use error::{follows, has_a_line_a_spad};
use own_clk::by_own_clk;

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

/// A macropixel and the pulses of its SPADs.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct PulsedPixel<'p> {
    /// Its number in the array, row-major: its delays may be its own.
    pub number: u32,
    /// The start value in its P-counter.
    pub start: u16,
    /// Rising edges of SPAD_RAW, sorted by time from the first STOP edge and thinned by the dead time.
    pub pulses: &'p [SpadEvent],
}

impl<'p> PulsedPixel<'p> {
    /// The first macropixels of an array, in its order.
    pub fn array(starts: &[u16], pulses: &[&'p [SpadEvent]]) -> Vec<Self> {
        debug_assert_eq!(starts.len(), pulses.len());
        let pixels = (0..).zip(starts).zip(pulses);
        pixels
            .map(|((number, &start), &pulses)| PulsedPixel {
                number,
                start,
                pulses,
            })
            .collect()
    }
}

/// Engines that run recorded pulses: pulses in, histograms out.
pub trait Replay: Engine {
    /// Counts of every macropixel and bin, bin 0 earliest. An engine that gains by it runs [`Engine::batch`] of them
    /// together; the results are the same.
    ///
    /// # Errors
    /// When this engine cannot tell what the circuit does, of the first macropixel concerned.
    fn replay(&self, pixels: &[PulsedPixel<'_>]) -> Result<Histograms, EngineError>;

    /// The pulses of macropixel `number` where [`Engine::law`] must see them to take them at the CLK edges at which that
    /// macropixel does: elsewhere only if CLK comes late to it, or its delays are not the library's.
    fn as_the_law_sees<'p>(&self, number: u32, pulses: &'p [SpadEvent]) -> Cow<'p, [SpadEvent]> {
        by_own_clk(self.law().sensor(), number, pulses)
    }

    /// Counts of every bin of the array's first macropixel. See [`PulsedPixel`] for start value and pulses.
    ///
    /// # Errors
    /// As [`Replay::replay`].
    fn histogram(&self, start: u16, pulses: &[SpadEvent]) -> Result<Vec<u16>, EngineError> {
        let counts = self.replay(&PulsedPixel::array(&[start], &[pulses]))?;
        Ok(counts.into_counts())
    }

    /// Histograms of the array's first macropixels, each with its start value and pulses.
    ///
    /// # Errors
    /// As [`Replay::replay`].
    fn histograms(
        &self,
        starts: &[u16],
        pulses: &[&[SpadEvent]],
    ) -> Result<Histograms, EngineError> {
        self.replay(&PulsedPixel::array(starts, pulses))
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
