//! Where the window of one laser cycle lies, and in which of its bins a time is.
//!
//! Near an edge between bins, times that are counted from the cycle's start may be rounded otherwise than those of the chip. There the window
//! law is asked.

use super::super::Window as Engine;
use super::{ROUNDING_FS, Sight};
use crate::photon::Photon;
use crate::units::Time;

/// The window of one laser cycle.
pub(super) struct CycleWindow<'w> {
    pub(super) engine: &'w Engine,
    pub(super) sight: &'w Sight,
    pub(super) laser_cycle: u32,
    /// When the laser cycle starts, which all times are counted with.
    pub(super) start: Time,
}

impl CycleWindow<'_> {
    /// From when on pulses are wanted.
    pub(super) fn wanted_from(&self) -> Time {
        self.start + Time::from_fs(self.sight.first_fs - ROUNDING_FS)
    }

    /// When the last bin is over for certain.
    pub(super) fn end(&self) -> Time {
        self.start + Time::from_fs(self.sight.until_fs)
    }

    /// Whether a time is within the window.
    pub(super) fn is_seen(&self, time: Time) -> bool {
        let is_inside = self.sight.rows.are_around((time - self.start).as_fs());
        is_inside.unwrap_or_else(|| self.row_of(time).is_some())
    }

    /// How many photons are within the window.
    pub(super) fn count_seen(&self, photons: &[Photon]) -> usize {
        let [first_fs, .., end_fs] = *self.sight.rows.edges_fs() else {
            return 0;
        };
        let mut seen = 0;
        for photon in photons {
            let time_fs = (photon.time - self.start).as_fs();
            let is_near = (time_fs - first_fs).abs() <= ROUNDING_FS
                || (time_fs - end_fs).abs() <= ROUNDING_FS;
            let is_seen = if is_near {
                self.is_seen(photon.time)
            } else {
                first_fs <= time_fs && time_fs < end_fs
            };
            seen += usize::from(is_seen);
        }
        seen
    }

    /// Bin + 1 of a time, if it is within the window.
    pub(super) fn row_of(&self, time: Time) -> Option<usize> {
        let time = time - self.start;
        if let Some(row) = self.sight.rows.row_of(time.as_fs()) {
            return Some(row).filter(|&row| row > 0);
        }
        let (law, cycle) = (&self.engine.law, i64::from(self.laser_cycle));
        let pulse = self.engine.exposure.stop(cycle) + time;
        let bin = law.bin_of(&self.sight.window, cycle, pulse)?;
        Some(bin + 1)
    }
}
