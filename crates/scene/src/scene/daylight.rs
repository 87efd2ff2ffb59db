//! How much of the daylight a surface gets: sun and sky.
//!
//! Without a place for the sun every surface gets the scene's illuminance, whichever way it faces (thesis Eq. 16, with a
//! diffuse target that faces the sun). With one, the sun's share goes with the cosine of incidence and shadows have only
//! the sky's; the sky is as bright everywhere, and a wall sees half of it. Light that one surface throws on another is
//! left out.

use glam::DVec3;

use super::cast::Stage;
use super::vector::Ray;

/// How far above a surface the ray to a light begins, m, so that it does not meet the surface itself.
pub(super) const ABOVE_M: f64 = 1e-4;

impl Stage<'_> {
    /// Daylight on a surface at `point` that faces along `normal` (unit), as a share of the scene's illuminance, 0 to 1.
    pub(crate) fn daylight(&self, point: DVec3, normal: DVec3) -> f64 {
        let (Some(sun), light) = (self.sun, &self.scene.light) else {
            return 1.0;
        };
        let from_sky = light.sky_share * (1.0 - normal.y) / 2.0;
        let incidence = normal.dot(sun);
        if incidence <= 0.0 {
            return from_sky;
        }
        let upwards = Ray::new(point + normal * ABOVE_M, sun);
        let from_sun = if self.is_blocked(&upwards) {
            0.0
        } else {
            (1.0 - light.sky_share) * incidence
        };
        from_sky + from_sun
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::scene::{Object, Scene, Shape};

    /// A pole on the ground, and the sun behind the lidar on the right at 45 degrees.
    fn scene() -> Scene {
        let mut scene = Scene::outdoor();
        let pole = Shape::Cylinder {
            centre_m: DVec3::new(0.0, 1.0, 10.0),
            axis: DVec3::Y,
            radius_m: 0.2,
            height_m: 2.0,
        };
        let ground = Shape::Ground { depth_m: 2.0 };
        scene.objects = vec![
            Object::new("ground", 0.2, ground),
            Object::new("pole", 0.2, pole),
        ];
        scene.light.sun_elevation_deg = Some(45.0);
        scene.light.sun_azimuth_deg = 90.0;
        scene.light.sky_share = 0.2;
        scene
    }

    #[test]
    fn surfaces_get_the_sun_by_their_tilt_and_the_sky_by_what_they_see_of_it() {
        let scene = scene();
        let sun = scene.towards_sun().unwrap();
        assert!((sun - DVec3::new(0.5f64.sqrt(), -(0.5f64.sqrt()), 0.0)).length() < 1e-12);
        let far = DVec3::new(50.0, 0.0, 10.0);
        let ground = 0.8 * 0.5f64.sqrt() + 0.2;
        assert!((Stage::new(&scene).daylight(far, DVec3::NEG_Y) - ground).abs() < 1e-12);
        assert!((Stage::new(&scene).daylight(far, DVec3::NEG_X) - 0.1).abs() < 1e-12);
        let facing = 0.8 + 0.2 * (1.0 + 0.5f64.sqrt()) / 2.0;
        assert!((Stage::new(&scene).daylight(far, sun) - facing).abs() < 1e-12);
    }

    #[test]
    fn a_pole_throws_its_shadow_away_from_the_sun() {
        let scene = scene();
        let on_ground =
            |x: f64| Stage::new(&scene).daylight(DVec3::new(x, 2.0, 10.0), DVec3::NEG_Y);
        assert!((on_ground(-1.0) - 0.2).abs() < 1e-12);
        assert!(on_ground(1.0) > 0.7 && on_ground(-2.5) > 0.7);
    }

    #[test]
    fn without_a_place_for_the_sun_all_surfaces_are_alike() {
        let mut scene = scene();
        scene.light.sun_elevation_deg = None;
        assert_eq!(
            Stage::new(&scene).daylight(DVec3::new(-1.0, 2.0, 10.0), DVec3::X),
            1.0
        );
    }
}
