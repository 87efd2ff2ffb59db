//! Ripple down counter of set/reset flip-flops (thesis 4.4.4, Fig. 51b), which HSLIDAR has (4.9.2).
//!
//! ```text
//!                     MEMORY<i> ─┐
//!   COUNTER_RESET ─► buffer ─┬─ AND ── set<i> ──┐      clock<0> = COUNTER_CLK
//!                 │ COUNTER_RESET_D         ┌───▼───────┐
//!                 │             clock<i> ──►│>          ├──┬─► COUNTER_OUT<i> = clock<i+1>
//!                 │                       ┌─┤D          │  │
//!                 └── clear ──────────────┼►│           │  │
//!                                         │ └───────────┘  │
//!                                         └──── NOT ◄──────┘
//! ```
//!
//! COUNTER_RESET clears every stage and, a buffer later, COUNTER_RESET_D sets those whose memory bit is 1. With the
//! active-low pins of a standard cell the gate is the thesis's OR; with active-high ones it is this AND of the same
//! six transistors.
//!
//! Set must win over clear, and the two must overlap: a stage that is set clocks the next one, which must still be
//! held. The library's cell lets R win over S, so R sets, S clears and the count is taken from Q̄.
//!
//! Timing: from COUNTER_CLK rising to LOCAL_STOP rising, n × clk-to-Q̄ and the tap. A stage whose memory bit is 1 is
//! released later than the others, by the buffer and the gate; no COUNTER_CLK edge may come in between.

use std::sync::Arc;

use crate::chip::blocks::finished;
use crate::chip::blocks::p_counter::pins::Pins;
use crate::chip::blocks::p_counter::variant::PCounterVariant;
use crate::chip::config::SensorConfig;
use crate::netlist::{CellKind, Module, ModuleBuilder};

pub(crate) const VARIANT: PCounterVariant = PCounterVariant {
    nets: &["COUNTER_RESET_D"],
    clears_first: true,
    ..PCounterVariant::down_counter(circuit, "a stage of set/reset flip-flops", 66)
};

/// The counter with `bits` programmable stages; ports as in [`circuit`](crate::chip::p_counter::circuit).
fn circuit(config: &SensorConfig) -> Arc<Module> {
    let bits = config.counter_bits;
    let mut m = ModuleBuilder::new("p_counter");
    let pins = Pins::declare(&mut m, config);
    let memory = pins.memory(&mut m);
    let delayed = m.wire("COUNTER_RESET_D");
    let out = m.wire_bus("COUNTER_OUT", bits);
    m.gate_into(CellKind::Buf, &[pins.reset], delayed);
    let mut clock = pins.clk;
    for bit in 0..bits {
        let set = m.gate(CellKind::And2, &[delayed, memory[bit]]);
        m.cell(
            &format!("counter_{bit}"),
            CellKind::Dffsr,
            &[out[bit], clock, set, pins.reset],
            &[None, Some(out[bit])],
        );
        clock = out[bit];
    }
    pins.ripple_tap(&mut m, config.tap, clock, pins.reset);
    finished(m.finish())
}
