//! Up counter and comparator (thesis 4.4.1, Fig. 49a).
//!
//! ```text
//!   COUNTER_CLK ─┬─► ripple up counter ─ COUNTER_OUT ─┐
//!                │     ▲ COUNTER_RESET: to zero        XNOR, AND ─ EQUAL ─┤D ├─► LOCAL_STOP
//!                │                        MEMORY ─────┘               ┌──►│> │
//!                └────────────────────────────────────────────────────┘   R: COUNTER_RESET
//! ```
//!
//! The thesis shows the principle only. Here the counter ripples, the cheapest choice, and while it does it passes
//! through counts that are not there: EQUAL has false pulses. So a flip-flop takes EQUAL with the next COUNTER_CLK
//! edge, which makes LOCAL_STOP come with edge start + 1, as in the other variants, and without a ripple's delay. A
//! count that runs on matches again every 2ⁿ edges, for one CLK period.
//!
//! Timing: LOCAL_STOP rises clk-to-Q after COUNTER_CLK. Ripple, comparator and setup must fit into a CLK period.

use std::sync::Arc;

use crate::chip::blocks::finished;
use crate::chip::blocks::p_counter::pins::Pins;
use crate::chip::blocks::p_counter::variant::{Counter, PCounterVariant};
use crate::chip::config::SensorConfig;
use crate::netlist::{CellKind, Module, ModuleBuilder};

pub(crate) const VARIANT: PCounterVariant = PCounterVariant {
    model: |config, start| Box::new(Model::new(config.counter_bits, start)),
    nets: &["EQUAL"],
    no_msb: Some("counts up"),
    ..PCounterVariant::down_counter(circuit, "a stage with a comparator", 62)
};

/// The counter and comparator of `bits` bits, at least 2; ports as in [`circuit`](crate::chip::p_counter::circuit).
fn circuit(config: &SensorConfig) -> Arc<Module> {
    let bits = config.counter_bits;
    let mut m = ModuleBuilder::new("p_counter");
    let pins = Pins::declare(&mut m, config);
    let memory = pins.memory(&mut m);
    let out = m.wire_bus("COUNTER_OUT", bits);
    let out_n = m.wire_bus("COUNTER_OUT_N", bits);
    let equal = m.wire("EQUAL");
    let mut clock = pins.clk;
    let mut same = Vec::new();
    for bit in 0..bits {
        m.cell(
            &format!("counter_{bit}"),
            CellKind::Dffr,
            &[out_n[bit], clock, pins.reset],
            &[out[bit], out_n[bit]],
        );
        same.push(m.gate(CellKind::Xnor2, &[out[bit], memory[bit]]));
        clock = out_n[bit];
    }
    let (low, high) = same.split_at(bits / 2);
    let halves = [m.tree(CellKind::And2, low), m.tree(CellKind::And2, high)];
    m.gate_into(CellKind::And2, &halves, equal);
    m.cell(
        "stop",
        CellKind::Dffr,
        &[equal, pins.clk, pins.reset],
        &[Some(pins.local_stop), None],
    );
    finished(m.finish())
}

/// Reference model.
#[derive(Debug)]
struct Model {
    start: u32,
    value: u32,
    mask: u32,
    local_stop: bool,
}

impl Model {
    /// A counter of `bits` bits that has just been reset, to be compared with `start`.
    fn new(bits: usize, start: u32) -> Self {
        Model {
            start,
            value: 0,
            mask: (1 << bits) - 1,
            local_stop: false,
        }
    }
}

impl Counter for Model {
    fn reset(&mut self) {
        self.value = 0;
        self.local_stop = false;
    }

    fn clock(&mut self) {
        self.local_stop = self.value == self.start;
        self.value = (self.value + 1) & self.mask;
    }

    fn count(&self) -> u32 {
        self.value
    }

    fn local_stop(&self) -> bool {
        self.local_stop
    }
}
