//! Whether a bin may take itself for full on the way to a count that is not.
//!
//! ```text
//!   COUNT 0111 → 1000        bits fall one after the other, then one rises:
//!     BIT<k-1> ▔▔╲▁▁▁▁ ─► tree ─╴latest fall ──┐
//!     BIT<k>   ▁▁▁▁╱▔▔ ─► tree ─╴earliest rise ┴► AND: both high for a moment if the rise overtakes the fall
//! ```
//!
//! Such a moment would gate the bin's clock off and on again: a count too many. It can only come once the upper bits
//! stand, above half of what a bin holds.

use super::delays::Anatomy;
use crate::chip::{Overflow, SensorConfig, sensor};
use crate::logic::Logic::One;
use crate::netlist::{CellKind, Edge, NetId, StaticTiming, Timing};
use crate::units::Time;

/// Whether any of these counts went where a bin's delays matter.
pub fn matters(config: &SensorConfig, counts: &[u16]) -> bool {
    let half = 1 << (config.bin_bits - 1);
    config.overflow == Overflow::Saturate && counts.iter().any(|&count| count >= half)
}

/// Whether in every bin of the macropixel with this timing falls reach each gate of the tree before rises do.
pub fn is_safe(config: &SensorConfig, anatomy: &Anatomy, timing: &Timing) -> bool {
    let netlist = &anatomy.netlist;
    let analysis = StaticTiming::new(netlist, timing);
    let pixel = sensor::pixel_name(0, 0);
    (0..config.bins).all(|bin| {
        let path = format!("{pixel}.histogram.bin_{bin}");
        let scope = netlist.scope(&path).expect("every bin has a counter");
        let bits = netlist.signal(&format!("{path}.COUNT"));
        let bits = bits.expect("a bin counts");
        let cells = || {
            netlist
                .cells_of(scope)
                .map(|cell| (cell, netlist.cells()[cell]))
        };
        let clock_to_q = cells().filter(|(_, leaf)| leaf.kind.is_flip_flop());
        let clock_to_q = clock_to_q.map(|(cell, _)| timing.of(cell)[1].to(One));
        let apart = Time::from_fs(clock_to_q.min().expect("a count has bits").into());
        // The tree ends at its inverter, behind which comes the clock.
        let inverter = cells().find(|(_, leaf)| leaf.kind == CellKind::Inv);
        let end = inverter.expect("FULL is inverted").1.outputs[0];
        let starts: Vec<(NetId, Edge)> = bits
            .iter()
            .flat_map(|&bit| Edge::BOTH.map(|edge| (bit, edge)))
            .collect();
        let arrivals = analysis.arrivals(&starts, &[end]).expect("a tree");
        let window = |net, edge| arrivals.edge_window(net, edge).expect("behind a bit");
        let keeps = |fall: NetId, rise: NetId| {
            window(fall, Edge::Fall).1 < window(rise, Edge::Rise).0 + apart
        };
        let mut gates = cells().filter(|(_, leaf)| leaf.kind == CellKind::And2);
        gates.all(|(_, leaf)| {
            let [a, b, ..] = leaf.inputs;
            leaf.inputs[..2].contains(&end) || (keeps(a, b) && keeps(b, a))
        })
    })
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::netlist::{Corner, Library};

    #[test]
    fn a_tree_of_equal_gates_is_safe_and_one_slow_gate_spoils_it() {
        let config = SensorConfig::default();
        let anatomy = Anatomy::new(&config);
        let mut timing = Timing::nominal(&anatomy.netlist, &Library::default(), Corner::Typ);
        assert!(is_safe(&config, &anatomy, &timing));
        let counter = format!("{}.histogram.bin_3", sensor::pixel_name(0, 0));
        let bits = anatomy.netlist.signal(&format!("{counter}.COUNT")).unwrap();
        let mut cells = anatomy.netlist.cells().iter();
        let gate = cells
            .position(|leaf| leaf.inputs[..2] == bits[2..4])
            .unwrap();
        let mut delays = *timing.of(gate);
        delays.iter_mut().for_each(|arc| arc.fall_fs *= 4);
        timing.set(gate, delays);
        assert!(!is_safe(&config, &anatomy, &timing));
    }

    #[test]
    fn only_counts_above_half_matter() {
        let config = SensorConfig::default();
        assert!(!matters(&config, &[0, 8191]));
        assert!(matters(&config, &[0, 8192]));
        let overflow = Overflow::Wrap;
        assert!(!matters(&SensorConfig { overflow, ..config }, &[16383]));
    }
}
