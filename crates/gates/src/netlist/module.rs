//! Hierarchical circuit descriptions: modules of cells, nets and instances of other modules.
//!
//! A [`Module`] is made by a [`ModuleBuilder`](super::ModuleBuilder), which checks it, and never changes again.

use std::collections::HashMap;
use std::sync::Arc;

use super::cell::{CellKind, MAX_INPUTS, MAX_OUTPUTS};
use super::own_delay::OwnDelay;

/// A net of one module, local to it.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash)]
pub struct Net(pub(super) u32);

impl Net {
    /// Index into the module's nets.
    pub(crate) const fn index(self) -> usize {
        self.0 as usize
    }
}

/// Direction of a port, seen from inside the module.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Direction {
    /// Driven from outside.
    Input,
    /// Driven by the module.
    Output,
}

/// A named net, or a named bus of consecutive nets (bit 0 first).
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Signal {
    /// Name, a plain Verilog identifier.
    pub name: String,
    pub(super) first: u32,
    pub(super) width: u32,
    /// Whether it is declared as a vector (a bus may be one bit wide).
    pub is_bus: bool,
    /// Whether the name was given by the designer (and not by the builder).
    pub is_named: bool,
}

impl Signal {
    /// Its nets, bit 0 first.
    pub fn nets(&self) -> impl ExactSizeIterator<Item = Net> + DoubleEndedIterator + use<> {
        (self.first..self.first + self.width).map(Net)
    }

    /// Number of bits.
    pub fn width(&self) -> usize {
        self.width as usize
    }
}

/// A port: a signal of the module and its direction.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Port {
    /// Index into [`Module::signals`].
    pub signal: usize,
    /// Who drives it.
    pub direction: Direction,
}

/// One leaf cell.
#[derive(Debug, Clone, PartialEq)]
pub struct Cell {
    /// Instance name.
    pub name: String,
    /// Which cell of the library.
    pub kind: CellKind,
    /// Input nets in pin order; the kind's pins are all connected, and those that it does not have are none.
    pub inputs: [Option<Net>; MAX_INPUTS],
    /// Output nets in pin order.
    pub outputs: [Option<Net>; MAX_OUTPUTS],
    /// A delay that is the cell's own, instead of the library's.
    pub own_delay: Option<OwnDelay>,
}

/// One instance of another module.
#[derive(Debug, Clone)]
pub struct Instance {
    /// Instance name.
    pub name: String,
    /// What is instantiated.
    pub module: Arc<Module>,
    /// The parent's nets for every port bit of the child: ports in order, bit 0 first.
    pub connections: Vec<Option<Net>>,
}

/// A finished circuit description.
#[derive(Debug, Clone)]
pub struct Module {
    pub(super) name: String,
    pub(super) signals: Vec<Signal>,
    pub(super) ports: Vec<Port>,
    pub(super) net_count: u32,
    pub(super) cells: Vec<Cell>,
    pub(super) instances: Vec<Instance>,
    pub(super) names: Names,
}

/// Where what has a name is, so that nothing is searched for: a module is described once, however often it is
/// instantiated, and so are its names.
#[derive(Debug, Clone, Default)]
pub(super) struct Names {
    signals: HashMap<String, u32>,
    cells: HashMap<String, u32>,
    /// How many scopes after its parent's each instance's scope comes, in depth-first order.
    instances: HashMap<String, u32>,
}

impl Module {
    /// The same module by another name.
    pub fn renamed(&self, name: &str) -> Arc<Self> {
        Arc::new(Module {
            name: name.to_owned(),
            ..self.clone()
        })
    }
}

impl Names {
    /// The names of a complete module.
    pub(crate) fn new(module: &Module) -> Self {
        let index = |i: usize| i as u32;
        let mut scopes = 1;
        let mut instances = HashMap::with_capacity(module.instances.len());
        for instance in &module.instances {
            instances.insert(instance.name.clone(), index(scopes));
            scopes += instance.module.total_scopes();
        }
        let signals = module.signals.iter().enumerate();
        let cells = module.cells.iter().enumerate();
        Names {
            signals: signals.map(|(i, s)| (s.name.clone(), index(i))).collect(),
            cells: cells.map(|(i, c)| (c.name.clone(), index(i))).collect(),
            instances,
        }
    }
}

impl Module {
    /// Name, unique in a design.
    pub fn name(&self) -> &str {
        &self.name
    }

    /// All signals, in order of declaration.
    pub fn signals(&self) -> &[Signal] {
        &self.signals
    }

    /// Ports in order of declaration.
    pub fn ports(&self) -> &[Port] {
        &self.ports
    }

    /// Leaf cells directly in this module.
    pub fn cells(&self) -> &[Cell] {
        &self.cells
    }

    /// Instances directly in this module.
    pub fn instances(&self) -> &[Instance] {
        &self.instances
    }

    /// Number of nets directly in this module.
    pub fn net_count(&self) -> usize {
        self.net_count as usize
    }

    /// Ports with their signals.
    pub fn port_signals(&self) -> impl Iterator<Item = (Direction, &Signal)> {
        self.ports
            .iter()
            .map(|p| (p.direction, &self.signals[p.signal]))
    }

    /// The signal of this name.
    pub fn signal(&self, name: &str) -> Option<&Signal> {
        let index = *self.names.signals.get(name)?;
        Some(&self.signals[index as usize])
    }

    /// Index of the leaf cell of this name directly in this module.
    pub fn cell(&self, name: &str) -> Option<usize> {
        self.names.cells.get(name).map(|&index| index as usize)
    }

    /// How many scopes after this module's the one of its instance `name` comes in an elaborated design.
    pub(crate) fn scope_offset(&self, name: &str) -> Option<usize> {
        let offset = self.names.instances.get(name)?;
        Some(*offset as usize)
    }

    /// This module and every instance below it.
    pub(crate) fn total_scopes(&self) -> usize {
        let below = self.instances.iter().map(|i| i.module.total_scopes());
        1 + below.sum::<usize>()
    }

    /// Transistors in this module and everything below it.
    pub fn transistors(&self) -> u64 {
        let own: u64 = self.cells.iter().map(|c| c.kind.transistors() as u64).sum();
        let below: u64 = self.instances.iter().map(|i| i.module.transistors()).sum();
        own + below
    }

    /// Layout area of this module and everything below it, as [`CellKind::area`] counts it.
    pub fn area(&self) -> u64 {
        let own: u64 = self.cells.iter().map(|c| c.kind.area() as u64).sum();
        let below: u64 = self.instances.iter().map(|i| i.module.area()).sum();
        own + below
    }

    /// Leaf cells in this module and everything below it.
    pub fn total_cells(&self) -> usize {
        self.cells.len()
            + self
                .instances
                .iter()
                .map(|i| i.module.total_cells())
                .sum::<usize>()
    }
}

#[cfg(test)]
mod tests {
    use crate::netlist::{CellKind, ModuleBuilder};

    #[test]
    fn a_module_is_as_large_as_its_cells_and_what_is_below() {
        let mut m = ModuleBuilder::new("leaf");
        let (a, z) = (m.input("A"), m.output("Z"));
        m.gate_into(CellKind::Inv, &[a], z);
        let q = m.wire("q");
        m.cell("ff", CellKind::Dffr, &[z, a, a], &[Some(q), None]);
        let leaf = m.finish().expect("a leaf");
        let areas = |area: fn(CellKind) -> u32| {
            [CellKind::Inv, CellKind::Dffr, CellKind::Xor2].map(|kind| u64::from(area(kind)))
        };
        let ([inv, ff, xor], [inv_fets, ff_fets, xor_fets]) =
            (areas(CellKind::area), areas(CellKind::transistors));
        assert_eq!(
            (leaf.area(), leaf.transistors()),
            (inv + ff, inv_fets + ff_fets)
        );
        let mut m = ModuleBuilder::new("top");
        let (a, z) = (m.input("A"), m.output("Z"));
        for name in ["one", "two"] {
            let below = m.wire(name);
            m.instance(&format!("u_{name}"), &leaf, &[("A", &[a]), ("Z", &[below])]);
        }
        m.gate_into(CellKind::Xor2, &[a, a], z);
        let top = m.finish().expect("a top");
        assert_eq!(top.area(), 2 * (inv + ff) + xor);
        assert_eq!(top.transistors(), 2 * (inv_fets + ff_fets) + xor_fets);
        let ports: Vec<_> = top
            .port_signals()
            .map(|(_, signal)| signal.name.as_str())
            .collect();
        assert_eq!((ports, top.ports().len()), (vec!["A", "Z"], 2));
    }
}
