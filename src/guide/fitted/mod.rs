//! The guide of the camera pair with errors drawn as the matcher makes them: about as fast as the drawn guide, and wrong in the matcher's ways.
//!
//! ```text
//!   ray of a binned pixel ─► true disparity ─┐ bleeding of near edges
//!                        └─► texture ────────┴─► none? gross? ─► error, alike in neighbours ─► points ─► macropixels
//! ```
//!
//! No images are matched. Every number of the default is fitted to what [`MatchedStereo`] does on rendered walls and posts (`vectors/stereo/errors.csv`,
//! which `vectors/remake.sh` makes anew); tests hold both guides' errors together.
//!
//! Limits: errors have no bias by the fraction of a pixel (the matcher's is 0.04 px), pixels beside an edge have answers like others (of the matcher's, a
//! quarter have none in the two pixels at either side), occluded pixels have no answer at all, panes are not seen, and rows that do not lie in a line (pitch, roll)
//! are matched as if they did.

mod field;
#[cfg(test)]
mod statistics;
#[cfg(test)]
mod tests;
mod texture;

use rayon::prelude::*;

use self::field::Field;
use self::texture::Law;
use super::mapping;
use super::render::{BINNING, Crop, Exposed, GRAIN, exposed};
use super::stereo::{StereoPoint, StereoRig};
use super::{Guide, GuideError, GuideInput, GuideMap, MatchedStereo};
use crate::scene::Scene;
use crate::settings::{Key, Range};

/// The camera pair with errors like those of semi-global matching.
///
/// All lengths are in binned pixels. Its claimed standard deviation is Eq. 27's with `sigma_px`.
#[derive(Debug, Clone, Copy, PartialEq, serde::Serialize, serde::Deserialize)]
#[serde(deny_unknown_fields, default)]
pub struct FittedStereo {
    /// Camera pixels across that make one.
    pub binning: u32,
    /// Grain of surfaces without a texture, as a share of their brightness (standard deviation).
    pub grain: f64,
    /// Standard deviation that is claimed for a disparity.
    pub sigma_px: f64,
    /// Standard deviation of a disparity's error where texture is strong.
    pub error_px: f64,
    /// Pixels over which errors are alike; 1: they are independent.
    pub correlation_px: f64,
    /// Pixels without an answer where texture is strong, per cent.
    pub invalid_percent: f64,
    /// Answers that are wrong by any amount where texture is strong, per cent.
    pub gross_percent: f64,
    /// Size of patches without an answer or with a gross one.
    pub patch_px: f64,
    /// Texture over noise at which half of the pixels have no answer.
    pub texture_limit: f64,
    /// By how much near surfaces are too wide on either side.
    pub bleed_px: f64,
}

impl Default for FittedStereo {
    fn default() -> Self {
        let MatchedStereo {
            binning,
            grain,
            sigma_px,
            ..
        } = MatchedStereo::default();
        FittedStereo {
            binning,
            grain,
            sigma_px,
            error_px: 0.1,
            correlation_px: 6.0,
            invalid_percent: 0.4,
            gross_percent: 0.0,
            patch_px: 3.0,
            texture_limit: 1.2,
            bleed_px: 0.0,
        }
    }
}

pub(super) const KEYS: &[Key] = &[
    Key {
        what: "Camera pixels across that are binned to one; all lengths here are in binned pixels",
        ..BINNING
    },
    GRAIN,
    Key {
        name: "sigma_px",
        what: "Standard deviation claimed for a disparity",
        unit: "",
        range: Range::Within(0.0, 100.0),
        source: "that of the guide matched",
    },
    Key {
        name: "error_px",
        what: "Standard deviation of a disparity's error where texture is strong",
        unit: "",
        range: Range::Within(0.0, 100.0),
        source: FITTED,
    },
    Key {
        name: "correlation_px",
        what: "Pixels over which errors are alike; 1: independent",
        unit: "",
        range: Range::Within(1.0, 1000.0),
        source: FITTED,
    },
    Key {
        name: "invalid_percent",
        what: "Pixels without an answer where texture is strong",
        unit: "%",
        range: Range::Within(0.0, 100.0),
        source: FITTED,
    },
    Key {
        name: "gross_percent",
        what: "Answers that are wrong by any amount where texture is strong",
        unit: "%",
        range: Range::Within(0.0, 100.0),
        source: FITTED,
    },
    Key {
        name: "patch_px",
        what: "Size of patches without an answer or with a gross one",
        unit: "",
        range: Range::Within(1.0, 1000.0),
        source: FITTED,
    },
    Key {
        name: "texture_limit",
        what: "Texture over noise of a pixel at which half of them have no answer",
        unit: "",
        range: Range::Within(0.0, 1000.0),
        source: FITTED,
    },
    Key {
        name: "bleed_px",
        what: "By how much near surfaces are too wide on either side",
        unit: "",
        range: Range::Within(0.0, 100.0),
        source: "measured: 0.2, less than a pixel (vectors/stereo/errors.csv, edges)",
    },
];

const FITTED: &str = "fitted to the guide matched (vectors/stereo/errors.csv)";

/// What is true of a binned pixel.
#[derive(Debug, Clone, Copy)]
struct Seen {
    radiance: f64,
    contrast: f64,
    /// Binned pixels.
    disparity_px: Option<f64>,
}

impl FittedStereo {
    fn crop(&self, input: &GuideInput<'_>) -> Option<Crop> {
        let matched = MatchedStereo {
            binning: self.binning,
            ..MatchedStereo::default()
        };
        matched.crop(input)
    }

    fn law(&self) -> Law {
        Law {
            sigma_px: self.error_px,
            invalid: self.invalid_percent / 100.0,
            gross: self.gross_percent / 100.0,
            limit: self.texture_limit,
        }
    }

    /// The nearest of what is seen up to `bleed_px` to either side, and the pixel's own brightness.
    fn seen(&self, rig: &StereoRig<'_>, at: (f64, f64)) -> Seen {
        let binning = f64::from(self.binning);
        let look = super::render::look(rig.stage(), rig.camera(), at, self.grain, binning);
        let mut disparity_px = rig.true_disparity_px(at);
        if self.bleed_px > 0.0 {
            for side in [-1.0, 1.0] {
                let beside = (at.0 + side * self.bleed_px * binning, at.1);
                let near = rig.true_disparity_px(beside);
                // A slanted surface is no edge, and what differs by less than a pixel is no other.
                let is_edge = |d: f64| disparity_px.is_none_or(|own| d > own + binning);
                if let Some(d) = near.filter(|&d| is_edge(d)) {
                    disparity_px = Some(d);
                }
            }
        }
        Seen {
            radiance: look.radiance,
            contrast: look.contrast,
            disparity_px: disparity_px.map(|px| px / binning),
        }
    }

    /// Points of every `stride`-th binned pixel, in the left camera's coordinates.
    fn points(&self, input: &GuideInput<'_>, stride: usize) -> Vec<StereoPoint> {
        let Some(crop) = self.crop(input) else {
            return Vec::new();
        };
        let drawn = self.drawn(input, crop, stride);
        let stereo = &input.scene.stereo;
        let camera = stereo.camera();
        let accepted = stereo.min_disparity_px..=stereo.max_disparity_px;
        let points = drawn.into_iter().filter_map(|(row, col, binned_px)| {
            let disparity_px = binned_px * f64::from(crop.binning);
            if disparity_px <= 0.0 || !accepted.contains(&disparity_px) {
                return None;
            }
            let (u, v) = crop.middle(row, col);
            let depth_m = camera.focal_px * stereo.baseline_m / disparity_px;
            Some(StereoPoint {
                row: v as u32,
                col: u as u32,
                disparity_px,
                depth_m,
                point_m: camera.at_unit_depth((u, v)) * depth_m,
            })
        });
        points.collect()
    }

    /// Rows, columns and disparities, all in binned pixels of the crop.
    fn drawn(&self, input: &GuideInput<'_>, crop: Crop, stride: usize) -> Vec<(usize, usize, f64)> {
        let scene = input.scene;
        let rig = StereoRig::new(scene, input.seed);
        let every = |size: u32| (stride / 2..size as usize).step_by(stride);
        let rows: Vec<usize> = every(crop.height).collect();
        let seen: Vec<Vec<Seen>> = rows
            .par_iter()
            .map(|&row| {
                let pixels = every(crop.width).map(|col| crop.middle(row, col));
                pixels.map(|at| self.seen(&rig, at)).collect()
            })
            .collect();
        let radiances: Vec<f32> = (seen.iter().flatten())
            .map(|seen| seen.radiance as f32)
            .collect();
        if radiances.is_empty() {
            return Vec::new();
        }
        let light = exposed(scene, crop.binning, &radiances);
        let pixels = rows.par_iter().zip(&seen).flat_map_iter(|(&row, seen)| {
            let light = &light;
            every(crop.width).zip(seen).filter_map(move |(col, seen)| {
                let px = self.answer(input.seed, crop, (row, col), seen, light, scene)?;
                Some((row, col, px))
            })
        });
        pixels.collect()
    }

    /// The disparity that a matcher would find, binned pixels.
    fn answer(
        &self,
        seed: u64,
        crop: Crop,
        (row, col): (usize, usize),
        seen: &Seen,
        light: &Exposed,
        scene: &Scene,
    ) -> Option<f64> {
        let true_px = seen.disparity_px?;
        let texture = light.texture(seen.radiance, seen.contrast);
        let law = self.law();
        let row = i64::from(crop.top) + row as i64;
        let col = i64::from(crop.left) + col as i64;
        let below = |field, limit: f64| {
            // Most pixels are far from any limit.
            limit > -6.0 && field::patches(seed, field, row, col, self.patch_px) < limit
        };
        if below(Field::Invalid, law.invalid_below(texture)) {
            return None;
        }
        if below(Field::Gross, law.gross_below(texture)) {
            let patch = field::of_patch(seed, Field::GrossAt, row, col, self.patch_px);
            let most_px = scene.stereo.max_disparity_px / f64::from(self.binning);
            // A normal number's fraction after many multiples is uniform.
            return Some((1e3 * patch).rem_euclid(1.0) * most_px);
        }
        let error = field::fine(seed, row, col, self.correlation_px);
        Some(true_px + law.sigma_px(texture) * error)
    }
}

impl Guide for FittedStereo {
    fn name(&self) -> &str {
        "fitted"
    }

    fn estimate(&self, input: &GuideInput<'_>) -> Result<GuideMap, GuideError> {
        let rig = StereoRig::new(input.scene, input.seed);
        let lidar = input.scene.lidar_camera(input.rows, input.cols);
        let camera_px = mapping::stride(&rig, &lidar);
        let stride = (camera_px / self.binning).max(1) as usize;
        let sigma_px = self.sigma_px * f64::from(self.binning);
        let sigma_m = |depth_m: f64| depth_m * depth_m * sigma_px / rig.focal_baseline_px_m();
        Ok(mapping::of_points(
            input.scene,
            input.rows,
            input.cols,
            &self.points(input, stride),
            sigma_m,
        ))
    }

    fn reach(&self, scene: &Scene) -> Option<String> {
        super::BehaviouralStereo.reach(scene)
    }
}
