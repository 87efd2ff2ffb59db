//! Shapes made ready for many rays: sines of their turn, edges of planes, axes of unit length are worked out once.

use glam::DVec3;

use super::cone::Cone;
use super::flat::Flat;
use super::kinds::Shape;
use super::map::DepthMap;
use super::meeting::{Meeting, in_front};
use super::mesh::Mesh;
use super::pose::Pose;
use super::{flat, person, round, solid};
use crate::scene::vector::{Ray, turned};

/// A [`Shape`] where it stands.
#[derive(Debug)]
pub(in crate::scene) enum PlacedShape<'a> {
    Ground {
        depth_m: f64,
    },
    Plane(Flat),
    Box {
        pose: Pose,
        size_m: DVec3,
    },
    Sphere {
        centre_m: DVec3,
        radius_m: f64,
    },
    Cylinder {
        centre_m: DVec3,
        /// Of unit length.
        axis: DVec3,
        radius_m: f64,
        height_m: f64,
    },
    Cone(Cone),
    Person {
        pose: Pose,
        height_m: f64,
    },
    Mesh {
        pose: Pose,
        scale_m: f64,
        mesh: &'a Mesh,
    },
    Map {
        pose: Pose,
        map: &'a DepthMap,
    },
}

impl Shape {
    /// Distance along `ray` to the first surface point in front of its origin, m.
    #[cfg(test)]
    pub(crate) fn intersect(&self, ray: &Ray) -> Option<f64> {
        self.placed().intersect(ray).map(|meeting| meeting.range_m)
    }

    /// The shape made ready for many rays.
    pub(in crate::scene) fn placed(&self) -> PlacedShape<'_> {
        PlacedShape::new(self)
    }
}

impl<'a> PlacedShape<'a> {
    pub(super) fn new(shape: &'a Shape) -> Self {
        match *shape {
            Shape::Ground { depth_m } => PlacedShape::Ground { depth_m },
            Shape::Plane {
                centre_m,
                normal,
                width_m,
                height_m,
            } => PlacedShape::Plane(Flat::new(centre_m, normal, (width_m, height_m))),
            Shape::Box {
                centre_m,
                size_m,
                yaw_deg,
            } => PlacedShape::Box {
                pose: Pose::new(centre_m, yaw_deg),
                size_m,
            },
            Shape::Sphere { centre_m, radius_m } => PlacedShape::Sphere { centre_m, radius_m },
            Shape::Cylinder {
                centre_m,
                axis,
                radius_m,
                height_m,
            } => PlacedShape::Cylinder {
                centre_m,
                axis: axis.normalize(),
                radius_m,
                height_m,
            },
            Shape::Cone {
                centre_m,
                axis,
                radius_m,
                tip_radius_m,
                height_m,
            } => PlacedShape::Cone(Cone::new(
                centre_m,
                axis,
                (radius_m, tip_radius_m),
                height_m,
            )),
            Shape::Person {
                foot_m,
                height_m,
                yaw_deg,
            } => PlacedShape::Person {
                pose: Pose::new(foot_m, yaw_deg),
                height_m,
            },
            Shape::Mesh {
                centre_m,
                scale_m,
                yaw_deg,
                ref mesh,
            } => PlacedShape::Mesh {
                pose: Pose::new(centre_m, yaw_deg),
                scale_m,
                mesh,
            },
            Shape::Map {
                centre_m,
                yaw_deg,
                ref map,
            } => PlacedShape::Map {
                pose: Pose::new(centre_m, yaw_deg),
                map,
            },
        }
    }

    /// Where a ray first meets the surface.
    pub(in crate::scene) fn intersect(&self, ray: &Ray) -> Option<Meeting> {
        match *self {
            PlacedShape::Ground { depth_m } => flat::meet_ground(ray, depth_m),
            PlacedShape::Plane(ref flat) => flat.intersect(ray),
            PlacedShape::Box { pose, size_m } => solid::meet_box(&pose.inwards(ray), size_m),
            PlacedShape::Sphere { centre_m, radius_m } => {
                round::meet_sphere(ray, centre_m, radius_m)
            }
            PlacedShape::Cylinder {
                centre_m,
                axis,
                radius_m,
                height_m,
            } => round::meet_cylinder(ray, centre_m, axis, (radius_m, height_m)),
            PlacedShape::Cone(cone) => cone.intersect(ray),
            PlacedShape::Person { pose, height_m } => {
                person::intersect(&pose.inwards(ray), height_m)
            }
            PlacedShape::Mesh {
                pose,
                scale_m,
                mesh,
            } => {
                let inside = pose.inwards(ray);
                let scaled = Ray {
                    origin: inside.origin / scale_m,
                    direction: inside.direction,
                };
                let meeting = mesh.intersect(&scaled)?;
                let range_m = in_front(meeting.range_m * scale_m)?;
                Some(Meeting { range_m, ..meeting })
            }
            PlacedShape::Map { pose, map } => map.intersect(&pose.inwards(ray)),
        }
    }

    /// A unit vector at right angles to `part` of the surface at `point`, which lies on it; of the two it is any.
    pub(in crate::scene) fn normal_at(&self, point: DVec3, part: u32) -> DVec3 {
        match *self {
            PlacedShape::Ground { .. } => DVec3::NEG_Y,
            PlacedShape::Plane(ref flat) => flat.normal,
            PlacedShape::Box { pose, .. } => pose.outwards(solid::face_normal(part)),
            PlacedShape::Sphere { centre_m, .. } => (point - centre_m).normalize(),
            PlacedShape::Cylinder { centre_m, axis, .. } => {
                round::cylinder_normal(point - centre_m, axis, part)
            }
            PlacedShape::Cone(cone) => cone.normal_at(point, part),
            PlacedShape::Person { pose, height_m } => {
                pose.outwards(person::normal_at(pose.inside(point) / height_m, part))
            }
            PlacedShape::Mesh { pose, mesh, .. } => pose.outwards(mesh.normal(part)),
            PlacedShape::Map { pose, map } => pose.outwards(map.normal_at(pose.inside(point))),
        }
    }

    /// How that normal turns along a small step within the surface from `point`: not at all where it is flat. People and depth maps count as
    /// made of flats.
    pub(in crate::scene) fn bend(&self, point: DVec3, part: u32, step_m: DVec3) -> DVec3 {
        match *self {
            PlacedShape::Sphere { radius_m, .. } => step_m / radius_m,
            PlacedShape::Cylinder { axis, radius_m, .. } => {
                round::cylinder_bend(step_m, axis, radius_m, part)
            }
            PlacedShape::Cone(cone) => cone.bend(point, part, step_m),
            PlacedShape::Ground { .. }
            | PlacedShape::Plane(_)
            | PlacedShape::Box { .. }
            | PlacedShape::Person { .. }
            | PlacedShape::Mesh { .. }
            | PlacedShape::Map { .. } => DVec3::ZERO,
        }
    }

    /// Where on the surface `point` lies, m, in coordinates that turn and move with the shape: right (or around) and down.
    /// Round shapes do not know how they are turned, so it comes with the call: by `seen_turned_deg` to the left.
    pub(in crate::scene) fn on_surface(
        &self,
        point: DVec3,
        part: u32,
        seen_turned_deg: f64,
    ) -> (f64, f64) {
        let turned_back = |vector: DVec3| {
            let (sine, cosine) = libm::sincos(seen_turned_deg.to_radians());
            turned(vector, (cosine, sine))
        };
        match *self {
            PlacedShape::Ground { .. } => (point.x, -point.z),
            PlacedShape::Plane(ref flat) => flat.on_surface(point),
            PlacedShape::Box { pose, .. } => solid::on_face(pose.inside(point), part),
            PlacedShape::Sphere { centre_m, radius_m } => {
                round::on_sphere(turned_back(point - centre_m), radius_m)
            }
            PlacedShape::Cylinder {
                centre_m,
                axis,
                radius_m,
                ..
            } => {
                let (offset, axis) = (turned_back(point - centre_m), turned_back(axis));
                round::on_cylinder(offset, axis, radius_m, part)
            }
            PlacedShape::Cone(cone) => cone.on_surface(point, part, turned_back),
            PlacedShape::Person { pose, .. } => {
                // Front and back carry what hangs straight down them; no two limbs carry the same.
                let inside = pose.inside(point);
                (inside.x + 0.7 * inside.z, inside.y)
            }
            PlacedShape::Mesh {
                pose,
                scale_m,
                mesh,
            } => {
                let (u, v) = mesh.on_surface(pose.inside(point) / scale_m, part);
                (u * scale_m, v * scale_m)
            }
            PlacedShape::Map { pose, .. } => {
                let inside = pose.inside(point);
                (inside.x, inside.y)
            }
        }
    }

    /// Reflectivity for the laser and for the cameras, where the shape itself knows them.
    pub(in crate::scene) fn own_material(&self, point: DVec3) -> (Option<f64>, Option<f64>) {
        match self {
            PlacedShape::Map { pose, map } => map.material_at(pose.inside(point)),
            _ => (None, None),
        }
    }
}
