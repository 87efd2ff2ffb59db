//! What the laser cycles of macropixels are made of, kept for exposures that differ in their seed alone.
//!
//! ```text
//!   start value, light ─► classes of laser cycles, each with its way of drawing ─┐    kept
//!                                                                       seed ────┴─► histogram
//! ```
//!
//! A guide with another seed gives most macropixels start values that they have had, and drawing is a small part of the work.

use std::sync::atomic::{AtomicUsize, Ordering};
use std::sync::{Arc, Mutex, PoisonError};

use smallvec::SmallVec;

use super::cycles::LikeCycles;
use super::{Cohort, StateMethod};
use crate::engine::EngineError;
use crate::photon::{PixelLight, StreamConfig};

/// Start values of a macropixel that are kept.
const MOST_STARTS: usize = 8;

/// Bytes of histories that are kept in all: those of 64×64 macropixels with four start values take 30 to 50 MB, but 0.5 GB in much light.
const MOST_BYTES: usize = 64 << 20;

/// Laser cycles alike, and how their events are drawn.
pub(super) struct LikeCyclesMethod {
    pub(super) like: LikeCycles,
    pub(super) way: StateMethod,
}

/// What a window's laser cycles are made of; `None` where it does not open.
pub(super) type WindowCycles = Option<Vec<LikeCyclesMethod>>;

struct Entry {
    start: u16,
    light: PixelLight,
    prepared: Arc<WindowCycles>,
}

/// What was prepared of each macropixel in exposures of one [`StreamConfig`] but for the seed.
pub(super) struct KeptCohorts {
    config: StreamConfig,
    bytes: AtomicUsize,
    of_pixels: Vec<Mutex<SmallVec<[Entry; 1]>>>,
}

impl KeptCohorts {
    pub(super) fn new(config: &StreamConfig, pixels: usize) -> Self {
        KeptCohorts {
            config: config.clone(),
            bytes: AtomicUsize::new(0),
            of_pixels: (0..pixels).map(|_| Mutex::default()).collect(),
        }
    }

    /// Whether exposures of this stream differ in nothing but their seed from those that this is of.
    pub(super) fn is_of(&self, config: &StreamConfig) -> bool {
        let seed = self.config.seed;
        StreamConfig {
            seed,
            ..config.clone()
        } == self.config
    }

    /// What `engine` prepares for a macropixel, which it has if it was asked for before.
    ///
    /// # Errors
    /// As [`Cohort::draw`].
    pub(super) fn prepared(
        &self,
        engine: &Cohort,
        pixel: u32,
        start: u16,
        light: &PixelLight,
    ) -> Result<Arc<WindowCycles>, EngineError> {
        let of_pixel = &self.of_pixels[pixel as usize];
        let lock = || of_pixel.lock().unwrap_or_else(PoisonError::into_inner);
        let is_its = |entry: &&Entry| entry.start == start && entry.light == *light;
        if let Some(entry) = lock().iter().find(is_its) {
            return Ok(Arc::clone(&entry.prepared));
        }
        let prepared = Arc::new(engine.prepared(&self.config, start, light)?);
        let bytes = prepared.iter().flatten().map(LikeCyclesMethod::bytes).sum();
        let mut entries = lock();
        if entries.len() < MOST_STARTS
            && self.bytes.fetch_add(bytes, Ordering::Relaxed) < MOST_BYTES
        {
            entries.push(Entry {
                start,
                light: light.clone(),
                prepared: Arc::clone(&prepared),
            });
        }
        Ok(prepared)
    }
}

impl LikeCyclesMethod {
    /// About as much memory as it takes.
    fn bytes(&self) -> usize {
        let of_way = match &self.way {
            StateMethod::Recent(histories) => histories.number() * size_of::<f64>(),
            StateMethod::Pooled | StateMethod::Joint => 0,
        };
        size_of::<Self>() + of_way
    }
}

#[cfg(test)]
mod tests {
    use super::super::CohortOptions;
    use crate::chip::{Exposure, SensorConfig};
    use crate::engine::{Cohort, Expose, LitPixel, stream_config};
    use crate::photon::{Echo, PhotonStream, PixelLight};
    use crate::units::Time;
    use proptest::prelude::*;

    proptest! {
        #![proptest_config(ProptestConfig { cases: 24, ..ProptestConfig::default() })]

        /// In any order of seeds, start values and lights, and for streams that are not the first one's, histograms are those of an engine that
        /// keeps nothing.
        #[test]
        fn what_is_kept_changes_no_histogram(
            asked in prop::collection::vec(
                (0u32..3, 20u16..24, (0usize..3, 0usize..3), 1u64..4, prop::bool::weighted(0.1)),
                5..40,
            ),
        ) {
            let sensor = SensorConfig { rows: 1, cols: 3, ..SensorConfig::default() };
            let exposure = Exposure::new(&sensor, 520, 100);
            let options = CohortOptions::default();
            let keeping = Cohort::new(&sensor, &exposure, options).keeping();
            let plain = Cohort::new(&sensor, &exposure, options);
            for (number, start, (background, signal), seed, is_wider) in asked {
                let arrival = Time::from_ns(60);
                let light = PixelLight::background([1e6, 5e6, 5e7][background])
                    .with_echo(Echo::new([0.1, 1.0, 20.0][signal], arrival));
                let sigma = Time::from_ps(if is_wider { 2_500 } else { 1_900 });
                let stream = PhotonStream::new(&stream_config(&sensor, &exposure, seed, sigma));
                let pixel = LitPixel { number, start, light: Some(light) };
                let [kept, anew] = [&keeping, &plain].map(|engine| {
                    let exposed = engine.expose(&stream, std::slice::from_ref(&pixel));
                    exposed.map(|exposed| exposed.histograms.into_counts())
                });
                prop_assert_eq!(kept, anew);
            }
        }
    }
}
