//! The guide: a stereo camera's idea of the distance of every macropixel (thesis 5.2 and 6.3.3).

mod mapping;
mod stereo;

pub use mapping::GuideMap;
pub use stereo::{StereoPoint, StereoRig};
