//! Which objects the rays of a macropixel, or of some pixels of a camera, may meet at all.
//!
//! ```text
//!                 ·  ray  ╭───╮ ball around an object
//!   lidar  ◁──────·───────┤   │         met where the angle between its middle and that of the macropixel
//!            α    ·       ╰───╯  β      is at most α + β
//! ```
//!
//! Every ray is tried on every object otherwise, 16 to 64 rays a macropixel and one a pixel of a camera. What a ray meets is the same: an
//! object that is left out meets none of them. Rays that a mirror throws elsewhere are tried on all.

use glam::DVec3;
use smallvec::SmallVec;

use super::settings::Scene;
use super::vector::Ray;

/// Objects that some rays may meet, by their index, rising.
pub(crate) type Candidates = SmallVec<[u32; 16]>;

/// Room for rounding, rad.
const ROOM_RAD: f64 = 1e-6;

/// Directions about a middle.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Cone {
    middle: DVec3,
    /// Half its angle with room for rounding, rad, and of that sine and cosine.
    half_rad: f64,
    sine_cosine: (f64, f64),
}

impl Cone {
    /// About the direction `middle`, so wide that `others` are in it, unit vectors all.
    pub(super) fn enclosing(middle: DVec3, others: impl IntoIterator<Item = DVec3>) -> Self {
        let cosines = others.into_iter().map(|other| other.dot(middle));
        let half_rad = libm::acos(cosines.fold(1.0, f64::min)) + ROOM_RAD;
        Cone {
            middle,
            half_rad,
            sine_cosine: libm::sincos(half_rad),
        }
    }
}

/// A ball around an object, as it is seen from one place.
#[derive(Debug, Clone, Copy)]
struct Disc {
    /// Direction of the middle.
    towards: DVec3,
    /// Half the angle that it fills, rad, and of that sine and cosine.
    fills_rad: f64,
    sine_cosine: (f64, f64),
}

/// Balls around the objects of a scene, as they are seen from one place.
#[derive(Debug)]
pub(crate) struct Bounds {
    /// `None` for an object that is everywhere or about the place.
    discs: Vec<Option<Disc>>,
}

impl Bounds {
    /// Those of a scene, from `place_m`; the lidar is at zero.
    pub(crate) fn from_scene(scene: &Scene, place_m: DVec3) -> Self {
        let disc = |(centre_m, radius_m): (DVec3, f64)| {
            let offset_m = centre_m - place_m;
            let away_m = offset_m.length();
            let fills_rad = libm::asin(radius_m / away_m);
            (away_m > radius_m).then(|| Disc {
                towards: offset_m / away_m,
                fills_rad,
                sine_cosine: libm::sincos(fills_rad),
            })
        };
        let objects = scene.objects.iter();
        Bounds {
            discs: objects
                .map(|object| object.shape.ball_around().and_then(disc))
                .collect(),
        }
    }

    /// Objects that `rays` from the place may meet; none of them may look backwards from another.
    pub(crate) fn of_rays(&self, rays: &[Ray]) -> Candidates {
        let sum: DVec3 = rays.iter().map(|ray| ray.direction).sum();
        self.candidates(Cone::enclosing(
            sum.normalize(),
            rays.iter().map(|ray| ray.direction),
        ))
    }

    /// Objects that rays from the place within a cone may meet.
    pub(super) fn candidates(&self, cone: Cone) -> Candidates {
        let (sine, cosine) = cone.sine_cosine;
        let may_meet = |disc: &Option<Disc>| {
            disc.is_none_or(|disc| {
                // The cosine of both angles together.
                let (own_sine, own_cosine) = disc.sine_cosine;
                cone.half_rad + disc.fills_rad >= std::f64::consts::PI
                    || cone.middle.dot(disc.towards) >= cosine * own_cosine - sine * own_sine
            })
        };
        let discs = (0..).zip(&self.discs);
        discs
            .filter_map(|(index, disc)| may_meet(disc).then_some(index))
            .collect()
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::scene::shape::{any_point, any_shape};
    use crate::scene::{GroundTruth, Object, Stage};
    use proptest::prelude::*;

    proptest! {
        /// Rays from anywhere, in groups.
        #[test]
        fn rays_from_elsewhere_meet_what_they_may_meet(
            shapes in prop::collection::vec(any_shape(), 1..8),
            place_m in any_point(3.0),
            towards in any_point(1.0).prop_filter("a direction", |towards| towards.length() > 0.1),
            spread in prop::collection::vec(any_point(0.05), 1..40),
        ) {
            let mut scene = Scene::outdoor();
            scene.objects = shapes.into_iter().map(|shape| Object::new("it", 0.3, shape)).collect();
            let rays: Vec<Ray> = spread.iter().map(|beside| Ray::new(place_m, towards + *beside)).collect();
            let candidates = Bounds::from_scene(&scene, place_m).of_rays(&rays);
            let stage = Stage::new(&scene);
            for ray in &rays {
                prop_assert_eq!(scene.hit(ray), stage.hit_of(ray, &candidates));
            }
        }

        /// Shadows: the slow way tries every shape.
        #[test]
        fn rays_are_blocked_by_what_they_meet(
            shapes in prop::collection::vec(any_shape(), 1..8),
            from_m in prop::collection::vec(any_point(20.0), 40),
            towards in any_point(1.0).prop_filter("a direction", |towards| towards.length() > 0.1),
        ) {
            let mut scene = Scene::outdoor();
            scene.objects = shapes.into_iter().map(|shape| Object::new("it", 0.3, shape)).collect();
            let stage = Stage::new(&scene);
            for origin in from_m {
                let ray = Ray::new(origin, towards);
                let blocked = scene.objects.iter().any(|object| object.shape.intersect(&ray).is_some());
                prop_assert_eq!(stage.is_blocked(&ray), blocked);
            }
        }

        /// Every macropixel, through panes and over mirrors.
        #[test]
        fn rays_return_the_same_from_the_objects_they_may_meet(
            shapes in prop::collection::vec((any_shape(), 0f64..0.9, 0f64..0.9), 1..8),
            fov_deg in 5f64..120.0,
        ) {
            let mut scene = Scene::outdoor();
            scene.lidar.fov_deg = fov_deg;
            scene.objects = shapes
                .into_iter()
                .map(|(shape, transmittance, mirror)| {
                    let mut object = Object::new("it", 0.3, shape);
                    (object.transmittance, object.mirror) = (transmittance, mirror * (1.0 - transmittance));
                    object
                })
                .collect();
            let (stage, bounds) = (Stage::new(&scene), Bounds::from_scene(&scene, DVec3::ZERO));
            let camera = scene.lidar_camera(6, 5);
            for (row, col) in (0..6).flat_map(|row| (0..5).map(move |col| (row, col))) {
                let ray_direction = |du: f64, dv: f64| {
                    camera.at_unit_depth((f64::from(col) + du, f64::from(row) + dv)).normalize()
                };
                let middle = ray_direction(0.5, 0.5);
                let corners = [ray_direction(0.0, 0.0), ray_direction(0.0, 1.0), ray_direction(1.0, 0.0), ray_direction(1.0, 1.0)];
                let candidates = bounds.candidates(Cone::enclosing(middle, corners));
                for direction in corners.into_iter().chain([middle, ray_direction(0.2, 0.9)]) {
                    let ray = Ray::new(DVec3::ZERO, direction);
                    prop_assert_eq!(scene.returns(&ray), stage.returns_of(&ray, &candidates));
                }
            }
        }
    }

    #[test]
    fn most_of_the_street_is_out_of_a_macropixel_s_sight() {
        let scene = Scene::outdoor();
        let truth = GroundTruth::render(&scene, 64, 64);
        let camera = scene.lidar_camera(64, 64);
        let bounds = Bounds::from_scene(&scene, DVec3::ZERO);
        let mut tried = 0;
        for pixel in 0..64 * 64u32 {
            let (row, col) = (f64::from(pixel / 64), f64::from(pixel % 64));
            let middle = camera.at_unit_depth((col + 0.5, row + 0.5)).normalize();
            let corners = [(0.0, 0.0), (0.0, 1.0), (1.0, 0.0), (1.0, 1.0)];
            let corners =
                corners.map(|(u, v)| camera.at_unit_depth((col + u, row + v)).normalize());
            let candidates = bounds.candidates(Cone::enclosing(middle, corners));
            let seen = truth.surfaces[pixel as usize].iter();
            for surface in seen {
                assert!(candidates.contains(&(surface.object as u32)));
            }
            tried += candidates.len();
        }
        assert!(2 * tried < 64 * 64 * scene.objects.len(), "{tried}");
    }
}
