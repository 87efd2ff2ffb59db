//! Load path: one serial pin to every P-counter's start value (thesis 4.7, Fig. 57).
//!
//! ```text
//!   COUNTER_INITS ─► shift register, cols × bits ───────────────► COUNTER_INIT_ROW
//!   LOAD_CLK ──────► bit counter ─ last bit ─►[ROW_DONE]─┐
//!                                                        AND NOT LOAD_CLK, NOT LOAD_RESET ─► WRITE ─ AND ─► MEMORY_LOAD<row>
//!                                  one-hot row token, moved by ROW_DONE's fall ──────┘
//! ```
//!
//! Bits are shifted in on rising LOAD_CLK edges, row 0 first; within a row the last column first, most
//! significant bit first. With the last bit of a row ROW_DONE goes high for one period, and in that
//! period's low half MEMORY_LOAD of the row pulses: half a period after the shift register has
//! changed and half a period before it changes again. The stream never pauses: rows × cols × bits
//! LOAD_CLK periods, and half a period more.
//!
//! LOAD_RESET (LOAD_ENABLE low, or chip reset) returns to row 0, bit 0. It closes WRITE before the token is
//! back, or row 0 would be written once more with whatever the shift register then holds.

use std::sync::Arc;

use super::finished;
use super::p_counter;
use crate::netlist::{CellKind, Module, ModuleBuilder, Net};

use CellKind::{And2, Dffr, Inv, Nor2, Or2, Xor2};

/// Deserialiser: `cols × bits` stages and the counter that knows when they are full.
///
/// Ports: COUNTER_INITS, LOAD_CLK, LOAD_RESET → COUNTER_INIT_ROW\<cols × bits\>, ROW_DONE.
pub fn deserialiser(cols: usize, bits: usize) -> Arc<Module> {
    let length = cols * bits;
    let mut m = ModuleBuilder::new("deserialiser");
    let serial = m.input("COUNTER_INITS");
    let clk = m.input("LOAD_CLK");
    let reset = m.input("LOAD_RESET");
    let row = m.output_bus("COUNTER_INIT_ROW", length);
    let done = m.output("ROW_DONE");
    for stage in 0..length {
        let data = if stage == 0 { serial } else { row[stage - 1] };
        m.cell(
            &format!("shift_{stage}"),
            Dffr,
            &[data, clk, reset],
            &[Some(row[stage]), None],
        );
    }
    let last = bit_counter(&mut m, clk, reset, length);
    m.cell("row_done", Dffr, &[last, clk, reset], &[Some(done), None]);
    finished(m.finish())
}

/// A synchronous counter modulo `length`; returns the net that is high at its last count.
pub(crate) fn bit_counter(m: &mut ModuleBuilder, clk: Net, reset: Net, length: usize) -> Net {
    let width = (usize::BITS - (length - 1).leading_zeros()).max(1) as usize;
    let count = m.wire_bus("BIT", width);
    let count_n = m.wire_bus("BIT_N", width);
    let matching: Vec<Net> = (0..width)
        .map(|b| {
            if (length - 1) >> b & 1 == 1 {
                count[b]
            } else {
                count_n[b]
            }
        })
        .collect();
    let last = m.tree(And2, &matching);
    let not_last = m.gate(Inv, &[last]);
    let mut carry: Option<Net> = None;
    for b in 0..width {
        let incremented = match carry {
            None => count_n[b],
            Some(carry) => m.gate(Xor2, &[count[b], carry]),
        };
        carry = Some(match carry {
            None => count[b],
            Some(carry) => m.gate(And2, &[count[b], carry]),
        });
        let next = m.gate(And2, &[incremented, not_last]);
        m.cell(
            &format!("bit_{b}"),
            Dffr,
            &[next, clk, reset],
            &[count[b], count_n[b]],
        );
    }
    last
}

/// Row scanner: a token that visits the rows and turns ROW_DONE into one row's MEMORY_LOAD.
///
/// Ports: ROW_DONE, LOAD_CLK, LOAD_RESET → MEMORY_LOAD\<rows\>.
pub fn row_scanner(rows: usize) -> Arc<Module> {
    let mut m = ModuleBuilder::new("row_scanner");
    let done = m.input("ROW_DONE");
    let clk = m.input("LOAD_CLK");
    let reset = m.input("LOAD_RESET");
    let load = m.output_bus("MEMORY_LOAD", rows);
    let select = m.wire_bus("SELECT", rows);
    let write = m.wire("WRITE");
    let step = m.gate(Inv, &[done]);
    let idle = m.gate(Or2, &[clk, step]);
    // A reset moves the token back to row 0 and must have closed WRITE by then.
    m.gate_into(Nor2, &[idle, reset], write);
    // Row 0 keeps its token inverted, so that a reset selects it.
    let from_last = m.gate(Inv, &[select[rows - 1]]);
    m.cell(
        "token_0",
        Dffr,
        &[from_last, step, reset],
        &[None, Some(select[0])],
    );
    for row in 1..rows {
        m.cell(
            &format!("token_{row}"),
            Dffr,
            &[select[row - 1], step, reset],
            &[Some(select[row]), None],
        );
    }
    for (&selected, &load) in select.iter().zip(&load) {
        m.gate_into(And2, &[write, selected], load);
    }
    finished(m.finish())
}

/// The instance name of a macropixel's memory in [`with_memories`].
pub fn memory_name(row: usize, col: usize) -> String {
    format!("memory_r{row}_c{col}")
}

/// The load path with nothing but the P-counters' memories behind it, for loading a whole array at
/// gate level without its pixels.
///
/// Ports: COUNTER_INITS, LOAD_CLK, LOAD_ENABLE, RESETB; instances are named by [`memory_name`].
pub fn with_memories(rows: usize, cols: usize, bits: usize) -> Arc<Module> {
    let memory = p_counter::memory(bits);
    let mut m = ModuleBuilder::new("load_path");
    m.input("COUNTER_INITS");
    m.input("LOAD_CLK");
    let enable = m.input("LOAD_ENABLE");
    let resetb = m.input("RESETB");
    let memory_reset = m.wire("MEMORY_RESET");
    m.gate_into(Inv, &[resetb], memory_reset);
    let (row_bits, load) = place(&mut m, rows, cols, bits, [enable, resetb]);
    for (row, &load) in load.iter().enumerate() {
        for col in 0..cols {
            let init = &row_bits[col * bits..][..bits];
            let ports = [("COUNTER_INIT", init), ("MEMORY_LOAD", &[load])];
            m.instance_by_names(&memory_name(row, col), &memory, &ports);
        }
    }
    finished(m.finish())
}

/// Places deserialiser and row scanner in a parent, which has declared COUNTER_INITS and LOAD_CLK; returns its
/// COUNTER_INIT_ROW and MEMORY_LOAD.
pub(super) fn place(
    m: &mut ModuleBuilder,
    rows: usize,
    cols: usize,
    bits: usize,
    [enable, resetb]: [Net; 2],
) -> (Vec<Net>, Vec<Net>) {
    let row_bits = m.wire_bus("COUNTER_INIT_ROW", cols * bits);
    let load = m.wire_bus("MEMORY_LOAD", rows);
    m.wire("ROW_DONE");
    let reset = m.wire("LOAD_RESET");
    m.gate_into(CellKind::Nand2, &[enable, resetb], reset);
    m.instance_by_names("deserialiser", &deserialiser(cols, bits), &[]);
    m.instance_by_names("row_scanner", &row_scanner(rows), &[]);
    (row_bits, load)
}

/// Reference model: the serial stream that loads `codes` (row-major, `rows × cols`), first bit first.
pub fn stream(codes: &[u16], cols: usize, bits: usize) -> bitvec::vec::BitVec {
    debug_assert_eq!(codes.len() % cols, 0);
    codes
        .chunks(cols)
        .flat_map(|row| row.iter().rev())
        .flat_map(|&code| (0..bits).rev().map(move |b| code >> b & 1 == 1))
        .collect()
}

/// Reference model: the codes that a serial stream leaves in the array, row-major.
pub fn codes(stream: &bitvec::slice::BitSlice, cols: usize, bits: usize) -> Vec<u16> {
    stream
        .chunks_exact(cols * bits)
        .flat_map(|row| {
            let of_pixel = |pixel: &bitvec::slice::BitSlice| {
                pixel.iter().fold(0, |code, bit| code << 1 | *bit as u16)
            };
            let mut codes: Vec<u16> = row.chunks_exact(bits).map(of_pixel).collect();
            codes.reverse();
            codes
        })
        .collect()
}

/// Reference model of the deserialiser, one LOAD_CLK edge at a time.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Deserialiser {
    row: bitvec::vec::BitVec,
    bit: usize,
    done: bool,
}

impl Deserialiser {
    /// A deserialiser that has been reset.
    pub fn new(cols: usize, bits: usize) -> Self {
        Deserialiser {
            row: bitvec::bitvec![0; cols * bits],
            bit: 0,
            done: false,
        }
    }

    /// LOAD_RESET.
    pub fn reset(&mut self) {
        self.row.fill(false);
        self.bit = 0;
        self.done = false;
    }

    /// A rising edge of LOAD_CLK with this COUNTER_INITS.
    pub fn clock(&mut self, serial: bool) {
        self.row.shift_end(1);
        self.row.set(0, serial);
        self.done = self.bit + 1 == self.row.len();
        self.bit = (self.bit + 1) % self.row.len();
    }

    /// COUNTER_INIT_ROW, bit 0 first.
    pub fn row(&self) -> &bitvec::slice::BitSlice {
        &self.row
    }

    /// ROW_DONE.
    pub fn row_done(&self) -> bool {
        self.done
    }
}

/// Reference model of the row scanner: the row that holds the token.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct RowScanner {
    rows: usize,
    token: usize,
    done: bool,
}

impl RowScanner {
    /// A row scanner that has been reset.
    pub fn new(rows: usize) -> Self {
        RowScanner {
            rows,
            token: 0,
            done: false,
        }
    }

    /// LOAD_RESET.
    pub fn reset(&mut self) {
        *self = RowScanner::new(self.rows);
    }

    /// ROW_DONE takes this value. Its fall hands the token on.
    pub fn row_done(&mut self, done: bool) {
        if self.done && !done {
            self.token = (self.token + 1) % self.rows;
        }
        self.done = done;
    }

    /// The row whose MEMORY_LOAD is high in this half of the LOAD_CLK period, if any.
    pub fn memory_load(&self, load_clk: bool) -> Option<usize> {
        (self.done && !load_clk).then_some(self.token)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    proptest! {
        #[test]
        fn a_stream_round_trips(rows in 1usize..6, cols in 1usize..6, bits in 2usize..12, seed: u64) {
            let codes_in: Vec<u16> = (0..rows * cols)
                .map(|i| (seed.wrapping_mul(i as u64 * 2 + 1) >> 20) as u16 & ((1 << bits) - 1))
                .collect();
            let stream = stream(&codes_in, cols, bits);
            prop_assert_eq!(stream.len(), rows * cols * bits);
            prop_assert_eq!(codes(&stream, cols, bits), codes_in);
        }

        #[test]
        fn the_models_step_by_step_leave_the_codes(rows in 1usize..6, cols in 1usize..6, bits in 2usize..12, seed: u64) {
            let stream: bitvec::vec::BitVec = (0..rows * cols * bits)
                .map(|i| seed.wrapping_mul(i as u64 * 2 + 1) >> 20 & 1 == 1)
                .collect();
            let mut deserialiser = Deserialiser::new(cols, bits);
            let mut scanner = RowScanner::new(rows);
            let mut found = vec![0; rows * cols];
            for bit in stream.iter().by_vals() {
                deserialiser.clock(bit);
                scanner.row_done(deserialiser.row_done());
                if let Some(row) = scanner.memory_load(false) {
                    for (col, code) in deserialiser.row().chunks(bits).enumerate() {
                        found[row * cols + col] = code.iter_ones().map(|b| 1u16 << b).sum();
                    }
                }
            }
            prop_assert_eq!(found, codes(&stream, cols, bits));
        }
    }
}
