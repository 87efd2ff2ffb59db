//! From histograms to time and depth: finding the peak, judging and interpolating it, taking range walk out, calibrating.

mod arrival;
mod calibration;
mod counting;
mod detector;
mod expected;
mod finder;
mod likelihood;
mod peak;
mod place;
mod plain;
mod profile;
mod pulse;
mod returns;
mod spad_state;
mod spreads;
pub mod tmf8820;
mod walk;

pub use arrival::{ArrivalOptions, arrival};
pub use calibration::{Calibration, CalibrationError, ZoneCalibration, ZoneEcho};
pub use detector::{
    Agreement, BadDetector, Coincidence, CountedEvents, DescribedCoincidence, DetectedReturn,
    Detector, DetectorDescription, NoReturn, SurfaceLight, TooManyCounts, UnknownCrosstalk,
};
pub use expected::{EchoLight, Response};
pub use finder::{DepthOptions, EchoFinder, Sighting, UnequalBins};
pub use peak::{Background, CentreOfMass, Peak, PeakOptions, centre_of_mass, interpolate};
pub use profile::{BinProfile, LineProfile, OtherSensor};
pub use returns::{Others, WindowReturn};
pub use walk::{CorrectedPeak, WalkCorrection, WalkLeft};

#[cfg(test)]
mod tests;
