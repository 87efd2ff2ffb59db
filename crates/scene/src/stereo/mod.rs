//! Stereo matching: disparities from a rectified pair of grey images (semi-global matching, thesis 5.2.2).
//!
//! Knows images and pixels only, nothing of scenes, cameras or metres.
//!
//! ```text
//!  left ──► census ──┐            ┌─► along the row, both ways ─┐          best, unique,   median,
//!                    ├─► costs ───┤                             ├─► sums ──► left = right,──► speckle ──► disparities
//!  right ─► census ──┘ (x, d) u8  └─► down (and up), 1 or 3 ────┘  u16       sub-pixel        filter
//! ```
//!
//! | file | what |
//! |---|---|
//! | `image.rs` | grey images of 8 to 16 bits |
//! | `settings.rs` | what a matcher can be told |
//! | `census.rs` | a pixel's neighbourhood as bits |
//! | `cost.rs` | how unlike two pixels are, for all disparities of a row |
//! | `sweep.rs` | rows in their order, paths up and down, threads |
//! | `winner.rs` | the best disparity of a pixel, and whether to believe it |
//! | `filter.rs` | median and speckle filter |
//! | `disparity.rs` | the result |
//! | `matching.rs` | all of it together |
//!
//! H. Hirschmüller, "Stereo Processing by Semiglobal Matching and Mutual Information", IEEE TPAMI 30(2), 2008, gives the paths'
//! recursion (Eq. 13); R. Zabih and J. Woodfill, "Non-parametric Local Transforms for Computing Visual Correspondence", ECCV 1994, the census.

mod census;
mod cost;
mod disparity;
mod filter;
mod image;
mod matching;
#[cfg(test)]
#[path = "tests/reference.rs"]
mod reference;
mod settings;
mod sweep;
mod winner;

pub use disparity::DisparityMap;
pub use image::{GreyImage, ImageError};
pub use settings::{Census, MatchError, Matcher, Paths, Workspace};

#[cfg(test)]
mod tests {
    use proptest::prelude::*;

    use super::*;

    fn image(width: usize, height: usize, bits: u32) -> impl Strategy<Value = GreyImage> {
        // Few grey levels give ties, all of them give none.
        let most = prop_oneof![Just(3u16), Just(((1u32 << bits) - 1) as u16)];
        most.prop_flat_map(move |most| {
            prop::collection::vec(0..=most, width * height)
                .prop_map(move |pixels| GreyImage::new(width, height, bits, pixels).unwrap())
        })
    }

    /// The right image is the left one moved, with pixels that are not.
    fn pair() -> impl Strategy<Value = (GreyImage, GreyImage)> {
        (1usize..40, 1usize..12, 8u32..=16, 0usize..12).prop_flat_map(
            |(width, height, bits, by)| {
                (
                    image(width, height, bits),
                    image(width, height, bits),
                    0u32..100,
                )
                    .prop_map(move |(left, other, noise)| {
                        let pixels = (0..width * height).map(|i| {
                            let (x, y) = (i % width, i / width);
                            if ((i as u32).wrapping_mul(2_654_435_761) >> 8) % 100 < noise {
                                other.pixels()[i]
                            } else {
                                left.row(y)[(x + by).min(width - 1)]
                            }
                        });
                        let right = GreyImage::new(width, height, bits, pixels.collect()).unwrap();
                        (left, right)
                    })
            },
        )
    }

    prop_compose! {
        fn matcher()(
            min_disparity in -8i32..8, disparities in prop_oneof![1usize..34, Just(64usize), 100usize..256],
            paths in 0usize..4, half in (1usize..4, 0usize..4), p1 in 0u8..20, more in (0u8..40, 0u8..120), p2_halved_by in 0u8..30,
            uniqueness_percent in 0u32..30, left_right_px in prop::option::of(0u32..4), median: bool, speckle_px in 0usize..20,
            speckle_step_px in 0.1f32..3.0,
        ) -> Matcher {
            let census = Census { cols: 2 * half.0 + 1, rows: 2 * half.1 + 1 };
            let p2 = (p1 + more.0 + more.1).min(254 - census.bits() as u8);
            Matcher {
                min_disparity, disparities, paths: Paths::ALL[paths], census, p1, p2, p2_least: (p1 + more.0).min(p2), p2_halved_by,
                uniqueness_percent, left_right_px, median, speckle_px, speckle_step_px,
            }
        }
    }

    proptest! {
        #[test]
        fn disparities_are_those_of_the_definition((left, right) in pair(), matcher in matcher()) {
            match matcher.match_pair(&left, &right) {
                Ok(found) => prop_assert_eq!(found, reference::match_pair(&matcher, &left, &right)),
                Err(error) => {
                    let too_far = matches!(error, MatchError::OutOfImage { .. });
                    prop_assert!(too_far, "{}", error);
                }
            }
        }

        #[test]
        fn threads_change_nothing((left, right) in pair(), matcher in matcher(), threads in 2usize..5) {
            let on = |threads| {
                let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build().unwrap();
                pool.install(|| matcher.match_pair(&left, &right))
            };
            prop_assert_eq!(on(threads), on(1));
        }
    }

    /// A picture of blotches, moved by `by_px`, which may be between pixels.
    fn blotches(width: usize, height: usize, by_px: f64) -> GreyImage {
        let pixels = (0..width * height).map(|i| {
            let (x, y) = ((i % width) as f64 + by_px, (i / width) as f64);
            let wave = |a: f64, b: f64, c: f64| (a * x + b * y + c).sin();
            let sum = wave(0.9, 0.31, 1.0)
                + wave(0.37, -0.83, 2.0)
                + wave(-0.53, 0.59, 0.3)
                + wave(0.21, 0.17, 4.0);
            (30_000.0 + 7_000.0 * sum).round() as u16
        });
        GreyImage::new(width, height, 16, pixels.collect()).unwrap()
    }

    #[test]
    fn a_plane_between_whole_disparities_is_found_there() {
        for by_px in [3.0, 3.25, 3.5, 7.8] {
            let (left, right) = (blotches(120, 40, 0.0), blotches(120, 40, by_px));
            for paths in Paths::ALL {
                let matcher = Matcher {
                    paths,
                    disparities: 16,
                    ..Matcher::default()
                };
                let map = matcher.match_pair(&left, &right).unwrap();
                let found: Vec<f64> = map
                    .values_px()
                    .iter()
                    .filter(|d| !d.is_nan())
                    .map(|&d| f64::from(d))
                    .collect();
                assert!(found.len() > 4_000, "{} at {by_px}", found.len());
                let mean = found.iter().sum::<f64>() / found.len() as f64;
                assert!((mean - by_px).abs() < 0.12, "{mean} at {by_px}");
            }
        }
    }

    #[test]
    fn what_cannot_be_is_refused() {
        let (left, right) = (blotches(20, 5, 0.0), blotches(19, 5, 0.0));
        let default = Matcher::default();
        let error = |matcher: Matcher| matcher.match_pair(&left, &left).unwrap_err();
        assert!(matches!(
            default.match_pair(&left, &right),
            Err(MatchError::Sizes { .. })
        ));
        assert_eq!(
            error(Matcher {
                disparities: 0,
                ..default
            }),
            MatchError::Disparities(0)
        );
        assert_eq!(
            error(Matcher {
                disparities: 257,
                ..default
            }),
            MatchError::Disparities(257)
        );
        for min_disparity in [20, -83, i32::MAX, i32::MIN] {
            let error = error(Matcher {
                min_disparity,
                ..default
            });
            assert!(matches!(error, MatchError::OutOfImage { .. }), "{error}");
        }
        for (cols, rows) in [(4, 5), (5, 4), (1, 1), (11, 9), (usize::MAX, 3)] {
            let error = error(Matcher {
                census: Census { cols, rows },
                ..default
            });
            assert_eq!(error, MatchError::Census { cols, rows });
        }
        for (p1, p2_least, p2) in [(30, 20, 60), (5, 70, 60), (5, 20, 207)] {
            let error = error(Matcher {
                p1,
                p2_least,
                p2,
                ..default
            });
            assert!(matches!(error, MatchError::Penalties { .. }), "{error}");
        }
        let error = error(Matcher {
            speckle_step_px: f32::NAN,
            ..default
        });
        assert!(matches!(error, MatchError::SpeckleStep(_)));
        let large = blotches(2_000, 1_100, 0.0);
        let error = Matcher {
            paths: Paths::Eight,
            disparities: 256,
            ..default
        }
        .match_pair(&large, &large);
        assert!(
            matches!(error, Err(MatchError::Memory { mib: 1074, .. })),
            "{error:?}"
        );
    }
}
