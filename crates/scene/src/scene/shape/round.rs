//! Spheres, cylinders and capsules.

use glam::DVec3;

use super::meeting::{Meeting, in_front};
use super::surface::{Surface, turned_back};
use crate::scene::vector::Ray;

/// The parts of a cylinder, or of a cone.
pub(super) const SIDE: u32 = 0;
const END: u32 = 1;

pub(super) fn meet_sphere(ray: &Ray, centre_m: DVec3, radius_m: f64) -> Option<Meeting> {
    let to_centre = centre_m - ray.origin;
    let along_m = to_centre.dot(ray.direction);
    let miss = to_centre - ray.direction * along_m;
    let half_chord_m2 = radius_m * radius_m - miss.dot(miss);
    if half_chord_m2 < 0.0 {
        return None;
    }
    let half_chord_m = half_chord_m2.sqrt();
    let range_m = in_front(along_m - half_chord_m).or_else(|| in_front(along_m + half_chord_m))?;
    Some(Meeting { range_m, part: 0 })
}

/// What of a vector is at right angles to an axis of unit length.
pub(super) fn off_axis(vector: DVec3, axis: DVec3) -> DVec3 {
    vector - axis * vector.dot(axis)
}

/// Across an axis of unit length, two ways, and along it: where `offset` lies, of a shape that is seen turned.
pub(super) fn about_axis(offset: DVec3, axis: DVec3, seen_turned_deg: f64) -> (f64, f64, f64) {
    let offset = turned_back(offset, seen_turned_deg);
    let axis = turned_back(axis, seen_turned_deg);
    let (side, other) = axis.any_orthonormal_pair();
    (offset.dot(side), offset.dot(other), offset.dot(axis))
}

/// A sphere where it stands.
#[derive(Debug)]
pub(in crate::scene) struct Ball {
    pub(super) centre_m: DVec3,
    pub(super) radius_m: f64,
}

impl Surface for Ball {
    fn intersect(&self, ray: &Ray) -> Option<Meeting> {
        meet_sphere(ray, self.centre_m, self.radius_m)
    }

    fn normal_at(&self, point: DVec3, _part: u32) -> DVec3 {
        (point - self.centre_m).normalize()
    }

    fn bend(&self, _point: DVec3, _part: u32, step_m: DVec3) -> DVec3 {
        step_m / self.radius_m
    }

    /// Around the vertical axis at the equator, and down along the meridian.
    fn on_surface(&self, point: DVec3, _part: u32, seen_turned_deg: f64) -> (f64, f64) {
        let offset = turned_back(point - self.centre_m, seen_turned_deg);
        let down = libm::asin((offset.y / self.radius_m).clamp(-1.0, 1.0));
        let around = libm::atan2(offset.x, -offset.z);
        (self.radius_m * around, self.radius_m * down)
    }
}

/// A cylinder with flat ends, where it stands.
#[derive(Debug)]
pub(in crate::scene) struct Cylinder {
    centre_m: DVec3,
    /// Of unit length.
    axis: DVec3,
    radius_m: f64,
    height_m: f64,
}

impl Cylinder {
    pub(super) fn new(centre_m: DVec3, axis: DVec3, radius_m: f64, height_m: f64) -> Self {
        Cylinder {
            centre_m,
            axis: axis.normalize(),
            radius_m,
            height_m,
        }
    }
}

impl Surface for Cylinder {
    fn intersect(&self, ray: &Ray) -> Option<Meeting> {
        let inside = pierced(ray, self.centre_m, self.axis, self.radius_m)?;
        between_ends(ray, (self.centre_m, self.axis), self.height_m / 2.0, inside)
    }

    fn normal_at(&self, point: DVec3, part: u32) -> DVec3 {
        match part {
            SIDE => off_axis(point - self.centre_m, self.axis).normalize(),
            _ => self.axis,
        }
    }

    fn bend(&self, _point: DVec3, part: u32, step_m: DVec3) -> DVec3 {
        match part {
            SIDE => off_axis(step_m, self.axis) / self.radius_m,
            _ => DVec3::ZERO,
        }
    }

    /// Around the side and along it, or across an end.
    fn on_surface(&self, point: DVec3, part: u32, seen_turned_deg: f64) -> (f64, f64) {
        let (x, y, along) = about_axis(point - self.centre_m, self.axis, seen_turned_deg);
        match part {
            SIDE => (self.radius_m * libm::atan2(y, x), along),
            _ => (x, y),
        }
    }
}

/// Ranges at which a line enters and leaves the endless cylinder of `radius_m` about the axis (of unit length) through
/// `from_m`; `None` if it never does, infinite where it stays inside.
fn pierced(ray: &Ray, from_m: DVec3, axis: DVec3, radius_m: f64) -> Option<(f64, f64)> {
    let (offset, direction) = (
        off_axis(ray.origin - from_m, axis),
        off_axis(ray.direction, axis),
    );
    let (a, b) = (direction.length_squared(), offset.dot(direction));
    let c = offset.length_squared() - radius_m * radius_m;
    if a < 1e-24 {
        return (c <= 0.0).then_some((f64::NEG_INFINITY, f64::INFINITY));
    }
    let square = b * b - a * c;
    (square >= 0.0).then(|| ((-b - square.sqrt()) / a, (-b + square.sqrt()) / a))
}

/// Where a ray meets what lies within an endless side, from `enter` to `leave` along the ray, and between two flat ends, `half_m` either way along
/// the axis (of unit length).
pub(super) fn between_ends(
    ray: &Ray,
    (centre_m, axis): (DVec3, DVec3),
    half_m: f64,
    (enter, leave): (f64, f64),
) -> Option<Meeting> {
    let (start, rise) = ((ray.origin - centre_m).dot(axis), ray.direction.dot(axis));
    let (low, high) = if rise == 0.0 {
        if start.abs() > half_m {
            return None;
        }
        (f64::NEG_INFINITY, f64::INFINITY)
    } else {
        let (a, b) = ((-half_m - start) / rise, (half_m - start) / rise);
        (a.min(b), a.max(b))
    };
    let first = if low > enter {
        (low, END)
    } else {
        (enter, SIDE)
    };
    let last = if high < leave {
        (high, END)
    } else {
        (leave, SIDE)
    };
    if first.0 > last.0 {
        return None;
    }
    let meeting = |(range_m, part)| in_front(range_m).map(|range_m| Meeting { range_m, part });
    meeting(first).or_else(|| meeting(last))
}

/// A cylinder whose ends are half balls, from `from_m` to `to_m`.
pub(super) fn meet_capsule(
    ray: &Ray,
    (from_m, to_m): (DVec3, DVec3),
    radius_m: f64,
) -> Option<Meeting> {
    // Most lines that miss pass its axis too far away, which needs no roots; a ten-thousandth is room for rounding.
    let across = ray.direction.cross(to_m - from_m);
    let apart = (from_m - ray.origin).dot(across);
    if apart * apart > 1.000_1 * radius_m * radius_m * across.length_squared() {
        return None;
    }
    let length_m = from_m.distance(to_m);
    let axis = (to_m - from_m) / length_m;
    let on_side = pierced(ray, from_m, axis, radius_m).and_then(|(enter, leave)| {
        let meets = |range_m: f64| {
            let height_m = (ray.point(range_m) - from_m).dot(axis);
            in_front(range_m).filter(|_| (0.0..=length_m).contains(&height_m))
        };
        meets(enter).or_else(|| meets(leave))
    });
    let end = |centre_m| meet_sphere(ray, centre_m, radius_m).map(|meeting| meeting.range_m);
    // From outside the nearest of the three surfaces is the capsule's; nobody looks from inside one.
    let nearest = [on_side, end(from_m), end(to_m)].into_iter().flatten();
    let range_m = nearest.reduce(f64::min)?;
    Some(Meeting { range_m, part: 0 })
}

/// From the axis of a capsule to a point of its surface.
pub(super) fn capsule_normal(point: DVec3, (from_m, to_m): (DVec3, DVec3)) -> DVec3 {
    let along = to_m - from_m;
    let share = (point - from_m).dot(along) / along.length_squared();
    (point - from_m - along * share.clamp(0.0, 1.0)).normalize()
}
