//! P-counter timing block: derives a macropixel's local signals from the global ones (thesis 4.5).
//!
//! ```text
//!   STOP ──┬──────────────────────────────┐
//!          └─► delay chain ─ STOP_D ─ NOT ─┴ AND ─ pulse ─┐
//!   RESETB ─ NOT ─┬─ MEMORY_RESET                        OR ─► COUNTER_RESET
//!   ENABLE ─ NOT ─┴ OR ──────────────── clear ───────────┘
//!
//!   CLK ──────────────────────────────┐
//!   NOT ENABLE ─┐                     NOR ─► COUNTER_CLK
//!   LOCAL_STOP ─┴ OR ─ block ─────────┘
//! ```
//!
//! * COUNTER_RESET pulses on each rising STOP edge, for as long as the delay chain is. It is also
//!   held while the chip is in reset or the counter disabled, so that the counter is never unknown
//!   and loading a new start value (whose changing bits flip their multiplexers, an edge for the next
//!   stage) can clock nothing.
//! * COUNTER_CLK is NOT CLK, so that LOCAL_STOP rises after CLK's falling edge. ENABLE gates it, and
//!   LOCAL_STOP blocks it until the next reset: a counter that has rolled over waits. One that is to wrap
//!   ([`AfterBorrow`]) goes without that: BLOCK is NOT ENABLE.
//!
//! Timing: at a STOP edge the falling LOCAL_STOP unblocks COUNTER_CLK, which rises if CLK is low. That
//! edge must still meet an active reset, hence the length of the chain (`timing/reset_chain`).

use std::ops::Range;
use std::sync::Arc;

use super::finished;
use crate::chip::config::AfterBorrow;
use crate::chip::timing::chip_timing::ChipTiming;
use crate::netlist::{CellKind, Module, ModuleBuilder, Net};
use crate::units::Time;

/// Fewest buffers in the delay chain that sets the width of COUNTER_RESET. A library may need more
/// ([`reset_stages`](crate::chip::config::SensorConfig::reset_stages)).
pub const SHORTEST_CHAIN: usize = 6;

/// The timing block.
///
/// Ports: CLK, STOP, RESETB, ENABLE, LOCAL_STOP → COUNTER_CLK, COUNTER_RESET, MEMORY_RESET, STOP_D. The delay chain has
/// `stages` buffers, one at least.
pub fn circuit(after_borrow: AfterBorrow, stages: usize) -> Arc<Module> {
    let mut m = ModuleBuilder::new("p_counter_timing");
    let clk = m.input("CLK");
    let stop = m.input("STOP");
    let resetb = m.input("RESETB");
    let enable = m.input("ENABLE");
    let local_stop = m.input("LOCAL_STOP");
    let counter_clk = m.output("COUNTER_CLK");
    let counter_reset = m.output("COUNTER_RESET");
    let memory_reset = m.output("MEMORY_RESET");
    let stop_d = m.output("STOP_D");
    let pulse = m.wire("PULSE");
    let block = m.wire("BLOCK");

    m.gate_into(CellKind::Inv, &[resetb], memory_reset);
    let disabled = match after_borrow {
        AfterBorrow::Hold => m.gate(CellKind::Inv, &[enable]),
        AfterBorrow::Wrap => {
            m.gate_into(CellKind::Inv, &[enable], block);
            block
        }
    };

    let mut delayed: Net = stop;
    for _ in 1..stages {
        delayed = m.gate(CellKind::Buf, &[delayed]);
    }
    m.gate_into(CellKind::Buf, &[delayed], stop_d);
    let over = m.gate(CellKind::Inv, &[stop_d]);
    m.gate_into(CellKind::And2, &[stop, over], pulse);
    let clear = m.gate(CellKind::Or2, &[disabled, memory_reset]);
    m.gate_into(CellKind::Or2, &[pulse, clear], counter_reset);

    if after_borrow == AfterBorrow::Hold {
        m.gate_into(CellKind::Or2, &[disabled, local_stop], block);
    }
    m.gate_into(CellKind::Nor2, &[clk, block], counter_clk);
    finished(m.finish())
}

/// Reference model: the block's inputs, and what it makes of them when everything has settled.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub struct PCounterTimingModel {
    /// Whether LOCAL_STOP blocks COUNTER_CLK.
    pub after_borrow: AfterBorrow,
    /// CLK.
    pub clk: bool,
    /// RESETB.
    pub resetb: bool,
    /// ENABLE.
    pub enable: bool,
    /// LOCAL_STOP.
    pub local_stop: bool,
}

impl PCounterTimingModel {
    /// COUNTER_CLK: NOT CLK, while enabled and, if the counter is to hold, before LOCAL_STOP.
    pub fn counter_clk(&self) -> bool {
        let is_held = self.local_stop && self.after_borrow == AfterBorrow::Hold;
        !self.clk && self.enable && !is_held
    }

    /// MEMORY_RESET.
    pub fn memory_reset(&self) -> bool {
        !self.resetb
    }

    /// COUNTER_RESET apart from its pulses: held in reset and while disabled.
    pub fn counter_reset(&self) -> bool {
        !self.resetb || !self.enable
    }

    /// The pulse of COUNTER_RESET that a rising edge of STOP at `stop` makes.
    pub fn reset_pulse(timing: &ChipTiming, stop: Time) -> Range<Time> {
        stop + timing.stop_to_reset..stop + timing.stop_to_reset_release
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn local_stop_and_enable_block_the_clock_and_only_enable_resets() {
        let running = PCounterTimingModel {
            resetb: true,
            enable: true,
            ..PCounterTimingModel::default()
        };
        assert!(running.counter_clk() && !running.counter_reset());
        let stopped = PCounterTimingModel {
            local_stop: true,
            ..running
        };
        assert!(!stopped.counter_clk() && !stopped.counter_reset());
        let wrapping = PCounterTimingModel {
            after_borrow: AfterBorrow::Wrap,
            ..stopped
        };
        assert!(wrapping.counter_clk());
        let disabled = PCounterTimingModel {
            enable: false,
            ..running
        };
        assert!(!disabled.counter_clk() && disabled.counter_reset());
    }
}
