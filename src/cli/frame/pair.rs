//! `gdtof frame --left L.png --right R.png --calib C.toml [--truth D.npy]`: a real camera pair instead of a scene.
//!
//! ```text
//!  left ──┬─► semi-global matching ──► disparities ──► the guide
//!  right ─┘                               │ (no truth)
//!  truth ─────────────────────────────────┴─► depths ──┐
//!  left ─────────────────────────────► reflectivities ─┴─► the scene that sends light back
//! ```

use std::path::{Path, PathBuf};
use std::sync::Arc;

use clap::Args;
use serde::Serialize;

use super::calibration::read_calibration;
use crate::chip::SensorConfig;
use crate::cli::stereo::{Errors, TruthArgs, cannot_match, disparity_picture, read_image};
use crate::files::{InputError, Raster};
use crate::guide::{Guide, GuideInput, MatchedPair};
use crate::report::{Table, write_npy_f32};
use crate::scene::{DVec3, DepthMap, GroundTruth, MapFiles, Object, PinholeCamera, Scene, Shape};
use crate::stereo::{DisparityMap, Matcher};

/// Standard deviation that is claimed for a disparity, px: half of all errors on the Motorcycle pair are below 0.15 px, as with 0.22 px, and tails are
/// longer than a Gaussian's.
const SIGMA_PX: f64 = 0.25;

const DEPTH_FILE: &str = "depth_map.npy";

/// A pair of pictures.
#[derive(Args)]
pub(super) struct PairArgs {
    /// Left picture (PNG) of a real, rectified camera pair to use in place of a scene; needs --right and --calib.
    #[arg(long, value_name = "FILE", requires_all = ["right", "calib"], conflicts_with_all = ["scene", "world"])]
    left: Option<PathBuf>,
    /// Right picture of that pair (PNG).
    #[arg(long, value_name = "FILE", requires = "left")]
    right: Option<PathBuf>,
    /// Calibration of that pair: a calib.txt of Middlebury or KITTI, or TOML with left and right (3x3 intrinsics, px) and baseline_m; optionally
    /// disparities, min_disparity, lidar_position_m (from the left camera) and lidar_fov_deg.
    #[arg(long, value_name = "FILE", requires = "left")]
    calib: Option<PathBuf>,
    /// The light is computed from the truth; without one from the pair's own depths.
    #[command(flatten)]
    truth: TruthArgs,
}

/// The pair in place of a scene.
pub(super) struct MatchedPairScene {
    pub(super) scene: Scene,
    pub(super) guide: Arc<dyn Guide>,
    pub(super) report: PairReport,
    map: DisparityMap,
    depths_m: Vec<f32>,
    matcher: Matcher,
}

/// What a report says of the pair.
#[derive(Debug, Serialize)]
pub(super) struct PairReport {
    left: String,
    right: String,
    light_from: &'static str,
    matched: usize,
    disparity_errors: Option<Errors>,
}

impl PairArgs {
    /// What the scene is called; `None` where there is no pair.
    pub(super) fn name(&self) -> Option<String> {
        Some(format!(
            "{} and {}",
            self.left.as_ref()?.display(),
            self.right.as_ref()?.display()
        ))
    }

    /// Reads and matches the pair. `optics` is the scene whose lidar, light and air stay.
    ///
    /// # Errors
    /// Files that cannot be read or do not make a pair; a calibration that is impossible or gives no depth.
    pub(super) fn match_pair(
        &self,
        sensor: &SensorConfig,
        optics: Scene,
        out: &Path,
    ) -> Result<Option<MatchedPairScene>, InputError> {
        let (Some(left_path), Some(right_path), Some(calib_path)) =
            (&self.left, &self.right, &self.calib)
        else {
            return Ok(None);
        };
        let complain = |message: String| InputError::new(calib_path.display(), message);
        let (calibration, [own, other]) = read_calibration(calib_path)?;
        let (left, right) = (read_image(left_path)?, read_image(right_path)?);
        let size = (left.width(), left.height());
        if let Some(whole) = calibration.size_px.filter(|whole| *whole != size) {
            let message = format!(
                "is of pictures of {} x {} pixels, and {} has {} x {}; give pictures of that size",
                whole.0,
                whole.1,
                left_path.display(),
                size.0,
                size.1
            );
            return Err(complain(message));
        }
        let default = Matcher::default();
        let matcher = Matcher {
            disparities: calibration.disparities.unwrap_or(default.disparities),
            min_disparity: calibration.min_disparity.unwrap_or(default.min_disparity),
            ..default
        };
        let map = (matcher.match_pair(&left, &right))
            .map_err(|error| cannot_match(left_path, right_path, &error))?;
        let truth = self.truth.read(&left)?;

        let mut camera =
            PinholeCamera::centred(own.focal_px, left.width() as u32, left.height() as u32);
        camera.centre = own.principal_px;
        let offset_px = other.principal_px.0 - own.principal_px.0;
        let baseline_m = calibration.baseline_m;
        let depth_m = |&disparity_px: &f32| {
            let depth_m = own.focal_px * baseline_m / (f64::from(disparity_px) + offset_px);
            if disparity_px.is_finite() && depth_m > 0.0 && depth_m.is_finite() {
                depth_m as f32
            } else {
                0.0
            }
        };
        let light = truth.as_deref().unwrap_or(map.values_px());
        let depths_m: Vec<f32> = light.iter().map(depth_m).collect();
        if depths_m.iter().all(|&z| z == 0.0) {
            let place = self.truth.truth.as_ref().unwrap_or(left_path);
            let message = "no pixel has a depth by this calibration; check disparities, baseline_m and principal points";
            return Err(InputError::new(place.display(), message));
        }
        let raster = Raster {
            width: left.width(),
            height: left.height(),
            values: depths_m.clone(),
            white: 1.0,
        };
        let files = MapFiles {
            depth: out.join(DEPTH_FILE),
            reflectivity: Some(left_path.clone()),
            grey: None,
            unit_m: Some(1.0),
            is_range: false,
            focal_px: own.focal_px,
            principal_px: Some(own.principal_px),
        };
        let from_camera_m = calibration.lidar_position_m.unwrap_or(DVec3::ZERO);
        let shape = Shape::Map {
            centre_m: -from_camera_m,
            yaw_deg: 0.0,
            map: Arc::new(DepthMap::from_depths(files, raster)?),
        };
        let mut scene = optics;
        scene.objects = vec![Object::new("pair", 1.0, shape)];
        scene.stereo.position_m = -from_camera_m;
        let (rows, cols) = (sensor.rows as u32, sensor.cols as u32);
        scene.lidar.fov_deg = (calibration.lidar_fov_deg)
            .unwrap_or_else(|| fov_deg(own.focal_px, (left.width(), left.height()), (rows, cols)));

        let guide = MatchedPair::new(&map, &camera, baseline_m, offset_px, SIGMA_PX);
        let input = GuideInput::still(&scene, rows, cols, 0);
        let guided = guide.estimate(&input).map_or(0, |map| map.guided());
        let seen = GroundTruth::render(&scene, rows, cols);
        if seen.range_m.iter().flatten().count() == 0 || (guided == 0 && guide.points() > 0) {
            return Err(complain(
                "this calibration puts every pixel of the pair outside of the lidar's view; check principal points, lidar_position_m and lidar_fov_deg".into(),
            ));
        }
        let report = PairReport {
            left: left_path.display().to_string(),
            right: right_path.display().to_string(),
            light_from: match truth {
                Some(_) => "the truth",
                None => "the pair's own depths",
            },
            matched: map.matched(),
            disparity_errors: truth.map(|truth| Errors::new(&map, &truth)),
        };
        Ok(Some(MatchedPairScene {
            scene,
            guide: Arc::new(guide),
            report,
            map,
            depths_m,
            matcher,
        }))
    }
}

impl MatchedPairScene {
    /// Writes depths that light comes from, and disparities that guide.
    ///
    /// # Errors
    /// When a file cannot be written.
    pub(super) fn write(&self, out: &Path) -> Result<(), InputError> {
        let shape = [self.map.height(), self.map.width()];
        write_npy_f32(&out.join(DEPTH_FILE), &shape, &self.depths_m)?;
        write_npy_f32(&out.join("disparity.npy"), &shape, self.map.values_px())?;
        disparity_picture(&self.matcher, &self.map, &out.join("disparity.png"))
    }
}

impl PairReport {
    /// Adds the pair's rows to a frame's table.
    pub(super) fn rows(&self, table: &mut Table) {
        table.push("light from", self.light_from);
        table.push("pixels matched", self.matched);
        if let Some(errors) = &self.disparity_errors {
            errors.rows(table);
        }
    }

    /// A note on how to read the errors.
    pub(super) fn note(&self) -> Option<&'static str> {
        self.disparity_errors.is_none().then_some(
            "Light comes from the depths that the pair itself has matched: errors of the guide are in both and are not seen. --truth gives other light.",
        )
    }
}

/// The field of view of an array of square macropixels that just fits into a picture.
fn fov_deg(focal_px: f64, (width, height): (usize, usize), (rows, cols): (u32, u32)) -> f64 {
    let across = (width as f64 / f64::from(cols)).min(height as f64 / f64::from(rows));
    2.0 * libm::atan(0.5 * across * f64::from(cols) / focal_px).to_degrees()
}
