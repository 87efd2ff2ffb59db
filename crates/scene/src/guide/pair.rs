//! The guide of a real camera pair: disparities that were matched in its pictures, by its calibration (thesis 5.2.3, Eq. 30 and 31).

use super::mapping;
use super::stereo::StereoPoint;
use super::{Guide, GuideError, GuideInput, GuideMap};
use crate::scene::PinholeCamera;
use crate::stereo::DisparityMap;

/// Points that were matched, in the left camera's coordinates. The camera stands where the scene's principal camera does
/// ([`Stereo::position_m`](crate::scene::Stereo)) and looks the lidar's way.
#[derive(Debug, Clone, PartialEq)]
pub struct MatchedPair {
    points: Vec<StereoPoint>,
    sigma_px: f64,
    focal_baseline_px_m: f64,
}

impl MatchedPair {
    /// The points of `map`, which the left camera `camera` has seen. A point at infinity has the disparity −`offset_px`: by so much the right
    /// camera's principal point is further right. `sigma_px` is the standard deviation that is claimed for a disparity.
    pub fn new(
        map: &DisparityMap,
        camera: &PinholeCamera,
        baseline_m: f64,
        offset_px: f64,
        sigma_px: f64,
    ) -> Self {
        let focal_baseline_px_m = camera.focal_px * baseline_m;
        let pixels = (0..map.height()).flat_map(|row| (0..map.width()).map(move |col| (row, col)));
        let points = pixels.filter_map(|(row, col)| {
            let disparity_px = f64::from(map.disparity_px(row, col)?);
            let depth_m = focal_baseline_px_m / (disparity_px + offset_px);
            if depth_m <= 0.0 || !depth_m.is_finite() {
                return None;
            }
            let direction = camera.at_unit_depth((col as f64 + 0.5, row as f64 + 0.5));
            Some(StereoPoint {
                row: row as u32,
                col: col as u32,
                disparity_px,
                depth_m,
                point_m: direction * depth_m,
            })
        });
        MatchedPair {
            points: points.collect(),
            sigma_px,
            focal_baseline_px_m,
        }
    }

    /// How many points there are.
    pub fn points(&self) -> usize {
        self.points.len()
    }
}

impl Guide for MatchedPair {
    fn name(&self) -> &str {
        "pair"
    }

    fn estimate(&self, input: &GuideInput<'_>) -> Result<GuideMap, GuideError> {
        let sigma_m = |depth_m: f64| depth_m * depth_m * self.sigma_px / self.focal_baseline_px_m;
        let points = (self.points.iter()).map(|point| (point, sigma_m(point.depth_m), false));
        Ok(mapping::of_points(
            input.scene,
            input.rows,
            input.cols,
            points,
        ))
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::guide::test_scenes::wall_at;

    /// Pictures of a wall at 30 m, of cameras whose principal points are 4 px apart: every macropixel is guided to it, with Eq. 27's claim.
    #[test]
    fn matched_points_guide_to_their_depth() {
        let scene = wall_at(30.0);
        let camera = scene.stereo.camera();
        let baseline_m = scene.stereo.baseline_m;
        let (width, height) = (camera.width as usize, camera.height as usize);
        let disparity_px = camera.focal_px * baseline_m / 30.0;
        let mut px = vec![(disparity_px - 4.0) as f32; width * height];
        // No answer, and one that is beyond infinity.
        (px[0], px[1]) = (f32::NAN, -5.0);
        let map = DisparityMap { width, height, px };
        let pair = MatchedPair::new(&map, &camera, baseline_m, 4.0, 0.2);
        assert_eq!((pair.name(), pair.points()), ("pair", width * height - 2));
        let guided = pair.estimate(&GuideInput::still(&scene, 8, 8, 1)).unwrap();
        let lidar = scene.lidar_camera(8, 8);
        for pixel in 0..64 {
            let (range_m, sigma_m) = guided.estimate_of(pixel).expect("the wall");
            let centre = ((pixel % 8) as f64 + 0.5, (pixel / 8) as f64 + 0.5);
            let wanted_m = 30.0 * lidar.at_unit_depth(centre).length();
            assert!(
                (range_m / wanted_m - 1.0).abs() < 1e-3,
                "{pixel}: {range_m} {wanted_m}"
            );
            let of_point_m = 30.0 * 30.0 * 0.2 / (camera.focal_px * baseline_m);
            assert!(
                (sigma_m / of_point_m - 1.0).abs() < 0.03,
                "{pixel}: {sigma_m}"
            );
        }
    }
}
