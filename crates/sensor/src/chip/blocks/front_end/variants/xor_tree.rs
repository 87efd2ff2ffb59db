//! Toggle flip-flops and an XOR tree: all SPADs on one wire, an edge for every pulse (thesis 2.4.1, Fig. 22b).
//!
//! ```text
//!   SPAD_RAW<0> ─► toggle ─┐
//!   SPAD_RAW<1> ─► toggle ─┴ XOR ─┐
//!        …                        XOR … ─► WIRE ─► two samplers on CLK, XOR ─► SPAD_TIMED<0>
//! ```
//!
//! Pulses may overlap: only those merge whose edges meet within an XOR gate's delay, 58 ps instead of a shaper's
//! nanosecond. But the wire says no more than whether an odd number of pulses came, and CLK sees it once a period:
//! of Λ pulses a second, (1 − exp(−2 Λ T)) / 2 periods have an odd number, half of them at most.
//!
//! Timing: the wire follows SPAD_RAW after clk-to-Q and 57 to 58 ps a level, by the direction in which each level changes.
//! A pulse that comes so near to CLK's edge, or to another pulse, is sampled a period sooner or later by that.

use std::sync::Arc;

use super::summation::{JOINED, TOGGLE};
use crate::chip::blocks::finished;
use crate::chip::blocks::front_end::variant::{FrontEndVariant, pins};
use crate::netlist::{CellKind, Module, ModuleBuilder};

pub(crate) const VARIANT: FrontEndVariant = FrontEndVariant {
    circuit: |config| circuit(config.spads()),
    joins: true,
    shapes: false,
    together: |_| 1,
};

/// Toggle of one SPAD: every pulse is an edge. Ports: SPAD_RAW, PIXEL_CLEAR → TOGGLE.
pub(in crate::chip::blocks) fn toggle() -> Arc<Module> {
    // Icarus takes a path through an instance of the module's own name for the module itself.
    let mut m = ModuleBuilder::new("spad_toggle");
    let raw = m.input("SPAD_RAW");
    let clear = m.input("PIXEL_CLEAR");
    let toggle = m.output("TOGGLE");
    let toggle_n = m.wire("TOGGLE_N");
    let pins = [toggle_n, raw, clear];
    m.cell(TOGGLE, CellKind::Dffr, &pins, &[toggle, toggle_n]);
    finished(m.finish())
}

/// Samplers of a wire that says something by changing. Ports: WIRE, CLK, PIXEL_CLEAR → SPAD_TIMED.
fn sampler() -> Arc<Module> {
    let mut m = ModuleBuilder::new("sampler");
    let wire = m.input("WIRE");
    let clk = m.input("CLK");
    let clear = m.input("PIXEL_CLEAR");
    let timed = m.output("SPAD_TIMED");
    let first = m.wire("FIRST");
    let second = m.wire("SECOND");
    for (name, d, q) in [("first", wire, first), ("second", first, second)] {
        m.cell(name, CellKind::Dffr, &[d, clk, clear], &[Some(q), None]);
    }
    m.gate_into(CellKind::Xor2, &[first, second], timed);
    finished(m.finish())
}

/// The front end of `spads` SPADs.
///
/// Ports: SPAD_RAW\<SPADs\>, CLK, PIXEL_CLEAR → SPAD_TIMED\<1\>.
fn circuit(spads: usize) -> Arc<Module> {
    let mut m = ModuleBuilder::new("front_end_xor_tree");
    let raw = pins(&mut m, spads);
    m.output_bus("SPAD_TIMED", 1);
    let of_spad = toggle();
    let toggles = m.wire_bus("TOGGLES", spads);
    for (spad, raw) in raw.iter().enumerate() {
        let ports = [("SPAD_RAW", &[*raw][..]), ("TOGGLE", &toggles[spad..=spad])];
        m.instance_by_names(&format!("spad_{spad}"), &of_spad, &ports);
    }
    let joined = m.tree(CellKind::Xor2, &toggles);
    let wire = m.wire("WIRE");
    m.gate_into(CellKind::Buf, &[joined], wire);
    m.instance_by_names(JOINED, &sampler(), &[]);
    finished(m.finish())
}
