//! The true distance with a Gaussian error: a guide whose claim is right by construction, to try windows and fusion on.

use super::{Guide, GuideError, GuideInput, GuideMap};
use crate::photon::{RandomPurpose, normal, random_stream};
use crate::scene::GroundTruth;
use crate::settings::Range::Within;
use crate::settings::keys;

/// What of a guide's random numbers tells this one's from others'.
const DRAWS: u32 = 1;

keys! {
    /// The truth with independent Gaussian errors of standard deviation √(`sigma_m`² + (`sigma_per_m`·range)²).
    ///
    /// It claims the standard deviation at the true range. Estimates do not fall below zero.
    #[derive(Copy)]
    pub struct NoisyTruth {
        /// Error that does not depend on distance.
        sigma_m: f64 ["m"] = 0.3, in Within(0.0, 1e4);
        /// Error as a share of the distance.
        sigma_per_m: f64 = 0.0, in Within(0.0, 10.0);
    }
}

impl Guide for NoisyTruth {
    fn name(&self) -> &str {
        "truth"
    }

    fn estimate(&self, input: &GuideInput<'_>) -> Result<GuideMap, GuideError> {
        let truth = GroundTruth::render(input.scene, input.rows, input.cols);
        let estimates = (0..).zip(&truth.range_m).map(|(pixel, range_m)| {
            let true_m = (*range_m)?;
            let sigma_m = libm::hypot(self.sigma_m, self.sigma_per_m * true_m);
            let mut random = random_stream(input.seed, RandomPurpose::Guide, pixel, DRAWS);
            Some(((true_m + sigma_m * normal(&mut random)).max(0.0), sigma_m))
        });
        Ok(GuideMap::new(input.rows, input.cols, estimates))
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::guide::test_scenes::{normalised_errors, wall_at};
    use crate::scene::Scene;

    #[test]
    fn errors_are_what_it_claims() {
        let scene = wall_at(60.0);
        let guide = NoisyTruth {
            sigma_m: 0.4,
            sigma_per_m: 0.01,
        };
        let errors = normalised_errors(&guide, &scene, 32, 0..4);
        let n = errors.len() as f64;
        let mean = errors.iter().sum::<f64>() / n;
        let variance = errors.iter().map(|e| e * e).sum::<f64>() / n;
        // Four standard errors of 4096 independent draws.
        assert!(mean.abs() < 4.0 / n.sqrt(), "{mean}");
        assert!(
            (variance - 1.0).abs() < 4.0 * (2.0 / n).sqrt(),
            "{variance}"
        );
    }

    /// The claim of every macropixel, and its draw.
    #[test]
    fn errors_have_a_part_that_grows_with_range() {
        let scene = wall_at(60.0);
        let guide = NoisyTruth {
            sigma_m: 0.4,
            sigma_per_m: 0.01,
        };
        let map = guide
            .estimate(&GuideInput::still(&scene, 16, 16, 3))
            .unwrap();
        let truth = GroundTruth::render(&scene, 16, 16);
        for pixel in 0..256 {
            let true_m = truth.range_m[pixel].expect("a wall");
            let (range_m, sigma_m) = map.estimate_of(pixel).expect("an estimate");
            assert!((sigma_m / (0.16 + 1e-4 * true_m * true_m).sqrt() - 1.0).abs() < 1e-12);
            let draw = normal(&mut random_stream(
                3,
                RandomPurpose::Guide,
                pixel as u32,
                DRAWS,
            ));
            assert!((range_m - true_m - sigma_m * draw).abs() < 1e-9);
        }
    }

    #[test]
    fn without_error_it_is_the_truth_and_the_sky_has_none() {
        let scene = Scene::outdoor();
        let guide = NoisyTruth {
            sigma_m: 0.0,
            sigma_per_m: 0.0,
        };
        let map = guide
            .estimate(&GuideInput::still(&scene, 16, 16, 3))
            .unwrap();
        assert_eq!(map.range_m, GroundTruth::render(&scene, 16, 16).range_m);
        for (range_m, sigma_m) in map.range_m.iter().zip(&map.sigma_m) {
            assert_eq!(
                *sigma_m,
                if range_m.is_some() {
                    0.0
                } else {
                    f64::INFINITY
                }
            );
        }
    }
}
