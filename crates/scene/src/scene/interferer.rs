//! Lidars of others: what they send, and what of it a macropixel sees.
//!
//! ```text
//!   another lidar ──────────────── straight into the lens ───────────────► one macropixel: 10⁵ photons a pulse
//!        ╲ beam
//!         ╲──────► surface ─────── reflected as sunlight is ─────────────► many: as strong as our own echo
//! ```
//!
//! It sends the same energy into every direction within its beam, a pyramid, and nothing beyond: E/Ω joules a steradian with
//! Ω = 4 asin(sin(w/2) sin(h/2)) for a beam of w by h. A surface that it lights at a distance d gets E/Ω · cos θ / d², and the lens as
//! much over its aperture. Its wavelength is ours unless given, so that no filter helps: the worst case. Another one goes through our filter
//! and meets the detection efficiency that SPADs have there. Mirrors and retroreflectors do
//! not send its light to us, panes between stop it, and neighbouring macropixels' crosstalk of it is left out; stray light
//! ([`stray_light`](super::stray_light)) is not.
//!
//! That guiding and dithering mitigate this interference is claimed at the end of the thesis (8.2), and not measured there.

use glam::DVec3;

use super::cast::Stage;
use super::daylight::ABOVE_M;
use super::settings::Scene;
use super::vector::{Ray, turned};
use super::words::{POSITION, SPEED};
use crate::photon::{OtherLaser, PhotonBudget, PulseTrain};
use crate::settings::Range::{Above, Limited, Within};
use crate::settings::{Fault, keys};
use crate::units::{SPEED_OF_LIGHT_M_PER_S, Time};

/// No lidar is nearer to ours than that, m: it would be in its lens.
const NEAREST_M: f64 = 0.05;

/// Trains of fewer photons a pulse are left out: 10⁶ pulses send one of ten thousand macropixels such a photon.
const LEAST_PHOTONS: f64 = 1e-10;

keys! {
    /// An `[[interferer]]` entry: the lidar of another vehicle.
    pub struct Interferer {
        /// Name in messages and for --set.
        name: String = String::new(), from "-";
        /// Where it is, [right, down, forward] of the lidar.
        place_m: DVec3 ["m"] = DVec3::ZERO, in POSITION, from "-";
        /// Which way it looks, to the right of forward; 180 looks back at us.
        yaw_deg: f64 ["deg"] = 180.0, in Within(-360.0, 360.0), from "chosen: oncoming";
        /// How far upwards it looks.
        pitch_deg: f64 ["deg"] = 0.0, in Within(-90.0, 90.0);
        /// Full width of its beam.
        beam_width_deg: f64 ["deg"] = 16.0, in Above(0.0, 180.0), from "chosen: a fifth of the street's lidar";
        /// Full height of its beam.
        beam_height_deg: f64 ["deg"] = 16.0, in Above(0.0, 180.0), from "chosen: as the street's lidar";
        /// Pulses per second.
        rate_hz: f64 ["Hz"] = 80e3, in Within(1.0, 1e7), from "thesis Table 14, the demonstrator";
        /// How much faster its clock is than ours, parts per million.
        drift_ppm: f64 = 0.0, in Within(-1e5, 1e5), from "chosen: the worst case; crystals keep 20";
        /// Longest random delay of each of its pulses.
        dither_ns: f64 ["ns"] = 0.0, in Within(0.0, 1e9), from "none";
        /// When it sends a pulse, as a share of its period after the exposure begins; drawn from the frame's seed if left out.
        #[serde(skip_serializing_if = "Option::is_none")]
        phase: Option<f64> = None, in Within(0.0, 1.0), from "-";
        /// Energy of one pulse.
        pulse_energy_uj: f64 ["uJ"] = 20.0,
            in Limited(0.0, 1e6, "lasers of flash lidars stay below 1 J a pulse"),
            from "chosen: as the street's lidar";
        /// Full width at half maximum of its Gaussian pulse.
        pulse_fwhm_ns: f64 ["ns"] = 4.5, in Within(0.0, 1e6), from "thesis 6.4.2";
        /// Wavelength of its laser, whose spectrum is as wide as ours; ours if left out. Needs a filter other than irradiance.
        #[serde(skip_serializing_if = "Option::is_none")]
        wavelength_nm: Option<f64> ["nm"] = None, in Within(100.0, 1e4), from "chosen: ours, the worst case";
        /// Velocity in the world, [right, down, forward].
        velocity_m_s: DVec3 ["m/s"] = DVec3::ZERO, in SPEED, from "at rest";
    }
}

/// What a macropixel gets of each pulse of another lidar by way of one object, or straight into the lens.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct OtherLight {
    interferer: u32,
    /// `None` for the way straight into the lens.
    object: Option<usize>,
    /// Exposure that a white surface would need to send as much, or that of the lens, J/m².
    exposure_j_m2: f64,
    /// Mean of the whole way and of its square, by the light that takes it.
    way_m: [f64; 2],
}

impl Interferer {
    /// What is impossible beyond the range of each key.
    pub(super) fn fault(&self, path: &str) -> Option<Fault> {
        let fault = |key: &str, message: String| {
            let path = format!("{path}.{key}");
            Some(Fault { path, message })
        };
        if self.place_m.length() < NEAREST_M {
            let message = format!(
                "place_m is where the sensor itself is; give one at least {NEAREST_M} m away"
            );
            return fault("place_m", message);
        }
        let period_ns = self.law(0, 0.0).period_s * 1e9;
        if self.dither_ns >= period_ns {
            let message = format!(
                "dither_ns = {} is impossible; give less than the {period_ns} ns from pulse to pulse",
                self.dither_ns
            );
            return fault("dither_ns", message);
        }
        None
    }

    /// When it sends its pulses, as interferer number `number`, where we wait `own_dither_ns` at most before ours.
    fn law(&self, number: u32, own_dither_ns: f64) -> OtherLaser {
        OtherLaser {
            number,
            period_s: 1.0 / (self.rate_hz * (1.0 + self.drift_ppm * 1e-6)),
            phase: self.phase,
            dither_s: self.dither_ns * 1e-9,
            own_dither_s: own_dither_ns * 1e-9,
        }
    }

    /// Energy that a pulse sends towards a point, J/sr.
    fn intensity_j_sr(&self, point: DVec3) -> f64 {
        let (pitch_sine, pitch_cosine) = libm::sincos(self.pitch_deg.to_radians());
        let (sine, cosine) = libm::sincos(self.yaw_deg.to_radians());
        // As it sees the point: right, down and forward of itself.
        let level = turned(point - self.place_m, (cosine, -sine));
        let forward = level.z * pitch_cosine - level.y * pitch_sine;
        let down = level.y * pitch_cosine + level.z * pitch_sine;
        let half = |full_deg: f64| 0.5 * full_deg.to_radians();
        let (half_width, half_height) = (half(self.beam_width_deg), half(self.beam_height_deg));
        let is_within = libm::atan2(level.x, forward).abs() <= half_width
            && libm::atan2(down, forward).abs() <= half_height;
        let solid_angle_sr = 4.0 * libm::asin(libm::sin(half_width) * libm::sin(half_height));
        match is_within {
            true => self.pulse_energy_uj * 1e-6 / solid_angle_sr,
            false => 0.0,
        }
    }

    /// Where it is, and which way it looks, as seen from a rig at `position_m` that has turned to the right by `yaw_deg`.
    pub(super) fn seen_from(&self, time_s: f64, position_m: DVec3, yaw_deg: f64) -> Self {
        let (sine, cosine) = libm::sincos(yaw_deg.to_radians());
        let place_m = self.place_m + self.velocity_m_s * time_s - position_m;
        Interferer {
            place_m: turned(place_m, (cosine, -sine)),
            yaw_deg: self.yaw_deg - yaw_deg,
            velocity_m_s: DVec3::ZERO,
            ..self.clone()
        }
    }
}

impl Stage<'_> {
    /// Adds what a surface at `place_m` that faces along `normal` (unit) reflects of others' pulses. `reflected` of the light that
    /// it reflects arrives after `range_m` more.
    pub(super) fn add_others(
        &self,
        (place_m, normal): (DVec3, DVec3),
        object: usize,
        reflected: f64,
        range_m: f64,
        others: &mut Vec<OtherLight>,
    ) {
        for (interferer, other) in (0..).zip(&self.scene.interferers) {
            let to = other.place_m - place_m;
            let (distance_m, incidence) = (to.length(), normal.dot(to.normalize_or_zero()));
            let sent = other.intensity_j_sr(place_m);
            let from = place_m + normal * ABOVE_M;
            if incidence <= 0.0 || sent == 0.0 || self.is_between(from, other.place_m) {
                continue;
            }
            let left = self.scene.medium.transmission(distance_m);
            let exposure_j_m2 = reflected * left * sent * incidence / (distance_m * distance_m);
            let way_m = range_m + distance_m;
            let object = Some(object);
            let same = |s: &&mut OtherLight| s.interferer == interferer && s.object == object;
            match others.iter_mut().find(same) {
                Some(other_light) => other_light.add(exposure_j_m2, way_m),
                None => others.push(OtherLight {
                    interferer,
                    object,
                    exposure_j_m2,
                    way_m: [way_m, way_m * way_m],
                }),
            }
        }
    }

    /// What of others' pulses comes straight into the lens and falls where `is_here` says.
    pub(super) fn add_straight(
        &self,
        is_here: impl Fn(DVec3) -> bool,
        others: &mut Vec<OtherLight>,
    ) {
        for (interferer, other) in (0..).zip(&self.scene.interferers) {
            let sent = other.intensity_j_sr(DVec3::ZERO);
            if sent == 0.0 || !is_here(other.place_m) || self.is_between(DVec3::ZERO, other.place_m)
            {
                continue;
            }
            let way_m = other.place_m.length();
            let left = self.scene.medium.transmission(way_m);
            let cosine = other.place_m.z / way_m;
            others.push(OtherLight {
                interferer,
                object: None,
                exposure_j_m2: left * sent * cosine / (way_m * way_m),
                way_m: [way_m, way_m * way_m],
            });
        }
    }

    /// Whether something opaque is between two points.
    fn is_between(&self, from: DVec3, to: DVec3) -> bool {
        let way = to - from;
        let met_m = self.range_to_hit(&Ray::new(from, way));
        met_m.is_some_and(|met_m| met_m < way.length() - NEAREST_M)
    }
}

impl OtherLight {
    fn add(&mut self, exposure_j_m2: f64, way_m: f64) {
        self.exposure_j_m2 += exposure_j_m2;
        let share = exposure_j_m2 / self.exposure_j_m2;
        for (mean, value) in self.way_m.iter_mut().zip([way_m, way_m * way_m]) {
            *mean += share * (value - *mean);
        }
    }

    /// What of it is detected; `lens` is the relative illumination of the macropixel.
    pub(super) fn train(
        &self,
        scene: &Scene,
        budget: &PhotonBudget,
        lens: f64,
    ) -> Option<PulseTrain> {
        let other = &scene.interferers[self.interferer as usize];
        let detected = (other.wavelength_nm).map_or(1.0, |nm| scene.lidar.detected_beside_own(nm));
        let photons = detected
            * match self.object {
                Some(_) => budget.photons_of_exposure(self.exposure_j_m2) * lens,
                None => budget.photons_through_lens(self.exposure_j_m2),
            };
        let [way_m, square_m2] = self.way_m;
        let of_way_s2 = (square_m2 - way_m * way_m).max(0.0) / SPEED_OF_LIGHT_M_PER_S.powi(2);
        let pulse_s = other.pulse_fwhm_ns * 1e-9 / (8.0 * std::f64::consts::LN_2).sqrt();
        let jitter_s = scene.lidar.spad_jitter_s();
        (photons > LEAST_PHOTONS).then(|| PulseTrain {
            laser: other.law(self.interferer, scene.lidar.dither_ns),
            photons,
            delay: Time::from_s(way_m / SPEED_OF_LIGHT_M_PER_S),
            sigma: Time::from_s((pulse_s * pulse_s + jitter_s * jitter_s + of_way_s2).sqrt()),
        })
    }
}

#[cfg(test)]
mod tests;
