//! What a macropixel sees of the light of other lidars.
//!
//! ```text
//!   another lidar ──────────────── straight into the lens ───────────────► one macropixel: 10⁵ photons a pulse
//!        ╲ beam
//!         ╲──────► surface ─────── reflected as sunlight is ─────────────► many: as strong as our own echo
//! ```
//!
//! A surface that a lidar of E/Ω joules a steradian lights at a distance d gets E/Ω · cos θ / d², and the lens as much over its aperture.
//! Light of another wavelength than ours goes through our filter, and meets the detection efficiency that SPADs have there. Mirrors and
//! retroreflectors do not send others' light to us, panes between stop it, and neighbouring macropixels' crosstalk of it is left out; stray
//! light ([`stray_light`](super::stray_light)) is not.
//!
//! That guiding and dithering mitigate this interference is claimed at the end of the thesis (8.2), and not measured there.

use glam::DVec3;

use super::cast::Stage;
use super::daylight::ABOVE_M;
use super::interferer::NEAREST_M;
use super::settings::Scene;
use super::vector::Ray;
use crate::photon::{PhotonBudget, PulseTrain};
use crate::units::{SPEED_OF_LIGHT_M_PER_S, Time};

/// Trains of fewer photons a pulse are left out: 10⁶ pulses send one of ten thousand macropixels such a photon.
const LEAST_PHOTONS: f64 = 1e-10;

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
