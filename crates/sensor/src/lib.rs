#![cfg_attr(not(test), warn(unreachable_pub, clippy::disallowed_methods))]
//! The chip, the ways to run it, and depth from what it counts.
//!
//! | module | what lives there |
//! |---|---|
//! | [`chip`] | the circuits beside their reference models, the window law |
//! | [`stimulus`] | stimulus, recordings, hardware events, Verilog testbench |
//! | [`engine`] | the ways to run an exposure |
//! | [`analysis`] | the periods, corners and spread that static timing allows |
//! | [`waves`] | waveforms as files, with views beside them |
//! | [`ranging`] | depth from histograms |
//! | `strategies` | random chips and photons for property tests, with the feature `proptest` |

pub mod analysis;
pub mod chip;
pub mod engine;
pub mod ranging;
pub mod stimulus;
#[cfg(feature = "proptest")]
pub mod strategies;
pub mod waves;

pub use femtogate::{Origin, kernel, liberty, logic, netlist, sdf, verilog};

/// The program that files of this project name as their writer.
pub const ORIGIN: Origin = Origin {
    vendor: "guided-dtof",
    program: "gdtof",
    version: env!("CARGO_PKG_VERSION"),
};

pub use guided_dtof_light::{files, numerics, photon, settings, theory, units};
