//! The lidar's laser, lens, filter and SPADs as its file describes them, from words or from measured curves.
//!
//! ```text
//!   laser ──► beam: how much of a pulse goes into which macropixel ──► surface ──► lens: vignetting ──► filter ──► SPAD
//!     └─ pulse: its power over time                     sun ───────────┘              (wavelengths)    (PDE over wavelength)
//! ```
//!
//! A signal photon has the laser's wavelength. Of the sun all wavelengths count that filter and SPAD let through, each by its
//! photons: the thesis's 13.8 W/m² are those of a top hat, all taken for 905 nm (Eq. 10 and 14).
//!
//! *Vignetting* is the relative illumination of a lens's data sheet: what an evenly bright scene gives a macropixel off the axis,
//! relative to the middle. The cosine to the fourth of a plain lens is one cosine each for the lens and the macropixel, which
//! are seen at an angle, and two for the distance. A uniform laser (Eq. 7) sends all macropixels the same energy, also those
//! that see a smaller solid angle, so that of the signal only the lens's cosine is lost.

use std::f64::consts::{LN_2, PI};

use super::camera::PinholeCamera;
use super::curve::{Curve, CurveSetting};
use super::settings::{Lidar, Scene};
use super::words::{BeamWord, PdeWord, VignettingWord};
use crate::numerics::integrate;
use crate::photon::solar::{spectral_irradiance, spectrum};
use crate::photon::{
    Atmosphere, DiffusionTail, EchoWidth, Filter, FilterShape, PhotonBudget, PulseShape,
    StreamConfig,
};
use crate::settings::Fault;
use crate::units::Time;

/// Skewness and excess kurtosis of a measured pulse up to which ranging takes it for a Gaussian: chosen. Of 576 depths of a triangle (0 and −0.6) or one whose
/// mode is early (0.2) none was beyond five bounds, from 0.1 to 3 µJ; of a rectangle (−1.2) up to 17 %, of a triangle that rises at once (0.57) 15 %.
const MOST_SKEWNESS: f64 = 0.25;
const MOST_KURTOSIS: f64 = 0.8;

/// Samples of a measured pulse whose own are not equally far apart.
const PULSE_SAMPLES: usize = 4096;

/// How the light of a macropixel differs from that of one on the axis.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct OffAxis {
    /// Of the laser's echo.
    pub signal: f64,
    /// Of the sunlight.
    pub background: f64,
}

impl Lidar {
    /// Share of the light of `wavelength_nm` that passes the filter, relative to its transmittance; `None` where only the
    /// sun's irradiance is known.
    pub(super) fn filter_at(&self, wavelength_nm: f64) -> Option<f64> {
        match &self.filter {
            CurveSetting::Curve(curve) => {
                let cold_nm = wavelength_nm - self.filter_shift_nm();
                Some(curve.interpolate(cold_nm).unwrap_or(0.0))
            }
            CurveSetting::Word(word) => {
                let filter = self.filter_of(word.shape()?);
                Some(filter.transmission(wavelength_nm))
            }
        }
    }

    pub(super) fn filter_of(&self, shape: FilterShape) -> Filter {
        let centre_nm = self.filter_centre_nm + self.filter_shift_nm();
        Filter::new(centre_nm, self.filter_fwhm_nm, shape)
    }

    /// Detection efficiency at a wavelength, relative to that at the laser's.
    pub(super) fn relative_pde(&self, wavelength_nm: f64) -> f64 {
        match &self.pde_curve {
            CurveSetting::Word(PdeWord::Flat) => 1.0,
            CurveSetting::Curve(curve) => {
                let own = curve.interpolate(self.warm_wavelength_nm()).unwrap_or(0.0);
                curve.interpolate(wavelength_nm).unwrap_or(0.0) / own
            }
        }
    }

    /// Sunlight in full sun (100 klux), W/m²: as much of the laser's wavelength gives as many detected photons.
    pub(super) fn effective_irradiance_w_m2(&self) -> f64 {
        let (from, to) = match &self.filter {
            CurveSetting::Curve(curve) => {
                let (from, to) = curve.ends();
                (from + self.filter_shift_nm(), to + self.filter_shift_nm())
            }
            CurveSetting::Word(word) => match word.shape() {
                None => return self.solar_irradiance_w_m2,
                Some(shape) => self.filter_of(shape).passband_nm(),
            },
        };
        let table = spectrum();
        let (from, to) = (from.max(table[0].0), to.min(table[table.len() - 1].0));
        if from >= to {
            return 0.0;
        }
        let mut breaks = vec![from, to];
        breaks.extend(table.iter().map(|&(nm, _)| nm));
        let shift_nm = self.filter_shift_nm();
        let (centre_nm, fwhm_nm) = (self.filter_centre_nm + shift_nm, self.filter_fwhm_nm);
        breaks.extend((-16..=16).map(|k| centre_nm + f64::from(k) * fwhm_nm / 4.0));
        let own = |curve: &Curve| -> Vec<f64> { curve.points.iter().map(|[nm, _]| *nm).collect() };
        if let CurveSetting::Curve(curve) = &self.filter {
            breaks.extend(own(curve).iter().map(|nm| nm + shift_nm));
        }
        if let CurveSetting::Curve(curve) = &self.pde_curve {
            breaks.extend(own(curve));
        }
        breaks.retain(|nm| (from..=to).contains(nm));
        breaks.sort_by(f64::total_cmp);
        let density = |nm: f64| {
            let passed = self.filter_at(nm).unwrap_or(0.0) * self.relative_pde(nm);
            spectral_irradiance(nm) * passed * nm / self.warm_wavelength_nm()
        };
        integrate(density, &breaks, 1e-10)
    }

    /// Standard deviation of the SPADs' Gaussian jitter, s.
    pub(super) fn spad_jitter_s(&self) -> f64 {
        self.spad_jitter_fwhm_ps * 1e-12 / (8.0 * LN_2).sqrt()
    }

    /// Avalanches that are late, if any.
    fn diffusion_tail(&self) -> Option<DiffusionTail> {
        let time = Time::from_s(self.spad_tail_ps * 1e-12);
        let is_there = self.spad_tail_share > 0.0 && time > Time::ZERO;
        is_there.then_some(DiffusionTail {
            share: self.spad_tail_share,
            time,
        })
    }

    /// What a file may not ask for, beyond the range of each key.
    pub(super) fn fault(&self) -> Option<Fault> {
        let fault = |key: &str, message: String| Some(Fault::new(format!("lidar.{key}"), message));
        let nm = self.warm_wavelength_nm();
        if self.laser_transmission() <= 0.0 {
            let message = format!(
                "filter lets nothing of the laser's {nm} nm through at {} C; give another filter_centre_nm, filter or wavelength_nm",
                self.temperature_c
            );
            return fault("filter", message);
        }
        if self.pulse_energy_uj > 0.0 && self.warm_pulse_j() == 0.0 {
            let message = format!(
                "pulse_energy_drift_1_k = {} leaves no light of the laser at {} C; give a smaller one",
                self.pulse_energy_drift_1_k, self.temperature_c
            );
            return fault("pulse_energy_drift_1_k", message);
        }
        if self.spad_tail_share > 0.0 && self.spad_tail_ps == 0.0 {
            let message =
                "spad_tail_share means nothing without a time constant; give spad_tail_ps, too";
            return fault("spad_tail_share", message.into());
        }
        if let CurveSetting::Curve(curve) = &self.filter
            && curve.greatest() > 1.0
        {
            let message = format!(
                "filter has a transmittance of {}; give 0 to 1",
                curve.greatest()
            );
            return fault("filter", message);
        }
        if let CurveSetting::Curve(curve) = &self.pde_curve
            && let Some(nm) = [self.wavelength_nm, nm]
                .into_iter()
                .find(|&nm| curve.interpolate(nm).unwrap_or(0.0) <= 0.0)
        {
            let message = format!(
                "pde_curve has no detection efficiency at the laser's {nm} nm; give a curve that does"
            );
            return fault("pde_curve", message);
        }
        for (key, curve) in [
            ("beam", self.beam.curve()),
            ("vignetting", self.vignetting.curve()),
        ] {
            if let Some(curve) = curve
                && !(curve.ends().0 == 0.0 && curve.ends().1 <= 90.0)
            {
                let message = format!(
                    "{key} has angles from {} to {} degrees; give them from 0, the axis, to at most 90",
                    curve.ends().0,
                    curve.ends().1
                );
                return fault(key, message);
            }
        }
        if let Some(curve) = self.stray.curve()
            && (curve.ends().0 != 0.0 || curve.points[0][1] <= 0.0)
        {
            let (first, last) = curve.ends();
            let message = format!(
                "stray has distances from {first} to {last}; give them from 0 on, with light there"
            );
            return fault("stray", message);
        }
        if let Some(curve) = self.pulse.curve() {
            let (first, last) = curve.ends();
            if !(1e-3..=1e6).contains(&(last - first)) {
                let message = format!("pulse lasts {} ns; give 0.001 to 1e6 ns", last - first);
                return fault("pulse", message);
            }
        }
        None
    }

    /// Intensity of the beam at an angle off the axis, in any unit; `None` for one that gives all macropixels the same.
    pub(super) fn beam_at(&self, angle_rad: f64) -> Option<f64> {
        match &self.beam {
            CurveSetting::Word(BeamWord::Uniform) => None,
            CurveSetting::Word(BeamWord::Gaussian) => {
                let half_widths = 2.0 * angle_rad.to_degrees() / self.beam_fwhm_deg;
                Some(libm::exp(
                    -std::f64::consts::LN_2 * half_widths * half_widths,
                ))
            }
            CurveSetting::Curve(curve) => {
                Some(curve.interpolate(angle_rad.to_degrees()).unwrap_or(0.0))
            }
        }
    }

    /// The whole beam: its intensity over all directions.
    pub(super) fn beam_total(&self) -> f64 {
        let mut breaks = vec![0.0, PI / 2.0];
        match self.beam.curve() {
            Some(curve) => breaks.extend(curve.points.iter().map(|[deg, _]| deg.to_radians())),
            None => {
                breaks.extend((1..16).map(|k| f64::from(k) * self.beam_fwhm_deg.to_radians() / 4.0))
            }
        }
        breaks.retain(|angle| (0.0..=PI / 2.0).contains(angle));
        breaks.sort_by(f64::total_cmp);
        let ring = |angle: f64| self.beam_at(angle).unwrap_or(0.0) * 2.0 * PI * libm::sin(angle);
        integrate(ring, &breaks, 1e-10)
    }

    /// Relative illumination at an angle off the axis.
    fn illumination_at(&self, cosine: f64) -> Option<f64> {
        match &self.vignetting {
            CurveSetting::Word(VignettingWord::None) => None,
            CurveSetting::Word(VignettingWord::Cos4) => Some(cosine.powi(4)),
            CurveSetting::Curve(curve) => {
                let [[_, middle], ..] = curve.points[..] else {
                    return Some(0.0);
                };
                let at = curve
                    .interpolate(libm::acos(cosine).to_degrees())
                    .unwrap_or(0.0);
                Some(at / middle.max(f64::MIN_POSITIVE))
            }
        }
    }
}

impl Scene {
    /// The photon budget of one macropixel of a `rows` × `cols` array behind this lens.
    ///
    /// The pitch is the one that fits the array into the field of view.
    pub fn photon_budget(&self, rows: u32, cols: u32) -> PhotonBudget {
        let lidar = &self.lidar;
        let lens_diameter_m = lidar.lens_diameter_mm * 1e-3;
        let lens_focal_m = lens_diameter_m * lidar.lens_f_number;
        let camera = self.lidar_camera(rows, cols);
        PhotonBudget {
            pde: lidar.warm_pde(),
            wavelength_nm: lidar.warm_wavelength_nm(),
            transmittance: lidar.transmittance * lidar.laser_transmission(),
            pulse_energy_j: lidar.warm_pulse_j(),
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

    /// The light of every macropixel of `camera` relative to one on the axis of a uniform beam, row by row.
    pub(super) fn off_axis(&self, camera: &PinholeCamera) -> Vec<OffAxis> {
        let lidar = &self.lidar;
        let pitch = [1.0 / camera.focal_px, 1.0 / camera.focal_v_px];
        let uniform = lidar
            .spot
            .share_per_pixel(camera.height, camera.width, pitch);
        let total = lidar.beam.curve().is_some() || lidar.beam != CurveSetting::default();
        let total = total.then(|| lidar.beam_total());
        let pixels =
            (0..camera.height).flat_map(|row| (0..camera.width).map(move |col| (row, col)));
        let pixel_optics = |(row, col): (u32, u32)| {
            let ray = camera.at_unit_depth((f64::from(col) + 0.5, f64::from(row) + 0.5));
            let cosine = 1.0 / ray.length();
            let cube = cosine.powi(3);
            let beam = total.map_or(1.0, |total| {
                let solid_angle = cube * pitch[0] * pitch[1];
                lidar.beam_at(libm::acos(cosine)).unwrap_or(1.0) * solid_angle / total / uniform
            });
            let lens = lidar.illumination_at(cosine);
            OffAxis {
                signal: beam * lens.map_or(1.0, |lens| lens / cube),
                background: lens.unwrap_or(1.0),
            }
        };
        pixels.map(pixel_optics).collect()
    }

    /// The measured laser pulse, whose times add to those of the Gaussian; `None` for a Gaussian alone.
    fn measured_pulse(&self) -> Option<PulseShape> {
        let curve = self.lidar.pulse.curve()?;
        let (first, last) = curve.ends();
        let points = &curve.points;
        let step_ns = points[1][0] - points[0][0];
        let is_even = points.windows(2).all(|pair| {
            let own = pair[1][0] - pair[0][0];
            (own - step_ns).abs() <= 1e-6 * step_ns
        });
        let samples = if is_even { points.len() } else { PULSE_SAMPLES };
        let step_ns = (last - first) / (samples - 1) as f64;
        let power = |n: usize| {
            curve
                .interpolate((first + n as f64 * step_ns).min(last))
                .unwrap_or(0.0)
        };
        let powers: Vec<f64> = (0..samples).map(power).collect();
        let step = Time::from_s(step_ns * 1e-9);
        PulseShape::new(step, &powers).ok()
    }

    /// What is detected of the laser pulse, whose times add to those of the Gaussian: the measured pulse, and late avalanches; `None` for a
    /// Gaussian alone.
    pub(crate) fn pulse_shape(&self) -> Option<PulseShape> {
        let measured = self.measured_pulse();
        match self.lidar.diffusion_tail() {
            Some(tail) => Some(tail.shape(measured.as_ref(), self.pulse_sigma())),
            None => measured,
        }
    }

    /// The lidar's key by which what is detected of a pulse is not Gaussian, if it is not.
    pub fn not_gaussian(&self) -> Option<&'static str> {
        let is_measured = self.lidar.pulse.curve().is_some();
        let measured = is_measured.then_some("pulse");
        measured.or_else(|| self.lidar.diffusion_tail().map(|_| "spad_tail_share"))
    }

    /// How wide the echo of one place is, for ranging.
    pub fn echo_width(&self) -> EchoWidth {
        EchoWidth {
            sigma: self.pulse_resolution(),
            tail: self.lidar.diffusion_tail(),
            is_gaussian: self.skewness_and_kurtosis().is_none(),
            energy_spread: self.lidar.pulse_energy_spread,
            pde_spread: self.lidar.pde_spread,
        }
    }

    /// Those of a measured pulse that is far from a Gaussian.
    fn skewness_and_kurtosis(&self) -> Option<(f64, f64)> {
        let pulse = self.measured_pulse()?;
        let (skewness, kurtosis) = pulse.skewness_and_kurtosis(self.pulse_sigma());
        let is_near = skewness.abs() <= MOST_SKEWNESS && kurtosis.abs() <= MOST_KURTOSIS;
        (!is_near).then_some((skewness, kurtosis))
    }

    /// What follows from such a pulse.
    pub(super) fn remark_on_pulse(&self) -> Option<String> {
        let (skewness, kurtosis) = self.skewness_and_kurtosis()?;
        Some(format!(
            "in [lidar], pulse is far from a Gaussian (skewness {skewness:.2}, excess kurtosis {kurtosis:.2}); depths are centres of mass without a bound"
        ))
    }

    /// A photon stream with the measured laser pulse, if there is one, and the spread of its energy.
    pub fn with_pulse(&self, config: StreamConfig) -> StreamConfig {
        let pulse_shape = self.pulse_shape();
        StreamConfig {
            pulse_shape,
            energy_spread: self.lidar.pulse_energy_spread,
            ..config
        }
    }

    /// Standard deviation of the whole laser pulse, measured shape and all jitter, without late avalanches.
    pub fn pulse_resolution(&self) -> Time {
        let sigma_fs = self.pulse_sigma().as_fs() as f64;
        let own_fs2 = self
            .measured_pulse()
            .map_or(0.0, |shape| shape.variance_fs2());
        Time::from_fs((sigma_fs * sigma_fs + own_fs2).sqrt().round() as i64)
    }
}

#[cfg(test)]
mod tests;
