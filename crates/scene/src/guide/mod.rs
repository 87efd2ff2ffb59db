//! Guides: they estimate where every macropixel's target is, so that its window can be placed there (thesis chapter
//! 5, 7.4.1).
//!
//! ```text
//!   GuideInput: still scene, array, seed, earlier frames ──► Guide ──► GuideMap: range and sigma of every macropixel
//! ```
//!
//! A guide makes errors as the instrument it stands for does, and says how large it takes them to be: `sigma_m` is the guide's own
//! claim, which the windows rely on (Eq. 25) and which may be wrong as the range may be.

mod camera_views;
mod facet;
mod from_file;
mod fused;
mod intensity;
mod kalman;
mod map;
mod mapping;
mod monocular;
mod noisy_truth;
pub mod options;
mod pair;
mod radar;
mod render;
mod rendered;
mod right_camera;
mod stereo;
#[cfg(test)]
#[path = "tests/test_scenes.rs"]
mod test_scenes;
mod third_camera;

use std::fmt::Debug;

use crate::scene::{DVec3, Scene};

pub use camera_views::CameraViews;
pub use from_file::FileMap;
pub use fused::{Fused, MOST_GUIDES};
pub use intensity::IntensityStereo;
pub use kalman::Kalman;
pub use map::GuideMap;
pub use mapping::BehaviouralStereo;
pub use monocular::Monocular;
pub use noisy_truth::NoisyTruth;
pub use pair::MatchedPair;
pub use radar::Radar;
pub use render::view;
pub use rendered::MatchedStereo;
pub use stereo::{StereoPoint, StereoRig};

/// A frame that the lidar has taken before.
#[derive(Debug, Clone, PartialEq)]
pub struct PastFrame {
    /// When its exposure began, s, on the clock of [`GuideInput::time_s`].
    pub time_s: f64,
    /// Measured distance of every macropixel, m, row-major; `None` where there was no significant peak.
    pub range_m: Vec<Option<f64>>,
    /// Counts of every macropixel, all bins together, row-major.
    pub counts: Vec<u32>,
}

/// What a guide may look at.
#[derive(Debug, Clone, Copy)]
pub struct GuideInput<'a> {
    /// The world when the guide looks at it: a still scene, with the optics of lidar and cameras.
    pub scene: &'a Scene,
    /// Rows of the array.
    pub rows: u32,
    /// Columns of the array.
    pub cols: u32,
    /// Seed of the guide's errors: equal seeds give equal maps, whatever the number of threads.
    pub seed: u64,
    /// When the windows will be open, s: what is predicted is predicted for this time.
    pub time_s: f64,
    /// Velocity of the rig as its odometry tells, m/s: x right, y down, z forward.
    pub velocity_m_s: DVec3,
    /// Frames that the lidar has taken before, the latest last.
    pub earlier: &'a [PastFrame],
    /// What the cameras saw when the guide was asked before: no map depends on it, but a still world is looked at once.
    pub views: Option<&'a CameraViews>,
}

impl<'a> GuideInput<'a> {
    /// For a single frame: nothing came before it.
    pub fn still(scene: &'a Scene, rows: u32, cols: u32, seed: u64) -> Self {
        GuideInput {
            scene,
            rows,
            cols,
            seed,
            time_s: 0.0,
            velocity_m_s: DVec3::ZERO,
            earlier: &[],
            views: None,
        }
    }
}

/// Why a guide has no map.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
#[non_exhaustive]
pub enum GuideError {
    /// A map is for another array.
    #[error(
        "{source_name}: this map has {found_rows}x{found_cols} macropixels and the sensor {rows}x{cols}; give one of the sensor's shape"
    )]
    Shape {
        /// Where the map comes from.
        source_name: String,
        /// Rows of the map.
        found_rows: usize,
        /// Columns of the map.
        found_cols: usize,
        /// Rows of the sensor.
        rows: usize,
        /// Columns of the sensor.
        cols: usize,
    },
}

/// Something that estimates the distance of every macropixel's target.
pub trait Guide: Debug + Send + Sync {
    /// What it is, in a word or two, for tables and remarks.
    fn name(&self) -> &str;

    /// The estimate for every macropixel.
    ///
    /// # Errors
    /// What keeps it from giving any.
    fn estimate(&self, input: &GuideInput<'_>) -> Result<GuideMap, GuideError>;

    /// Whether nothing but its name, the look of the scene ([`Scene::looks_like`]), array and seed decides its map of a still scene.
    fn follows_from_look(&self) -> bool {
        false
    }

    /// Where it has estimates at all, as part of a sentence; `None` where nothing limits it.
    fn reach(&self, _scene: &Scene) -> Option<String> {
        None
    }
}
