//! Echoes: what surfaces send back of every laser pulse.

use super::error::is_amount;
use crate::photon::pulse::PulseShape;
use crate::units::Time;

/// The echo of one surface: the photons it sends back of every laser pulse.
#[derive(Debug, Clone, PartialEq)]
pub struct Echo {
    /// Mean number of detected photons per laser cycle, finite and ≥ 0.
    pub photons: f64,
    /// Centre of the echo (of a Gaussian pulse) after the start of its cycle.
    pub arrival: Time,
    /// Standard deviation of a photon's time, with all jitter; `None` for that of the stream.
    pub sigma: Option<Time>,
    /// A measured pulse, whose times add to those of the Gaussian; `None` for that of the stream, if it has one.
    pub shape: Option<PulseShape>,
}

impl Echo {
    /// An echo as wide as the laser pulse.
    pub const fn new(photons: f64, arrival: Time) -> Self {
        debug_assert!(is_amount(photons), "photons are finite and not negative");
        Echo {
            photons,
            arrival,
            sigma: None,
            shape: None,
        }
    }

    /// The same, with photons spread by this standard deviation in all.
    pub const fn with_sigma(mut self, sigma: Time) -> Self {
        self.sigma = Some(sigma);
        self
    }

    /// The same, with this pulse instead of the stream's.
    pub fn with_shape(self, shape: PulseShape) -> Self {
        Echo {
            shape: Some(shape),
            ..self
        }
    }
}
