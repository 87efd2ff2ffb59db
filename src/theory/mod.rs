//! Chapter 3 of the thesis: how often the echo is found, and how precisely.

mod counts;
mod cycles;
pub mod detection;
pub mod estimators;
mod gaussian;
pub mod precision;
mod pulse;

pub use counts::{Counts, Tails};
pub use pulse::{LnBin, MeasuredPulse, Pulse, PulseError};
