//! Synchronous summation of SPADs, the chip's own front end (thesis 2.4.1, Fig. 22d; 4.2, Fig. 47).
//!
//! ```text
//!                 toggle            first             second
//!               ┌────────┐        ┌───────┐         ┌───────┐
//!            ┌─►│D      Q├────────┤D     Q├────┬────┤D     Q├──┐
//!            └──┤QN      │        │       │    │    │       │  XOR ─► SPAD_TIMED
//!   SPAD_RAW ──►│>       │ CLK ──►│>      │    │ ┌─►│>      │  │
//!               └────────┘        └───────┘    └─┼──────────┼──┘
//!                                         CLK ───┘
//! ```
//!
//! Each pulse toggles the first flip-flop. CLK samples it twice, and two successive samples differ for
//! exactly one period after each pulse. Two pulses of one SPAD within a period cancel, so the dead
//! time must exceed the CLK period. PIXEL_CLEAR forgets everything.
//!
//! Timing: a pulse is taken by the first rising CLK edge at or after pulse + clk-to-Q. A pulse lasts the dead time, which
//! must not be shorter than the toggle flip-flop can follow ([`PulseLimits`](crate::chip::front_end::PulseLimits)).

use std::sync::Arc;

use crate::chip::blocks::finished;
use crate::chip::blocks::front_end::variant::FrontEndVariant;
use crate::netlist::{CellKind, Module, ModuleBuilder, Net};

/// Name of the cell that a SPAD's pulses toggle.
pub(crate) const TOGGLE: &str = "toggle";

/// The instance that retimes the one wire of a front end that joins its SPADs.
pub(crate) const JOINED: &str = "joined";

pub(crate) const VARIANT: FrontEndVariant = FrontEndVariant {
    circuit: |config| circuit(config.spads()),
    joins: false,
    shapes: false,
    together: |_| 1,
};

/// Retiming of one SPAD, or of the wire that joins several. Ports: SPAD_RAW, CLK, PIXEL_CLEAR → SPAD_TIMED.
pub(super) fn retiming() -> Arc<Module> {
    let mut m = ModuleBuilder::new("retiming");
    let raw = m.input("SPAD_RAW");
    let clk = m.input("CLK");
    let clear = m.input("PIXEL_CLEAR");
    let timed = m.output("SPAD_TIMED");
    let toggle = m.wire("TOGGLE");
    let toggle_n = m.wire("TOGGLE_N");
    let first = m.wire("FIRST");
    let second = m.wire("SECOND");
    m.cell(
        TOGGLE,
        CellKind::Dffr,
        &[toggle_n, raw, clear],
        &[toggle, toggle_n],
    );
    for (name, d, q) in [("first", toggle, first), ("second", first, second)] {
        m.cell(name, CellKind::Dffr, &[d, clk, clear], &[Some(q), None]);
    }
    m.gate_into(CellKind::Xor2, &[first, second], timed);
    finished(m.finish())
}

/// SPAD_TIMED of one line, from the rising edges of `joined`.
pub(super) fn retime(m: &mut ModuleBuilder, joined: Net) {
    m.output_bus("SPAD_TIMED", 1);
    let retiming = retiming();
    m.instance_by_names(JOINED, &retiming, &[("SPAD_RAW", &[joined])]);
}

/// The front end of a macropixel with `spads` SPADs.
///
/// Ports: SPAD_RAW\<SPADs\>, CLK, PIXEL_CLEAR → SPAD_TIMED\<SPADs\>.
pub fn circuit(spads: usize) -> Arc<Module> {
    let retiming = retiming();
    let mut m = ModuleBuilder::new("front_end");
    let raw = m.input_bus("SPAD_RAW", spads);
    m.input("CLK");
    m.input("PIXEL_CLEAR");
    let timed = m.output_bus("SPAD_TIMED", spads);
    for spad in 0..spads {
        let ports = [
            ("SPAD_RAW", &raw[spad..=spad]),
            ("SPAD_TIMED", &timed[spad..=spad]),
        ];
        m.instance_by_names(&format!("spad_{spad}"), &retiming, &ports);
    }
    finished(m.finish())
}

/// Reference model: one bit per SPAD.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq)]
pub struct SummationModel {
    toggle: u64,
    first: u64,
    second: u64,
}

impl SummationModel {
    /// A pulse of one SPAD.
    pub fn pulse(&mut self, spad: u8) {
        self.toggle ^= 1 << spad;
    }

    /// A rising edge of CLK.
    pub fn clock(&mut self) {
        self.second = self.first;
        self.first = self.toggle;
    }

    /// SPAD_TIMED, a bit for each SPAD.
    pub fn spad_timed(&self) -> u64 {
        self.first ^ self.second
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_pulse_lasts_one_period_and_two_cancel() {
        let mut model = SummationModel::default();
        model.pulse(3);
        model.clock();
        assert_eq!(model.spad_timed(), 1 << 3);
        model.clock();
        assert_eq!(model.spad_timed(), 0);
        model.pulse(3);
        model.pulse(3);
        model.clock();
        assert_eq!(model.spad_timed(), 0);
    }
}
