//! Clock counter: CLK periods from START to STOP (thesis 2.4.3).
//!
//! ```text
//!   START ─► two samplers on NOT CLK ─────────┐
//!   STOP ──► two samplers on NOT CLK ─ NOT ─ AND ─ GATE ─┐
//!   CLK ───────────────────────────────────────────────── AND ─► ripple counter ─► CODE
//! ```
//!
//! Samplers change while CLK is low, so that GATE lets whole pulses through. What is counted are the falling edges of CLK
//! from START on and before STOP. Steps are CLK periods, all of them; where START lies within the first one is
//! lost, and the clock has to be brought to every pixel.

use std::sync::Arc;

use super::ripple_counter;
use crate::chip::blocks::finished;
use crate::netlist::{CellKind, Module, ModuleBuilder, Net};
use crate::units::Time;

/// A clock counter. Ports: START, STOP, CLK, TDC_RESET → CODE\<bits\>.
pub fn circuit(bits: usize) -> Arc<Module> {
    let mut m = ModuleBuilder::new("clock_counter");
    let (start, stop) = (m.input("START"), m.input("STOP"));
    let (clk, clear) = (m.input("CLK"), m.input("TDC_RESET"));
    let code = m.output_bus("CODE", bits);
    let clk_n = m.wire("CLK_N");
    let gate = m.wire("GATE");
    let gated = m.wire("GATED_CLK");
    m.gate_into(CellKind::Inv, &[clk], clk_n);
    let mut sampled = |name: &str, level: Net| {
        let [first, second, inverse] =
            ["FIRST", "SECOND", "SECOND_N"].map(|net| m.wire(&format!("{name}_{net}")));
        let pins = [level, clk_n, clear];
        m.cell(
            &format!("{name}_first"),
            CellKind::Dffr,
            &pins,
            &[Some(first), None],
        );
        let pins = [first, clk_n, clear];
        m.cell(
            &format!("{name}_second"),
            CellKind::Dffr,
            &pins,
            &[second, inverse],
        );
        (second, inverse)
    };
    let (started, _) = sampled("START", start);
    let (_, running) = sampled("STOP", stop);
    m.gate_into(CellKind::And2, &[started, running], gate);
    m.gate_into(CellKind::And2, &[clk, gate], gated);
    ripple_counter(&mut m, gated, clear, &code);
    finished(m.finish())
}

/// Reference model: the code where NOT CLK rises at `edges`.
pub fn model(edges: impl Iterator<Item = Time>, start: Time, stop: Time) -> usize {
    edges.filter(|&edge| start <= edge && edge < stop).count()
}
