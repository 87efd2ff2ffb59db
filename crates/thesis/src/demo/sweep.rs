//! The distance sweep of 6.4.2 (Fig. 103 to 105): a figure at steps up to 50 m under 72 klux, nine frames, 3×3 macropixels of it.

use super::Demonstrator;
use super::found::mean;
use super::scenes::figure_at;
use crate::report::{Axis, Chart};
use crate::scene::GroundTruth;
use crate::system::{DriveSimulation, FrameError, FrameSettings, PixelDepth};

/// Illuminance, klux.
pub(crate) const KLUX: f64 = 72.0;
/// Frames at each distance.
pub const FRAMES: u32 = 9;
/// Side of the square of macropixels.
const SIDE: usize = 3;
/// Distances, m: from where the stereo rig begins to see (7.3.1).
pub const DISTANCES_M: [f64; 8] = [16.0, 20.0, 25.0, 30.0, 35.0, 40.0, 45.0, 50.0];
/// Reflectivity of the figure, which is not published: that of the target by which the light was measured (Fig. 94).
pub const REFLECTIVITY: f64 = 0.1;

/// What is measured at one distance.
#[derive(Debug, Clone, PartialEq, serde::Serialize)]
pub struct SweepPoint {
    /// Where the figure stands, m.
    pub distance_m: f64,
    /// Macropixels times frames.
    pub samples: usize,
    /// Those with a depth.
    pub depths: usize,
    /// Those with the figure in their window.
    pub in_window: usize,
    /// Mean error of the depths, m.
    pub mean_error_m: f64,
    /// Their standard deviation, m.
    pub sigma_m: f64,
    /// Root mean square error, m.
    pub rms_m: f64,
    /// The same of the guide.
    pub guide_rms_m: f64,
    /// Its theory for a quarter of a pixel (Eq. 27), m.
    pub(crate) guide_theory_m: f64,
}

/// The sweep; `done` is called after every frame.
///
/// # Errors
/// What a drive reports.
pub fn sweep(
    demonstrator: &Demonstrator,
    reflectivity: f64,
    seed: u64,
    done: impl Fn(),
) -> Result<Vec<SweepPoint>, FrameError> {
    let points = DISTANCES_M.iter();
    points
        .map(|&distance_m| point(demonstrator, distance_m, reflectivity, seed, &done))
        .collect()
}

/// The figure at one distance; `done` is called after every frame.
///
/// # Errors
/// What a drive reports.
pub(crate) fn point(
    demonstrator: &Demonstrator,
    distance_m: f64,
    reflectivity: f64,
    seed: u64,
    done: impl Fn(),
) -> Result<SweepPoint, FrameError> {
    point_with(demonstrator, distance_m, reflectivity, seed, |_| (), done)
}

/// As [`point`], with frames that `change` has made different.
///
/// # Errors
/// What a drive reports.
pub(crate) fn point_with(
    demonstrator: &Demonstrator,
    distance_m: f64,
    reflectivity: f64,
    seed: u64,
    change: impl FnOnce(&mut FrameSettings),
    done: impl Fn(),
) -> Result<SweepPoint, FrameError> {
    let scene = figure_at(distance_m, reflectivity, KLUX);
    let camera = scene.stereo.camera();
    let focal_baseline_px_m = camera.focal_px * scene.stereo.baseline_m;
    let mut settings = demonstrator.drive(scene, seed + (distance_m * 10.0) as u64);
    let (rows, cols) = (demonstrator.sensor.rows, demonstrator.sensor.cols);
    let truth = GroundTruth::render(&settings.frame.scene, rows as u32, cols as u32);
    let square = square_on(&truth);
    settings.only = Some(square.clone());
    change(&mut settings.frame);
    let mut drive = DriveSimulation::new(&settings)?;
    let mut pixels: Vec<PixelDepth> = Vec::new();
    for _ in 0..FRAMES {
        let frame = drive.frame(|_| {})?;
        let on_it = frame.pixels.iter().zip(&square);
        pixels.extend(on_it.filter(|&(_, &on)| on).map(|(pixel, _)| pixel));
        done();
    }
    let errors: Vec<f64> = pixels.iter().filter_map(PixelDepth::error_m).collect();
    let mean_error_m = mean(errors.iter().copied()).unwrap_or(f64::NAN);
    let square_m2 = |values: &mut dyn Iterator<Item = f64>| {
        mean(values.map(|v| v * v)).map_or(f64::NAN, f64::sqrt)
    };
    let guides = pixels.iter().filter_map(|p| Some(p.guide_m? - p.true_m?));
    Ok(SweepPoint {
        distance_m,
        samples: pixels.len(),
        depths: errors.len(),
        in_window: pixels.iter().filter(|p| p.in_window).count(),
        mean_error_m,
        sigma_m: square_m2(&mut errors.iter().map(|e| e - mean_error_m)),
        rms_m: square_m2(&mut errors.iter().copied()),
        guide_rms_m: square_m2(&mut guides.into_iter()),
        guide_theory_m: distance_m * distance_m * 0.25 / focal_baseline_px_m,
    })
}

/// Fig. 103, 104 and 105, with their numbers.
pub fn charts(points: &[SweepPoint]) -> [(u32, Chart); 3] {
    let curve = |y: fn(&SweepPoint) -> f64| -> Vec<(f64, f64)> {
        points.iter().map(|p| (p.distance_m, y(p))).collect()
    };
    let title = "9 frames of 3×3 macropixels at 72 klux";
    let whiskers = points.iter().flat_map(|p| {
        let mean_m = p.distance_m + p.mean_error_m;
        [mean_m - 3.0 * p.sigma_m, mean_m + 3.0 * p.sigma_m].map(|m| (p.distance_m, m))
    });
    let mean = Chart::new(
        format!("Measured distance, {title}: mean and three standard deviations"),
        Axis::linear("true distance (m)"),
        Axis::linear("measured distance (m)"),
    )
    .whiskers("3 σ", whiskers)
    .points("mean", curve(|p| p.distance_m + p.mean_error_m))
    .dashed("true", curve(|p| p.distance_m));
    let sigma = Chart::new(
        format!("Standard deviation, {title}"),
        Axis::linear("distance (m)"),
        Axis::linear("σ (m)"),
    )
    .points("measured on the model", curve(|p| p.sigma_m))
    .dashed("0.1 % of the distance", curve(|p| 1e-3 * p.distance_m));
    let rms = Chart::new(
        format!("RMS error, {title}"),
        Axis::linear("distance (m)"),
        Axis::log("RMS error (m)"),
    )
    .points("guided lidar", curve(|p| p.rms_m))
    .points("its stereo guide", curve(|p| p.guide_rms_m))
    .dashed("a quarter of a pixel, Eq. 27", curve(|p| p.guide_theory_m))
    .line("published, at most 0.15 m", curve(|_| 0.15));
    [(103, mean), (104, sigma), (105, rms)]
}

/// The square of macropixels that lies on the figure, nearest to the middle of it.
fn square_on(truth: &GroundTruth) -> Vec<bool> {
    let (rows, cols) = (truth.rows as usize, truth.cols as usize);
    let on_it: Vec<(f64, f64)> = (0..rows * cols)
        .filter(|&pixel| truth.object[pixel] == Some(1))
        .map(|pixel| ((pixel / cols) as f64, (pixel % cols) as f64))
        .collect();
    let middle =
        |coordinate: fn(&(f64, f64)) -> f64| mean(on_it.iter().map(coordinate)).unwrap_or(0.0);
    let (row, col) = (middle(|p| p.0), middle(|p| p.1));
    // Rows and columns from the one that has the middle less half a side.
    let first = |middle: f64| (middle - (SIDE - 1) as f64 / 2.0).round().max(0.0) as usize;
    let within = |at: usize, middle: f64| (first(middle)..first(middle) + SIDE).contains(&at);
    (0..rows * cols)
        .map(|pixel| within(pixel / cols, row) && within(pixel % cols, col))
        .collect()
}
