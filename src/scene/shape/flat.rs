//! Ground and planes.

use glam::DVec3;

use super::{Meeting, in_front};
use crate::scene::vector::Ray;

pub(super) fn meet_ground(ray: &Ray, depth_m: f64) -> Option<Meeting> {
    let range_m = in_front((depth_m - ray.origin.y) / ray.direction.y)?;
    Some(Meeting { range_m, part: 0 })
}

pub(super) fn meet_plane(
    ray: &Ray,
    centre_m: DVec3,
    normal: DVec3,
    (width_m, height_m): (f64, f64),
) -> Option<Meeting> {
    let normal = normal.normalize();
    let range_m = in_front((centre_m - ray.origin).dot(normal) / ray.direction.dot(normal))?;
    let offset_m = ray.at(range_m) - centre_m;
    // Most that miss are beyond the corners, which needs no edges; a millionth is room for rounding.
    if 4.0 * offset_m.length_squared() > 1.000_001 * (width_m * width_m + height_m * height_m) {
        return None;
    }
    let (along_m, across_m) = in_plane(offset_m, normal);
    let inside = along_m.abs() <= width_m / 2.0 && across_m.abs() <= height_m / 2.0;
    inside.then_some(Meeting { range_m, part: 0 })
}

/// An offset from the middle, along the plane's two edges. The first edge is horizontal; a plane that lies flat has no
/// preferred one and takes x.
pub(super) fn in_plane(offset: DVec3, normal: DVec3) -> (f64, f64) {
    let horizontal = DVec3::Y.cross(normal);
    let along = if horizontal.length() > 1e-9 {
        horizontal.normalize()
    } else {
        DVec3::X
    };
    (offset.dot(along), offset.dot(normal.cross(along)))
}
