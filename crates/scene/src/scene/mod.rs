//! What the lidar looks at: surfaces, sunlight, the lidar's and the stereo camera's optics, and
//! the true distance of every macropixel.
//!
//! Coordinates in metres: x to the right, y down, z forward, the lidar at the origin.

mod bounce;
mod bounds;
mod builtin;
mod bundle;
mod camera;
mod cast;
mod curve;
mod daylight;
mod entry;
mod eye_safety;
mod falling;
mod file;
mod fog;
mod heat;
mod illumination;
mod interferer;
mod look;
mod medium;
#[cfg(test)]
#[path = "tests/mirrors.rs"]
mod mirrors;
mod motion;
mod object;
mod optics;
mod others_light;
mod rig;
mod rules;
mod settings;
mod shape;
mod spads;
mod stray_light;
mod texture;
mod truth;
mod unmoved;
mod vector;
mod view;
mod words;

pub(crate) use bounds::Bounds;
pub use camera::PinholeCamera;
pub use cast::{Hit, Stage};
pub use curve::{Curve, CurveError, CurveSetting};
pub use eye_safety::{Emission, EyeRule, EyeSafety, Train};
pub use illumination::{MOST_BACKGROUND_HZ, MOST_PER_ECHO, is_beyond_model};
pub use interferer::Interferer;
pub use medium::{DROPLET_LIDAR_RATIO_SR, Medium};
pub use object::Object;
pub use rig::{Rig, RigWaypoint, Waypoint};
pub use settings::{Lidar, Light, MOST_BASELINE_M, SKY_REFLECTIVITY, Scene, Stereo};
pub use shape::{DepthMap, MapFiles, Mesh, Shape};
pub use texture::{Pattern, Picture, Texture};
pub use truth::{GroundTruth, PreviousWorld};
pub use vector::{Ray, turned};
pub use view::Surface;
pub use words::{BeamWord, FilterWord, PdeWord, PulseWord, StrayWord, VignettingWord};

/// A point or direction, m (or without unit): x right, y down, z forward.
pub use glam::DVec3;
