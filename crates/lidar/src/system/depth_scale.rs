//! Depths at the ends of the colour scale: the same in `depth.png`, on the page and in Python.

use crate::scene::Scene;

/// Farthest end of the scale of a drive, m.
const FARTHEST_M: f32 = 200.0;

/// Ends of the scale of a frame, m: whole metres about its shortest and its longest depth; 0 and 1 without a depth.
pub fn frame_scale_m(depths_m: impl IntoIterator<Item = f64>) -> (f32, f32) {
    let ends = (f32::INFINITY, f32::NEG_INFINITY);
    let (shortest, longest) = (depths_m.into_iter())
        .map(|depth_m| depth_m as f32)
        .fold(ends, |(least, most), m| (least.min(m), most.max(m)));
    if shortest.is_finite() && longest.is_finite() {
        (shortest.floor(), longest.ceil().max(shortest.floor() + 1.0))
    } else {
        (0.0, 1.0)
    }
}

/// Ends of the scale of all frames of a drive, m: what the scene's camera pair measures, up to 200 m.
pub fn drive_scale_m(scene: &Scene) -> (f32, f32) {
    let stereo = &scene.stereo;
    let metre_pixels = stereo.camera().focal_px * stereo.baseline_m;
    let [near, far] =
        [stereo.max_disparity_px, stereo.min_disparity_px].map(|px| (metre_pixels / px) as f32);
    (near, far.min(FARTHEST_M))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_frame_ends_at_whole_metres_a_metre_apart_at_least() {
        assert_eq!(frame_scale_m([31.5, 3.2, 8.0]), (3.0, 32.0));
        assert_eq!(frame_scale_m([7.0]), (7.0, 8.0));
        assert_eq!(frame_scale_m([]), (0.0, 1.0));
        assert_eq!(frame_scale_m([f64::NAN, 2.5]), (2.0, 3.0));
    }

    #[test]
    fn a_drive_ends_where_its_cameras_do() {
        let (near, far) = drive_scale_m(&Scene::outdoor());
        assert!(
            (14.9..15.1).contains(&near) && far == FARTHEST_M,
            "{near} {far}"
        );
    }
}
