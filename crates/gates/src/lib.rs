#![cfg_attr(not(test), warn(unreachable_pub, clippy::disallowed_methods))]
#![doc = include_str!("../README.md")]

mod complaint;
pub mod kernel;
pub mod logic;
pub mod netlist;
mod origin;
pub mod units;
pub mod waves;

pub use complaint::{InputError, in_words, instead_of, nearest};
pub use origin::Origin;
