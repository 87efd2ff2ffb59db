//! From histograms to time: finding the peak and interpolating it.

mod peak;

pub use peak::{Background, Peak, PeakOptions, interpolate};
