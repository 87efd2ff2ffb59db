//! The photon budget: how many photons a macropixel detects per laser pulse and per second.
//!
//! Thesis 3.2.1, Equations 6 to 16. The laser lights exactly the field of view (or the circle around it), the target
//! is Lambertian and fills the pixel, the lens collects the share R = sin²α = d²/(4z² + d²) of what the target sends
//! back. The printed results, Eq. 12 and 13 and from them 15 and 16, drop the d² in that denominator. Here it stays;
//! the printed forms stand beside, under names ending in `_far_field`. The angle of incidence plays no part here, as
//! in the thesis; callers that know it pass its cosine times the reflectivity (`Scene::pixel_light`).
//!
//! The printed derivation divides by π when it turns the target's exitance into a radiance
//! (Eq. 9) and then multiplies by sin²α (Eq. 12). Integrating a Lambertian radiance over the lens
//! gives π·sin²α, so radiometry wants no division at all. [`Convention`] offers both: scenes have the latter unless
//! told otherwise, the figures of the thesis (1140 z⁻² photons, 20 Mcounts/s) need the printed form.
//!
//! Air that scatters takes light from the echo twice, on its way there and back. The background keeps its
//! brightness: what the air takes from the sunlit target it replaces by sunlight of its own.

use std::f64::consts::PI;

use super::optics::{Atmosphere, Filter, FilterShape, Lens};
use super::solar::{FULL_SUN_KLUX, band_irradiance};
use crate::settings::words;
use crate::units::{PLANCK_J_S, SPEED_OF_LIGHT_M_PER_S};

words! {
    /// How a target's exitance becomes power on the pixel.
    #[derive(Default)]
    #[non_exhaustive]
    pub enum Convention {
        /// As printed in Equations 9 to 16, with the factor 1/π.
        Thesis = "thesis",
        /// Lambertian radiometry: π times the thesis's figures, for signal and background alike.
        #[default]
        Lambertian = "lambertian",
    }
}

impl Convention {
    fn factor(self) -> f64 {
        match self {
            Convention::Thesis => 1.0 / PI,
            Convention::Lambertian => 1.0,
        }
    }
}

words! {
    /// What the laser lights up (Fig. 30).
    #[derive(Default)]
    #[non_exhaustive]
    pub enum Spot {
        /// The projected sensor area and nothing else (Eq. 7).
        #[default]
        Rectangle = "rectangle",
        /// The circle around it (Eq. 8), which wastes at least 1 − 2/π of the power.
        Round = "round",
    }
}

impl Spot {
    /// Share of the laser's power that falls on the area on the target of one pixel with this pitch in x and y, in any unit (Eq. 7
    /// and 8 times Eq. 11).
    pub fn share_per_pixel(self, rows: u32, cols: u32, [x, y]: [f64; 2]) -> f64 {
        let (rows, cols) = (f64::from(rows), f64::from(cols));
        match self {
            Spot::Rectangle => 1.0 / (rows * cols),
            Spot::Round => 4.0 * x * y / (PI * ((rows * y).powi(2) + (cols * x).powi(2))),
        }
    }

    /// Whether it lights a point this far from its middle in x and y, where the projected sensor reaches `half_x` and `half_y`, all in
    /// the same unit.
    pub fn lights(self, [x, y]: [f64; 2], [half_x, half_y]: [f64; 2]) -> bool {
        match self {
            Spot::Rectangle => x.abs() <= half_x && y.abs() <= half_y,
            Spot::Round => libm::hypot(x, y) <= libm::hypot(half_x, half_y),
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
    /// Pitch of a macropixel in x and y, m; their product is A_pix.
    pub pixel_pitch_m: [f64; 2],
    /// Rows of the array.
    pub rows: u32,
    /// Columns of the array.
    pub cols: u32,
    /// Solar irradiance in the filter's band at 100 klux, W/m² (M_target,bg).
    pub solar_irradiance_w_m2: f64,
    /// What the laser lights up.
    pub spot: Spot,
    /// The air between.
    pub atmosphere: Atmosphere,
    /// Which constant of proportionality to use.
    pub convention: Convention,
}

impl PhotonBudget {
    /// Detected signal photons of one macropixel per laser pulse (Eq. 15 with the exact lens share
    /// of Eq. 6), for a target of `reflectivity` (0 to 1) at `range_m` > 0.
    pub fn signal_per_pulse(&self, range_m: f64, reflectivity: f64) -> f64 {
        self.lens_share(range_m) * self.signal_at_target(range_m, reflectivity)
    }

    /// Eq. 15 as printed, for 4z² ≫ d²: exactly proportional to z⁻² in clear air. Exceeds
    /// [`PhotonBudget::signal_per_pulse`] by the factor 1 + d²/4z².
    pub fn signal_per_pulse_far_field(&self, range_m: f64, reflectivity: f64) -> f64 {
        self.lens_share_far_field(range_m) * self.signal_at_target(range_m, reflectivity)
    }

    /// Detected background photons of one macropixel per second, for a target of `reflectivity` (0 to 1)
    /// under `illuminance_klux` of sunlight: Eq. 16, independent of the range, because the growing
    /// footprint (Eq. 11) and the shrinking lens share cancel.
    pub fn background_hz(&self, reflectivity: f64, illuminance_klux: f64) -> f64 {
        let etendue_m2 = self.solid_angle_sr() * (self.lens_diameter_m / 2.0).powi(2);
        self.background_per_m2(reflectivity, illuminance_klux) * etendue_m2
    }

    /// Detected photons of one macropixel where each square metre that it sees, if white, has got this energy of the laser's
    /// wavelength: as Eq. 16, for a pulse.
    pub fn photons_of_exposure(&self, exposure_j_m2: f64) -> f64 {
        let etendue_m2 = self.solid_angle_sr() * (self.lens_diameter_m / 2.0).powi(2);
        self.counts_per_joule(1.0) * exposure_j_m2 * etendue_m2
    }

    /// Detected photons of what falls on the lens, J/m², all of which goes into one macropixel.
    pub fn photons_through_lens(&self, exposure_j_m2: f64) -> f64 {
        let aperture_m2 = PI * (self.lens_diameter_m / 2.0).powi(2);
        self.counts_per_joule(1.0) / self.convention.factor() * exposure_j_m2 * aperture_m2
    }

    /// sin²α of Eq. 6: the lens's share of what a target at `range_m` sends back.
    pub(crate) fn lens_share(&self, range_m: f64) -> f64 {
        let d2 = self.lens_diameter_m * self.lens_diameter_m;
        d2 / (4.0 * range_m * range_m + d2)
    }

    /// Eq. 6 for 4z² ≫ d².
    pub(crate) fn lens_share_far_field(&self, range_m: f64) -> f64 {
        (0.5 * self.lens_diameter_m / range_m).powi(2)
    }

    /// What one macropixel sees, sr: A_pix over f².
    fn solid_angle_sr(&self) -> f64 {
        let [x_m, y_m] = self.pixel_pitch_m;
        x_m * y_m / self.lens_focal_m.powi(2)
    }

    /// What would be detected of one pulse if the lens took all that the pixel's target sends back.
    fn signal_at_target(&self, range_m: f64, reflectivity: f64) -> f64 {
        self.atmosphere.round_trip(range_m)
            * self.counts_per_joule(reflectivity)
            * self.pixel_energy_j()
    }

    /// What of a pulse falls on one pixel's area on the target, J.
    fn pixel_energy_j(&self) -> f64 {
        let share = (self.spot).share_per_pixel(self.rows, self.cols, self.pixel_pitch_m);
        self.pulse_energy_j * share
    }

    /// Detections per second and square metre of sunlit target, before the lens's share.
    fn background_per_m2(&self, reflectivity: f64, illuminance_klux: f64) -> f64 {
        let irradiance_w_m2 = self.solar_irradiance_w_m2 * illuminance_klux / FULL_SUN_KLUX;
        self.counts_per_joule(reflectivity) * irradiance_w_m2
    }

    /// Detected photons per joule that falls on the target, before the lens's share (Eq. 14).
    fn counts_per_joule(&self, reflectivity: f64) -> f64 {
        let photon_j = PLANCK_J_S * SPEED_OF_LIGHT_M_PER_S / (self.wavelength_nm * 1e-9);
        self.convention.factor() * self.pde * self.transmittance * reflectivity / photon_j
    }

    /// The long-range automotive system of Table 6 (its target's reflectivity is 0.1).
    pub fn table_6() -> Self {
        let lens = Lens {
            diameter_m: 6e-3,
            f_number: 2.2,
        };
        PhotonBudget {
            pde: 0.22,
            wavelength_nm: 905.0,
            transmittance: 1.0,
            pulse_energy_j: 50e-6,
            lens_diameter_m: lens.diameter_m,
            lens_focal_m: lens.focal_m(),
            pixel_pitch_m: [30e-6; 2],
            rows: 63,
            cols: 200,
            solar_irradiance_w_m2: band_irradiance(&Filter::new(905.0, 20.0, FilterShape::TopHat)),
            spot: Spot::Rectangle,
            atmosphere: Atmosphere::CLEAR,
            convention: Convention::Thesis,
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn table_6_gives_1140_over_z_squared() {
        let z_m = 200.0;
        let coefficient = PhotonBudget::table_6().signal_per_pulse(z_m, 0.1) * z_m * z_m;
        assert!((coefficient - 1139.4).abs() < 0.1, "{coefficient}");
    }

    #[test]
    fn table_6_gives_20_million_background_counts() {
        let hz = PhotonBudget::table_6().background_hz(0.1, 100.0);
        assert!((hz - 20e6).abs() < 0.5e6, "{hz}");
    }

    #[test]
    fn lambertian_is_pi_times_the_thesis() {
        let thesis = PhotonBudget::table_6();
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
        let budget = PhotonBudget::table_6();
        assert!(budget.lens_share(1e-9) <= 1.0);
        let z_m = 1e-3;
        let far_field = budget.lens_diameter_m.powi(2) / (4.0 * z_m * z_m);
        assert!(budget.lens_share(z_m) < far_field);
    }

    #[test]
    fn background_is_linear_in_illuminance() {
        let budget = PhotonBudget::table_6();
        let full = budget.background_hz(0.1, 100.0);
        assert!((budget.background_hz(0.1, 60.0) / full - 0.6).abs() < 1e-12);
        assert_eq!(budget.background_hz(0.1, 0.0), 0.0);
    }

    #[test]
    fn the_printed_forms_are_the_far_field() {
        let budget = PhotonBudget::table_6();
        for z_m in [1e-3, 0.1, 10.0, 200.0] {
            let excess = (budget.lens_diameter_m / (2.0 * z_m)).powi(2);
            let signal =
                budget.signal_per_pulse_far_field(z_m, 0.1) / budget.signal_per_pulse(z_m, 0.1);
            // R·A_scene of Eq. 13 before the shortcut 4z² ≫ d².
            let scene_m2 = budget.solid_angle_sr() * z_m * z_m;
            let exact_hz = budget.background_per_m2(0.1, 100.0) * budget.lens_share(z_m) * scene_m2;
            let background = budget.background_hz(0.1, 100.0) / exact_hz;
            for ratio in [signal, background] {
                assert!(
                    (ratio / (1.0 + excess) - 1.0).abs() < 1e-12,
                    "{z_m} m: {ratio}"
                );
            }
        }
    }

    #[test]
    fn the_chain_of_equations_6_to_12_gives_equation_15() {
        for spot in [Spot::Rectangle, Spot::Round] {
            let budget = PhotonBudget {
                spot,
                ..PhotonBudget::table_6()
            };
            let z_m = 37.0;
            // A_scene of Eq. 11, and M_target,source of Eq. 7 and 8, per pulse instead of per second.
            let scene_m2 = budget.solid_angle_sr() * z_m * z_m;
            let exposure_j_m2 = budget.pixel_energy_j() / scene_m2;
            let radiance = exposure_j_m2 * 0.1 * budget.transmittance / PI;
            let pixel_j = budget.lens_share(z_m) * radiance * scene_m2;
            let photon_j = PLANCK_J_S * SPEED_OF_LIGHT_M_PER_S / 905e-9;
            let got = budget.signal_per_pulse(z_m, 0.1);
            assert!(
                (got / (budget.pde * pixel_j / photon_j) - 1.0).abs() < 1e-12,
                "{spot:?}"
            );
        }
    }

    #[test]
    fn a_round_spot_wastes_light() {
        let ratio = |rows, cols, pitch| {
            Spot::Rectangle.share_per_pixel(rows, cols, pitch)
                / Spot::Round.share_per_pixel(rows, cols, pitch)
        };
        assert!((ratio(64, 64, [1.0; 2]) - PI / 2.0).abs() < 1e-12);
        assert!((ratio(64, 32, [54.0, 27.0]) - PI / 2.0).abs() < 1e-12);
        assert!(ratio(63, 200, [1.0; 2]) > PI / 2.0);
    }

    #[test]
    fn fog_dims_the_echo_twice_and_the_background_not_at_all() {
        let clear = PhotonBudget::table_6();
        let fog = PhotonBudget {
            atmosphere: Atmosphere {
                extinction_per_m: 0.01,
            },
            ..clear
        };
        let left = fog.signal_per_pulse(60.0, 0.1) / clear.signal_per_pulse(60.0, 0.1);
        assert!((left - (-1.2f64).exp()).abs() < 1e-12);
        assert_eq!(
            fog.background_hz(0.1, 100.0),
            clear.background_hz(0.1, 100.0)
        );
    }
}
