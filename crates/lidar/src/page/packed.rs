//! A recording as the page takes it: names and numbers as JSON, and of every frame its arrays, compressed.
//!
//! Arrays of a frame, one after the other, little endian; n macropixels in rows:
//!
//! ```text
//!   truth, guide, depth, bound, spread, peak, confidence, signal, background   n × f32 each; NaN where there is none
//!   returns, returns' bounds, returns' photons                  4 × n × f32 each; NaN where there are fewer
//!   edges                                                       n × u32: which of `edges_m`, from 1; 0 where no window opens
//!   start                                                       n × i16: −1 where SPADs are off
//!   object                                                      n × u16: which of `objects`, from 1; 0 for the sky
//!   histograms                                                  n × bins × u16
//!   reason                                                      n × u8: which of `reasons`, from 1; 0 where there is a depth; 128 more in window
//!   camera                                                      n × across² × u8, in rows of the finer picture
//! ```

use std::collections::HashMap;
use std::io::Write;
use std::path::Path;

use base64::Engine;
use base64::prelude::BASE64_STANDARD;
use flate2::Compression;
use flate2::write::GzEncoder;
use rayon::prelude::*;
use serde::Serialize;

use super::recording::{Recorded, Recording};
use crate::chip::SensorConfig;
use crate::files::InputError;
use crate::guide::view;
use crate::report::{Category, DEPTH_COLOURS, Rgb, SMALLEST_TILED_CELL_PX};
use crate::scene::{DVec3, Ray, Scene, Stage};
use crate::system::{
    DepthReturn, NoDepth, RETURNS, Ranger, TakenSettings, drive_scale_m, frame_scale_m,
};
use crate::units::TimeOfFlight;

/// Pixels of the camera view across a macropixel.
const ACROSS: u32 = 4;

/// Added to a reason where the truth lies in the window.
const IN_WINDOW: u8 = 128;

/// What the page is made of.
#[derive(Debug)]
pub(super) struct Packed {
    pub(super) meta: Meta,
    /// A gzip file in base64 for each frame.
    pub(super) frames: Vec<String>,
}

/// The page's names and numbers.
#[derive(Debug, Serialize)]
pub(super) struct Meta {
    pub(super) title: String,
    version: &'static str,
    is_drive: bool,
    /// As `--scene` takes it.
    scene: String,
    seed: u64,
    stop_periods: u32,
    /// The folder, as commands name it.
    folder: String,
    rows: usize,
    cols: usize,
    bins: usize,
    returns: usize,
    across: u32,
    /// Height of a macropixel over its width.
    aspect: f64,
    laser_cycles: u32,
    /// Tangents of the first and the last edge of the view: x, y.
    from: [f64; 2],
    to: [f64; 2],
    /// Standard deviation of the echo as a range, m.
    sigma_m: f64,
    reasons: Vec<Reason>,
    /// Depths at the ends of the colour scale, m, and its colours from near to far.
    scale_m: (f32, f32),
    depth_colours: [Rgb; DEPTH_COLOURS.len()],
    /// Cells of fewer pixels have the mean of their pattern.
    smallest_tiled_px: usize,
    objects: Vec<String>,
    edges_m: Vec<Vec<f32>>,
    probes: Vec<(usize, usize)>,
    times: Vec<FrameMeta>,
}

/// A reason for no depth, and what its macropixels look like.
#[derive(Debug, Serialize)]
struct Reason {
    name: &'static str,
    levels: [[u8; 4]; 4],
    mean: u8,
}

#[derive(Debug, Serialize)]
struct FrameMeta {
    number: u32,
    time_s: f64,
    summary: serde_json::Value,
}

/// Windows that differ, each once.
#[derive(Default)]
struct Windows {
    edges_m: Vec<Vec<f32>>,
    /// By macropixel, where each has windows of its own, and start value.
    numbers: HashMap<(usize, u16), u32>,
}

impl Windows {
    fn number(&mut self, ranger: &Ranger<'_>, pixel: usize, start: u16) -> u32 {
        let of = if ranger.has_own_windows() { pixel } else { 0 };
        *self.numbers.entry((of, start)).or_insert_with(|| {
            let Some(edges_m) = ranger.edges_m(pixel, start) else {
                return 0;
            };
            self.edges_m
                .push(edges_m.iter().map(|&m| m as f32).collect());
            self.edges_m.len() as u32
        })
    }
}

impl Packed {
    /// Packs `recording`, which commands call `folder`.
    ///
    /// # Errors
    /// Histograms that no depth is found in.
    pub(super) fn new(recording: &Recording, folder: &Path) -> Result<Self, InputError> {
        let TakenSettings {
            scene_name,
            scene,
            sensor,
            exposure,
            seed,
            depth,
            ..
        } = &recording.settings;
        let calibration = recording.calibration.as_ref();
        let ranger = Ranger::new(sensor, exposure, scene, depth, calibration);
        let ranger = ranger.map_err(|why| InputError::new(folder.display(), why.to_string()))?;
        let mut windows = Windows::default();
        let packed_frames: Vec<PackedFrame> = (recording.frames.iter())
            .map(|frame| PackedFrame::new(recording, frame, &ranger, &mut windows))
            .collect();
        let scale_m = if recording.is_drive {
            drive_scale_m(scene)
        } else {
            frame_scale_m(
                packed_frames
                    .iter()
                    .flat_map(|frame| &frame.depths_m)
                    .copied(),
            )
        };
        let frames = packed_frames
            .par_iter()
            .map(PackedFrame::compressed)
            .collect();
        let camera = scene.lidar_camera(sensor.rows as u32, sensor.cols as u32);
        let corner = |at: (usize, usize)| {
            let towards = camera.at_unit_depth((at.0 as f64, at.1 as f64));
            [towards.x, towards.y]
        };
        let kind = if recording.is_drive { "Drive" } else { "Frame" };
        let times = recording.frames.iter().map(|frame| FrameMeta {
            number: frame.number,
            time_s: frame.time_s,
            summary: frame.summary.clone(),
        });
        let meta = Meta {
            title: format!("{kind} of {scene_name}"),
            version: env!("CARGO_PKG_VERSION"),
            is_drive: recording.is_drive,
            scene: (scene_name.strip_prefix("built-in "))
                .unwrap_or(scene_name)
                .to_owned(),
            seed: *seed,
            stop_periods: exposure.stop_periods,
            folder: folder.display().to_string(),
            rows: sensor.rows,
            cols: sensor.cols,
            bins: sensor.bins,
            returns: RETURNS,
            across: ACROSS,
            aspect: scene.lidar.macropixel_aspect,
            laser_cycles: exposure.laser_cycles,
            from: corner((0, 0)),
            to: corner((sensor.cols, sensor.rows)),
            sigma_m: scene.pulse_resolution().as_range_m(),
            reasons: Vec::from(NoDepth::categories().map(Reason::from)),
            scale_m,
            depth_colours: DEPTH_COLOURS,
            smallest_tiled_px: SMALLEST_TILED_CELL_PX,
            objects: scene.objects.iter().map(|o| o.name.clone()).collect(),
            edges_m: windows.edges_m,
            probes: recording.probes.clone(),
            times: times.collect(),
        };
        Ok(Packed { meta, frames })
    }
}

impl From<Category<'static>> for Reason {
    fn from(category: Category<'static>) -> Self {
        Reason {
            name: category.name,
            levels: *category.pattern.levels(),
            mean: category.pattern.mean(),
        }
    }
}

/// The arrays of a frame.
struct PackedFrame {
    bytes: Vec<u8>,
    /// Of macropixels that have one.
    depths_m: Vec<f64>,
}

impl PackedFrame {
    fn new(
        recording: &Recording,
        frame: &Recorded,
        ranger: &Ranger<'_>,
        windows: &mut Windows,
    ) -> Self {
        let TakenSettings { sensor, scene, .. } = &recording.settings;
        let bins = sensor.bins;
        let counts_of = |pixel: usize| &frame.counts[pixel * bins..(pixel + 1) * bins];
        let found: Vec<_> = (frame.known.par_iter())
            .map(|known| {
                let counts = counts_of(known.pixel);
                (ranger.depth(known, counts), ranger.peak(known, counts))
            })
            .collect();
        let metres = |m: Option<f64>| m.map_or(f32::NAN, |m| m as f32);
        let mut bytes = Vec::new();
        let mut floats = |of: &dyn Fn(usize) -> Option<f64>| {
            for pixel in 0..found.len() {
                bytes.extend(metres(of(pixel)).to_le_bytes());
            }
        };
        floats(&|p| found[p].0.true_m);
        floats(&|p| found[p].0.guide_m);
        floats(&|p| found[p].0.measured_m);
        floats(&|p| found[p].0.bound_m);
        floats(&|p| found[p].0.spread_m);
        floats(&|p| found[p].0.peak_m);
        floats(&|p| found[p].0.confidence);
        floats(&|p| Some(found[p].1?.signal_counts));
        floats(&|p| Some(found[p].1?.background_per_bin));
        for of in [
            (|found| Some(found.depth_m)) as fn(&DepthReturn) -> Option<f64>,
            |found| found.bound_m,
            |found| Some(found.photons),
        ] {
            for number in 0..RETURNS {
                floats(&|p| of(found[p].0.returns.get(number)?));
            }
        }
        for known in &frame.known {
            let number = known
                .start
                .map_or(0, |start| windows.number(ranger, known.pixel, start));
            bytes.extend(number.to_le_bytes());
        }
        for known in &frame.known {
            let start = known.start.map_or(-1, |start| start as i16);
            bytes.extend(start.to_le_bytes());
        }
        let scene = scene.snapshot(frame.time_s);
        for object in objects(&scene, sensor) {
            bytes.extend(object.to_le_bytes());
        }
        bytes.extend(frame.counts.iter().flat_map(|n| n.to_le_bytes()));
        bytes.extend(found.iter().map(|(pixel, _)| {
            NoDepth::number(pixel.no_depth) + if pixel.in_window { IN_WINDOW } else { 0 }
        }));
        bytes.extend(picture(&scene, sensor));
        let depths_m = found
            .iter()
            .filter_map(|(pixel, _)| pixel.measured_m)
            .collect();
        PackedFrame { bytes, depths_m }
    }

    fn compressed(&self) -> String {
        let mut encoder = GzEncoder::new(Vec::new(), Compression::best());
        encoder.write_all(&self.bytes).expect("memory takes all");
        BASE64_STANDARD.encode(encoder.finish().expect("memory takes all"))
    }
}

/// What the middle of every macropixel sees, from 1; 0 for the sky.
fn objects(scene: &Scene, sensor: &SensorConfig) -> Vec<u16> {
    let (rows, cols) = (sensor.rows, sensor.cols);
    let camera = scene.lidar_camera(rows as u32, cols as u32);
    let stage = Stage::new(scene);
    let pixels = (0..rows * cols).into_par_iter();
    let seen = pixels.map(|pixel| {
        let at = ((pixel % cols) as f64 + 0.5, (pixel / cols) as f64 + 0.5);
        let hit = stage.hit(&Ray::new(DVec3::ZERO, camera.at_unit_depth(at)));
        hit.map_or(0, |hit| (hit.object + 1).min(usize::from(u16::MAX)) as u16)
    });
    seen.collect()
}

/// What a camera in the lidar's place sees, in bytes of grey.
fn picture(scene: &Scene, sensor: &SensorConfig) -> Vec<u8> {
    let (rows, cols) = (sensor.rows as u32, sensor.cols as u32);
    let seen = view(scene, rows * ACROSS, cols * ACROSS);
    let mut sorted = seen.clone();
    let rank = sorted.len() * 99 / 100;
    let bright = *sorted.select_nth_unstable_by(rank, f32::total_cmp).1;
    let grey = |radiance: f32| {
        let share = f64::from(radiance) / f64::from(bright).max(1e-12);
        // Eyes and screens see roots of light.
        (240.0 * libm::pow(share.clamp(0.0, 1.0625), 1.0 / 2.2)).min(255.0) as u8
    };
    seen.into_iter().map(grey).collect()
}
