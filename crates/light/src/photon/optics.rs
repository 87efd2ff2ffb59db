//! What stands between the SPADs and the scene: lens, band-pass filter, the laser's drift, the air.
//!
//! Lens: thesis 2.3.2, Eq. 3. Filter and drift: 2.3.3 and Fig. 20. A laser (a VCSEL: 0.08 nm/°C, ±10 nm from
//! one piece to the next) wanders over 30 nm between −40 °C and 105 °C (the minus sign is lost in
//! print), and the filter has to let it through without letting in the sun.

use std::f64::consts::{LN_2, PI};

use crate::numerics::normal_above;

/// A lens.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Lens {
    /// Diameter of the aperture, m (D, d_lens).
    pub diameter_m: f64,
    /// Focal length over diameter (f#).
    pub f_number: f64,
}

impl Lens {
    /// Focal length, m (Eq. 3).
    pub(crate) fn focal_m(&self) -> f64 {
        self.f_number * self.diameter_m
    }
}

/// Transmission of a filter against wavelength; all are 1 at the centre.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash)]
#[non_exhaustive]
pub enum FilterShape {
    /// 1 inside the band, 0 outside.
    TopHat,
    /// A Gaussian.
    Gaussian,
    /// One period of a raised cosine, 0 beyond one FWHM from the centre.
    Cosine,
    /// One resonance of a Fabry-Pérot cavity, with its long wings.
    Lorentz,
}

impl FilterShape {
    /// Every shape.
    pub const ALL: [FilterShape; 4] = [
        FilterShape::TopHat,
        FilterShape::Gaussian,
        FilterShape::Cosine,
        FilterShape::Lorentz,
    ];
}

/// A band-pass filter of peak transmission 1; losses belong to the budget's transmittance.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Filter {
    /// Centre of the band, nm.
    pub centre_nm: f64,
    /// Full width at half maximum, nm, > 0.
    pub fwhm_nm: f64,
    /// Shape of the band.
    pub shape: FilterShape,
}

impl Filter {
    /// A filter of the given centre, width (> 0) and shape.
    pub fn new(centre_nm: f64, fwhm_nm: f64, shape: FilterShape) -> Self {
        debug_assert!(fwhm_nm > 0.0, "{fwhm_nm}");
        Filter {
            centre_nm,
            fwhm_nm,
            shape,
        }
    }

    /// Transmission at `wavelength_nm`, 0 to 1.
    pub fn transmission(&self, wavelength_nm: f64) -> f64 {
        // In half widths: every shape has fallen to 1/2 at x = 1.
        let x = 2.0 * (wavelength_nm - self.centre_nm).abs() / self.fwhm_nm;
        match self.shape {
            FilterShape::TopHat => f64::from(u8::from(x <= 1.0)),
            FilterShape::Gaussian => libm::exp(-LN_2 * x * x),
            FilterShape::Cosine if x < 2.0 => 0.5 + 0.5 * libm::cos(0.5 * PI * x),
            FilterShape::Cosine => 0.0,
            FilterShape::Lorentz => 1.0 / (1.0 + x * x),
        }
    }

    /// Share that passes of a Gaussian line of this width (full, at half maximum, > 0): the overlap of two Gaussians, or of a Gaussian and
    /// a top hat; `None` for shapes without such a closed form.
    pub fn transmission_of(&self, wavelength_nm: f64, line_fwhm_nm: f64) -> Option<f64> {
        let off_nm = wavelength_nm - self.centre_nm;
        match self.shape {
            FilterShape::Gaussian => {
                let fwhm_nm = libm::hypot(self.fwhm_nm, line_fwhm_nm);
                let joint = Filter { fwhm_nm, ..*self };
                Some(self.fwhm_nm / fwhm_nm * joint.transmission(wavelength_nm))
            }
            FilterShape::TopHat => {
                let sigma_nm = line_fwhm_nm / (8.0 * LN_2).sqrt();
                let above = |edge_nm: f64| normal_above((edge_nm - off_nm) / sigma_nm);
                Some(above(-0.5 * self.fwhm_nm) - above(0.5 * self.fwhm_nm))
            }
            FilterShape::Cosine | FilterShape::Lorentz => None,
        }
    }

    /// Wavelengths outside of which the transmission is nothing (below 10⁻³⁰), nm.
    pub fn passband_nm(&self) -> (f64, f64) {
        let half_widths = match self.shape {
            FilterShape::TopHat => 1.0,
            FilterShape::Gaussian => 10.0,
            FilterShape::Cosine => 2.0,
            FilterShape::Lorentz => f64::INFINITY,
        };
        let reach_nm = half_widths * self.fwhm_nm / 2.0;
        (self.centre_nm - reach_nm, self.centre_nm + reach_nm)
    }
}

/// A laser whose wavelength depends on temperature and on the piece at hand (2.3.3, Fig. 20).
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct LaserDrift {
    /// Wavelength of a typical piece at `reference_c`, nm.
    pub nominal_nm: f64,
    /// Temperature of the nominal wavelength, °C.
    pub reference_c: f64,
    /// Drift, nm/°C.
    pub nm_per_c: f64,
    /// How far a piece may lie from the typical one, nm.
    pub process_nm: f64,
}

impl LaserDrift {
    /// The VCSEL of Fig. 20: 0.08 nm/°C, ±10 nm, nominal at 25 °C.
    pub fn vcsel(nominal_nm: f64) -> Self {
        LaserDrift {
            nominal_nm,
            reference_c: 25.0,
            nm_per_c: 0.08,
            process_nm: 10.0,
        }
    }

    /// Wavelength at `temperature_c` of a piece `offset_nm` from the typical one, nm.
    pub fn wavelength_nm(&self, temperature_c: f64, offset_nm: f64) -> f64 {
        self.nominal_nm + offset_nm + self.nm_per_c * (temperature_c - self.reference_c)
    }
}

/// Air that takes light away as Beer and Lambert say: e^(−αz) over z metres.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub struct Atmosphere {
    /// Extinction coefficient α at the laser's wavelength, 1/m. Zero is vacuum.
    pub extinction_per_m: f64,
}

impl Atmosphere {
    /// Nothing in the way.
    pub const CLEAR: Atmosphere = Atmosphere {
        extinction_per_m: 0.0,
    };

    /// Air in which a black object can just be told from the sky (contrast 2 %, 550 nm) at `visibility_m`.
    ///
    /// α = 3.912/V · (λ/550 nm)^(−q), the law of Koschmieder and Kruse with Kim's exponents for haze
    /// and fog (Kim, McArthur and Korevaar, Proc. SPIE 4214, 2001); below 500 m q = 0.
    pub fn from_visibility(visibility_m: f64, wavelength_nm: f64) -> Self {
        let km = visibility_m * 1e-3;
        let exponent = match km {
            v if v > 50.0 => 1.6,
            v if v > 6.0 => 1.3,
            v if v > 1.0 => 0.16 * v + 0.34,
            v if v > 0.5 => v - 0.5,
            _ => 0.0,
        };
        let koschmieder = libm::log(1.0f64 / 0.02);
        Atmosphere {
            extinction_per_m: koschmieder / visibility_m
                * libm::pow(wavelength_nm / 550.0, -exponent),
        }
    }

    /// Share of the laser's light that survives the way to a target at `range_m` and back.
    pub fn round_trip(&self, range_m: f64) -> f64 {
        libm::exp(-2.0 * self.extinction_per_m * range_m)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_lens_of_table_6_sees_26_by_8_degrees() {
        let lens = Lens {
            diameter_m: 6e-3,
            f_number: 2.2,
        };
        assert!((lens.focal_m() - 13.2e-3).abs() < 1e-15);
        let angle_deg = |pixels: f64| {
            let half_m = 0.5 * pixels * 30e-6;
            2.0 * (half_m / lens.focal_m()).atan().to_degrees()
        };
        let (h, v) = (angle_deg(200.0), angle_deg(63.0));
        assert!((h - 26.0).abs() < 0.5 && (v - 8.0).abs() < 0.5, "{h} {v}");
    }

    #[test]
    fn every_shape_is_one_at_the_centre_and_half_at_its_width() {
        for shape in FilterShape::ALL {
            let filter = Filter::new(940.0, 8.0, shape);
            assert_eq!(filter.transmission(940.0), 1.0);
            let (inside, outside) = (filter.transmission(943.9999), filter.transmission(944.0001));
            assert!((0.5 * (inside + outside) - 0.5).abs() < 1e-4, "{shape:?}");
            let (from, to) = filter.passband_nm();
            assert!(
                filter.transmission(from - 1e-6) < 1e-29 && filter.transmission(to + 1e-6) < 1e-29
            );
        }
    }

    #[test]
    fn fog_leaves_two_percent_of_contrast_at_its_visibility() {
        for visibility_m in [50.0, 200.0, 499.0] {
            let fog = Atmosphere::from_visibility(visibility_m, 905.0);
            assert!((fog.round_trip(visibility_m / 2.0) - 0.02).abs() < 1e-12);
        }
        let haze = |nm| Atmosphere::from_visibility(10e3, nm).extinction_per_m;
        assert!(haze(905.0) < haze(550.0), "haze scatters the infrared less");
        assert_eq!(Atmosphere::CLEAR.round_trip(200.0), 1.0);
    }
}
