//! The flat netlist: every cell and net of the elaborated chip in plain arrays.
//!
//! Hierarchy survives as a list of [`Scope`]s in depth-first order, each with a map from its
//! module's local nets to the chip's nets. Names are stored in the modules alone: a path is followed from module to
//! module, one hash look-up for each name in it.

use std::sync::Arc;

use super::cell::{CellKind, MAX_INPUTS, MAX_OUTPUTS};
use super::id::{CellId, NetId, ScopeId};
use super::module::{Direction, Module, Net};
use super::own_delay::OwnDelay;

/// A leaf cell of the elaborated chip.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct FlatCell {
    /// Which cell of the library.
    pub kind: CellKind,
    /// Input nets in pin order; the kind's pins are all connected, and those that it does not have are none.
    pub inputs: [Option<NetId>; MAX_INPUTS],
    /// Output nets in pin order.
    pub outputs: [Option<NetId>; MAX_OUTPUTS],
}

impl FlatCell {
    /// The net at an input pin.
    ///
    /// # Panics
    /// When the cell's kind has no such pin.
    #[inline]
    pub fn input(&self, pin: usize) -> NetId {
        self.inputs[pin].expect("a pin of the cell")
    }

    /// Input nets in pin order.
    pub fn input_nets(&self) -> impl Iterator<Item = NetId> + use<> {
        self.inputs.into_iter().flatten()
    }

    /// Output nets in pin order, without those that are open.
    pub fn output_nets(&self) -> impl Iterator<Item = NetId> + use<> {
        self.outputs.into_iter().flatten()
    }
}

/// One instance in the hierarchy.
#[derive(Debug, Clone)]
pub struct Scope {
    /// Instance name.
    pub name: String,
    /// What it is an instance of.
    pub module: Arc<Module>,
    /// The scope around it; the top is its own parent.
    pub parent: ScopeId,
    /// Number of scopes in this subtree, itself included: the next sibling is that far on.
    pub subtree: usize,
    first_net: usize,
    first_cell: usize,
    /// The first of the nets that this scope is the outermost to name; they are numbered in the scopes' order.
    first_own_net: usize,
}

/// An elaborated design.
#[derive(Debug, Clone)]
pub struct Netlist {
    cells: Vec<FlatCell>,
    net_count: usize,
    scopes: Vec<Scope>,
    net_map: Vec<NetId>,
    /// Cells with delays of their own, in order.
    own_delays: Vec<(CellId, OwnDelay)>,
}

impl Netlist {
    /// Flattens `top` and everything below it. The top scope is named after its module.
    ///
    /// # Example
    ///
    /// ```
    /// use femtogate::netlist::{CellKind, ModuleBuilder, Netlist};
    ///
    /// let mut m = ModuleBuilder::new("inverter");
    /// let (a, z) = (m.input("A"), m.output("Z"));
    /// m.cell("gate", CellKind::Inv, &[a], &[z]);
    /// let inverter = m.finish()?;
    ///
    /// let mut m = ModuleBuilder::new("pair");
    /// let (a, between, z) = (m.input("A"), m.wire("BETWEEN"), m.output("Z"));
    /// m.instance("first", &inverter, &[("A", &[a]), ("Z", &[between])]);
    /// m.instance("second", &inverter, &[("A", &[between]), ("Z", &[z])]);
    /// let netlist = Netlist::elaborate(&m.finish()?);
    ///
    /// assert_eq!((netlist.cells().len(), netlist.net_count()), (2, 3));
    /// let gate = netlist.cell("second.gate").unwrap();
    /// assert_eq!(netlist.cell_path(gate), "pair.second.gate");
    /// # Ok::<(), femtogate::netlist::NetlistError>(())
    /// ```
    pub fn elaborate(top: &Arc<Module>) -> Self {
        let mut netlist = Netlist {
            cells: Vec::with_capacity(top.total_cells()),
            net_count: 0,
            scopes: Vec::new(),
            net_map: Vec::new(),
            own_delays: Vec::new(),
        };
        let ports: Vec<_> = top
            .port_signals()
            .flat_map(|(_, s)| s.nets())
            .map(|_| Some(netlist.new_net()))
            .collect();
        netlist.stamp(top, top.name(), ScopeId::TOP, &ports);
        netlist
    }

    fn new_net(&mut self) -> NetId {
        self.net_count += 1;
        assert!(
            self.net_count < u32::MAX as usize,
            "more nets than NetId can number"
        );
        NetId::new(self.net_count - 1)
    }

    fn stamp(
        &mut self,
        module: &Arc<Module>,
        name: &str,
        parent: ScopeId,
        ports: &[Option<NetId>],
    ) {
        let index = self.scopes.len();
        let first_net = self.net_map.len();
        let mut nets = vec![None; module.net_count()];
        let port_nets = module.port_signals().flat_map(|(_, s)| s.nets());
        for (local, &outer) in port_nets.zip(ports) {
            nets[local.index()] = outer;
        }
        let first_own_net = self.net_count;
        for net in nets {
            let net = net.unwrap_or_else(|| self.new_net());
            self.net_map.push(net);
        }
        let first_cell = self.cells.len();
        let global =
            |net_map: &[NetId], net: Option<Net>| net.map(|net| net_map[first_net + net.index()]);
        for cell in module.cells() {
            let flat = FlatCell {
                kind: cell.kind,
                inputs: cell.inputs.map(|n| global(&self.net_map, n)),
                outputs: cell.outputs.map(|n| global(&self.net_map, n)),
            };
            self.own_delays.extend(
                cell.own_delay
                    .map(|delay| (CellId::new(self.cells.len()), delay)),
            );
            self.cells.push(flat);
        }
        self.scopes.push(Scope {
            name: name.to_owned(),
            module: Arc::clone(module),
            parent,
            subtree: 1,
            first_net,
            first_cell,
            first_own_net: if index == 0 { 0 } else { first_own_net },
        });
        let mut child_ports = Vec::new();
        for child in module.instances() {
            child_ports.clear();
            child_ports.extend(child.connections.iter().map(|&n| global(&self.net_map, n)));
            self.stamp(
                &child.module,
                &child.name,
                ScopeId::new(index),
                &child_ports,
            );
        }
        self.scopes[index].subtree = self.scopes.len() - index;
    }

    /// Every leaf cell.
    pub fn cells(&self) -> &[FlatCell] {
        &self.cells
    }

    /// Cells whose delays are their own instead of the library's, in ascending order.
    pub fn own_delays(&self) -> &[(CellId, OwnDelay)] {
        &self.own_delays
    }

    /// The leaf cells directly in a scope, in the order of its module.
    pub fn cells_of(
        &self,
        scope: ScopeId,
    ) -> impl ExactSizeIterator<Item = CellId> + DoubleEndedIterator + Clone + use<> {
        let scope = &self.scopes[scope.index()];
        let cells = scope.first_cell..scope.first_cell + scope.module.cells().len();
        cells.map(CellId::new)
    }

    /// The leaf cells in a scope and in all scopes below it, in ascending order without gaps.
    pub fn cells_below(
        &self,
        scope: ScopeId,
    ) -> impl ExactSizeIterator<Item = CellId> + DoubleEndedIterator + Clone + use<> {
        let scope = &self.scopes[scope.index()];
        let cells = scope.first_cell..scope.first_cell + scope.module.total_cells();
        cells.map(CellId::new)
    }

    /// Number of nets.
    pub fn net_count(&self) -> usize {
        self.net_count
    }

    /// Every instance, depth first, the top at index 0.
    pub fn scopes(&self) -> &[Scope] {
        &self.scopes
    }

    /// The chip's nets of one scope's signal, bit 0 first.
    pub fn signal_nets(
        &self,
        scope: &Scope,
        signal: &super::module::Signal,
    ) -> impl ExactSizeIterator<Item = NetId> + DoubleEndedIterator + use<'_> {
        let first = scope.first_net;
        signal.nets().map(move |n| self.net_map[first + n.index()])
    }

    /// The scopes directly below a scope.
    pub fn children(&self, scope: ScopeId) -> impl Iterator<Item = ScopeId> + '_ {
        let end = scope.index() + self.scopes[scope.index()].subtree;
        let mut next = scope.index() + 1;
        std::iter::from_fn(move || {
            let this = next;
            (this < end).then(|| {
                next += self.scopes[this].subtree;
                ScopeId::new(this)
            })
        })
    }

    /// The scope at a dotted path below the top; the empty path is the top itself.
    pub fn scope(&self, path: &str) -> Option<ScopeId> {
        path.split('.')
            .filter(|part| !part.is_empty())
            .try_fold(0, |scope, part| {
                Some(scope + self.scopes[scope].module.scope_offset(part)?)
            })
            .map(ScopeId::new)
    }

    /// The leaf cell at a dotted path below the top.
    pub fn cell(&self, path: &str) -> Option<CellId> {
        let (scope_path, name) = path.rsplit_once('.').unwrap_or(("", path));
        let scope = &self.scopes[self.scope(scope_path)?.index()];
        Some(CellId::new(scope.first_cell + scope.module.cell(name)?))
    }

    /// Nets of the signal at a dotted path below the top, such as `mp_r0_c0.p_counter.COUNT`.
    pub fn signal(&self, path: &str) -> Option<Vec<NetId>> {
        let (scope_path, name) = path.rsplit_once('.').unwrap_or(("", path));
        let scope = &self.scopes[self.scope(scope_path)?.index()];
        let signal = scope.module.signal(name)?;
        Some(self.signal_nets(scope, signal).collect())
    }

    /// The net at a dotted path below the top; one bit of a bus as `path.BUS[3]`.
    ///
    /// # Example
    ///
    /// ```
    /// use femtogate::netlist::{CellKind, ModuleBuilder, Netlist};
    ///
    /// let mut m = ModuleBuilder::new("top");
    /// let (a, z) = (m.input("A"), m.output_bus("Z", 2));
    /// m.gate_into(CellKind::Buf, &[a], z[0]);
    /// m.gate_into(CellKind::Inv, &[a], z[1]);
    /// let netlist = Netlist::elaborate(&m.finish()?);
    ///
    /// let bit = netlist.net("Z[1]").unwrap();
    /// assert_eq!(netlist.net_path(bit).unwrap(), "top.Z[1]");
    /// assert_eq!(netlist.net("Z"), None); // A bus has several nets.
    /// assert_eq!(netlist.signal("Z").unwrap()[1], bit);
    /// # Ok::<(), femtogate::netlist::NetlistError>(())
    /// ```
    pub fn net(&self, path: &str) -> Option<NetId> {
        if let Some((bus, index)) = path.strip_suffix(']').and_then(|p| p.rsplit_once('[')) {
            return self.signal(bus)?.get(index.parse::<usize>().ok()?).copied();
        }
        match self.signal(path)?[..] {
            [net] => Some(net),
            _ => None,
        }
    }

    /// Nets that only the outside can drive, in port order.
    pub fn inputs(&self) -> Vec<NetId> {
        let top = &self.scopes[0];
        top.module
            .port_signals()
            .filter(|(direction, _)| *direction == Direction::Input)
            .flat_map(|(_, signal)| self.signal_nets(top, signal))
            .collect()
    }

    /// Dotted path of a scope, top name first.
    pub fn scope_path(&self, mut scope: ScopeId) -> String {
        let mut parts = vec![self.scopes[scope.index()].name.as_str()];
        while scope != ScopeId::TOP {
            scope = self.scopes[scope.index()].parent;
            parts.push(&self.scopes[scope.index()].name);
        }
        parts.reverse();
        parts.join(".")
    }

    /// Dotted path of a leaf cell, top name first.
    pub fn cell_path(&self, cell: CellId) -> String {
        // Scopes are in stamping order, so their first cells ascend.
        let after = |scope: &Scope| scope.first_cell <= cell.index();
        let index = self.scopes.partition_point(after) - 1;
        let scope = &self.scopes[index];
        let name = &scope.module.cells()[cell.index() - scope.first_cell].name;
        format!("{}.{name}", self.scope_path(ScopeId::new(index)))
    }

    /// Dotted path of a net in the outermost scope that names it.
    pub fn net_path(&self, net: NetId) -> Option<String> {
        let after = |scope: &Scope| scope.first_own_net <= net.index();
        let index = self.scopes.partition_point(after).checked_sub(1)?;
        let scope = &self.scopes[index];
        let local = &self.net_map[scope.first_net..][..scope.module.net_count()];
        let position = local.iter().position(|&n| n == net)?;
        let mut signals = scope.module.signals().iter();
        let signal = signals.find(|s| s.nets().any(|n| n.index() == position))?;
        let bit = position - signal.nets().next()?.index();
        let path = format!("{}.{}", self.scope_path(ScopeId::new(index)), signal.name);
        Some(if signal.is_bus {
            format!("{path}[{bit}]")
        } else {
            path
        })
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::netlist::ModuleBuilder;

    fn two_inverters() -> Arc<Module> {
        let mut m = ModuleBuilder::new("leaf");
        let (a, z) = (m.input("A"), m.output("Z"));
        m.cell("inv", CellKind::Inv, &[a], &[z]);
        let leaf = m.finish().unwrap();
        let mut m = ModuleBuilder::new("pair");
        let (a, z) = (m.input("A"), m.output_bus("Z", 2));
        m.instance("first", &leaf, &[("A", &[a]), ("Z", &z[..1])]);
        m.instance("second", &leaf, &[("A", &z[..1]), ("Z", &z[1..])]);
        m.finish().unwrap()
    }

    #[test]
    fn hierarchy_shares_nets_through_ports() {
        let n = Netlist::elaborate(&two_inverters());
        assert_eq!(n.net_count(), 3);
        assert_eq!(n.cells().len(), 2);
        assert_eq!(n.net("first.Z"), n.net("second.A"));
        assert_eq!(n.net("second.Z"), n.net("Z[1]"));
        assert_eq!(n.net("third.Z"), None);
        assert_eq!(n.inputs(), vec![n.net("A").unwrap()]);
    }

    #[test]
    fn names_are_recovered() {
        let n = Netlist::elaborate(&two_inverters());
        assert_eq!(n.cell_path(CellId::new(1)), "pair.second.inv");
        assert_eq!(n.cell("second.inv"), Some(CellId::new(1)));
        assert_eq!((n.cell("inv"), n.cell("second.INV")), (None, None));
        assert_eq!(n.net_path(n.net("second.Z").unwrap()).unwrap(), "pair.Z[1]");
        assert_eq!(n.children(ScopeId::TOP).count(), 2);
    }

    #[test]
    fn every_scope_and_net_is_found_by_its_path() {
        let mut m = ModuleBuilder::new("top");
        let (a, z) = (m.input("A"), m.output_bus("Z", 4));
        let pair = two_inverters();
        m.instance("x", &pair, &[("A", &[a]), ("Z", &z[..2])]);
        m.instance("y", &pair, &[("A", &z[1..2]), ("Z", &z[2..])]);
        m.instance("z", &pair, &[("A", &[a])]);
        let n = Netlist::elaborate(&m.finish().unwrap());
        let below_top = |path: String| path.split_once('.').map(|(_, p)| p.to_owned());
        for scope in (1..n.scopes().len()).map(ScopeId::new) {
            let path = below_top(n.scope_path(scope)).unwrap();
            assert_eq!(n.scope(&path), Some(scope), "{path}");
        }
        for net in (0..n.net_count()).map(NetId::new) {
            let path = below_top(n.net_path(net).unwrap()).unwrap();
            assert_eq!(n.net(&path), Some(net), "{path}");
        }
    }
}
