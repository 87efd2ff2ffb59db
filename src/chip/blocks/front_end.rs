//! Front end: synchronous summation of SPADs (thesis 2.4.1, Fig. 22d; 4.2, Fig. 47).
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
//! must not be shorter than the toggle flip-flop can follow ([`PulseLimits`]).

use std::sync::Arc;

use super::finished;
use crate::netlist::{CellKind, Module, ModuleBuilder, Net};
use crate::units::Time;

/// What the toggle flip-flops ask of SPAD_RAW. What lies between the end of one pulse and the next one is chance, and left
/// to the timing checks of the gate engine.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct PulseLimits {
    /// Shortest pulse.
    pub width: Time,
    /// Shortest time from one rise to the next: clk-to-Q and setup.
    pub apart: Time,
}

impl PulseLimits {
    /// The shortest dead time that keeps both.
    pub fn shortest(&self) -> Time {
        self.width.max(self.apart)
    }

    /// Whether the flip-flops follow pulses of this dead time, ns.
    ///
    /// # Errors
    /// When it is shorter than they ask for.
    pub fn follow(&self, dead_time_ns: f64) -> Result<(), DeadTimeTooShort> {
        match dead_time_ns >= self.shortest().as_ns() {
            true => Ok(()),
            false => Err(DeadTimeTooShort {
                dead_time_ns,
                limits: *self,
            }),
        }
    }
}

/// A dead time that the front end's flip-flops cannot follow.
#[derive(Debug, Clone, Copy, PartialEq, thiserror::Error)]
#[error(
    "dead_time_ns = {dead_time_ns} is shorter than the front end follows, whose toggle flip-flop takes pulses of at least {} and no two closer than {} (clk-to-Q and setup)",
    limits.width,
    limits.apart
)]
pub struct DeadTimeTooShort {
    /// The dead time, ns.
    pub dead_time_ns: f64,
    /// What the flip-flops ask for.
    pub limits: PulseLimits,
}

impl DeadTimeTooShort {
    /// The shortest dead time that the flip-flops follow, ns, rounded up to a tenth of a picosecond.
    pub fn at_least_ns(&self) -> f64 {
        (self.limits.shortest().as_ns() * 1e4).ceil() * 1e-4
    }

    /// The dead time in nanoseconds that was probably meant: those of SPADs are some nanoseconds, and this one would be in
    /// another unit.
    pub fn probably_meant_ns(&self) -> Option<f64> {
        let meant = [1e3, 1e6, 1e9].map(|factor| (self.dead_time_ns * factor * 1e6).round() * 1e-6);
        meant.into_iter().find(|ns| (0.5..500.0).contains(ns))
    }

    /// What to give instead.
    pub fn cure(&self) -> String {
        let meant = self.probably_meant_ns();
        let meant = meant.map_or(String::new(), |ns| format!("; did you mean {ns} (ns)?"));
        format!("give at least {:.4}{meant}", self.at_least_ns())
    }
}

/// Retiming of one SPAD. Ports: SPAD_RAW, CLK, PIXEL_CLEAR → SPAD_TIMED.
fn retiming() -> Arc<Module> {
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
        "toggle",
        CellKind::Dffr,
        &[toggle_n, raw, clear],
        &[toggle, toggle_n],
    );
    for (name, d, q) in [("first", toggle, first), ("second", first, second)] {
        m.cell(name, CellKind::Dffr, &[d, clk, clear], &[q, Net::NONE]);
    }
    m.gate_into(CellKind::Xor2, &[first, second], timed);
    finished(m.finish())
}

/// The front end of a macropixel of so many SPADs.
///
/// Ports: SPAD_RAW\<SPADs\>, CLK, PIXEL_CLEAR → SPAD_TIMED\<SPADs\>.
pub fn circuit(spads: usize) -> Arc<Module> {
    let retiming = retiming();
    let mut m = ModuleBuilder::new("front_end");
    let raw = m.input_bus("SPAD_RAW", spads);
    let clk = m.input("CLK");
    let clear = m.input("PIXEL_CLEAR");
    let timed = m.output_bus("SPAD_TIMED", spads);
    for spad in 0..spads {
        m.instance(
            &format!("spad_{spad}"),
            &retiming,
            &[
                ("SPAD_RAW", &raw[spad..=spad]),
                ("CLK", &[clk]),
                ("PIXEL_CLEAR", &[clear]),
                ("SPAD_TIMED", &timed[spad..=spad]),
            ],
        );
    }
    finished(m.finish())
}

/// Whether the cell at this dotted path is a front end's first sampling flip-flop. Its D follows SPADs, not CLK, so that
/// it breaks setup and hold by design; the second one gives it a period to make up its mind.
pub(crate) fn is_asynchronous_sampler(cell_path: &str) -> bool {
    let mut parts = cell_path.rsplit('.');
    parts.next() == Some("first")
        && parts
            .next()
            .is_some_and(|retiming| retiming.starts_with("spad_"))
        && parts.next() == Some("front_end")
}

/// Reference model: one bit per SPAD.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq)]
pub struct Model {
    toggle: u64,
    first: u64,
    second: u64,
}

impl Model {
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
        let mut model = Model::default();
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
