//! The delays and limits of an elaborated design in one corner: those of the library, or of each instance by itself.
//!
//! Nominal designs share one set of delays per kind of cell. A cell whose delays are changed (mismatch,
//! back-annotation) gets a set of its own. So does one that delays as a wire does ([`DelayModel`]).

use std::collections::BTreeMap;

use super::cell::CellKind;
use super::corner::Corner;
use super::delay::{CellDelays, DelayModel};
use super::flat::Netlist;
use super::id::CellId;
use super::instance_limits::InstanceLimits;
use super::library::Library;

/// Delays of every cell of a netlist, and limits of every flip-flop.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Timing {
    sets: Vec<CellDelays>,
    /// Whether a set is that of one cell alone.
    is_own: Vec<bool>,
    /// By index into `sets`.
    models: Vec<DelayModel>,
    of_cell: Vec<u32>,
    /// The library's limits by kind of cell, and those of single cells.
    limits: Vec<InstanceLimits>,
    own_limits: BTreeMap<CellId, InstanceLimits>,
}

impl Timing {
    /// Every cell as the library has it in this corner, or with the delay that is its own.
    ///
    /// # Example
    ///
    /// ```
    /// use femtogate::netlist::{
    ///     CellKind, Corner, Edge, Library, ModuleBuilder, Netlist, StaticTiming, Timing,
    /// };
    ///
    /// let mut m = ModuleBuilder::new("top");
    /// let (a, z) = (m.input("A"), m.output("Z"));
    /// m.cell("inverter", CellKind::Inv, &[a], &[z]);
    /// let netlist = Netlist::elaborate(&m.finish()?);
    /// let [a, z] = ["A", "Z"].map(|name| netlist.net(name).unwrap());
    ///
    /// let library = Library::generic_40nm();
    /// let [fast, slow] = [Corner::Fast, Corner::Slow].map(|corner| {
    ///     let timing = Timing::nominal(&netlist, &library, corner);
    ///     let arrivals = StaticTiming::new(&netlist, &timing).arrivals(&[(a, Edge::Rise)], &[]);
    ///     arrivals.unwrap().window(z).unwrap()
    /// });
    /// assert!(fast.1 < slow.0);
    /// # Ok::<(), femtogate::netlist::NetlistError>(())
    /// ```
    pub fn nominal(netlist: &Netlist, library: &Library, corner: Corner) -> Self {
        Self::nominal_as(netlist, library, corner, |cell| netlist.cell_path(cell))
    }

    /// The same where each cell is the one at this path, which says what elements of delay lines it has.
    pub fn nominal_as(
        netlist: &Netlist,
        library: &Library,
        corner: Corner,
        path: impl Fn(CellId) -> String,
    ) -> Self {
        Self::of_library(netlist, library, corner).with_own_delays(netlist, corner, path)
    }

    /// The same where cells with delays of their own have these.
    #[must_use]
    pub fn with_own_delays(
        mut self,
        netlist: &Netlist,
        corner: Corner,
        path: impl Fn(CellId) -> String,
    ) -> Self {
        for &(cell, delay) in netlist.own_delays() {
            self.set(cell, delay.delays(|| path(cell), corner));
            self.set_model(cell, delay.model);
        }
        self
    }

    /// Gives the cells from `first` on the delays and limits of a block's, which is of as many cells. `known` is what this gave
    /// for the same block before: its sets are shared.
    #[cfg(feature = "liberty")]
    pub(crate) fn adopt(&mut self, first: CellId, block: &Timing, known: Option<u32>) -> u32 {
        let base = known.unwrap_or_else(|| {
            let base = self.sets.len() as u32;
            self.sets.extend(&block.sets);
            self.models.extend(&block.models);
            self.is_own.resize(self.sets.len(), false);
            base
        });
        for (cell, &set) in block.of_cell.iter().enumerate() {
            self.of_cell[first.index() + cell] = base + set;
        }
        let limits = block.own_limits.iter();
        self.own_limits
            .extend(limits.map(|(&cell, &own)| (CellId::new(first.index() + cell.index()), own)));
        base
    }

    /// Every cell as the library has it in this corner, even those with delays of their own.
    pub fn of_library(netlist: &Netlist, library: &Library, corner: Corner) -> Self {
        Timing {
            sets: CellKind::ALL
                .iter()
                .map(|&kind| library.delays(kind, corner))
                .collect(),
            is_own: vec![false; CellKind::ALL.len()],
            models: vec![DelayModel::Inertial; CellKind::ALL.len()],
            of_cell: netlist.cells().iter().map(|c| c.kind as u32).collect(),
            limits: CellKind::ALL
                .map(|kind| InstanceLimits::from_library(library.checks(kind), corner))
                .into(),
            own_limits: BTreeMap::new(),
        }
    }

    /// Delays of one cell.
    #[inline]
    pub fn cell_delays(&self, cell: CellId) -> &CellDelays {
        &self.sets[self.of_cell[cell.index()] as usize]
    }

    /// Gives one cell delays of its own.
    pub fn set(&mut self, cell: CellId, delays: CellDelays) {
        let own = self.own_set(cell);
        self.sets[own] = delays;
    }

    /// How one cell delays: all its arcs alike, because a change of its output cancels one from any arc.
    #[inline]
    pub fn model(&self, cell: CellId) -> DelayModel {
        self.models[self.of_cell[cell.index()] as usize]
    }

    /// Makes one cell delay in this way.
    pub fn set_model(&mut self, cell: CellId, model: DelayModel) {
        let own = self.own_set(cell);
        self.models[own] = model;
    }

    /// Limits of one cell, which is of this kind.
    pub fn limits(&self, cell: CellId, kind: CellKind) -> &InstanceLimits {
        let own = self.own_limits.get(&cell);
        own.unwrap_or(&self.limits[kind as usize])
    }

    /// Gives one cell limits of its own.
    pub fn set_limits(&mut self, cell: CellId, limits: InstanceLimits) {
        self.own_limits.insert(cell, limits);
    }

    /// Every limit times `factor`.
    pub fn scale_limits(&mut self, factor: f64) {
        let all = self.limits.iter_mut().chain(self.own_limits.values_mut());
        all.for_each(|limits| *limits = limits.times(factor));
    }

    /// The timing of some of the cells, of which the first becomes cell 0 of a netlist of their own.
    #[must_use]
    pub fn part(&self, cells: impl Iterator<Item = CellId> + Clone) -> Self {
        let own_limits = cells.clone().enumerate().filter_map(|(place, cell)| {
            let limits = self.own_limits.get(&cell)?;
            Some((CellId::new(place), *limits))
        });
        Timing {
            own_limits: own_limits.collect(),
            of_cell: cells.map(|cell| self.of_cell[cell.index()]).collect(),
            is_own: vec![false; self.sets.len()],
            ..self.clone()
        }
    }

    /// Index of a set that is this cell's alone.
    fn own_set(&mut self, cell: CellId) -> usize {
        let set = self.of_cell[cell.index()] as usize;
        if self.is_own[set] {
            return set;
        }
        self.of_cell[cell.index()] = self.sets.len() as u32;
        self.sets.push(self.sets[set]);
        self.models.push(self.models[set]);
        self.is_own.push(true);
        self.sets.len() - 1
    }

    /// Distinct sets of delays.
    pub(crate) fn sets(&self) -> &[CellDelays] {
        &self.sets
    }

    /// Index into [`Timing::sets`] by cell.
    pub(crate) fn set_of(&self, cell: CellId) -> u32 {
        self.of_cell[cell.index()]
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::logic::Logic;
    use crate::netlist::ModuleBuilder;
    use crate::netlist::{ArcDelay, MAX_INPUTS, MAX_OUTPUTS};

    #[test]
    fn a_changed_cell_leaves_its_siblings_alone() {
        let mut m = ModuleBuilder::new("pair");
        let a = m.input("A");
        let b = m.gate(CellKind::Inv, &[a]);
        m.gate(CellKind::Inv, &[b]);
        let netlist = Netlist::elaborate(&m.finish().unwrap());
        let mut timing = Timing::nominal(&netlist, &Library::generic_40nm(), Corner::Typ);
        let nominal = *timing.cell_delays(CellId::new(0));
        let slow = [[ArcDelay {
            rise_fs: 9,
            fall_fs: 8,
        }; MAX_OUTPUTS]; MAX_INPUTS];
        timing.set(CellId::new(1), slow);
        timing.set_model(CellId::new(1), DelayModel::Transport);
        timing.set(CellId::new(1), slow);
        assert_eq!(timing.model(CellId::new(0)), DelayModel::Inertial);
        assert_eq!(timing.model(CellId::new(1)), DelayModel::Transport);
        assert_eq!(*timing.cell_delays(CellId::new(0)), nominal);
        assert_eq!(*timing.cell_delays(CellId::new(1)), slow);
        assert_eq!(
            timing.cell_delays(CellId::new(1))[0][0].delay_fs(Logic::X),
            8
        );
    }
}
