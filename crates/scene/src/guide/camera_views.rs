//! What the two cameras see without noise, kept for the next look.
//!
//! ```text
//!   scene, part of the images ─► radiances, exposure ──┐    kept
//!                               seed ──► noise ────────┴─► images
//! ```
//!
//! From frame to frame of a drive noise is new, and the world mostly is not.

use std::sync::{Arc, Mutex, PoisonError};

use super::render::{Crop, Radiances};
use crate::scene::Scene;

/// Looks that are kept: of the pair, and of a third camera.
const MOST_KEPT: usize = 2;

/// What cameras saw of the latest scenes, for guides that are asked frame after frame.
#[derive(Debug, Default)]
pub struct CameraViews(Mutex<Vec<KeptView>>);

#[derive(Debug)]
struct KeptView {
    scene: Scene,
    crop: Crop,
    grain: f64,
    radiances: Arc<Radiances>,
}

impl CameraViews {
    /// What both cameras see in this part of their images: what is kept, or what `render` gives.
    pub(super) fn radiances(
        &self,
        scene: &Scene,
        (crop, grain): (Crop, f64),
        render: impl FnOnce() -> Radiances,
    ) -> Arc<Radiances> {
        let lock = || self.0.lock().unwrap_or_else(PoisonError::into_inner);
        let is_it =
            |view: &&KeptView| view.crop == crop && view.grain == grain && view.scene == *scene;
        if let Some(view) = lock().iter().find(is_it) {
            return Arc::clone(&view.radiances);
        }
        let radiances = Arc::new(render());
        let mut views = lock();
        if views.len() == MOST_KEPT {
            views.remove(0);
        }
        views.push(KeptView {
            scene: scene.clone(),
            crop,
            grain,
            radiances: Arc::clone(&radiances),
        });
        radiances
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::guide::test_scenes::{coarse, wall_at};
    use crate::guide::{Guide, GuideInput, MatchedStereo};

    /// Of scenes and seeds in any order, with a third camera or another guide between, maps are those without anything kept.
    #[test]
    fn maps_are_those_of_a_new_look() {
        let near = coarse(wall_at(20.0));
        let mut dark = near.clone();
        dark.light.illuminance_klux = 0.01;
        let mut third = near.clone();
        third.stereo.third_camera_baseline_m = 0.3;
        let scenes = [near, coarse(wall_at(40.0)), dark, third];
        let guides = [
            MatchedStereo::default(),
            MatchedStereo {
                grain: 0.3,
                ..MatchedStereo::default()
            },
        ];
        let views = CameraViews::default();
        let order = [0, 0, 1, 0, 2, 2, 0, 3, 3, 1];
        let mut maps = Vec::new();
        for (seed, scene) in order.into_iter().enumerate() {
            for guide in &guides {
                let input = GuideInput::still(&scenes[scene], 16, 16, seed as u64 / 2);
                let anew = guide.estimate(&input).unwrap();
                let kept = GuideInput {
                    views: Some(&views),
                    ..input
                };
                assert_eq!(guide.estimate(&kept).unwrap(), anew);
                maps.push(anew);
            }
        }
        assert!(maps[0] != maps[1] && maps[0] != maps[4] && maps[0] != maps[6]);
    }

    #[test]
    fn the_same_look_is_rendered_once() {
        let views = CameraViews::default();
        let scenes = [20.0, 30.0, 40.0].map(|depth_m| coarse(wall_at(depth_m)));
        let crop = Crop {
            binning: 1,
            left: 0,
            top: 0,
            width: 1,
            height: 1,
        };
        let rendered = |scene: &Scene| {
            let mut is_rendered = false;
            views.radiances(scene, (crop, 0.1), || {
                is_rendered = true;
                Radiances {
                    images: [vec![0.5], vec![0.4]],
                    exposure_s: 1e-3,
                }
            });
            is_rendered
        };
        let order = [0, 0, 1, 0, 1, 2, 2, 0];
        let expected = [true, false, true, false, false, true, false, true];
        assert_eq!(order.map(|scene| rendered(&scenes[scene])), expected);
    }
}
