//! Histogram of a counter TDC: bins to which several events are added at once (thesis 4.9.3; `metdc_counter`).
//!
//! ```text
//!   each bin:  [COUNT] ─► AND ◄─ SELECTED<bin> ─► CHOSEN ─► OR of all bins ─► + EVENTS ─► NEXT ─┐
//!                 ▲                                                 └─ carry ─► OR ┘  Overflow::Saturate: all ones
//!                 └── mux ◄─ SELECTED<bin>: NEXT, or what it was ◄──────────────────────────────┘   clocked by CLK
//! ```
//!
//! A ripple counter, as `histogram` has it, counts one edge at a time. Here one adder serves all bins, because one is selected at a time.
//! With [`Overflow::Wrap`] the carry has no part in NEXT.
//!
//! Timing: a carry ripples through all bits between two rising CLK edges; that is the slowest path of the macropixel.

use std::sync::Arc;

use super::finished;
use super::histogram::bin_name;
use crate::chip::config::Overflow;
use crate::netlist::{CellKind, Module, ModuleBuilder, Net};

/// Bits for which a buffer of SELECTED is strong enough in the cells of libraries.
const BITS_OF_A_BUFFER: usize = 4;

/// One bin. Ports: CLK, SELECTED, NEXT\<bits\>, PIXEL_CLEAR → COUNT\<bits\>, and CHOSEN\<bits\>, which is COUNT while it is selected.
fn bin_register(bits: usize) -> Arc<Module> {
    let mut m = ModuleBuilder::new("bin_register");
    let clk = m.input("CLK");
    let select = m.input("SELECTED");
    let next = m.input_bus("NEXT", bits);
    let clear = m.input("PIXEL_CLEAR");
    let count = m.output_bus("COUNT", bits);
    let chosen = m.output_bus("CHOSEN", bits);
    let mut enable = select;
    for bit in 0..bits {
        if bit % BITS_OF_A_BUFFER == 0 {
            enable = m.gate(CellKind::Buf, &[select]);
        }
        m.gate_into(CellKind::And2, &[count[bit], enable], chosen[bit]);
        let data = m.gate(CellKind::Mux2, &[count[bit], next[bit], enable]);
        m.cell(
            &format!("bit_{bit}"),
            CellKind::Dffr,
            &[data, clk, clear],
            &[Some(count[bit]), None],
        );
    }
    finished(m.finish())
}

/// The histogram of a macropixel.
///
/// Ports: CLK, SELECTED\<bins\>, EVENTS\<event bits\>, PIXEL_CLEAR → the counts BIN_0\<bits\>, BIN_1\<bits\>, ….
pub fn circuit(bins: usize, bits: usize, event_bits: usize, overflow: Overflow) -> Arc<Module> {
    let register = bin_register(bits);
    let mut m = ModuleBuilder::new("histogram");
    m.input("CLK");
    let select = m.input_bus("SELECTED", bins);
    let events = m.input_bus("EVENTS", event_bits);
    m.input("PIXEL_CLEAR");
    let counts: Vec<Vec<Net>> = (0..bins)
        .map(|bin| m.output_bus(&bin_name(bin), bits))
        .collect();
    let next = m.wire_bus("NEXT", bits);
    let chosen: Vec<Vec<Net>> = (0..bins)
        .map(|bin| m.wire_bus(&format!("CHOSEN_{bin}"), bits))
        .collect();

    let mut carry = None;
    let mut sums = Vec::new();
    for bit in 0..bits {
        let of_bins: Vec<Net> = chosen.iter().map(|chosen| chosen[bit]).collect();
        let now = m.tree(CellKind::Or2, &of_bins);
        let addends = events.get(bit).copied().into_iter().chain(carry);
        let addends: Vec<Net> = addends.collect();
        let (sum, carrying) = match addends[..] {
            [one] => {
                let sum = m.gate(CellKind::Xor2, &[now, one]);
                (sum, (CellKind::And2, vec![now, one]))
            }
            [event, carry] => {
                let half = m.gate(CellKind::Xor2, &[now, event]);
                let sum = m.gate(CellKind::Xor2, &[half, carry]);
                (sum, (CellKind::Mux2, vec![now, carry, half]))
            }
            _ => unreachable!("the first bit has an event, and later ones a carry"),
        };
        sums.push(sum);
        let is_used = bit + 1 < bits || overflow == Overflow::Saturate;
        carry = is_used.then(|| m.gate(carrying.0, &carrying.1));
    }
    // Events that have no bit of their own in a bin overflow it, too.
    let beyond: Vec<Net> = events.iter().skip(bits).copied().chain(carry).collect();
    let overflows = (overflow == Overflow::Saturate).then(|| m.tree(CellKind::Or2, &beyond));
    for (&sum, &next) in sums.iter().zip(&next) {
        match overflows {
            Some(overflows) => m.gate_into(CellKind::Or2, &[sum, overflows], next),
            None => m.gate_into(CellKind::Buf, &[sum], next),
        };
    }
    for (bin, count) in counts.iter().enumerate() {
        let ports = [
            ("SELECTED", &select[bin..=bin]),
            ("COUNT", &count[..]),
            ("CHOSEN", &chosen[bin][..]),
        ];
        m.instance_by_names(&format!("bin_{bin}"), &register, &ports);
    }
    finished(m.finish())
}
