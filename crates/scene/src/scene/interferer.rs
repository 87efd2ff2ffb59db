//! Lidars of others: where they are, and what they send.
//!
//! Each sends the same energy into every direction within its beam, a pyramid, and nothing beyond: E/Ω joules a steradian with
//! Ω = 4 asin(sin(w/2) sin(h/2)) for a beam of w by h. Its wavelength is ours unless given, so that no filter helps: the worst case.
//! What macropixels see of it is in [`others_light`](super::others_light).

use glam::DVec3;

use super::vector::turned;
use super::words::{DITHER_NS, ENERGY_UJ, FWHM_NS, NEAR_M, POSITION, SPEED, SPEEDS};
use crate::photon::OtherLaser;
use crate::settings::Range::{Above, Limited, Within};
use crate::settings::{Fault, keys};

/// No lidar is nearer to ours than that, m: it would be in its lens.
pub(super) const NEAREST_M: f64 = 0.05;

keys! {
    /// An `[[interferer]]` entry: the lidar of another vehicle.
    pub struct Interferer {
        /// Name in messages and for --set.
        name: String = String::new(), from "-";
        /// Where it is, [right, down, forward] of the lidar.
        place_m: DVec3 ["m"] = DVec3::ZERO, in POSITION, usually NEAR_M, from "-";
        /// Which way it looks, to the right of forward; 180 looks back at us.
        yaw_deg: f64 ["deg"] = 180.0, in Within(-360.0, 360.0), from "chosen: oncoming";
        /// How far upwards it looks.
        pitch_deg: f64 ["deg"] = 0.0, in Within(-90.0, 90.0);
        /// Full width of its beam.
        beam_width_deg: f64 ["deg"] = 16.0, in Above(0.0, 180.0), from "chosen: a fifth of the street's lidar";
        /// Full height of its beam.
        beam_height_deg: f64 ["deg"] = 16.0, in Above(0.0, 180.0), from "chosen: as the street's lidar";
        /// Pulses per second.
        rate_hz: f64 ["Hz"] = 80e3, in Within(1.0, 1e7), usually (100.0, 1e7), from "thesis Table 14, the demonstrator";
        /// How much faster its clock is than ours, parts per million.
        drift_ppm: f64 = 0.0, in Within(-1e5, 1e5), from "chosen: the worst case; crystals keep 20";
        /// Longest random delay of each of its pulses.
        dither_ns: f64 ["ns"] = 0.0, in Within(0.0, 1e9), usually DITHER_NS, from "none";
        /// When it sends a pulse, as a share of its period after the exposure begins; drawn from the frame's seed if left out.
        #[serde(skip_serializing_if = "Option::is_none")]
        phase: Option<f64> = None, in Within(0.0, 1.0), from "-";
        /// Energy of one pulse.
        pulse_energy_uj: f64 ["uJ"] = 20.0,
            in Limited(0.0, 1e6, "lasers of flash lidars stay below 1 J a pulse"), usually ENERGY_UJ,
            from "chosen: as the street's lidar";
        /// Full width at half maximum of its Gaussian pulse.
        pulse_fwhm_ns: f64 ["ns"] = 4.5, in Within(0.0, 1e6), usually FWHM_NS, from "thesis 6.4.2";
        /// Wavelength of its laser, whose spectrum is as wide as ours; ours if left out. Needs a filter other than irradiance.
        #[serde(skip_serializing_if = "Option::is_none")]
        wavelength_nm: Option<f64> ["nm"] = None, in Within(100.0, 1e4), from "chosen: ours, the worst case";
        /// Velocity in the world, [right, down, forward].
        velocity_m_s: DVec3 ["m/s"] = DVec3::ZERO, in SPEED, usually SPEEDS, from "at rest";
    }
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
    pub(super) fn law(&self, number: u32, own_dither_ns: f64) -> OtherLaser {
        OtherLaser {
            number,
            period_s: 1.0 / (self.rate_hz * (1.0 + self.drift_ppm * 1e-6)),
            phase: self.phase,
            dither_s: self.dither_ns * 1e-9,
            own_dither_s: own_dither_ns * 1e-9,
        }
    }

    /// Energy that a pulse sends towards a point, J/sr.
    pub(super) fn intensity_j_sr(&self, point: DVec3) -> f64 {
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
        if is_within {
            self.pulse_energy_uj * 1e-6 / solid_angle_sr
        } else {
            0.0
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
