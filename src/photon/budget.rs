//! The photon budget: how many photons a macropixel detects per laser pulse and per second.
//!
//! Thesis 3.2.1, Equations 6 to 16: the laser illuminates exactly the field of view (rectangular
//! spot), the target is Lambertian and fills the pixel, the lens collects the share
//! sin²α = d²/(4z² + d²) of what the target sends back. Equations 15 and 16 drop the d² in that
//! denominator; here it stays, so that the budget is right at any range. As in the thesis the
//! angle of incidence plays no part.
//!
//! The printed derivation divides by π when it turns the target's exitance into a radiance
//! (Eq. 9) and then multiplies by sin²α (Eq. 12). Integrating a Lambertian radiance over the lens
//! gives π·sin²α, so radiometry wants no division at all. [`Convention`] offers both; the figures
//! of the thesis (1140 z⁻² photons, 20 Mcounts/s) need the printed form.

use std::f64::consts::PI;

use crate::units::{PLANCK_J_S, SPEED_OF_LIGHT_M_PER_S};

/// How a target's exitance becomes power on the pixel.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, serde::Deserialize)]
#[serde(rename_all = "lowercase")]
pub enum Convention {
    /// As printed in Equations 9 to 16, with the factor 1/π.
    #[default]
    Thesis,
    /// Lambertian radiometry: π times the thesis's figures, for signal and background alike.
    Lambertian,
}

impl Convention {
    fn factor(self) -> f64 {
        match self {
            Convention::Thesis => 1.0 / PI,
            Convention::Lambertian => 1.0,
        }
    }
}

/// Everything Equations 15 and 16 need to know of sensor, lens, laser and sun.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct PhotonBudget {
    /// Photon detection efficiency, 0 to 1.
    pub pde: f64,
    /// Laser wavelength, nm.
    pub wavelength_nm: f64,
    /// Transmittance of lens and filter, 0 to 1 (τ_opt).
    pub transmittance: f64,
    /// Energy of one laser pulse over the whole field of view, J (E_tx).
    pub pulse_energy_j: f64,
    /// Diameter of the lens aperture, m.
    pub lens_diameter_m: f64,
    /// Focal length of the lens, m.
    pub lens_focal_m: f64,
    /// Pitch of a (square) macropixel, m; its square is A_pix.
    pub pixel_pitch_m: f64,
    /// Rows of the array.
    pub rows: u32,
    /// Columns of the array.
    pub cols: u32,
    /// Solar irradiance in the filter's band at 100 klux, W/m² (M_target,bg).
    pub solar_irradiance_w_m2: f64,
    /// Which constant of proportionality to use.
    pub convention: Convention,
}

impl PhotonBudget {
    /// Detected signal photons of one macropixel per laser pulse (Eq. 15 with the exact lens share
    /// of Eq. 6), for a target of `reflectivity` (0 to 1) at `range_m` > 0.
    pub fn signal_per_pulse(&self, range_m: f64, reflectivity: f64) -> f64 {
        let pixel_energy_j = self.pulse_energy_j / (f64::from(self.rows) * f64::from(self.cols));
        self.counts_per_joule(reflectivity) * self.lens_share(range_m) * pixel_energy_j
    }

    /// Detected background photons of one macropixel per second (Eq. 16), for a target of
    /// `reflectivity` (0 to 1) under `illuminance_klux` of sunlight.
    ///
    /// Independent of the range: the far-field limit, in which the growing pixel footprint and
    /// the shrinking lens share cancel.
    pub fn background_hz(&self, reflectivity: f64, illuminance_klux: f64) -> f64 {
        let irradiance_w_m2 = self.solar_irradiance_w_m2 * illuminance_klux / 100.0;
        let pixel_angle_rad = self.pixel_pitch_m / self.lens_focal_m;
        let etendue_m2 = (pixel_angle_rad * self.lens_diameter_m / 2.0).powi(2);
        self.counts_per_joule(reflectivity) * irradiance_w_m2 * etendue_m2
    }

    /// sin²α of Eq. 6: the lens's share of what a target at `range_m` sends back.
    pub fn lens_share(&self, range_m: f64) -> f64 {
        let d2 = self.lens_diameter_m * self.lens_diameter_m;
        d2 / (4.0 * range_m * range_m + d2)
    }

    /// Detected photons per joule that falls on the target, before the lens's share.
    fn counts_per_joule(&self, reflectivity: f64) -> f64 {
        let photon_j = PLANCK_J_S * SPEED_OF_LIGHT_M_PER_S / (self.wavelength_nm * 1e-9);
        self.convention.factor() * self.pde * self.transmittance * reflectivity / photon_j
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// The long-range system of Table 6.
    fn table_6() -> PhotonBudget {
        PhotonBudget {
            pde: 0.22,
            wavelength_nm: 905.0,
            transmittance: 1.0,
            pulse_energy_j: 50e-6,
            lens_diameter_m: 6e-3,
            lens_focal_m: 6e-3 * 2.2,
            pixel_pitch_m: 30e-6,
            rows: 63,
            cols: 200,
            solar_irradiance_w_m2: 13.808,
            convention: Convention::Thesis,
        }
    }

    #[test]
    fn table_6_gives_1140_over_z_squared() {
        let z_m = 200.0;
        let coefficient = table_6().signal_per_pulse(z_m, 0.1) * z_m * z_m;
        assert!((coefficient - 1139.4).abs() < 0.1, "{coefficient}");
    }

    #[test]
    fn table_6_gives_20_million_background_counts() {
        let hz = table_6().background_hz(0.1, 100.0);
        assert!((hz - 20e6).abs() < 0.5e6, "{hz}");
    }

    #[test]
    fn lambertian_is_pi_times_the_thesis() {
        let thesis = table_6();
        let lambertian = PhotonBudget {
            convention: Convention::Lambertian,
            ..thesis
        };
        let signal = lambertian.signal_per_pulse(50.0, 0.3) / thesis.signal_per_pulse(50.0, 0.3);
        let background = lambertian.background_hz(0.3, 40.0) / thesis.background_hz(0.3, 40.0);
        assert!((signal - PI).abs() < 1e-12 && (background - PI).abs() < 1e-12);
    }

    #[test]
    fn the_lens_cannot_collect_more_than_everything() {
        let budget = table_6();
        assert!(budget.lens_share(1e-9) <= 1.0);
        let z_m = 1e-3;
        let far_field = budget.lens_diameter_m.powi(2) / (4.0 * z_m * z_m);
        assert!(budget.lens_share(z_m) < far_field);
    }

    #[test]
    fn background_is_linear_in_illuminance() {
        let budget = table_6();
        let full = budget.background_hz(0.1, 100.0);
        assert!((budget.background_hz(0.1, 60.0) / full - 0.6).abs() < 1e-12);
        assert_eq!(budget.background_hz(0.1, 0.0), 0.0);
    }
}
