//! Rays about one ray, over mirrors: how a turn of the look moves the place where it ends.
//!
//! ```text
//!                    ╲│ mirror
//!      ·  ·  ·  ·  ·  ╲          a look that turns by t meets the mirror beside the first, and goes on another way: by t reflected
//!   ◁──────────────────╲         where the mirror is plane, and by more where it bulges
//!                      │╲
//!                      │·        moved: m per rad, at right angles to the ray
//!                      ▼ ·
//! ```
//!
//! A ray's length, from the lidar to where it ends, changes with the turn as if there were no mirror but a plane at right angles to
//! [`facing`](Bundle::onto): mirrors themselves leave it stationary (Fermat). Two turns, at right angles to each other, say it all to first order.

use glam::DVec3;

/// What becomes of a turn of the look.
#[derive(Debug, Clone, Copy)]
struct Beside {
    /// The turn itself, of unit length, at right angles to the look.
    turn: DVec3,
    /// How far beside the ray the turned one goes, at right angles to it, m per rad.
    moved_m: DVec3,
    /// By how much it goes another way, rad per rad.
    turned: DVec3,
}

/// Rays about one.
#[derive(Debug, Clone, Copy)]
pub(super) struct Bundle {
    /// Direction of the ray where it begins.
    look: DVec3,
    beside: [Beside; 2],
}

impl Bundle {
    /// Where a look begins.
    pub(super) fn new(look: DVec3) -> Self {
        let (right, down) = look.any_orthonormal_pair();
        let beside = [right, down].map(|turn| Beside {
            turn,
            moved_m: DVec3::ZERO,
            turned: turn,
        });
        Bundle { look, beside }
    }

    /// The same `way_m` farther on.
    pub(super) fn advanced(self, way_m: f64) -> Self {
        let beside = self.beside.map(|ray| Beside {
            moved_m: ray.moved_m + ray.turned * way_m,
            ..ray
        });
        Bundle { beside, ..self }
    }

    /// What a mirror with this normal makes of it, whose normal changes by `bend` of a small step within it.
    pub(super) fn thrown_back(
        self,
        direction: DVec3,
        normal: DVec3,
        bend: impl Fn(DVec3) -> DVec3,
    ) -> Self {
        let (along, thrown) = (direction.dot(normal), reflected(direction, normal));
        let beside = self.beside.map(|ray| {
            let on_mirror = ray.moved_m - direction * (ray.moved_m.dot(normal) / along);
            let bent = bend(on_mirror);
            let change = ray.turned.dot(normal) + direction.dot(bent);
            Beside {
                moved_m: on_mirror - thrown * on_mirror.dot(thrown),
                turned: ray.turned - (normal * change + bent * along) * 2.0,
                ..ray
            }
        });
        Bundle { beside, ..self }
    }

    /// The normal of a surface where the bundle ends, `range_m` from its beginning, as its beginning sees it
    /// ([`SurfaceReturn::facing`](super::SurfaceReturn::facing)), and how much of the light is left that would be there at this range without a mirror's curvature.
    pub(super) fn facing_and_share(
        &self,
        direction: DVec3,
        normal: DVec3,
        range_m: f64,
    ) -> (DVec3, f64) {
        let across = self.beside.map(|ray| ray.turn * ray.moved_m.dot(normal));
        let facing = self.look * direction.dot(normal) + (across[0] + across[1]) / range_m;
        // Light of a solid angle is on this area; by the same ratio less of what the surface sends finds back to the lens.
        let area_m2 = self.beside[0]
            .moved_m
            .cross(self.beside[1].moved_m)
            .length();
        (facing, (range_m * range_m / area_m2).min(1.0))
    }
}

/// The direction in which a mirror with this normal throws light that comes along `direction`.
pub(super) fn reflected(direction: DVec3, normal: DVec3) -> DVec3 {
    direction - normal * (2.0 * direction.dot(normal))
}
