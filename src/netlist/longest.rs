//! The longest combinational path through a module, by adding up the slowest arc of every cell.

use std::sync::Arc;

use super::flat::Netlist;
use super::library::{Corner, Library};
use super::module::Module;
use crate::logic::Logic;
use crate::units::Time;

/// The longest delay from any input of a purely combinational module to any of its nets, taking the
/// slower of rise and fall everywhere (an upper bound: one path may not be able to use both).
///
/// # Panics
/// When the module holds flip-flops or a combinational loop.
pub fn longest_path(module: &Arc<Module>, library: &Library, corner: Corner) -> Time {
    let netlist = Netlist::elaborate(module);
    let cells = netlist.cells();
    let mut arrival = vec![None; netlist.net_count()];
    for net in netlist.inputs() {
        arrival[net.index()] = Some(Time::ZERO);
    }
    let mut waiting: Vec<usize> = (0..cells.len()).collect();
    while !waiting.is_empty() {
        let before = waiting.len();
        waiting.retain(|&index| {
            let cell = &cells[index];
            assert!(
                !cell.kind.is_flip_flop(),
                "a flip-flop is not combinational"
            );
            let slowest = (0..cell.kind.inputs().len())
                .map(|pin| {
                    let delay = |to| library.delay(cell.kind, pin, to, corner);
                    let worst = delay(Logic::One).max(delay(Logic::Zero));
                    arrival[cell.inputs[pin].index()].map(|t: Time| t + worst)
                })
                .collect::<Option<Vec<Time>>>()
                .and_then(|times| times.into_iter().max());
            if let Some(time) = slowest {
                arrival[cell.outputs[0].index()] = Some(time);
            }
            slowest.is_none()
        });
        assert!(waiting.len() < before, "a combinational loop");
    }
    arrival.into_iter().flatten().max().unwrap_or(Time::ZERO)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::netlist::{CellKind, ModuleBuilder};

    #[test]
    fn a_chain_adds_up() {
        let mut m = ModuleBuilder::new("chain");
        let mut net = m.input("A");
        for _ in 0..5 {
            net = m.gate(CellKind::Buf, &[net]);
        }
        let library = Library::default();
        let one = library.delay(CellKind::Buf, 0, Logic::One, Corner::Typ);
        let path = longest_path(&m.finish().unwrap(), &library, Corner::Typ);
        assert_eq!(path, one * 5);
    }
}
