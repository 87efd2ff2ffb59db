//! A scene as its file describes it: lidar optics, stereo rig, sunlight, objects.

use std::f64::consts::LN_2;

use glam::DVec3;

use super::camera::PinholeCamera;
use super::curve::CurveSetting;
use super::interferer::Interferer;
use super::medium::Medium;
use super::object::Object;
use super::rig::Rig;
use super::words::{
    BeamWord, CHOSEN, DITHER_NS, ENERGY_UJ, FWHM_NS, FilterWord, NEAR_M, POSITION, PdeWord,
    PulseWord, SHARE, StrayWord, TABLE_12, VignettingWord,
};
use crate::photon::{Convention, Spot};
use crate::settings::Range::{Above, Limited, Within, WordOrCurve};
use crate::settings::keys;
use crate::units::Time;

/// The sky has no reflectivity, but it is not dark: it counts as a surface of this reflectivity
/// in sunlight that returns no echo. A tenth of a white wall is of the order of a clear sky in
/// the near infrared; haze is brighter.
pub const SKY_REFLECTIVITY: f64 = 0.1;

/// Temperature of the lidar at which its keys hold, °C.
pub(super) const REFERENCE_C: f64 = 25.0;

/// A world and the optics through which it is seen. By default there is nothing in it.
///
/// What moves is described where it is at time 0; [`Scene::snapshot`] gives the scene at other times.
///
/// Read one with [`Scene::parse`] or [`Scene::load`], or take [`Scene::outdoor`]. After changing
/// fields call [`Scene::validate`].
#[derive(Debug, Clone, PartialEq, Default, serde::Serialize)]
pub struct Scene {
    /// Laser, lens and SPADs of the lidar.
    pub lidar: Lidar,
    /// The camera pair that guides the lidar; the thesis's rig unless given.
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
    /// Lidars of others; none unless given.
    #[serde(rename = "interferer", skip_serializing_if = "Vec::is_empty")]
    pub interferers: Vec<Interferer>,
}

keys! {
    /// The lidar's optics. Rows and columns are the sensor's business, not the scene's.
    /// What a file leaves out is the built-in street's, but for dark counts: none.
    #[non_exhaustive]
    pub struct Lidar {
        /// Horizontal field of view; the vertical one follows from the sensor's rows and the shape of its macropixels.
        fov_deg: f64 ["deg"] = 16.0, in Within(0.1, 150.0),
            from "chosen: 64 columns of 0.25 degrees";
        /// Height of a macropixel over its width; HSLIDAR's are 54 um over 114 um.
        macropixel_aspect: f64 = 1.0, in Within(0.01, 100.0), from "chosen: square";
        /// Laser wavelength.
        wavelength_nm: f64 ["nm"] = 940.0, in Within(100.0, 1e4),
            from "thesis 3.2, a dip of the solar spectrum";
        /// Full width at half maximum of the laser's Gaussian spectrum; 0 is a line.
        laser_fwhm_nm: f64 ["nm"] = 0.0, in Within(0.0, 1000.0), usually (1e-3, 100.0), from "chosen: a line";
        /// Growth of the laser's wavelength with temperature; edge emitters have 0.3 nm/K.
        laser_drift_nm_k: f64 ["nm/K"] = 0.08, in Within(-10.0, 10.0),
            from "thesis Table 4, a VCSEL";
        /// Energy of one laser pulse over the whole field of view.
        pulse_energy_uj: f64 ["uJ"] = 100.0,
            in Limited(0.0, 1e6, "lasers of flash lidars stay below 1 J a pulse"), usually ENERGY_UJ,
            from "chosen: class 1 at 10 frames a second of 1000 pulses";
        /// Most frames a second: the laser rests where the chip would be faster. 0 is as many as the chip takes.
        frame_rate_hz: f64 ["Hz"] = 10.0, in Within(0.0, 1e6), from CHOSEN;
        /// Growth of a pulse's energy with temperature, as a share of pulse_energy_uj; negative for lasers at a fixed current.
        pulse_energy_drift_1_k: f64 ["1/K"] = 0.0, in Within(-0.1, 0.1),
            from "none in the thesis; Liao et al. 2016 (doi 10.4236/opj.2016.68B013), a diode of 940 nm";
        /// Standard deviation of a pulse's energy, relative to the mean; window takes some twice as long with it.
        pulse_energy_spread: f64 = 0.0, in Within(0.0, 0.5), from "none in the thesis";
        /// Full width at half maximum of the Gaussian pulse, jitter included; with a measured pulse, of the jitter
        /// alone.
        pulse_fwhm_ns: f64 ["ns"] = 4.5, in Within(0.0, 1e6), usually FWHM_NS, from "thesis 6.4.2";
        /// Full width at half maximum of the SPADs' Gaussian timing jitter, on top of the pulse's width.
        spad_jitter_fwhm_ps: f64 ["ps"] = 0.0, in Within(0.0, 1e6), usually (1.0, 1e4),
            from "none in the thesis; Sun et al. 2019 (doi 10.1109/JEDS.2019.2895151) have 110 ps in 180 nm CMOS";
        /// Share of the photons whose carrier diffuses to the junction, so that the avalanche is late; cohort refuses them.
        spad_tail_share: f64 = 0.0, in SHARE, from "none in the thesis; Cova et al. 1996 (doi 10.1364/AO.35.001956)";
        /// Time constant of the exponential delay of these avalanches.
        spad_tail_ps: f64 ["ps"] = 0.0, in Within(0.0, 1e6), usually (1.0, 1e5), from "none in the thesis; Cova et al. 1996";
        /// Standard deviation of the laser's delay after STOP, on top of the pulse's width.
        trigger_jitter_ps: f64 ["ps"] = 0.0, in Within(0.0, 1e6), usually (0.1, 1e5), from "none in the thesis";
        /// Laser pulse.
        ///
        /// The centre of mass of a measured one leaves with the STOP edge.
        pulse: CurveSetting<PulseWord> = CurveSetting::default(),
            in WordOrCurve(PulseWord::NAMES, "time in ns and power"),
            from "thesis 6.4.2";
        /// Where the laser's energy goes: uniform is as spot says.
        beam: CurveSetting<BeamWord> = CurveSetting::default(),
            in WordOrCurve(BeamWord::NAMES, "degrees off the axis and intensity"),
            from "thesis Eq. 7";
        /// Full width at half maximum of a Gaussian beam.
        beam_fwhm_deg: f64 ["deg"] = 16.0, in Above(0.0, 180.0), from "chosen: the field of view";
        /// Longest random wait before each laser pulse, against other lidars.
        dither_ns: f64 ["ns"] = 0.0, in Within(0.0, 1e9), usually DITHER_NS, from "none";
        /// Width of the laser's apparent source, for the safety of eyes; 0 is a point, the worst.
        laser_source_mm: f64 ["mm"] = 12.0, in Within(0.0, 1000.0), usually (0.02, 300.0), from "chosen: an array of VCSELs behind a diffuser";
        /// Photon detection efficiency of the SPADs at the laser's wavelength.
        pde: f64 = 0.185, in SHARE, from "thesis Table 6";
        /// Photon detection efficiency over wavelength, for sunlight.
        pde_curve: CurveSetting<PdeWord> = CurveSetting::default(),
            in WordOrCurve(
                PdeWord::NAMES,
                "wavelength in nm and efficiency, of which only the shape counts",
            ),
            from "thesis Eq. 14";
        /// Standard deviation of a SPAD's detection efficiency, relative to the mean; window takes some 12 times as long with it.
        pde_spread: f64 = 0.0, in Within(0.0, 1.0), from "none in the thesis";
        /// Diameter of the lens aperture.
        lens_diameter_mm: f64 ["mm"] = 4.0, in Above(0.0, 1e5), usually (0.1, 500.0), from CHOSEN;
        /// Focal length over diameter of the lens.
        lens_f_number: f64 = 2.2, in Above(0.0, 1e4), from CHOSEN;
        /// Share of the light that lens and filter let through.
        transmittance: f64 = 1.0, in SHARE, from "thesis Eq. 15, where it is left out";
        /// Illumination off the axis by an evenly bright scene.
        vignetting: CurveSetting<VignettingWord> = CurveSetting::default(),
            in WordOrCurve(
                VignettingWord::NAMES,
                "degrees off the axis and illumination of the array",
            ),
            from "thesis Eq. 12, which has none";
        /// Rays that look from every place for laser light that other surfaces throw there; 0 is none.
        bounce_rays: u32 = 0, in Within(0.0, 4096.0), from "none in the thesis; 16 are right to some per cent";
        /// Share of the light that lens and filter scatter over other macropixels.
        stray_share: f64 = 0.0, in SHARE, from "none in the thesis; lenses scatter 0.1 to 5 %";
        /// Distance within which stray light is even.
        ///
        /// In widths of a macropixel.
        stray_radius: f64 = 2.0, in Above(0.0, 100.0), from "chosen";
        /// How stray light falls off with the distance.
        stray: CurveSetting<StrayWord> = CurveSetting::default(),
            in WordOrCurve(
                StrayWord::NAMES,
                "widths of a macropixel and light, of which only the shape counts",
            ),
            from "chosen: a cube, as of surfaces that scatter little";
        /// Band-pass filter, through which ASTM G173 sunlight comes; irradiance is one that lets solar_irradiance_w_m2 through.
        filter: CurveSetting<FilterWord> = CurveSetting::default(),
            in WordOrCurve(FilterWord::NAMES, "wavelength in nm and transmittance"),
            from "thesis 2.3.3";
        /// Centre of the filter, if it is given as a shape; it does not follow wavelength_nm.
        filter_centre_nm: f64 ["nm"] = 940.0, in Within(100.0, 1e4), from "chosen: the laser's default";
        /// Full width at half maximum of the filter, if it is given as a shape.
        filter_fwhm_nm: f64 ["nm"] = 10.0, in Above(0.0, 1e4), usually (0.01, 1000.0);
        /// Growth of the filter's wavelengths with temperature.
        filter_drift_nm_k: f64 ["nm/K"] = 0.02, in Within(-10.0, 10.0),
            from "chosen: a hard-coated filter has 0.01 to 0.03";
        /// Solar irradiance within the filter's band at 100 klux, where filter is irradiance.
        solar_irradiance_w_m2: f64 ["W/m2"] = 3.047,
            in Limited(
                0.0,
                1361.0,
                "the sun has no more outside the atmosphere, at all wavelengths together",
            ),
            from "ASTM G173 global tilt, 935 to 945 nm";
        /// Dark counts of one macropixel, all its SPADs together.
        ///
        /// The mean where they differ.
        dark_count_hz: f64 ["Hz"] = 0.0, in Limited(0.0, 1.6e8, "16 hot SPADs have 10 MHz each"),
            from "chosen: 1.25 kHz for each of 16 SPADs";
        /// Standard deviation of the natural logarithm of a SPAD's dark count rate; the mean rate stays the same.
        dark_count_spread: f64 = 0.0, in Within(0.0, 5.0), from "none in the thesis";
        /// Energy by which dark counts grow with temperature: exp(-energy/kT).
        dark_count_activation_ev: f64 ["eV"] = 0.56, in Within(0.0, 2.0),
            from "generation at traps in the middle of silicon's band gap (Shockley, Read, Hall): twice as much every 9.8 K";
        /// Bias of the SPADs above their breakdown voltage at 25 degC, which detects 90 % of what it could.
        excess_bias_v: f64 ["V"] = 3.0, in Above(0.0, 100.0), from "chosen";
        /// Growth of the breakdown voltage with temperature, while the bias stays.
        breakdown_drift_mv_k: f64 ["mV/K"] = 21.5, in Within(0.0, 1000.0),
            from "arXiv:2007.02444, SensL MicroFJ; thinner junctions have less";
        /// Temperature of the lidar, at which all its other keys have their values if it is 25 degC; the chip's junction is 25 K above it.
        temperature_c: f64 ["C"] = REFERENCE_C, in Limited(-55.0, 125.0, "the chip is 25 K warmer, and its delays are known up to 150 degC"),
            from "chosen";
        /// Share of SPADs that are hot.
        hot_spad_share: f64 = 0.0, in SHARE, from "none in the thesis";
        /// Dark counts of a hot SPAD.
        hot_spad_hz: f64 ["Hz"] = 1e6,
            in Limited(0.0, 1e7, "a SPAD that fires more often is to be switched off");
        /// Seed that decides which SPADs are hot, dark or insensitive.
        spad_seed: u32 = 1, in Within(0.0, 4_294_967_295.0);
        /// What the laser lights up: the field of view, or the circle around it.
        spot: Spot = Spot::default(), from "thesis Eq. 7";
        /// Constant of the photon budget: Lambertian radiometry, or 1/pi of it, as printed in the thesis.
        convention: Convention = Convention::default(),
            from "radiometry: a Lambertian surface sends the share sin2(alpha) of its light into a cone";
    }
}

impl Lidar {
    /// From the beginning of a frame to that of the next one, s, if the chip could begin it after `chip_s`.
    pub fn frame_s(&self, chip_s: f64) -> f64 {
        if self.frame_rate_hz > 0.0 {
            chip_s.max(1.0 / self.frame_rate_hz)
        } else {
            chip_s
        }
    }

    /// What is odd about the laser's wavelength beside the filter's, if anything.
    pub(super) fn remark_on_filter(&self) -> Option<String> {
        let laser_nm = self.wavelength_nm;
        let CurveSetting::Word(filter) = &self.filter else {
            return None;
        };
        if filter.shape().is_some() {
            // Both the sunlight and the laser's go through it.
            let (centre_nm, fwhm_nm) = (self.filter_centre_nm, self.filter_fwhm_nm);
            let is_off = (laser_nm - centre_nm).abs() > 0.5 * fwhm_nm;
            return is_off.then(|| {
                format!(
                    "in [lidar], the laser has {laser_nm} nm, and the filter at {centre_nm} nm, {fwhm_nm} nm wide, passes less than half of its light; give filter_centre_nm = {laser_nm}"
                )
            });
        }
        let by_default = Lidar::default();
        let (centre_nm, fwhm_nm) = (by_default.wavelength_nm, by_default.filter_fwhm_nm);
        let is_off = (laser_nm - centre_nm).abs() > fwhm_nm
            && self.solar_irradiance_w_m2 == by_default.solar_irradiance_w_m2;
        is_off.then(|| {
            format!(
                "in [lidar], the laser has {laser_nm} nm, and sunlight comes through a filter at {centre_nm} nm, {fwhm_nm} nm wide; give filter = \"top_hat\" with filter_centre_nm = {laser_nm}, or solar_irradiance_w_m2 of that band"
            )
        })
    }

    /// The optics of the thesis's demonstrator, before HSLIDAR's 64×32 macropixels (4.9, 6.3.1, Table 14).
    ///
    /// Published: macropixels of 114 µm × 54 µm, 25 mm focal length, 940 nm with a pulse of 4.5 ns, a filter of 10 nm, 3.5 % PDE, and
    /// what its chip counts before a target of 10 %: 89 z⁻² a pulse, 4.8 Mcounts/s at 60 klux (Fig. 94). SPADs that are dead and photons
    /// that cancel are not counted; with them, 129.9 z⁻² and 4.876 Mcounts/s arrive. Aperture, transmittance and the laser's energy
    /// are not published. An aperture of f/1.4 is chosen, and the transmittance (which also stands for a PDE that is lower at 940 nm
    /// than at 850 nm) is what gives the background; only their product counts. The energy, 0.98 µJ, is what then gives the signal,
    /// whatever the aperture.
    pub fn demonstrator() -> Self {
        Lidar {
            fov_deg: 16.604,
            macropixel_aspect: 54.0 / 114.0,
            wavelength_nm: 940.0,
            pulse_energy_uj: 0.9822,
            pulse_fwhm_ns: 4.5,
            pde: 0.035,
            lens_diameter_mm: 25.0 / 1.4,
            lens_f_number: 1.4,
            transmittance: 0.2051,
            solar_irradiance_w_m2: 3.047,
            dark_count_hz: 0.0,
            frame_rate_hz: 0.0,
            laser_source_mm: 0.0,
            spot: Spot::Rectangle,
            convention: Convention::Lambertian,
            ..Lidar::default()
        }
    }
}

/// Longest baseline of a camera pair, m: chosen, ten times that of long ones on vehicles.
pub const MOST_BASELINE_M: f64 = 20.0;

keys! {
    /// The stereo camera rig of thesis 5.2.2 (Table 12), whose values are the default of every field.
    #[derive(Copy)]
    pub struct Stereo {
        /// Distance from the principal (left) to the right camera.
        baseline_m: f64 ["m"] = 1.0,
            in Limited(1e-6, MOST_BASELINE_M, "the cameras of one rig stand closer; calibrations in mm have 1000 times as much"),
            from TABLE_12;
        /// Distance from the principal to a third camera, between the two, that is like them: for what the pair has no estimate of. 0 is
        /// none.
        third_camera_baseline_m: f64 ["m"] = 0.0, in Within(0.0, MOST_BASELINE_M), from "none in Table 12; thesis 7.3.1 proposes one";
        /// Focal length of both lenses.
        focal_mm: f64 ["mm"] = 12.0, in Above(0.0, 1e5), usually (0.5, 2000.0), from TABLE_12;
        /// Pixel pitch of both cameras.
        pixel_pitch_um: f64 ["um"] = 3.45, in Above(0.0, 1e5), usually (0.3, 100.0), from TABLE_12;
        /// Columns of an image.
        width: u32 ["px"] = 1440, in Within(1.0, 16_384.0), from TABLE_12;
        /// Rows of an image.
        height: u32 ["px"] = 1080, in Within(1.0, 16_384.0), from TABLE_12;
        /// Standard deviation of the matched disparity.
        disparity_sigma_px: f64 ["px"] = 1.0 / 3.0, in Within(0.0, 1e5),
            from "thesis Fig. 68, where 1/3 px is overlaid";
        /// Disparities are multiples of one over this many pixels.
        subpixel_steps: u32 = 16, in Within(1.0, 65_536.0),
            from "chosen: what semi-global matching gives";
        /// Smallest disparity accepted.
        min_disparity_px: f64 ["px"] = 10.0, in Above(0.0, 1e5),
            from "thesis 5.2.1, an error below 10 % for a whole pixel";
        /// Largest disparity searched.
        ///
        /// 5.2.1 speaks of 128 px as customary, but at 1 m and 12 mm that would end the view at 27 m, while the rig is reported to see
        /// down to about 15 m. 232 px is the disparity at 15 m.
        max_disparity_px: f64 ["px"] = 232.0, in Above(0.0, 1e5),
            from "chosen: the disparity at 15 m, where the thesis's rig begins to see";
        /// Place of the principal camera, [right, down, forward] of the lidar.
        position_m: DVec3 ["m"] = DVec3::ZERO, in POSITION, usually NEAR_M, from CHOSEN;
        /// By how much the right camera has turned outwards since calibration.
        yaw_error_deg: f64 ["deg"] = 0.0, in Within(-45.0, 45.0), from "thesis Fig. 70; none";
        /// By how much the right camera has turned upwards.
        pitch_error_deg: f64 ["deg"] = 0.0, in Within(-45.0, 45.0), from "none";
        /// By how much the right camera has turned clockwise about its axis.
        roll_error_deg: f64 ["deg"] = 0.0, in Within(-45.0, 45.0), from "none";
        /// By how much the right camera has moved outwards.
        baseline_error_m: f64 ["m"] = 0.0, in Within(-10.0, 10.0), from "none";
        /// By how much the right camera's focal length has grown, per cent.
        focal_error_percent: f64 = 0.0, in Within(-50.0, 50.0), from "none";
    }
}

impl Stereo {
    /// Either camera, in its own coordinates.
    pub fn camera(&self) -> PinholeCamera {
        let focal_px = self.focal_mm * 1e-3 / (self.pixel_pitch_um * 1e-6);
        PinholeCamera::centred(focal_px, self.width, self.height)
    }
}

keys! {
    /// Sunlight on the scene; what a file leaves out is the built-in street's.
    #[derive(Copy)]
    #[non_exhaustive]
    pub struct Light {
        /// Illuminance of the scene by the sun.
        ///
        /// 100 klux is full sun. With a place for the sun, that of a surface that faces it: level ground has less by the sine of sun_elevation_deg.
        illuminance_klux: f64 ["klux"] = 50.0,
            in Limited(0.0, 200.0, "the sun with bright clouds about it stays below 150 klux"),
            from CHOSEN;
        /// Height of the sun above the horizon, for shadows and slopes; light from everywhere if left out.
        #[serde(skip_serializing_if = "Option::is_none")]
        sun_elevation_deg: Option<f64> ["deg"] = None, in Within(-90.0, 90.0),
            from "thesis Eq. 16, where surfaces face the sun";
        /// Direction of the sun, to the right of forward.
        sun_azimuth_deg: f64 ["deg"] = 0.0, in Within(-360.0, 360.0);
        /// Share of the illuminance that comes from the sky, where the sun has a place.
        sky_share: f64 = 0.2, in SHARE, from "chosen: a clear day; 1 is an overcast one";
        /// What a surface in the sun's light would reflect to be as bright as the sky.
        sky_reflectivity: f64 = SKY_REFLECTIVITY, in Within(0.0, 10.0),
            from "chosen: a clear sky in the near infrared; haze is brighter";
    }
}

impl Scene {
    /// The lidar as a camera of `rows` × `cols` macropixels.
    pub fn lidar_camera(&self, rows: u32, cols: u32) -> PinholeCamera {
        PinholeCamera::with_horizontal_fov(self.lidar.fov_deg, cols, rows)
            .with_pixel_aspect(self.lidar.macropixel_aspect)
    }

    /// Unit vector towards the sun; `None` where light comes from everywhere.
    pub(crate) fn towards_sun(&self) -> Option<DVec3> {
        let (sine, cosine) = libm::sincos(self.light.sun_elevation_deg?.to_radians());
        let (right, forward) = libm::sincos(self.light.sun_azimuth_deg.to_radians());
        Some(DVec3::new(right * cosine, -sine, forward * cosine))
    }

    /// Standard deviation of the Gaussian part of a detected photon's time: of the laser pulse, its width at half maximum over
    /// 2·√(2·ln 2), of the trigger's jitter, and of the SPADs' jitter. Variances add.
    pub fn pulse_sigma(&self) -> Time {
        let pulse_s = self.lidar.pulse_fwhm_ns * 1e-9 / (8.0 * LN_2).sqrt();
        let sent_s = libm::hypot(pulse_s, self.lidar.trigger_jitter_ps * 1e-12);
        Time::from_s(libm::hypot(sent_s, self.lidar.spad_jitter_s()))
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
    fn pulse_sigma_follows_from_the_width() {
        let mut scene = Scene::outdoor();
        scene.lidar.pulse_fwhm_ns = 2.354_820_045;
        assert!((scene.pulse_sigma().as_ns() - 1.0).abs() < 1e-6);
        scene.lidar.trigger_jitter_ps = 750.0;
        assert!((scene.pulse_sigma().as_ns() - 1.25).abs() < 1e-6);
        scene.lidar.spad_jitter_fwhm_ps = 3e3 * (8.0 * LN_2).sqrt();
        assert!((scene.pulse_sigma().as_ns() - 3.25).abs() < 1e-6);
    }
}
