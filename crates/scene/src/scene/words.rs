//! Words that stand in a scene file where no curve has been measured.

use crate::photon::FilterShape;
use crate::settings::{Range, words};

words! {
    /// Laser pulses without a measurement.
    #[derive(Default)]
    #[non_exhaustive]
    pub enum PulseWord {
        /// A Gaussian of `pulse_fwhm_ns`.
        #[default]
        Gaussian = "gaussian",
    }
}

words! {
    /// Lenses without a measurement.
    #[derive(Default)]
    #[non_exhaustive]
    pub enum VignettingWord {
        /// None, as in the thesis.
        #[default]
        None = "none",
        /// That of a plain lens.
        Cos4 = "cos4",
    }
}

words! {
    /// Stray light without a measurement.
    #[derive(Default)]
    #[non_exhaustive]
    pub enum StrayWord {
        /// A halo of `stray_radius` that falls off with the cube of the distance.
        #[default]
        Halo = "halo",
    }
}

words! {
    /// Laser beams without a measurement.
    #[derive(Default)]
    #[non_exhaustive]
    pub enum BeamWord {
        /// The same energy for every macropixel (Eq. 7 and 8, [`Spot`](crate::photon::Spot)).
        #[default]
        Uniform = "uniform",
        /// A Gaussian of `beam_fwhm_deg`.
        Gaussian = "gaussian",
    }
}

words! {
    /// Filters without a measurement.
    #[derive(Default)]
    #[non_exhaustive]
    pub enum FilterWord {
        /// Any that lets `solar_irradiance_w_m2` through.
        #[default]
        Irradiance = "irradiance",
        /// A top hat.
        TopHat = "top_hat",
        /// A Gaussian.
        Gaussian = "gaussian",
        /// One period of a raised cosine.
        Cosine = "cosine",
        /// One resonance of a Fabry-Pérot cavity.
        Lorentz = "lorentz",
    }
}

impl FilterWord {
    /// The shape that it stands for; `None` where only the irradiance is known.
    pub(super) fn shape(self) -> Option<FilterShape> {
        match self {
            FilterWord::Irradiance => None,
            FilterWord::TopHat => Some(FilterShape::TopHat),
            FilterWord::Gaussian => Some(FilterShape::Gaussian),
            FilterWord::Cosine => Some(FilterShape::Cosine),
            FilterWord::Lorentz => Some(FilterShape::Lorentz),
        }
    }
}

words! {
    /// Detection efficiencies without a measurement.
    #[derive(Default)]
    #[non_exhaustive]
    pub enum PdeWord {
        /// The same at all wavelengths.
        #[default]
        Flat = "flat",
    }
}

/// Beyond a million metres the squares in the geometry lose the small lengths.
const FAR_M: f64 = 1e6;

pub(super) const CHOSEN: &str = "chosen for the street";
pub(super) const TABLE_12: &str = "thesis Table 12";
pub(super) const LENGTH: Range = Range::Above(0.0, FAR_M);
pub(super) const POSITION: Range = Range::Within(-FAR_M, FAR_M);
/// Lengths and places of scenes that a lidar may see, m; a file in millimetres has larger ones.
pub(super) const NEAR_M: (f64, f64) = (0.0, 1000.0);

/// Speeds of what moves on roads and in the air, m/s.
pub(super) const SPEEDS: (f64, f64) = (0.0, 300.0);

/// Widths of laser pulses at half maximum, ns.
pub(super) const FWHM_NS: (f64, f64) = (0.01, 500.0);

/// Random waits before laser pulses, ns.
pub(super) const DITHER_NS: (f64, f64) = (0.01, 1e5);

/// Energies of laser pulses, uJ: from chips that see some metres to large flash lidars.
pub(super) const ENERGY_UJ: (f64, f64) = (1e-3, 2e4);

pub(super) const SHARE: Range = Range::Within(0.0, 1.0);
pub(super) const SPEED: Range = Range::Within(-1e4, 1e4);
pub(super) const PLACES: Range = Range::Within(-FAR_M, FAR_M);
