//! Why there is no frame.

use super::settings::EngineKind;
use crate::engine::EngineError;
use crate::files::InputError;
use crate::guide::GuideError;
use crate::ranging::UnequalBins;

/// Why there is no frame.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum FrameError {
    /// Something the user gave cannot be.
    #[error(transparent)]
    Input(#[from] InputError),
    /// The engine cannot run this configuration.
    #[error(transparent)]
    Engine(#[from] EngineError),
    /// The guide has no map.
    #[error(transparent)]
    Guide(#[from] GuideError),
    /// Depths cannot be found in such histograms.
    #[error(transparent)]
    Ranging(#[from] UnequalBins),
    /// The cohort engine cannot take all macropixels of a frame.
    #[error("{why}; this is so for {refused} of {pixels} macropixels")]
    Refused {
        /// The refusal of the first of them.
        why: EngineError,
        /// Macropixels that the engine refuses.
        refused: usize,
        /// Macropixels of the frame.
        pixels: usize,
    },
    /// The load path left other start values in the array than were sent.
    #[error(
        "the load path netlist left {found:?} in macropixel ({row}, {col}) where {sent} was sent"
    )]
    Load {
        /// Row in the array.
        row: usize,
        /// Column in the array.
        col: usize,
        /// Start value sent.
        sent: u16,
        /// Start value found, if known.
        found: Option<u16>,
    },
    /// A probed macropixel counts differently at gate level.
    #[error(
        "macropixel ({row}, {col}) counts {gate:?} at gate level and {model:?} on the {engine:?} engine"
    )]
    Disagreement {
        /// Row in the array.
        row: usize,
        /// Column in the array.
        col: usize,
        /// Engine of the frame.
        engine: EngineKind,
        /// Counts at gate level.
        gate: Vec<u16>,
        /// Counts of the engine.
        model: Vec<u16>,
    },
}
