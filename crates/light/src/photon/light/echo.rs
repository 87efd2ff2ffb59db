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

// Pulses of another lidar's laser, which has a rate of its own.
//
// ```text
//   own pulses       │            │            │            │            laser cycles begin with them
//   the other's         ▂              ▂              ▂              ▂   later in each laser cycle by what its period is longer
// ```
//
// Two lasers of one rate meet at the same time of every laser cycle and make an echo that is none. *Dither*, a random wait before each
// pulse of either laser, spreads that echo over the time in which the other's pulse may come.

/// Mean photons of a pulse that are drawn, at most, where SPADs are ready again within it: as many as an oncoming lidar sends straight
/// into the lens.
pub(in crate::photon) const MOST_PER_PULSE: f64 = 1e5;

/// When another laser sends its pulses, beside our own.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct OtherLaser {
    /// Lasers of other numbers have other random phases and dithers.
    pub number: u32,
    /// Mean time between its pulses, above 0.
    pub period_s: f64,
    /// When it sends a pulse, as a share of its period after the exposure begins; drawn from the stream's seed if `None`.
    pub phase: Option<f64>,
    /// Each of its pulses is late by as much as that at most, all delays alike likely; below its period.
    pub dither_s: f64,
    /// We wait as long as that at most before each of our own pulses, all waits alike likely. Light that arrives meanwhile is lost.
    pub own_dither_s: f64,
}

/// What a macropixel detects of another laser.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct PulseTrain {
    /// The laser.
    pub laser: OtherLaser,
    /// Mean number of detected photons of each of its pulses, finite and ≥ 0.
    pub photons: f64,
    /// From its laser to here.
    pub delay: Time,
    /// Standard deviation of a photon's time.
    pub sigma: Time,
}
