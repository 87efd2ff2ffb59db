//! What rays ask a shape that stands in its place. A kind of shape answers in its own file.

use glam::DVec3;

use super::meeting::Meeting;
use crate::scene::vector::{Ray, turned};

/// A shape made ready for many rays: sines of its turn, edges, axes of unit length are worked out once.
pub(in crate::scene) trait Surface {
    /// Where a ray first meets it.
    fn intersect(&self, ray: &Ray) -> Option<Meeting>;

    /// A unit vector at right angles to `part` of the surface at `point`, which lies on it; of the two it is any.
    fn normal_at(&self, point: DVec3, part: u32) -> DVec3;

    /// How that normal turns along a small step within the surface from `point`: not at all where it is flat. People and depth maps count as
    /// made of flats.
    fn bend(&self, _point: DVec3, _part: u32, _step_m: DVec3) -> DVec3 {
        DVec3::ZERO
    }

    /// Where on the surface `point` lies, m, in coordinates that turn and move with the shape: right (or around) and down.
    /// Round shapes do not know how they are turned, so it comes with the call: by `seen_turned_deg` to the left.
    fn on_surface(&self, point: DVec3, part: u32, seen_turned_deg: f64) -> (f64, f64);

    /// Reflectivity for the laser and for the cameras, where the shape itself knows them.
    fn own_material(&self, _point: DVec3) -> (Option<f64>, Option<f64>) {
        (None, None)
    }
}

/// A vector of a round shape before it was seen turned.
pub(super) fn turned_back(vector: DVec3, seen_turned_deg: f64) -> DVec3 {
    let (sine, cosine) = libm::sincos(seen_turned_deg.to_radians());
    turned(vector, (cosine, sine))
}
