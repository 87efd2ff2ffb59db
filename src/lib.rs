//! A hardware model of a guided direct time-of-flight lidar chip, down to gates and flip-flops.

pub mod chip;
pub mod cli;
pub mod engine;
pub mod files;
pub mod guide;
pub mod kernel;
pub mod logic;
pub mod netlist;
pub mod photon;
pub mod ranging;
pub mod report;
pub mod scene;
pub mod system;
pub mod units;
pub mod waves;
