//! What the lidar looks at: surfaces, sunlight, the lidar's and the stereo camera's optics, and
//! the true distance of every macropixel.
//!
//! Coordinates in metres: x to the right, y down, z forward, the lidar at the origin.

mod camera;
mod cast;
mod entry;
mod file;
mod illumination;
mod keys;
mod motion;
mod rules;
mod settings;
mod shape;
mod truth;
mod vector;

pub use camera::PinholeCamera;
pub use cast::{Hit, Return, Returns};
pub use illumination::SKY_REFLECTIVITY;
pub use settings::{Lidar, Light, Scene, Stereo};
pub use shape::{Object, Shape};
pub use truth::GroundTruth;
pub use vector::{Ray, turned};

/// A point or direction, m (or without unit): x right, y down, z forward.
pub use glam::DVec3;
