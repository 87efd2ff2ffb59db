//! The guide of the camera pair that matches images: left and right image of the scene, semi-global matching, mapping onto macropixels (thesis 5.2, 6.3.2).
//!
//! ```text
//!  scene ──► two images of what the lidar sees (render) ──► disparities (stereo) ──► points ──► macropixels (mapping)
//! ```
//!
//! A road's disparity grows by two thirds of a pixel a row. Paths from above alone bring the smaller disparities of the rows before along, and the
//! road comes out too far; as many from below undo it. Hence four paths, not five.
//!
//! As in 6.3.2, pixels are binned and only the part of the images that the lidar sees is matched.

use super::mapping;
use super::render::{Crop, pair};
use super::stereo::{StereoPoint, StereoRig};
use super::third_camera::with_third_camera;
use super::{Guide, GuideError, GuideInput, GuideMap};
use crate::scene::{DVec3, Scene};
use crate::settings::Range::Within;
use crate::settings::keys;
use crate::stereo::{DisparityMap, Matcher, Paths};

keys! {
    /// The camera pair with images and a matcher.
    ///
    /// Its standard deviation is Eq. 27's with `sigma_px` binned pixels, more where pixels about have no answer.
    #[derive(Copy)]
    #[non_exhaustive]
    pub struct MatchedStereo {
        /// Camera pixels across that are binned to one before matching.
        binning: u32 = 2, in Within(1.0, 16.0), from "thesis 6.3.2";
        /// Paths of the semi-global matching: 3, 4, 5 or 8; with 3 and 5, which come from above only, depths of roads
        /// lag behind.
        paths: u32 = 4, in Within(3.0, 8.0),
            from "measured: on the street's road the median error is 2.3 times the reported uncertainty with 5 paths, and 0.2 times with 8";
        /// Contrast of the random pattern on surfaces that have no texture; its standard deviation is 0.9 of this.
        grain: f64 = 0.1, in Within(0.0, 1.0);
        /// Reported uncertainty (standard deviation) of a disparity whose neighbours all have one, in binned pixels.
        sigma_px: f64 = 0.25, in Within(0.0, 100.0),
            from "measured: 0.09 and a bias up to 0.12 on walls with the default pattern, 0.2 with a fifth of its contrast";
    }
}

/// Binned pixels that are matched around what the lidar sees: costs compare neighbourhoods.
const MARGIN_PX: u32 = 8;

/// Pixels to either side whose answers tell how well a pixel is matched: those that the census compares.
const AROUND: usize = 3;

/// A near surface's answers reach as far beyond its edge: macropixels that see nothing else have no estimate. With them 0.981 to 0.987 of
/// targets were within 3 σ, without 0.988 to 0.990.
const RIM_PX: usize = AROUND;

/// Where texture is weak answers are missing and the others worse: on walls with 99, 88, 75 and 58 % of answers the standard deviation is 0.18, 0.47, 0.62
/// and 0.71 pixels (DESIGN.md), which is this many times the least one for each share that is missing.
const WORSE_BY_MISSING: f64 = 8.0;

impl MatchedStereo {
    /// What is wrong with keys that have no range of numbers.
    ///
    /// # Errors
    /// When something is.
    pub(super) fn check(&self) -> Result<(), String> {
        let numbers = Paths::ALL.map(|paths| paths.number());
        if numbers.contains(&(self.paths as usize)) {
            return Ok(());
        }
        Err(format!(
            "paths = {} is impossible; give 3, 4, 5 or 8",
            self.paths
        ))
    }

    /// The part of the left image that the lidar sees at any distance, and to its left what the right camera sees of it.
    pub(super) fn crop(&self, input: &GuideInput<'_>) -> Option<Crop> {
        let stereo = &input.scene.stereo;
        let camera = stereo.camera();
        let lidar = input.scene.lidar_camera(input.rows, input.cols);
        let nearest_m = camera.focal_px * stereo.baseline_m / stereo.max_disparity_px;
        let (mut least, mut most) = ((f64::MAX, f64::MAX), (f64::MIN, f64::MIN));
        for depth_m in [nearest_m, 1e6] {
            for corner in [
                (0.0, 0.0),
                (f64::from(lidar.width), f64::from(lidar.height)),
            ] {
                let point = lidar.at_unit_depth(corner) * depth_m - stereo.position_m;
                let (u, v) = camera.project(point)?;
                least = (least.0.min(u), least.1.min(v));
                most = (most.0.max(u), most.1.max(v));
            }
        }
        let binning = f64::from(self.binning);
        let first = |px: f64, more: f64| (px / binning - more).floor().max(0.0) as u32;
        let end = |px: f64, size: u32| {
            let last = (px / binning + f64::from(MARGIN_PX)).ceil().max(0.0) as u32;
            last.min(size / self.binning)
        };
        let searched = (stereo.max_disparity_px / binning).ceil();
        let left = first(least.0, f64::from(MARGIN_PX) + searched);
        let top = first(least.1, f64::from(MARGIN_PX));
        Some(Crop {
            binning: self.binning,
            left,
            top,
            width: end(most.0, camera.width)
                .checked_sub(left)
                .filter(|&n| n > 0)?,
            height: end(most.1, camera.height)
                .checked_sub(top)
                .filter(|&n| n > 0)?,
        })
    }

    fn matcher(&self, scene: &Scene) -> Matcher {
        // From infinity on: what is farther than is asked for would be matched wrongly if its disparity were not searched.
        let searched =
            (scene.stereo.max_disparity_px / f64::from(self.binning)).ceil() as usize + 2;
        Matcher {
            disparities: searched.min(256),
            paths: (Paths::ALL.into_iter())
                .find(|paths| paths.number() >= self.paths as usize)
                .unwrap_or(Paths::Eight),
            ..Matcher::default()
        }
    }

    /// Disparities of the crop, binned pixels.
    pub(super) fn disparities(&self, input: &GuideInput<'_>, crop: Crop) -> Option<DisparityMap> {
        let [left, right] = pair(input, crop, self.grain);
        self.matcher(input.scene).match_pair(&left, &right).ok()
    }

    /// The points of all pixels with a disparity, in the left camera's coordinates, the standard deviation claimed for a disparity, px, and
    /// whether they are at the rim of a near surface.
    fn points(&self, input: &GuideInput<'_>) -> Vec<(StereoPoint, f64, bool)> {
        let found = self
            .crop(input)
            .and_then(|crop| Some((crop, self.disparities(input, crop)?)));
        let Some((crop, map)) = found else {
            return Vec::new();
        };
        let stereo = &input.scene.stereo;
        let camera = stereo.camera();
        let focal_baseline = camera.focal_px * stereo.baseline_m;
        let accepted = stereo.min_disparity_px..=stereo.max_disparity_px;
        let answered = answered_share(&map);
        let rims = map.rims(RIM_PX, false);
        let mut points = Vec::with_capacity(map.matched());
        for row in 0..map.height() {
            for col in 0..map.width() {
                let Some(binned_px) = map.disparity_px(row, col) else {
                    continue;
                };
                let disparity_px = f64::from(binned_px) * f64::from(crop.binning);
                if disparity_px <= 0.0 || !accepted.contains(&disparity_px) {
                    continue;
                }
                let (u, v) = crop.middle(row, col);
                let depth_m = focal_baseline / disparity_px;
                let point_m: DVec3 = camera.at_unit_depth((u, v)) * depth_m;
                let missing = 1.0 - answered[row * map.width() + col];
                let sigma_px = self.sigma_px * (1.0 + WORSE_BY_MISSING * missing);
                let point = StereoPoint {
                    row: v as u32,
                    col: u as u32,
                    disparity_px,
                    depth_m,
                    point_m,
                };
                let is_rim = rims[row * map.width() + col];
                points.push((point, sigma_px * f64::from(self.binning), is_rim));
            }
        }
        points
    }
}

/// The share of the pixels about each one that have an answer.
fn answered_share(map: &DisparityMap) -> Vec<f64> {
    let (width, height) = (map.width(), map.height());
    let about = |at: usize, size: usize| at.saturating_sub(AROUND)..(at + AROUND + 1).min(size);
    let has_answer =
        |row: usize, col: usize| f64::from(u8::from(map.disparity_px(row, col).is_some()));
    let mut of_rows = vec![0.0; width * height];
    for (at, share) in of_rows.iter_mut().enumerate() {
        let cols = about(at % width, width);
        let n = cols.len() as f64;
        *share = cols.map(|col| has_answer(at / width, col)).sum::<f64>() / n;
    }
    let of_both = |at: usize| {
        let rows = about(at / width, height);
        let n = rows.len() as f64;
        rows.map(|row| of_rows[row * width + at % width])
            .sum::<f64>()
            / n
    };
    (0..width * height).map(of_both).collect()
}

impl Guide for MatchedStereo {
    fn name(&self) -> &str {
        "matched"
    }

    fn estimate(&self, input: &GuideInput<'_>) -> Result<GuideMap, GuideError> {
        Ok(with_third_camera(input, |input| {
            let rig = StereoRig::new(input.scene, input.seed);
            let points = self.points(input);
            let points = points.iter().map(|(point, sigma_px, is_rim)| {
                let sigma_m = point.depth_m * point.depth_m * sigma_px / rig.focal_baseline_px_m();
                (point, sigma_m, *is_rim)
            });
            mapping::of_points(input.scene, input.rows, input.cols, points)
        }))
    }

    fn reach(&self, scene: &Scene) -> Option<String> {
        super::BehaviouralStereo.reach(scene)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::guide::test_scenes::{coarse, depends_on_its_seed_alone, wall_at};
    use crate::scene::{GroundTruth, Object, Shape};
    use proptest::prelude::*;

    const WHOLE: MatchedStereo = MatchedStereo {
        binning: 1,
        paths: 4,
        grain: 0.1,
        sigma_px: 0.25,
    };

    fn disparities_px(guide: MatchedStereo, scene: &Scene, seed: u64) -> Vec<f64> {
        let points = guide.points(&GuideInput::still(scene, 32, 32, seed));
        points
            .iter()
            .map(|(point, ..)| point.disparity_px)
            .collect()
    }

    fn middle(mut values: Vec<f64>) -> f64 {
        values.sort_by(f64::total_cmp);
        values[values.len() / 2]
    }

    #[test]
    fn a_wall_is_matched_at_its_depth() {
        for depth_m in [20.0, 33.0, 50.0] {
            let scene = coarse(wall_at(depth_m));
            let camera = scene.stereo.camera();
            let expected_px = camera.focal_px * scene.stereo.baseline_m / depth_m;
            let found = disparities_px(WHOLE, &scene, 1);
            assert!(found.len() > 10_000, "{} at {depth_m} m", found.len());
            let good = found.iter().filter(|px| (*px - expected_px).abs() < 1.0);
            assert!(good.count() * 100 > found.len() * 99);
            let off_px = middle(found) - expected_px;
            assert!(off_px.abs() < 0.2, "{off_px} px at {depth_m} m");
        }
    }

    /// What the lidar sees at any distance is in the crop with its margin, and the crop ends there.
    #[test]
    fn the_crop_is_what_the_lidar_sees_and_its_margin() {
        let wall = wall_at(30.0);
        for (binning, position_m) in [
            (1, DVec3::new(-0.1, 0.0, 0.0)),
            (2, DVec3::new(0.4, 0.2, -0.5)),
            (3, DVec3::new(-0.6, -0.3, 0.1)),
        ] {
            let mut scene = wall.clone();
            scene.stereo.position_m = position_m;
            let guide = MatchedStereo { binning, ..WHOLE };
            let crop = guide
                .crop(&GuideInput::still(&scene, 24, 40, 1))
                .expect("in view");
            let (camera, lidar) = (scene.stereo.camera(), scene.lidar_camera(24, 40));
            let nearest_m =
                camera.focal_px * scene.stereo.baseline_m / scene.stereo.max_disparity_px;
            let (mut least, mut most) = ([f64::MAX; 2], [f64::MIN; 2]);
            for corner in [(0.0, 0.0), (40.0, 0.0), (0.0, 24.0), (40.0, 24.0)] {
                for step in 0..=60 {
                    let depth_m = nearest_m * libm::pow(1e6 / nearest_m, f64::from(step) / 60.0);
                    let (u, v) = camera
                        .project(lidar.at_unit_depth(corner) * depth_m - position_m)
                        .expect("before it");
                    for (axis, at) in [u, v].into_iter().enumerate() {
                        least[axis] = least[axis].min(at / f64::from(binning));
                        most[axis] = most[axis].max(at / f64::from(binning));
                    }
                }
            }
            let searched = (scene.stereo.max_disparity_px / f64::from(binning)).ceil();
            let size = [camera.width, camera.height].map(|px| f64::from(px / binning));
            let margin = [8.0 + searched, 8.0];
            let (first, end) = (
                [crop.left, crop.top],
                [crop.left + crop.width, crop.top + crop.height],
            );
            for axis in 0..2 {
                let (first, end) = (f64::from(first[axis]), f64::from(end[axis]));
                let (wanted, last) = (
                    (least[axis] - margin[axis]).max(0.0),
                    (most[axis] + 8.0).min(size[axis]),
                );
                assert!(
                    first <= wanted && wanted < first + 1.0,
                    "{binning}, {axis}: {first}, not {wanted}"
                );
                assert!(
                    last <= end && end < last + 1.0,
                    "{binning}, {axis}: {end}, not {last}"
                );
            }
        }
    }

    #[test]
    fn disparities_are_searched_from_infinity_to_the_nearest() {
        let mut scene = wall_at(30.0);
        scene.stereo.max_disparity_px = 101.0;
        for (binning, disparities) in [(1, 103), (2, 53), (3, 36)] {
            let matcher = MatchedStereo { binning, ..WHOLE }.matcher(&scene);
            assert_eq!(
                (matcher.min_disparity, matcher.disparities),
                (0, disparities)
            );
        }
        scene.stereo.max_disparity_px = 400.0;
        assert_eq!(WHOLE.matcher(&scene).disparities, 256);
        let reach = WHOLE.reach(&scene);
        assert!(reach.is_some() && reach == crate::guide::BehaviouralStereo.reach(&scene));
        for (paths, wanted) in [
            (3, Paths::Three),
            (4, Paths::Four),
            (5, Paths::Five),
            (6, Paths::Eight),
            (8, Paths::Eight),
        ] {
            assert_eq!(
                MatchedStereo { paths, ..WHOLE }.matcher(&scene).paths,
                wanted
            );
        }
    }

    #[test]
    fn every_macropixel_before_a_wall_is_guided_to_it() {
        for binning in [1, 2] {
            is_guided_to_a_wall(MatchedStereo { binning, ..WHOLE });
        }
    }

    fn is_guided_to_a_wall(guide: MatchedStereo) {
        let scene = coarse(wall_at(30.0));
        let input = GuideInput::still(&scene, 32, 32, 3);
        let map = guide.estimate(&input).unwrap();
        let truth = GroundTruth::render(&scene, 32, 32);
        let pairs = map.range_m.iter().zip(&truth.range_m).zip(&map.sigma_m);
        let good = pairs.filter(|((found, truth), sigma_m)| {
            matches!((found, truth), (Some(found), Some(truth)) if (found - truth).abs() < 4.0 * **sigma_m)
        });
        let good = good.count();
        assert!(good > 32 * 32 * 9 / 10, "{good}");
        // One pixel's claim, a little more for its place and less for what others say of the slope.
        let focal_baseline_px_m = scene.stereo.camera().focal_px * scene.stereo.baseline_m;
        let sigma_px = guide.sigma_px * f64::from(guide.binning);
        let of_pixel_m = 30.0 * 30.0 * sigma_px / focal_baseline_px_m;
        let typical = middle(map.sigma_m.clone()) / of_pixel_m;
        assert!((0.8..1.6).contains(&typical), "{typical}");
    }

    proptest! {
        #[test]
        fn the_share_of_answers_is_that_of_the_pixels_about(
            width in 1usize..12, answers in prop::collection::vec(any::<bool>(), 1..140),
        ) {
            let height = answers.len() / width;
            prop_assume!(height > 0);
            let px = |&answer: &bool| if answer { 7.0 } else { f32::NAN };
            let px = answers.iter().take(width * height).map(px).collect();
            let map = DisparityMap { width, height, px };
            for (at, found) in answered_share(&map).into_iter().enumerate() {
                let is_near = |a: usize, b: usize| a.abs_diff(b) <= AROUND;
                let about = (0..width * height)
                    .filter(|other| is_near(other / width, at / width) && is_near(other % width, at % width));
                let about: Vec<usize> = about.collect();
                let share = about.iter().filter(|&&other| answers[other]).count() as f64 / about.len() as f64;
                prop_assert!((found - share).abs() < 1e-12);
            }
        }
    }

    #[test]
    fn what_a_near_surface_ends_before_is_not_told_as_near() {
        let mut scene = coarse(wall_at(60.0));
        let half = Shape::Plane {
            centre_m: DVec3::new(10.0, 0.0, 20.0),
            normal: DVec3::new(0.0, 0.0, -1.0),
            width_m: 20.0,
            height_m: 100.0,
        };
        scene.objects.push(Object::new("near", 0.3, half));
        let map = WHOLE
            .estimate(&GuideInput::still(&scene, 32, 32, 1))
            .unwrap();
        let truth = GroundTruth::render(&scene, 32, 32);
        let near = |range_m: &Option<f64>| range_m.is_some_and(|m| m < 30.0);
        let pairs = || map.range_m.iter().zip(&truth.range_m);
        let (wrong, right) = (
            pairs().filter(|(found, truth)| near(found) && !near(truth)),
            pairs().filter(|(found, truth)| near(found) && near(truth)),
        );
        let (wrong, right) = (wrong.count(), right.count());
        assert!(wrong <= 2 && right > 32 * 12, "{wrong} {right}");
    }

    #[test]
    fn a_camera_that_has_turned_outwards_sees_walls_nearer() {
        let mut scene = coarse(wall_at(40.0));
        let straight = middle(disparities_px(WHOLE, &scene, 1));
        scene.stereo.yaw_error_deg = 0.3;
        let verged = middle(disparities_px(WHOLE, &scene, 1));
        let expected_px = scene.stereo.camera().focal_px * 0.3f64.to_radians().tan();
        assert!(
            (verged - straight - expected_px).abs() < 0.25,
            "{straight} {verged}"
        );
    }

    #[test]
    fn images_that_do_not_lie_in_a_row_are_not_matched() {
        let mut scene = coarse(wall_at(40.0));
        let level = disparities_px(WHOLE, &scene, 1).len();
        // Four pixels up.
        scene.stereo.pitch_error_deg = (4.0 / scene.stereo.camera().focal_px).to_degrees();
        let pitched = disparities_px(WHOLE, &scene, 1).len();
        assert!(pitched * 10 < level, "{pitched} of {level}");
    }

    #[test]
    fn in_the_dark_and_without_grain_little_is_matched() {
        let mut scene = coarse(wall_at(40.0));
        let by_day = disparities_px(WHOLE, &scene, 1).len();
        let plain = MatchedStereo {
            grain: 0.0,
            ..WHOLE
        };
        assert!(disparities_px(plain, &scene, 1).len() * 10 < by_day);
        scene.light.illuminance_klux = 1e-5;
        assert!(disparities_px(WHOLE, &scene, 1).len() * 10 < by_day);
    }

    #[test]
    fn a_seed_gives_the_same_map_on_any_number_of_threads() {
        depends_on_its_seed_alone(&WHOLE);
    }
}
