//! What is really there: the surface that every macropixel sees.
//!
//! A macropixel is taken to see one point, the one on the ray through its centre; edges that
//! cross a macropixel do not mix two distances.

use glam::DVec3;

use super::cast::Hit;
use super::settings::Scene;
use super::vector::Ray;

/// True range and reflectivity of every macropixel, row by row from the top left.
#[derive(Debug, Clone, PartialEq)]
pub struct GroundTruth {
    /// Rows of the array.
    pub rows: u32,
    /// Columns of the array.
    pub cols: u32,
    /// Distance from the lidar along the ray (not z), m; `None` for the sky. Length rows·cols.
    pub range_m: Vec<Option<f64>>,
    /// Reflectivity of the surface, 0 for the sky. Length rows·cols.
    pub reflectivity: Vec<f64>,
    /// Index of the surface's object in [`Scene::objects`]; `None` for the sky. Length rows·cols.
    pub object: Vec<Option<usize>>,
}

impl GroundTruth {
    /// Looks along the centre ray of every macropixel of a `rows` × `cols` array.
    pub fn render(scene: &Scene, rows: u32, cols: u32) -> Self {
        let camera = scene.lidar_camera(rows, cols);
        let hits: Vec<Option<Hit>> = (0..rows)
            .flat_map(|row| (0..cols).map(move |col| (row, col)))
            .map(|(row, col)| {
                let centre = (f64::from(col) + 0.5, f64::from(row) + 0.5);
                scene.hit(&Ray::new(DVec3::ZERO, camera.at_unit_depth(centre)))
            })
            .collect();
        GroundTruth {
            rows,
            cols,
            range_m: hits.iter().map(|h| h.map(|h| h.range_m)).collect(),
            reflectivity: hits
                .iter()
                .map(|h| h.map_or(0.0, |h| h.reflectivity))
                .collect(),
            object: hits.iter().map(|h| h.map(|h| h.object)).collect(),
        }
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
        assert!((corner - expected).abs() < 1e-9, "{corner} {expected}");
        assert!(truth.reflectivity.iter().all(|&r| r == 0.4));
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
