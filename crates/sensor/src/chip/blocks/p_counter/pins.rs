//! The pins that every P-counter has, and the memory of its start value.

use std::sync::Arc;

use super::step_divider;
use crate::chip::blocks::finished;
use crate::chip::config::{SensorConfig, Tap};
use crate::netlist::{CellKind, Module, ModuleBuilder, Net};

/// The memory that keeps a start value: `bits` flip-flops clocked by MEMORY_LOAD.
///
/// Ports: COUNTER_INIT\<bits\>, MEMORY_LOAD, MEMORY_RESET → MEMORY\<bits\>.
pub(crate) fn memory(bits: usize) -> Arc<Module> {
    let mut m = ModuleBuilder::new("p_counter_memory");
    let init = m.input_bus("COUNTER_INIT", bits);
    let load = m.input("MEMORY_LOAD");
    let reset = m.input("MEMORY_RESET");
    let memory = m.output_bus("MEMORY", bits);
    for bit in 0..bits {
        m.cell(
            &format!("memory_{bit}"),
            CellKind::Dffr,
            &[init[bit], load, reset],
            &[Some(memory[bit]), None],
        );
    }
    finished(m.finish())
}

/// The pins that every variant has.
pub(super) struct Pins {
    pub(super) init: Vec<Net>,
    pub(super) load: Net,
    pub(super) memory_reset: Net,
    /// What clocks the counter: COUNTER_CLK, divided where windows step by several CLK periods.
    pub(super) clk: Net,
    pub(super) reset: Net,
    pub(super) local_stop: Net,
}

impl Pins {
    pub(super) fn declare(m: &mut ModuleBuilder, config: &SensorConfig) -> Self {
        let mut pins = Pins {
            init: m.input_bus("COUNTER_INIT", config.counter_bits),
            load: m.input("MEMORY_LOAD"),
            memory_reset: m.input("MEMORY_RESET"),
            clk: m.input("COUNTER_CLK"),
            reset: m.input("COUNTER_RESET"),
            local_stop: m.output("LOCAL_STOP"),
        };
        pins.clk = step_divider::place(m, pins.clk, pins.reset, config.step_bits());
        pins
    }

    /// Places the memory; returns MEMORY.
    pub(super) fn memory(&self, m: &mut ModuleBuilder) -> Vec<Net> {
        let bits = self.init.len();
        let memory = m.wire_bus("MEMORY", bits);
        m.instance_by_names("memory", &self::memory(bits), &[]);
        memory
    }

    /// Places stage number `bit`: a flip-flop that can only be reset, and the multiplexer by which its bit of the memory inverts it. `state` is
    /// Q, QN and COUNTER_OUT.
    pub(super) fn stage(
        &self,
        m: &mut ModuleBuilder,
        bit: usize,
        [data, clock]: [Net; 2],
        memory: Net,
        [q, qn, out]: [Net; 3],
    ) {
        let inputs = [data, clock, self.reset];
        m.cell(&format!("counter_{bit}"), CellKind::Dffr, &inputs, &[q, qn]);
        let inputs = [q, qn, memory];
        m.cell(&format!("mux_{bit}"), CellKind::Mux2, &inputs, &[out]);
    }

    /// LOCAL_STOP of a ripple counter whose last output is `last`: a toggle flip-flop more, or that output.
    pub(super) fn ripple_tap(&self, m: &mut ModuleBuilder, tap: Tap, last: Net, reset: Net) {
        match tap {
            Tap::Borrow => {
                let borrow_n = m.wire("BORROW_N");
                m.cell(
                    "borrow",
                    CellKind::Dffr,
                    &[borrow_n, last, reset],
                    &[self.local_stop, borrow_n],
                );
            }
            Tap::Msb => m.gate_into(CellKind::Buf, &[last], self.local_stop),
        }
    }
}
