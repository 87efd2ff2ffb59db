//! A netlist in a library's cells: the drive of every cell, by its load; slews from the inputs on; and so each instance's delays.
//!
//! ```text
//!   weakest drives ─► loads ─► drives ─► loads … ─► slews, in the order in which they settle ─► delays, limits
//! ```
//!
//! A drive is strong enough if the slew it makes, from one as slow, is at most that of the library's smallest inverter
//! which drives eight of its kind ([`Environment::slowest_slew_fs`]). Slews are those of timing analysis without knowledge of paths: at
//! each pin the slowest of all that can come there, whatever the values.

use std::collections::{HashMap, VecDeque};
use std::ops::Range;
use std::sync::Arc;

use super::composite::{ByEdge, Composite, Conditions, MOST_STAGES};
use super::mapping::CellMap;
use super::read::Liberty;
use crate::netlist::{
    CellId, CellKind, CheckLimits, Corner, FlatCell, Library, MAX_INPUTS, MAX_OUTPUTS, Module,
    NetId, Netlist, ScopeId, Timing, TimingArc,
};

/// What a netlist finds around it.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Environment {
    /// Slew of every input of the netlist, fs, between the library's thresholds.
    pub input_slew_fs: f64,
    /// Slowest slew that drives are chosen to keep, fs.
    pub slowest_slew_fs: f64,
    /// Capacitance of wires, fF for each pin that a net leads to.
    pub wire_ff: f64,
}

impl Environment {
    /// Slews by the library's smallest inverter: inputs as if it drove four of its kind, drives as if it drove eight. Wires are
    /// left out, as before layout.
    pub fn new(library: &Liberty) -> Self {
        let inverter = &library.map.recipe(CellKind::Inv).stages[0].drives[0];
        Environment {
            input_slew_fs: inverter.settled_slew(4.0),
            slowest_slew_fs: inverter.settled_slew(8.0),
            wire_ff: 0.0,
        }
    }
}

/// A netlist in a library's cells.
#[derive(Debug, Clone)]
pub struct CharacterisedNetlist {
    /// Delays and limits of every cell; those of cells with delays of their own are the library's, too.
    pub timing: Timing,
    /// Which drive of each stage, by cell.
    drives: Vec<[u8; MOST_STAGES]>,
    nets: Nets,
    blocks: Vec<Block>,
}

/// Cells of a block, which is characterised alone.
#[derive(Debug, Clone)]
struct Block {
    cells: Range<usize>,
    alone: Arc<(Netlist, CharacterisedNetlist)>,
}

/// What nets do to the cells at them.
#[derive(Debug, Clone)]
struct Nets {
    /// Load of each net, fF.
    loads: Vec<ByEdge>,
    /// Slew of each net, fs.
    slews: Vec<ByEdge>,
    /// Slew at a pin without a net, fs.
    input_slew_fs: f64,
}

impl Nets {
    /// Slews at a cell's pins and loads at its outputs.
    fn conditions(&self, cell: &FlatCell) -> Conditions {
        let load = |net: NetId| self.loads[net.index()];
        let slew = |net: NetId| self.slews[net.index()];
        Conditions {
            slews: cell
                .inputs
                .map(|net| net.map_or([self.input_slew_fs; 2], slew)),
            loads: cell.outputs.map(|net| net.map(load).unwrap_or_default()),
        }
    }
}

impl Liberty {
    /// Delays and limits of every cell of a netlist in this library's cells, by its load and the slews at its pins; cells with delays
    /// of their own keep these, as they are in the typical corner. Inputs have the slew of [`Environment::new`], and wires are left out.
    pub fn timing(&self, netlist: &Netlist) -> Timing {
        let timing = CharacterisedNetlist::new(netlist, self, &Environment::new(self)).timing;
        timing.with_own_delays(netlist, Corner::Typ, |cell| netlist.cell_path(cell))
    }

    /// Delays and limits of each kind by itself, the same in every corner: with the environment's slew at every pin and four of the smallest
    /// inverters on each output.
    pub fn nominal(&self, environment: &Environment) -> Library {
        let mut library = Library::generic_40nm();
        let inverter = &self.map.recipe(CellKind::Inv).stages[0].drives[0];
        let load = inverter.inputs[0].load_ff.map(|load| 4.0 * load);
        let drives = [0; MOST_STAGES];
        for kind in CellKind::ALL {
            let recipe = self.map.recipe(kind);
            let composite = Composite {
                recipe,
                drives: &drives[..recipe.stages.len()],
                is_connected: [true; MAX_OUTPUTS],
            };
            let conditions = Conditions {
                slews: [[environment.input_slew_fs; 2]; MAX_INPUTS],
                loads: [load; MAX_OUTPUTS],
            };
            let (delays, limits) = composite.characterise(kind, &conditions);
            library.set_arcs(kind, delays.map(|outputs| outputs.map(TimingArc::fixed)));
            if kind.is_flip_flop() {
                library.set_checks(kind, limits.of_kind());
            }
        }
        library
    }
}

impl CharacterisedNetlist {
    /// Sizes and times a netlist. Nets without a driver have the environment's slew. A net that the library's strongest buffer is
    /// too weak for loads its driver with no more than that buffer could drive: such nets get trees of buffers in layout, which are no part
    /// of a netlist.
    pub fn new(netlist: &Netlist, library: &Liberty, environment: &Environment) -> Self {
        Self::with_blocks(netlist, library, environment, |_| false)
    }

    /// The same where each instance of the modules that are blocks is sized and timed alone, as blocks are that are laid out once:
    /// the environment's slew comes to its inputs, and its outputs drive nothing outside.
    pub fn with_blocks(
        netlist: &Netlist,
        library: &Liberty,
        environment: &Environment,
        is_block: impl Fn(&Module) -> bool,
    ) -> Self {
        let mut known: HashMap<*const Module, Arc<(Netlist, CharacterisedNetlist)>> =
            HashMap::new();
        let mut blocks = Vec::new();
        let mut scope = 1;
        while let Some(at) = netlist.scopes().get(scope) {
            if !is_block(&at.module) {
                scope += 1;
                continue;
            }
            let alone = known.entry(Arc::as_ptr(&at.module)).or_insert_with(|| {
                let alone = Netlist::elaborate(&at.module);
                let characterised = Self::new(&alone, library, environment);
                Arc::new((alone, characterised))
            });
            let mut cells = netlist.cells_below(ScopeId::new(scope));
            let count = cells.len();
            if let Some(first) = cells.next() {
                blocks.push(Block {
                    cells: first.index()..first.index() + count,
                    alone: Arc::clone(alone),
                });
            }
            scope += at.subtree;
        }
        let mut work = Characterisation::new(netlist, &library.map, environment, blocks);
        // Stronger drives load what is before them, which may then need to be stronger, too. Three rounds are chosen.
        for _ in 0..3 {
            work.size();
        }
        work.settle();
        work.finish()
    }

    /// Area (in the library's unit) and leakage (W) of the cells below a scope of `netlist`.
    pub fn silicon(&self, netlist: &Netlist, library: &Liberty, scope: ScopeId) -> (f64, f64) {
        let (mut area, mut leakage_w) = (0.0, 0.0);
        for cell in netlist.cells_below(scope) {
            let (composite, _) = self.instance(netlist, &library.map, cell);
            for stage in composite.used() {
                area += composite.cell(stage).area;
                leakage_w += composite.cell(stage).leakage_w;
            }
        }
        (area, leakage_w)
    }

    /// Energy within the cells below a scope of `netlist`, by the library's tables, and of the loads at their outputs with a supply of `volt`, J, when
    /// each net changes as often as `changes` says.
    pub fn energy_j(
        &self,
        (netlist, scope): (&Netlist, ScopeId),
        library: &Liberty,
        volt: f64,
        changes: impl Fn(NetId) -> f64,
    ) -> [f64; 2] {
        let toggles = |net: Option<NetId>| net.map_or(0.0, &changes);
        let each = netlist.cells_below(scope).map(|cell| {
            let (composite, conditions) = self.instance(netlist, &library.map, cell);
            let leaf = &netlist.cells()[cell.index()];
            composite.energy_fj(
                &conditions,
                leaf.inputs.map(toggles),
                leaf.outputs.map(toggles),
            )
        });
        let sum = each.fold([0.0; 2], |a, b| [a[0] + b[0], a[1] + b[1]]);
        [sum[0] * 1e-15, sum[1] * volt * volt * 1e-15]
    }

    /// The largest limits of any flip-flop of a kind in `netlist`, the same in every corner; none if there is none.
    pub fn largest_limits(&self, netlist: &Netlist, kind: CellKind) -> Option<CheckLimits> {
        let cells = netlist.cells().iter().enumerate();
        let limits = cells.filter(|(_, cell)| cell.kind == kind);
        let limits = limits.map(|(index, _)| *self.timing.limits(CellId::new(index), kind));
        let largest = limits.reduce(|a, b| a.larger(&b));
        largest.map(|limits| limits.of_kind())
    }

    /// The shortest and the longest delay of any instance in `netlist`, fs as its tables give them, each with the library's cells that it is of
    /// and where they stand. Delays of [`CharacterisedNetlist::timing`] are whole, from 0 to 4.295 us.
    pub fn extreme_delays(&self, netlist: &Netlist, library: &Liberty) -> [(f64, String); 2] {
        let mut extremes = [f64::INFINITY, f64::NEG_INFINITY].map(|fs| (fs, CellId::new(0)));
        for (id, cell) in netlist.cells_below(ScopeId::TOP).zip(netlist.cells()) {
            let (composite, conditions) = self.instance(netlist, &library.map, id);
            let [shortest, longest] = composite.extreme_delays(cell.kind, &conditions);
            if shortest < extremes[0].0 {
                extremes[0] = (shortest, id);
            }
            if longest > extremes[1].0 {
                extremes[1] = (longest, id);
            }
        }
        extremes.map(|(fs, cell)| {
            let (composite, _) = self.instance(netlist, &library.map, cell);
            let cells = composite.used().map(|stage| composite.cell(stage));
            let cells = cells.map(|cell| format!("{} ({})", cell.name, cell.place));
            (fs, cells.collect::<Vec<_>>().join(" + "))
        })
    }

    /// What stands for a cell, and what the nets at it do to it.
    pub(super) fn instance<'m>(
        &'m self,
        netlist: &Netlist,
        map: &'m CellMap,
        cell: CellId,
    ) -> (Composite<'m>, Conditions) {
        let cell = cell.index();
        let after = self.blocks.partition_point(|block| block.cells.end <= cell);
        match self.blocks.get(after) {
            Some(block) if block.cells.contains(&cell) => {
                let (alone, characterised) = &*block.alone;
                let own = CellId::new(cell - block.cells.start);
                characterised.instance(alone, map, own)
            }
            _ => {
                let conditions = self.nets.conditions(&netlist.cells()[cell]);
                (composite(netlist, map, &self.drives, cell), conditions)
            }
        }
    }
}

fn composite<'m>(
    netlist: &Netlist,
    map: &'m CellMap,
    drives: &'m [[u8; MOST_STAGES]],
    cell: usize,
) -> Composite<'m> {
    let recipe = map.recipe(netlist.cells()[cell].kind);
    Composite {
        recipe,
        drives: &drives[cell][..recipe.stages.len()],
        is_connected: netlist.cells()[cell].outputs.map(|net| net.is_some()),
    }
}

/// The load that the library's strongest buffer drives with a slew, fF.
fn most_load(map: &CellMap, slew_fs: f64) -> f64 {
    let recipe = map.recipe(CellKind::Buf);
    let drives: Vec<u8> = recipe
        .stages
        .iter()
        .map(|stage| stage.drives.len() as u8 - 1)
        .collect();
    let buffer = Composite {
        recipe,
        drives: &drives,
        is_connected: [true; MAX_OUTPUTS],
    };
    let last = drives.len() - 1;
    let (mut low, mut high) = (0.0, 1e5);
    for _ in 0..60 {
        let middle = 0.5 * (low + high);
        if buffer.stage_slew(last, slew_fs, &[[middle; 2]; MAX_OUTPUTS]) <= slew_fs {
            low = middle
        } else {
            high = middle
        }
    }
    low
}

struct Characterisation<'w> {
    netlist: &'w Netlist,
    map: &'w CellMap,
    environment: &'w Environment,
    drives: Vec<[u8; MOST_STAGES]>,
    blocks: Vec<Block>,
    /// Cells in no block.
    outside: Vec<usize>,
    /// What a net is taken to load its driver with at most, fF.
    most_load: f64,
    nets: Nets,
    /// Cells that a net leads to.
    readers: Vec<Vec<u32>>,
}

impl<'w> Characterisation<'w> {
    fn new(
        netlist: &'w Netlist,
        map: &'w CellMap,
        environment: &'w Environment,
        blocks: Vec<Block>,
    ) -> Self {
        let mut drives = vec![[0; MOST_STAGES]; netlist.cells().len()];
        let mut is_inside = vec![false; netlist.cells().len()];
        for block in &blocks {
            drives[block.cells.clone()].copy_from_slice(&block.alone.1.drives);
            is_inside[block.cells.clone()].fill(true);
        }
        let outside = (0..is_inside.len()).filter(|&cell| !is_inside[cell]);
        let outside: Vec<usize> = outside.collect();
        let mut readers = vec![Vec::new(); netlist.net_count()];
        for &index in &outside {
            for net in netlist.cells()[index].input_nets() {
                readers[net.index()].push(index as u32);
            }
        }
        Characterisation {
            netlist,
            map,
            environment,
            drives,
            blocks,
            outside,
            most_load: most_load(map, environment.slowest_slew_fs),
            nets: Nets {
                loads: vec![[0.0; 2]; netlist.net_count()],
                slews: vec![[environment.input_slew_fs; 2]; netlist.net_count()],
                input_slew_fs: environment.input_slew_fs,
            },
            readers,
        }
    }

    fn composite(&self, cell: usize) -> Composite<'_> {
        composite(self.netlist, self.map, &self.drives, cell)
    }

    fn load_nets(&mut self) {
        let mut loads = vec![[0.0; 2]; self.netlist.net_count()];
        for (index, cell) in self.netlist.cells().iter().enumerate() {
            let composite = self.composite(index);
            for (pin, net) in cell.input_nets().enumerate() {
                let own = composite.input_load(pin);
                let load = &mut loads[net.index()];
                *load =
                    std::array::from_fn(|edge| load[edge] + own[edge] + self.environment.wire_ff);
            }
        }
        for load in loads.as_flattened_mut() {
            *load = load.min(self.most_load);
        }
        self.nets.loads = loads;
    }

    /// Chooses every drive by the loads of the ones chosen before.
    fn size(&mut self) {
        self.load_nets();
        let slowest = self.environment.slowest_slew_fs;
        let mut drives = self.drives.clone();
        for &cell in &self.outside {
            let chosen = &mut drives[cell];
            let Conditions { loads, .. } = self.nets.conditions(&self.netlist.cells()[cell]);
            let recipe = self.composite(cell).recipe;
            // From the outputs back: what a stage drives is known.
            for stage in (0..recipe.stages.len()).rev() {
                let strongest = recipe.stages[stage].drives.len() as u8 - 1;
                let enough = |&drive: &u8| {
                    let mut tried = *chosen;
                    tried[stage] = drive;
                    let tried = Composite {
                        drives: &tried[..recipe.stages.len()],
                        ..self.composite(cell)
                    };
                    tried.stage_slew(stage, slowest, &loads) <= slowest
                };
                chosen[stage] = (0..strongest).find(enough).unwrap_or(strongest);
            }
        }
        self.drives = drives;
    }

    /// Slews of all nets: a cell is looked at again whenever a slew at its pins has changed.
    fn settle(&mut self) {
        self.load_nets();
        let mut waiting: VecDeque<usize> = self.outside.iter().copied().collect();
        let mut is_waiting = vec![true; self.netlist.cells().len()];
        // Slews go round in loops, each time fainter; nothing here needs more than the depth of the logic.
        let mut left = 1000 * waiting.len();
        while let Some(cell) = waiting.pop_front() {
            is_waiting[cell] = false;
            left = left.saturating_sub(1);
            if left == 0 {
                debug_assert!(false, "slews settle");
                return;
            }
            let leaf = &self.netlist.cells()[cell];
            let found = self
                .composite(cell)
                .output_slews(&self.nets.conditions(leaf));
            let outputs = leaf.outputs;
            for (net, slew) in outputs.iter().zip(found) {
                let (Some(net), Some(slew)) = (net, slew) else {
                    continue;
                };
                let known = &mut self.nets.slews[net.index()];
                if (0..2).any(|edge| (slew[edge] - known[edge]).abs() > 1e-3) {
                    *known = slew;
                    for &reader in &self.readers[net.index()] {
                        if !std::mem::replace(&mut is_waiting[reader as usize], true) {
                            waiting.push_back(reader as usize);
                        }
                    }
                }
            }
        }
    }

    fn finish(self) -> CharacterisedNetlist {
        let mut timing = Timing::of_library(self.netlist, &Library::generic_40nm(), Corner::Typ);
        let mut adopted = HashMap::new();
        for block in &self.blocks {
            let alone = &block.alone.1;
            let at = adopted.entry(Arc::as_ptr(&block.alone)).or_insert(None);
            *at = Some(timing.adopt(CellId::new(block.cells.start), &alone.timing, *at));
        }
        for &index in &self.outside {
            let cell = &self.netlist.cells()[index];
            let (composite, conditions) = (self.composite(index), self.nets.conditions(cell));
            let (delays, limits) = composite.characterise(cell.kind, &conditions);
            timing.set(CellId::new(index), delays);
            if cell.kind.is_flip_flop() {
                timing.set_limits(CellId::new(index), limits);
            }
        }
        CharacterisedNetlist {
            timing,
            drives: self.drives,
            nets: self.nets,
            blocks: self.blocks,
        }
    }
}
