//! Multipath: light of our laser that comes by way of another surface.
//!
//! ```text
//!   lidar ───────────► second surface         a macropixel sees a place on the first surface. The laser lights the second one, which
//!     ▲                    ╲ diffuse          throws light there: r₂ + d + r₁ instead of 2 r₁, so it comes later than the echo
//!     ╰──────────── first surface
//! ```
//!
//! One diffuse bounce, by sampling: rays leave the place that is seen with the density of Lambert's cosine, so that the exposure there is the
//! mean of what they find, ρ₂ · E₂, and the error that of a mean. In a corner the bounced light of one macropixel is 2 % off with 16 rays a look,
//! 256 a macropixel, beside 1024 a look (the test below). Bounced light that a mirror throws, and what has bounced twice, is left out; both
//! surfaces take retroreflectors for plain ones, which send their light back to the laser.

use glam::DVec3;

use super::camera::PinholeCamera;
use super::cast::Stage;
use super::daylight::ABOVE_M;
use super::settings::Scene;
use super::vector::Ray;

/// How much before a surface light must have come, m, not to be stopped before it.
const THERE_M: f64 = 1e-3;

/// Light of one bounce that a macropixel gets.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct Bounce {
    /// The second surface's object.
    pub object: usize,
    /// Exposure that a white surface would need to send as much, J/m².
    pub exposure_j_m2: f64,
    /// Its whole way.
    pub way_m: f64,
}

impl Scene {
    /// Energy that a pulse sends into a direction, J/sr, where `camera` is the lidar's.
    fn sent_j_sr(&self, camera: &PinholeCamera, towards: DVec3) -> f64 {
        let Some((u, v)) = camera.project(towards) else {
            return 0.0;
        };
        let (lidar, cosine) = (&self.lidar, towards.z / towards.length());
        let pitch = [1.0 / camera.focal_px, 1.0 / camera.focal_v_px];
        let pulse_j = lidar.warm_pulse_j();
        if let Some(beam) = lidar.beam_at(libm::acos(cosine)) {
            return pulse_j * beam / lidar.beam_total();
        }
        let offset = [
            (u - camera.centre.0) * pitch[0],
            (v - camera.centre.1) * pitch[1],
        ];
        let half = [(camera.width, pitch[0]), (camera.height, pitch[1])]
            .map(|(n, p)| 0.5 * f64::from(n) * p);
        let is_lit = lidar.spot.lights(offset, half);
        let share = lidar
            .spot
            .share_per_pixel(camera.height, camera.width, pitch);
        let solid_angle_sr = cosine.powi(3) * pitch[0] * pitch[1];
        if is_lit {
            pulse_j * share / solid_angle_sr
        } else {
            0.0
        }
    }
}

impl Stage<'_> {
    /// Adds the bounced light of a place that faces along `normal` (unit). `reflected` of it arrives after `range_m` more at `camera`, the
    /// lidar's.
    pub(super) fn add_bounced(
        &self,
        camera: &PinholeCamera,
        (place_m, normal): (DVec3, DVec3),
        reflected: f64,
        range_m: f64,
        bounced: &mut Vec<Bounce>,
    ) {
        let rays = self.scene.lidar.bounce_rays;
        if rays == 0 || reflected == 0.0 {
            return;
        }
        let from = place_m + normal * ABOVE_M;
        let side = normal.any_orthonormal_vector();
        let other_side = normal.cross(side);
        // Neighbouring places look into other directions.
        let bits = place_m.to_array().map(f64::to_bits);
        let turn =
            rand_philox::splitmix64(bits[0] ^ bits[1].rotate_left(21) ^ bits[2].rotate_left(42));
        let turn = (turn >> 11) as f64 * 0.5f64.powi(53);
        for ray in 0..rays {
            const GOLDEN: f64 = 0.618_033_988_749_894_8;
            let height = (f64::from(ray) + 0.5) / f64::from(rays);
            let angle = std::f64::consts::TAU * (turn + f64::from(ray) * GOLDEN).fract();
            let (sine, cosine) = (libm::sin(angle), libm::cos(angle));
            let flat = height.sqrt();
            let direction =
                (side * cosine + other_side * sine) * flat + normal * (1.0 - height).sqrt();
            let look = Ray::new(from, direction);
            let Some(hit) = self.hit(&look) else {
                continue;
            };
            let second_m = look.point(hit.range_m);
            let lit_m = second_m.length();
            let incidence = -hit.normal.dot(second_m) / lit_m;
            let sent_j_sr = self.scene.sent_j_sr(camera, second_m);
            if incidence <= 0.0 || sent_j_sr == 0.0 {
                continue;
            }
            let met_m = self.range_to_hit(&Ray::new(DVec3::ZERO, second_m));
            if met_m.is_some_and(|met_m| met_m < lit_m - THERE_M) {
                continue;
            }
            let left = self.scene.medium.transmission(lit_m + hit.range_m);
            let exposure_j_m2 = sent_j_sr * incidence / (lit_m * lit_m);
            bounced.push(Bounce {
                object: hit.object,
                exposure_j_m2: reflected * left * hit.reflectivity * exposure_j_m2
                    / f64::from(rays),
                way_m: lit_m + hit.range_m + range_m,
            });
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::scene::{GroundTruth, Object, Shape};
    use crate::units::TimeOfFlight;

    /// Bounced and direct photons of every macropixel, and the mean way of the bounced ones, m.
    fn bounced(scene: &Scene, across: u32) -> Vec<(f64, f64, f64)> {
        let truth = GroundTruth::render(scene, across, across);
        let budget = scene.photon_budget(across, across);
        let photons = |view: &std::sync::Arc<crate::scene::view::View>| {
            let all: f64 = view.bounced.iter().map(|b| b.exposure_j_m2).sum();
            let ways = view.bounced.iter().map(|b| b.exposure_j_m2 * b.way_m);
            let direct = view.glimpses.iter();
            let direct = direct.map(|g| budget.signal_per_pulse(g.range_m, g.frontal_reflectivity));
            (
                budget.photons_of_exposure(all),
                direct.sum(),
                ways.sum::<f64>() / all,
            )
        };
        truth.views.iter().map(photons).collect()
    }

    /// In a sphere about the lidar every place gets ρ of the pulse over the whole surface, wherever the laser shines: a ray from any place of a
    /// sphere by Lambert's cosine falls on all of it alike.
    #[test]
    fn a_sphere_throws_light_everywhere_alike() {
        let mut scene = Scene::outdoor();
        scene.lidar.fov_deg = 120.0;
        scene.lidar.bounce_rays = 256;
        let (reflectivity, radius_m) = (0.5, 20.0);
        let shape = Shape::Sphere {
            centre_m: DVec3::ZERO,
            radius_m,
        };
        scene.objects = vec![Object::new("sphere", reflectivity, shape)];
        let found = bounced(&scene, 8);
        let photons: f64 = found.iter().map(|(photons, ..)| photons).sum::<f64>() / 64.0;
        let surface_m2 = 4.0 * std::f64::consts::PI * radius_m * radius_m;
        let exposure_j_m2 = reflectivity * scene.lidar.pulse_energy_uj * 1e-6 / surface_m2;
        let expected = scene
            .photon_budget(8, 8)
            .photons_of_exposure(reflectivity * exposure_j_m2);
        assert!(
            (photons / expected - 1.0).abs() < 0.02,
            "{photons} {expected}"
        );
        // Ways are two radii and a chord.
        assert!(
            found
                .iter()
                .all(|(_, _, way_m)| (2.0 * radius_m..4.0 * radius_m).contains(way_m))
        );
        scene.lidar.bounce_rays = 0;
        assert!(
            bounced(&scene, 8)
                .iter()
                .all(|(photons, ..)| *photons == 0.0)
        );
    }

    /// A floor and a wall that meet at a right angle, beside an integral over the wall.
    #[test]
    fn a_corner_has_the_light_and_the_delay_that_an_integral_over_its_wall_says() {
        let mut scene = Scene::outdoor();
        let (wall_m, floor_m, reflectivity) = (12.0, 1.5, 0.6);
        scene.lidar.fov_deg = 40.0;
        let wall = Shape::Plane {
            centre_m: DVec3::new(0.0, 0.0, wall_m),
            normal: DVec3::NEG_Z,
            width_m: 60.0,
            height_m: 2.0 * floor_m,
        };
        let floor = Shape::Ground { depth_m: floor_m };
        scene.objects = vec![
            Object::new("floor", reflectivity, floor),
            Object::new("wall", reflectivity, wall),
        ];
        // A macropixel that sees the floor before the wall.
        let (row, col) = (23, 15);
        let camera = scene.lidar_camera(32, 32);
        let seen = camera.at_unit_depth((15.5, 23.5));
        let at = seen * (floor_m / seen.y);
        assert!(at.z < wall_m && at.z > 7.0, "{at}");
        let (mut exposure, mut way_m) = (0.0, 0.0);
        let steps = 600;
        for (i, j) in (0..steps).flat_map(|i| (0..steps).map(move |j| (i, j))) {
            let part = |n: i32| (f64::from(n) + 0.5) / f64::from(steps) - 0.5;
            let (x, y) = (20.0 * part(i), 2.0 * floor_m * part(j));
            let place = DVec3::new(x, y, wall_m);
            let to = at - place;
            let (lit_m, apart_m) = (place.length(), to.length());
            let lit = scene.sent_j_sr(&camera, place) * (wall_m / lit_m) / (lit_m * lit_m);
            let cosines = (wall_m - at.z) / apart_m * (floor_m - y) / apart_m;
            let area = 20.0 * 2.0 * floor_m / f64::from(steps * steps);
            let thrown =
                reflectivity * lit * cosines * area / (std::f64::consts::PI * apart_m * apart_m);
            exposure += thrown;
            way_m += thrown * (lit_m + apart_m + at.length());
        }
        let budget = scene.photon_budget(32, 32);
        let expected = budget.photons_of_exposure(reflectivity * exposure);
        // The integral is that of the middle of the macropixel: 2.6 % less than with very many rays.
        for (rays, most) in [(16, 0.12), (1024, 0.04)] {
            scene.lidar.bounce_rays = rays;
            let (photons, direct, mean_m) = bounced(&scene, 32)[row * 32 + col];
            println!(
                "{rays} rays: {photons:.5} of {expected:.5}, {:.1} % of {direct:.4} direct",
                100.0 * photons / direct
            );
            assert!(
                (photons / expected - 1.0).abs() < most,
                "{rays}: {photons} {expected}"
            );
            assert!((mean_m - way_m / exposure).abs() < 20.0 * most, "{mean_m}");
            assert!(photons < 0.3 * direct && photons > 0.005 * direct);
        }
        // The first return comes late by what is bounced of its light, times how much later that is.
        let mut centre_m = |rays: u32| {
            scene.lidar.bounce_rays = rays;
            let light = &scene.pixel_light(&GroundTruth::render(&scene, 32, 32))[row * 32 + col];
            let all = light.segments().flat_map(|segment| segment.echoes());
            let all: Vec<_> = all
                .map(|e| (e.photons, e.photons * e.arrival.as_range_m()))
                .collect();
            let sum = |term: fn(&(f64, f64)) -> f64| all.iter().map(term).sum::<f64>();
            (sum(|e| e.0), sum(|e| e.1) / sum(|e| e.0))
        };
        let ((direct, direct_m), (_, centre_m)) = (centre_m(0), centre_m(1024));
        let late_m = 0.5 * way_m / exposure - direct_m;
        let closed_m = expected * late_m / (direct + expected);
        let found_m = centre_m - direct_m;
        println!(
            "{:.0} mm late, {:.0} by the integral",
            1e3 * found_m,
            1e3 * closed_m
        );
        assert!(
            (found_m / closed_m - 1.0).abs() < 0.05,
            "{found_m} {closed_m}"
        );
    }
}
