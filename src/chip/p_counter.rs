//! P-counter: the programmable ripple down-counter that opens a macropixel's time window.
//!
//! ```text
//!                   ┌─────────────── stage i ───────────────┐
//!   COUNTER_INIT<i>─┤ D  memory  Q ├── MEMORY<i> ──┐        │
//!   MEMORY_LOAD ────┤>             │               │S       │
//!                   │   ┌──────────────┐  Q  ┌─────▼────┐   │
//!   clock<i> ───────┼──►│>  counter    ├─────┤0   mux   ├───┼─► COUNTER_OUT<i> = clock<i+1>
//!                   │ ┌─┤D          QN ├──┬──┤1         │   │
//!                   │ │ └──────R───────┘  │  └──────────┘   │
//!                   │ └────────┼──────────┘                 │
//!   COUNTER_RESET ──┼──────────┘                            │
//!                   └───────────────────────────────────────┘
//!   clock<0> = COUNTER_CLK;   borrow: a last toggle flip-flop on COUNTER_OUT<n-1> gives LOCAL_STOP
//! ```
//!
//! The counter flip-flop can only be reset. Passing Q or Q̄ by the memory bit makes a reset leave
//! COUNTER_OUT = MEMORY (thesis 4.4.4, Fig. 51c, 53). A rising stage output is the borrow that
//! clocks the next stage.
//!
//! The thesis ties LOCAL_STOP to the counter's MSB *and* claims 2ⁿ window steps. With n stages both
//! cannot hold, since a start value of 2ⁿ⁻¹ or more has its MSB high from the reset on. LOCAL_STOP is
//! here the borrow out of the last stage, a toggle flip-flop more, which rises when the counter rolls
//! over past zero for every one of the 2ⁿ start values.
//!
//! Timing: from COUNTER_CLK rising to LOCAL_STOP rising, n × (clk-to-Q + mux) + clk-to-Q, the same for
//! every start value because rolling over toggles every stage. COUNTER_RESET must stay high until
//! outputs returning to their memory value (rising edges, too) have died out in the next stages.

use std::sync::Arc;

use super::finished;
use crate::netlist::{CellKind, Module, ModuleBuilder};

/// The memory that keeps a start value: `bits` flip-flops clocked by MEMORY_LOAD.
///
/// Ports: COUNTER_INIT\<bits\>, MEMORY_LOAD, MEMORY_RESET → MEMORY\<bits\>.
pub fn memory(bits: usize) -> Arc<Module> {
    let mut m = ModuleBuilder::new("p_counter_memory");
    let init = m.input_bus("COUNTER_INIT", bits);
    let load = m.input("MEMORY_LOAD");
    let reset = m.input("MEMORY_RESET");
    let memory = m.output_bus("MEMORY", bits);
    let unused = crate::netlist::Net::NONE;
    for bit in 0..bits {
        m.cell(
            &format!("memory_{bit}"),
            CellKind::Dffr,
            &[init[bit], load, reset],
            &[memory[bit], unused],
        );
    }
    finished(m.finish())
}

/// The P-counter with `bits` programmable stages.
///
/// Ports: COUNTER_INIT\<bits\>, MEMORY_LOAD, MEMORY_RESET, COUNTER_CLK, COUNTER_RESET → LOCAL_STOP.
pub fn circuit(bits: usize) -> Arc<Module> {
    let memory_module = memory(bits);
    let mut m = ModuleBuilder::new("p_counter");
    let init = m.input_bus("COUNTER_INIT", bits);
    let load = m.input("MEMORY_LOAD");
    let memory_reset = m.input("MEMORY_RESET");
    let counter_clk = m.input("COUNTER_CLK");
    let counter_reset = m.input("COUNTER_RESET");
    let local_stop = m.output("LOCAL_STOP");
    let memory = m.wire_bus("MEMORY", bits);
    let q = m.wire_bus("Q", bits);
    let qn = m.wire_bus("QN", bits);
    let out = m.wire_bus("COUNTER_OUT", bits);
    m.instance(
        "memory",
        &memory_module,
        &[
            ("COUNTER_INIT", &init),
            ("MEMORY_LOAD", &[load]),
            ("MEMORY_RESET", &[memory_reset]),
            ("MEMORY", &memory),
        ],
    );
    let mut clock = counter_clk;
    for bit in 0..bits {
        m.cell(
            &format!("counter_{bit}"),
            CellKind::Dffr,
            &[qn[bit], clock, counter_reset],
            &[q[bit], qn[bit]],
        );
        m.cell(
            &format!("mux_{bit}"),
            CellKind::Mux2,
            &[q[bit], qn[bit], memory[bit]],
            &[out[bit]],
        );
        clock = out[bit];
    }
    let borrow_n = m.wire("BORROW_N");
    m.cell(
        "borrow",
        CellKind::Dffr,
        &[borrow_n, clock, counter_reset],
        &[local_stop, borrow_n],
    );
    finished(m.finish())
}

/// Reference model: what the P-counter does, in numbers.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Model {
    start: u32,
    value: u32,
    local_stop: bool,
}

impl Model {
    /// A reset counter holding `start`.
    pub fn new(start: u32) -> Self {
        Model {
            start,
            value: start,
            local_stop: false,
        }
    }

    /// COUNTER_RESET: back to the start value, LOCAL_STOP low.
    pub fn reset(&mut self) {
        *self = Model::new(self.start);
    }

    /// A rising edge of COUNTER_CLK. Returns whether LOCAL_STOP rose. LOCAL_STOP blocks
    /// COUNTER_CLK, so that a counter that has rolled over waits for the next reset.
    pub fn clock(&mut self) -> bool {
        if self.local_stop {
            return false;
        }
        self.local_stop = self.value == 0;
        self.value = self.value.wrapping_sub(1);
        self.local_stop
    }

    /// COUNTER_OUT of `bits` stages; all ones once the counter has rolled over.
    pub fn counter_out(&self, bits: usize) -> u64 {
        self.value as u64 & ((1 << bits) - 1)
    }

    /// LOCAL_STOP.
    pub fn local_stop(&self) -> bool {
        self.local_stop
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_stage_is_two_flip_flops_and_a_four_transistor_mux() {
        let flip_flop = CellKind::Dffr.transistors() as u64;
        let stage = circuit(9).transistors() - circuit(8).transistors();
        assert_eq!(stage, 2 * flip_flop + 4);
    }

    #[test]
    fn local_stop_comes_one_edge_after_zero() {
        let mut model = Model::new(5);
        let rises: Vec<bool> = (0..10).map(|_| model.clock()).collect();
        assert_eq!(rises.iter().position(|&r| r), Some(5));
        assert_eq!(rises.iter().filter(|&&r| r).count(), 1);
        model.reset();
        assert!(!model.local_stop());
    }
}
