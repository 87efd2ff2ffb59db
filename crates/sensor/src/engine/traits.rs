//! What an engine is: the traits that all implement, what they are given and what they give.

use std::borrow::Cow;
use std::ops::AddAssign;

use serde::Serialize;

use super::{EngineError, Histograms};
use crate::chip::{Sensor, WindowLaw};
use crate::photon::{PhotonStream, PixelLight, SpadEvent};
use crate::units::Time;

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
pub struct ExposureResult {
    /// Counts of every macropixel and bin.
    pub histograms: Histograms,
    /// What was simulated.
    pub work: EngineWork,
}

impl ExposureResult {
    /// Of no macropixel.
    pub(crate) fn new(bins: usize) -> Self {
        ExposureResult {
            histograms: Histograms::new(bins),
            work: EngineWork::default(),
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
    fn expose(
        &self,
        stream: &PhotonStream,
        pixels: &[LitPixel],
    ) -> Result<ExposureResult, EngineError>;
}

// A macropixel's pulses by its own CLK.
//
// ```text
//   CLK of column 0  ▔▔▁▁▔▔▁▁▔▔▁▁        what a macropixel does is the same at another time: the engines run all of them by
//   CLK of column c  ▔▔▔▁▁▔▔▁▁▔▔▁        column 0's CLK, and pulses come earlier instead
//                      └ Sensor::clk_skew(c)
// ```

/// The pulses of macropixel `number` as one sees them to whose column CLK comes as to the first.
pub(super) fn by_own_clk<'p>(
    sensor: &Sensor,
    number: u32,
    pulses: &'p [SpadEvent],
) -> Cow<'p, [SpadEvent]> {
    let skew = sensor.clk_skew(number as usize % sensor.cols);
    if skew == Time::ZERO {
        return Cow::Borrowed(pulses);
    }
    let earlier = pulses.iter().map(|pulse| SpadEvent {
        time: pulse.time - skew,
        ..*pulse
    });
    earlier.collect()
}

/// What an engine did, and what it had no need to do. Sums over macropixels.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq, Serialize)]
pub struct EngineWork {
    /// Macropixels asked for.
    pub macropixels: u64,
    /// Those not simulated because their SPADs are switched off.
    pub skipped_dark: u64,
    /// Those not simulated because their window never opens.
    pub skipped_closed: u64,
    /// Photons and dark counts of the exposure that were drawn; those that several windows look back on, for each of them.
    pub photons_drawn: u64,
    /// SPAD pulses that the engine looked at.
    pub pulses: u64,
    /// Drawn photons that would have been such pulses, had they not met a blind SPAD.
    pub lost_to_dead_time: u64,
    /// Those pulses in time windows that cancel in their SPAD's flip-flop, two at a time ([`Cancelling`](super::Cancelling)).
    pub cancelled: u64,
    /// CLK periods of the exposure, over all macropixels.
    pub clk_periods: u64,
    /// Those that were simulated, one by one or because a photon fell into them.
    pub clk_periods_visited: u64,
}

impl AddAssign for EngineWork {
    fn add_assign(&mut self, other: Self) {
        self.macropixels += other.macropixels;
        self.skipped_dark += other.skipped_dark;
        self.skipped_closed += other.skipped_closed;
        self.photons_drawn += other.photons_drawn;
        self.pulses += other.pulses;
        self.lost_to_dead_time += other.lost_to_dead_time;
        self.cancelled += other.cancelled;
        self.clk_periods += other.clk_periods;
        self.clk_periods_visited += other.clk_periods_visited;
    }
}
