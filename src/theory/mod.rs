//! Chapter 3 of the thesis: how often the echo is found, and how precisely.

mod counts;
mod cycles;
pub mod detection;
mod gaussian;

pub use counts::{Counts, Tails};
