//! A hardware model of a guided direct time-of-flight lidar chip, down to gates and flip-flops.

pub mod files;
pub mod guide;
pub mod photon;
pub mod ranging;
pub mod report;
pub mod scene;
pub mod units;
