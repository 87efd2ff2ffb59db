//! Pulse shapers and an OR tree: all SPADs on one wire (thesis 2.4.1, Fig. 22a).
//!
//! ```text
//!   SPAD_RAW<0> ─► shaper ─┐
//!   SPAD_RAW<1> ─► shaper ─┴ OR ─┐
//!        …                       OR … ─► WIRE ─► toggle, two samplers on CLK ─► SPAD_TIMED<0>
//! ```
//!
//! A pulse that begins while another lasts makes no edge of its own and prolongs the wire's pulse: n SPADs of rate m and
//! shaped pulses of width τ, no longer than the dead time, make n m (1 − m τ)ⁿ⁻¹ edges, because no other SPAD may have fired
//! in the τ before. That is most at m = 1 / (n τ) and falls from there on; for many SPADs it is the paralysable law
//! Λ exp(−Λ τ).
//!
//! Timing: the wire rises 43 ps + 44 ps a level after SPAD_RAW, and the toggle follows with its clk-to-Q. Gaps shorter than
//! an OR gate's delay close.

use std::sync::Arc;

use super::summation::retime;
use crate::chip::blocks::finished;
use crate::chip::blocks::front_end::pulse_shaper;
use crate::chip::blocks::front_end::variant::{FrontEndVariant, pins};
use crate::netlist::{CellKind, Module, ModuleBuilder, Net};

pub(crate) const VARIANT: FrontEndVariant = FrontEndVariant {
    circuit: |config| circuit(config.spads()),
    joins: true,
    shapes: true,
    together: |_| 1,
};

/// The front end of `spads` SPADs.
///
/// Ports: SPAD_RAW\<SPADs\>, CLK, PIXEL_CLEAR → SPAD_TIMED\<1\>.
fn circuit(spads: usize) -> Arc<Module> {
    let mut m = ModuleBuilder::new("front_end_or_tree");
    let raw = pins(&mut m, spads);
    let shaped = shapers(&mut m, &raw);
    let joined = m.tree(CellKind::Or2, &shaped);
    let wire = m.wire("WIRE");
    m.gate_into(CellKind::Buf, &[joined], wire);
    retime(&mut m, wire);
    finished(m.finish())
}

/// A pulse shaper for each SPAD, and what they give.
pub(super) fn shapers(m: &mut ModuleBuilder, raw: &[Net]) -> Vec<Net> {
    let shaper = pulse_shaper::circuit();
    let shaped = m.wire_bus("SHAPED", raw.len());
    for (spad, raw) in raw.iter().enumerate() {
        let ports = [("SPAD_RAW", &[*raw][..]), ("SHAPED", &shaped[spad..=spad])];
        m.instance(&format!("shaper_{spad}"), &shaper, &ports);
    }
    shaped
}
