//! Shapes of all kinds, each made ready for many rays.

use glam::DVec3;

use super::cone::Cone;
use super::flat::{Flat, Level};
use super::kinds::Shape;
use super::map::PlacedMap;
use super::meeting::Meeting;
use super::mesh::PlacedMesh;
use super::person::Person;
use super::round::{Ball, Cylinder};
use super::solid::Block;
use super::surface::Surface;
use crate::scene::vector::Ray;

/// One variant a kind, which passes each question on.
macro_rules! surfaces {
    ($($kind:ident($surface:ty)),+ $(,)?) => {
        /// A [`Shape`] where it stands.
        #[derive(Debug)]
        pub(in crate::scene) enum PlacedShape<'a> {
            $($kind($surface)),+
        }

        impl Surface for PlacedShape<'_> {
            fn intersect(&self, ray: &Ray) -> Option<Meeting> {
                match self {
                    $(PlacedShape::$kind(surface) => surface.intersect(ray)),+
                }
            }

            fn normal_at(&self, point: DVec3, part: u32) -> DVec3 {
                match self {
                    $(PlacedShape::$kind(surface) => surface.normal_at(point, part)),+
                }
            }

            fn bend(&self, point: DVec3, part: u32, step_m: DVec3) -> DVec3 {
                match self {
                    $(PlacedShape::$kind(surface) => surface.bend(point, part, step_m)),+
                }
            }

            fn on_surface(&self, point: DVec3, part: u32, seen_turned_deg: f64) -> (f64, f64) {
                match self {
                    $(PlacedShape::$kind(surface) => surface.on_surface(point, part, seen_turned_deg)),+
                }
            }

            fn own_material(&self, point: DVec3) -> (Option<f64>, Option<f64>) {
                match self {
                    $(PlacedShape::$kind(surface) => surface.own_material(point)),+
                }
            }
        }
    };
}

surfaces! {
    Ground(Level),
    Plane(Flat),
    Box(Block),
    Sphere(Ball),
    Cylinder(Cylinder),
    Cone(Cone),
    Person(Person),
    Mesh(PlacedMesh<'a>),
    Map(PlacedMap<'a>),
}

impl Shape {
    /// Distance along `ray` to the first surface point in front of its origin, m.
    #[cfg(test)]
    pub(crate) fn intersect(&self, ray: &Ray) -> Option<f64> {
        self.placed().intersect(ray).map(|meeting| meeting.range_m)
    }

    /// The shape made ready for many rays.
    pub(in crate::scene) fn placed(&self) -> PlacedShape<'_> {
        match *self {
            Shape::Ground { depth_m } => PlacedShape::Ground(Level { depth_m }),
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
            } => PlacedShape::Box(Block::new(centre_m, yaw_deg, size_m)),
            Shape::Sphere { centre_m, radius_m } => {
                PlacedShape::Sphere(Ball { centre_m, radius_m })
            }
            Shape::Cylinder {
                centre_m,
                axis,
                radius_m,
                height_m,
            } => PlacedShape::Cylinder(Cylinder::new(centre_m, axis, radius_m, height_m)),
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
            } => PlacedShape::Person(Person::new(foot_m, yaw_deg, height_m)),
            Shape::Mesh {
                centre_m,
                scale_m,
                yaw_deg,
                ref mesh,
            } => PlacedShape::Mesh(PlacedMesh::new(centre_m, yaw_deg, scale_m, mesh)),
            Shape::Map {
                centre_m,
                yaw_deg,
                ref map,
            } => PlacedShape::Map(PlacedMap::new(centre_m, yaw_deg, map)),
        }
    }
}
