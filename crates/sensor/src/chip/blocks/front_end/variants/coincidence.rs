//! Coincidence: an event where k SPADs or more fire within a shaped pulse's width (thesis 2.4.1, Fig. 22c).
//!
//! ```text
//!   SPAD_RAW<n> ─► shapers ─SHAPED<n>─► sorting network, output k ─► WIRE ─► toggle, two samplers on CLK ─► SPAD_TIMED<0>
//!
//!   one comparator:  a ─┬─ OR ─►  the larger      as many of the outputs are high, from the first on,
//!                    b ─┴─ AND ─► the smaller     as inputs are: output k is high where k inputs are
//! ```
//!
//! An adder and a comparator would say the same, but their outputs have hazards, each of which would be an edge. Batcher's
//! odd-even merge sort is all AND and OR: an input that rises can only make outputs rise. Of its 63 comparators for 16
//! SPADs the gates that output k does not depend on are left out.
//!
//! k is fixed in the circuit. The thesis has it set for each pixel by the rate that is expected there.
//!
//! n SPADs of rate m have k − 1 others high with the binomial probability of m τ: the wire has
//! n m C(n−1, k−1) (m τ)ᵏ⁻¹ (1 − m τ)ⁿ⁻ᵏ edges a second, which for k = 1 are the OR tree's.
//!
//! Timing: the paths through the network differ by some tens of ps, as AND's and OR's delays do.

use std::collections::VecDeque;
use std::sync::Arc;

use super::or_tree::shapers;
use super::summation::retime;
use crate::chip::blocks::finished;
use crate::chip::blocks::front_end::variant::{FrontEndVariant, pins};
use crate::netlist::{CellKind, Module, ModuleBuilder};
use crate::units::Time;

pub(crate) const VARIANT: FrontEndVariant = FrontEndVariant {
    circuit: |config| circuit(config.spads(), config.coincident_spads),
    joins: true,
    shapes: true,
    together: |config| config.coincident_spads,
};

/// The front end of `spads` SPADs, a power of two, of which `together` must fire.
///
/// Ports: SPAD_RAW\<SPADs\>, CLK, PIXEL_CLEAR → SPAD_TIMED\<1\>.
fn circuit(spads: usize, together: usize) -> Arc<Module> {
    debug_assert!((1..=spads).contains(&together));
    let mut m = ModuleBuilder::new("front_end_coincidence");
    let raw = pins(&mut m, spads);
    let mut lines = shapers(&mut m, &raw);
    for comparator in needed(&comparators(spads), together - 1, spads) {
        let (a, b) = comparator.between;
        let inputs = [lines[a], lines[b]];
        if comparator.larger {
            lines[a] = m.gate(CellKind::Or2, &inputs);
        }
        if comparator.smaller {
            lines[b] = m.gate(CellKind::And2, &inputs);
        }
    }
    let wire = m.wire("WIRE");
    m.gate_into(CellKind::Buf, &[lines[together - 1]], wire);
    retime(&mut m, wire);
    finished(m.finish())
}

/// Batcher's odd-even merge sort of a power of two lines, the larger to the first of each pair.
fn comparators(lines: usize) -> Vec<(usize, usize)> {
    debug_assert!(lines.is_power_of_two());
    let mut pairs = Vec::new();
    let halves =
        |from: usize| std::iter::successors(Some(from), |n| Some(n / 2)).take_while(|&n| n > 0);
    for sorted in (0..lines.trailing_zeros()).map(|bit| 1 << bit) {
        for apart in halves(sorted) {
            for from in (apart % sorted..lines - apart).step_by(2 * apart) {
                for line in from..(from + apart).min(lines - apart) {
                    if line / (2 * sorted) == (line + apart) / (2 * sorted) {
                        pairs.push((line, line + apart));
                    }
                }
            }
        }
    }
    pairs
}

/// A comparator, and which of its outputs something depends on.
struct Comparator {
    between: (usize, usize),
    larger: bool,
    smaller: bool,
}

/// The comparators that line `output` depends on.
fn needed(pairs: &[(usize, usize)], output: usize, lines: usize) -> Vec<Comparator> {
    let mut is_needed = vec![false; lines];
    is_needed[output] = true;
    let mut comparators: Vec<Comparator> = Vec::new();
    for &(a, b) in pairs.iter().rev() {
        let (larger, smaller) = (is_needed[a], is_needed[b]);
        if larger || smaller {
            is_needed[a] = true;
            is_needed[b] = true;
            comparators.push(Comparator {
                between: (a, b),
                larger,
                smaller,
            });
        }
    }
    comparators.reverse();
    comparators
}

/// Reference model of the wire on which shaped pulses meet; an OR tree's is that of one SPAD.
#[derive(Debug, Clone, PartialEq, Eq)]
pub(crate) struct Wire {
    together: usize,
    width: Time,
    /// When the pulses end that are high.
    ends: VecDeque<Time>,
}

impl Wire {
    /// A wire that is high while `together` pulses of this width overlap.
    pub(crate) fn new(together: usize, width: Time) -> Self {
        Wire {
            together,
            width,
            ends: VecDeque::new(),
        }
    }

    /// A pulse that begins at `time`, not before the last one: whether the wire rises with it.
    pub(crate) fn pulse(&mut self, time: Time) -> bool {
        while self.ends.front().is_some_and(|&end| end <= time) {
            self.ends.pop_front();
        }
        self.ends.push_back(time + self.width);
        self.ends.len() == self.together
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Zero-one principle: what sorts all words of zeros and ones sorts everything.
    #[test]
    fn the_network_sorts_and_its_pruned_parts_still_tell_each_output() {
        for lines in [1usize, 2, 4, 8, 16] {
            let pairs = comparators(lines);
            let known = [0, 1, 5, 19, 63];
            assert_eq!(pairs.len(), known[lines.trailing_zeros() as usize]);
            for output in 0..lines {
                let pruned = needed(&pairs, output, lines);
                for word in 0..1u32 << lines {
                    let mut values: Vec<bool> = (0..lines).map(|l| word >> l & 1 == 1).collect();
                    for comparator in &pruned {
                        let (a, b) = comparator.between;
                        let (high, low) = (values[a] | values[b], values[a] & values[b]);
                        values[a] = high;
                        values[b] = low;
                    }
                    assert_eq!(values[output], word.count_ones() as usize > output);
                }
            }
        }
    }

    #[test]
    fn the_wire_rises_with_the_pulse_that_makes_them_enough() {
        let ns = Time::from_ns;
        let mut wire = Wire::new(2, ns(3));
        let rises: Vec<bool> = [0, 1, 2, 4, 20, 30].map(|t| wire.pulse(ns(t))).into();
        // At 4 ns those of 0 and 1 are over and that of 2 is not.
        assert_eq!(rises, [false, true, false, true, false, false]);
    }
}
