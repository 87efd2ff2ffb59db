//! The kinds of shapes, where they stand, and how they move and turn.

use std::sync::Arc;

use glam::DVec3;

use super::map::DepthMap;
use super::mesh::Mesh;
use super::person;
use crate::scene::vector::turned;

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
    /// A cone with flat ends, or one flat end and a tip: traffic cones, funnels, tree tops.
    Cone {
        /// Middle of its axis.
        centre_m: DVec3,
        /// Any vector along it towards its tip, with any length but zero.
        axis: DVec3,
        /// Its radius at the foot.
        radius_m: f64,
        /// Its radius at the other end; 0 for a tip.
        tip_radius_m: f64,
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

impl Shape {
    /// The shape at another place.
    pub(in crate::scene) fn shifted(self, by_m: DVec3) -> Self {
        let mut moved = self;
        match &mut moved {
            Shape::Ground { depth_m } => *depth_m += by_m.y,
            Shape::Plane { centre_m, .. }
            | Shape::Box { centre_m, .. }
            | Shape::Sphere { centre_m, .. }
            | Shape::Cylinder { centre_m, .. }
            | Shape::Cone { centre_m, .. }
            | Shape::Mesh { centre_m, .. }
            | Shape::Map { centre_m, .. } => *centre_m += by_m,
            Shape::Person { foot_m, .. } => *foot_m += by_m,
        }
        moved
    }

    /// Middle and radius of a ball that all of it lies in, m; `None` where it has no end, or that has not been worked out.
    pub(in crate::scene) fn ball_around(&self) -> Option<(DVec3, f64)> {
        Some(match self {
            Shape::Ground { .. } | Shape::Mesh { .. } | Shape::Map { .. } => return None,
            Shape::Plane {
                centre_m,
                width_m,
                height_m,
                ..
            } => (*centre_m, 0.5 * libm::hypot(*width_m, *height_m)),
            Shape::Box {
                centre_m, size_m, ..
            } => (*centre_m, 0.5 * size_m.length()),
            Shape::Sphere { centre_m, radius_m } => (*centre_m, radius_m.abs()),
            Shape::Cylinder {
                centre_m,
                radius_m,
                height_m,
                ..
            } => (*centre_m, libm::hypot(*radius_m, 0.5 * height_m)),
            Shape::Cone {
                centre_m,
                radius_m,
                tip_radius_m,
                height_m,
                ..
            } => {
                let widest_m = radius_m.max(*tip_radius_m);
                (*centre_m, libm::hypot(widest_m, 0.5 * height_m))
            }
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
    pub(in crate::scene) fn is_endless(&self) -> bool {
        matches!(self, Shape::Ground { .. })
    }

    /// The shape as somebody at the origin sees it who has turned by `by_deg` to the right.
    pub(in crate::scene) fn seen_turned(self, by_deg: f64) -> Self {
        let (sine, cosine) = libm::sincos(by_deg.to_radians());
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
            Shape::Cylinder { centre_m, axis, .. } | Shape::Cone { centre_m, axis, .. } => {
                turn(centre_m);
                turn(axis);
            }
        }
        seen
    }
}
