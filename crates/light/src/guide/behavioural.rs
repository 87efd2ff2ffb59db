//! The guide of a camera pair whose errors are drawn, not made by matching images (thesis 5.2).

use super::mapping;
use super::third_camera::{nearer_pair, with_third_camera};
use super::{Guide, GuideError, GuideInput, GuideMap};
use crate::scene::Scene;

/// The scene's stereo rig with the errors of [`StereoRig`](super::StereoRig).
///
/// The standard deviation of a range is Eq. 27's at the estimated depth, rounding to sub-pixel steps included.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub struct BehaviouralStereo;

impl Guide for BehaviouralStereo {
    fn name(&self) -> &str {
        "stereo"
    }

    fn estimate(&self, input: &GuideInput<'_>) -> Result<GuideMap, GuideError> {
        Ok(with_third_camera(input, |input| {
            mapping::of_rig(input.scene, input.rows, input.cols, input.seed)
        }))
    }

    fn reach(&self, scene: &Scene) -> Option<String> {
        let stereo = &scene.stereo;
        let metre_pixels = stereo.camera().focal_px * stereo.baseline_m;
        let shortest_m = nearer_pair(stereo).map_or(stereo.baseline_m, |pair| pair.baseline_m);
        Some(format!(
            "the camera pair measures from {:.1} m to {:.1} m, where both cameras see the same",
            stereo.camera().focal_px * shortest_m / stereo.max_disparity_px,
            metre_pixels / stereo.min_disparity_px,
        ))
    }
}
