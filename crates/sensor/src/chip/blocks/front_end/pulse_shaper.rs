//! Pulse shaper: a monostable that makes one short pulse of a SPAD's long one (thesis 2.4.1, Fig. 22a).
//!
//! ```text
//!   SPAD_RAW ──┬──────────────────────────────────────────┐
//!              ├─► buffer ─ AND ─ AND ─ … ─ AND ─ NOT ─ LATE ─ AND ─► SHAPED
//!              └──────────────┴─────┴────────┘   (23 stages)
//! ```
//!
//! SHAPED is high from SPAD_RAW's rise until that has come through the delay chain. A chain of plain inverters would
//! hold LATE low for as long again after SPAD_RAW has fallen, and a SPAD that fires soon after its dead time would get
//! a late and narrow pulse, or none. Here SPAD_RAW gates every stage, so that its fall empties the whole chain at once.
//!
//! Timing, typical corner: SHAPED rises 43 ps after SPAD_RAW and lasts 1.01 ns, a width chosen so that an OR tree of 16
//! SPADs with 8 ns of dead time folds over within their count rates. SPAD_RAW must be high for longer than that and low for
//! 62 ps. The price is the chain: 144 transistors a SPAD. Current-starved inverters would do with fewer, at a
//! width that varies more.

use std::sync::Arc;

use crate::chip::blocks::finished;
use crate::netlist::{CellKind, Module, ModuleBuilder};

/// Stages of the delay chain, the buffer included.
pub(super) const STAGES: usize = 23;

/// A pulse shaper. Ports: SPAD_RAW → SHAPED.
pub(super) fn circuit() -> Arc<Module> {
    let mut m = ModuleBuilder::new("pulse_shaper");
    let raw = m.input("SPAD_RAW");
    let shaped = m.output("SHAPED");
    let late = m.wire("LATE");
    let buffered = m.gate(CellKind::Buf, &[raw]);
    let chain = (1..STAGES).fold(buffered, |net, _| m.gate(CellKind::And2, &[raw, net]));
    m.gate_into(CellKind::Inv, &[chain], late);
    m.gate_into(CellKind::And2, &[raw, late], shaped);
    finished(m.finish())
}
