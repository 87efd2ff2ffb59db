//! Down counter in Gray code: with each count one bit changes, and no other moves.
//!
//! ```text
//!     MEMORY<i> ─┐
//!                XOR ─ GRAY_START<i> ──────────────┐
//!   MEMORY<i+1> ─┘                                 │S
//!     toggle<i> ─┐ NEXT<i>  ┌─────────┐  Q   ┌─────▼─┐
//!                XOR ───────┤D        ├──┬───┤0  mux ├─► COUNTER_OUT<i>
//!          Q<i> ─┘          │         │QN│ ┌─┤1      │
//!   COUNTER_CLK ───────────►│>        ├────┘ └───────┘
//!                           └─R───────┘  └─► to XOR
//!                     COUNTER_RESET
//!
//!   GRAY_PARITY, the least significant bit of the binary count: a stage with MEMORY<0> that toggles with every count
//!   toggle<0> = GRAY_PARITY      toggle<i> = NOT GRAY_PARITY and COUNTER_OUT<i-1> and no bit below that
//!   top bit:  toggle = NOT GRAY_PARITY and no bit below its neighbour; with the tap borrow it is LOCAL_STOP
//! ```
//!
//! Counting down, a Gray code toggles its lowest bit where its parity is odd, and otherwise the bit above its lowest 1: at
//! zero, which has none, the top bit. So the top bit is that of the binary count, and rises past zero. Start values are binary,
//! as for the other variants: an XOR of two memory bits makes the Gray bit that the multiplexer is set by. Where start values
//! came in Gray code already, a stage had eight transistors less.
//!
//! Whoever reads the count with another clock is wrong by one at most. LOCAL_STOP is a flip-flop, and needs no comparison.
//!
//! Timing: LOCAL_STOP rises clk-to-Q after COUNTER_CLK (and multiplexer and buffer with the tap `msb`). As in the
//! [synchronous counter](super::synchronous) a chain of AND gates must settle within a CLK period, here from GRAY_PARITY on.

use std::sync::Arc;

use crate::chip::blocks::finished;
use crate::chip::blocks::p_counter::pins::Pins;
use crate::chip::blocks::p_counter::variant::PCounterVariant;
use crate::chip::config::{SensorConfig, Tap};
use crate::netlist::{CellKind, Module, ModuleBuilder};

pub(crate) const VARIANT: PCounterVariant = PCounterVariant {
    code: |count| count ^ count >> 1,
    nets: &["GRAY_PARITY", "GRAY_START"],
    ..PCounterVariant::down_counter(circuit, "a stage in Gray code", 82)
};

/// The counter with `bits` programmable stages; ports as in [`circuit`](crate::chip::p_counter::circuit).
fn circuit(config: &SensorConfig) -> Arc<Module> {
    let bits = config.counter_bits;
    let mut m = ModuleBuilder::new("p_counter");
    let pins = Pins::declare(&mut m, config);
    let memory = pins.memory(&mut m);
    let parity = m.wire("GRAY_PARITY");
    let start = m.wire_bus("GRAY_START", bits - 1);
    let q = m.wire_bus("Q", bits);
    let qn = m.wire_bus("QN", bits);
    let out = m.wire_bus("COUNTER_OUT", bits);
    for (bit, &start) in start.iter().enumerate() {
        m.gate_into(CellKind::Xor2, &memory[bit..bit + 2], start);
    }
    let [parity_q, parity_qn] = ["GRAY_PARITY_Q", "GRAY_PARITY_QN"].map(|name| m.wire(name));
    m.cell(
        "parity",
        CellKind::Dffr,
        &[parity_qn, pins.clk, pins.reset],
        &[parity_q, parity_qn],
    );
    let choice = [parity_q, parity_qn, memory[0]];
    m.cell("mux_parity", CellKind::Mux2, &choice, &[parity]);

    let top = bits - usize::from(config.tap == Tap::Msb);
    // Whether the parity is even and no bit below the last one is 1.
    let mut is_clear = m.gate(CellKind::Inv, &[parity]);
    for bit in 0..=top {
        let toggle = match bit {
            0 => parity,
            _ if bit == top => is_clear,
            _ => m.gate(CellKind::And2, &[is_clear, out[bit - 1]]),
        };
        if (1..top).contains(&bit) {
            let is_zero = m.gate(CellKind::Inv, &[out[bit - 1]]);
            is_clear = m.gate(CellKind::And2, &[is_clear, is_zero]);
        }
        // The borrow starts at 0 and needs no multiplexer.
        let (name, own, inverted) = if bit == bits {
            ("borrow".to_owned(), pins.local_stop, None)
        } else {
            (format!("counter_{bit}"), q[bit], Some(qn[bit]))
        };
        let next = m.gate(CellKind::Xor2, &[own, toggle]);
        let inputs = [next, pins.clk, pins.reset];
        m.cell(&name, CellKind::Dffr, &inputs, &[Some(own), inverted]);
        if bit < bits {
            let start = *start.get(bit).unwrap_or(&memory[bit]);
            let choice = [q[bit], qn[bit], start];
            m.cell(&format!("mux_{bit}"), CellKind::Mux2, &choice, &[out[bit]]);
        }
    }
    if config.tap == Tap::Msb {
        m.gate_into(CellKind::Buf, &[out[top]], pins.local_stop);
    }
    finished(m.finish())
}
