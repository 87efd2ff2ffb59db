//! The laser cycles of an exposure: how many there are, and when each starts.

use crate::units::{Every, Time};

/// Laser cycles that follow each other without a gap.
#[derive(Debug, Clone, Copy)]
pub(super) struct LaserCycles {
    /// How many there are.
    pub(super) number: u32,
    /// The whole femtoseconds of each.
    pub(super) whole_fs: i64,
    /// When each starts.
    pub(super) starts: Every,
}

impl LaserCycles {
    /// Start of laser cycle `cycle`, exact to the femtosecond.
    #[inline]
    pub(super) fn start(&self, cycle: u32) -> Time {
        self.starts.time(cycle)
    }
}
