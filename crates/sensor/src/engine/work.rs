//! What an engine did, counted.

use std::iter::Sum;
use std::ops::AddAssign;

use serde::Serialize;

/// What an engine did, and what it had no need to do. Sums over macropixels.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq, Serialize)]
pub struct Work {
    /// Macropixels asked for.
    pub macropixels: u64,
    /// Those not simulated because their SPADs are switched off.
    pub skipped_dark: u64,
    /// Those not simulated because their window never opens.
    pub skipped_closed: u64,
    /// Photons and dark counts of the exposure that were drawn; those that several windows look back on, for each of them.
    pub photons_drawn: u64,
    /// SPAD pulses that the engine looked at.
    pub pulses: u64,
    /// Drawn photons that would have been such pulses, had they not met a blind SPAD.
    pub lost_to_dead_time: u64,
    /// Those pulses in time windows that cancel in their SPAD's flip-flop, two at a time ([`Cancelling`](super::Cancelling)).
    pub cancelled: u64,
    /// CLK periods of the exposure, over all macropixels.
    pub clk_periods: u64,
    /// Those that were simulated, one by one or because a photon fell into them.
    pub clk_periods_visited: u64,
}

impl AddAssign for Work {
    fn add_assign(&mut self, other: Self) {
        self.macropixels += other.macropixels;
        self.skipped_dark += other.skipped_dark;
        self.skipped_closed += other.skipped_closed;
        self.photons_drawn += other.photons_drawn;
        self.pulses += other.pulses;
        self.lost_to_dead_time += other.lost_to_dead_time;
        self.cancelled += other.cancelled;
        self.clk_periods += other.clk_periods;
        self.clk_periods_visited += other.clk_periods_visited;
    }
}

impl Sum for Work {
    fn sum<I: Iterator<Item = Self>>(iter: I) -> Self {
        iter.fold(Work::default(), |mut sum, work| {
            sum += work;
            sum
        })
    }
}
