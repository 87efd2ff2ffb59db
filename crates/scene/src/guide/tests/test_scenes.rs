//! What tests of guides share.

use std::ops::Range;

use super::{Guide, GuideInput};
use crate::scene::{DVec3, GroundTruth, Object, Scene, Shape};

/// The street's optics before a wall across the whole view.
pub(super) fn wall_at(depth_m: f64) -> Scene {
    let mut scene = Scene::outdoor();
    scene.objects.truncate(1);
    scene.objects[0] = Object {
        name: "wall".into(),
        shape: Shape::Plane {
            centre_m: DVec3::new(0.0, 0.0, depth_m),
            normal: DVec3::new(0.0, 0.0, -1.0),
            width_m: 1e4,
            height_m: 1e4,
        },
        ..scene.objects[0].clone()
    };
    scene
}

/// The rig with a sixth of its pixels either way, which renders 36 times as fast.
pub(super) fn coarse(mut scene: Scene) -> Scene {
    let stereo = &mut scene.stereo;
    stereo.pixel_pitch_um *= 6.0;
    stereo.width /= 6;
    stereo.height /= 6;
    stereo.min_disparity_px /= 6.0;
    stereo.max_disparity_px /= 6.0;
    scene
}

/// Holds a guide's map of the street to its seed alone: equal on any number of threads, another for another seed.
pub(super) fn depends_on_its_seed_alone(guide: &dyn Guide) {
    let scene = coarse(Scene::outdoor());
    let estimate = |seed| {
        guide
            .estimate(&GuideInput::still(&scene, 16, 16, seed))
            .unwrap()
    };
    let pool = rayon::ThreadPoolBuilder::new()
        .num_threads(1)
        .build()
        .unwrap();
    assert_eq!(pool.install(|| estimate(5)), estimate(5));
    assert_ne!(estimate(5), estimate(6));
}

/// Estimate less truth of every macropixel of `size`×`size`, and the standard deviation claimed for it, m.
pub(super) fn errors_m(
    guide: &dyn Guide,
    scene: &Scene,
    size: u32,
    seeds: Range<u64>,
) -> Vec<(f64, f64)> {
    let truth = GroundTruth::render(scene, size, size);
    let maps = seeds.map(|seed| {
        let input = GuideInput::still(scene, size, size, seed);
        guide.estimate(&input).unwrap()
    });
    let errors = maps.flat_map(|map| {
        let pixels = (0..map.range_m.len()).map(|pixel| {
            let (range_m, sigma_m) = map.estimate_of(pixel)?;
            Some((range_m - truth.range_m[pixel]?, sigma_m))
        });
        pixels.flatten().collect::<Vec<_>>()
    });
    errors.collect()
}

/// Errors over the standard deviation claimed for them.
pub(super) fn normalised_errors(
    guide: &dyn Guide,
    scene: &Scene,
    size: u32,
    seeds: Range<u64>,
) -> Vec<f64> {
    let errors = errors_m(guide, scene, size, seeds).into_iter();
    errors.map(|(error_m, sigma_m)| error_m / sigma_m).collect()
}

/// Root mean square error, m.
pub(super) fn rms_error_m(guide: &dyn Guide, scene: &Scene, size: u32, seeds: Range<u64>) -> f64 {
    let errors = errors_m(guide, scene, size, seeds);
    let squares: f64 = errors.iter().map(|(e, _)| e * e).sum();
    (squares / errors.len() as f64).sqrt()
}
