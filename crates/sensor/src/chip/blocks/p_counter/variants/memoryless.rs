//! Ripple down counter without memory (thesis 4.4.3): loaded once, never reset, it comes round by itself.
//!
//! ```text
//!   MEMORY_LOAD ─┬─► delay chain ─ NOT ─┐
//!                └───────────────────── AND ─ LOAD_PULSE ─┬─ buffer ─ AND ── set<i>     (wins over clear)
//!                                                         │  COUNTER_INIT<i> ┘
//!                                  MEMORY_RESET ───────── OR ── CLEAR
//!
//!   stages as in set_reset, set by set<i>, cleared by CLEAR;   COUNTER_RESET is not used
//! ```
//!
//! The thesis: constrain STOP to 2ⁿ CLK periods and let every P-counter wrap around at that rate. We read it so: the
//! start value is written into the counter's own flip-flops once, nothing resets them at STOP, and since 2ⁿ counts
//! make no difference to n bits, each laser cycle begins with the start value again. LOCAL_STOP is therefore the
//! most significant bit, which rises once in 2ⁿ counts for *every* start value, so that here the tap `msb` has no
//! false rise to hide. The tap `borrow` makes one bit more, and asks for STOP periods of 2ⁿ⁺¹.
//!
//! A flip-flop that can only be reset cannot be loaded without a memory bit to choose its output, so this takes the
//! set/reset cell. Loading is level-sensitive while COUNTER_INIT shifts on with the next LOAD_CLK edge, before
//! MEMORY_LOAD is over; hence the short pulse.
//!
//! Timing: the ripple of [`set_reset`](super::set_reset). The first count is the first COUNTER_CLK edge once ENABLE
//! is there, *not* the first after a reset: with STOP on CLK's falling edge that edge counts, so that windows come a
//! CLK period earlier than in the other variants. By the same token the STOP edge that ends the exposure is counted
//! before ENABLE goes: start values are one less afterwards and must be loaded again.

use std::sync::Arc;

use crate::chip::blocks::finished;
use crate::chip::blocks::p_counter::pins::Pins;
use crate::chip::blocks::p_counter::variant::PCounterVariant;
use crate::chip::config::SensorConfig;
use crate::chip::p_counter_timing::SHORTEST_CHAIN;
use crate::netlist::{CellKind, Module, ModuleBuilder};

pub(crate) const VARIANT: PCounterVariant = PCounterVariant {
    nets: &["LOAD_PULSE"],
    has_memory: false,
    ..PCounterVariant::down_counter(circuit, "a stage without memory", 42)
};

/// The counter with `bits` stages; ports as in [`circuit`](crate::chip::p_counter::circuit).
fn circuit(config: &SensorConfig) -> Arc<Module> {
    let bits = config.counter_bits;
    let mut m = ModuleBuilder::new("p_counter");
    let pins = Pins::declare(&mut m, config);
    let pulse = m.wire("LOAD_PULSE");
    let clear = m.wire("CLEAR");
    let out = m.wire_bus("COUNTER_OUT", bits);
    let mut delayed = pins.load;
    for _ in 0..SHORTEST_CHAIN {
        delayed = m.gate(CellKind::Buf, &[delayed]);
    }
    let over = m.gate(CellKind::Inv, &[delayed]);
    m.gate_into(CellKind::And2, &[pins.load, over], pulse);
    m.gate_into(CellKind::Or2, &[pulse, pins.memory_reset], clear);
    // Later than CLEAR, so that it is the last to go.
    let preset = m.gate(CellKind::Buf, &[pulse]);
    let mut clock = pins.clk;
    for (bit, (&out, &init)) in out.iter().zip(&pins.init).enumerate() {
        let set = m.gate(CellKind::And2, &[preset, init]);
        m.cell(
            &format!("counter_{bit}"),
            CellKind::Dffsr,
            &[out, clock, set, clear],
            &[None, Some(out)],
        );
        clock = out;
    }
    pins.ripple_tap(&mut m, config.tap, clock, clear);
    finished(m.finish())
}
