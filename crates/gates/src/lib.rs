#![forbid(unsafe_code)]
#![warn(missing_docs)]
#![cfg_attr(not(test), warn(unreachable_pub, clippy::disallowed_methods))]
#![cfg_attr(docsrs, feature(doc_cfg))]
#![doc = include_str!("../README.md")]

mod complaint;
pub mod kernel;
#[cfg(feature = "liberty")]
pub mod liberty;
pub mod logic;
pub mod netlist;
mod origin;
pub mod sdf;
pub mod units;
pub mod verilog;
pub mod waves;
#[cfg(feature = "yosys")]
pub mod yosys;

pub use complaint::{InputError, in_words, instead_of, nearest};
pub use origin::Origin;
