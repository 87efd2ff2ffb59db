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
//! What the thesis published, computed by this library: its figures, and its demonstrator.
//!
//! | module | what lives there |
//! |---|---|
//! | [`reproduce`] | the thesis's figures, published beside computed |
//! | [`demo`] | the demonstrator of the thesis before its scenes |

pub mod demo;
pub mod reproduce;

use guided_dtof::{
    analysis, chip, engine, files, guide, kernel, netlist, numerics, photon, ranging, report,
    scene, settings, system, theory, units,
};
