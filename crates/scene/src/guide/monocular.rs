//! Depth from a single image by a network (thesis 5.3, Table 13): an estimate everywhere, with large errors.
//!
//! Such a network puts out disparity up to scale and offset, which one point of known distance fixes. So errors are those of a
//! disparity: of inverse depth, the same at all distances, which makes errors of depth grow with its square as they do with a camera pair.
//! Table 13 gives words only (density high, accuracy low); 5.3.2 has the number, an RMS error “more than ten times greater” than
//! the camera pair's at short distances.
//!
//! ```text
//!   1/ẑ = 1/z + σ·(√a·frame + √b·patch + √c·macropixel)       frame, patch, macropixel: normal, a + b + c = 1
//! ```
//!
//! The network smooths, so most of the error is common to a patch, and some to the frame (a wrong scale). How much, the thesis does not
//! say: the shares are chosen. Inverse depths at or beyond `farthest_m`, negative ones included, come out as `farthest_m`: the target that
//! “disappears from the depth image” (Fig. 75).

use super::{Guide, GuideError, GuideInput, GuideMap};
use crate::guide::StereoRig;
use crate::photon::{RandomPurpose, normal, random_stream};
use crate::scene::GroundTruth;
use crate::settings::Range::{Above, Within};
use crate::settings::keys;

/// What of a guide's random numbers tells this one's from others': the error of the frame, of patches and of macropixels.
const DRAWS: [u32; 3] = [2, 3, 4];

/// Shares of the error's variance that are common to the frame, to a patch, and a macropixel's own; chosen.
const SHARES: [f64; 3] = [0.2, 0.7, 0.1];

/// Standard deviations that must hold the target: the windows' (Eq. 25).
const WINDOW_SIGMAS: f64 = 3.0;

keys! {
    /// A learned depth map with the errors of thesis 5.3.
    ///
    /// The claim holds three standard deviations of inverse depth, which is what errs normally, on the far side, where they are longer: a third of
    /// 1/(1/ẑ − 3σ) − ẑ, which is ẑ²·σ where that is small. What lies beyond `farthest_m` is not told apart, so the far side ends there, but ẑ²·σ is the least.
    #[derive(Copy)]
    #[non_exhaustive]
    pub struct Monocular {
        /// Error as a multiple of the scene's camera pair's.
        times_stereo: f64 = 10.0, in Within(0.0, 1e4), from "thesis 5.3.2: more than ten times";
        /// Size, in macropixels, of patches that share an error.
        patch: u32 = 8, in Within(1.0, 1024.0);
        /// Largest depth that is reported; surfaces beyond it get this depth.
        farthest_m: f64 ["m"] = 200.0, in Above(0.0, 1e5);
    }
}

impl Monocular {
    /// The standard deviation claimed of a depth, m, when that of inverse depth is `sigma_per_m`.
    fn claim_m(&self, depth_m: f64, sigma_per_m: f64) -> f64 {
        let least_per_m = 1.0 / depth_m - WINDOW_SIGMAS * sigma_per_m;
        let far_m = 1.0 / least_per_m.max(1.0 / self.farthest_m);
        let far_side_m = (far_m - depth_m) / WINDOW_SIGMAS;
        far_side_m.max(depth_m * depth_m * sigma_per_m)
    }

    /// The error of a macropixel in standard deviations.
    fn error(&self, seed: u64, row: u32, col: u32) -> f64 {
        let draw = |what: usize, row: u32, col: u32| {
            let index = row << 16 | col;
            normal(&mut random_stream(
                seed,
                RandomPurpose::Guide,
                index,
                DRAWS[what],
            ))
        };
        // Between the corners of a patch, weights linear in either direction, made up to a variance of one.
        let (r, c) = (row / self.patch, col / self.patch);
        let part = |at: u32| f64::from(at % self.patch) / f64::from(self.patch);
        let (down, right) = (part(row), part(col));
        let corners = [
            ((1.0 - down) * (1.0 - right), draw(1, r, c)),
            ((1.0 - down) * right, draw(1, r, c + 1)),
            (down * (1.0 - right), draw(1, r + 1, c)),
            (down * right, draw(1, r + 1, c + 1)),
        ];
        let norm: f64 = corners.iter().map(|(w, _)| w * w).sum::<f64>().sqrt();
        let patch = corners.iter().map(|(w, e)| w * e).sum::<f64>() / norm;
        let parts = [draw(0, 0, 0), patch, draw(2, row, col)];
        let weighted = SHARES.iter().zip(parts).map(|(share, e)| share.sqrt() * e);
        weighted.sum()
    }
}

impl Guide for Monocular {
    fn name(&self) -> &str {
        "monocular"
    }

    fn estimate(&self, input: &GuideInput<'_>) -> Result<GuideMap, GuideError> {
        let (rows, cols) = (input.rows, input.cols);
        let truth = GroundTruth::render(input.scene, rows, cols);
        let lidar = input.scene.lidar_camera(rows, cols);
        let sigma_per_m = self.times_stereo * StereoRig::new(input.scene, 0).depth_sigma_m(1.0);
        let estimates = truth.range_m.iter().enumerate().map(|(pixel, range_m)| {
            let (row, col) = (pixel as u32 / cols, pixel as u32 % cols);
            let centre = (f64::from(col) + 0.5, f64::from(row) + 0.5);
            let range_per_depth = lidar.at_unit_depth(centre).length();
            let inverse = range_per_depth / (*range_m)?;
            let estimated = inverse + sigma_per_m * self.error(input.seed, row, col);
            let depth_m = 1.0 / estimated.max(1.0 / self.farthest_m);
            let sigma_m = self.claim_m(depth_m, sigma_per_m);
            Some((depth_m * range_per_depth, sigma_m * range_per_depth))
        });
        Ok(GuideMap::new(rows, cols, estimates))
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::guide::BehaviouralStereo;
    use crate::guide::test_scenes::{rms_error_m, wall_at};
    use proptest::prelude::*;

    #[test]
    fn inverse_depths_have_the_claimed_error_and_neighbours_share_most_of_it() {
        let guide = Monocular::default();
        let (mut squares, mut products, mut n) = (0.0, 0.0, 0.0);
        for seed in 0..4000 {
            let (a, b) = (guide.error(seed, 11, 21), guide.error(seed, 11, 22));
            squares += a * a;
            products += a * b;
            n += 1.0;
        }
        let standard_error = (2.0f64 / n).sqrt();
        let (variance, correlation) = (squares / n, products / n);
        assert!((variance - 1.0).abs() < 4.0 * standard_error, "{variance}");
        // All but the macropixel's own share, less what the patch changes over one macropixel.
        assert!((0.8..0.95).contains(&correlation), "{correlation}");
    }

    /// Between corners the patch's errors blend; from one corner to the next they share the frame's alone.
    #[test]
    fn errors_of_two_corners_of_a_patch_are_each_their_own() {
        let guide = Monocular::default();
        let correlation = |[a, b]: [(u32, u32); 2]| {
            let product = |seed| guide.error(seed, a.0, a.1) * guide.error(seed, b.0, b.1);
            (0..4000).map(product).sum::<f64>() / 4000.0
        };
        let corners = correlation([(8, 16), (8, 24)]);
        assert!((corners - SHARES[0]).abs() < 0.07, "{corners}");
        // Half way along an edge each corner's error has a weight of 1/sqrt(2).
        let half_way = correlation([(8, 16), (8, 20)]);
        let expected = SHARES[0] + SHARES[1] / 2f64.sqrt();
        assert!((half_way - expected).abs() < 0.07, "{half_way}");
        let down = correlation([(8, 16), (12, 16)]);
        assert!((down - expected).abs() < 0.07, "{down}");
        // In the middle of a patch all four corners weigh the same, a quarter of it on they do not.
        let within = |down: f64, right: f64| {
            let weights = [
                (1.0 - down) * (1.0 - right),
                (1.0 - down) * right,
                down * (1.0 - right),
                down * right,
            ];
            weights.map(|w| w / weights.iter().map(|w| w * w).sum::<f64>().sqrt())
        };
        for (row, col) in [(12, 20), (10, 20), (14, 18)] {
            let [nearest, .., farthest] =
                within(f64::from(row - 8) / 8.0, f64::from(col - 16) / 8.0);
            for (corner, weight) in [((8, 16), nearest), ((16, 24), farthest)] {
                let found = correlation([corner, (row, col)]);
                let expected = SHARES[0] + SHARES[1] * weight;
                assert!(
                    (found - expected).abs() < 0.07,
                    "{row}, {col}: {found} {expected}"
                );
            }
        }
    }

    proptest! {
        #[test]
        fn three_sigma_of_inverse_depth_are_within_three_of_depth(
            depth_m in 5.0f64..150.0, error in -3.0f64..3.0, times in 0.01f64..1.0,
        ) {
            let guide = Monocular::default();
            // Up to the farthest estimate.
            let sigma_per_m = times * (1.0 / depth_m - 1.0 / guide.farthest_m) / 3.0;
            let claim_m = guide.claim_m(depth_m, sigma_per_m);
            let true_m = 1.0 / (1.0 / depth_m + error * sigma_per_m);
            prop_assert!((true_m - depth_m).abs() <= 3.0 * claim_m * (1.0 + 1e-9));
            // No wider than the far side asks.
            let far_m = 1.0 / (1.0 / depth_m - 3.0 * sigma_per_m);
            prop_assert!((depth_m + 3.0 * claim_m - far_m).abs() < 1e-9 * far_m);
            // There is no estimate beyond.
            let of_far_m = guide.claim_m(guide.farthest_m, sigma_per_m);
            let linear_m = guide.farthest_m * guide.farthest_m * sigma_per_m;
            prop_assert!((of_far_m - linear_m).abs() < 1e-9 * linear_m);
        }
    }

    /// Every macropixel's estimate and claim, by the definition: inverse depth with its own error, and the depth's claim along its ray.
    #[test]
    fn estimates_are_the_walls_inverse_depth_with_their_error() {
        let depth_m = 40.0;
        let scene = wall_at(depth_m);
        let guide = Monocular {
            times_stereo: 3.0,
            ..Monocular::default()
        };
        let (rows, cols) = (24, 40);
        let map = guide
            .estimate(&GuideInput::still(&scene, rows, cols, 7))
            .unwrap();
        let truth = GroundTruth::render(&scene, rows, cols);
        let sigma_per_m = 3.0 * StereoRig::new(&scene, 0).depth_sigma_m(1.0);
        for pixel in 0..(rows * cols) as usize {
            let (row, col) = (pixel as u32 / cols, pixel as u32 % cols);
            // The wall is square to the axis, so that a ray is so much longer than the wall is far.
            let longer = truth.range_m[pixel].expect("a wall") / depth_m;
            let found_m = 1.0 / (1.0 / depth_m + sigma_per_m * guide.error(7, row, col));
            let wanted = (
                found_m * longer,
                guide.claim_m(found_m, sigma_per_m) * longer,
            );
            let (range_m, sigma_m) = map.estimate_of(pixel).expect("an estimate");
            assert!(
                (range_m / wanted.0 - 1.0).abs() < 1e-6,
                "{row}, {col}: {range_m} {}",
                wanted.0
            );
            assert!(
                (sigma_m / wanted.1 - 1.0).abs() < 1e-5,
                "{row}, {col}: {sigma_m} {}",
                wanted.1
            );
        }
    }

    #[test]
    fn it_is_dense_and_ten_times_worse_than_the_camera_pair() {
        for z_m in [20.0, 40.0] {
            let scene = wall_at(z_m);
            let map = Monocular::default().estimate(&GuideInput::still(&scene, 16, 16, 1));
            assert_eq!(map.unwrap().guided(), 256);
            let mono = rms_error_m(&Monocular::default(), &scene, 8, 0..400);
            let pair = rms_error_m(&BehaviouralStereo, &scene, 8, 0..12);
            // 400 frames with one error each of a fifth of the variance, and depth that is not linear in its inverse.
            assert!(
                (mono / pair / 10.0 - 1.0).abs() < 0.12,
                "{z_m}: {mono} {pair}"
            );
        }
    }

    #[test]
    fn what_is_too_far_comes_out_as_background() {
        let scene = wall_at(400.0);
        let guide = Monocular {
            farthest_m: 150.0,
            ..Monocular::default()
        };
        let map = guide.estimate(&GuideInput::still(&scene, 8, 8, 2)).unwrap();
        assert!(map.range_m.iter().flatten().all(|&m| m < 153.0));
    }
}
