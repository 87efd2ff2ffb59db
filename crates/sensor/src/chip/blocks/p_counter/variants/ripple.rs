//! Ripple down counter of reset-only flip-flops: the sensor's P-counter (thesis 4.4.4, 4.5, Fig. 51c, 53).
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
//!   clock<0> = COUNTER_CLK;   tap borrow: a last toggle flip-flop on COUNTER_OUT<n-1> gives LOCAL_STOP
//! ```
//!
//! The counter flip-flop can only be reset. Passing Q or Q̄ by the memory bit makes a reset leave
//! COUNTER_OUT = MEMORY. A rising stage output is the borrow that clocks the next stage.
//!
//! Timing: from COUNTER_CLK rising to LOCAL_STOP rising, n × (clk-to-Q + mux) + clk-to-Q, the same for
//! every start value because rolling over toggles every stage. COUNTER_RESET must stay high until
//! outputs returning to their memory value (rising edges, too) have died out in the next stages. A memory bit that
//! changes flips its multiplexer, which is an edge as well: COUNTER_RESET must be held while loading.

use std::sync::Arc;

use crate::chip::blocks::finished;
use crate::chip::blocks::p_counter::pins::Pins;
use crate::chip::blocks::p_counter::variant::PCounterVariant;
use crate::chip::config::SensorConfig;
use crate::netlist::{Module, ModuleBuilder};

pub(crate) const VARIANT: PCounterVariant = PCounterVariant::down_counter(circuit, "a stage", 52);

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
        let state = [q[bit], qn[bit], out[bit]];
        pins.stage(&mut m, bit, [qn[bit], clock], memory[bit], state);
        clock = out[bit];
    }
    pins.ripple_tap(&mut m, config.tap, clock, pins.reset);
    finished(m.finish())
}
