//! What an engine is: the traits that all implement, what they are given and what they give.

use std::borrow::Cow;

use super::own_clk::by_own_clk;
use super::{EngineError, Histograms, Work};
use crate::chip::{Sensor, WindowLaw};
use crate::photon::{PhotonStream, PixelLight, SpadEvent};

/// What every engine tells of itself. What it runs is in [`Replay`] and [`Expose`].
pub trait Engine: Sync {
    /// The window law of its sensor and exposure.
    fn law(&self) -> WindowLaw;

    /// Bins of a macropixel.
    fn bins(&self) -> usize {
        self.law().sensor().bins
    }

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

    /// The pulses of each of these macropixels as one sees them to whose column CLK comes as to the first.
    pub(super) fn all_by_own_clk(pixels: &[Self], sensor: &Sensor) -> Vec<Cow<'p, [SpadEvent]>> {
        let seen = |pixel: &Self| by_own_clk(sensor, pixel.number, pixel.pulses);
        pixels.iter().map(seen).collect()
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

/// A macropixel and the light on it.
#[derive(Debug, Clone, PartialEq)]
pub struct LitPixel {
    /// Its number in the array, row-major: the key of its photons.
    pub number: u32,
    /// The start value in its P-counter.
    pub start: u16,
    /// What shines on it; `None` where its SPADs are switched off, as they are without a guide.
    pub light: Option<PixelLight>,
}

/// Histograms, and what they took.
#[derive(Debug, Clone, PartialEq)]
pub struct Exposed {
    /// Counts of every macropixel and bin.
    pub histograms: Histograms,
    /// What was simulated.
    pub work: Work,
}

impl Exposed {
    /// Of no macropixel.
    pub(crate) fn new(bins: usize) -> Self {
        Exposed {
            histograms: Histograms::new(bins),
            work: Work::default(),
        }
    }
}

/// Engines that expose macropixels to light: light in, histograms out.
pub trait Expose: Engine {
    /// Histograms of macropixels in the light of `stream`, in the order of `pixels`. For the same stream they are
    /// those of [`full_stream`](super::full_stream), which draws every photon; an engine that needs fewer may leave the others out, and
    /// [`Cohort`](super::Cohort) gives others of the same distribution.
    ///
    /// # Errors
    /// When this engine cannot tell what the circuit does in this light.
    fn expose(&self, stream: &PhotonStream, pixels: &[LitPixel]) -> Result<Exposed, EngineError>;
}
