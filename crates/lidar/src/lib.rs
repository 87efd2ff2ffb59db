#![forbid(unsafe_code)]
#![cfg_attr(
    not(test),
    warn(
        unreachable_pub,
        clippy::disallowed_methods,
        clippy::print_stdout,
        clippy::print_stderr
    )
)]
#![doc = include_str!("tutorial.md")]
//! # Modules
//!
//! They follow the data from the circuit and the scene to the depth map:
//!
//! | module | what lives there |
//! |---|---|
//! | [`units`] | integer femtoseconds, exact clock frequencies, constants |
//! | [`numerics`] | quadrature, special functions, confidence intervals |
//! | [`files`] | user's input with line numbers, output whole or not at all |
//! | [`settings`] | settings files and `--set`, held to tables of their keys |
//! | [`logic`] | four-valued logic |
//! | [`netlist`] | cells, hierarchical builder, delays, Verilog |
//! | [`kernel`] | the discrete event kernel |
//! | [`waves`] | VCD and FST, views for GTKWave and Surfer |
//! | [`chip`] | the circuits beside their reference models, the window law |
//! | [`photon`] | photon budget, SPADs, the photon stream |
//! | [`stimulus`] | stimulus, recordings, hardware events, Verilog testbench |
//! | [`engine`] | the ways to run an exposure |
//! | [`analysis`] | the periods, corners and spread that static timing allows |
//! | [`stereo`] | semi-global matching of two grey images |
//! | [`scene`] | surfaces, optics, sunlight, ground truth |
//! | [`guide`] | the stereo camera pair and its mapping onto macropixels |
//! | [`theory`] | detection probability, precision, partial histograms, design, significance |
//! | [`ranging`] | depth from histograms |
//! | `strategies` | random chips and photons for property tests, with the feature `proptest` |
//! | [`report`] | pictures, arrays, tables |
//! | [`photons`] | SPAD pulses of a scene for any chip, as files |
//! | [`system`] | one guided frame, end to end, and drives of many |
//! | [`request`] | what a user asks for, read and checked |
//! | [`page`] | one HTML file to look at a frame or a drive |
//! | [`testbenches`] | the chip's blocks driven and checked at gate level, with waveforms |
//! | [`propose`] | which chip to build: designs by theory, the front of them, on engines |
//! | [`sweep`] | studies: a row of results for each of many frames |

pub mod page;
pub mod photons;
pub mod propose;
pub mod report;
pub mod request;
pub mod sweep;
pub mod system;
pub mod testbenches;

pub use guided_dtof_light::{files, numerics, photon, settings, theory, units};
pub use guided_dtof_scene::{guide, scene, stereo};
#[cfg(feature = "proptest")]
pub use guided_dtof_sensor::strategies;
pub use guided_dtof_sensor::{
    ORIGIN, analysis, chip, engine, kernel, liberty, logic, netlist, ranging, sdf, stimulus,
    verilog, waves,
};
