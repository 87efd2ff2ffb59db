#![cfg_attr(not(test), warn(unreachable_pub, clippy::disallowed_methods))]
//! Light and the SPADs that see it, what theory says of them, and what all of the project reads and writes with.
//!
//! | module | what lives there |
//! |---|---|
//! | [`units`] | integer femtoseconds, exact clock frequencies, constants of nature |
//! | [`numerics`] | quadrature, special functions, confidence intervals |
//! | [`files`] | user's input with line numbers, output whole or not at all |
//! | [`settings`] | settings files and `--set`, held to tables of their keys |
//! | [`photon`] | photon budget, SPADs, the photon stream |
//! | [`theory`] | detection probability, precision, partial histograms, design, significance |

pub mod files;
pub mod numerics;
pub mod photon;
pub mod settings;
pub mod theory;
pub mod units;
