//! When the signals of one macropixel change, earliest and latest, by static timing of its netlist.
//!
//! ```text
//!   CLK rises ──► SHIFT, SPAD_EVENT            STOP rises ──► COUNTER_RESET rises ──► stages, LOCAL_STOP, HIT fall
//!   CLK falls ──► COUNTER_CLK ─► LOCAL_STOP ─► STROBE    └──► COUNTER_RESET falls ──► HIT's reset ends
//!                                    └─► BLOCK           └──► RUN ──► ENABLE, COUNTER_CLK    (first and last cycle)
//! ```
//!
//! The netlist is the one that the gate engine simulates. Static timing knows of no values: its bounds hold whatever the
//! values are, so an order that they decide is the order of the simulated events. What a question is *not* about is cut
//! from the graph, and each cut says why:
//!
//! * HIT: a bin that is full blocks its own clock, a loop within the histogram that leads nowhere else.
//! * BLOCK: LOCAL_STOP blocks COUNTER_CLK, which is the next question, not this one.
//! * RUN (the macropixels' ENABLE): it changes with STOP, but only before the first and after the last laser cycle.
//! * Clocks of the P-counter's stages during a reset: the flip-flops behind them are held.

mod counter;
mod delays;

use std::sync::OnceLock;

use super::cell_library::CellLibrary;
use super::silicon::Silicon;
use crate::chip::{LoadProbe, Probe, Probes, SensorConfig, Tdc, array};
use crate::netlist::{
    Arrivals, CellId, CellKind, Corner, Edge, FlatCell, NetId, Netlist, Requirement, ScopeId,
    StaticTiming, Timing,
};
use crate::units::Time;
pub use counter::CounterDelays;
pub use delays::{MacropixelDelays, ShaperDelays};

/// Earliest and latest.
pub type DelaySpan = (Time, Time);

/// The width of a span.
pub fn spread(span: DelaySpan) -> Time {
    span.1 - span.0
}

/// The span from the earlier beginning to the later end.
pub(crate) fn hull(a: DelaySpan, b: DelaySpan) -> DelaySpan {
    (a.0.min(b.0), a.1.max(b.1))
}

/// A macropixel with its load path, as the gate engine has it, and its nets and cells, found once.
pub struct MacropixelCircuit {
    /// The netlist.
    pub netlist: Netlist,
    /// Handles of its nets.
    pub probes: Probes,
    toggles: Vec<CellId>,
    /// What CLK samples of SPADs where a toggle flip-flop of each does not say it: on a wire that they share, in a front end of one's own.
    sampled: Vec<NetId>,
    /// Whether SPADs share a wire.
    joins: bool,
    /// Ends of the pulse shapers' delay chains.
    late: Vec<NetId>,
    hits: Vec<CellId>,
    /// Data of which a CLK edge takes what the last one made: SPAD_EVENT, and all that CLK samples where blocks are one's own.
    clocked: Vec<NetId>,
    /// The P-counter's flip-flops, memory excepted.
    counting: Vec<CellId>,
    /// COUNTER_RESET's cause besides STOP.
    clear: NetId,
    /// The inverse of ENABLE.
    disabled: NetId,
    /// Path of each cell before and, where the macropixel is in it, after its name.
    cell_paths: OnceLock<Vec<(String, Option<String>)>>,
    /// Delays of the library's cells: a macropixel in a Liberty file's takes milliseconds.
    cell_timing: OnceLock<(CellLibrary, Corner, Timing)>,
}

impl MacropixelCircuit {
    /// The macropixel at `position` (row, column) of a sensor: its cells' names, and so their mismatch, depend on that. Times are by
    /// its own CLK and STOP, whenever they come to its column.
    pub(crate) fn new(config: &SensorConfig, position: (usize, usize)) -> Self {
        let unskewed = SensorConfig {
            clk_skew_ps: 0.0,
            ..config.clone()
        };
        let netlist = Netlist::elaborate(&array::subarray(&unskewed, position, (1, 1)));
        let probes = Probes::of_macropixel(&netlist, position.0, position.1);
        let clk = probes.net(Probe::Clk);
        let data = |cell: &FlatCell| {
            let is_clocked = cell.kind.is_flip_flop() && cell.input(1) == clk;
            is_clocked.then(|| cell.input(0))
        };
        let has_own = config.front_end_block.is_some() || config.metdc_block.is_some();
        let adds = config.tdc == Tdc::Counter;
        let event = probes.find(Probe::SpadEvent).unwrap_or_default();
        MacropixelCircuit {
            clocked: if has_own || adds {
                netlist.cells().iter().filter_map(data).collect()
            } else {
                event.to_vec()
            },
            toggles: probes.toggle_cells(&netlist),
            joins: config.front_end.joins(),
            sampled: if config.front_end.joins() || config.front_end_block.is_some() {
                probes
                    .samplers(&netlist)
                    .map(|cell| netlist.cells()[cell.index()].input(0))
                    .collect()
            } else {
                Vec::new()
            },
            late: probes.shaper_ends(&netlist),
            hits: probes.hit_cells(&netlist),
            counting: probes.counter_cells(&netlist),
            clear: probes.counter_clear(&netlist),
            disabled: probes.disabled(&netlist),
            cell_paths: OnceLock::new(),
            cell_timing: OnceLock::new(),
            probes,
            netlist,
        }
    }

    /// Delays in this silicon of the macropixel at another `position` (row, column), which differs in the names of its cells only.
    pub(crate) fn timing_at(&self, silicon: &Silicon, position: (usize, usize)) -> Timing {
        let split = |cell| {
            let path = self.netlist.cell_path(cell);
            match path.split_once(self.probes.macropixel()) {
                Some((before, after)) => (before.to_owned(), Some(after.to_owned())),
                None => (path, None),
            }
        };
        let paths = self.cell_paths.get_or_init(|| {
            let cells = self.netlist.cells_below(ScopeId::TOP);
            cells.map(split).collect()
        });
        let name = array::pixel_name(position.0, position.1);
        let path = |cell: CellId| match &paths[cell.index()] {
            (path, None) => path.clone(),
            (before, Some(after)) => [before, name.as_str(), after].concat(),
        };
        let of_library = || silicon.cell_timing(&self.netlist);
        let cells = (silicon.cell_library, silicon.corner);
        let (library, corner, known) = self
            .cell_timing
            .get_or_init(|| (cells.0, cells.1, of_library()));
        let timing = if (*library, *corner) == cells {
            known.clone()
        } else {
            of_library()
        };
        silicon.timing_of(&self.netlist, timing, path)
    }

    /// Its paths with these delays, which must be of its netlist.
    pub(crate) fn paths<'c>(&'c self, timing: &'c Timing) -> MacropixelPaths<'c> {
        MacropixelPaths {
            circuit: self,
            timing,
            analysis: StaticTiming::new(&self.netlist, timing),
        }
    }

    /// The P-counter's flip-flops whose clock is COUNTER_CLK itself, or what a divider leaves of it: of a ripple counter the
    /// first one, and of the divider.
    pub(crate) fn clocked_by_counter_clk(&self) -> impl Iterator<Item = CellId> + '_ {
        let counter_clk = self.probes.net(Probe::CounterClk);
        let divided = self.probes.find(Probe::StepClk).map(|nets| nets[0]);
        let all = self.counting.iter().copied();
        all.filter(move |&cell| {
            let clock = self.pin(cell, 1);
            clock == counter_clk || Some(clock) == divided
        })
    }

    /// Of what flip-flops ask of CLK, that of HIT, which catches the strobe, and the rest. The flip-flops that sample SPADs are left out by
    /// design: their data come at any time.
    /// So are those that sample START of a counter TDC, unless `with_start`.
    pub(crate) fn split(
        &self,
        asked: &[Requirement],
        with_start: bool,
    ) -> (Vec<Requirement>, Vec<Requirement>) {
        let of_start = self.probes.start_samplers(&self.netlist);
        let samplers = self.probes.samplers(&self.netlist);
        let samplers: Vec<CellId> = samplers.chain(of_start.filter(|_| !with_start)).collect();
        let asked = asked
            .iter()
            .filter(|r| !(r.kind.concerns_data() && samplers.contains(&r.cell)));
        asked.copied().partition(|r| self.hits.contains(&r.cell))
    }

    /// Kinds of the P-counter's flip-flops, memory excepted.
    pub(crate) fn counting_kinds(&self) -> impl Iterator<Item = CellKind> + '_ {
        let counting = self.counting.iter();
        counting.map(|&cell| self.netlist.cells()[cell.index()].kind)
    }

    /// The clock that freezes the window: of the delay lines' samples, or of the HIT flip-flops.
    fn sampling(&self) -> NetId {
        let of_lines = self.probes.find(Probe::SampleClk);
        of_lines.map_or_else(|| self.hit_pin(1), |nets| nets[0])
    }

    /// Whether a shift register times photons.
    fn is_clocked(&self) -> bool {
        self.probes.find(Probe::SpadEvent).is_some()
    }

    /// An input that the HIT flip-flops share: STROBE, their clock, or HIT_RESET.
    fn hit_pin(&self, pin: usize) -> NetId {
        self.pin(self.hits[0], pin)
    }

    fn pin(&self, cell: CellId, pin: usize) -> NetId {
        self.netlist.cells()[cell.index()].input(pin)
    }
}

/// One macropixel with its delays, to be asked what follows an edge.
pub struct MacropixelPaths<'c> {
    circuit: &'c MacropixelCircuit,
    timing: &'c Timing,
    analysis: StaticTiming<'c>,
}

impl<'c> MacropixelPaths<'c> {
    /// The static timing of the whole netlist, for other questions.
    pub(crate) fn analysis(&self) -> &StaticTiming<'c> {
        &self.analysis
    }

    /// What an edge of CLK changes.
    pub(crate) fn after_clk(&self, edge: Edge) -> Arrivals<'c> {
        self.arrivals_after(
            Probe::Clk,
            &[edge],
            &[
                self.circuit.probes.latched_probe(),
                Probe::Block,
                Probe::Enable,
            ],
        )
    }

    /// What STOP's rise changes, up to the resets that it makes and the strobe of the conventional mode.
    pub(crate) fn after_stop(&self) -> Arrivals<'c> {
        let latched = self.circuit.probes.latched_probe();
        let cuts = [latched, Probe::Enable, Probe::CounterReset];
        let cuts = cuts
            .iter()
            .flat_map(|&cut| self.circuit.probes.bus(cut))
            .copied();
        let of_hit = [1, 2].map(|pin| self.circuit.hit_pin(pin));
        let cuts: Vec<NetId> = cuts.chain(of_hit).collect();
        let stop = (self.circuit.probes.net(Probe::Stop), Edge::Rise);
        let arrivals = self.analysis.arrivals(&[stop], &cuts);
        arrivals.expect("every loop is cut")
    }

    /// What an edge of LOAD_CLK changes, LOCAL_STOP left out: it does not belong to the load.
    fn after_load_clk(&self, edge: Edge) -> Arrivals<'c> {
        let clk = (LoadProbe::Clk.net(&self.circuit.netlist), edge);
        let cuts = [self.circuit.probes.net(Probe::LocalStop)];
        let arrivals = self.analysis.arrivals(&[clk], &cuts);
        arrivals.expect("every loop is cut")
    }

    /// What an edge of COUNTER_RESET changes. LOCAL_STOP, which falls, may let COUNTER_CLK rise.
    pub(crate) fn after_counter_reset(&self, edge: Edge) -> Arrivals<'c> {
        let reset = (self.circuit.probes.net(Probe::CounterReset), edge);
        let hit = self.circuit.probes.latched().iter().copied();
        let cuts = hit.chain([self.circuit.hit_pin(1)]);
        let cuts: Vec<NetId> = cuts.chain(self.stage_clocks()).collect();
        let arrivals = self.analysis.arrivals(&[reset], &cuts);
        arrivals.expect("every loop is cut")
    }

    /// What a change of RUN, the macropixels' ENABLE, changes.
    pub(crate) fn after_enable(&self) -> Arrivals<'c> {
        let cuts = [Probe::CounterReset, Probe::CounterClk];
        self.arrivals_after(Probe::Enable, &Edge::BOTH, &cuts)
    }

    /// The flip-flop of a bin's lowest bit, and HIT's rise (latest) and fall (earliest) → its clock. None where HIT does not clock it.
    fn hit_to_count(&self) -> Option<(CellKind, Time, Time)> {
        let probes = &self.circuit.probes;
        let hit = probes.find(Probe::Hit)?[0];
        let count = probes.bin(0)[0];
        let mut cells = self.circuit.netlist.cells().iter();
        let flip_flop =
            cells.find(|cell| cell.kind.is_flip_flop() && cell.outputs.contains(&Some(count)))?;
        let clock = flip_flop.input(1);
        if clock == hit {
            return Some((flip_flop.kind, Time::ZERO, Time::ZERO));
        }
        let [rise, fall] = Edge::BOTH.map(|edge| {
            let arrivals = self.analysis.arrivals(&[(hit, edge)], &[clock]);
            let arrivals = arrivals.expect("every loop is cut");
            arrivals.edge_window(clock, edge)
        });
        Some((flip_flop.kind, rise?.1, fall?.0))
    }

    /// BLOCK rises → COUNTER_CLK falls, earliest.
    fn block_to_counter_clk(&self) -> Option<Time> {
        self.circuit.probes.find(Probe::Block)?;
        let cuts = [Probe::CounterClk, self.circuit.probes.latched_probe()];
        let blocked = self.arrivals_after(Probe::Block, &[Edge::Rise], &cuts);
        let counter_clk = self.circuit.probes.net(Probe::CounterClk);
        Some(blocked.edge_window(counter_clk, Edge::Fall)?.0)
    }

    /// TOGGLE → PHOTONS, of all SPADs and either edge.
    fn joining(&self) -> Option<DelaySpan> {
        let probes = &self.circuit.probes;
        let photons = probes.find(Probe::Photons)?[0];
        let arrival_window = |&toggle: &NetId| {
            let starts = Edge::BOTH.map(|edge| (toggle, edge));
            let arrivals = self.analysis.arrivals(&starts, probes.latched());
            arrivals.expect("every loop is cut").window(photons)
        };
        probes
            .toggles()
            .iter()
            .filter_map(arrival_window)
            .reduce(hull)
    }

    fn arrivals_after(&self, from: Probe, edges: &[Edge], cuts: &[Probe]) -> Arrivals<'c> {
        let probes = &self.circuit.probes;
        let starts: Vec<(NetId, Edge)> =
            edges.iter().map(|&edge| (probes.net(from), edge)).collect();
        let cuts: Vec<NetId> = cuts
            .iter()
            .flat_map(|&cut| probes.bus(cut))
            .copied()
            .collect();
        self.analysis
            .arrivals(&starts, &cuts)
            .expect("every loop is cut")
    }

    /// Clocks of the P-counter's flip-flops.
    fn stage_clocks(&self) -> impl Iterator<Item = NetId> + '_ {
        let counting = self.circuit.counting.iter();
        counting.map(|&cell| self.circuit.pin(cell, 1))
    }

    /// A stage's clock rises → the clock of a stage behind it rises, latest; stages are what CLK's fall, `fall`, reaches.
    fn stage_to_stage_clock(&self, fall: &Arrivals<'_>) -> Option<Time> {
        let counter_clk = self.circuit.probes.net(Probe::CounterClk);
        let is_stage = |clock: &NetId| fall.window(*clock).is_some();
        let mut clocks: Vec<NetId> = self.stage_clocks().filter(is_stage).collect();
        clocks.sort_unstable();
        clocks.dedup();
        let behind = |clock: NetId| {
            let others = clocks.iter().copied().filter(move |&other| other != clock);
            let others: Vec<NetId> = others.collect();
            let cuts = [&others[..], &[counter_clk], self.circuit.probes.latched()].concat();
            let cuts: Vec<NetId> = cuts.into_iter().filter(|&net| net != clock).collect();
            let arrivals = self.analysis.arrivals(&[(clock, Edge::Rise)], &cuts);
            let arrivals = arrivals.expect("every loop is cut");
            let later = others.into_iter().filter(|&other| other != counter_clk);
            latest(later.map(|other| arrivals.edge_window(other, Edge::Rise)))
        };
        clocks.iter().filter_map(|&clock| behind(clock)).max()
    }

    /// Clock → an output rises, falls, of one flip-flop.
    fn clock_to_q(&self, cell: CellId, output: usize) -> (Time, Time) {
        let clock = self.timing.cell_delays(cell)[1][output];
        (clock.rise(), clock.fall())
    }

    /// SPAD_RAW rises → what CLK samples, of each SPAD.
    pub(crate) fn front_end_latency(&self) -> Vec<DelaySpan> {
        if self.circuit.sampled.is_empty() {
            let toggles = self.circuit.toggles.iter();
            return toggles.map(|&toggle| self.clock_to_q(toggle, 0)).collect();
        }
        let raw = self.circuit.probes.bus(Probe::SpadRaw).iter();
        let of_spad = |&raw: &NetId| {
            let after = self.after_spad(raw, Edge::Rise);
            let sampled = self.circuit.sampled.iter();
            let of_edges = Edge::BOTH.map(|edge| {
                let spans = sampled
                    .clone()
                    .filter_map(|&net| after.edge_window(net, edge));
                spans.reduce(hull)
            });
            let [rise, fall] = of_edges;
            let either = of_edges.into_iter().flatten().reduce(hull);
            let either = either.expect("CLK samples every SPAD");
            // Of toggle flip-flops the first is the rise, as above.
            match (rise, fall) {
                (Some(rise), Some(fall)) if !self.circuit.joins => (rise.0, fall.1),
                _ => either,
            }
        };
        raw.map(of_spad).collect()
    }

    /// Delays of the slowest pulse shaper.
    fn shaper_delays(&self) -> Option<ShaperDelays> {
        let probes = &self.circuit.probes;
        let shaped = probes.find(Probe::Shaped)?.iter();
        let raw = probes.bus(Probe::SpadRaw).iter();
        let of_spad = |(&raw, (&shaped, &late)): (&NetId, (&NetId, &NetId))| {
            let rise = self.after_spad(raw, Edge::Rise);
            let fall = self.after_spad(raw, Edge::Fall);
            ShaperDelays {
                width: edge(&rise, shaped, Edge::Fall).1 - edge(&rise, shaped, Edge::Rise).0,
                recovery: edge(&fall, late, Edge::Rise).1,
            }
        };
        let all = raw.zip(shaped.zip(&self.circuit.late)).map(of_spad);
        all.reduce(|a, b| ShaperDelays {
            width: a.width.max(b.width),
            recovery: a.recovery.max(b.recovery),
        })
    }

    /// What an edge of one SPAD changes.
    fn after_spad(&self, raw: NetId, edge: Edge) -> Arrivals<'c> {
        let hit = self.circuit.probes.latched();
        let arrivals = self.analysis.arrivals(&[(raw, edge)], hit);
        arrivals.expect("a front end has no loops")
    }

    /// Fastest and slowest arc of every cell of some kinds.
    fn arcs(&self, is: impl Fn(CellKind) -> bool) -> impl Iterator<Item = Option<DelaySpan>> {
        let netlist = &self.circuit.netlist;
        let cells = netlist.cells_below(ScopeId::TOP).zip(netlist.cells());
        cells
            .filter(move |(_, leaf)| is(leaf.kind))
            .map(|(cell, leaf)| {
                let pins = 0..leaf.kind.inputs().len();
                let arcs = pins.filter(|&pin| leaf.kind.triggers(pin)).flat_map(|pin| {
                    let arcs = &self.timing.cell_delays(cell)[pin][..leaf.kind.outputs().len()];
                    arcs.iter().flat_map(|arc| [arc.rise(), arc.fall()])
                });
                arcs.map(|delay| (delay, delay)).reduce(hull)
            })
    }
}

fn edge(arrivals: &Arrivals<'_>, net: NetId, edge: Edge) -> DelaySpan {
    let window = arrivals.edge_window(net, edge);
    window.expect("the macropixel connects these")
}

fn changes(arrivals: &Arrivals<'_>, net: NetId) -> DelaySpan {
    arrivals.window(net).expect("the macropixel connects these")
}

fn latest(windows: impl Iterator<Item = Option<DelaySpan>>) -> Option<Time> {
    windows.flatten().map(|window| window.1).max()
}

fn earliest(windows: impl Iterator<Item = Option<DelaySpan>>) -> Option<Time> {
    windows.flatten().map(|window| window.0).min()
}
