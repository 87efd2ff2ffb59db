//! Synchronous down counter (thesis 4.4.2, Fig. 50a), reset as the sensor's own is (Fig. 51c).
//!
//! ```text
//!   toggle<i> ─┐  NEXT<i>  ┌─────────┐  Q   ┌───────┐
//!              XOR ────────┤D        ├──┬───┤0  mux ├─┬─► COUNTER_OUT<i>
//!        Q<i> ─┘           │         │QN│ ┌─┤1      │ │
//!   COUNTER_CLK ──────────►│>        ├────┘ └───▲───┘ └─ NOT ─┐
//!                          └─R───────┘  │   MEMORY<i>         AND ─► toggle<i+1>
//!                   COUNTER_RESET   to XOR         toggle<i> ─┘
//!
//!   toggle<0> = 1;   tap borrow: a last flip-flop toggled by toggle<n> gives LOCAL_STOP
//! ```
//!
//! A bit toggles when all bits below it are zero. Toggling Q toggles COUNTER_OUT, whichever the multiplexer passes,
//! so that the reset-only flip-flop and its memory bit serve here, too.
//!
//! Timing: LOCAL_STOP rises clk-to-Q after COUNTER_CLK (and multiplexer and buffer with the tap `msb`), whatever the
//! number of bits. The price is the chain of AND gates, which must settle within a CLK period and between
//! COUNTER_RESET's rise and the first count.

use std::sync::Arc;

use crate::chip::blocks::finished;
use crate::chip::blocks::p_counter::pins::Pins;
use crate::chip::blocks::p_counter::variant::PCounterVariant;
use crate::chip::config::{SensorConfig, Tap};
use crate::netlist::{CellKind, Module, ModuleBuilder, Net};

pub(crate) const VARIANT: PCounterVariant = PCounterVariant {
    nets: &["NEXT"],
    ..PCounterVariant::down_counter(circuit, "a synchronous stage", 68)
};

/// The counter with `bits` programmable stages; ports as in [`circuit`](crate::chip::p_counter::circuit).
fn circuit(config: &SensorConfig) -> Arc<Module> {
    let bits = config.counter_bits;
    let mut m = ModuleBuilder::new("p_counter");
    let pins = Pins::declare(&mut m, config);
    let memory = pins.memory(&mut m);
    let q = m.wire_bus("Q", bits);
    let qn = m.wire_bus("QN", bits);
    let next = m.wire_bus("NEXT", bits - 1);
    let out = m.wire_bus("COUNTER_OUT", bits);
    // Bit 0 always toggles.
    let mut toggle: Option<Net> = None;
    for bit in 0..bits {
        let data = match toggle {
            None => qn[bit],
            Some(toggle) => {
                m.gate_into(CellKind::Xor2, &[q[bit], toggle], next[bit - 1]);
                next[bit - 1]
            }
        };
        let state = [q[bit], qn[bit], out[bit]];
        pins.stage(&mut m, bit, [data, pins.clk], memory[bit], state);
        if config.tap == Tap::Borrow || bit + 1 < bits {
            let is_zero = m.gate(CellKind::Inv, &[out[bit]]);
            toggle = Some(match toggle {
                None => is_zero,
                Some(below) => m.gate(CellKind::And2, &[below, is_zero]),
            });
        }
    }
    match config.tap {
        Tap::Borrow => {
            let all_zero = toggle.expect("every bit has been looked at");
            let data = m.gate(CellKind::Xor2, &[pins.local_stop, all_zero]);
            m.cell(
                "borrow",
                CellKind::Dffr,
                &[data, pins.clk, pins.reset],
                &[Some(pins.local_stop), None],
            );
        }
        Tap::Msb => m.gate_into(CellKind::Buf, &[out[bits - 1]], pins.local_stop),
    }
    finished(m.finish())
}
