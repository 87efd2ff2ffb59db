//! Correlation block: the SPADs of a macropixel to one event, by TYPE and THRESHOLD (thesis 4.2, Fig. 47).
//!
//! ```text
//!   SPAD_TIMED<n> ─► population count ─COUNT<b>─► compare with THRESHOLD<b> ─┬ less ────┐
//!                                                                            ├ equal ───┤ mux ─► SPAD_EVENT
//!                                                         TYPE<2> selects:   └ greater ─┘
//! ```
//!
//! TYPE 0 is *less*, 1 *equal*, 2 or 3 *greater*. TYPE = less is true of an empty pixel as well and then
//! gives an event in every CLK period.
//!
//! Timing: combinational between two rising CLK edges. Counting is a carry-save tree of full adders,
//! comparing a ripple from the most significant bit.

use std::sync::Arc;

use super::finished;
use crate::chip::config::EventType;
use crate::netlist::{CellKind, Module, ModuleBuilder, Net};
use crate::photon::count_bits;

use CellKind::{And2, Inv, Mux2, Nor2, Or2, Xnor2, Xor2};

/// The correlation block of `spads` SPADs, at least 1.
///
/// Ports: SPAD_TIMED\<SPADs\>, TYPE\<2\>, THRESHOLD\<bits\> → SPAD_EVENT.
pub fn circuit(spads: usize) -> Arc<Module> {
    let bits = count_bits(spads);
    let mut m = ModuleBuilder::new("correlation");
    let timed = m.input_bus("SPAD_TIMED", spads);
    let event_type = m.input_bus("TYPE", 2);
    let threshold = m.input_bus("THRESHOLD", bits);
    let event = m.output("SPAD_EVENT");
    let count = m.wire_bus("COUNT", bits);
    population_count(&mut m, &timed, &count);

    let mut greater: Option<Net> = None;
    let mut same = Vec::new();
    for bit in 0..bits {
        let agrees = m.gate(Xnor2, &[count[bit], threshold[bit]]);
        let lower = m.gate(Inv, &[threshold[bit]]);
        let above = m.gate(And2, &[count[bit], lower]);
        greater = Some(match greater {
            None => above,
            Some(below) => {
                let carried = m.gate(And2, &[agrees, below]);
                m.gate(Or2, &[above, carried])
            }
        });
        same.push(agrees);
    }
    let greater = greater.expect("a threshold has bits");
    let equal = m.tree(And2, &same);
    let less = m.gate(Nor2, &[equal, greater]);
    let not_greater = m.gate(Mux2, &[less, equal, event_type[0]]);
    m.gate_into(Mux2, &[not_greater, greater, event_type[1]], event);
    finished(m.finish())
}

/// Adds up single bits in carry-save form until one bit of each weight is left.
pub(super) fn population_count(m: &mut ModuleBuilder, bits: &[Net], sum: &[Net]) {
    let mut column = bits.to_vec();
    for (weight, &out) in sum.iter().enumerate() {
        let mut carries = Vec::new();
        let mut next = 0;
        // First in, first out keeps the tree balanced.
        while column.len() - next >= 3 {
            let (a, b, c) = (column[next], column[next + 1], column[next + 2]);
            next += 3;
            let half = m.gate(Xor2, &[a, b]);
            column.push(m.gate(Xor2, &[half, c]));
            carries.push(m.gate(Mux2, &[a, c, half]));
        }
        if column.len() - next == 2 {
            let (a, b) = (column[next], column[next + 1]);
            m.gate_into(Xor2, &[a, b], out);
            carries.push(m.gate(And2, &[a, b]));
        } else {
            m.cell(
                &format!("sum_{weight}"),
                CellKind::Buf,
                &column[next..],
                &[out],
            );
        }
        column = carries;
    }
}

/// Reference model: whether SPAD_TIMED meets the condition.
pub fn model(spad_timed: u64, event_type: EventType, threshold: u8) -> bool {
    let count = spad_timed.count_ones();
    let threshold = threshold as u32;
    match event_type {
        EventType::Less => count < threshold,
        EventType::Equal => count == threshold,
        EventType::Greater => count > threshold,
    }
}
