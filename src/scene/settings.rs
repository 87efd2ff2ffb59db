//! A scene as its file describes it: lidar optics, stereo rig, sunlight, objects.

use std::f64::consts::LN_2;

use glam::DVec3;

use super::camera::PinholeCamera;
use super::curve::Measured;
use super::illumination::SKY_REFLECTIVITY;
use super::medium::Medium;
use super::motion::Rig;
use super::object::Object;
use super::optics::{BeamWord, FilterWord, PdeWord, PulseWord, VignettingWord};
use crate::photon::{Atmosphere, Convention, PhotonBudget, Spot};
use crate::units::Time;

/// A world and the optics through which it is seen. By default there is nothing in it.
///
/// What moves is described where it is at time 0; [`Scene::at`] gives the scene at other times.
///
/// Read one with [`Scene::parse`] or [`Scene::load`], or take [`Scene::outdoor`]. After changing
/// fields call [`Scene::validate`].
#[derive(Debug, Clone, PartialEq, Default, serde::Serialize)]
pub struct Scene {
    /// Laser, lens and SPADs of the lidar.
    pub lidar: Lidar,
    /// The camera pair that guides it; the thesis's rig unless given.
    pub stereo: Stereo,
    /// Sunlight.
    pub light: Light,
    /// Fog and rain; clear air unless given.
    pub medium: Medium,
    /// Motion of lidar and cameras; none unless given.
    pub rig: Rig,
    /// What there is to see.
    #[serde(rename = "object")]
    pub objects: Vec<Object>,
}

/// The lidar's optics. Rows and columns are the sensor's business, not the scene's.
/// What a file leaves out is the built-in street's, but for dark counts: none.
#[derive(Debug, Clone, PartialEq, serde::Serialize, serde::Deserialize)]
#[serde(deny_unknown_fields, default)]
pub struct Lidar {
    /// Horizontal field of view, degrees. The vertical one follows from the sensor's rows and the macropixels' shape.
    pub fov_deg: f64,
    /// Height of a macropixel over its width.
    pub macropixel_aspect: f64,
    /// Laser wavelength, nm.
    pub wavelength_nm: f64,
    /// Energy of one pulse over the whole field of view, µJ.
    pub pulse_energy_uj: f64,
    /// Full width at half maximum of the Gaussian pulse, jitter included, or of what jitter adds to a measured pulse, ns.
    pub pulse_fwhm_ns: f64,
    /// Measured power over time, ns, whose centre of mass leaves with the STOP edge.
    pub pulse: Measured<PulseWord>,
    /// How the laser's energy is spread over directions: uniform as `spot` says, or intensity over degrees off the axis.
    pub beam: Measured<BeamWord>,
    /// Full width at half maximum of a Gaussian beam, degrees.
    pub beam_fwhm_deg: f64,
    /// Photon detection efficiency of the SPADs at the laser's wavelength, 0 to 1.
    pub pde: f64,
    /// Photon detection efficiency over wavelength, nm, of which only the shape counts.
    pub pde_curve: Measured<PdeWord>,
    /// Standard deviation of a SPAD's detection efficiency, relative to the mean.
    pub pde_spread: f64,
    /// Diameter of the lens aperture, mm.
    pub lens_diameter_mm: f64,
    /// Focal length over diameter.
    pub lens_f_number: f64,
    /// Transmittance of lens and filter, 0 to 1.
    pub transmittance: f64,
    /// What an evenly bright scene gives off the axis relative to the middle: a word, or a curve over degrees.
    pub vignetting: Measured<VignettingWord>,
    /// Band-pass filter: a shape, or transmittance over wavelength, nm.
    pub filter: Measured<FilterWord>,
    /// Centre of a filter that is a shape, nm.
    pub filter_centre_nm: f64,
    /// Full width at half maximum of it, nm.
    pub filter_fwhm_nm: f64,
    /// Solar irradiance within the filter's band at 100 klux, W/m², where `filter` is irradiance.
    pub solar_irradiance_w_m2: f64,
    /// Dark counts of one macropixel, all SPADs together, per second; the mean where they differ.
    pub dark_count_hz: f64,
    /// Standard deviation of the natural logarithm of a SPAD's dark count rate.
    pub dark_count_spread: f64,
    /// Share of SPADs that are hot, 0 to 1.
    pub hot_spad_share: f64,
    /// Dark counts of a hot SPAD per second.
    pub hot_spad_hz: f64,
    /// Which SPADs are how: seed of the array.
    pub spad_seed: u32,
    /// What the laser lights up: the field of view, or the circle around it.
    pub spot: Spot,
    /// Constant of the photon budget.
    pub convention: Convention,
}

impl Default for Lidar {
    fn default() -> Self {
        Lidar {
            fov_deg: 16.0,
            macropixel_aspect: 1.0,
            wavelength_nm: 940.0,
            pulse_energy_uj: 20.0,
            pulse_fwhm_ns: 4.5,
            pulse: Measured::default(),
            beam: Measured::default(),
            beam_fwhm_deg: 16.0,
            pde: 0.185,
            pde_curve: Measured::default(),
            pde_spread: 0.0,
            lens_diameter_mm: 4.0,
            lens_f_number: 2.2,
            transmittance: 1.0,
            vignetting: Measured::default(),
            filter: Measured::default(),
            filter_centre_nm: 940.0,
            filter_fwhm_nm: 10.0,
            solar_irradiance_w_m2: 3.047,
            dark_count_hz: 0.0,
            dark_count_spread: 0.0,
            hot_spad_share: 0.0,
            hot_spad_hz: 1e6,
            spad_seed: 1,
            spot: Spot::default(),
            convention: Convention::default(),
        }
    }
}

impl Lidar {
    /// The optics of the thesis's demonstrator, before HSLIDAR's 64×32 macropixels (4.9, 6.3.1, Table 14).
    ///
    /// Published: macropixels of 114 µm × 54 µm, 25 mm focal length, 940 nm with a pulse of 4.5 ns, a filter of 10 nm, 3.5 % PDE, and
    /// what a target of 10 % gives: 89 z⁻² counts a pulse, 4.8 Mcounts/s at 60 klux (Fig. 94). Aperture, transmittance and the
    /// laser's energy are not. An aperture of f/1.4 is chosen, and the transmittance (which also stands for a PDE that is lower at 940 nm
    /// than at 850 nm) is what gives the background; only their product counts. The energy, 0.68 µJ, is what then gives the signal,
    /// whatever the aperture.
    pub fn demonstrator() -> Self {
        Lidar {
            fov_deg: 16.604,
            macropixel_aspect: 54.0 / 114.0,
            wavelength_nm: 940.0,
            pulse_energy_uj: 0.6838,
            pulse_fwhm_ns: 4.5,
            pde: 0.035,
            lens_diameter_mm: 25.0 / 1.4,
            lens_f_number: 1.4,
            transmittance: 0.2019,
            solar_irradiance_w_m2: 3.047,
            dark_count_hz: 0.0,
            spot: Spot::Rectangle,
            convention: Convention::Lambertian,
            ..Lidar::default()
        }
    }
}

/// The stereo camera rig of thesis 5.2.2 (Table 12), whose values are the default of every field.
#[derive(Debug, Clone, Copy, PartialEq, serde::Serialize, serde::Deserialize)]
#[serde(deny_unknown_fields, default)]
pub struct Stereo {
    /// Distance from the principal (left) to the right camera, m.
    pub baseline_m: f64,
    /// Focal length of both lenses, mm.
    pub focal_mm: f64,
    /// Pixel pitch of both cameras, µm.
    pub pixel_pitch_um: f64,
    /// Columns of an image.
    pub width: u32,
    /// Rows of an image.
    pub height: u32,
    /// Standard deviation of the matched disparity, px; the thesis overlays 1/3 px on its Fig. 68.
    pub disparity_sigma_px: f64,
    /// Disparities are multiples of 1/`subpixel_steps` px.
    pub subpixel_steps: u32,
    /// Smallest disparity accepted, px. 10 px holds a whole-pixel error below 10 % (5.2.1).
    pub min_disparity_px: f64,
    /// Largest disparity searched, px.
    ///
    /// 5.2.1 speaks of 128 px as customary, but at 1 m and 12 mm that would end the view at 27 m,
    /// while the rig is reported to see down to about 15 m. 232 px is the disparity at 15 m.
    pub max_disparity_px: f64,
    /// Position of the principal camera, with the lidar at the origin, m.
    pub position_m: DVec3,
    /// By how much the right camera has turned outwards since calibration, degrees (Fig. 70).
    pub yaw_error_deg: f64,
    /// By how much it has turned upwards, degrees.
    pub pitch_error_deg: f64,
    /// By how much it has turned about its axis, clockwise as it looks, degrees.
    pub roll_error_deg: f64,
    /// By how much it has moved outwards, m.
    pub baseline_error_m: f64,
    /// By how much its focal length has grown, per cent.
    pub focal_error_percent: f64,
}

impl Default for Stereo {
    fn default() -> Self {
        Stereo {
            baseline_m: 1.0,
            focal_mm: 12.0,
            pixel_pitch_um: 3.45,
            width: 1440,
            height: 1080,
            disparity_sigma_px: 1.0 / 3.0,
            subpixel_steps: 16,
            min_disparity_px: 10.0,
            max_disparity_px: 232.0,
            position_m: DVec3::ZERO,
            yaw_error_deg: 0.0,
            pitch_error_deg: 0.0,
            roll_error_deg: 0.0,
            baseline_error_m: 0.0,
            focal_error_percent: 0.0,
        }
    }
}

impl Stereo {
    /// Either camera, in its own coordinates.
    pub fn camera(&self) -> PinholeCamera {
        let focal_px = self.focal_mm * 1e-3 / (self.pixel_pitch_um * 1e-6);
        PinholeCamera::centred(focal_px, self.width, self.height)
    }
}

/// Sunlight on the scene; what a file leaves out is the built-in street's.
#[derive(Debug, Clone, Copy, PartialEq, serde::Serialize, serde::Deserialize)]
#[serde(deny_unknown_fields, default)]
pub struct Light {
    /// Illuminance, klux; 100 is full sun. With a place for the sun, that of a surface that faces it.
    pub illuminance_klux: f64,
    /// Height of the sun above the horizon, degrees; `None` for light from everywhere.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub sun_elevation_deg: Option<f64>,
    /// Where the sun stands, degrees to the right of forward.
    pub sun_azimuth_deg: f64,
    /// Share of the illuminance that comes from the sky, where the sun has a place.
    pub sky_share: f64,
    /// What a Lambertian surface in the sun's light would reflect to be as bright as the sky.
    pub sky_reflectivity: f64,
}

impl Default for Light {
    fn default() -> Self {
        Light {
            illuminance_klux: 50.0,
            sun_elevation_deg: None,
            sun_azimuth_deg: 0.0,
            sky_share: 0.2,
            sky_reflectivity: SKY_REFLECTIVITY,
        }
    }
}

impl Scene {
    /// The lidar as a camera of `rows` × `cols` macropixels.
    pub fn lidar_camera(&self, rows: u32, cols: u32) -> PinholeCamera {
        PinholeCamera::with_horizontal_fov(self.lidar.fov_deg, cols, rows)
            .with_pixel_aspect(self.lidar.macropixel_aspect)
    }

    /// The photon budget of one macropixel of a `rows` × `cols` array behind this lens.
    ///
    /// The pitch is the one that fits the array into the field of view.
    pub fn photon_budget(&self, rows: u32, cols: u32) -> PhotonBudget {
        let lidar = &self.lidar;
        let lens_diameter_m = lidar.lens_diameter_mm * 1e-3;
        let lens_focal_m = lens_diameter_m * lidar.lens_f_number;
        let camera = self.lidar_camera(rows, cols);
        PhotonBudget {
            pde: lidar.pde,
            wavelength_nm: lidar.wavelength_nm,
            transmittance: lidar.transmittance * lidar.laser_transmission(),
            pulse_energy_j: lidar.pulse_energy_uj * 1e-6,
            lens_diameter_m,
            lens_focal_m,
            pixel_pitch_m: [camera.focal_px, camera.focal_v_px].map(|px| lens_focal_m / px),
            rows,
            cols,
            // The transmittance above is for signal and background alike.
            solar_irradiance_w_m2: lidar.effective_irradiance_w_m2() / lidar.laser_transmission(),
            spot: lidar.spot,
            atmosphere: Atmosphere::CLEAR,
            convention: lidar.convention,
        }
    }

    /// Standard deviation of the laser pulse: its width at half maximum over 2·√(2·ln 2).
    pub fn pulse_sigma(&self) -> Time {
        Time::from_s(self.lidar.pulse_fwhm_ns * 1e-9 / (8.0 * LN_2).sqrt())
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_thesis_rig_sees_from_15_to_beyond_200_m() {
        let stereo = Stereo::default();
        let focal_times_baseline = stereo.camera().focal_px * stereo.baseline_m;
        assert!((focal_times_baseline / stereo.max_disparity_px - 15.0).abs() < 0.01);
        assert!(focal_times_baseline / stereo.min_disparity_px > 200.0);
    }

    #[test]
    fn the_array_fills_the_field_of_view() {
        let scene = Scene::outdoor();
        let budget = scene.photon_budget(64, 64);
        let half_width_m = 32.0 * budget.pixel_pitch_m[0];
        let fov_deg = 2.0 * (half_width_m / budget.lens_focal_m).atan().to_degrees();
        assert!((fov_deg - scene.lidar.fov_deg).abs() < 1e-9);
    }

    #[test]
    fn the_demonstrator_has_the_published_pitch_and_light() {
        let mut scene = Scene::outdoor();
        scene.lidar = Lidar::demonstrator();
        let budget = scene.photon_budget(32, 64);
        let [x_m, y_m] = budget.pixel_pitch_m;
        assert!((x_m - 114e-6).abs() < 1e-8 && (y_m - 54e-6).abs() < 1e-8);
        assert!((budget.lens_focal_m - 25e-3).abs() < 1e-12);
        // Fig. 94: its digits are good to half of the last one.
        let signal = budget.signal_per_pulse_far_field(30.0, 0.1) * 900.0;
        let background_hz = budget.background_hz(0.1, 60.0);
        assert!((signal - 89.0).abs() < 0.1, "{signal}");
        assert!((background_hz - 4.8e6).abs() < 0.01e6, "{background_hz}");
    }

    #[test]
    fn pulse_sigma_follows_from_the_width() {
        let mut scene = Scene::outdoor();
        scene.lidar.pulse_fwhm_ns = 2.354_820_045;
        assert!((scene.pulse_sigma().as_ns() - 1.0).abs() < 1e-6);
    }
}
