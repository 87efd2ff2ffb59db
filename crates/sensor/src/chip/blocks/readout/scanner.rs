//! Readout scanner: which bin of which row is on the columns, and when the serialisers take it (thesis 4.2).
//!
//! ```text
//!   READ_CLK ─► bit counter ─ last bit ─►[BUSY]─QN─► WORD_LOAD ─┬─► serialisers
//!                                                               ├─► one-hot bin token, a step a word ─► BIN_READ
//!                                       AND last bin ───────────┴─► one-hot row token, a step a row ─ AND ─► ROW_READ
//!                                                                                       READ_ENABLE ──┘
//! ```
//!
//! After a reset WORD_LOAD is high: the first READ_CLK edge takes row 0, bin 0, whose bits follow without a pause, and the
//! edge moves the tokens on to what is taken a word later. So a word has all the periods of the one before it to settle.
//!
//! Timing: everything is clocked by READ_CLK's rise. The tokens change with the edge that takes the word they select; what
//! they change arrives through four cells or more, long after the serialisers' hold time.

use std::sync::Arc;

use crate::chip::blocks::finished;
use crate::chip::blocks::load_path::bit_counter;
use crate::netlist::{CellKind, Module, ModuleBuilder, Net};

use CellKind::{And2, Dffr, Inv, Mux2};

/// Ports: READ_CLK, READ_ENABLE, READ_RESET → ROW_READ\<rows\>, BIN_READ\<bins\>, WORD_LOAD. A word has `word_periods` bits.
pub fn circuit(rows: usize, bins: usize, word_periods: usize) -> Arc<Module> {
    let mut m = ModuleBuilder::new("readout_scanner");
    let clk = m.input("READ_CLK");
    let enable = m.input("READ_ENABLE");
    let reset = m.input("READ_RESET");
    let row_read = m.output_bus("ROW_READ", rows);
    let bin_read = m.output_bus("BIN_READ", bins);
    let load = m.output("WORD_LOAD");
    let row = m.wire_bus("ROW", rows);
    let last = bit_counter(&mut m, clk, reset, word_periods);
    let not_last = m.gate(Inv, &[last]);
    m.cell("busy", Dffr, &[not_last, clk, reset], &[None, Some(load)]);
    token(&mut m, "bin", &bin_read, load, [clk, reset]);
    let next_row = m.gate(And2, &[load, bin_read[bins - 1]]);
    token(&mut m, "row", &row, next_row, [clk, reset]);
    for (&row, &read) in row.iter().zip(&row_read) {
        m.gate_into(And2, &[row, enable], read);
    }
    finished(m.finish())
}

/// A token that a clock edge moves from one of `nets` to the next while `step` is high; a reset puts it on the first, whose
/// flip-flop keeps it inverted.
fn token(m: &mut ModuleBuilder, name: &str, nets: &[Net], step: Net, [clk, reset]: [Net; 2]) {
    let first_n = m.wire(&format!("{}_0_N", name.to_uppercase()));
    let from_last = m.gate(Inv, &nets[nets.len() - 1..]);
    for (index, &net) in nets.iter().enumerate() {
        let (own, before) = match index {
            0 => (first_n, from_last),
            _ => (net, nets[index - 1]),
        };
        let next = m.gate(Mux2, &[own, before, step]);
        let outputs = match index {
            0 => [first_n, net].map(Some),
            _ => [Some(net), None],
        };
        m.cell(
            &format!("{name}_{index}"),
            Dffr,
            &[next, clk, reset],
            &outputs,
        );
    }
}

/// Reference model, one READ_CLK edge at a time.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Scanner {
    rows: usize,
    bins: usize,
    word_periods: usize,
    bit: usize,
    bin: usize,
    row: usize,
}

impl Scanner {
    /// A scanner that has been reset.
    pub fn new(rows: usize, bins: usize, word_periods: usize) -> Self {
        Scanner {
            rows,
            bins,
            word_periods,
            bit: 0,
            bin: 0,
            row: 0,
        }
    }

    /// READ_RESET.
    pub fn reset(&mut self) {
        *self = Scanner::new(self.rows, self.bins, self.word_periods);
    }

    /// A rising edge of READ_CLK.
    pub fn clock(&mut self) {
        if self.word_load() {
            self.bin = (self.bin + 1) % self.bins;
            if self.bin == 0 {
                self.row = (self.row + 1) % self.rows;
            }
        }
        self.bit = (self.bit + 1) % self.word_periods;
    }

    /// WORD_LOAD.
    pub fn word_load(&self) -> bool {
        self.bit == 0
    }

    /// Row and bin on the columns while READ_ENABLE is high.
    pub fn selected(&self) -> (usize, usize) {
        (self.row, self.bin)
    }
}
