#![cfg_attr(not(test), warn(unreachable_pub, clippy::disallowed_methods))]
//! Light: the world that it comes from, the SPADs that see it, and the guides that say where to look.
//!
//! | module | what lives there |
//! |---|---|
//! | [`units`] | integer femtoseconds, exact clock frequencies, constants of nature |
//! | [`numerics`] | quadrature, special functions, confidence intervals |
//! | [`files`] | user's input with line numbers, output whole or not at all |
//! | [`settings`] | settings files and `--set`, held to tables of their keys |
//! | [`photon`] | photon budget, SPADs, the photon stream |
//! | [`theory`] | detection probability, precision, partial histograms, design, significance |
//! | [`stereo`] | semi-global matching of two grey images |
//! | [`scene`] | surfaces, optics, sunlight, ground truth |
//! | [`guide`] | the stereo camera pair and its mapping onto macropixels |

pub mod files;
pub mod guide;
pub mod numerics;
pub mod photon;
pub mod scene;
pub mod settings;
pub mod stereo;
pub mod theory;
pub mod units;
