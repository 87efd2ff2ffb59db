//! Coordinates of a shape's own: where it stands and which way it is turned.

use glam::DVec3;

use crate::scene::vector::{Ray, turned};

/// Place and turn of a shape that has coordinates of its own.
#[derive(Debug, Clone, Copy)]
pub(in crate::scene) struct Pose {
    centre_m: DVec3,
    cosine_sine: (f64, f64),
}

impl Pose {
    pub(super) fn new(centre_m: DVec3, yaw_deg: f64) -> Self {
        let (sine, cosine) = libm::sincos(yaw_deg.to_radians());
        Pose {
            centre_m,
            cosine_sine: (cosine, sine),
        }
    }

    /// A point in the shape's own coordinates.
    pub(super) fn inside(&self, point: DVec3) -> DVec3 {
        let (cosine, sine) = self.cosine_sine;
        turned(point - self.centre_m, (cosine, -sine))
    }

    /// A ray in the shape's own coordinates; distances along it are the same.
    pub(super) fn inwards(&self, ray: &Ray) -> Ray {
        let (cosine, sine) = self.cosine_sine;
        Ray {
            origin: self.inside(ray.origin),
            direction: turned(ray.direction, (cosine, -sine)),
        }
    }

    /// A direction of the shape's own coordinates in those of the scene.
    pub(super) fn outwards(&self, direction: DVec3) -> DVec3 {
        turned(direction, self.cosine_sine)
    }
}
