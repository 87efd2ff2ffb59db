//! From histograms to time and depth: finding the peak, interpolating it, calibrating it.

mod arrival;
mod calibration;
mod peak;
pub mod tmf8820;

pub use arrival::{ArrivalOptions, arrival};
pub use calibration::{Calibration, CalibrationError, Echo, ZoneCalibration};
pub use peak::{Background, Peak, PeakOptions, interpolate};
