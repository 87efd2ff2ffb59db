//! Histogram: one ripple up-counter per bin (thesis 4.2).
//!
//! ```text
//!   HIT ──────┐
//!             AND ─►[bit 0]─QN─►[bit 1]─QN─► … ─►[bit n-1]      every bit: D = QN
//!   NOT FULL ─┘        └──────────┴──── AND ──────┘ = FULL
//! ```
//!
//! `Overflow::Saturate` stops a counter at its largest value by gating its clock with FULL;
//! `Overflow::Wrap` leaves the gate out. PIXEL_CLEAR empties the counters: a clear of their own, since
//! the chip's reset would wipe the P-counters' start values with them.
//!
//! Timing: a count ripples through all bits within bits × clk-to-Q, long before the next laser cycle.

use std::sync::Arc;

use super::finished;
use crate::chip::config::{Overflow, SensorConfig};
use crate::netlist::{CellKind, Module, ModuleBuilder};

/// One bin. Ports: HIT, PIXEL_CLEAR → COUNT\<bits\>.
pub fn bin_counter(bits: usize, overflow: Overflow) -> Arc<Module> {
    let mut m = ModuleBuilder::new("bin_counter");
    let hit = m.input("HIT");
    let clear = m.input("PIXEL_CLEAR");
    let count = m.output_bus("COUNT", bits);
    let count_n = m.wire_bus("COUNT_N", bits);
    let mut clock = match overflow {
        Overflow::Wrap => hit,
        Overflow::Saturate => {
            let full = m.tree(CellKind::And2, &count);
            let not_full = m.gate(CellKind::Inv, &[full]);
            m.gate(CellKind::And2, &[hit, not_full])
        }
    };
    for bit in 0..bits {
        m.cell(
            &format!("bit_{bit}"),
            CellKind::Dffr,
            &[count_n[bit], clock, clear],
            &[count[bit], count_n[bit]],
        );
        clock = count_n[bit];
    }
    finished(m.finish())
}

/// The name of a bin's count in the histogram.
pub(crate) fn bin_name(bin: usize) -> String {
    format!("BIN_{bin}")
}

/// The histogram of a macropixel: bin 0 is the earliest CLK period.
///
/// Ports: HIT\<bins\>, PIXEL_CLEAR → the counts BIN_0\<bits\>, BIN_1\<bits\>, ….
pub fn circuit(bins: usize, bits: usize, overflow: Overflow) -> Arc<Module> {
    let counter = bin_counter(bits, overflow);
    let mut m = ModuleBuilder::new("histogram");
    let hit = m.input_bus("HIT", bins);
    m.input("PIXEL_CLEAR");
    for bin in 0..bins {
        let count = m.output_bus(&bin_name(bin), bits);
        let ports = [("HIT", &hit[bin..=bin]), ("COUNT", &count)];
        m.instance_by_names(&format!("bin_{bin}"), &counter, &ports);
    }
    finished(m.finish())
}

/// Reference model: counts of a sensor's bins after these hits of them.
pub(crate) fn counts(config: &SensorConfig, hits: impl IntoIterator<Item = u64>) -> Vec<u16> {
    let bits = config.bin_bits as u32;
    let counts = hits.into_iter().map(|n| model(n, bits, config.overflow));
    counts.collect()
}

/// Reference model: a bin's count after `hits` hits.
pub fn model(hits: u64, bits: u32, overflow: Overflow) -> u16 {
    let largest = (1u64 << bits) - 1;
    match overflow {
        Overflow::Saturate => hits.min(largest) as u16,
        Overflow::Wrap => (hits & largest) as u16,
    }
}
