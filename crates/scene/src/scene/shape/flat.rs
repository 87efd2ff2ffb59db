//! Ground and planes.

use glam::DVec3;

use super::meeting::{Meeting, in_front};
use super::surface::Surface;
use crate::scene::vector::Ray;

/// The ground.
#[derive(Debug)]
pub(in crate::scene) struct Level {
    pub(super) depth_m: f64,
}

impl Surface for Level {
    fn intersect(&self, ray: &Ray) -> Option<Meeting> {
        let range_m = in_front((self.depth_m - ray.origin.y) / ray.direction.y)?;
        Some(Meeting { range_m, part: 0 })
    }

    fn normal_at(&self, _point: DVec3, _part: u32) -> DVec3 {
        DVec3::NEG_Y
    }

    fn on_surface(&self, point: DVec3, _part: u32, _seen_turned_deg: f64) -> (f64, f64) {
        (point.x, -point.z)
    }
}

/// A rectangle where it stands.
#[derive(Debug)]
pub(in crate::scene) struct Flat {
    centre_m: DVec3,
    /// Of unit length.
    normal: DVec3,
    /// Directions of its edges. The first is horizontal; a plane that lies flat has no preferred one and takes x.
    edges: [DVec3; 2],
    half_m: [f64; 2],
    /// Most of four times a square of the distance from the middle; a millionth is room for rounding.
    reach_m2: f64,
}

impl Flat {
    pub(super) fn new(centre_m: DVec3, normal: DVec3, (width_m, height_m): (f64, f64)) -> Self {
        let normal = normal.normalize();
        let horizontal = DVec3::Y.cross(normal);
        let along = if horizontal.length() > 1e-9 {
            horizontal.normalize()
        } else {
            DVec3::X
        };
        Flat {
            centre_m,
            normal,
            edges: [along, normal.cross(along)],
            half_m: [width_m / 2.0, height_m / 2.0],
            reach_m2: 1.000_001 * (width_m * width_m + height_m * height_m),
        }
    }

    /// Where a point lies along the two edges, from the middle.
    fn along_edges(&self, point: DVec3) -> (f64, f64) {
        let offset = point - self.centre_m;
        (offset.dot(self.edges[0]), offset.dot(self.edges[1]))
    }
}

impl Surface for Flat {
    fn intersect(&self, ray: &Ray) -> Option<Meeting> {
        let away_m = (self.centre_m - ray.origin).dot(self.normal);
        let range_m = in_front(away_m / ray.direction.dot(self.normal))?;
        let point = ray.point(range_m);
        // Most that miss are beyond the corners, which needs no edges.
        if 4.0 * (point - self.centre_m).length_squared() > self.reach_m2 {
            return None;
        }
        let (along_m, across_m) = self.along_edges(point);
        let inside = along_m.abs() <= self.half_m[0] && across_m.abs() <= self.half_m[1];
        inside.then_some(Meeting { range_m, part: 0 })
    }

    fn normal_at(&self, _point: DVec3, _part: u32) -> DVec3 {
        self.normal
    }

    fn on_surface(&self, point: DVec3, _part: u32, _seen_turned_deg: f64) -> (f64, f64) {
        self.along_edges(point)
    }
}
