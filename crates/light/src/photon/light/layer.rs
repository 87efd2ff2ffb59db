//! Layers: light as a sum of parts that are drawn independently.

use std::ops::Range;
use std::sync::Arc;

use super::echo::{Echo, PulseTrain};
use super::profile::Profile;

/// A part of light that is drawn by itself: constant background and an echo in some laser cycles, of which only some
/// photons are kept.
pub(crate) struct Layer<'a> {
    pub cycles: Range<u32>,
    /// Photons are drawn at this rate.
    pub background_hz: f64,
    pub signal_per_cycle: f64,
    pub echo: Option<&'a Echo>,
    /// Its signal is that of another laser's pulses, and not of each laser cycle.
    pub train: Option<&'a PulseTrain>,
    /// A background photon is kept with the rate at its time relative to the greatest one.
    pub profile: Option<&'a Arc<Profile>>,
    /// And any photon with that of its SPAD.
    pub by_spad: Option<&'a Arc<[f64]>>,
}

impl<'a> Layer<'a> {
    /// Constant background, in all laser cycles.
    pub(crate) fn constant(background_hz: f64) -> Self {
        Layer {
            cycles: 0..u32::MAX,
            background_hz,
            signal_per_cycle: 0.0,
            echo: None,
            train: None,
            profile: None,
            by_spad: None,
        }
    }

    pub(crate) fn of_echo(echo: &'a Echo) -> Self {
        Layer {
            signal_per_cycle: echo.photons,
            echo: Some(echo),
            ..Self::constant(0.0)
        }
    }

    pub(crate) fn of_train(train: &'a PulseTrain) -> Self {
        Layer {
            signal_per_cycle: train.photons,
            train: Some(train),
            ..Self::constant(0.0)
        }
    }
}
