//! The things in a scene and where a ray meets them.

use glam::DVec3;

use super::vector::{Ray, turned};

/// Hits nearer than this are the surface on which a ray starts, m.
const NEAREST_M: f64 = 1e-6;

/// A thing that reflects light, evenly and diffusely.
///
/// Make one with [`Object::new`], then change what is to differ.
#[derive(Debug, Clone, PartialEq, serde::Serialize, serde::Deserialize)]
#[serde(
    into = "super::entry::ObjectEntry",
    try_from = "super::entry::ObjectEntry"
)]
pub struct Object {
    /// Name for reports and complaints.
    pub name: String,
    /// Lambertian reflectivity at the laser's wavelength, 0 to 1.
    pub reflectivity: f64,
    /// Lambertian reflectivity where the cameras see, 0 to 1; `None` for the same as the laser's.
    pub grey: Option<f64>,
    /// By how much more of the laser's light returns than a Lambertian surface of this reflectivity sends back, 1 or
    /// more: retroreflectors. Sunlight does not return so.
    pub retro: f64,
    /// Velocity in the world, m/s.
    pub velocity_m_s: DVec3,
    /// Where and what it is at time 0.
    pub shape: Shape,
}

impl Object {
    /// A thing at rest that looks alike to laser and cameras.
    pub fn new(name: impl Into<String>, reflectivity: f64, shape: Shape) -> Self {
        Object {
            name: name.into(),
            reflectivity,
            grey: None,
            retro: 1.0,
            velocity_m_s: DVec3::ZERO,
            shape,
        }
    }
}

/// Geometry of an object, all lengths in metres.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum Shape {
    /// The endless horizontal plane `depth_m` below the lidar.
    Ground {
        /// Height of the lidar above it.
        depth_m: f64,
    },
    /// A flat rectangle, seen from both sides.
    Plane {
        /// Its middle.
        centre_m: DVec3,
        /// Any vector at right angles to it, with any length but zero.
        normal: DVec3,
        /// Extent along the horizontal edge.
        width_m: f64,
        /// Extent along the other edge.
        height_m: f64,
    },
    /// A box standing upright.
    Box {
        /// Its middle.
        centre_m: DVec3,
        /// Extents along x, y and z before turning.
        size_m: DVec3,
        /// Turn about the vertical axis; positive takes its forward face to the right.
        yaw_deg: f64,
    },
    /// A ball.
    Sphere {
        /// Its middle.
        centre_m: DVec3,
        /// Its radius.
        radius_m: f64,
    },
}

impl Shape {
    /// Distance along `ray` to the first surface point in front of its origin, m.
    pub fn intersect(&self, ray: &Ray) -> Option<f64> {
        match *self {
            Shape::Ground { depth_m } => in_front((depth_m - ray.origin.y) / ray.direction.y),
            Shape::Plane {
                centre_m,
                normal,
                width_m,
                height_m,
            } => intersect_plane(ray, centre_m, normal, (width_m, height_m)),
            Shape::Box {
                centre_m,
                size_m,
                yaw_deg,
            } => intersect_box(ray, centre_m, size_m, yaw_deg.to_radians()),
            Shape::Sphere { centre_m, radius_m } => intersect_sphere(ray, centre_m, radius_m),
        }
    }

    /// A unit vector at right angles to the surface at `point`, which lies on it; of the two it is any.
    pub(super) fn normal_at(&self, point: DVec3) -> DVec3 {
        match *self {
            Shape::Ground { .. } => DVec3::NEG_Y,
            Shape::Plane { normal, .. } => normal.normalize(),
            Shape::Box {
                centre_m,
                size_m,
                yaw_deg,
            } => {
                let (sine, cosine) = yaw_deg.to_radians().sin_cos();
                let inside = turned(point - centre_m, (cosine, -sine));
                // Of the six faces the point lies on the one that it is nearest to.
                let depths = size_m * 0.5 - inside.abs();
                let axis = (0..3).fold(0, |least, axis| match depths[axis] < depths[least] {
                    true => axis,
                    false => least,
                });
                let mut normal = DVec3::ZERO;
                normal[axis] = 1.0;
                turned(normal, (cosine, sine))
            }
            Shape::Sphere { centre_m, .. } => (point - centre_m).normalize(),
        }
    }

    /// The shape at another place.
    pub(super) fn shifted(self, by_m: DVec3) -> Self {
        let mut moved = self;
        match &mut moved {
            Shape::Ground { depth_m } => *depth_m += by_m.y,
            Shape::Plane { centre_m, .. }
            | Shape::Box { centre_m, .. }
            | Shape::Sphere { centre_m, .. } => *centre_m += by_m,
        }
        moved
    }
}

/// A ray parameter, if it is a point one can see. Parallel rays give infinity or NaN.
fn in_front(range_m: f64) -> Option<f64> {
    (range_m.is_finite() && range_m > NEAREST_M).then_some(range_m)
}

fn intersect_plane(
    ray: &Ray,
    centre_m: DVec3,
    normal: DVec3,
    (width_m, height_m): (f64, f64),
) -> Option<f64> {
    let normal = normal.normalize();
    let range_m = in_front((centre_m - ray.origin).dot(normal) / ray.direction.dot(normal))?;
    // The first edge is horizontal; a plane that lies flat has no preferred one and takes x.
    let down = DVec3::new(0.0, 1.0, 0.0);
    let horizontal = down.cross(normal);
    let along = if horizontal.length() > 1e-9 {
        horizontal.normalize()
    } else {
        DVec3::new(1.0, 0.0, 0.0)
    };
    let across = normal.cross(along);
    let offset = ray.at(range_m) - centre_m;
    let inside =
        offset.dot(along).abs() <= width_m / 2.0 && offset.dot(across).abs() <= height_m / 2.0;
    inside.then_some(range_m)
}

/// Slab method in the box's own coordinates.
fn intersect_box(ray: &Ray, centre_m: DVec3, size_m: DVec3, yaw_rad: f64) -> Option<f64> {
    let back = (yaw_rad.cos(), -yaw_rad.sin());
    let origin = turned(ray.origin - centre_m, back);
    let direction = turned(ray.direction, back);
    let half = size_m * 0.5;
    let (mut enter, mut leave) = (f64::NEG_INFINITY, f64::INFINITY);
    for axis in 0..3 {
        if direction[axis] == 0.0 {
            if origin[axis].abs() > half[axis] {
                return None;
            }
            continue;
        }
        let a = (-half[axis] - origin[axis]) / direction[axis];
        let b = (half[axis] - origin[axis]) / direction[axis];
        enter = enter.max(a.min(b));
        leave = leave.min(a.max(b));
    }
    if enter > leave {
        return None;
    }
    in_front(enter).or_else(|| in_front(leave))
}

fn intersect_sphere(ray: &Ray, centre_m: DVec3, radius_m: f64) -> Option<f64> {
    let to_centre = centre_m - ray.origin;
    let along_m = to_centre.dot(ray.direction);
    let miss = to_centre - ray.direction * along_m;
    let half_chord_m2 = radius_m * radius_m - miss.dot(miss);
    if half_chord_m2 < 0.0 {
        return None;
    }
    let half_chord_m = half_chord_m2.sqrt();
    in_front(along_m - half_chord_m).or_else(|| in_front(along_m + half_chord_m))
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    fn ray(x: f64, y: f64, z: f64) -> Ray {
        Ray::new(DVec3::ZERO, DVec3::new(x, y, z))
    }

    #[test]
    fn the_ground_is_hit_below_the_horizon_only() {
        let ground = Shape::Ground { depth_m: 2.0 };
        let range_m = ground.intersect(&ray(0.0, 1.0, 1.0)).unwrap();
        assert!((range_m - 2.0 * 2f64.sqrt()).abs() < 1e-12);
        assert_eq!(ground.intersect(&ray(0.0, 0.0, 1.0)), None);
        assert_eq!(ground.intersect(&ray(0.0, -0.1, 1.0)), None);
    }

    #[test]
    fn a_plane_ends_at_its_edges() {
        let plane = Shape::Plane {
            centre_m: DVec3::new(0.0, 0.0, 10.0),
            normal: DVec3::new(0.0, 0.0, -3.0),
            width_m: 4.0,
            height_m: 2.0,
        };
        assert_eq!(plane.intersect(&ray(0.0, 0.0, 1.0)), Some(10.0));
        assert!(plane.intersect(&ray(0.19, 0.0, 1.0)).is_some());
        assert!(plane.intersect(&ray(0.21, 0.0, 1.0)).is_none());
        assert!(plane.intersect(&ray(0.0, 0.11, 1.0)).is_none());
        assert!(plane.intersect(&ray(0.0, 0.0, -1.0)).is_none());
    }

    #[test]
    fn a_turned_box_shows_its_corner() {
        let shape = Shape::Box {
            centre_m: DVec3::new(0.0, 0.0, 10.0),
            size_m: DVec3::new(2.0, 2.0, 2.0),
            yaw_deg: 45.0,
        };
        let range_m = shape.intersect(&ray(0.0, 0.0, 1.0)).unwrap();
        assert!((range_m - (10.0 - 2f64.sqrt())).abs() < 1e-12, "{range_m}");
    }

    #[test]
    fn a_positive_yaw_turns_the_front_to_the_right() {
        // A long thin box, turned by 30°: its near end is on the left, its far end on the right.
        let shape = Shape::Box {
            centre_m: DVec3::new(0.0, 0.0, 10.0),
            size_m: DVec3::new(0.1, 1.0, 8.0),
            yaw_deg: 30.0,
        };
        assert!(
            shape
                .intersect(&ray(-0.5 * 3.9, 0.0, 10.0 - 0.866 * 3.9))
                .is_some()
        );
        assert!(
            shape
                .intersect(&ray(0.5 * 3.9, 0.0, 10.0 - 0.866 * 3.9))
                .is_none()
        );
    }

    #[test]
    fn from_inside_one_sees_the_far_wall() {
        let centre_m = DVec3::ZERO;
        let sphere = Shape::Sphere {
            centre_m,
            radius_m: 3.0,
        };
        let cube = Shape::Box {
            centre_m,
            size_m: DVec3::new(2.0, 2.0, 2.0),
            yaw_deg: 0.0,
        };
        assert_eq!(sphere.intersect(&ray(0.0, 0.0, 1.0)), Some(3.0));
        assert_eq!(cube.intersect(&ray(1.0, 0.0, 0.0)), Some(1.0));
    }

    proptest! {
        #[test]
        fn hits_of_a_sphere_lie_on_it(x in -1.0f64..1.0, y in -1.0f64..1.0, radius_m in 0.1f64..3.0) {
            let centre_m = DVec3::new(0.3, -0.2, 8.0);
            let ray = ray(x, y, 8.0);
            if let Some(range_m) = (Shape::Sphere { centre_m, radius_m }).intersect(&ray) {
                prop_assert!(((ray.at(range_m) - centre_m).length() - radius_m).abs() < 1e-6);
            }
        }
    }
}
