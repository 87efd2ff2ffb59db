//! From stereo depths to guided macropixels (thesis 6.3.3, Equations 30 to 32).
//!
//! Each camera pixel with a depth becomes a point in the world (Eq. 30, 31), which is projected
//! into the lidar's image (Eq. 32). Lidar and cameras look the same way, so R_L = 1 and T_L is
//! the camera's position.
//!
//! Several camera pixels land in one macropixel. The thesis mentions taking the most frequent value and itself discards duplicates for speed, without
//! saying which one it keeps. Here the one nearest to the macropixel's centre is kept, and the others tell the slope along which it is moved there,
//! and whether there are two surfaces (`facet`).
//!
//! Camera and lidar stand in different places, so the camera may see what an edge hides from the
//! lidar, and such a point can be the one kept. Guides of macropixels on the rim of near objects
//! are therefore sometimes those of the background, as in any rig with a parallax.

use rayon::prelude::*;

use super::facet::{self, Sample};
use super::stereo::{StereoPoint, StereoRig};
use super::third_camera::{nearer_pair, with_third_camera};
use super::{Guide, GuideError, GuideInput, GuideMap};
use crate::scene::{PinholeCamera, Scene};

/// About this many camera pixels are measured across one macropixel.
///
/// Three make nine candidates, enough to come within a sixth of a macropixel of its centre;
/// more would cost time and change little.
const SAMPLES_ACROSS: f64 = 3.0;

/// A stereo point that has landed in the lidar's image.
#[derive(Debug, Clone, Copy)]
struct Landing {
    index: usize,
    sample: Sample,
}

/// Measures with the scene's stereo rig and maps onto a `rows` × `cols` array; equal seeds
/// give equal maps, whatever the number of threads.
pub(super) fn of_rig(scene: &Scene, rows: u32, cols: u32, seed: u64) -> GuideMap {
    let rig = StereoRig::new(scene, seed);
    let lidar = scene.lidar_camera(rows, cols);
    let stride = stride(&rig, &lidar);
    let image_rows: Vec<u32> = offsets(rig.camera.height, stride).collect();
    let landings: Vec<Vec<Landing>> = image_rows
        .par_iter()
        .map(|&row| {
            offsets(rig.camera.width, stride)
                .filter(|&col| may_land(scene, &lidar, &rig, (row, col)))
                .filter_map(|col| {
                    let point = rig.measure(row, col)?;
                    land(scene, &lidar, &point, rig.depth_sigma_m(point.depth_m))
                })
                .collect()
        })
        .collect();
    of_landings(&lidar, landings.into_iter().flatten())
}

/// Maps points, each with the standard deviation of its depth, m, and whether it is at the rim of a near surface, onto a `rows` × `cols` array.
pub(super) fn of_points<'p>(
    scene: &Scene,
    rows: u32,
    cols: u32,
    points: impl IntoIterator<Item = (&'p StereoPoint, f64, bool)>,
) -> GuideMap {
    let lidar = scene.lidar_camera(rows, cols);
    let points = points.into_iter();
    let landings = points.filter_map(|(point, sigma_m, is_rim)| {
        let mut landing = land(scene, &lidar, point, sigma_m)?;
        landing.sample.is_rim = is_rim;
        Some(landing)
    });
    of_landings(&lidar, landings)
}

/// One estimate of all that lands in a macropixel.
fn of_landings(lidar: &PinholeCamera, landings: impl Iterator<Item = Landing>) -> GuideMap {
    let (rows, cols) = (lidar.height, lidar.width);
    let mut landings: Vec<Landing> = landings.collect();
    // Stable, so that of two samples as near to a centre the one further up, then further left, comes first.
    landings.sort_by_key(|landing| landing.index);
    let mut estimates = vec![None; rows as usize * cols as usize];
    let pitch = [1.0 / lidar.focal_px, 1.0 / lidar.focal_v_px];
    let mut samples = Vec::new();
    for of_one in landings.chunk_by(|a, b| a.index == b.index) {
        samples.clear();
        samples.extend(of_one.iter().map(|landing| landing.sample));
        estimates[of_one[0].index] = facet::estimate(&mut samples, pitch);
    }
    GuideMap::new(rows, cols, estimates)
}

/// Camera pixels from one measurement to the next.
pub(super) fn stride(rig: &StereoRig, lidar: &PinholeCamera) -> u32 {
    let camera_px_per_macropixel = rig.camera.focal_px / lidar.focal_px.max(lidar.focal_v_px);
    (camera_px_per_macropixel / SAMPLES_ACROSS).floor().max(1.0) as u32
}

/// Every `stride`-th pixel of `size`, starting half a stride in.
fn offsets(size: u32, stride: u32) -> impl Iterator<Item = u32> {
    (stride / 2..size).step_by(stride as usize)
}

/// Whether a camera pixel may land in the lidar's image, at whatever depth it is measured: as that grows, it goes straight from
/// where the nearest lands to where the farthest does. Most rows of the demonstrator's cameras see what is above or below it.
fn may_land(
    scene: &Scene,
    lidar: &PinholeCamera,
    rig: &StereoRig<'_>,
    (row, col): (u32, u32),
) -> bool {
    /// As good as endless.
    const FAR_M: f64 = 1e9;
    let pixel = (f64::from(col) + 0.5, f64::from(row) + 0.5);
    let direction = rig.camera.at_unit_depth(pixel);
    let nearest_m = rig.focal_baseline_px_m() / scene.stereo.max_disparity_px;
    let ends = [nearest_m, FAR_M]
        .map(|depth_m| lidar.project(direction * depth_m + scene.stereo.position_m));
    let [Some((u0, v0)), Some((u1, v1))] = ends else {
        return true;
    };
    let (width, height) = (f64::from(lidar.width), f64::from(lidar.height));
    u0.max(u1) >= 0.0 && u0.min(u1) <= width && v0.max(v1) >= 0.0 && v0.min(v1) <= height
}

/// Where in the lidar's image a stereo point lands; `None` outside.
fn land(
    scene: &Scene,
    lidar: &PinholeCamera,
    point: &StereoPoint,
    sigma_m: f64,
) -> Option<Landing> {
    let from_lidar = point.point_m + scene.stereo.position_m;
    let (u, v) = lidar.project(from_lidar)?;
    let (row, col) = lidar.pixel_at((u, v))?;
    let (du, dv) = (u - f64::from(col) - 0.5, v - f64::from(row) - 0.5);
    // The error is along the camera's ray: what of it the lidar sees as range is its share along the lidar's.
    let range_per_depth = from_lidar.normalize().dot(point.point_m) / point.depth_m;
    let range_m = from_lidar.length();
    Some(Landing {
        index: row as usize * lidar.width as usize + col as usize,
        sample: Sample {
            at: [du, dv],
            inverse: 1.0 / range_m,
            sigma: sigma_m * range_per_depth.abs() / (range_m * range_m),
            is_rim: false,
        },
    })
}

/// The scene's stereo rig with the errors of [`StereoRig`](super::StereoRig).
///
/// The standard deviation of a range is Eq. 27's at the estimated depth, rounding to sub-pixel steps included.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub struct BehaviouralStereo;

impl Guide for BehaviouralStereo {
    fn name(&self) -> &str {
        "stereo"
    }

    fn estimate(&self, input: &GuideInput<'_>) -> Result<GuideMap, GuideError> {
        Ok(with_third_camera(input, |input| {
            of_rig(input.scene, input.rows, input.cols, input.seed)
        }))
    }

    fn follows_from_look(&self) -> bool {
        true
    }

    fn reach(&self, scene: &Scene) -> Option<String> {
        let stereo = &scene.stereo;
        let metre_pixels = stereo.camera().focal_px * stereo.baseline_m;
        let shortest_m = nearer_pair(stereo).map_or(stereo.baseline_m, |pair| pair.baseline_m);
        Some(format!(
            "the camera pair measures from {:.1} m (max_disparity_px) to {:.1} m (min_disparity_px), where both cameras see the same",
            stereo.camera().focal_px * shortest_m / stereo.max_disparity_px,
            metre_pixels / stereo.min_disparity_px,
        ))
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::scene::{DVec3, GroundTruth, Object, Shape};

    fn perfect_wall(z_m: f64) -> Scene {
        let mut scene = Scene::outdoor();
        scene.stereo.disparity_sigma_px = 0.0;
        scene.stereo.subpixel_steps = 65_536;
        scene.objects = vec![Object::new(
            "wall",
            0.5,
            Shape::Plane {
                centre_m: DVec3::new(0.0, 0.0, z_m),
                normal: DVec3::new(0.0, 0.0, -1.0),
                width_m: 1e4,
                height_m: 1e4,
            },
        )];
        scene
    }

    #[test]
    fn a_perfect_rig_guides_every_pixel_to_the_truth() {
        for position_m in [DVec3::ZERO, DVec3::new(-0.5, 0.1, 0.3)] {
            let mut scene = perfect_wall(60.0);
            scene.stereo.position_m = position_m;
            let guide = of_rig(&scene, 64, 64, 0);
            let truth = GroundTruth::render(&scene, 64, 64);
            assert_eq!(guide.guided(), 64 * 64);
            for (g, t) in guide
                .range_m
                .iter()
                .flatten()
                .zip(truth.range_m.iter().flatten())
            {
                // Half a macropixel at the corner of the field is worth 2.6 cm of radial range.
                assert!((g - t).abs() < 0.03, "{g} {t}");
            }
        }
    }

    /// Pixels that land nowhere at any depth are left out, and no others: against every depth from the nearest on, in small steps.
    #[test]
    fn pixels_are_left_out_that_land_nowhere() {
        let mut scene = perfect_wall(60.0);
        for position_m in [
            DVec3::ZERO,
            DVec3::new(-0.5, 0.1, 0.3),
            DVec3::new(0.3, -0.4, 0.0),
        ] {
            scene.stereo.position_m = position_m;
            let rig = StereoRig::new(&scene, 0);
            let lidar = scene.lidar_camera(32, 48);
            let nearest_m = rig.focal_baseline_px_m() / scene.stereo.max_disparity_px;
            let (mut in_view, mut beside) = (0, 0);
            for (row, col) in (5..rig.camera.height)
                .step_by(29)
                .flat_map(|row| (3..rig.camera.width).step_by(17).map(move |col| (row, col)))
            {
                let direction = rig
                    .camera
                    .at_unit_depth((f64::from(col) + 0.5, f64::from(row) + 0.5));
                let depths_m = (0..=600)
                    .map(|step| nearest_m * libm::pow(1e9 / nearest_m, f64::from(step) / 600.0));
                let lands = depths_m.into_iter().any(|depth_m| {
                    let at = lidar.project(direction * depth_m + position_m);
                    at.and_then(|at| lidar.pixel_at(at)).is_some()
                });
                let may = may_land(&scene, &lidar, &rig, (row, col));
                assert!(may || !lands, "{row}, {col} lands and is left out");
                in_view += usize::from(lands);
                beside += usize::from(may && !lands);
            }
            // At the corners, a way may pass by that the ends' box does not.
            assert!(
                beside * 100 <= in_view && in_view > 500,
                "{beside} beside {in_view}"
            );
        }
    }

    #[test]
    fn three_pixels_are_measured_across_a_macropixel_from_half_a_stride_on() {
        let scene = perfect_wall(60.0);
        let rig = StereoRig::new(&scene, 0);
        for (rows, cols) in [(16, 16), (32, 64), (64, 32), (1000, 1000)] {
            let lidar = scene.lidar_camera(rows, cols);
            let across = rig.camera.focal_px / lidar.focal_px.max(lidar.focal_v_px);
            let wanted = ((across / 3.0) as u32).max(1);
            assert_eq!(stride(&rig, &lidar), wanted);
        }
        assert_eq!(offsets(14, 4).collect::<Vec<_>>(), [2, 6, 10]);
        assert_eq!(offsets(8, 5).collect::<Vec<_>>(), [2, 7]);
        assert_eq!(offsets(3, 1).collect::<Vec<_>>(), [0, 1, 2]);
    }

    /// A point's place in its macropixel, its range, and what a metre along the camera's ray changes of that.
    #[test]
    fn a_point_lands_where_it_is_seen() {
        let mut scene = perfect_wall(60.0);
        scene.stereo.position_m = DVec3::new(-4.0, 1.0, 2.0);
        let lidar = scene.lidar_camera(32, 48);
        let rig = StereoRig::new(&scene, 0);
        let mut landed = 0;
        for (row, col) in (100..1000)
            .step_by(35)
            .flat_map(|row| (100..1400).step_by(35).map(move |col| (row, col)))
        {
            let direction = rig
                .camera
                .at_unit_depth((f64::from(col) + 0.5, f64::from(row) + 0.5));
            let at_depth = |depth_m: f64| StereoPoint {
                row,
                col,
                disparity_px: 1.0,
                depth_m,
                point_m: direction * depth_m,
            };
            let Some(landing) = land(&scene, &lidar, &at_depth(12.0), 0.2) else {
                continue;
            };
            landed += 1;
            let range_m = |depth_m: f64| (direction * depth_m + scene.stereo.position_m).length();
            let (u, v) = lidar
                .project(direction * 12.0 + scene.stereo.position_m)
                .expect("in view");
            assert_eq!(landing.index, v as usize * 48 + u as usize);
            let Sample {
                at,
                inverse,
                sigma,
                is_rim,
            } = landing.sample;
            assert!(
                (at[0] - (u.fract() - 0.5)).abs() < 1e-9
                    && (at[1] - (v.fract() - 0.5)).abs() < 1e-9
            );
            assert!((inverse * range_m(12.0) - 1.0).abs() < 1e-12 && !is_rim);
            let per_m = (range_m(12.001) - range_m(11.999)) / 0.002;
            let wanted = 0.2 * per_m / range_m(12.0).powi(2);
            assert!((sigma / wanted - 1.0).abs() < 1e-6, "{sigma} {wanted}");
        }
        assert!(landed > 20, "{landed}");
    }

    #[test]
    fn the_street_is_guided_almost_everywhere_but_in_the_sky() {
        let scene = Scene::outdoor();
        let guide = of_rig(&scene, 64, 64, 1);
        let truth = GroundTruth::render(&scene, 64, 64);
        let rig = StereoRig::new(&scene, 1);
        let (mut surfaces, mut guided, mut close) = (0, 0, 0);
        for (g, t) in guide.range_m.iter().zip(&truth.range_m) {
            if let Some(t) = t {
                surfaces += 1;
                if let Some(g) = g {
                    guided += 1;
                    // Slanted surfaces change within a macropixel: a tenth on top of 3 sigma.
                    close += usize::from((g - t).abs() < 3.0 * rig.depth_sigma_m(*t) + 0.1 * t);
                }
            }
        }
        assert!(
            guided * 100 > surfaces * 85,
            "{guided} of {surfaces} guided"
        );
        assert!(close * 100 > guided * 95, "{close} of {guided} close");
    }

    #[test]
    fn a_seed_gives_the_same_map_on_any_number_of_threads() {
        let scene = Scene::outdoor();
        let here = of_rig(&scene, 16, 16, 5);
        let alone = rayon::ThreadPoolBuilder::new()
            .num_threads(1)
            .build()
            .unwrap()
            .install(|| of_rig(&scene, 16, 16, 5));
        assert_eq!(here, alone);
        assert_ne!(here, of_rig(&scene, 16, 16, 6));
    }

    /// At the ends of what it measures, pixels of the two cameras are as far apart as its disparities reach.
    #[test]
    fn a_rig_says_between_which_ranges_it_measures() {
        let mut scene = Scene::outdoor();
        scene.stereo.baseline_m = 0.7;
        let (stereo, camera) = (&scene.stereo, scene.stereo.camera());
        let reach = BehaviouralStereo.reach(&scene).unwrap();
        let ends_m: Vec<f64> = reach
            .split_whitespace()
            .filter_map(|word| word.parse().ok())
            .collect();
        assert_eq!(ends_m.len(), 2, "{reach}");
        for (depth_m, disparity_px) in ends_m
            .iter()
            .zip([stereo.max_disparity_px, stereo.min_disparity_px])
        {
            let baseline_m = match nearer_pair(stereo) {
                Some(pair) if disparity_px == stereo.max_disparity_px => pair.baseline_m,
                _ => stereo.baseline_m,
            };
            let columns = [0.0, baseline_m]
                .map(|x_m| camera.project(DVec3::new(x_m, 0.0, *depth_m)).unwrap().0);
            // The range is told to 0.1 m.
            let told = 0.06 / depth_m;
            assert!(
                ((columns[1] - columns[0]) / disparity_px - 1.0).abs() < told,
                "{columns:?} {reach}"
            );
        }
    }

    #[test]
    fn an_array_finer_than_the_camera_has_gaps_but_works() {
        let guide = of_rig(&perfect_wall(60.0), 64, 2048, 0);
        assert!(guide.guided() > 0 && guide.guided() < 64 * 2048);
    }
}
