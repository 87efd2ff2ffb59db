//! METDC with a counter: HSLIDAR's clocked mode (thesis 4.9.3, 2.4.3, Table 10).
//!
//! ```text
//!   LOCAL_STOP ─► mux, buffer ─STROBE─►[START]     D is NOT PIXEL_CLEAR; reset as HIT is in `metdc`
//!                                         ▼
//!                                    [COUNTING]    clocked by CLK, as is CODE
//!                                         │
//!                     ┌────── + 1 ◄───────┤ CODE is 0 while COUNTING is low, and stops at M
//!                     └─►[CODE<b>]─► decoder ─► SELECTED<0>, SELECTED<1>, … SELECTED<M-1>
//!
//!   SPAD_TIMED<n> ─► population count ─► EVENTS<c>                       (adder)
//! ```
//!
//! CODE counts CLK periods from LOCAL_STOP on. A photon's time is the CODE of the period in which it comes, and the decoder turns it into
//! the bin to which `histogram_sums` adds the period's EVENTS. Bin 0 is the first whole CLK period after LOCAL_STOP.
//!
//! # What is chosen
//!
//! The thesis says that a counter TDC clocked by CLK times photons, that a bin is one CLK period (4.9.3), and that the macropixel has a
//! multi-event TDC (4.9), which times every event of a laser cycle instead of the first (2.4.3, Fig. 25). The text that we have lacks the
//! paragraph of 2.4.3 on counters. These are our choices:
//!
//! * **Several events in one bin and laser cycle all count.** A TDC that keeps one of them would miss events, which is what multi-event TDCs
//!   and synchronous summation avoid (2.4.1: *without missing a count*). The shift register of `metdc` counts one, and delay
//!   lines count an odd number of them as one.
//! * EVENTS is the number of SPADs that fired in the CLK period, which is the synchronous summation of Fig. 22d. TYPE and THRESHOLD have
//!   nothing to compare. Two photons of one SPAD within a CLK period still cancel, in its toggle flip-flop.
//! * LOCAL_STOP opens the window. A shift register remembers the CLK periods before it; a counter cannot. So windows of the same
//!   start value lie later than the QuantIC4x4's, by a window and one CLK period.
//! * The next laser cycle's COUNTER_RESET ends a window that is still open.
//!
//! Timing: START must keep setup and hold of COUNTING's CLK edge, and be low for one CLK edge after STOP. Everything else lies between two
//! rising CLK edges.

use std::sync::Arc;

use super::{correlation, finished, metdc};
use crate::netlist::{CellKind, Module, ModuleBuilder, Net};
use crate::photon::count_bits;

/// Bits of CODE, which counts to `bins`.
const fn code_bits(bins: usize) -> usize {
    (usize::BITS - bins.leading_zeros()) as usize
}

/// A METDC of `bins` bins.
///
/// Ports: CLK, LOCAL_STOP, STOP, STOP_D, COUNTER_RESET, CONVENTIONAL, PIXEL_CLEAR → SELECTED\<bins\> (bin 0 = earliest).
pub fn circuit(bins: usize) -> Arc<Module> {
    let mut m = ModuleBuilder::new("metdc");
    let clk = m.input("CLK");
    let strobe_inputs = metdc::StrobeInputs::declare(&mut m);
    let clear = m.input("PIXEL_CLEAR");
    let select = m.output_bus("SELECTED", bins);
    let strobe = m.wire("STROBE");
    let start = m.wire("START");
    let counting = m.wire("COUNTING");
    let code = m.wire_bus("CODE", code_bits(bins));
    let code_n = m.wire_bus("CODE_N", code_bits(bins));

    let start_reset = strobe_inputs.place(&mut m, strobe);
    // High whenever a strobe comes: the library has no constants.
    let counts = m.gate(CellKind::Inv, &[clear]);
    m.cell(
        "start",
        CellKind::Dffr,
        &[counts, strobe, start_reset],
        &[Some(start), None],
    );
    m.cell(
        "counting",
        CellKind::Dffr,
        &[start, clk, clear],
        &[Some(counting), None],
    );
    // The bits of a number, each as it must be.
    let is_code = |number: usize| -> Vec<Net> {
        let bits = code.iter().zip(&code_n).enumerate();
        let bits = bits.map(|(bit, (&one, &zero))| if number >> bit & 1 == 1 { one } else { zero });
        bits.collect()
    };
    let is_over = m.tree(CellKind::And2, &is_code(bins));
    let mut carry = m.gate(CellKind::Inv, &[is_over]);
    for (bit, &now) in code.iter().enumerate() {
        let next = m.gate(CellKind::Xor2, &[now, carry]);
        let next = m.gate(CellKind::And2, &[next, counting]);
        if bit + 1 < code.len() {
            carry = m.gate(CellKind::And2, &[now, carry]);
        }
        m.cell(
            &format!("code_{bit}"),
            CellKind::Dffr,
            &[next, clk, clear],
            &[now, code_n[bit]],
        );
    }
    for (bin, &select) in select.iter().enumerate() {
        let is_bin = m.tree(CellKind::And2, &is_code(bin));
        m.gate_into(CellKind::And2, &[is_bin, counting], select);
    }
    finished(m.finish())
}

/// The number of lines of SPAD_TIMED that are high.
///
/// Ports: SPAD_TIMED\<lines\> → EVENTS\<bits\>.
pub fn adder(lines: usize) -> Arc<Module> {
    let mut m = ModuleBuilder::new("adder");
    let timed = m.input_bus("SPAD_TIMED", lines);
    let events = m.output_bus("EVENTS", count_bits(lines));
    correlation::population_count(&mut m, &timed, &events);
    finished(m.finish())
}

/// Reference model: what CLK edges make of START.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct MetdcCounterModel {
    counting: bool,
    code: usize,
    bins: usize,
}

impl MetdcCounterModel {
    /// A METDC of `bins` bins after PIXEL_CLEAR.
    pub fn new(bins: usize) -> Self {
        MetdcCounterModel {
            counting: false,
            code: 0,
            bins,
        }
    }

    /// A rising edge of CLK that finds START like this.
    pub fn clock(&mut self, start: bool) {
        self.code = if self.counting {
            (self.code + 1).min(self.bins)
        } else {
            0
        };
        self.counting = start;
    }

    /// The bin to which the present CLK period's events are added, if to any.
    pub fn selected(&self) -> Option<usize> {
        (self.counting && self.code < self.bins).then_some(self.code)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn start_selects_every_bin_once_and_low_start_makes_ready_for_the_next_window() {
        let mut model = MetdcCounterModel::new(3);
        let mut clocked = |start| {
            model.clock(start);
            model.selected()
        };
        let starts = [true, true, true, true, true, false, true, true, false, true];
        let found = starts.map(&mut clocked);
        let [a, b, c] = [0, 1, 2].map(Some);
        assert_eq!(found, [a, b, c, None, None, None, a, b, None, a]);
    }
}
