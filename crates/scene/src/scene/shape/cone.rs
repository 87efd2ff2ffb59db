//! Cones with two flat ends, or with one and a tip.
//!
//! ```text
//!            ╱╲   tip_radius_m
//!    axis ↑ ╱──╲
//!          ╱    ╲     its radius is middle + slope · height above the middle
//!         ╱──────╲   radius_m
//! ```

use glam::DVec3;

use super::meeting::Meeting;
use super::round::{SIDE, about_axis, between_ends, off_axis};
use super::surface::Surface;
use crate::scene::vector::Ray;

/// A cone where it stands.
#[derive(Debug)]
pub(in crate::scene) struct Cone {
    centre_m: DVec3,
    /// Of unit length.
    axis: DVec3,
    half_m: f64,
    /// Half way up.
    radius_m: f64,
    /// By how much the radius grows per metre along the axis.
    slope: f64,
}

impl Cone {
    pub(super) fn new(
        centre_m: DVec3,
        axis: DVec3,
        (foot_m, tip_m): (f64, f64),
        height_m: f64,
    ) -> Self {
        Cone {
            centre_m,
            axis: axis.normalize(),
            half_m: height_m / 2.0,
            radius_m: 0.5 * (foot_m + tip_m),
            slope: (tip_m - foot_m) / height_m,
        }
    }

    fn off_axis(&self, vector: DVec3) -> DVec3 {
        off_axis(vector, self.axis)
    }

    /// Where a line is inside the endless cone, on the side of its tip that is used.
    fn inside_side(&self, ray: &Ray) -> Option<(f64, f64)> {
        let start = ray.origin - self.centre_m;
        let (offset, direction) = (self.off_axis(start), self.off_axis(ray.direction));
        let radius_m = self.radius_m + self.slope * start.dot(self.axis);
        let growth = self.slope * ray.direction.dot(self.axis);
        let a = direction.length_squared() - growth * growth;
        let b = offset.dot(direction) - radius_m * growth;
        let c = offset.length_squared() - radius_m * radius_m;
        let all = (f64::NEG_INFINITY, f64::INFINITY);
        let (before, after) = (|end| (all.0, end), |start| (start, all.1));
        let square = b * b - a * c;
        if square < 0.0 {
            return None;
        }
        let q = -(b + square.sqrt().copysign(b));
        if q == 0.0 {
            return (c <= 0.0).then_some(if a > 0.0 { (0.0, 0.0) } else { all });
        }
        let (one, other) = (q / a, c / q);
        let (first, last) = (one.min(other), one.max(other));
        Some(if a > 0.0 {
            (first, last)
        } else if a < 0.0 {
            if growth > 0.0 {
                after(last)
            } else {
                before(first)
            }
        } else if b < 0.0 {
            after(other)
        } else {
            before(other)
        })
    }
}

impl Surface for Cone {
    fn intersect(&self, ray: &Ray) -> Option<Meeting> {
        let inside = self.inside_side(ray)?;
        between_ends(ray, (self.centre_m, self.axis), self.half_m, inside)
    }

    fn normal_at(&self, point: DVec3, part: u32) -> DVec3 {
        match part {
            SIDE => {
                let outwards = self.off_axis(point - self.centre_m).normalize_or_zero();
                // At the tip itself it is the axis.
                (outwards - self.axis * self.slope).normalize_or(self.axis)
            }
            _ => self.axis,
        }
    }

    /// How the normal turns along a small step within the surface: around the axis only, and most near the tip.
    fn bend(&self, point: DVec3, part: u32, step_m: DVec3) -> DVec3 {
        let from_axis = self.off_axis(point - self.centre_m);
        let away_m2 = from_axis.length_squared();
        if part != SIDE || away_m2 == 0.0 {
            return DVec3::ZERO;
        }
        let around = self.off_axis(step_m) - from_axis * (from_axis.dot(step_m) / away_m2);
        around / (away_m2.sqrt() * libm::hypot(1.0, self.slope))
    }

    /// Around the side and along it, or across an end.
    fn on_surface(&self, point: DVec3, part: u32, seen_turned_deg: f64) -> (f64, f64) {
        let (x, y, along) = about_axis(point - self.centre_m, self.axis, seen_turned_deg);
        match part {
            SIDE => {
                let slant = libm::hypot(1.0, self.slope);
                (libm::hypot(x, y) * libm::atan2(y, x), along * slant)
            }
            _ => (x, y),
        }
    }
}
