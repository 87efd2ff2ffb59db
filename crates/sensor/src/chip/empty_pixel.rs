//! What a macropixel counts without photons: which laser cycles are latched, which bins have been compared by then, and how
//! often a bin in which no SPAD fires counts (it does where TYPE and THRESHOLD ask for few SPADs).
//!
//! ```text
//!   STOP         │0            │1            │2          guided: laser cycle n is latched in the window after STOP n
//!   latched   −1 │             │0            │1          conventional: n by the STOP edge n + 1 that ends it
//!   pipeline  ···╎ compared from here on ──────────►
//! ```

use std::ops::Range;

use super::config::{Mode, Tdc};
use super::correlation;
use super::window_law::{OpenWindow, WindowLaw};
use crate::units::Time;

/// The first rising CLK edge whose photons are compared: the pipeline starts empty, and what earlier edges took never was in it.
const FIRST_COMPARED: i64 = -1;

impl WindowLaw {
    /// Laser cycles whose histogram is latched.
    pub(crate) fn latched_cycles(&self) -> Range<i64> {
        // A conventional cycle is latched by the STOP edge that ends it; the exposure's first one ends one, too.
        let first = match self.sensor.mode {
            Mode::Guided => 0,
            Mode::Conventional => -1,
        };
        first..i64::from(self.exposure.laser_cycles)
    }

    /// Photon time from which on photons are compared.
    fn compared_from(&self) -> Time {
        self.taken_until(FIRST_COMPARED - 1)
    }

    /// How many bins of `window`, the first ones, are over before anything is compared in laser cycle `cycle`, so that they do
    /// not count.
    pub(crate) fn not_compared(&self, window: &OpenWindow, cycle: i64) -> usize {
        let from = self.compared_from();
        if self.edge(window, cycle, 0) >= from {
            return 0;
        }
        let edges = self.edges(window, cycle);
        edges.edges()[1..].partition_point(|&end| end <= from)
    }

    /// How often each bin of `window` counts in the exposure where no SPAD ever fires.
    pub(crate) fn empty_hits(&self, window: &OpenWindow) -> Vec<i64> {
        let bins = self.sensor.bins;
        let compares = self.sensor.tdc == Tdc::Clocked;
        if !compares || !correlation::model(0, self.sensor.event_type, self.sensor.threshold) {
            return vec![0; bins];
        }
        let cycles = self.latched_cycles();
        let mut hits = vec![cycles.end - cycles.start; bins];
        for cycle in cycles {
            let not_compared = self.not_compared(window, cycle);
            if not_compared == 0 {
                break;
            }
            hits[..not_compared].iter_mut().for_each(|hits| *hits -= 1);
        }
        hits
    }
}
