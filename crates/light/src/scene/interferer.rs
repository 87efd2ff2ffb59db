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
        beam_width_deg: f64 ["deg"] = 16.0, in Above(0.0, 180.0), from "chosen: as the street's lidar";
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
mod tests {
    use super::*;
    use crate::photon::{PhotonStream, PixelLight, SpadModel, StreamConfig};
    use crate::scene::{GroundTruth, Object, Shape};
    use crate::units::Frequency;

    fn other(keys: &str) -> Interferer {
        let text = format!("[[interferer]]\nname = \"other\"\n{keys}\n");
        Scene::parse("test", &text).unwrap().interferers.remove(0)
    }

    /// The street's optics before a wall of this reflectivity, 40 m ahead, with another lidar.
    fn before_a_wall(reflectivity: f64, keys: &str) -> Scene {
        let mut scene = Scene::outdoor();
        let shape = Shape::Plane {
            centre_m: DVec3::new(0.0, 0.0, 40.0),
            normal: DVec3::NEG_Z,
            width_m: 100.0,
            height_m: 100.0,
        };
        scene.objects = vec![Object::new("wall", reflectivity, shape)];
        scene.interferers = vec![other(keys)];
        scene
    }

    fn others(scene: &Scene, across: u32) -> Vec<Vec<PulseTrain>> {
        let truth = GroundTruth::render(scene, across, across);
        let budget = scene.photon_budget(across, across);
        let of = |view: &std::sync::Arc<crate::scene::view::View>| {
            let others = view.others.iter();
            others
                .filter_map(|s| s.train(scene, &budget, 1.0))
                .collect()
        };
        truth.views.iter().map(of).collect()
    }

    #[test]
    fn all_of_a_pulse_is_in_its_beam() {
        let keys = "place_m = [3, -1, 20]\nyaw_deg = 130\npitch_deg = -20\nbeam_width_deg = 50\nbeam_height_deg = 24";
        let other = other(keys);
        let (steps, mut sent_j) = (800, 0.0);
        for (row, col) in (0..steps).flat_map(|row| (0..2 * steps).map(move |col| (row, col))) {
            let step = std::f64::consts::PI / f64::from(steps);
            let (theta, phi) = ((f64::from(row) + 0.5) * step, (f64::from(col) + 0.5) * step);
            let direction = DVec3::new(
                theta.sin() * phi.cos(),
                theta.cos(),
                theta.sin() * phi.sin(),
            );
            let point = other.place_m + 7.0 * direction;
            sent_j += other.intensity_j_sr(point) * theta.sin() * step * step;
        }
        assert!((sent_j / 20e-6 - 1.0).abs() < 5e-3, "{sent_j}");
        let ahead = other.place_m
            + turned(
                DVec3::Z,
                (130f64.to_radians().cos(), 130f64.to_radians().sin()),
            );
        let down = DVec3::new(0.0, 20f64.to_radians().tan(), 0.0);
        assert_eq!(other.intensity_j_sr(ahead), 0.0);
        assert!(other.intensity_j_sr(ahead + down) > 0.0);
    }

    /// A lidar like ours beside ours sends a macropixel what ours does, and as late.
    #[test]
    fn a_lidar_beside_ours_with_our_beam_makes_our_echo() {
        let own_beam = Scene::outdoor().lidar.fov_deg;
        let keys = format!(
            "place_m = [0.05, 0, 0]\nyaw_deg = 0\nbeam_width_deg = {own_beam}\nbeam_height_deg = {own_beam}"
        );
        let scene = before_a_wall(0.3, &keys);
        let truth = GroundTruth::render(&scene, 16, 16);
        let lights = scene.pixel_light(&truth);
        let middle = 8 * 16 + 8;
        let own = lights[middle].signal_per_cycle();
        let [train] = others(&scene, 16)[middle][..] else {
            panic!("one train");
        };
        // A uniform beam fills the plane field of view, and a pyramid its solid angle: 0.7 % less on the axis.
        assert!(
            (train.photons / own - 1.0).abs() < 0.02,
            "{} {own}",
            train.photons
        );
        let off = train.delay - lights[middle].arrival();
        assert!(off.as_ns().abs() < 0.05, "{off}");
    }

    #[test]
    fn a_lidar_that_looks_at_us_shines_into_one_macropixel_as_its_intensity_says() {
        let scene = before_a_wall(0.3, "place_m = [1.0, 0.5, 30]");
        let all = others(&scene, 16);
        let lit: Vec<_> = all.iter().flatten().collect();
        // The wall is behind it.
        let [train] = lit[..] else {
            panic!("{} trains", lit.len());
        };
        let half = 8f64.to_radians().sin();
        let intensity_j_sr = 20e-6 / (4.0 * (half * half).asin());
        let range_m = DVec3::new(1.0, 0.5, 30.0).length();
        let aperture_m2 = std::f64::consts::PI * 0.002f64.powi(2);
        let joules = intensity_j_sr * aperture_m2 * (30.0 / range_m) / (range_m * range_m);
        let photon_j = 6.626_070_15e-34 * 299_792_458.0 / 940e-9;
        let expected = 0.185 * joules / photon_j;
        assert!(
            (train.photons / expected - 1.0).abs() < 1e-9,
            "{} {expected}",
            train.photons
        );
        assert!((train.delay.as_s() * 299_792_458.0 - range_m).abs() < 1e-6);
        let mut hidden = scene.clone();
        hidden.interferers[0].place_m.z = 41.0;
        assert!(others(&hidden, 16).iter().all(Vec::is_empty));
        hidden.interferers[0] = other("place_m = [1.0, 0.5, 30]\nyaw_deg = 90");
        assert!(others(&hidden, 16).iter().all(Vec::is_empty));
    }

    /// Another wavelength gets through our filter as much as the filter says, and meets the efficiency that SPADs have there.
    #[test]
    fn another_wavelength_meets_our_filter() {
        let photons = |lidar: &str, keys: &str| -> f64 {
            let text = format!(
                "[lidar]\n{lidar}\n[[interferer]]\nname = \"car\"\nplace_m = [1.0, 0.5, 30]\n{keys}\n"
            );
            let mut scene = Scene::parse("test", &text).unwrap();
            let interferers = std::mem::take(&mut scene.interferers);
            let street = before_a_wall(0.3, "place_m = [1.0, 0.5, 30]");
            let scene = Scene {
                interferers,
                lidar: scene.lidar,
                ..street
            };
            others(&scene, 16)
                .iter()
                .flatten()
                .map(|train| train.photons)
                .sum()
        };
        let gaussian = "filter = \"gaussian\"\nfilter_fwhm_nm = 20";
        let own = photons(gaussian, "");
        assert_eq!(photons(gaussian, "wavelength_nm = 940"), own);
        // 35 nm are 1.75 widths off the centre; a photon of 905 nm has more energy.
        let expected = 0.5f64.powf(3.5 * 3.5) * 905.0 / 940.0;
        let found = photons(gaussian, "wavelength_nm = 905") / own;
        assert!((found / expected - 1.0).abs() < 1e-9, "{found} {expected}");
        assert_eq!(photons("filter = \"top_hat\"", "wavelength_nm = 905"), 0.0);
        let curves = "filter = [[890, 0.1], [950, 0.1], [960, 1.0]]\npde_curve = [[900, 0.4], [905, 0.4], [940, 0.1], [960, 0.1]]";
        let found = photons(curves, "wavelength_nm = 905") / photons(curves, "");
        assert!(
            (found / (4.0 * 905.0 / 940.0) - 1.0).abs() < 1e-9,
            "{found}"
        );
        // Our laser drifts with the temperature, theirs is where it is.
        let warm = photons(
            &format!("{gaussian}\ntemperature_c = 105"),
            "wavelength_nm = 946.4",
        );
        assert_eq!(
            warm,
            photons(&format!("{gaussian}\ntemperature_c = 105"), "")
        );
        let keys = "[[interferer]]\nname = \"car\"\nplace_m = [0, 0, 9]\nwavelength_nm = 905\n";
        let fault = Scene::parse("test", keys).unwrap_err().to_string();
        assert!(
            fault.contains("in [[interferer]] number 1 (car)")
                && fault.contains("lidar.filter is irradiance"),
            "{fault}"
        );
    }

    /// Arrivals in the laser cycle of a laser of our rate, of one whose clock is fast, and where either laser dithers.
    #[test]
    fn a_laser_of_our_rate_stands_still_until_a_clock_drifts_or_a_laser_dithers() {
        const CYCLES: u32 = 4000;
        let stream = |seed| {
            PhotonStream::new(&StreamConfig {
                seed,
                clock: Frequency::from_hz(80_000_000),
                stop_periods: 1000,
                laser_cycles: CYCLES,
                lead: Time::ZERO,
                pulse_sigma: Time::from_ns(1),
                pulse_shape: None,
                energy_spread: 0.0,
                spads: SpadModel::with_dead_time(Time::from_ns(8)),
            })
        };
        let times_ns = |keys: &str, own_dither_ns: f64, seed: u64| -> Vec<f64> {
            let other = other(&format!("place_m = [0, 0, 30]\npulse_fwhm_ns = 0\n{keys}"));
            let train = PulseTrain {
                laser: other.law(0, own_dither_ns),
                // The first photon on each SPAD of every pulse.
                photons: 1e4,
                delay: Time::from_ns(100),
                sigma: Time::ZERO,
            };
            let light = PixelLight::dark().with_train(train);
            let events = stream(seed).pixel_events(0, &light).events;
            let first = events.chunk_by(|a, b| a.time == b.time).map(|all| {
                assert_eq!(all.len(), 16);
                all[0].time
            });
            first
                .map(|time| time.as_ns().rem_euclid(12_500.0))
                .collect()
        };
        let spread = |times_ns: &[f64]| {
            let ends = times_ns
                .iter()
                .fold((f64::MAX, 0f64), |(a, b), &t| (a.min(t), b.max(t)));
            ends.1 - ends.0
        };
        let still = times_ns("phase = 0.25", 0.0, 1);
        assert_eq!(still.len(), CYCLES as usize);
        assert!(
            still.iter().all(|ns| (ns - 3225.0).abs() < 1e-3),
            "{:?}",
            &still[..3]
        );
        // 2 ppm over 4000 laser cycles of 12.5 us are 100 ns.
        let drifting = times_ns("phase = 0.25\ndrift_ppm = 2", 0.0, 1);
        assert!(
            (spread(&drifting) - 100.0).abs() < 0.1,
            "{}",
            spread(&drifting)
        );
        let dithering = times_ns("phase = 0.25\ndither_ns = 500", 0.0, 1);
        assert!((490.0..500.0).contains(&spread(&dithering)));
        // Waits of 100 ns on average, as random walk and drift, take it everywhere; 100 of 12 600 ns are lost.
        let waiting = times_ns("phase = 0.25", 200.0, 1);
        let lost = 1.0 - waiting.len() as f64 / (f64::from(CYCLES) * 1.008);
        assert!(
            spread(&waiting) > 12_300.0 && (lost - 100.0 / 12_600.0).abs() < 3e-3,
            "{lost}"
        );
        let quarters = (0..4).map(|n| {
            let within = f64::from(n) * 3125.0..f64::from(n + 1) * 3125.0;
            waiting.iter().filter(|ns| within.contains(ns)).count()
        });
        assert!(
            quarters.clone().all(|n| (900..1100).contains(&n)),
            "{:?}",
            quarters.collect::<Vec<_>>()
        );
        let random = [1, 2].map(|seed| times_ns("", 0.0, seed)[0]);
        assert!((random[0] - random[1]).abs() > 1.0);
    }

    #[test]
    fn what_cannot_be_is_refused_in_one_sentence() {
        for (keys, complaint) in [
            (
                "place_m = [0, 0, 0]",
                "place_m is where the sensor itself is",
            ),
            (
                "place_m = [0, 0, 9]\nrate_hz = 0",
                "rate_hz = 0 is impossible; give 1 to 1e7 Hz",
            ),
            (
                "place_m = [0, 0, 9]\ndither_ns = 12500",
                "give less than the 12500 ns from pulse to pulse",
            ),
            ("", "lacks `name` or `place_m`"),
        ] {
            let text = format!("[[interferer]]\nname = \"car\"\n{keys}\n");
            let error = Scene::parse("test", &text).unwrap_err().to_string();
            assert!(error.contains(complaint), "{error}");
            assert!(
                error.contains("in [[interferer]] number 1 (car)"),
                "{error}"
            );
        }
    }

    #[test]
    fn another_lidar_moves_with_the_world() {
        let mut scene = before_a_wall(0.3, "place_m = [0, 0, 30]\nvelocity_m_s = [1, 0, -10]");
        scene.rig.yaw_rate_deg_s = 30.0;
        let later = &scene.at(3.0).interferers[0];
        assert!(
            (later.place_m - DVec3::new(0.0, 0.0, 3.0)).length() < 1e-9,
            "{}",
            later.place_m
        );
        assert_eq!((later.yaw_deg, later.velocity_m_s), (90.0, DVec3::ZERO));
        assert!(!scene.is_still());
    }
}
