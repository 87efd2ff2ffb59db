//! Bin selection: the count of one bin of a macropixel, while its row is read (thesis 4.2).
//!
//! ```text
//!   ROW_READ ────┐
//!   BIN_READ<b> ─AND─► SELECT<b> ─┐
//!                     COUNT<b>[i] ─NAND ─┐
//!                     … the next bin ────NAND ─┐
//!                     … the other pairs ───────OR ─► WORD[i]
//! ```
//!
//! While ROW_READ is low all NANDs are high, whatever the counts do, and WORD is 0. That costs nothing in the columns, and
//! nothing while photons are counted.
//!
//! Timing: AND, two NANDs and a tree of ORs from BIN_READ to WORD.

use std::sync::Arc;

use crate::chip::blocks::finished;
use crate::netlist::{CellKind, Module, ModuleBuilder, Net};

/// Ports: ROW_READ, BIN_READ\<bins\>, COUNT\<bins × bits\> (bin 0 first, bit 0 first) → WORD\<bits\>.
pub fn circuit(bins: usize, bits: usize) -> Arc<Module> {
    let mut m = ModuleBuilder::new("bin_select");
    let row_read = m.input("ROW_READ");
    let bin_read = m.input_bus("BIN_READ", bins);
    let counts = m.input_bus("COUNT", bins * bits);
    let word = m.output_bus("WORD", bits);
    let select: Vec<Net> = bin_read
        .iter()
        .map(|&bin| m.gate(CellKind::And2, &[row_read, bin]))
        .collect();
    for (bit, &word) in word.iter().enumerate() {
        let closed: Vec<Net> = (0..bins)
            .map(|bin| m.gate(CellKind::Nand2, &[select[bin], counts[bin * bits + bit]]))
            .collect();
        let mut pairs = closed.chunks(2).collect::<Vec<_>>();
        let last = pairs.pop().expect("a macropixel has a bin");
        let open = |m: &mut ModuleBuilder, pair: &[Net]| match *pair {
            [a, b] => m.gate(CellKind::Nand2, &[a, b]),
            _ => m.gate(CellKind::Inv, pair),
        };
        if pairs.is_empty() {
            let kind = match last.len() {
                2 => CellKind::Nand2,
                _ => CellKind::Inv,
            };
            m.gate_into(kind, last, word);
            continue;
        }
        let others: Vec<Net> = pairs.into_iter().map(|pair| open(&mut m, pair)).collect();
        let last = open(&mut m, last);
        let others = m.tree(CellKind::Or2, &others);
        m.gate_into(CellKind::Or2, &[others, last], word);
    }
    finished(m.finish())
}

/// Reference model: WORD for the counts of a macropixel, with ROW_READ and BIN_READ (bit b for bin b).
pub fn model(counts: &[u16], row_read: bool, bin_read: u64) -> u16 {
    let selected = |(bin, &count): (usize, &u16)| {
        if row_read && bin_read >> bin & 1 == 1 {
            count
        } else {
            0
        }
    };
    counts
        .iter()
        .enumerate()
        .map(selected)
        .fold(0, |a, b| a | b)
}
