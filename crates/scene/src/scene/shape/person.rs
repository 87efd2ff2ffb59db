//! A person made of simple shapes, in mid-stride.
//!
//! ```text
//!        ( )      head      ball
//!         |       neck      capsule       Shares of the height are those of an adult (Drillis and Contini 1966,
//!       /[ ]\     trunk     box           rounded to 0.005): head 0.13 high, shoulders at 0.82, hips at 0.53, wrists
//!      / [ ] \    arms      capsules      0.33 below the shoulders.
//!        / \      legs      capsules
//! ```
//!
//! Own coordinates: the soles at the origin, x to the right, y down, z the way the person walks; lengths in heights.

use glam::DVec3;

use super::meeting::{Meeting, NEAREST_M};
use super::pose::Pose;
use super::surface::Surface;
use super::{round, solid};
use crate::scene::vector::Ray;

enum Limb {
    Ball(DVec3, f64),
    Block(DVec3, DVec3),
    Capsule((DVec3, DVec3), f64),
}

const fn point(x: f64, y: f64, z: f64) -> DVec3 {
    DVec3::new(x, y, z)
}

/// Head, neck, trunk, arms and legs.
const LIMBS: [Limb; 7] = [
    Limb::Ball(point(0.0, -0.935, 0.0), 0.065),
    Limb::Capsule((point(0.0, -0.88, 0.0), point(0.0, -0.81, 0.0)), 0.03),
    Limb::Block(point(0.0, -0.665, 0.0), point(0.23, 0.31, 0.12)),
    Limb::Capsule(
        (point(-0.14, -0.795, 0.0), point(-0.16, -0.49, 0.08)),
        0.025,
    ),
    Limb::Capsule((point(0.14, -0.795, 0.0), point(0.16, -0.49, -0.08)), 0.025),
    Limb::Capsule((point(-0.06, -0.51, 0.0), point(-0.06, -0.04, -0.11)), 0.04),
    Limb::Capsule((point(0.06, -0.51, 0.0), point(0.06, -0.04, 0.11)), 0.04),
];

/// What all limbs lie in: middle and size.
pub(super) const AROUND: (DVec3, DVec3) = (point(0.0, -0.5, 0.0), point(0.38, 1.0, 0.32));

/// A person where she or he stands.
#[derive(Debug)]
pub(in crate::scene) struct Person {
    pose: Pose,
    height_m: f64,
}

impl Person {
    pub(super) fn new(foot_m: DVec3, yaw_deg: f64, height_m: f64) -> Self {
        Person {
            pose: Pose::new(foot_m, yaw_deg),
            height_m,
        }
    }
}

impl Surface for Person {
    fn intersect(&self, ray: &Ray) -> Option<Meeting> {
        intersect(&self.pose.inwards(ray), self.height_m)
    }

    fn normal_at(&self, point: DVec3, part: u32) -> DVec3 {
        let inside = self.pose.inside(point) / self.height_m;
        self.pose.outwards(normal_at(inside, part))
    }

    /// Front and back carry what hangs straight down them; no two limbs carry the same.
    fn on_surface(&self, point: DVec3, _part: u32, _seen_turned_deg: f64) -> (f64, f64) {
        let inside = self.pose.inside(point);
        (inside.x + 0.7 * inside.z, inside.y)
    }
}

/// Where a ray in the person's own place and turn meets a person of `height_m`. The part is the limb, and in steps of 8
/// the axis of the trunk's face.
fn intersect(ray: &Ray, height_m: f64) -> Option<Meeting> {
    let ray = Ray {
        origin: ray.origin / height_m,
        direction: ray.direction,
    };
    let from = |centre: DVec3| Ray {
        origin: ray.origin - centre,
        direction: ray.direction,
    };
    solid::meet_box(&from(AROUND.0), AROUND.1)?;
    let mut nearest: Option<Meeting> = None;
    for (number, limb) in (0..).zip(&LIMBS) {
        let meeting = match limb {
            Limb::Ball(centre, radius) => round::meet_sphere(&ray, *centre, *radius),
            Limb::Block(centre, size) => solid::meet_box(&from(*centre), *size),
            Limb::Capsule(ends, radius) => round::meet_capsule(&ray, *ends, *radius),
        };
        if let Some(Meeting { range_m, part }) = meeting
            && nearest.is_none_or(|n| range_m < n.range_m)
        {
            let part = number + 8 * part;
            nearest = Some(Meeting { range_m, part });
        }
    }
    let Meeting { range_m, part } = nearest?;
    let range_m = range_m * height_m;
    (range_m > NEAREST_M).then_some(Meeting { range_m, part })
}

/// The normal at a point on a limb, in the person's own coordinates.
fn normal_at(point: DVec3, part: u32) -> DVec3 {
    match &LIMBS[(part % 8) as usize] {
        Limb::Ball(centre, _) => (point - centre).normalize(),
        Limb::Block(..) => solid::face_normal(part / 8),
        Limb::Capsule(ends, _) => round::capsule_normal(point, *ends),
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    /// Signed distance to a limb, negative inside: the slow way to find it, by walking along the ray.
    fn distance(limb: &Limb, point: DVec3) -> f64 {
        match limb {
            Limb::Ball(centre, radius) => point.distance(*centre) - radius,
            Limb::Block(centre, size) => {
                let beyond = (point - centre).abs() - *size * 0.5;
                beyond.max(DVec3::ZERO).length() + beyond.max_element().min(0.0)
            }
            Limb::Capsule((from, to), radius) => {
                let along = *to - *from;
                let share = (point - *from).dot(along) / along.length_squared();
                point.distance(*from + along * share.clamp(0.0, 1.0)) - radius
            }
        }
    }

    #[test]
    fn a_person_reaches_from_the_soles_to_the_crown_within_the_box_around() {
        let reach = |direction: DVec3| {
            let ends = LIMBS.iter().map(|limb| match limb {
                Limb::Ball(centre, radius) => centre.dot(direction) + radius,
                Limb::Block(centre, size) => {
                    centre.dot(direction) + (*size * 0.5).dot(direction.abs())
                }
                Limb::Capsule((a, b), radius) => a.dot(direction).max(b.dot(direction)) + radius,
            });
            ends.fold(f64::MIN, f64::max)
        };
        assert!((reach(DVec3::NEG_Y) - 1.0).abs() < 1e-9 && reach(DVec3::Y).abs() < 1e-9);
        for axis in DVec3::AXES.into_iter().flat_map(|axis| [axis, -axis]) {
            let around = AROUND.0.dot(axis) + AROUND.1.dot(axis.abs()) / 2.0;
            assert!(reach(axis) <= around + 1e-9, "{axis}");
        }
    }

    proptest! {
        /// Walking along the ray in steps that cannot pass a surface ends where the formulae say.
        #[test]
        fn rays_end_where_walking_along_them_ends(
            x in -0.3f64..0.3, y in -1.1f64..0.1, turn in 0.0f64..6.3, height_m in 0.5f64..2.5,
        ) {
            let origin = point(turn.sin(), -0.6, -turn.cos()) * 3.0 * height_m;
            let ray = Ray::new(origin, point(0.0, y, 0.0) * height_m + point(turn.cos(), 0.0, turn.sin()) * x * height_m - origin);
            let (mut walked, mut closest) = (Some(0.0), f64::MAX);
            while let Some(so_far) = walked {
                let point = ray.point(so_far) / height_m;
                let step = LIMBS.iter().map(|limb| distance(limb, point)).fold(f64::MAX, f64::min);
                closest = closest.min(step);
                if step < 1e-8 { break }
                walked = (so_far < 9.0 * height_m).then_some(so_far + step * height_m);
            }
            let met = intersect(&ray, height_m);
            match (met, walked) {
                (None, None) => {}
                (Some(Meeting { range_m, part }), Some(walked_m)) => {
                    let least = |range_m: f64| {
                        let point = ray.point(range_m) / height_m;
                        LIMBS.iter().map(|limb| distance(limb, point)).fold(f64::MAX, f64::min)
                    };
                    prop_assert!(least(range_m).abs() < 1e-9);
                    // Unless the walk ended where the ray only grazes a limb.
                    let grazed = least(walked_m + 1e-3) > 0.0;
                    prop_assert!(grazed || (range_m - walked_m).abs() < 1e-3, "{range_m} {walked_m}");
                    let point = ray.point(range_m) / height_m;
                    let normal = normal_at(point, part);
                    let limb = &LIMBS[(part % 8) as usize];
                    let rise = distance(limb, point + normal * 1e-6) - distance(limb, point);
                    prop_assert!((rise.abs() - 1e-6).abs() < 1e-9, "{rise}");
                }
                // A ray that grazes a limb.
                _ => prop_assert!(closest < 1e-6, "{closest}"),
            }
        }
    }
}
