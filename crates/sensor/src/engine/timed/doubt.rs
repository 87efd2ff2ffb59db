//! Why a macropixel's delays leave open what it counts.

use serde::{Serialize, Serializer};

use crate::chip::Irregular;
use crate::chip::race::{Conflict, NoAim};

/// Why a macropixel is replayed at gate level.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord, thiserror::Error)]
#[non_exhaustive]
pub enum Doubt {
    /// The serial load does not bring this start value into the P-counter.
    #[error("the load leaves another start value")]
    Load,
    /// What the macropixel does before the exposure may last into it.
    #[error("power-up has no time to settle")]
    PowerUp,
    /// The longest delay of a cell reaches the next clock edge.
    #[error("a cell is slower than half a CLK period")]
    SlowCell,
    /// A front end that joins SPADs.
    #[error("SPADs that share a wire are left to the gates")]
    SharedWire,
    /// Delay lines, where cells differ.
    #[error("delay lines among cells that differ are left to the gates")]
    DelayLines,
    /// Orders of events are known for the shift register.
    #[error("a counter TDC is left to the gates")]
    CounterTdc,
    /// Latencies of a SPAD's two edges.
    #[error("a SPAD's flip-flop rises and falls at different speeds")]
    UnevenLatency,
    /// Pulse width and latency.
    #[error("a SPAD's pulses are shorter than its flip-flop's delay")]
    ShortPulse,
    /// A count runs on when the next one may come.
    #[error("a bin has no time to count")]
    SlowBin,
    /// The tree that tells when a bin is full may see a carry on its way.
    #[error("a bin may seem full for a moment")]
    FullForAMoment,
    /// HIT's reset and STROBE, in the conventional mode.
    #[error("HIT's reset meets the strobe")]
    ResetMeetsStrobe,
    /// Nothing resets it in a laser cycle.
    #[error("a P-counter without memory is left to the gates")]
    Memoryless,
    /// Nobody wrote down what it does between edges.
    #[error("a P-counter of one's own is left to the gates")]
    OwnCounter,
    /// Width of COUNTER_RESET.
    #[error("the reset pulse is too short")]
    ShortReset,
    /// ENABLE and COUNTER_RESET.
    #[error("ENABLE changes as the reset pulse ends")]
    EnableMeetsReset,
    /// LOCAL_STOP and COUNTER_CLK's gate.
    #[error("LOCAL_STOP blocks the P-counter too late")]
    LateBlock,
    /// STROBE and the end of HIT's reset.
    #[error("the strobe meets the end of HIT's reset")]
    StrobeMeetsReset,
    /// HIT falls too late for the next strobe.
    #[error("HIT has no time to fall")]
    SlowHit,
    /// A start value whose LOCAL_STOP is high before it counts.
    #[error("a reset raises LOCAL_STOP")]
    ResetRaisesLocalStop,
    /// The window law finds two signals too close.
    #[error("{0}")]
    Race(Conflict),
    /// The window law has no single window.
    #[error("{0}")]
    Irregular(Irregular),
}

impl From<NoAim> for Doubt {
    fn from(why: NoAim) -> Self {
        match why {
            NoAim::Race(race) => Doubt::Race(race.what),
            NoAim::Irregular(why) => Doubt::Irregular(why),
        }
    }
}

impl Serialize for Doubt {
    /// In words.
    fn serialize<S: Serializer>(&self, serializer: S) -> Result<S::Ok, S::Error> {
        serializer.collect_str(self)
    }
}
