//! Chapter 3 of the thesis: how often the echo is found, how precisely, with how many bins, what follows for a
//! design, and when a peak is chance.

pub mod capacity;
mod counts;
pub mod cycles;
pub mod design;
pub mod detection;
pub mod estimators;
pub mod front_ends;
mod gaussian;
pub mod partial;
pub mod precision;
mod pulse;
pub mod significance;
pub mod spread_echo;

pub use counts::{Counts, Tails};
pub use pulse::{LnBin, MeasuredPulse, Pulse, PulseSamplesError};
