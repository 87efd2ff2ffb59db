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
            let disparity_px = f64::from(map.at(row, col)?);
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
