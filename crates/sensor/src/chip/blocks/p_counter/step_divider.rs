//! Step divider: windows that step by several CLK periods (HSLIDAR's clocked mode, thesis 4.9.3, Table 10: bins of one
//! CLK period, steps of four).
//!
//! ```text
//!                 step_0               step_1
//!               ┌────────┐           ┌────────┐
//!            ┌─►│D     QN├──┐     ┌─►│D     QN├──┐
//!            └──│        │◄─┘     └──│        │◄─┘
//!   COUNTER_CLK►│>      Q├──────────►│>      Q├─STEP_CLK─► to the first stage of the counter
//!               │R       │           │R       │
//!   COUNTER_RESET┴────────────────────┘
//! ```
//!
//! A ripple divider of reset-only flip-flops. Reset to zero, it passes the first COUNTER_CLK edge after the reset on, and then
//! one of every 2ᵏ: a start value of n raises LOCAL_STOP with edge 2ᵏ·n.
//!
//! Timing: k × clk-to-Q are added to the ripple. Its falls at a reset clock nothing.

use crate::netlist::{CellKind, ModuleBuilder, Net};

/// Places a divider by 2ᵏ, k = `bits`, and returns the clock that it makes; for 0 that is `clk` itself.
pub(super) fn place(m: &mut ModuleBuilder, clk: Net, reset: Net, bits: u32) -> Net {
    let mut clock = clk;
    for bit in 0..bits {
        let name = if bit + 1 == bits {
            "STEP_CLK".to_owned()
        } else {
            format!("STEP_{bit}")
        };
        let q = m.wire(&name);
        let q_n = m.wire(&format!("STEP_N_{bit}"));
        let name = format!("step_{bit}");
        m.cell(&name, CellKind::Dffr, &[q_n, clock, reset], &[q, q_n]);
        clock = q;
    }
    clock
}

/// Reference model.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) struct StepDividerModel {
    bits: u32,
    count: u32,
}

impl StepDividerModel {
    /// A divider by 2ᵏ, k = `bits`, just reset.
    pub(super) fn new(bits: u32) -> Self {
        StepDividerModel { bits, count: 0 }
    }

    /// COUNTER_RESET.
    pub(super) fn reset(&mut self) {
        self.count = 0;
    }

    /// A rising edge of COUNTER_CLK. Returns whether it is passed on.
    pub(super) fn clock(&mut self) -> bool {
        let is_passed_on = self.count == 0;
        self.count = (self.count + 1) % (1 << self.bits);
        is_passed_on
    }
}
