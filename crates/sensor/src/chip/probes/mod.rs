//! Where the nets and cells inside the chip are: the only place that knows their names, besides the files that build the
//! circuits.
//!
//! ```text
//!   Probes::of_macropixel(netlist, row, col) ─┬─► probes.net(Probe::LocalStop)  ─► NetId
//!                                             ├─► probes.bus(Probe::Shift)      ─► NetIds, bit 0 first
//!   LoadProbe::Write.net(netlist)             ├─► probes.bin(3)                 ─► NetIds of a bin's count
//!   SensorPins::find(netlist)                 └─► probes.path(Probe::Strobe)    ─► dotted path, for viewers
//! ```
//!
//! | file | what it has |
//! |---|---|
//! | this | [`Probes`] of a macropixel |
//! | `probe` | [`Probe`]: what there is in a macropixel, and its path |
//! | `readout` | [`ReadProbe`]s of the readout |
//! | `load_path` | [`LoadProbe`]s and memories of the load path |
//! | `pins` | [`SensorPins`], [`LoadPins`] and [`ReadPins`], which a tester drives |
//!
//! Handles are resolved once, by a hash look-up for each part of a path. A circuit that has only some of a macropixel's
//! blocks (a P-counter on a test bench) has only some of the probes; asking for another is a bug of ours, and panics.

mod load_path;
mod pins;
mod probe;
mod readout;
#[cfg(test)]
mod tests;

pub use load_path::{LoadProbe, memories, memory_path};
pub use pins::{LoadPins, ReadPins, SensorPins};
pub(crate) use probe::spad_path;
pub use probe::{Probe, bin_path};
pub use readout::ReadProbe;

use std::collections::HashSet;

use self::probe::{FRONT_END, METDC, P_COUNTER, P_COUNTER_TIMING, join};
use super::array;
use crate::netlist::{CellId, CellKind, FlatCell, NetId, Netlist, ScopeId};

/// Handles of one macropixel.
#[derive(Debug, Clone)]
pub struct Probes {
    path: String,
    /// By probe; empty where the circuit has none.
    nets: Vec<Vec<NetId>>,
    /// Toggle flip-flop's output by SPAD; none where SPADs share the wire before it.
    toggles: Vec<NetId>,
    bins: Vec<Vec<NetId>>,
}

impl Probes {
    /// Handles of the macropixel at a row and column of an elaborated sensor, or of a part of one.
    ///
    /// # Panics
    /// When the netlist has no such macropixel.
    pub fn of_macropixel(netlist: &Netlist, row: usize, col: usize) -> Self {
        let name = array::pixel_name(row, col);
        assert!(netlist.scope(&name).is_some(), "no macropixel {name}");
        Self::below_instance(netlist, &name)
    }

    /// Handles of what there is of a macropixel below the instance at `path`; an empty path is the top itself.
    pub fn below_instance(netlist: &Netlist, path: &str) -> Self {
        Self::resolve(netlist, path, |probe| probe.path(path))
    }

    /// Handles in a netlist whose top is one block of a macropixel, such as a P-counter: its pins and inner nets.
    pub fn of_block(netlist: &Netlist) -> Self {
        Self::resolve(netlist, "", |probe| probe.name().to_owned())
    }

    fn resolve(netlist: &Netlist, path: &str, place: impl Fn(Probe) -> String) -> Self {
        let nets = |probe| netlist.signal(&place(probe)).unwrap_or_default();
        let toggle = |spad| netlist.net(&join([&spad_path(path, spad), "TOGGLE"]));
        let bin = |bin| netlist.signal(&bin_path(path, bin));
        Probes {
            nets: Probe::ALL.into_iter().map(nets).collect(),
            toggles: (0..).map_while(toggle).collect(),
            bins: (0..).map_while(bin).collect(),
            path: path.to_owned(),
        }
    }

    /// Dotted path of the macropixel.
    pub(crate) fn macropixel(&self) -> &str {
        &self.path
    }

    /// Dotted path of a probe.
    pub fn path(&self, probe: Probe) -> String {
        probe.path(&self.path)
    }

    /// Dotted path of a bin's count.
    pub(crate) fn bin_path(&self, bin: usize) -> String {
        bin_path(&self.path, bin)
    }

    /// Nets of a probe, bit 0 first, if the circuit has it.
    pub fn find(&self, probe: Probe) -> Option<&[NetId]> {
        let nets = self.nets[probe as usize].as_slice();
        (!nets.is_empty()).then_some(nets)
    }

    /// Nets of a probe, bit 0 first.
    ///
    /// # Panics
    /// When the circuit does not have it.
    pub fn bus(&self, probe: Probe) -> &[NetId] {
        let missing = || panic!("the circuit has no {}", self.path(probe));
        self.find(probe).unwrap_or_else(missing)
    }

    /// What STROBE sets: HIT, or START of a counter TDC.
    pub(crate) fn latched_probe(&self) -> Probe {
        match self.find(Probe::Start) {
            Some(_) => Probe::Start,
            None => Probe::Hit,
        }
    }

    /// Its nets.
    pub(crate) fn latched(&self) -> &[NetId] {
        self.bus(self.latched_probe())
    }

    /// The net of a probe of one bit, or the first of several.
    ///
    /// # Panics
    /// When the circuit does not have it.
    pub fn net(&self, probe: Probe) -> NetId {
        self.bus(probe)[0]
    }

    /// Output of the toggle flip-flop of each SPAD; none where SPADs share the wire before it.
    pub(crate) fn toggles(&self) -> &[NetId] {
        &self.toggles
    }

    /// Count of each bin, bin 0 earliest, bit 0 first.
    pub fn bins(&self) -> &[Vec<NetId>] {
        &self.bins
    }

    /// Count of a bin, bit 0 first.
    pub(crate) fn bin(&self, bin: usize) -> &[NetId] {
        &self.bins[bin]
    }

    /// The flip-flops of a bin's count, bit 0 first.
    ///
    /// # Panics
    /// When the circuit does not have it.
    pub(crate) fn bin_cells(&self, netlist: &Netlist, bin: usize) -> Vec<CellId> {
        let cell = |bit| {
            join([
                &self.path,
                "histogram",
                &format!("bin_{bin}"),
                &format!("bit_{bit}"),
            ])
        };
        cells(netlist, (0..self.bin(bin).len()).map(cell))
    }

    /// The toggle flip-flop of each SPAD.
    pub(crate) fn toggle_cells(&self, netlist: &Netlist) -> Vec<CellId> {
        let cell = |spad| spad_path(&self.path, spad) + ".toggle";
        cells(netlist, (0..self.toggles.len()).map(cell))
    }

    /// The front end's first samplers: flip-flops that CLK clocks and whose D follows SPADs, so that it breaks setup and hold by
    /// design; a second one gives them a period to make up their minds.
    pub(crate) fn samplers<'n>(
        &self,
        netlist: &'n Netlist,
    ) -> impl Iterator<Item = CellId> + use<'n> {
        self.clocked_behind(netlist, FRONT_END, Probe::SpadRaw)
    }

    /// The stages of the METDC that take SPAD_EVENT.
    pub(crate) fn event_stages<'n>(
        &self,
        netlist: &'n Netlist,
    ) -> impl Iterator<Item = CellId> + use<'n> {
        self.clocked_behind(netlist, METDC, Probe::SpadEvent)
    }

    /// The flip-flops of a counter TDC that take START.
    pub(crate) fn start_samplers<'n>(
        &self,
        netlist: &'n Netlist,
    ) -> impl Iterator<Item = CellId> + use<'n> {
        self.clocked_behind(netlist, METDC, Probe::Start)
    }

    /// Flip-flops of a block that CLK clocks and whose D edges of `from` reach.
    fn clocked_behind<'n>(
        &self,
        netlist: &'n Netlist,
        block: &str,
        from: Probe,
    ) -> impl Iterator<Item = CellId> + use<'n> {
        let cells = self.block_cells(netlist, block);
        let from = self.find(from).unwrap_or_default();
        let reached = reached(netlist, cells.clone(), from);
        let clk = self.net(Probe::Clk);
        cells.filter(move |&cell| {
            let cell = &netlist.cells()[cell.index()];
            cell.kind.is_flip_flop() && cell.input(1) == clk && reached.contains(&cell.input(0))
        })
    }

    /// The cells of a block of the macropixel, or all of those of a block alone.
    fn block_cells(
        &self,
        netlist: &Netlist,
        block: &str,
    ) -> impl Iterator<Item = CellId> + Clone + use<> {
        let scope = netlist.scope(&join([&self.path, block]));
        netlist.cells_below(scope.unwrap_or(ScopeId::TOP))
    }

    /// The end of each pulse shaper's delay chain, by SPAD.
    pub(crate) fn shaper_ends(&self, netlist: &Netlist) -> Vec<NetId> {
        let late = |spad| {
            let shaper = format!("shaper_{spad}");
            netlist.net(&join([&self.path, FRONT_END, &shaper, "LATE"]))
        };
        (0..).map_while(late).collect()
    }

    /// The stages of the METDC's shift register, the first one first.
    pub(crate) fn shift_cells(&self, netlist: &Netlist) -> Vec<CellId> {
        let cell = |stage| join([&self.path, METDC, &format!("shift_{stage}")]);
        cells(netlist, (0..self.bus(Probe::Shift).len()).map(cell))
    }

    /// The HIT flip-flop of each bin, or that of a counter TDC's START.
    ///
    /// # Panics
    /// When something else drives a HIT.
    pub fn hit_cells(&self, netlist: &Netlist) -> Vec<CellId> {
        let cells = self.find_hit_cells(netlist);
        cells.expect("a METDC of one's own has been checked")
    }

    /// The HIT flip-flop of each bin, if each is one's output.
    pub(crate) fn find_hit_cells(&self, netlist: &Netlist) -> Option<Vec<CellId>> {
        let cells = self.block_cells(netlist, METDC);
        let drives = |cell: &FlatCell, hit: NetId| {
            cell.kind.is_flip_flop() && cell.outputs.contains(&Some(hit))
        };
        let of_hit = |&hit| {
            cells
                .clone()
                .find(|&cell| drives(&netlist.cells()[cell.index()], hit))
        };
        self.latched().iter().map(of_hit).collect()
    }

    /// Every cell of the P-counter timing block.
    ///
    /// # Panics
    /// When the circuit has none.
    pub fn timing_block_cells(
        &self,
        netlist: &Netlist,
    ) -> impl Iterator<Item = CellId> + Clone + use<> {
        cells_of(netlist, &join([&self.path, P_COUNTER_TIMING]))
    }

    /// The flip-flops of the P-counter, its memory excepted.
    ///
    /// # Panics
    /// When the circuit has no P-counter.
    pub(crate) fn counter_cells(&self, netlist: &Netlist) -> Vec<CellId> {
        let cells = cells_of(netlist, &self.p_counter());
        let is_flip_flop = |&cell: &CellId| netlist.cells()[cell.index()].kind.is_flip_flop();
        cells.filter(is_flip_flop).collect()
    }

    /// The P-counter's flip-flops in the netlist of a macropixel alone, in the order in which they are described.
    pub fn p_counter_cells(macropixel: &Netlist) -> Vec<CellId> {
        let cells = cells_of(macropixel, P_COUNTER);
        let is_flip_flop = |&cell: &CellId| macropixel.cells()[cell.index()].kind.is_flip_flop();
        cells.filter(is_flip_flop).collect()
    }

    /// Dotted path of the P-counter.
    pub fn p_counter(&self) -> String {
        join([&self.path, P_COUNTER])
    }

    /// The inverse of ENABLE, which resets the P-counter and keeps CLK from it.
    ///
    /// # Panics
    /// When the circuit has no P-counter timing block.
    pub(crate) fn disabled(&self, netlist: &Netlist) -> NetId {
        let enable = self.net(Probe::Enable);
        let mut cells = self
            .timing_block_cells(netlist)
            .map(|cell| &netlist.cells()[cell.index()]);
        let inverter = cells.find(|cell| cell.kind == CellKind::Inv && cell.input(0) == enable);
        let inverter = inverter.expect("ENABLE has an inverter");
        inverter.outputs[0].expect("its output is read")
    }

    /// What makes COUNTER_RESET besides the pulse at STOP: reset and ENABLE.
    ///
    /// # Panics
    /// When the circuit has no P-counter timing block.
    pub(crate) fn counter_clear(&self, netlist: &Netlist) -> NetId {
        let (reset, pulse) = (self.net(Probe::CounterReset), self.net(Probe::ResetPulse));
        let mut drivers = self
            .timing_block_cells(netlist)
            .map(|cell| &netlist.cells()[cell.index()]);
        let or = drivers.find(|cell| cell.outputs[0] == Some(reset));
        let or = or.expect("COUNTER_RESET has a driver");
        if or.input(0) == pulse {
            or.input(1)
        } else {
            or.input(0)
        }
    }
}

/// Nets that edges of these come to within some cells, through gates, clocks, resets and sets.
pub(crate) fn reached(
    netlist: &Netlist,
    cells: impl Iterator<Item = CellId> + Clone,
    from: &[NetId],
) -> HashSet<NetId> {
    let mut reached: HashSet<NetId> = from.iter().copied().collect();
    loop {
        let before = reached.len();
        for cell in cells.clone().map(|cell| &netlist.cells()[cell.index()]) {
            let mut pins = (0..cell.kind.inputs().len()).filter(|&pin| cell.kind.triggers(pin));
            if pins.any(|pin| reached.contains(&cell.input(pin))) {
                reached.extend(cell.output_nets());
            }
        }
        if reached.len() == before {
            return reached;
        }
    }
}

fn cells(netlist: &Netlist, paths: impl Iterator<Item = String>) -> Vec<CellId> {
    let cell = |path: String| {
        let cell = netlist.cell(&path);
        cell.unwrap_or_else(|| panic!("the circuit has no {path}"))
    };
    paths.map(cell).collect()
}

fn cells_of(netlist: &Netlist, path: &str) -> impl Iterator<Item = CellId> + Clone + use<> {
    let scope = netlist.scope(path);
    netlist.cells_of(scope.unwrap_or_else(|| panic!("the circuit has no {path}")))
}

fn top_bus(netlist: &Netlist, path: &str) -> Vec<NetId> {
    let nets = netlist.signal(path);
    nets.unwrap_or_else(|| panic!("the netlist has no {path}"))
}
