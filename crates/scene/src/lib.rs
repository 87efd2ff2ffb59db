#![cfg_attr(not(test), warn(unreachable_pub, clippy::disallowed_methods))]
//! The world before the chip, and the guides that say where to look.
//!
//! | module | what lives there |
//! |---|---|
//! | [`scene`] | surfaces, optics, sunlight, ground truth |
//! | [`stereo`] | semi-global matching of two grey images |
//! | [`guide`] | the stereo camera pair and its mapping onto macropixels |

pub mod guide;
pub mod scene;
pub mod stereo;

use guided_dtof_light::{files, numerics, photon, settings, units};
