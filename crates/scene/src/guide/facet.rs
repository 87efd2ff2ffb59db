//! What the camera pixels that land in one macropixel say together of its target.
//!
//! ```text
//!        ┌─────────┐   samples: inverse range q at places x about the centre
//!        │·  ·  ·  │   surface:  q(x) = q̄ + g·(x − x̄), for a plane's inverse depth is linear in the image
//!        │·  ×· ·  │   kept:     the sample nearest to ×, moved there along the slope g
//!        │·  ·  ·  │   range:    E[q²]/E[q³] over the macropixel: light falls with r² and the cosine of a plane with r
//!        └─────────┘
//! ```
//!
//! The lidar measures the mean by light over the macropixel. One pixel's depth, as it is, is off by the slope times its distance from there:
//! on a road up to metres. The slope is known from the samples alone.
//!
//! Samples that no plane fits belong to several surfaces, and the brightest part is meant: every sample stands for as much solid angle, whose
//! light falls with the square of the range and with the cosine that the slope tells. How much a surface reflects, depths do not say. So where
//! another part might be as bright the claim is widened to the variance that the choice has.

use crate::numerics::normal_above;

/// A depth that has landed in a macropixel.
#[derive(Debug, Clone, Copy)]
pub(super) struct Sample {
    /// Place in macropixels, to the right of the centre and below.
    pub(super) at: [f64; 2],
    /// Inverse distance from the lidar, 1/m, and its standard deviation as the rig tells.
    pub(super) inverse: f64,
    pub(super) sigma: f64,
    /// Whether its depth may be that of a nearer surface beside it, as a matcher's is at rims ([`crate::stereo::DisparityMap::rims`]).
    pub(super) is_rim: bool,
}

/// A macropixel's width and height as the lidar sees them, rad.
pub(super) type Pitch = [f64; 2];

/// Slopes of inverse range that are expected before any is seen, 1/m per rad: ground seen from 1.5 m has 1/1.5.
const SLOPE: f64 = 0.7;

/// Steeper by so much than expected is no surface but two, of which samples on either side are missing.
const STEEPEST: f64 = 3.0 * SLOPE;

/// Residuals over what the rig claims, as a variance, beyond which samples are not of one plane: one in 1000 by chance where nine samples leave six
/// degrees of freedom.
const NOT_PLANE: f64 = 3.7;

/// The centre is meant where samples are as even about it as their grid allows, else their own middle: they do not fill the macropixel.
const OFF_CENTRE: f64 = 0.2;

/// Standard deviation of the logarithm of two surfaces' reflectivities over each other: from a tenth to a half is 1.6 of it.
const LOG_REFLECTIVITY: f64 = 1.0;

/// Range and its standard deviation, m; `None` without samples, or where all of those that are meant may be of a surface beside.
pub(super) fn estimate(samples: &mut [Sample], pitch: Pitch) -> Option<(f64, f64)> {
    samples.sort_by(|a, b| a.inverse.total_cmp(&b.inverse));
    let mut parts = Vec::new();
    split(samples, pitch, &mut parts);
    let brightest = parts
        .iter()
        .copied()
        .reduce(|a, b| if b.light > a.light { b } else { a })?;
    // The rest may be brighter or not: what is at the rim says neither.
    if brightest.samples.iter().all(|sample| sample.is_rim) {
        return None;
    }
    let is_alone = parts.len() == 1;
    let (range_m, mut variance_m2) = brightest.range(is_alone);
    for other in parts.iter().filter(|other| other.first != brightest.first) {
        let counting2 = 1.0 / brightest.count() + 1.0 / other.count();
        let unknown2 = brightest.log_unknown.powi(2) + other.log_unknown.powi(2);
        let sigma = (LOG_REFLECTIVITY * LOG_REFLECTIVITY + counting2 + unknown2).sqrt();
        let is_other = normal_above(libm::log(brightest.light / other.light) / sigma);
        variance_m2 += is_other * (other.range(false).0 - range_m).powi(2);
    }
    Some((range_m, variance_m2.sqrt()))
}

/// Samples on one plane.
#[derive(Debug, Clone, Copy)]
struct Part<'s> {
    samples: &'s [Sample],
    first: f64,
    middle: [f64; 2],
    slope: [f64; 2],
    /// Σ (x − x̄)·(x − x̄)ᵀ with what is expected of slopes before: its 00, 01 and 11.
    moments: [f64; 3],
    /// Variance of a sample by its residuals.
    residual: f64,
    sigma2: f64,
    /// Variances of the slopes.
    slope2: [f64; 2],
    light: f64,
    /// How little the logarithm of the light is known because slopes are not.
    log_unknown: f64,
}

/// Takes samples, sorted, apart until each part is a plane.
fn split<'s>(samples: &'s [Sample], pitch: Pitch, parts: &mut Vec<Part<'s>>) {
    let Some(part) = Part::new(samples, pitch) else {
        return;
    };
    let gap = |at: usize| samples[at].inverse - samples[at - 1].inverse;
    let widest = (1..samples.len()).max_by(|&a, &b| gap(a).total_cmp(&gap(b)));
    match widest {
        Some(at) if part.residual > NOT_PLANE * part.sigma2 || part.is_too_steep(pitch) => {
            split(&samples[..at], pitch, parts);
            split(&samples[at..], pitch, parts);
        }
        _ => parts.push(part),
    }
}

impl<'s> Part<'s> {
    fn new(samples: &'s [Sample], pitch: Pitch) -> Option<Self> {
        let first = samples.first()?.inverse;
        let n = samples.len() as f64;
        let mean = |value: &dyn Fn(&Sample) -> f64| samples.iter().map(value).sum::<f64>() / n;
        let middle = [mean(&|s| s.at[0]), mean(&|s| s.at[1])];
        let (inverse, sigma2) = (mean(&|s| s.inverse), mean(&|s| s.sigma * s.sigma));
        let off = |s: &Sample| [s.at[0] - middle[0], s.at[1] - middle[1]];
        // A rig that claims no error at all still has that of its numbers.
        let expected = SLOPE * pitch[0].max(pitch[1]);
        let ridge = (sigma2 / (expected * expected)).max(1e-9);
        let (mut moments, mut with) = ([ridge, 0.0, ridge], [0.0; 2]);
        for sample in samples {
            let [x, y] = off(sample);
            let above = sample.inverse - inverse;
            moments = [moments[0] + x * x, moments[1] + x * y, moments[2] + y * y];
            with = [with[0] + x * above, with[1] + y * above];
        }
        let slope = solve(moments, with);
        let squares = samples.iter().map(|s| {
            let [x, y] = off(s);
            (s.inverse - inverse - slope[0] * x - slope[1] * y).powi(2)
        });
        let free = n - 3.0;
        let residual = if free > 0.0 {
            squares.sum::<f64>() / free
        } else {
            0.0
        };
        // Tangents of the incidence: what slopes there are beyond those that noise makes, and how little is known of them.
        let [a, b, d] = moments;
        let noise = sigma2 / (a * d - b * b);
        let slope2 = [noise * d, noise * a];
        let (mut tangent2, mut unknown2) = (0.0, 0.0);
        for axis in 0..2 {
            let of_slope = (pitch[axis] * inverse).powi(-2);
            tangent2 += of_slope * (slope[axis] * slope[axis] - slope2[axis]).max(0.0);
            unknown2 += of_slope * slope2[axis];
        }
        let log_unknown = 0.25 * libm::log((1.0 + tangent2 + unknown2) / (1.0 + tangent2));
        let light = n * inverse * inverse / (1.0 + tangent2).sqrt() / libm::exp(log_unknown);
        Some(Part {
            samples,
            first,
            middle,
            slope,
            moments,
            residual,
            sigma2,
            slope2,
            light,
            log_unknown,
        })
    }

    /// Beyond four standard deviations of the slope.
    fn is_too_steep(&self, pitch: Pitch) -> bool {
        (0..2).any(|axis| {
            let least = self.slope[axis].abs() - 4.0 * self.slope2[axis].sqrt();
            least > STEEPEST * pitch[axis]
        })
    }

    fn count(&self) -> f64 {
        self.samples.len() as f64
    }

    /// Range and variance, m and m²; over the whole macropixel, if the part fills it.
    fn range(&self, is_alone: bool) -> (f64, f64) {
        let fills = |axis: usize| is_alone && self.middle[axis].abs() < OFF_CENTRE;
        let place = [0, 1].map(|axis| if fills(axis) { 0.0 } else { self.middle[axis] });
        let from = |s: &Sample| [place[0] - s.at[0], place[1] - s.at[1]];
        let distance2 = |s: &Sample| {
            let [x, y] = from(s);
            x * x + y * y
        };
        let kept = self
            .samples
            .iter()
            .reduce(|a, b| if distance2(b) < distance2(a) { b } else { a })
            .expect("no part is empty");
        let way = from(kept);
        let inverse = kept.inverse + self.slope[0] * way[0] + self.slope[1] * way[1];
        let carried = solve(self.moments, way);
        let beside =
            carried[0] * (kept.at[0] - self.middle[0]) + carried[1] * (kept.at[1] - self.middle[1]);
        let along = carried[0] * way[0] + carried[1] * way[1];
        let variance = self.sigma2 * (1.0 + 2.0 * beside + along).max(0.0);
        // Where samples are missing, the part may reach on as far again.
        let mut variance = variance;
        if is_alone {
            for (axis, place) in place.iter().enumerate() {
                let slope2 = self.slope[axis].powi(2) + self.slope2[axis];
                variance += slope2 * place.powi(2) / 3.0;
            }
        }
        let spread = self.slope.iter().map(|g| g * g / 12.0).sum::<f64>();
        let square = inverse * inverse;
        let range_m = (square + spread) / (square + 3.0 * spread) / inverse;
        (range_m, variance * range_m.powi(4))
    }
}

/// x of A·x = b, for a symmetric A given by its 00, 01 and 11.
fn solve([a, b, d]: [f64; 3], [x, y]: [f64; 2]) -> [f64; 2] {
    let determinant = a * d - b * b;
    [(d * x - b * y) / determinant, (a * y - b * x) / determinant]
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::photon::{RandomPurpose, normal, random_stream};
    use proptest::prelude::*;

    const PITCH: Pitch = [4.4e-3; 2];

    /// Three samples either way, off the centre by `phase`, on a plane of inverse range `middle` at the centre.
    fn on_plane(
        middle: f64,
        slope: [f64; 2],
        phase: [f64; 2],
        sigma: f64,
        seed: u64,
    ) -> Vec<Sample> {
        let places = (0..9u32).map(|n| [f64::from(n % 3), f64::from(n / 3)]);
        let samples = (0..).zip(places).map(|(n, place)| {
            let at = [0, 1].map(|axis| (place[axis] - 1.0) / 3.0 + phase[axis]);
            let error = sigma * normal(&mut random_stream(seed, RandomPurpose::Guide, n, 98));
            Sample {
                at,
                inverse: middle + slope[0] * at[0] + slope[1] * at[1] + error,
                sigma,
                is_rim: false,
            }
        });
        samples.collect()
    }

    /// The mean range by light over a plane, slowly: light goes with the cosine, which goes with q, and with q².
    fn mean_range_m(middle: f64, slope: [f64; 2]) -> f64 {
        const N: u32 = 200;
        let offset = |n: u32| (f64::from(n) + 0.5) / f64::from(N) - 0.5;
        let places = (0..N).flat_map(|x| (0..N).map(move |y| (offset(x), offset(y))));
        let (light, moment) = places.fold((0.0, 0.0), |(light, moment), (x, y)| {
            let q = middle + slope[0] * x + slope[1] * y;
            (light + q.powi(3), moment + q.powi(2))
        });
        moment / light
    }

    /// Six samples at 20 m and three at 40 m, whose logarithm of light is 1 of reflectivity, 1/6 and 1/3 of counting apart, as variances.
    #[test]
    fn the_other_surface_counts_as_often_as_it_may_be_the_brighter_one() {
        let mut samples = on_plane(1.0 / 20.0, [0.0; 2], [0.0; 2], 1e-12, 1);
        let right = samples.iter_mut().filter(|sample| sample.at[0] > 0.1);
        right.for_each(|sample| sample.inverse = 1.0 / 40.0);
        let (range_m, sigma_m) = estimate(&mut samples, PITCH).unwrap();
        let ratio: f64 = (6.0 / 400.0) / (3.0 / 1600.0);
        let is_other = normal_above(ratio.ln() / (1.0f64 + 1.0 / 6.0 + 1.0 / 3.0).sqrt());
        let expected_m = 20.0 * is_other.sqrt();
        assert!(
            (range_m - 20.0).abs() < 1e-3 && (sigma_m / expected_m - 1.0).abs() < 1e-3,
            "{range_m} {sigma_m}"
        );
    }

    proptest! {
        #[test]
        fn a_plane_is_as_far_as_its_light_says(
            range_m in 15.0f64..120.0, slope in (-0.6f64..0.6, -0.6f64..0.6), phase in (-0.16f64..0.16, -0.16f64..0.16),
        ) {
            let middle = 1.0 / range_m;
            // No steeper than a plane that ends in the macropixel.
            let slope = [slope.0, slope.1].map(|s| (s * PITCH[0]).clamp(-0.6 * middle, 0.6 * middle));
            let mut samples = on_plane(middle, slope, [phase.0, phase.1], 1e-9, 0);
            let (found_m, sigma_m) = estimate(&mut samples, PITCH).unwrap();
            let expected_m = mean_range_m(middle, slope);
            prop_assert!((found_m / expected_m - 1.0).abs() < 2e-3, "{found_m} {expected_m}");
            prop_assert!(sigma_m < 1e-4 * range_m);
        }
    }

    proptest! {
        /// Slowly: how far each sample moves the range, by differences.
        #[test]
        fn the_claimed_variance_is_what_errors_of_all_samples_add_up_to(
            places in prop::collection::vec((-0.5f64..0.5, -0.5f64..0.5), 4..12), range_m in 15.0f64..120.0,
        ) {
            const SIGMA: f64 = 1e-9;
            let plain = |&(x, y): &(f64, f64)| Sample { at: [x, y], inverse: 1.0 / range_m, sigma: SIGMA, is_rim: false };
            let samples: Vec<Sample> = places.iter().map(plain).collect();
            let part = Part::new(&samples, PITCH).unwrap();
            let [a, b, d] = part.moments;
            // Places on one line leave the slope across it unknown.
            prop_assume!(a * d - b * b > 0.01);
            let moved_m = |which: usize, by: f64| {
                let mut samples = samples.clone();
                samples[which].inverse += by;
                Part::new(&samples, PITCH).unwrap().range(false).0
            };
            let step = 1e-5 / range_m;
            let per_sample = (0..samples.len()).map(|n| (moved_m(n, step) - moved_m(n, -step)) / (2.0 * step));
            let expected: f64 = per_sample.map(|slope| (slope * SIGMA).powi(2)).sum();
            let (_, variance) = part.range(false);
            prop_assert!((variance / expected - 1.0).abs() < 1e-3, "{variance} {expected}");
        }
    }

    proptest! {
        /// So uncertain that no slope is believed.
        #[test]
        fn of_samples_in_doubt_the_nearest_to_their_middle_is_kept(
            drawn in prop::collection::vec((-0.5f64..0.5, -0.5f64..0.5, 0.01f64..0.1), 3..12),
        ) {
            let sample = |&(x, y, inverse): &(f64, f64, f64)| Sample { at: [x, y], inverse, sigma: 100.0, is_rim: false };
            let samples: Vec<Sample> = drawn.iter().map(sample).collect();
            let part = Part::new(&samples, PITCH).unwrap();
            let off = |s: &Sample| (s.at[0] - part.middle[0]).hypot(s.at[1] - part.middle[1]);
            let mut sorted: Vec<&Sample> = samples.iter().collect();
            sorted.sort_by(|a, b| off(a).total_cmp(&off(b)));
            let nearest = sorted[0];
            // Either may be kept of two that are as near.
            prop_assume!(off(sorted[1]) - off(nearest) > 1e-9);
            let (range_m, _) = part.range(false);
            prop_assert!((range_m * nearest.inverse - 1.0).abs() < 1e-4, "{range_m} {}", 1.0 / nearest.inverse);
        }
    }

    /// Samples lie about a place 0.3 macropixels beside the centre, so the part's middle is claimed, and that the slope may go on as far again.
    #[test]
    fn a_part_on_one_side_may_reach_to_the_other() {
        let (middle, slope) = (0.025, 0.4 * PITCH[0]);
        let samples = on_plane(middle, [slope, 0.0], [0.3, 0.0], 1e-9, 1);
        let part = Part::new(&samples, PITCH).unwrap();
        let [alone, beside] = [true, false].map(|is_alone| part.range(is_alone));
        assert!((1.0 / alone.0 / (middle + 0.3 * slope) - 1.0).abs() < 1e-3);
        let expected = (0.3 * slope).powi(2) / 3.0 * alone.0.powi(4);
        let found = alone.1 - beside.1;
        assert!((found / expected - 1.0).abs() < 1e-3, "{found} {expected}");
    }

    /// A road at 40 m, which is 2.5 m deep in a macropixel, and a wall: shares within 1, 2 and 3 σ are those of a normal distribution.
    #[test]
    fn what_is_claimed_of_a_plane_holds() {
        const SEEDS: u64 = 3000;
        for slope in [
            [0.0, 0.0],
            [0.0, 0.5 * PITCH[1]],
            [0.4 * PITCH[0], 0.3 * PITCH[1]],
        ] {
            let (middle, sigma) = (0.025, 1e-4);
            let expected_m = mean_range_m(middle, slope);
            let errors: Vec<f64> = (0..SEEDS)
                .map(|seed| {
                    let phase = [7, 11].map(|n| ((seed % n) as f64 / n as f64 - 0.5) / 3.0);
                    let mut samples = on_plane(middle, slope, phase, sigma, seed);
                    let (range_m, sigma_m) = estimate(&mut samples, PITCH).unwrap();
                    (range_m - expected_m).abs() / sigma_m
                })
                .collect();
            for (sigmas, promised) in [(1.0, 0.6827), (2.0, 0.9545), (3.0, 0.9973f64)] {
                let inside = errors.iter().filter(|e| **e <= sigmas).count() as f64;
                let share = inside / SEEDS as f64;
                // Four standard errors, and as much again as depths are not linear in disparities.
                let give = 4.0 * (promised * (1.0 - promised) / SEEDS as f64).sqrt() + 0.005;
                assert!(
                    (share - promised).abs() < give,
                    "{slope:?} {sigmas}: {share}"
                );
            }
        }
    }

    /// Columns of samples at these distances, m, one after the other.
    fn columns(ranges_m: [Option<f64>; 3]) -> Vec<Sample> {
        let mut samples = on_plane(0.0, [0.0; 2], [0.0; 2], 1e-4, 1);
        let mut number = 0;
        samples.retain_mut(|sample| {
            let range_m = ranges_m[number % 3];
            number += 1;
            range_m.inspect(|m| sample.inverse += 1.0 / m).is_some()
        });
        samples
    }

    #[test]
    fn of_two_surfaces_the_brighter_one_is_meant_and_doubt_is_told() {
        let facet = |ranges_m| estimate(&mut columns(ranges_m), PITCH).unwrap();
        // Nine times as much light from the near one.
        let (range_m, sigma_m) = facet([Some(20.0), Some(20.0), Some(40.0)]);
        assert!(
            (range_m - 20.0).abs() < 0.3 && sigma_m > 1.0,
            "{range_m} {sigma_m}"
        );
        // Twice as much from the far one.
        let (range_m, sigma_m) = facet([Some(100.0), Some(100.0), Some(80.0)]);
        assert!((range_m - 100.0).abs() < 4.0, "{range_m}");
        assert!(3.0 * sigma_m > 20.0, "{sigma_m}");
        // A post before a house that the right camera does not see beside it is no steep plane.
        let (range_m, _) = facet([Some(45.0), None, Some(180.0)]);
        assert!((range_m - 45.0).abs() < 1.0, "{range_m}");
    }

    #[test]
    fn what_may_be_a_surface_beside_is_not_told() {
        let facet = |ranges_m, rims: &[usize]| {
            let mut samples = columns(ranges_m);
            for (number, sample) in samples.iter_mut().enumerate() {
                sample.is_rim = rims.contains(&(number % 3));
            }
            estimate(&mut samples, PITCH)
        };
        let mixed = [Some(20.0), Some(20.0), Some(110.0)];
        // The near one is sure in one of its columns.
        assert_eq!(facet(mixed, &[1]), facet(mixed, &[]));
        assert_eq!(facet(mixed, &[0, 1]), None);
        let plane = [Some(20.0); 3];
        assert_eq!(facet(plane, &[0, 1, 2]), None);
        assert_eq!(facet(plane, &[0, 1]), facet(plane, &[]));
    }

    #[test]
    fn one_sample_is_what_it_is_and_none_is_nothing() {
        let mut one = vec![Sample {
            at: [0.0; 2],
            inverse: 0.02,
            sigma: 1e-4,
            is_rim: false,
        }];
        let (range_m, sigma_m) = estimate(&mut one, PITCH).unwrap();
        assert!(
            (range_m - 50.0).abs() < 1e-9 && (sigma_m - 0.25).abs() < 1e-3,
            "{range_m} {sigma_m}"
        );
        assert_eq!(estimate(&mut [], PITCH), None);
    }
}
