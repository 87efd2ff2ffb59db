//! The delays that decide what a macropixel counts, as numbers: what the blocks' reference models and the window law take.

use crate::chip::front_end::PulseLimits;
use crate::units::Time;

/// Delays of the paths that decide where a window lies.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct ChipTiming {
    /// SPAD_RAW rising to what is sampled, the toggle flip-flop's output or PHOTONS: the front-end latency. Earliest, where SPADs
    /// share a wire whose gates rise and fall at different speeds.
    pub spad_to_sampled: Time,
    /// Delay of each of the stages of the photon line, where there is one.
    pub photon_line_stage: Time,
    /// What the front end asks of SPAD_RAW.
    pub pulses: PulseLimits,
    /// CLK falling to COUNTER_CLK rising.
    pub clk_to_counter_clk: Time,
    /// The P-counter's own delays and limits.
    pub counter: CounterTiming,
    /// LOCAL_STOP rising to the clock of the HIT flip-flops.
    pub local_stop_to_strobe: Time,
    /// LOCAL_STOP rising to what freezes the window: that clock, or the one that samples the delay lines.
    pub local_stop_to_sample: Time,
    /// STOP rising to the clock of the HIT flip-flops, conventional mode.
    pub stop_to_strobe: Time,
    /// STOP rising to what freezes the window, conventional mode.
    pub stop_to_sample: Time,
    /// Clock of the HIT flip-flops to HIT.
    pub strobe_to_hit: Time,
    /// How long HIT must be high for its bin to count.
    pub hit_high: Time,
    /// CLK rising to the latest change of the METDC's shift register; nothing where there is none.
    pub clk_to_shift: Time,
    /// STOP rising to COUNTER_RESET rising.
    pub stop_to_reset: Time,
    /// STOP rising to COUNTER_RESET falling.
    pub stop_to_reset_release: Time,
    /// STOP rising to the reset of the HIT flip-flops, guided mode.
    pub stop_to_hit_reset: Time,
    /// STOP rising to the release of the HIT flip-flops, guided mode.
    pub stop_to_hit_release: Time,
    /// STOP rising to where a strobe counts, conventional mode: the reset of the HIT flip-flops is released and has recovered.
    pub stop_to_hit_ready: Time,
    /// STOP rising to HIT's fall in the guided mode, which is START's in a counter TDC.
    pub stop_to_start_falls: Time,
    /// STOP rising to the inverse of ENABLE, which blocks COUNTER_CLK, falling.
    pub stop_to_enabled: Time,
    /// CLK rising to SPAD_EVENT settled, longest path; nothing where events are not clocked.
    pub clk_to_event: Time,
    /// The shortest CLK period that all flip-flops behind CLK allow, those that catch the strobe left out.
    pub clk_period: Time,
    /// By how much data come too soon for the hold time of a flip-flop behind CLK, at any CLK period; none if they do not.
    pub broken_hold: Option<Time>,
    /// How long before its clock a flip-flop's data must be stable.
    pub setup: Time,
    /// How long after its clock a flip-flop's data must be stable. Of HIT this is counted to the latest change of the shift register, and
    /// so is longer where its stages change at different times.
    pub hold: Time,
    /// How long before a strobe that counts the reset of HIT must be released.
    pub recovery: Time,
    /// How long after a strobe that must not count the reset of HIT must still hold.
    pub removal: Time,
}

/// Delays and limits of a P-counter.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct CounterTiming {
    /// COUNTER_CLK rising → LOCAL_STOP rising, the latest of all start values.
    /// [`LocalStopDelays`](super::local_stop::LocalStopDelays) has each.
    pub clk_to_local_stop: Time,
    /// COUNTER_RESET rising → LOCAL_STOP rising, where a start value can make it.
    pub reset_to_local_stop: Option<Time>,
    /// COUNTER_RESET falling → the last flip-flop is released.
    pub release: Time,
    /// COUNTER_RESET rising → the first count may come: everything it samples has settled, setup included.
    pub settle: Time,
    /// One count → the next may come: longest path and setup.
    pub period: Time,
    /// Longest recovery time among the flip-flops that COUNTER_CLK clocks.
    pub recovery: Time,
    /// Longest removal time among them.
    pub removal: Time,
    /// Their longest minimum high pulse of COUNTER_CLK.
    pub clock_high: Time,
    /// How LOCAL_STOP blocks COUNTER_CLK, where it does.
    pub block: Option<BlockTiming>,
    /// LOAD_CLK falls → the pulse that loads start values is over, latest, less LOAD_CLK rises → COUNTER_INIT changes, earliest. It must
    /// be less than half a LOAD_CLK period. None where a memory takes the start values.
    pub load_pulse: Option<Time>,
    /// Width of COUNTER_RESET, at its shortest.
    pub reset_width: Time,
    /// What COUNTER_RESET must outlast.
    pub reset_need: Time,
}

/// Delays of the gate with which LOCAL_STOP blocks COUNTER_CLK.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct BlockTiming {
    /// LOCAL_STOP rises → BLOCK rises.
    pub from_local_stop: Time,
    /// BLOCK rises → COUNTER_CLK falls, at the earliest.
    pub to_counter_clk: Time,
}

impl ChipTiming {
    /// CLK falling to LOCAL_STOP rising, the latest of all start values: what the thesis calls the ripple delay (4.6, Fig. 56).
    pub fn ripple(&self) -> Time {
        self.clk_to_counter_clk + self.counter.clk_to_local_stop
    }
}
