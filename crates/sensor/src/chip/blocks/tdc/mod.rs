//! Other time-to-digital converters than the METDC's shift register on the global CLK (thesis 2.4.3, Fig. 23). None
//! of them is in the chips; they are here for comparison.
//!
//! | file | what it counts | resolution | what makes its steps unequal |
//! |---|---|---|---|
//! | [`clock_counter`] | periods of the global CLK | 1 / CLK | nothing |
//! | [`ring_oscillator`] | periods of a ring of its own (Fig. 23a) | two rounds of the ring | nothing, but every pixel's period is another |
//! | [`delay_line`] | elements that START has passed (Fig. 23b) | one element | every element |
//! | [`coupling`] | not a circuit: rings that pull their neighbours' phases | | |
//!
//! All measure from START to STOP, levels that rise once in a conversion, and are cleared by TDC_RESET before the next one, with
//! both low again, START first. [`Steps`] says where the codes' edges lie.

pub mod clock_counter;
pub mod coupling;
pub mod delay_line;
pub mod ring_oscillator;

use crate::netlist::{CellKind, ModuleBuilder, Net};
use crate::units::Time;

/// A ripple counter of rises of `clock`, which `clear` sets to zero.
fn ripple_counter(m: &mut ModuleBuilder, clock: Net, clear: Net, count: &[Net]) {
    let mut clock = clock;
    for (bit, &q) in count.iter().enumerate() {
        let inverted = m.wire(&format!("COUNT_N_{bit}"));
        let name = format!("count_{bit}");
        m.cell(
            &name,
            CellKind::Dffr,
            &[inverted, clock, clear],
            &[q, inverted],
        );
        clock = inverted;
    }
}

/// Where the codes of a converter begin that START resets: code k is given from edge k − 1 on, and before edge k.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Steps {
    edges: Vec<Time>,
}

impl Steps {
    /// Steps at these times from START to STOP, in order.
    pub fn new(edges: Vec<Time>) -> Self {
        debug_assert!(edges.is_sorted());
        Steps { edges }
    }

    /// The code of STOP so long after START.
    pub fn code(&self, interval: Time) -> usize {
        self.edges.partition_point(|&edge| edge <= interval)
    }

    /// The edges.
    pub fn edges(&self) -> &[Time] {
        &self.edges
    }

    /// Widths of the codes from 1 on, as far as they have an end, s.
    pub fn widths_s(&self) -> Vec<f64> {
        let widths = self.edges.windows(2);
        widths.map(|ends| (ends[1] - ends[0]).as_s()).collect()
    }
}
