//! A third camera beside the pair, for its blind spot (thesis 7.3.1, Fig. 60).
//!
//! ```text
//!   principal   third                              right
//!       ▼         ▼                                  ▼
//!       ├─ short ─┤                                  │     near: disparities of the long pair are too large to be searched
//!       ├───────────── long ─────────────────────────┤     far: those of the short pair are too small to be exact
//! ```
//!
//! Where the long pair has no estimate, the short one's is taken. It is calibrated, whatever the right camera's errors are.

use super::{GuideInput, GuideMap};
use crate::scene::{Scene, Stereo};

/// What tells the short pair's errors from the long one's.
const SEED: u64 = 1 << 56;

/// The pair of principal and third camera, if there is a third one.
pub(super) fn nearer_pair(stereo: &Stereo) -> Option<Stereo> {
    (stereo.third_camera_baseline_m > 0.0).then_some(Stereo {
        baseline_m: stereo.third_camera_baseline_m,
        third_camera_baseline_m: 0.0,
        yaw_error_deg: 0.0,
        pitch_error_deg: 0.0,
        roll_error_deg: 0.0,
        baseline_error_m: 0.0,
        focal_error_percent: 0.0,
        ..*stereo
    })
}

/// The estimates of the scene's pair and, where it has none and there is a third camera, of that with the principal one.
pub(super) fn with_third_camera(
    input: &GuideInput<'_>,
    estimate: impl Fn(&GuideInput<'_>) -> GuideMap,
) -> GuideMap {
    let far = estimate(input);
    let Some(stereo) = nearer_pair(&input.scene.stereo) else {
        return far;
    };
    let scene = Scene {
        stereo,
        ..input.scene.clone()
    };
    let near = estimate(&GuideInput {
        scene: &scene,
        seed: input.seed.wrapping_add(SEED),
        ..*input
    });
    far.or(&near)
}

#[cfg(test)]
mod tests {
    use crate::guide::test_scenes::{coarse, wall_at};
    use crate::guide::{BehaviouralStereo, Guide, GuideInput, MatchedStereo};
    use crate::scene::GroundTruth;

    #[test]
    fn a_third_camera_sees_what_is_too_near_and_leaves_the_rest() {
        let matched = MatchedStereo {
            binning: 1,
            ..MatchedStereo::default()
        };
        let guides: [&dyn Guide; 2] = [&BehaviouralStereo, &matched];
        for (guide, depth_m) in guides.into_iter().flat_map(|g| [8.0, 40.0].map(|m| (g, m))) {
            let mut scene = coarse(wall_at(depth_m));
            let truth = GroundTruth::render(&scene, 16, 16);
            let mut map = |third_m: f64| {
                scene.stereo.third_camera_baseline_m = third_m;
                guide
                    .estimate(&GuideInput::still(&scene, 16, 16, 3))
                    .unwrap()
            };
            let (pair, three) = (map(0.0), map(0.2));
            if depth_m > 15.0 {
                let same = (0..256).filter(|&n| pair.estimate_of(n) == three.estimate_of(n));
                assert!(same.count() >= pair.guided(), "{} {depth_m}", guide.name());
                continue;
            }
            let good = |map: &crate::guide::GuideMap| {
                let is_good = |&n: &usize| {
                    let (found, true_m) = (map.estimate_of(n), truth.range_m[n].unwrap());
                    found.is_some_and(|(m, sigma_m)| (m - true_m).abs() < 3.5 * sigma_m)
                };
                (0..256).filter(is_good).count()
            };
            assert!(good(&pair) < 13, "{} {}", guide.name(), good(&pair));
            assert!(good(&three) > 210, "{} {}", guide.name(), good(&three));
        }
    }
}
