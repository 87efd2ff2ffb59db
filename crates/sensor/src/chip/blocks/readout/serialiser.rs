//! Serialiser: a word of several columns, bit by bit (thesis 4.2, 4.7).
//!
//! ```text
//!   WORD of the last column, bit 0 … first column, bit n−1
//!        │                                      │
//!   0 ─ mux ─►[stage 0]─► … ─ mux ─►[stage L−1]─┴─► DATA_OUT      all muxes: WORD_LOAD ? WORD : the stage before
//! ```
//!
//! The first column leaves first, most significant bit first. Behind the last bit come zeros: a serialiser of fewer columns
//! than the others, which share WORD_LOAD, sends them until the next word.
//!
//! Timing: WORD and WORD_LOAD have to be set up when READ_CLK rises; DATA_OUT follows after clk-to-Q.

use std::sync::Arc;

use bitvec::vec::BitVec;

use crate::chip::blocks::finished;
use crate::netlist::{CellKind, Module, ModuleBuilder, Net};

/// A serialiser of `cols` columns among others of up to `most`, which may have a name of their own.
///
/// Ports: WORD\<cols × bits\> (first column first, bit 0 first), READ_CLK, READ_RESET, WORD_LOAD → DATA_OUT.
pub fn circuit(cols: usize, most: usize, bits: usize) -> Arc<Module> {
    let name = if cols == most {
        "serialiser".to_owned()
    } else {
        format!("serialiser_of_{cols}")
    };
    let length = cols * bits;
    let mut m = ModuleBuilder::new(name);
    let word = m.input_bus("WORD", length);
    let clk = m.input("READ_CLK");
    let reset = m.input("READ_RESET");
    let load = m.input("WORD_LOAD");
    let out = m.output("DATA_OUT");
    let mut before: Option<Net> = None;
    for stage in 0..length {
        let bit = word[(cols - 1 - stage / bits) * bits + stage % bits];
        let data = match before {
            None => m.gate(CellKind::And2, &[bit, load]),
            Some(before) => m.gate(CellKind::Mux2, &[before, bit, load]),
        };
        let q = if stage + 1 == length {
            out
        } else {
            m.wire(&format!("STAGE_{stage}"))
        };
        m.cell(
            &format!("stage_{stage}"),
            CellKind::Dffr,
            &[data, clk, reset],
            &[Some(q), None],
        );
        before = Some(q);
    }
    finished(m.finish())
}

/// Reference model, one READ_CLK edge at a time.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Serialiser {
    /// The bit on DATA_OUT first.
    stages: BitVec,
    bits: usize,
}

impl Serialiser {
    /// A serialiser of `cols` columns that has been reset.
    pub fn new(cols: usize, bits: usize) -> Self {
        Serialiser {
            stages: BitVec::repeat(false, cols * bits),
            bits,
        }
    }

    /// READ_RESET.
    pub fn reset(&mut self) {
        self.stages.fill(false);
    }

    /// A rising edge of READ_CLK, which takes the words of its columns if there are any (WORD_LOAD), or shifts.
    pub fn clock(&mut self, words: Option<&[u16]>) {
        self.stages.shift_start(1);
        for (col, word) in words.into_iter().flatten().enumerate() {
            for (index, bit) in (0..self.bits).rev().enumerate() {
                self.stages
                    .set(col * self.bits + index, word >> bit & 1 == 1);
            }
        }
    }

    /// DATA_OUT.
    pub fn data_out(&self) -> bool {
        self.stages[0]
    }
}
