//! The chip against its theory: what the formulas of chapter 3 promise, measured on the modelled chip.
//!
//! ```text
//!   formulas (Eq. 17, 20, Cramér-Rao, 3.4) ────────────────────────┐
//!   trial: light ─► chip ─► thousands of histograms ─► P_D, spread ┴─► table: formula | chip ± | each effect absent
//! ```
//!
//! Seeds are fixed, so that a table is the same every time; the number of frames is the reader's choice.

pub mod detection;
pub mod partial;
pub mod penalty;
pub mod precision;
mod trial;

pub use trial::{Effect, Trial};

use crate::numerics::intervals::Estimate;
use crate::report::{Chart, Grid};

/// Frames behind each number, unless another count is wanted.
pub const FRAMES: usize = 300;

/// What a study found.
#[derive(Debug, Clone, Default)]
pub struct MeasuredStudy {
    /// How it was done.
    pub notes: Vec<String>,
    /// Tables, each with its title.
    pub grids: Vec<(&'static str, Grid)>,
    /// Pictures.
    pub charts: Vec<Chart>,
}

/// The ends of an interval.
fn interval_text(estimate: &Estimate, decimals: usize) -> String {
    let Estimate { low, high, .. } = estimate;
    format!("{low:.decimals$} to {high:.decimals$}")
}
