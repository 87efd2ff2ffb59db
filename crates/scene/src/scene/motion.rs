//! Motion: scenes are described at time 0, and here they are at other times.
//!
//! Everything else looks at a scene that stands still. Motion within an exposure is a row of such scenes.
//!
//! The world's coordinates are those of the lidar at time 0. Where the rig (lidar and cameras) moves and turns, the scene
//! in its own coordinates moves and turns the other way.

use glam::DVec3;

use super::object::Object;
use super::rig::{Rig, interpolate};
use super::settings::Scene;

impl Scene {
    /// The scene as it stands still at `time_s` (negative times are before the described one), as the rig sees it from
    /// where it is by then: every object is where its motion has taken it, and at rest.
    pub fn snapshot(&self, time_s: f64) -> Scene {
        let mut scene = self.clone();
        if self.is_still() {
            return scene;
        }
        let (position_m, yaw_deg) = self.rig.pose(time_s);
        for object in &mut scene.objects {
            let points = object.waypoints.iter().map(|&at| at.into());
            let displacement_m = match interpolate(points, time_s) {
                Some([_, x, y, z]) => DVec3::new(x, y, z),
                None => object.velocity_m_s * time_s,
            };
            let shift_m = displacement_m - position_m;
            object.shape = object.shape.clone().shifted(shift_m).seen_turned(yaw_deg);
            if let Some(texture) = &mut object.texture {
                texture.seen_turned_deg += yaw_deg;
                if object.shape.is_endless() {
                    // Ground has no place that its pattern could move with. Its coordinates are right and backwards.
                    let turn = |(u, v): (f64, f64), deg: f64| {
                        let (sine, cosine) = libm::sincos(deg.to_radians());
                        (cosine * u - sine * v, sine * u + cosine * v)
                    };
                    let (u, v) = turn((-shift_m.x, shift_m.z), texture.turn_deg);
                    texture.shift_m = (texture.shift_m.0 + u, texture.shift_m.1 + v);
                    texture.turn_deg += yaw_deg;
                }
            }
            object.velocity_m_s = DVec3::ZERO;
            object.waypoints.clear();
        }
        for other in &mut scene.interferers {
            *other = other.seen_from(time_s, position_m, yaw_deg);
        }
        scene.light.sun_azimuth_deg -= yaw_deg;
        scene.rig = Rig::default();
        scene
    }

    /// The longest way of an object, as seen from the rig, and how far the rig turns, from now on for `duration_s` seconds: m
    /// and degrees. Turning is left out of the ways.
    pub(super) fn ways_over(&self, duration_s: f64) -> (f64, f64) {
        const STEPS: u32 = 16;
        let times = (0..=STEPS).map(|n| duration_s * f64::from(n) / f64::from(STEPS));
        let times: Vec<f64> = times.collect();
        let rig: Vec<(DVec3, f64)> = times.iter().map(|&time_s| self.rig.pose(time_s)).collect();
        let turn_deg = rig
            .windows(2)
            .map(|pair| (pair[1].1 - pair[0].1).abs())
            .sum();
        let way_m = |object: &Object| -> f64 {
            let places = times.iter().zip(&rig).map(|(&time_s, (rig_m, _))| {
                let points = object.waypoints.iter().map(|&at| at.into());
                match interpolate(points, time_s) {
                    Some([_, x, y, z]) => DVec3::new(x, y, z) - *rig_m,
                    None => object.velocity_m_s * time_s - *rig_m,
                }
            });
            let places: Vec<DVec3> = places.collect();
            places
                .windows(2)
                .map(|pair| (pair[1] - pair[0]).length())
                .sum()
        };
        let others = self.interferers.iter();
        let other_m = others.map(|other| other.velocity_m_s.length() * duration_s);
        let ways_m = self.objects.iter().map(way_m).chain(other_m);
        (ways_m.fold(0.0, f64::max), turn_deg)
    }

    /// Whether the scene is the same at all times.
    pub fn is_still(&self) -> bool {
        let mut objects = self.objects.iter();
        let mut others = self.interferers.iter();
        self.rig.is_still()
            && others.all(|other| other.velocity_m_s == DVec3::ZERO)
            && objects.all(|o| o.velocity_m_s == DVec3::ZERO && o.waypoints.is_empty())
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::scene::shape::{any_point, any_shape};
    use crate::scene::{Object, Pattern, Ray, Shape, Texture, turned};
    use proptest::prelude::*;

    #[test]
    fn a_scene_at_a_time_stands_still_where_motion_has_taken_it() {
        let mut scene = Scene::outdoor();
        assert!(scene.is_still());
        assert_eq!(scene.snapshot(7.0), scene);
        let end = scene.objects.len() - 1;
        scene.objects[end].velocity_m_s = DVec3::new(0.0, 0.0, -10.0);
        assert!(!scene.is_still());
        let ahead = Ray::new(DVec3::ZERO, DVec3::new(0.0, -0.05, 1.0));
        let range_m = |scene: &Scene| scene.hit(&ahead).unwrap().range_m;
        let later = scene.snapshot(2.0);
        assert!(later.is_still());
        let expected = 20.0 / ahead.direction.z;
        assert!((range_m(&scene) - range_m(&later) - expected).abs() < 1e-9);
        assert_eq!(
            scene.snapshot(0.0).objects[end].shape,
            scene.objects[end].shape
        );
    }

    #[test]
    fn waypoints_are_joined_by_straight_lines_and_their_ends_are_rests() {
        let points = [[1.0, 5.0], [2.0, 7.0], [2.0, 9.0], [4.0, 1.0]];
        for (time_s, place) in [
            (0.0, 5.0),
            (1.0, 5.0),
            (1.5, 6.0),
            (2.0, 9.0),
            (3.0, 5.0),
            (9.0, 1.0),
        ] {
            assert_eq!(
                interpolate(points.into_iter(), time_s),
                Some([time_s.clamp(1.0, 4.0), place])
            );
        }
        assert_eq!(interpolate(std::iter::empty::<[f64; 2]>(), 1.0), None);
    }

    fn still_life(shapes: Vec<Shape>) -> Scene {
        let mut scene = Scene::outdoor();
        let noise = |object| Object {
            texture: Some(Texture {
                turn_deg: 20.0,
                shift_m: (0.3, 0.1),
                ..Texture::new(Pattern::Noise(1), 2.0, 0.0)
            }),
            ..object
        };
        let shapes = shapes.into_iter();
        scene.objects = shapes
            .map(|shape| noise(Object::new("it", 0.6, shape)))
            .collect();
        scene
    }

    proptest! {
        /// What a rig sees that has moved and turned is what a ray sees that was moved and turned in the scene at rest:
        /// range, material and, turned back, the normal.
        #[test]
        fn a_moving_rig_sees_what_moved_rays_see(
            shapes in prop::collection::vec(any_shape(), 1..20), towards in any_point(1.0), time_s in -2f64..3.0,
            forward in -3f64..3.0, right in -2f64..2.0, down in -0.2f64..0.2, yaw_rate_deg_s in -40f64..40.0,
        ) {
            let mut scene = still_life(shapes);
            scene.rig = Rig { velocity_m_s: DVec3::new(right, down, forward), yaw_rate_deg_s, waypoints: vec![] };
            let (position_m, yaw_deg) = scene.rig.pose(time_s);
            let (sine, cosine) = yaw_deg.to_radians().sin_cos();
            let seen = scene.snapshot(time_s).hit(&Ray::new(DVec3::ZERO, towards));
            let expected = scene.hit(&Ray::new(position_m, turned(towards, (cosine, sine))));
            match (seen, expected) {
                (Some(seen), Some(expected)) => {
                    prop_assert!((seen.range_m - expected.range_m).abs() < 1e-6);
                    prop_assert!((turned(seen.normal, (cosine, sine)) - expected.normal).length() < 1e-6);
                    prop_assert!((seen.grey - expected.grey).abs() < 1e-4, "{} {}", seen.grey, expected.grey);
                    prop_assert_eq!(seen.object, expected.object);
                }
                (seen, expected) => prop_assert_eq!(seen.is_some(), expected.is_some()),
            }
        }
    }
}
