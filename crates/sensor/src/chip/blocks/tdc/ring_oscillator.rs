//! Gated ring oscillator: periods of a ring of inverters that runs from START to STOP (thesis 2.4.3, Fig. 23a).
//!
//! ```text
//!   START ───────────┐
//!   STOP ─ NOT ─ AND ┴ GATE ─ NAND ─ RING<0> ─ NOT ─ RING<1> ─ NOT … NOT ─ RING<n-1> ─┐
//!                          ┌─┘                          └─► ripple counter ─► CODE    │
//!                          └──────────────────────────────────────────────────────────┘
//! ```
//!
//! The ring rests with RING<0> high and starts in the same state every time. RING<0> falls as GATE rises, and then once a
//! period: the code is how often it has fallen. A fall just before GATE's lasts for NAND's rise, and is lost only where that is
//! shorter than the next inverter's, by mismatch; so every fall is counted or is not, and nothing is half seen.
//!
//! Its steps are equal, as it goes round the same cells each time, and so is every conversion: there is no jitter here.
//! Pixels differ: the period is the sum of two delays of every cell of its own ring.

use std::sync::Arc;

use super::{Steps, ripple_counter};
use crate::chip::blocks::finished;
use crate::logic::Logic::{One, Zero};
use crate::netlist::{CellKind, Module, ModuleBuilder, Netlist, Timing};
use crate::units::Time;

/// A ring of `stages` stages, the gate among them: an odd number from 3. Ports: START, STOP, TDC_RESET →
/// CODE\<bits\>.
pub fn circuit(stages: usize, bits: usize) -> Arc<Module> {
    debug_assert!(stages >= 3 && !stages.is_multiple_of(2));
    let mut m = ModuleBuilder::new("ring_oscillator");
    let (start, stop, clear) = (m.input("START"), m.input("STOP"), m.input("TDC_RESET"));
    let code = m.output_bus("CODE", bits);
    let gate = m.wire("GATE");
    let ring = m.wire_bus("RING", stages);
    let running = m.wire("STOP_N");
    m.cell("stop", CellKind::Inv, &[stop], &[running]);
    m.cell("gate", CellKind::And2, &[start, running], &[gate]);
    m.cell(
        "ring_0",
        CellKind::Nand2,
        &[gate, ring[stages - 1]],
        &[ring[0]],
    );
    for stage in 1..stages {
        let name = format!("ring_{stage}");
        m.cell(&name, CellKind::Inv, &[ring[stage - 1]], &[ring[stage]]);
    }
    ripple_counter(&mut m, ring[1], clear, &code);
    finished(m.finish())
}

/// Reference model: what its cells' delays make of it.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct RingOscillatorModel {
    /// START → the first fall of RING<0>, less STOP → GATE's fall.
    pub first: Time,
    /// The ring's period.
    pub period: Time,
    /// START → STOP from which on GATE rises at all.
    pub opens: Time,
    /// How long before GATE's fall RING<0> must fall to be counted.
    pub lag: Time,
}

impl RingOscillatorModel {
    /// The ring at `path` (empty: the top) of a netlist with these delays.
    ///
    /// # Panics
    /// When there is no ring.
    pub fn from_netlist(netlist: &Netlist, timing: &Timing, path: &str) -> Self {
        let cell = |name: &str| {
            if path.is_empty() {
                netlist.cell(name)
            } else {
                netlist.cell(&format!("{path}.{name}"))
            }
        };
        let delay = |name: &str, pin: usize, to| {
            let cell = cell(name).expect("a ring has its cells");
            timing.cell_delays(cell)[pin][0].delay(to)
        };
        let inverters = (1..).map(|stage| format!("ring_{stage}"));
        let inverters = inverters.take_while(|name| cell(name).is_some());
        let round = |name: &str, pin| delay(name, pin, One) + delay(name, pin, Zero);
        let to_fall = delay("gate", 0, One) + delay("ring_0", 0, Zero);
        // RING<0> falls for as long as it takes GATE's fall to raise it again, and RING<1> must see that. In the very
        // instant of GATE's fall there is none.
        let unseen = delay("ring_1", 0, One) - delay("ring_0", 0, One);
        RingOscillatorModel {
            opens: delay("gate", 0, One) - delay("stop", 0, Zero),
            lag: unseen.max(Time::from_fs(1)),
            first: to_fall - delay("stop", 0, Zero) - delay("gate", 1, Zero),
            period: inverters.fold(round("ring_0", 1), |sum, name| sum + round(&name, 0)),
        }
    }

    /// Where the first `codes` codes begin. The first may begin before START: STOP is seen later than START.
    pub fn steps(&self, codes: usize) -> Steps {
        let edge = |fall: i64| self.first + self.lag + self.period * fall;
        Steps::new(
            (0..codes as i64)
                .map(|fall| edge(fall).max(self.opens))
                .collect(),
        )
    }
}
