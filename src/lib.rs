//! A hardware model of a guided direct time-of-flight lidar chip, down to gates and flip-flops.

pub mod chip;
pub mod files;
pub mod kernel;
pub mod logic;
pub mod netlist;
pub mod units;
