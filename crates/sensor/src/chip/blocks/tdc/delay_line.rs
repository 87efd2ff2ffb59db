//! Delay line: how many elements START has passed when STOP rises (thesis 2.4.3, Fig. 23b).
//!
//! ```text
//!   START ─► BUF ─┬─► BUF ─┬─► BUF ─┬─► …
//!              TAP<0>   TAP<1>   TAP<2>
//!                 D        D        D
//!   STOP ────────►>       ►>       ►>         SEEN<n>: 1…10…0, the code is the number of ones
//! ```
//!
//! No clock runs, and a step is as short as one element. Each has its own delay: a code is as wide as its element is slow, and
//! the errors add up along the line.

use std::sync::Arc;

use super::Steps;
use crate::chip::blocks::finished;
use crate::netlist::{CellKind, Module, ModuleBuilder, Netlist, Timing};
use crate::units::Time;

/// A line of `elements` elements. Ports: START, STOP, TDC_RESET → SEEN\<elements\>.
pub fn circuit(elements: usize) -> Arc<Module> {
    let mut m = ModuleBuilder::new("delay_line");
    let (start, stop, clear) = (m.input("START"), m.input("STOP"), m.input("TDC_RESET"));
    let seen = m.output_bus("SEEN", elements);
    let taps = m.wire_bus("TAP", elements);
    let mut before = start;
    for (element, (&tap, &seen)) in taps.iter().zip(&seen).enumerate() {
        m.cell(
            &format!("element_{element}"),
            CellKind::Buf,
            &[before],
            &[tap],
        );
        let pins = [tap, stop, clear];
        m.cell(
            &format!("seen_{element}"),
            CellKind::Dffr,
            &pins,
            &[Some(seen), None],
        );
        before = tap;
    }
    finished(m.finish())
}

/// Reference model: the steps of the line at `path` (empty: the top) of a netlist with these delays.
///
/// # Panics
/// When there is no line.
pub fn model(netlist: &Netlist, timing: &Timing, path: &str) -> Steps {
    let element = |number: usize| {
        let name = format!("element_{number}");
        netlist.cell(&if path.is_empty() {
            name
        } else {
            format!("{path}.{name}")
        })
    };
    let elements = (0..).map_while(element);
    let edges = elements.scan(Time::ZERO, |passed, cell| {
        *passed += timing.cell_delays(cell)[0][0].rise();
        Some(*passed)
    });
    let steps = Steps::new(edges.collect());
    assert!(
        !steps.edges().is_empty(),
        "there is no delay line at {path:?}"
    );
    steps
}
