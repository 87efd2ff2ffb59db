//! Where rays end: the nearest surface along one, and everything that sends light back along it.

use glam::DVec3;
use smallvec::{SmallVec, smallvec};

use super::settings::Scene;
use super::vector::Ray;

/// A surface point that a ray meets, and what its material is there.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Hit {
    /// Distance from the ray's origin, m.
    pub range_m: f64,
    /// Unit vector at right angles to the surface, on the side of the ray's origin.
    pub normal: DVec3,
    /// Lambertian reflectivity at the laser's wavelength, 0 to 1.
    pub reflectivity: f64,
    /// Lambertian reflectivity that the cameras see, 0 to 1.
    pub grey: f64,
    /// How many times more of the laser's light returns than from a Lambertian surface of this reflectivity, 1 or more.
    pub retro: f64,
    /// Index into [`Scene::objects`].
    pub object: usize,
}

/// A surface that sends light back along a ray.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Return {
    /// The surface; its range is the whole way to it, its normal is turned against the light that meets it.
    pub hit: Hit,
    /// Share of the laser's light that is left of the way there and back by panes, 0 to 1.
    pub share: f64,
    /// Share of the surface's own light (sunlight that it reflects) that arrives, 0 to 1.
    pub share_back: f64,
}

/// All that sends light back along a ray, nearest first.
#[derive(Debug, Clone, PartialEq)]
pub struct Returns {
    /// Surfaces; none where there is only sky.
    pub surfaces: SmallVec<[Return; 2]>,
    /// Share of the sky's light that arrives, 0 to 1.
    pub sky_share: f64,
}

impl Scene {
    /// The nearest opaque surface along `ray`; `None` for the sky. Of two in the same place the one
    /// listed first in the scene counts.
    pub fn hit(&self, ray: &Ray) -> Option<Hit> {
        let mut nearest: Option<(f64, usize)> = None;
        for (index, object) in self.objects.iter().enumerate() {
            if let Some(range_m) = object.shape.intersect(ray)
                && nearest.is_none_or(|(least_m, _)| range_m < least_m)
            {
                nearest = Some((range_m, index));
            }
        }
        let (range_m, index) = nearest?;
        let object = &self.objects[index];
        let normal = object.shape.normal_at(ray.at(range_m));
        Some(Hit {
            range_m,
            normal: if normal.dot(ray.direction) > 0.0 {
                -normal
            } else {
                normal
            },
            reflectivity: object.reflectivity,
            grey: object.grey.unwrap_or(object.reflectivity),
            retro: object.retro,
            object: index,
        })
    }

    /// All that sends light back along `ray`.
    pub fn returns(&self, ray: &Ray) -> Returns {
        match self.hit(ray) {
            Some(hit) => Returns {
                surfaces: smallvec![Return {
                    hit,
                    share: 1.0,
                    share_back: 1.0,
                }],
                sky_share: 0.0,
            },
            None => Returns {
                surfaces: smallvec![],
                sky_share: 1.0,
            },
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::scene::{Object, Shape};
    use proptest::prelude::*;

    fn wall(z_m: f64) -> Object {
        let shape = Shape::Plane {
            centre_m: DVec3::new(0.0, 0.0, z_m),
            normal: DVec3::new(0.0, 0.0, 1.0),
            width_m: 1e4,
            height_m: 1e4,
        };
        Object::new("wall", 0.4, shape)
    }

    fn scene(objects: Vec<Object>) -> Scene {
        let mut scene = Scene::outdoor();
        scene.objects = objects;
        scene
    }

    fn ahead() -> Ray {
        Ray::new(DVec3::ZERO, DVec3::Z)
    }

    #[test]
    fn the_nearest_surface_hides_the_others() {
        let scene = scene(vec![wall(50.0), wall(20.0)]);
        let hit = scene.hit(&ahead()).unwrap();
        assert_eq!((hit.range_m, hit.object), (20.0, 1));
        let returns = scene.returns(&ahead());
        assert_eq!(returns.surfaces.len(), 1);
        assert_eq!((returns.surfaces[0].hit, returns.sky_share), (hit, 0.0));
    }

    #[test]
    fn cameras_see_what_the_laser_sees_unless_told_otherwise() {
        let mut objects = vec![wall(5.0)];
        let hit = scene(objects.clone()).hit(&ahead()).unwrap();
        assert_eq!((hit.reflectivity, hit.grey, hit.retro), (0.4, 0.4, 1.0));
        objects[0].grey = Some(0.1);
        objects[0].retro = 500.0;
        let hit = scene(objects).hit(&ahead()).unwrap();
        assert_eq!((hit.reflectivity, hit.grey, hit.retro), (0.4, 0.1, 500.0));
    }

    #[test]
    fn nothing_but_sky_returns_nothing() {
        let returns = scene(vec![]).returns(&ahead());
        assert_eq!((returns.surfaces.len(), returns.sky_share), (0, 1.0));
    }

    proptest! {
        /// The normal says how the range changes with the ray: to first order, neighbouring rays end in the plane at
        /// right angles to it.
        #[test]
        fn normals_are_at_right_angles_to_the_surface(
            x in -0.4f64..0.4, y in -0.4f64..0.4, yaw_deg in -180.0f64..180.0, kind in 0..4,
        ) {
            let centre_m = DVec3::new(0.0, 0.0, 5.0);
            let shape = match kind {
                0 => Shape::Ground { depth_m: 1.0 },
                1 => Shape::Plane { centre_m, normal: DVec3::new(0.3, -0.5, 1.0), width_m: 9.0, height_m: 9.0 },
                2 => Shape::Box { centre_m, size_m: DVec3::new(1.0, 2.0, 3.0), yaw_deg },
                _ => Shape::Sphere { centre_m, radius_m: 1.5 },
            };
            let scene = scene(vec![Object::new("it", 0.5, shape)]);
            let ray = |x, y| Ray::new(DVec3::ZERO, DVec3::new(x, y, 1.0));
            let Some(hit) = scene.hit(&ray(x, y)) else { return Ok(()) };
            prop_assert!((hit.normal.length() - 1.0).abs() < 1e-12);
            prop_assert!(hit.normal.dot(ray(x, y).direction) <= 0.0);
            let point = ray(x, y).at(hit.range_m);
            for (dx, dy) in [(1e-6, 0.0), (0.0, 1e-6)] {
                let beside = ray(x + dx, y + dy);
                let Some(next) = scene.hit(&beside) else { continue };
                let same_face = (next.normal - hit.normal).length() < 1e-3;
                // Where a ray grazes, one step is no small one.
                if same_face && hit.normal.dot(ray(x, y).direction) < -0.1 {
                    let along = (beside.at(next.range_m) - point).normalize();
                    prop_assert!(along.dot(hit.normal).abs() < 1e-3, "{along} {}", hit.normal);
                }
            }
        }
    }
}
