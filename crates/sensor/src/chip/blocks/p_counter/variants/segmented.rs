//! Down counter of three-bit segments: synchronous within a segment, a ripple from one to the next.
//!
//! ```text
//!   COUNTER_CLK ─► segment 0 ─ COUNTER_OUT<2> ─► segment 1 ─ COUNTER_OUT<5> ─► segment 2 ... last bit ─► LOCAL_STOP
//!                  bits 0..2                     bits 3..5
//!
//!   a bit:      D ┌─────────┐  Q   ┌───────┐              D of a segment's bits, whose outputs are OUT<0..2>:
//!        ─────────┤D        ├──────┤0  mux ├─► OUT        0: QN
//!   the segment's │         │ QN   │       │              1: Q XNOR OUT<0>
//!   clock ───────►│>        ├──────┤1      │              2: Q XOR (OUT<0> NOR OUT<1>)
//!                 └─R───────┘      └───▲───┘
//!          COUNTER_RESET            MEMORY<i>             tap borrow: a toggle flip-flop on the last bit
//! ```
//!
//! Flip-flops and multiplexers are those of the [ripple counter](super::ripple): toggling Q toggles the output, whichever is passed.
//! A segment's last bit rises when all its bits were zero, and only then. That borrow clocks the next segment. The last
//! segment may be shorter. The thesis has no such counter. One of nine bits has the ripple of three stages, and needs no chain of
//! ANDs: its gates are 60 transistors, and 138 in the [synchronous counter](super::synchronous).
//!
//! Timing: from COUNTER_CLK rising to LOCAL_STOP rising, ⌈n/3⌉ × (clk-to-Q + mux) + clk-to-Q, or a buffer for the last flip-flop with
//! the tap `msb`. The data of a segment must settle within a CLK period, clk-to-Q, mux, NOR and XOR after its clock; segments behind
//! the first have eight periods and more. What a ripple counter asks of COUNTER_RESET holds here, too: it must outlast the way
//! to the next segment's clock, and be held while loading.

use std::sync::Arc;

use crate::chip::blocks::finished;
use crate::chip::blocks::p_counter::pins::Pins;
use crate::chip::blocks::p_counter::variant::PCounterVariant;
use crate::chip::config::SensorConfig;
use crate::netlist::{CellKind, Module, ModuleBuilder};

pub(crate) const VARIANT: PCounterVariant =
    PCounterVariant::down_counter(circuit, "the third stage of a segment", 64);

/// Bits that count synchronously.
const SEGMENT: usize = 3;

/// The counter with `bits` programmable stages; ports as in [`circuit`](crate::chip::p_counter::circuit).
fn circuit(config: &SensorConfig) -> Arc<Module> {
    let bits = config.counter_bits;
    let mut m = ModuleBuilder::new("p_counter");
    let pins = Pins::declare(&mut m, config);
    let memory = pins.memory(&mut m);
    let q = m.wire_bus("Q", bits);
    let qn = m.wire_bus("QN", bits);
    let out = m.wire_bus("COUNTER_OUT", bits);
    let mut clock = pins.clk;
    for bit in 0..bits {
        let first = bit / SEGMENT * SEGMENT;
        if first > 0 {
            clock = out[first - 1];
        }
        let data = match &out[first..bit] {
            [] => qn[bit],
            [below] => m.gate(CellKind::Xnor2, &[q[bit], *below]),
            below => {
                let are_zero = m.gate(CellKind::Nor2, below);
                m.gate(CellKind::Xor2, &[q[bit], are_zero])
            }
        };
        let state = [q[bit], qn[bit], out[bit]];
        pins.stage(&mut m, bit, [data, clock], memory[bit], state);
    }
    pins.ripple_tap(&mut m, config.tap, out[bits - 1], pins.reset);
    finished(m.finish())
}
