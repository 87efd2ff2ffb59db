//! Claims 17, 18 and 26: the stereo pair of Table 12 as a guide.

use super::claim::{ClaimRow, Verdict};
use super::demonstrator;
use super::parameters::HSLIDAR_BIN_M;
use super::thesis::{chart, claim};
use crate::guide::StereoRig;
use crate::numerics::intervals::{deviation, mean};
use crate::report::Chart;
use crate::scene::{DVec3, Object, Scene, Shape};
use crate::theory::design::StereoPair;

/// Table 12's pair at full resolution: 12 mm lenses, 3.45 µm pixels, 1 m apart.
pub(super) const PAIR: StereoPair = StereoPair {
    focal_px: 12e-3 / 3.45e-6,
    baseline_m: 1.0,
};
/// The same with 2×2 pixels binned, as the demonstrator runs it (6.3.2).
const BINNED: StereoPair = StereoPair {
    focal_px: PAIR.focal_px / 2.0,
    ..PAIR
};
/// Sub-pixel disparity of the theory line of Fig. 68, px.
pub(super) const THIRD_PX: f64 = 1.0 / 3.0;
/// Window step of the demonstrator in bins: 12.5 ns of 2.6 ns bins (Table 14).
pub(super) const HSLIDAR_STEP_BINS: f64 = 12.5 / 2.6;

/// The built-in rig before a wall across the whole view.
pub(super) fn wall_at(depth_m: f64) -> Scene {
    let mut scene = Scene::outdoor();
    scene.objects = vec![Object::new(
        "wall",
        0.1,
        Shape::Plane {
            centre_m: DVec3::new(0.0, 0.0, depth_m),
            normal: DVec3::new(0.0, 0.0, -1.0),
            width_m: 1e4,
            height_m: 1e4,
        },
    )];
    scene
}

/// Depths that the modelled rig measures in the middle of its image, m.
fn measured_depths_m(scene: &Scene, seed: u64) -> Vec<f64> {
    let rig = StereoRig::new(scene, seed);
    let pixels = (500..580).flat_map(|row| (680..760).map(move |col| (row, col)));
    pixels
        .filter_map(|(row, col)| Some(rig.measure(row, col)?.depth_m))
        .collect()
}

/// Root mean square depth error of the modelled rig at `depth_m`, m.
fn rms_error_m(depth_m: f64) -> f64 {
    let depths = measured_depths_m(&wall_at(depth_m), 5);
    let squares: f64 = depths.iter().map(|d| (d - depth_m).powi(2)).sum();
    (squares / depths.len() as f64).sqrt()
}

/// Slope of ln y over ln x, least squares.
fn exponent(points: &[(f64, f64)]) -> f64 {
    let n = points.len() as f64;
    let logs: Vec<(f64, f64)> = points
        .iter()
        .map(|(x, y)| (libm::log(*x), libm::log(*y)))
        .collect();
    let (mx, my) = logs
        .iter()
        .fold((0.0, 0.0), |(a, b), (x, y)| (a + x / n, b + y / n));
    let sxy: f64 = logs.iter().map(|(x, y)| (x - mx) * (y - my)).sum();
    let sxx: f64 = logs.iter().map(|(x, _)| (x - mx).powi(2)).sum();
    sxy / sxx
}

/// Depths at which the modelled rig is tried, m.
pub(super) const DEPTHS_M: [f64; 8] = [20.0, 30.0, 45.0, 65.0, 90.0, 120.0, 155.0, 195.0];

fn rig_errors() -> Vec<(f64, f64)> {
    DEPTHS_M.map(|z_m| (z_m, rms_error_m(z_m))).to_vec()
}

/// Claim 17: error against distance, and the nearest distance.
pub(super) fn error_rows() -> Vec<ClaimRow> {
    let claim = claim(17);
    let errors = rig_errors();
    let ratio = errors
        .iter()
        .map(|&(z_m, rms_m)| rms_m / PAIR.depth_error_m(z_m, THIRD_PX))
        .sum::<f64>()
        / errors.len() as f64;
    let mut rows = vec![
        claim.row("exponent", exponent(&errors)),
        claim.row("rig_over_line", ratio),
        claim.row("line_200_m", PAIR.depth_error_m(200.0, THIRD_PX)),
        claim.row(
            "one_px",
            100.0 * PAIR.depth_error_m(PAIR.depth_m(10.0), 1.0) / PAIR.depth_m(10.0),
        ),
    ];
    rows.extend(limit_rows());
    rows
}

/// The limits of Table 12's pair, with pixels as they are and binned. Both are published of one rig.
fn limit_rows() -> Vec<ClaimRow> {
    let claim = claim(17);
    let limits = [("unbinned", PAIR), ("binned", BINNED)].map(|(pixels, pair)| {
        [("nearest", 128.0), ("farthest", 10.0)].map(|(end, disparity_px)| {
            let name = format!("{end}_{pixels}");
            claim.row(&name, pair.depth_m(disparity_px))
        })
    });
    let meet = |rig: &&[ClaimRow; 2]| rig.iter().all(|row| row.verdict() == Verdict::Agrees);
    let both = limits.iter().filter(meet).count() as f64;
    // Distance times disparity is constant, so 200 m at 10 px give the least distance, at 128 px.
    let least_nearest_m = 200.0 * 10.0 / 128.0;
    let widest_um = 12e3 / (least_nearest_m * 128.0);
    let narrowest_um = 12e3 / (16.5 * 128.0);
    let headline = claim.row("both_limits", both).remark(format!(
        "128 and 10 px of disparity are 12.8 apart, so that who sees 200 m sees nothing nearer than {least_nearest_m:.1} m. 12 mm lenses meet both with pixels of {narrowest_um:.1} to {widest_um:.1} µm; Table 12's are 3.45 and, binned, 6.9 µm."
    ));
    std::iter::once(headline)
        .chain(limits.into_iter().flatten())
        .collect()
}

/// Fig. 61: distance limits of a 1 m pair.
pub(super) fn figure_61() -> Chart {
    let focal_mm = || (4..=100).map(|i| f64::from(i) * 0.5);
    let limit = |disparity_px: f64, pitch_um: f64| {
        focal_mm().map(move |f| {
            let pair = StereoPair {
                focal_px: f * 1e3 / pitch_um,
                baseline_m: 1.0,
            };
            (f, pair.depth_m(disparity_px))
        })
    };
    chart(61)
        .line("farthest, 3.45 µm pixels", limit(10.0, 3.45))
        .line("nearest, 3.45 µm pixels", limit(128.0, 3.45))
        .dashed("farthest, 2×2 binned", limit(10.0, 6.9))
        .dashed("nearest, 2×2 binned", limit(128.0, 6.9))
        .points("published nearest, 12 mm", [(12.0, 15.0)])
}

/// Estimates of a window of 5×5 pixels in the middle of the image before a wall, as Fig. 66 samples them, m.
fn sampled_m(depth_m: f64, seed: u64) -> Vec<f64> {
    let scene = wall_at(depth_m);
    let rig = StereoRig::new(&scene, seed);
    let pixels = (538..543).flat_map(|row| (718..723).map(move |col| (row, col)));
    pixels
        .filter_map(|(row, col)| Some(rig.measure(row, col)?.depth_m))
        .collect()
}

/// Distances of the sweep, m; the thesis goes to 200 m, and says that what is nearer than about 15 m is not resolved.
fn sweep_m() -> impl Iterator<Item = f64> {
    (2..=20).map(|i| 10.0 * f64::from(i))
}

/// Mean and standard deviation of 5×5 pixels at every distance of the sweep.
fn sampled_sweep() -> Vec<(f64, f64, f64)> {
    sweep_m()
        .map(|z_m| {
            let sampled_m = sampled_m(z_m, z_m as u64);
            (z_m, mean(&sampled_m).value, deviation(&sampled_m).value)
        })
        .collect()
}

/// Fig. 66: mean and three standard deviations of 5×5 pixels against distance.
pub(super) fn figure_66() -> Chart {
    let sweep = sampled_sweep();
    let line = |sigmas: f64| sweep.iter().map(move |(z, m, s)| (*z, m + sigmas * s));
    chart(66)
        .points("mean, modelled rig", line(0.0))
        .dashed("mean + 3 σ", line(3.0))
        .dashed("mean − 3 σ", line(-3.0))
        .line("true", sweep_m().map(|z| (z, z)))
}

/// Fig. 67: standard deviation of 5×5 pixels, and three of the squared fit.
pub(super) fn figure_67() -> Chart {
    let sweep = sampled_sweep();
    // Least squares of σ = a·z²: the fit of Fig. 67 without the terms that Eq. 27 does not have.
    let squares: f64 = sweep.iter().map(|(z, _, _)| z.powi(4)).sum();
    let fit = sweep.iter().map(|(z, _, s)| s * z * z).sum::<f64>() / squares;
    let of_fit = |sigmas: f64| sweep_m().map(move |z| (z, sigmas * fit * z * z));
    let expected = |sigma_px| sweep_m().map(move |z| (z, PAIR.depth_error_m(z, sigma_px)));
    chart(67)
        .points("modelled rig", sweep.iter().map(|(z, _, s)| (*z, *s)))
        .line("squared fit", of_fit(1.0))
        .dashed("three times that", of_fit(3.0))
        .dashed("Eq. 27, ⅓ px", expected(THIRD_PX))
}

/// Fig. 107: a pedestrian who comes nearer, his guide and his window with cameras that have turned towards each other by 0.1°.
///
/// The window is the demonstrator's: 8 bins, its centre on the next step of 12.5 ns.
pub(super) fn figure_107() -> Chart {
    let walk_m = || (60..=100).map(|i| 0.5 * f64::from(i));
    let mean_m = |z_m: f64, yaw_error_deg: f64| {
        let mut scene = wall_at(z_m);
        scene.stereo.yaw_error_deg = yaw_error_deg;
        let rig = StereoRig::new(&scene, 107);
        let pixels = (530..550).flat_map(|row| (710..730).map(move |col| (row, col)));
        let depths: Vec<f64> = pixels
            .filter_map(|(row, col)| Some(rig.measure(row, col)?.depth_m))
            .collect();
        mean(&depths).value
    };
    let guided = |yaw_deg: f64| walk_m().map(move |z_m| (z_m, mean_m(z_m, yaw_deg)));
    let step_m = HSLIDAR_STEP_BINS * HSLIDAR_BIN_M;
    let slipped: Vec<(f64, f64)> = guided(-0.1).collect();
    let edge = |bins: f64| {
        let centre_m = move |guide_m: f64| (guide_m / step_m).round() * step_m;
        slipped
            .iter()
            .map(move |&(z_m, guide_m)| (z_m, centre_m(guide_m) + bins * HSLIDAR_BIN_M))
    };
    chart(107)
        .line("true", walk_m().map(|z| (z, z)))
        .points("guide, calibrated", guided(0.0))
        .points("guide, 0.1° off", slipped.iter().copied())
        .dashed("window's near edge", edge(-4.0))
        .dashed("window's far edge", edge(4.0))
}

/// Fig. 68 and 105: error against distance.
pub(super) fn figure_68() -> Chart {
    let line = |sigma_px: f64| {
        (10..=200).step_by(2).map(move |z| {
            let z_m = f64::from(z);
            (z_m, PAIR.depth_error_m(z_m, sigma_px))
        })
    };
    chart(68)
        .line("Eq. 27, ⅓ px (Fig. 68)", line(THIRD_PX))
        .dashed("Eq. 27, ¼ px (Fig. 105)", line(0.25))
        .points("modelled rig", rig_errors())
}

/// Claim 18: a yaw of 0.1° at 40 m.
pub(super) fn yaw_rows() -> Vec<ClaimRow> {
    let claim = claim(18);
    let depth_m = 40.0;
    let mut scene = wall_at(depth_m);
    scene.stereo.yaw_error_deg = 0.1;
    let depths = measured_depths_m(&scene, 5);
    let mean_m = depths.iter().sum::<f64>() / depths.len() as f64;
    let away_m = -PAIR.yaw_error_m(depth_m, 0.1);
    let towards_m = PAIR.yaw_error_m(depth_m, -0.1);
    // To first order the error is z²·θ/B whatever the lens.
    let degrees = |error_m: f64| (error_m * PAIR.baseline_m / (depth_m * depth_m)).to_degrees();
    let why = format!(
        "z²·tan θ/B is 2.8 m at 40 m for any lens, once one of two cameras 1 m apart turns by 0.1°; 1 to 2 m take {:.3} to {:.3}°.",
        degrees(1.0),
        degrees(2.0)
    );
    vec![
        claim.row("away", away_m).differs(&why),
        claim.row("away_rig", depth_m - mean_m).differs(&why),
        claim.row("towards", towards_m).differs(&why),
        claim.row("half_as_far", -PAIR.yaw_error_m(depth_m, 0.05)),
    ]
}

/// Fig. 70: a yaw after calibration at 40 m.
pub(super) fn figure_70() -> Chart {
    let angles = || (-20..=20).map(|i| f64::from(i) * 0.01);
    let modelled = (-4..=4).map(|i| {
        let yaw_deg = f64::from(i) * 0.05;
        let mut scene = wall_at(40.0);
        scene.stereo.yaw_error_deg = yaw_deg;
        let depths = measured_depths_m(&scene, 5);
        (yaw_deg, depths.iter().sum::<f64>() / depths.len() as f64)
    });
    // “a 1-2 m error from even a 0.1° mechanical deviation” (6.4.2).
    let published = [(0.1, 38.0), (0.1, 39.0), (-0.1, 41.0), (-0.1, 42.0)];
    chart(70)
        .line(
            "formula",
            angles().map(|a| (a, 40.0 + PAIR.yaw_error_m(40.0, a))),
        )
        .points("modelled rig", modelled)
        .points("published, 1 to 2 m", published)
}

/// Claim 26: what throws a target out of its window.
pub(super) fn motion_rows() -> Vec<ClaimRow> {
    let claim = claim(26);
    let window_m = 8.0 * HSLIDAR_BIN_M;
    let metres_per_mile = 1609.344;
    let per_frame_m = 65.0 * metres_per_mile / 3600.0 / 3.0;
    let slip_m = -PAIR.yaw_error_m(40.0, 0.1);
    let mut rows = demonstrator::motion_rows();
    rows.extend([
        claim.row("way_per_frame", per_frame_m),
        claim.row("window", window_m),
        claim.row("way_over_half_window", per_frame_m / (0.5 * window_m)),
        claim.row("slip_over_half_window", slip_m / (0.5 * window_m)),
        claim.row("greatest_speed", 3.0 * 0.5 * window_m),
    ]);
    rows
}
