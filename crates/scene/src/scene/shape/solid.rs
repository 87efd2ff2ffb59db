//! Boxes.

use glam::DVec3;

use super::meeting::{Meeting, in_front};
use super::pose::Pose;
use super::surface::Surface;
use crate::scene::vector::Ray;

/// A box where it stands.
#[derive(Debug)]
pub(in crate::scene) struct Block {
    pose: Pose,
    size_m: DVec3,
}

impl Block {
    pub(super) fn new(centre_m: DVec3, yaw_deg: f64, size_m: DVec3) -> Self {
        Block {
            pose: Pose::new(centre_m, yaw_deg),
            size_m,
        }
    }
}

impl Surface for Block {
    fn intersect(&self, ray: &Ray) -> Option<Meeting> {
        meet_box(&self.pose.inwards(ray), self.size_m)
    }

    fn normal_at(&self, _point: DVec3, part: u32) -> DVec3 {
        self.pose.outwards(face_normal(part))
    }

    fn on_surface(&self, point: DVec3, part: u32, _seen_turned_deg: f64) -> (f64, f64) {
        on_face(self.pose.inside(point), part)
    }
}

/// Slab method; `ray` is in the box's own coordinates. The part is the axis that the face looks along.
pub(super) fn meet_box(ray: &Ray, size_m: DVec3) -> Option<Meeting> {
    let half = size_m * 0.5;
    let (mut enter, mut leave) = ((f64::NEG_INFINITY, 0), (f64::INFINITY, 0));
    for axis in 0..3 {
        let (origin, direction) = (ray.origin[axis], ray.direction[axis]);
        if direction == 0.0 {
            if origin.abs() > half[axis] {
                return None;
            }
            continue;
        }
        let a = (-half[axis] - origin) / direction;
        let b = (half[axis] - origin) / direction;
        if a.min(b) > enter.0 {
            enter = (a.min(b), axis as u32);
        }
        if a.max(b) < leave.0 {
            leave = (a.max(b), axis as u32);
        }
    }
    if enter.0 > leave.0 {
        return None;
    }
    let meeting = |(range_m, part)| in_front(range_m).map(|range_m| Meeting { range_m, part });
    meeting(enter).or_else(|| meeting(leave))
}

pub(super) fn face_normal(part: u32) -> DVec3 {
    DVec3::AXES[part as usize]
}

/// Where on a face a point of it lies, in the box's own coordinates.
pub(super) fn on_face(point: DVec3, part: u32) -> (f64, f64) {
    match part {
        0 => (point.z, point.y),
        1 => (point.x, point.z),
        _ => (point.x, point.y),
    }
}
