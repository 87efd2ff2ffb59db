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
//! The command `gdtof`: what it reads, asks the library for, and prints.

pub mod cli;

use guided_dtof::{
    ORIGIN, analysis, chip, engine, files, guide, kernel, liberty, netlist, numerics, page, photon,
    photons, propose, ranging, report, request, scene, sdf, settings, stereo, stimulus, sweep,
    system, testbenches, units, waves,
};
use guided_dtof_thesis::{demo, reproduce};
