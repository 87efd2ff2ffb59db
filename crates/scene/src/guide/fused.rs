//! Fusion of several guides by their variances (thesis 7.4.1: “how to effectively combine different sources”).
//!
//! ```text
//!   agree(i, j):  |rᵢ − rⱼ| ≤ 3·√(σᵢ² + σⱼ²)
//!   largest set S of estimates that all agree with each other (of equally large ones the one with the smaller variance)
//!   r = Σ rᵢ/σᵢ² / Σ 1/σᵢ²,   σ² = 1 / Σ 1/σᵢ²             over S
//! ```
//!
//! Estimates outside S are outliers. Where S is more than half of the estimates, they are dropped. Otherwise nobody knows who is
//! right: the range is that of S, and the variance is widened to the spread of all of them about it, every one with equal credence, so
//! that the window policy knows of the doubt. Variances add up to a right claim where the guides err independently.

use std::sync::Arc;

use super::{Guide, GuideError, GuideInput, GuideMap};

/// Two estimates farther apart than this many standard deviations of their difference are not of the same target: three in a
/// thousand of those that are; chosen.
const AGREE_SIGMAS: f64 = 3.0;

/// Most guides that are fused: all sets of them are tried.
pub const MOST_GUIDES: usize = 8;

/// Several guides as one.
#[derive(Debug, Clone)]
pub struct Fused {
    guides: Vec<Arc<dyn Guide>>,
    name: String,
}

impl Fused {
    /// Of one to eight guides.
    ///
    /// # Panics
    /// With none, or with more than eight.
    pub fn new(guides: Vec<Arc<dyn Guide>>) -> Self {
        assert!((1..=MOST_GUIDES).contains(&guides.len()));
        let names: Vec<&str> = guides.iter().map(|guide| guide.name()).collect();
        Fused {
            name: names.join(" + "),
            guides,
        }
    }
}

impl Guide for Fused {
    fn name(&self) -> &str {
        &self.name
    }

    fn estimate(&self, input: &GuideInput<'_>) -> Result<GuideMap, GuideError> {
        // Each guide has a seed of its own, so that two of a kind err independently; the first has that of the frame.
        let maps = (0u64..).zip(&self.guides).map(|(number, guide)| {
            guide.estimate(&GuideInput {
                seed: input.seed.wrapping_add(number << 48),
                ..*input
            })
        });
        let maps: Vec<GuideMap> = maps.collect::<Result<_, _>>()?;
        let pixels = input.rows as usize * input.cols as usize;
        let fused = (0..pixels).map(|pixel| {
            let estimates = maps.iter().filter_map(|map| map.estimate_of(pixel));
            fuse(&estimates.collect::<Vec<_>>())
        });
        Ok(GuideMap::new(input.rows, input.cols, fused))
    }
}

/// Range and standard deviation that several of them make together, m; `None` of none.
fn fuse(estimates: &[(f64, f64)]) -> Option<(f64, f64)> {
    let n = estimates.len();
    let agree = |i: usize, j: usize| {
        let ((a, sigma_a), (b, sigma_b)) = (estimates[i], estimates[j]);
        (a - b).abs() <= AGREE_SIGMAS * libm::hypot(sigma_a, sigma_b)
    };
    let members = |set: usize| (0..n).filter(move |i| set >> i & 1 == 1);
    let consistent =
        |set: &usize| members(*set).all(|i| members(*set).all(|j| j >= i || agree(i, j)));
    let sets = (1usize..1 << n).filter(consistent);
    let weighed = sets.map(|set| (set, weighted_mean(members(set).map(|i| estimates[i]))));
    let (set, (range_m, sigma_m)) = weighed.max_by(|(a, (_, sigma_a)), (b, (_, sigma_b))| {
        let by_size = a.count_ones().cmp(&b.count_ones());
        by_size.then(sigma_b.total_cmp(sigma_a))
    })?;
    let inside = set.count_ones() as usize;
    if 2 * inside > n {
        return Some((range_m, sigma_m));
    }
    let others = (0..n).filter(|i| set >> i & 1 == 0);
    let spread: f64 = others
        .map(|i| estimates[i].1.powi(2) + (estimates[i].0 - range_m).powi(2))
        .sum();
    let variance = (inside as f64 * sigma_m * sigma_m + spread) / n as f64;
    Some((range_m, variance.sqrt()))
}

/// Mean by inverse variances, and its standard deviation. An estimate without error is the mean.
fn weighted_mean(estimates: impl Iterator<Item = (f64, f64)> + Clone) -> (f64, f64) {
    if let Some(exact) = estimates.clone().find(|(_, sigma_m)| *sigma_m == 0.0) {
        return exact;
    }
    // One alone stays what it is, to the bit.
    let mut each = estimates.clone();
    if let (Some(only), None) = (each.next(), each.next()) {
        return only;
    }
    let (weights, sum) = estimates.fold((0.0, 0.0), |(weights, sum), (range_m, sigma_m)| {
        let weight = 1.0 / (sigma_m * sigma_m);
        (weights + weight, sum + weight * range_m)
    });
    (sum / weights, 1.0 / f64::sqrt(weights))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::guide::test_scenes::{normalised_errors, rms_error_m, wall_at};
    use crate::guide::{Monocular, NoisyTruth};
    use proptest::prelude::*;

    fn truth(sigma_m: f64) -> Arc<dyn Guide> {
        Arc::new(NoisyTruth {
            sigma_m,
            sigma_per_m: 0.0,
        })
    }

    /// The mean where the product of the normal densities is greatest, by its slope, and the width by its curvature.
    fn slowly(estimates: &[(f64, f64)]) -> (f64, f64) {
        let log = |x: f64| {
            let terms = estimates.iter().map(|(r, s)| -((x - r) / s).powi(2) / 2.0);
            terms.sum::<f64>()
        };
        let slope = |x: f64| (log(x + 1e-3) - log(x - 1e-3)) / 2e-3;
        let (mut low, mut high) = (-1e3, 1e3);
        for _ in 0..100 {
            let middle = (low + high) / 2.0;
            if slope(middle) > 0.0 {
                low = middle;
            } else {
                high = middle;
            }
        }
        let h = 0.1;
        let curvature = (log(low + h) - 2.0 * log(low) + log(low - h)) / (h * h);
        (low, (-1.0 / curvature).sqrt())
    }

    proptest! {
        #[test]
        fn agreeing_estimates_fuse_to_the_greatest_product_of_their_densities(
            estimates in prop::collection::vec((-1.0f64..1.0, 0.7f64..5.0), 1..5),
            at in 10.0f64..100.0,
        ) {
            let estimates: Vec<_> = estimates.iter().map(|(r, s)| (at + r, *s)).collect();
            let (mean, sigma) = fuse(&estimates).unwrap();
            let (expected_mean, expected_sigma) = slowly(&estimates);
            prop_assert!((mean - expected_mean).abs() < 1e-3, "{mean} {expected_mean}");
            prop_assert!((sigma / expected_sigma - 1.0).abs() < 1e-4, "{sigma} {expected_sigma}");
        }

        #[test]
        fn order_does_not_matter(
            mut estimates in prop::collection::vec((10.0f64..100.0, 0.1f64..5.0), 1..6),
        ) {
            let (range_m, sigma_m) = fuse(&estimates).unwrap();
            estimates.reverse();
            let (other_m, other_sigma_m) = fuse(&estimates).unwrap();
            prop_assert!((range_m - other_m).abs() < 1e-9 && (sigma_m - other_sigma_m).abs() < 1e-9);
        }
    }

    #[test]
    fn an_outlier_is_outvoted_and_a_tie_widens_the_claim() {
        let (range_m, sigma_m) = fuse(&[(50.0, 0.3), (20.0, 0.1), (50.2, 0.4)]).unwrap();
        assert!((range_m - 50.072).abs() < 1e-3, "{range_m}");
        assert!((sigma_m - 0.24).abs() < 1e-3, "{sigma_m}");
        let (range_m, sigma_m) = fuse(&[(50.0, 0.3), (20.0, 0.1)]).unwrap();
        assert_eq!(range_m, 20.0);
        assert!((sigma_m - 30.0 / f64::sqrt(2.0)).abs() < 0.01, "{sigma_m}");
        assert_eq!(fuse(&[]), None);
        assert_eq!(fuse(&[(7.0, 0.0), (7.5, 1.0)]), Some((7.0, 0.0)));
    }

    /// The first guide errs as it does alone, and each other one as alone with a seed that is 2⁴⁸ more.
    #[test]
    fn each_guide_has_a_seed_of_its_own() {
        let scene = wall_at(40.0);
        let fused = Fused::new(vec![truth(1.0), truth(2.0), truth(1.5)]);
        let input = GuideInput::still(&scene, 4, 4, 9);
        let alone = [(1.0, 9), (2.0, 9 + (1 << 48)), (1.5, 9 + (2 << 48))];
        let alone = alone.map(|(sigma_m, seed)| {
            truth(sigma_m)
                .estimate(&GuideInput { seed, ..input })
                .unwrap()
        });
        let together = fused.estimate(&input).unwrap();
        for pixel in 0..16 {
            let estimates: Vec<_> = alone
                .iter()
                .filter_map(|map| map.estimate_of(pixel))
                .collect();
            assert_eq!(
                (estimates.len(), together.estimate_of(pixel)),
                (3, fuse(&estimates))
            );
        }
    }

    /// Where no more than half agree, the claim is the spread about what the nearest claims say: by hand.
    #[test]
    fn without_a_majority_all_are_in_the_claim() {
        let (range_m, sigma_m) =
            fuse(&[(50.0, 1.0), (50.0, 1.0), (20.0, 0.5), (90.0, 2.0)]).unwrap();
        assert_eq!(range_m, 50.0);
        let variance = (2.0 * 0.5 + (0.25 + 900.0) + (4.0 + 1600.0)) / 4.0;
        assert!((sigma_m - f64::sqrt(variance)).abs() < 1e-9, "{sigma_m}");
    }

    #[test]
    fn fused_errors_are_smaller_than_any_and_what_is_claimed() {
        let scene = wall_at(40.0);
        // A network's error, whose claim is its own estimate's, and an independent one.
        let guides = [Arc::new(Monocular::default()) as Arc<dyn Guide>, truth(1.0)];
        let fused = Fused::new(guides.to_vec());
        let rms = |guide: &dyn Guide| rms_error_m(guide, &scene, 8, 0..100);
        let alone = guides.iter().map(|guide| rms(&**guide));
        let together = rms(&fused);
        assert!(alone.into_iter().all(|alone| together < 0.97 * alone));
        let errors = normalised_errors(&fused, &scene, 8, 0..100);
        let variance = errors.iter().map(|e| e * e).sum::<f64>() / errors.len() as f64;
        assert!((variance - 1.0).abs() < 0.15, "{variance}");
        assert_eq!(fused.name(), "monocular + truth");
    }
}
