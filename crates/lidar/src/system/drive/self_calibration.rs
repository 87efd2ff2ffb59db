//! Self-calibration of the camera pair in a drive (thesis 7.3.2): how far the right camera has turned, told by the lidar's depths.
//!
//! ```text
//!   guide's disparity − that of the lidar's depth      ▁▁▂▁▁▁▇█▇▁▁▁▂▁    all that have both: most agree on the camera's turn
//!                                                            ╰ ±1 px: the fullest, its mean ─► rectified so from the next frame on
//! ```
//!
//! A turn of the right camera adds about the same disparity everywhere, f·tan(turn). Near surfaces stay in their windows and tell of it. Where
//! hardly any does, one macropixel in four looks where its surface would be after some other turn, each another one, up to ±1°.
//!
//! What has moved since the guide's images tells of other turns. So depths count that are those of the frame before, and all the same from
//! surfaces at several depths: a car ahead that goes at the lidar's own speed is at one. A turn upwards or about the axis changes no depth, and
//! is not found.

use std::collections::BTreeSet;

use crate::guide::GuideMap;
use crate::scene::Scene;
use crate::system::pixel::PixelDepth;

/// Disparities as far as this from each other tell of one turn, px: three standard deviations of the thesis's rig; chosen.
const AGREE_PX: f64 = 1.0;

/// A surface that is nearer or farther than in the frame before by more than this is one that moves, m: three standard deviations of a depth;
/// chosen.
const STILL_M: f64 = 0.2;

/// Depths of one surface differ by less than this factor, at so many depths at least a turn must be seen, by so many macropixels; chosen.
const ONE_DEPTH: f64 = 1.1;
const DEPTHS: usize = 3;
const FEWEST: usize = 8;

/// Where fewer than one in so many of the guide's macropixels has a depth, and these do not agree, one in so many searches; chosen.
const FEW: usize = 20;
const SEARCHING: usize = 4;

/// Turns that are searched, degrees either way; chosen.
const SEARCHED_DEG: f64 = 1.0;

/// Multiples of it spread evenly between whole numbers.
const GOLDEN: f64 = 0.618_033_988_749_894_8;

/// What is known of the right camera.
#[derive(Debug)]
pub(super) struct SelfCalibration {
    /// By how much it is taken to have turned outwards since calibration, degrees.
    turn_deg: f64,
    is_lost: bool,
    focal_px: f64,
    focal_baseline_px_m: f64,
    /// Nearer surfaces are those of a third camera, which has not turned.
    most_px: f64,
    /// How far ahead the cameras stand, m.
    ahead_m: f64,
    /// Depths of the frame before.
    before_m: Vec<Option<f64>>,
    /// Depth over range, of every macropixel.
    depth_per_range: Vec<f64>,
}

impl SelfCalibration {
    /// Of a rig as it was calibrated.
    pub(super) fn new(scene: &Scene, rows: u32, cols: u32) -> Self {
        let (lidar, stereo) = (scene.lidar_camera(rows, cols), &scene.stereo);
        let pixels = (0..rows).flat_map(|row| (0..cols).map(move |col| (col, row)));
        let middle = |(col, row): (u32, u32)| (f64::from(col) + 0.5, f64::from(row) + 0.5);
        let depth = |at| 1.0 / lidar.at_unit_depth(middle(at)).length();
        let focal_px = stereo.camera().focal_px;
        SelfCalibration {
            turn_deg: 0.0,
            is_lost: false,
            focal_px,
            focal_baseline_px_m: focal_px * stereo.baseline_m,
            most_px: stereo.max_disparity_px,
            ahead_m: stereo.position_m.z,
            before_m: Vec::new(),
            depth_per_range: pixels.map(depth).collect(),
        }
    }

    /// By how much the right camera is taken to have turned outwards, degrees.
    pub(super) fn turn_deg(&self) -> f64 {
        self.turn_deg
    }

    /// A world as the cameras see it once their images are rectified by what is known of the turn.
    pub(super) fn rectified(&self, world: Scene) -> Scene {
        let mut world = world;
        world.stereo.yaw_error_deg -= self.turn_deg;
        world
    }

    /// Disparity of a macropixel's surface at a range, px.
    fn disparity_px(&self, pixel: usize, range_m: f64) -> f64 {
        self.focal_baseline_px_m / (range_m * self.depth_per_range[pixel] - self.ahead_m)
    }

    /// Where macropixels look: at the guide's estimates, and some of them elsewhere, where the turn is not known.
    pub(super) fn aimed(&self, guide: &GuideMap, frame: u32) -> GuideMap {
        let mut aimed = guide.clone();
        if !self.is_lost {
            return aimed;
        }
        let reach_px = self.focal_px * libm::tan(SEARCHED_DEG.to_radians());
        let searching = aimed.range_m.iter_mut().enumerate();
        let searching = searching
            .skip(frame as usize % SEARCHING)
            .step_by(SEARCHING);
        for (pixel, range_m) in searching {
            let Some(estimate_m) = *range_m else { continue };
            let number = pixel as f64 + f64::from(frame) * self.depth_per_range.len() as f64;
            let offset_px = reach_px * (2.0 * (number * GOLDEN).fract() - 1.0);
            let disparity_px = self.disparity_px(pixel, estimate_m) - offset_px;
            if disparity_px > 0.0 {
                let depth_m = self.focal_baseline_px_m / disparity_px;
                *range_m = Some((depth_m + self.ahead_m) / self.depth_per_range[pixel]);
            }
        }
        aimed
    }

    /// Learns the turn from the depths of a frame.
    pub(super) fn learn(&mut self, pixels: &[PixelDepth]) {
        let told = |(number, pixel): (usize, &PixelDepth)| {
            let (guide_m, measured_m) = (pixel.guide_m?, pixel.measured_m?);
            let before_m = self.before_m.get(number).copied().flatten();
            let is_still = before_m.is_some_and(|m| (m - measured_m).abs() < STILL_M);
            let guided_px = self.disparity_px(number, guide_m);
            let offset_px = guided_px - self.disparity_px(number, measured_m);
            let depth = (libm::log(measured_m) / libm::log(ONE_DEPTH)) as i32;
            let is_of_pair = guided_px <= self.most_px && offset_px.is_finite();
            (is_of_pair && (is_still || self.is_lost)).then_some((offset_px, depth))
        };
        let mut offsets: Vec<(f64, i32)> = pixels.iter().enumerate().filter_map(told).collect();
        offsets.sort_by(|a, b| a.0.total_cmp(&b.0));
        let agreeing = (0..offsets.len()).map(|first| {
            let from = &offsets[first..];
            &from[..from.partition_point(|(px, _)| px - from[0].0 <= 2.0 * AGREE_PX)]
        });
        let most = agreeing
            .max_by_key(|agreeing| agreeing.len())
            .unwrap_or(&[]);
        let depths: BTreeSet<i32> = most.iter().map(|(_, depth)| *depth).collect();
        let agree = most.len() >= FEWEST && depths.len() >= DEPTHS;
        if agree {
            let offset_px = most.iter().map(|(px, _)| px).sum::<f64>() / most.len() as f64;
            self.turn_deg += libm::atan(offset_px / self.focal_px).to_degrees();
        }
        let guided = pixels
            .iter()
            .filter(|pixel| pixel.guide_m.is_some())
            .count();
        // Two frames are needed to tell.
        let is_first = self.before_m.is_empty();
        self.before_m = pixels.iter().map(|pixel| pixel.measured_m).collect();
        let has_few = self.before_m.iter().flatten().count() * FEW < guided;
        self.is_lost = has_few && !agree && !is_first;
    }
}

#[cfg(test)]
mod tests {
    use crate::chip::{Exposure, SensorConfig};
    use crate::scene::Scene;
    use crate::system::{DriveFrame, DriveSettings, DriveSimulation, FrameSettings};

    /// Frames of the street, whose right camera has turned by so much.
    fn drive(turn_deg: f64, self_calibrates: bool, number: u32) -> Vec<DriveFrame> {
        let mut scene = Scene::outdoor();
        scene.stereo.yaw_error_deg = turn_deg;
        let sensor = SensorConfig {
            rows: 64,
            cols: 64,
            ..SensorConfig::default()
        };
        let exposure = Exposure::new(&sensor, 520, 400);
        let settings = DriveSettings {
            self_calibrates,
            segments: 1,
            ..DriveSettings::new(FrameSettings::new(sensor, scene, exposure))
        };
        let mut drive = DriveSimulation::new(&settings).unwrap();
        (0..number).map(|_| drive.frame(|_| {}).unwrap()).collect()
    }

    fn share_in_window(frame: &DriveFrame) -> f64 {
        let summary = frame.summary();
        summary.in_window as f64 / summary.with_target as f64
    }

    #[test]
    fn windows_are_where_they_were_a_few_frames_after_a_turn() {
        // A frame has the same errors in every drive.
        let calibrated: Vec<f64> = drive(0.0, false, 5).iter().map(share_in_window).collect();
        // Far turns leave hardly anything in its window, and are searched for.
        let turns = [(0.1, 4), (-0.9, 5), (-0.1, 4), (0.9, 5)];
        let takes_all = std::env::var_os("GDTOF_CASES").is_some();
        let taken = if takes_all { turns.len() } else { 2 };
        for (turn_deg, frames) in turns.into_iter().take(taken) {
            let off = share_in_window(&drive(turn_deg, false, 1)[0]);
            let found = drive(turn_deg, true, frames);
            let last = found.last().unwrap();
            let back = share_in_window(last);
            let calibrated = calibrated[frames as usize - 1];
            assert!(off < 0.7 * calibrated, "{turn_deg}: {off} {calibrated}");
            assert!(
                (back - calibrated).abs() < 0.015,
                "{turn_deg}: {back} {calibrated}"
            );
            let error_deg = (last.camera_turn_deg - turn_deg).abs();
            assert!(error_deg < 0.005, "{turn_deg}: {error_deg}");
        }
    }

    #[test]
    fn a_calibrated_pair_stays_as_it_is() {
        let (with, without) = (drive(0.0, true, 3), drive(0.0, false, 3));
        for (with, without) in with.iter().zip(&without) {
            assert!(
                with.camera_turn_deg.abs() < 0.003,
                "{}",
                with.camera_turn_deg
            );
            let shares = [with, without].map(share_in_window);
            assert!((shares[0] - shares[1]).abs() < 0.01, "{shares:?}");
        }
    }
}
