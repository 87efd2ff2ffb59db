//! Geometry: where a ray meets a shape, which way the surface faces there, and where on the surface the point is.
//!
//! ```text
//!   Shape ─┬─ flat:   ground, plane         placed() ─► meet(ray) ─► range, part (face, limb, triangle)
//!          ├─ solid:  box                                normal_at(point, part)
//!          ├─ round:  sphere, cylinder                   on_surface(point, part) ─► metres along the surface, for textures
//!          ├─ person: a body of these
//!          ├─ mesh:   triangles of a file
//!          └─ map:    depths that a camera has seen
//! ```
//!
//! Shapes that can be turned do their geometry in coordinates of their own ([`Pose`](pose::Pose)), worked out once for many rays
//! ([`Placed`]).

mod flat;
mod map;
mod mesh;
mod person;
mod placed;
mod pose;
mod round;
mod solid;

use std::sync::Arc;

use glam::DVec3;

pub use map::{DepthMap, MapFiles};
pub use mesh::Mesh;

pub(super) use self::placed::Placed;
use super::vector::{Ray, turned};

/// Hits nearer than this are the surface on which a ray starts, m.
const NEAREST_M: f64 = 1e-6;

/// Geometry of an object, all lengths in metres.
#[derive(Debug, Clone, PartialEq)]
pub enum Shape {
    /// The endless horizontal plane `depth_m` below the lidar.
    Ground {
        /// Height of the lidar above it.
        depth_m: f64,
    },
    /// A flat rectangle, seen from both sides.
    Plane {
        /// Its middle.
        centre_m: DVec3,
        /// Any vector at right angles to it, with any length but zero.
        normal: DVec3,
        /// Extent along the horizontal edge.
        width_m: f64,
        /// Extent along the other edge.
        height_m: f64,
    },
    /// A box standing upright.
    Box {
        /// Its middle.
        centre_m: DVec3,
        /// Extents along x, y and z before turning.
        size_m: DVec3,
        /// Turn about the vertical axis; positive takes its forward face to the right.
        yaw_deg: f64,
    },
    /// A ball.
    Sphere {
        /// Its middle.
        centre_m: DVec3,
        /// Its radius.
        radius_m: f64,
    },
    /// A cylinder with flat ends: poles, trunks, barrels, pipes.
    Cylinder {
        /// Its middle.
        centre_m: DVec3,
        /// Any vector along it, with any length but zero.
        axis: DVec3,
        /// Its radius.
        radius_m: f64,
        /// Its length along the axis.
        height_m: f64,
    },
    /// A walking person: head, neck, trunk, arms and legs.
    Person {
        /// Where the feet stand.
        foot_m: DVec3,
        /// From the soles to the crown.
        height_m: f64,
        /// Turn about the vertical axis; at 0 the person walks forward (away), at 180 towards the lidar, at 90 to the
        /// right.
        yaw_deg: f64,
    },
    /// Triangles of a file.
    Mesh {
        /// Where the origin of the file's coordinates is.
        centre_m: DVec3,
        /// The file's unit of length.
        scale_m: f64,
        /// Turn about the vertical axis; positive takes its forward side to the right.
        yaw_deg: f64,
        /// What was read of it.
        mesh: Arc<Mesh>,
    },
    /// What a camera has seen.
    Map {
        /// Where the camera stood.
        centre_m: DVec3,
        /// Which way it looked, degrees to the right of forward.
        yaw_deg: f64,
        /// What it has seen.
        map: Arc<DepthMap>,
    },
}

/// Where a ray meets a shape.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct Meeting {
    pub(super) range_m: f64,
    /// Which of the shape's surfaces: the axis of a box's face, an end of a cylinder, a limb.
    pub(super) part: u32,
}

impl Shape {
    /// Distance along `ray` to the first surface point in front of its origin, m.
    pub fn intersect(&self, ray: &Ray) -> Option<f64> {
        self.placed().meet(ray).map(|meeting| meeting.range_m)
    }

    /// The shape made ready for many rays.
    pub(super) fn placed(&self) -> Placed<'_> {
        Placed::new(self)
    }

    /// The shape at another place.
    pub(super) fn shifted(self, by_m: DVec3) -> Self {
        let mut moved = self;
        match &mut moved {
            Shape::Ground { depth_m } => *depth_m += by_m.y,
            Shape::Plane { centre_m, .. }
            | Shape::Box { centre_m, .. }
            | Shape::Sphere { centre_m, .. }
            | Shape::Cylinder { centre_m, .. }
            | Shape::Mesh { centre_m, .. }
            | Shape::Map { centre_m, .. } => *centre_m += by_m,
            Shape::Person { foot_m, .. } => *foot_m += by_m,
        }
        moved
    }
}

impl Shape {
    /// Middle and radius of a ball that all of it lies in, m; `None` where it has no end, or that has not been worked out.
    pub(super) fn ball_around(&self) -> Option<(DVec3, f64)> {
        Some(match self {
            Shape::Ground { .. } | Shape::Mesh { .. } | Shape::Map { .. } => return None,
            Shape::Plane {
                centre_m,
                width_m,
                height_m,
                ..
            } => (*centre_m, 0.5 * width_m.hypot(*height_m)),
            Shape::Box {
                centre_m, size_m, ..
            } => (*centre_m, 0.5 * size_m.length()),
            Shape::Sphere { centre_m, radius_m } => (*centre_m, radius_m.abs()),
            Shape::Cylinder {
                centre_m,
                radius_m,
                height_m,
                ..
            } => (*centre_m, radius_m.hypot(0.5 * height_m)),
            Shape::Person {
                foot_m, height_m, ..
            } => {
                let (middle, size) = person::AROUND;
                // Turned about the vertical axis, which goes through the middle.
                (*foot_m + middle * *height_m, 0.5 * size.length() * height_m)
            }
        })
    }

    /// Whether it is the same wherever it is moved along itself, so that only its texture tells.
    pub(super) fn is_endless(&self) -> bool {
        matches!(self, Shape::Ground { .. })
    }

    /// The shape as somebody at the origin sees it who has turned by `by_deg` to the right.
    pub(super) fn seen_turned(self, by_deg: f64) -> Self {
        let (sine, cosine) = by_deg.to_radians().sin_cos();
        let turn = |vector: &mut DVec3| *vector = turned(*vector, (cosine, -sine));
        let mut seen = self;
        match &mut seen {
            Shape::Ground { .. } => {}
            Shape::Plane {
                centre_m, normal, ..
            } => {
                turn(centre_m);
                turn(normal);
            }
            Shape::Box {
                centre_m, yaw_deg, ..
            }
            | Shape::Mesh {
                centre_m, yaw_deg, ..
            }
            | Shape::Map {
                centre_m, yaw_deg, ..
            }
            | Shape::Person {
                foot_m: centre_m,
                yaw_deg,
                ..
            } => {
                turn(centre_m);
                *yaw_deg -= by_deg;
            }
            Shape::Sphere { centre_m, .. } => turn(centre_m),
            Shape::Cylinder { centre_m, axis, .. } => {
                turn(centre_m);
                turn(axis);
            }
        }
        seen
    }
}

/// A ray parameter, if it is a point one can see. Parallel rays give infinity or NaN.
fn in_front(range_m: f64) -> Option<f64> {
    (range_m.is_finite() && range_m > NEAREST_M).then_some(range_m)
}

#[cfg(test)]
mod tests {
    use super::*;
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

    proptest! {
        #[test]
        fn hits_of_a_sphere_lie_on_it(x in -1.0f64..1.0, y in -1.0f64..1.0, radius_m in 0.1f64..3.0) {
            let centre_m = DVec3::new(0.3, -0.2, 8.0);
            let ray = ray(x, y, 8.0);
            if let Some(range_m) = (Shape::Sphere { centre_m, radius_m }).intersect(&ray) {
                prop_assert!(((ray.at(range_m) - centre_m).length() - radius_m).abs() < 1e-6);
            }
        }
    }
}
