//! A mesh where it stands.

use glam::DVec3;

use super::Mesh;
use crate::scene::shape::meeting::{Meeting, in_front};
use crate::scene::shape::pose::Pose;
use crate::scene::shape::surface::Surface;
use crate::scene::vector::Ray;

/// A mesh with its place, its turn and its unit of length.
#[derive(Debug)]
pub(in crate::scene) struct PlacedMesh<'a> {
    pose: Pose,
    scale_m: f64,
    mesh: &'a Mesh,
}

impl<'a> PlacedMesh<'a> {
    pub(in crate::scene::shape) fn new(
        centre_m: DVec3,
        yaw_deg: f64,
        scale_m: f64,
        mesh: &'a Mesh,
    ) -> Self {
        PlacedMesh {
            pose: Pose::new(centre_m, yaw_deg),
            scale_m,
            mesh,
        }
    }
}

impl Surface for PlacedMesh<'_> {
    fn intersect(&self, ray: &Ray) -> Option<Meeting> {
        let inside = self.pose.inwards(ray);
        let scaled = Ray {
            origin: inside.origin / self.scale_m,
            direction: inside.direction,
        };
        let meeting = self.mesh.intersect(&scaled)?;
        let range_m = in_front(meeting.range_m * self.scale_m)?;
        Some(Meeting { range_m, ..meeting })
    }

    fn normal_at(&self, _point: DVec3, part: u32) -> DVec3 {
        self.pose.outwards(self.mesh.normal(part))
    }

    fn on_surface(&self, point: DVec3, part: u32, _seen_turned_deg: f64) -> (f64, f64) {
        let inside = self.pose.inside(point) / self.scale_m;
        let (u, v) = self.mesh.on_surface(inside, part);
        (u * self.scale_m, v * self.scale_m)
    }
}
