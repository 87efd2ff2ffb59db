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
//!   LOCAL_STOP blocks it until the next reset: a counter that has rolled over waits.
//!
//! Timing: at a STOP edge the falling LOCAL_STOP unblocks COUNTER_CLK, which rises if CLK is low. That
//! edge must still meet an active reset, hence the length of the chain.

use std::sync::Arc;

use super::finished;
use crate::netlist::{CellKind, Module, ModuleBuilder, Net};

/// Buffers in the delay chain that sets the width of COUNTER_RESET.
pub const DELAY_CHAIN: usize = 6;

/// The timing block.
///
/// Ports: CLK, STOP, RESETB, ENABLE, LOCAL_STOP → COUNTER_CLK, COUNTER_RESET, MEMORY_RESET, STOP_D.
pub fn circuit() -> Arc<Module> {
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
    let disabled = m.gate(CellKind::Inv, &[enable]);

    let mut delayed: Net = stop;
    for _ in 1..DELAY_CHAIN {
        delayed = m.gate(CellKind::Buf, &[delayed]);
    }
    m.gate_into(CellKind::Buf, &[delayed], stop_d);
    let over = m.gate(CellKind::Inv, &[stop_d]);
    m.gate_into(CellKind::And2, &[stop, over], pulse);
    let clear = m.gate(CellKind::Or2, &[disabled, memory_reset]);
    m.gate_into(CellKind::Or2, &[pulse, clear], counter_reset);

    m.gate_into(CellKind::Or2, &[disabled, local_stop], block);
    m.gate_into(CellKind::Nor2, &[clk, block], counter_clk);
    finished(m.finish())
}
