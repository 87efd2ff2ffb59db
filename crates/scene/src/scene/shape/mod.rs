//! Geometry: where a ray meets a shape, which way the surface faces there, and where on the surface the point is.
//!
//! ```text
//!   Shape ─┬─ flat:   ground, plane         placed() ─► meet(ray) ─► range, part (face, limb, triangle)
//!          ├─ solid:  box                                normal_at(point, part)
//!          ├─ round:  sphere, cylinder                   on_surface(point, part) ─► metres along the surface, for textures
//!          ├─ cone                                       bend(point, part) ─► how the normal turns, for curved mirrors
//!          ├─ person: a body of these
//!          ├─ mesh:   triangles of a file
//!          └─ map:    depths that a camera has seen
//! ```
//!
//! Each kind made ready for many rays ([`PlacedShape`]) is a [`Surface`]. Those that can be turned do their geometry in coordinates of their own
//! ([`Pose`](pose::Pose)).

#[cfg(test)]
mod any_shape;
mod cone;
mod flat;
mod kinds;
mod map;
mod meeting;
mod mesh;
mod person;
mod placed;
mod pose;
mod round;
mod solid;
mod surface;

#[cfg(test)]
pub(super) use any_shape::{any_point, any_shape};
pub use kinds::Shape;
pub use map::{DepthMap, MapFiles};
pub(super) use meeting::Meeting;
pub use mesh::Mesh;
pub(super) use placed::PlacedShape;
pub(super) use surface::Surface;

#[cfg(test)]
mod tests {
    use super::*;
    use crate::scene::DVec3;
    use crate::scene::vector::Ray;
    use proptest::prelude::*;

    fn ray(x: f64, y: f64, z: f64) -> Ray {
        Ray::new(DVec3::ZERO, DVec3::new(x, y, z))
    }

    #[test]
    fn the_ground_is_hit_below_the_horizon_only() {
        let ground = Shape::Ground { depth_m: 2.0 };
        let range_m = ground.intersect(&ray(0.0, 1.0, 1.0)).unwrap();
        assert!((range_m - 2.0 * 2f64.sqrt()).abs() < 1e-12);
        assert_eq!(ground.intersect(&ray(0.0, 0.0, 1.0)), None);
        assert_eq!(ground.intersect(&ray(0.0, -0.1, 1.0)), None);
    }

    #[test]
    fn a_plane_ends_at_its_edges() {
        let plane = Shape::Plane {
            centre_m: DVec3::new(0.0, 0.0, 10.0),
            normal: DVec3::new(0.0, 0.0, -3.0),
            width_m: 4.0,
            height_m: 2.0,
        };
        assert_eq!(plane.intersect(&ray(0.0, 0.0, 1.0)), Some(10.0));
        assert!(plane.intersect(&ray(0.19, 0.0, 1.0)).is_some());
        assert!(plane.intersect(&ray(0.21, 0.0, 1.0)).is_none());
        assert!(plane.intersect(&ray(0.0, 0.11, 1.0)).is_none());
        assert!(plane.intersect(&ray(0.0, 0.0, -1.0)).is_none());
    }

    #[test]
    fn a_turned_box_shows_its_corner() {
        let shape = Shape::Box {
            centre_m: DVec3::new(0.0, 0.0, 10.0),
            size_m: DVec3::new(2.0, 2.0, 2.0),
            yaw_deg: 45.0,
        };
        let range_m = shape.intersect(&ray(0.0, 0.0, 1.0)).unwrap();
        assert!((range_m - (10.0 - 2f64.sqrt())).abs() < 1e-12, "{range_m}");
    }

    #[test]
    fn a_positive_yaw_turns_the_front_to_the_right() {
        // A long thin box, turned by 30°: its near end is on the left, its far end on the right.
        let shape = Shape::Box {
            centre_m: DVec3::new(0.0, 0.0, 10.0),
            size_m: DVec3::new(0.1, 1.0, 8.0),
            yaw_deg: 30.0,
        };
        assert!(
            shape
                .intersect(&ray(-0.5 * 3.9, 0.0, 10.0 - 0.866 * 3.9))
                .is_some()
        );
        assert!(
            shape
                .intersect(&ray(0.5 * 3.9, 0.0, 10.0 - 0.866 * 3.9))
                .is_none()
        );
    }

    #[test]
    fn from_inside_one_sees_the_far_wall() {
        let centre_m = DVec3::ZERO;
        let sphere = Shape::Sphere {
            centre_m,
            radius_m: 3.0,
        };
        let cube = Shape::Box {
            centre_m,
            size_m: DVec3::new(2.0, 2.0, 2.0),
            yaw_deg: 0.0,
        };
        assert_eq!(sphere.intersect(&ray(0.0, 0.0, 1.0)), Some(3.0));
        assert_eq!(cube.intersect(&ray(1.0, 0.0, 0.0)), Some(1.0));
    }

    #[test]
    fn a_cone_ends_in_its_tip() {
        // Its tip is up, 1 m high and 1 m wide at the foot, 10 m away.
        let cone = Shape::Cone {
            centre_m: DVec3::new(0.0, 0.0, 10.0),
            axis: DVec3::NEG_Y,
            radius_m: 0.5,
            tip_radius_m: 0.0,
            height_m: 1.0,
        };
        let range_m = cone.intersect(&ray(0.0, 0.0, 1.0)).unwrap();
        assert!((range_m - 9.75).abs() < 1e-12, "{range_m}");
        // Above its tip and below its foot it is not met, nor is the other half of the endless cone.
        let level = |x, y| cone.intersect(&Ray::new(DVec3::new(x, y, 0.0), DVec3::Z));
        assert_eq!(
            [level(0.0, -0.51), level(0.0, 0.51), level(0.1, -0.6)],
            [None; 3]
        );
        for y in [-0.49, -0.2, 0.0, 0.3, 0.49] {
            let radius_m = 0.5 * (y + 0.5);
            assert!((level(0.0, y).unwrap() - (10.0 - radius_m)).abs() < 1e-9);
            assert_eq!(level(radius_m + 1e-6, y), None);
        }
        // From above and from below, and from inside.
        let upright =
            |x, y, down| cone.intersect(&Ray::new(DVec3::new(x, y, 10.0), DVec3::Y * down));
        assert!((upright(0.2, -5.0, 1.0).unwrap() - 4.9).abs() < 1e-9);
        assert!((upright(0.2, 5.0, -1.0).unwrap() - 4.5).abs() < 1e-9);
        assert!((upright(0.0, 0.0, -1.0).unwrap() - 0.5).abs() < 1e-9);
    }

    proptest! {
        /// With equal radii it is a cylinder.
        #[test]
        fn a_cone_that_does_not_taper_is_a_cylinder(x in -1.0f64..1.0, y in -1.0f64..1.0, lean in -1.0f64..1.0) {
            let (centre_m, axis) = (DVec3::new(0.3, -0.2, 8.0), DVec3::new(lean, -1.0, 0.4));
            let cone = Shape::Cone { centre_m, axis, radius_m: 0.9, tip_radius_m: 0.9, height_m: 3.0 };
            let cylinder = Shape::Cylinder { centre_m, axis, radius_m: 0.9, height_m: 3.0 };
            let [cone, cylinder] = [cone, cylinder].map(|shape| shape.intersect(&ray(x, y, 4.0)));
            prop_assert_eq!(cone.is_some(), cylinder.is_some());
            if let (Some(cone), Some(cylinder)) = (cone, cylinder) {
                prop_assert!((cone - cylinder).abs() < 1e-9);
            }
        }

        #[test]
        fn hits_of_a_sphere_lie_on_it(x in -1.0f64..1.0, y in -1.0f64..1.0, radius_m in 0.1f64..3.0) {
            let centre_m = DVec3::new(0.3, -0.2, 8.0);
            let ray = ray(x, y, 8.0);
            if let Some(range_m) = (Shape::Sphere { centre_m, radius_m }).intersect(&ray) {
                prop_assert!(((ray.point(range_m) - centre_m).length() - radius_m).abs() < 1e-6);
            }
        }
    }
}
