//! What is really there: the surfaces that every macropixel sees ([`view`](super::view)).
//!
//! The true range of a macropixel is that of the surface that sends back most of the laser's light: the mean over its rays, weighted
//! by their light. What sees the same in two worlds is looked at once ([`unmoved`](super::unmoved)).

use std::sync::Arc;

use glam::DVec3;
use rayon::prelude::*;
use smallvec::SmallVec;

use super::bounds::Bounds;
use super::cast::Stage;
use super::settings::Scene;
use super::unmoved::MovedObjects;
use super::view::{Surface, View, cone};
use crate::photon::DEEP;
use crate::units::TimeOfFlight;

/// True range and reflectivity of every macropixel, row by row from the top left.
#[derive(Debug, Clone, PartialEq)]
pub struct GroundTruth {
    /// Rows of the array.
    pub rows: u32,
    /// Columns of the array.
    pub cols: u32,
    /// Distance from the lidar along the ray (not z) of the surface that sends back most light, m; `None` for the sky.
    /// Length rows·cols.
    pub range_m: Vec<Option<f64>>,
    /// Reflectivity of that surface, 0 for the sky. Length rows·cols.
    pub reflectivity: Vec<f64>,
    /// Index of its object in [`Scene::objects`]; `None` for the sky. Length rows·cols.
    pub object: Vec<Option<usize>>,
    /// All surfaces that a macropixel sees, that which sends back most light first. Length rows·cols.
    pub surfaces: Vec<SmallVec<[Surface; 1]>>,
    /// Shared with other worlds that look the same.
    pub(super) views: Vec<Arc<View>>,
}

/// A world that stands still, and what was seen of it.
#[derive(Debug, Clone, Copy)]
pub struct PreviousWorld<'a> {
    /// The world.
    pub world: &'a Scene,
    /// What was seen of it.
    pub truth: &'a GroundTruth,
}

impl GroundTruth {
    /// Looks out of every macropixel of a `rows` × `cols` array.
    pub fn render(scene: &Scene, rows: u32, cols: u32) -> Self {
        Self::render_after(scene, rows, cols, None).0
    }

    /// The same, where macropixels keep what they saw of a world `before` that looks the same to them. It is of as many rows and
    /// columns. Returns how many there are, too.
    pub fn render_after(
        scene: &Scene,
        rows: u32,
        cols: u32,
        before: Option<PreviousWorld<'_>>,
    ) -> (Self, usize) {
        let moved = before.and_then(|before| {
            debug_assert_eq!((before.truth.rows, before.truth.cols), (rows, cols));
            Some((
                MovedObjects::from_worlds(before.world, scene)?,
                before.truth,
            ))
        });
        let camera = scene.lidar_camera(rows, cols);
        let (stage, bounds) = (Stage::new(scene), Bounds::from_scene(scene, DVec3::ZERO));
        let place = |pixel: u32| (pixel / cols, pixel % cols);
        let deep_m = DEEP * scene.pulse_resolution().as_range_m();
        let is_kept = |pixel: u32| {
            let moved = moved.as_ref();
            moved.is_some_and(|(moved, _)| moved.is_out_of_sight(cone(&camera, place(pixel))))
        };
        let pixels = || (0..rows * cols).into_par_iter();
        let is_kept: Vec<bool> = pixels().map(is_kept).collect();
        let seen = |pixel: u32| match &moved {
            Some((_, before)) if is_kept[pixel as usize] => {
                let pixel = pixel as usize;
                (before.views[pixel].clone(), before.surfaces[pixel].clone())
            }
            _ => {
                let view = View::new(&stage, &bounds, &camera, place(pixel), deep_m);
                let surfaces = view.surfaces(&scene.medium);
                (Arc::new(view), surfaces)
            }
        };
        type Surfaces = Vec<SmallVec<[Surface; 1]>>;
        let (views, surfaces): (Vec<Arc<View>>, Surfaces) = pixels().map(seen).unzip();
        let kept = is_kept.iter().filter(|is_kept| **is_kept).count();
        let brightest = || surfaces.iter().map(|surfaces| surfaces.first());
        let truth = GroundTruth {
            rows,
            cols,
            range_m: brightest().map(|s| s.map(|s| s.range_m)).collect(),
            reflectivity: brightest()
                .map(|s| s.map_or(0.0, |s| s.reflectivity))
                .collect(),
            object: brightest().map(|s| s.map(|s| s.object)).collect(),
            surfaces,
            views,
        };
        (truth, kept)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::scene::{Object, Shape};

    /// The outdoor optics before a wall at `z_m`.
    fn wall(z_m: f64) -> Scene {
        let mut scene = Scene::outdoor();
        let shape = Shape::Plane {
            centre_m: DVec3::new(0.0, 0.0, z_m),
            normal: DVec3::new(0.0, 0.0, 1.0),
            width_m: 1e4,
            height_m: 1e4,
        };
        scene.objects = vec![Object::new("wall", 0.4, shape)];
        scene
    }

    #[test]
    fn range_is_radial_not_depth() {
        let truth = GroundTruth::render(&wall(50.0), 64, 64);
        let corner = truth.range_m[0].unwrap();
        let half = (8f64).to_radians().tan() * 63.0 / 64.0;
        let expected = 50.0 * (1.0 + 2.0 * half * half).sqrt();
        assert!((corner - expected).abs() < 1e-3, "{corner} {expected}");
        assert!(truth.reflectivity.iter().all(|&r| (r - 0.4).abs() < 1e-12));
    }

    #[test]
    fn an_edge_gives_both_surfaces_and_the_range_of_the_brighter_one() {
        let mut scene = wall(50.0);
        // The near wall fills the right 0.3 of the only macropixel.
        scene.lidar.fov_deg = 1.0;
        let half_m = 20.0 * 0.5f64.to_radians().tan();
        let shape = Shape::Plane {
            centre_m: DVec3::new(0.4 * half_m + 5.0, 0.0, 20.0),
            normal: DVec3::Z,
            width_m: 10.0,
            height_m: 10.0,
        };
        scene.objects.push(Object::new("near", 0.4, shape));
        let truth = GroundTruth::render(&scene, 1, 1);
        let surfaces = &truth.surfaces[0];
        assert_eq!(surfaces.len(), 2);
        assert_eq!(truth.object[0], Some(1));
        let (near, far) = (surfaces[0], surfaces[1]);
        assert!((near.ray_share - 0.3).abs() < 0.01, "{near:?}");
        // Its light: share times 1/r².
        let expected = 0.3 / 400.0 / (0.3 / 400.0 + 0.7 / 2500.0);
        assert!((near.light_share - expected).abs() < 0.01, "{near:?}");
        assert!((near.light_share + far.light_share - 1.0).abs() < 1e-12);
        assert!((near.range_m - 20.0).abs() < 0.01 && (far.range_m - 50.0).abs() < 0.01);
    }

    #[test]
    fn a_black_surface_still_has_its_range() {
        let mut scene = wall(50.0);
        scene.objects[0].reflectivity = 0.0;
        let truth = GroundTruth::render(&scene, 4, 4);
        assert!(
            truth
                .range_m
                .iter()
                .all(|r| (r.unwrap() - 50.0).abs() < 1.0)
        );
    }

    #[test]
    fn the_street_has_sky_above_and_every_object_in_view() {
        let scene = Scene::outdoor();
        let truth = GroundTruth::render(&scene, 64, 64);
        assert!(
            truth.range_m[..64].iter().any(Option::is_none),
            "no sky in the top row"
        );
        assert!(truth.range_m[63 * 64..].iter().all(Option::is_some));
        for (index, object) in scene.objects.iter().enumerate() {
            let pixels = truth.object.iter().filter(|o| **o == Some(index)).count();
            assert!(pixels >= 2, "{} covers {pixels} macropixels", object.name);
        }
        let ranges = truth.range_m.iter().flatten();
        let (near, far) = ranges.fold((f64::MAX, 0f64), |(a, b), &r| (a.min(r), b.max(r)));
        assert!(near > 14.0 && far < 200.0, "{near} to {far} m");
    }
}
