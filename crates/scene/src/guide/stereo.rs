//! A stereo camera pair that measures distance with realistic errors (thesis 5.2).
//!
//! No images are matched. For a pixel of the principal (left) camera the scene gives the true
//! point; its disparity d = f·B/Z (Eq. 26) gets a Gaussian error, is rounded to the matcher's
//! sub-pixel step, and turned back into Z' = f·B/d. The error of Z' so grows with Z² (Eq. 27).
//! A pixel has no distance when the second camera does not see its point (occlusion, or outside
//! its image), when it looks at the sky, or when the disparity is outside the search range.
//!
//! Both cameras look along the lidar's z axis. A yaw error turns the right camera outwards after
//! calibration, unknown to the matcher: disparities grow and distances come out short (Fig. 70).
//!
//! Limits: errors of neighbouring pixels are independent, whereas a matcher smooths; there are
//! no gross mismatches, and texture and light play no part.

use glam::DVec3;

use super::right_camera::RightCamera;
use crate::photon::{RandomPurpose, normal, random_stream};
use crate::scene::{PinholeCamera, Ray, Scene, Stage};

/// How much nearer than the expected point the right camera's view may end, as a share of the
/// range, before the point counts as occluded: room for rounding on slanted surfaces.
const OCCLUSION_TOLERANCE: f64 = 1e-6;

/// The stereo cameras in a scene.
#[derive(Debug)]
pub struct StereoRig<'a> {
    stage: Stage<'a>,
    /// Either camera, in its own coordinates.
    pub(crate) camera: PinholeCamera,
    right: RightCamera,
    seed: u64,
}

/// What the rig finds out about one pixel of its principal camera.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct StereoPoint {
    /// Row of the pixel.
    pub row: u32,
    /// Column of the pixel.
    pub col: u32,
    /// Measured disparity, px.
    pub disparity_px: f64,
    /// Estimated depth along the camera's axis, m (Z' of Eq. 26).
    pub depth_m: f64,
    /// The estimated point in the principal camera's coordinates (Eq. 31), m.
    pub point_m: DVec3,
}

impl<'a> StereoRig<'a> {
    /// The rig of `scene`; equal seeds give equal errors.
    pub fn new(scene: &'a Scene, seed: u64) -> Self {
        StereoRig {
            stage: Stage::new(scene),
            camera: scene.stereo.camera(),
            right: RightCamera::new(&scene.stereo),
            seed,
        }
    }

    /// Focal length times baseline, px·m: depth times disparity (Eq. 26).
    pub(crate) fn focal_baseline_px_m(&self) -> f64 {
        self.camera.focal_px * self.stage.scene.stereo.baseline_m
    }

    /// The standard deviation of the estimated depth at depth `depth_m`, m (Eq. 27), the
    /// rounding to sub-pixel steps (variance step²/12) included.
    pub(crate) fn depth_sigma_m(&self, depth_m: f64) -> f64 {
        let stereo = &self.stage.scene.stereo;
        let step_px = 1.0 / f64::from(stereo.subpixel_steps);
        let sigma_px = (stereo.disparity_sigma_px.powi(2) + step_px * step_px / 12.0).sqrt();
        depth_m * depth_m * sigma_px / self.focal_baseline_px_m()
    }

    /// Measures pixel (`row`, `col`) of the principal camera; `None` where stereo has no answer.
    ///
    /// A pure function of the scene, the seed and the pixel.
    pub fn measure(&self, row: u32, col: u32) -> Option<StereoPoint> {
        let pixel = (f64::from(col) + 0.5, f64::from(row) + 0.5);
        let direction = self.camera.at_unit_depth(pixel);
        let true_disparity_px = self.true_disparity_px(pixel)?;
        let disparity_px = self.matched(row, col, true_disparity_px)?;
        let depth_m = self.focal_baseline_px_m() / disparity_px;
        Some(StereoPoint {
            row,
            col,
            disparity_px,
            depth_m,
            point_m: direction * depth_m,
        })
    }

    /// The disparity of what the principal camera sees at pixel coordinates; `None` in the sky and where the right camera does not see it.
    fn true_disparity_px(&self, at: (f64, f64)) -> Option<f64> {
        let stereo = &self.stage.scene.stereo;
        let ray = Ray::new(stereo.position_m, self.camera.at_unit_depth(at));
        let point_m = ray.point(self.stage.range_to_hit(&ray)?);
        Some(at.0 - self.seen_by_right_camera(point_m)?)
    }

    /// The image column at which the right camera sees `point_m`; `None` if it does not.
    fn seen_by_right_camera(&self, point_m: DVec3) -> Option<f64> {
        let origin = self.right.origin_m;
        let towards = point_m - origin;
        let (u, _) = self.right.sees_at(point_m)?;
        let first_m = self.stage.range_to_hit(&Ray::new(origin, towards))?;
        let visible = first_m >= towards.length() * (1.0 - OCCLUSION_TOLERANCE);
        visible.then_some(u)
    }

    /// What the matcher makes of a true disparity.
    fn matched(&self, row: u32, col: u32, true_disparity_px: f64) -> Option<f64> {
        let stereo = &self.stage.scene.stereo;
        let pixel = row * self.camera.width + col;
        let mut random = random_stream(self.seed, RandomPurpose::Stereo, pixel, 0);
        let noisy_px = true_disparity_px + stereo.disparity_sigma_px * normal(&mut random);
        let steps = f64::from(stereo.subpixel_steps);
        let disparity_px = (noisy_px * steps).round() / steps;
        let searched = stereo.min_disparity_px..=stereo.max_disparity_px;
        (disparity_px > 0.0 && searched.contains(&disparity_px)).then_some(disparity_px)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::numerics::intervals::mean_and_sigma;
    use crate::scene::{Object, Shape};

    fn wall(z_m: f64, half_width_m: f64) -> Object {
        Object::new(
            "wall",
            0.5,
            Shape::Plane {
                centre_m: DVec3::new(0.0, 0.0, z_m),
                normal: DVec3::new(0.0, 0.0, -1.0),
                width_m: 2.0 * half_width_m,
                height_m: 1e4,
            },
        )
    }

    fn scene_with(objects: Vec<Object>) -> Scene {
        let mut scene = Scene::outdoor();
        scene.objects = objects;
        scene
    }

    /// Depths measured by every fourth pixel in the middle of the image.
    fn depths_m(scene: &Scene) -> Vec<f64> {
        let rig = StereoRig::new(scene, 11);
        (200..880)
            .step_by(4)
            .flat_map(|row| (400..1040).step_by(4).map(move |col| (row, col)))
            .filter_map(|(row, col)| rig.measure(row, col).map(|p| p.depth_m))
            .collect()
    }

    #[test]
    fn depth_errors_grow_with_the_square_of_depth() {
        for z_m in [20.0, 40.0, 80.0, 120.0, 160.0] {
            let scene = scene_with(vec![wall(z_m, 1e4)]);
            let values = depths_m(&scene);
            assert!(values.len() > 20_000, "{} pixels at {z_m} m", values.len());
            let (mean_m, sigma_m) = mean_and_sigma(&values);
            let expected_m = StereoRig::new(&scene, 0).depth_sigma_m(z_m);
            assert!(
                (sigma_m / expected_m - 1.0).abs() < 0.04,
                "{z_m} m: {sigma_m} {expected_m}"
            );
            assert!((mean_m / z_m - 1.0).abs() < 3e-3, "{z_m} m: {mean_m}");
        }
    }

    /// Eq. 27 with the steps' error, as numbers: sub-pixel steps of a quarter and of one pixel beside 0.25 px.
    #[test]
    fn the_claimed_error_has_that_of_the_steps_in_it() {
        let mut scene = scene_with(vec![wall(30.0, 1e4)]);
        scene.stereo.disparity_sigma_px = 0.25;
        for (steps, sigma_px) in [
            (4, (0.0625f64 + 1.0 / 192.0).sqrt()),
            (1, (0.0625f64 + 1.0 / 12.0).sqrt()),
        ] {
            scene.stereo.subpixel_steps = steps;
            let rig = StereoRig::new(&scene, 0);
            let wanted_m = 50.0 * 50.0 * sigma_px / rig.focal_baseline_px_m();
            assert!((rig.depth_sigma_m(50.0) / wanted_m - 1.0).abs() < 1e-12);
        }
    }

    /// A point lies on the ray through the middle of its pixel, and no two pixels of the image err alike.
    #[test]
    fn points_lie_behind_the_middle_of_their_pixels() {
        let scene = scene_with(vec![wall(30.0, 1e4)]);
        let rig = StereoRig::new(&scene, 3);
        let mut errors = Vec::new();
        for (row, col) in (300..420).flat_map(|row| (700..820).map(move |col| (row, col))) {
            let point = rig.measure(row, col).expect("a wall");
            let (u, v) = rig
                .camera
                .project(point.point_m)
                .expect("before the camera");
            assert!(
                (u - f64::from(col) - 0.5).abs() < 1e-9 && (v - f64::from(row) - 0.5).abs() < 1e-9
            );
            errors.push(point.disparity_px);
        }
        let (mean, sigma) = mean_and_sigma(&errors);
        let n = errors.len() as f64;
        for apart in [1, 120, 121, 119] {
            let product = |(a, b): (&f64, &f64)| (a - mean) * (b - mean) / (sigma * sigma);
            let correlation = errors
                .iter()
                .zip(&errors[apart..])
                .map(product)
                .sum::<f64>()
                / n;
            assert!(
                correlation.abs() < 5.0 / n.sqrt(),
                "{apart} apart: {correlation}"
            );
        }
    }

    #[test]
    fn without_error_depth_is_exact_to_the_sub_pixel_step() {
        let mut scene = scene_with(vec![wall(30.0, 1e4)]);
        scene.stereo.disparity_sigma_px = 0.0;
        let point = StereoRig::new(&scene, 0).measure(540, 720).unwrap();
        let true_px = 3478.26 / 30.0;
        assert!((point.disparity_px - true_px).abs() <= 0.5 / 16.0 + 1e-3);
        assert_eq!(
            point.disparity_px * 16.0,
            (point.disparity_px * 16.0).round()
        );
    }

    #[test]
    fn too_near_and_too_far_have_no_answer() {
        assert!(depths_m(&scene_with(vec![wall(13.0, 1e4)])).is_empty());
        assert!(depths_m(&scene_with(vec![wall(400.0, 1e4)])).is_empty());
        assert!(depths_m(&scene_with(vec![])).is_empty());
    }

    #[test]
    fn what_the_right_camera_cannot_see_has_no_answer() {
        // A narrow post at 20 m before a wall at 60 m. The post covers columns of the left image
        // around its own, and hides a strip of wall from the right camera.
        let mut scene = scene_with(vec![wall(20.0, 0.25), wall(60.0, 1e4)]);
        scene.stereo.position_m = DVec3::ZERO;
        scene.stereo.disparity_sigma_px = 0.0;
        let rig = StereoRig::new(&scene, 0);
        let depth_at = |x_m: f64, z_m: f64| {
            let (u, v) = rig.camera.project(DVec3::new(x_m, 0.0, z_m)).unwrap();
            rig.measure(v as u32, u as u32).map(|p| p.depth_m.round())
        };
        assert_eq!(depth_at(0.0, 20.0), Some(20.0));
        // The right camera, at x = 1 m, sees wall points beyond the post at 1 + 3·(0 − 1) = −2 m.
        assert_eq!(depth_at(-2.0, 60.0), None);
        assert_eq!(depth_at(2.0, 60.0), Some(60.0));
    }

    #[test]
    fn cameras_that_verge_away_measure_short() {
        let mut scene = scene_with(vec![wall(40.0, 1e4)]);
        let (straight_m, _) = mean_and_sigma(&depths_m(&scene));
        scene.stereo.yaw_error_deg = 0.1;
        let (verged_m, _) = mean_and_sigma(&depths_m(&scene));
        // In the middle of the image 0.1° is f·tan(0.1°) = 6.07 px more than 86.96 px.
        let expected_m = 40.0 * 86.96 / (86.96 + 6.07);
        assert!((straight_m - 40.0).abs() < 0.1, "{straight_m}");
        assert!(
            (verged_m - expected_m).abs() < 0.2,
            "{verged_m} {expected_m}"
        );
    }
}
