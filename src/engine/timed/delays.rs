//! When the signals of one macropixel change: earliest and latest, from the delays of its own cells.
//!
//! ```text
//!   CLK rises ──► SHIFT, SPAD_EVENT            STOP rises ──► COUNTER_RESET rises ──► stages, LOCAL_STOP, HIT fall
//!   CLK falls ──► COUNTER_CLK ─► LOCAL_STOP ─► STROBE    └──► COUNTER_RESET falls ──► HIT's reset ends
//!                                    └─► BLOCK           └──► RUN ──► CLEAR, COUNTER_CLK     (first and last cycle)
//! ```
//!
//! Static timing of the netlist that the gate engine simulates. Its bounds hold whatever the values are, so an order that
//! they decide is the order of the simulated events. Loops (LOCAL_STOP blocks COUNTER_CLK) are cut where one part's
//! question ends and the next one's begins.

use crate::chip::{Mode, Probe, Probes, SPADS, SensorConfig, sensor};
use crate::logic::Logic::{One, Zero};
use crate::netlist::{Arrivals, CellKind, Edge, NetId, Netlist, StaticTiming, Timing};
use crate::units::Time;

/// Earliest and latest.
pub type Span = (Time, Time);

/// The width of a span.
pub fn spread(span: Span) -> Time {
    span.1 - span.0
}

/// The netlist of a macropixel and the nets that matter, found once for all macropixels.
pub struct Anatomy {
    /// A macropixel with its load path, as the gate engine has it. Only names depend on its position.
    pub netlist: Netlist,
    /// Path of each cell before and, where the macropixel is in it, after its name.
    paths: Vec<(String, Option<String>)>,
    mode: Mode,
    clk: NetId,
    stop: NetId,
    run: NetId,
    block: NetId,
    clear: NetId,
    counter_clk: NetId,
    counter_reset: NetId,
    local_stop: NetId,
    strobe: NetId,
    hit_reset: NetId,
    event: NetId,
    shift: Vec<NetId>,
    hit: Vec<NetId>,
    toggles: [usize; SPADS],
    /// The P-counter's flip-flops, memory excepted.
    counting: Vec<usize>,
}

/// Delays of one macropixel.
#[derive(Debug, Clone)]
pub struct Delays {
    /// SPAD_RAW rises → TOGGLE rises, falls; of each SPAD.
    pub latency: [(Time, Time); SPADS],
    /// CLK rises → SPAD_EVENT settled, latest.
    pub event: Time,
    /// CLK rises → the stage of SHIFT changes that each bin's HIT takes, bin 0 first.
    pub shift: Vec<Span>,
    /// CLK falls (guided) or STOP rises (conventional) → STROBE rises.
    pub strobe: Span,
    /// COUNTER_RESET falls (guided) or STOP rises (conventional) → HIT's reset ends.
    pub hit_release: Span,
    /// The slowest arc of any cell.
    pub slowest: Time,
    /// The slowest arc of an AND.
    pub slowest_and: Time,
    /// The fastest arc of a flip-flop.
    pub fastest_flip_flop: Time,
    /// What the guided mode needs.
    pub counter: Option<CounterDelays>,
}

/// Delays of a P-counter with its timing block.
#[derive(Debug, Clone)]
pub struct CounterDelays {
    /// CLK falls → COUNTER_CLK rises.
    pub counter_clk: Span,
    /// CLK falls → LOCAL_STOP rises.
    pub local_stop: Span,
    /// CLK falls → LOCAL_STOP → BLOCK rises, latest; none where LOCAL_STOP does not block.
    pub block: Option<Time>,
    /// COUNTER_CLK rises → data of the flip-flops that it clocks settled, latest.
    pub settled: Time,
    /// STOP rises → COUNTER_RESET rises.
    pub reset: Span,
    /// STOP rises → COUNTER_RESET falls.
    pub release: Span,
    /// COUNTER_RESET falls → the last flip-flop is released, latest.
    pub released: Time,
    /// COUNTER_RESET rises → the last edge at a stage's clock, latest.
    pub reset_edges: Time,
    /// COUNTER_RESET rises → data of the flip-flops that COUNTER_CLK clocks settled, latest.
    pub reset_settled: Time,
    /// COUNTER_RESET rises → HIT's reset begins.
    pub hit_reset: Span,
    /// COUNTER_RESET rises → HIT has fallen, latest.
    pub hit_falls: Time,
    /// STOP rises → RUN changes → COUNTER_RESET's other cause changes.
    pub clear: Span,
    /// STOP rises → RUN changes → COUNTER_CLK changes, latest.
    pub enabled: Time,
}

impl Anatomy {
    /// Finds the nets of this sensor's macropixels.
    pub fn new(config: &SensorConfig) -> Self {
        let netlist = Netlist::elaborate(&sensor::window(config, (0, 0), (1, 1)));
        let pixel = sensor::pixel_name(0, 0);
        let probes = Probes::of_macropixel(&netlist, 0, 0);
        let net = |probe| probes.net(probe);
        let toggles = probes.toggle_cells(&netlist);
        let paths = (0..netlist.cells().len()).map(|cell| {
            let path = netlist.cell_path(cell);
            match path.split_once(&pixel) {
                Some((before, after)) => (before.to_owned(), Some(after.to_owned())),
                None => (path, None),
            }
        });
        Anatomy {
            paths: paths.collect(),
            mode: config.mode,
            clk: net(Probe::Clk),
            stop: net(Probe::Stop),
            run: net(Probe::Enable),
            block: net(Probe::Block),
            clear: probes.counter_clear(&netlist),
            counter_clk: net(Probe::CounterClk),
            counter_reset: net(Probe::CounterReset),
            local_stop: net(Probe::LocalStop),
            strobe: net(Probe::Strobe),
            hit_reset: net(Probe::HitReset),
            event: net(Probe::SpadEvent),
            shift: probes.bus(Probe::Shift).to_vec(),
            hit: probes.bus(Probe::Hit).to_vec(),
            toggles: std::array::from_fn(|spad| toggles[spad]),
            counting: probes.counter_cells(&netlist),
            netlist,
        }
    }

    /// Path of a cell where the macropixel has another name.
    pub fn cell_path(&self, cell: usize, pixel: &str) -> String {
        match &self.paths[cell] {
            (path, None) => path.clone(),
            (before, Some(after)) => [before, pixel, after].concat(),
        }
    }

    /// Delays of the macropixel with this timing.
    pub fn delays(&self, timing: &Timing) -> Delays {
        let analysis = StaticTiming::new(&self.netlist, timing);
        let after = |net, edges: &[Edge], cuts: &[NetId]| {
            let starts: Vec<(NetId, Edge)> = edges.iter().map(|&edge| (net, edge)).collect();
            analysis.arrivals(&starts, cuts).expect("every loop is cut")
        };
        let cuts = |more: &[NetId]| [&self.hit, more].concat();
        let rise = after(self.clk, &[Edge::Rise], &cuts(&[self.counter_clk]));
        let ends = [self.run, self.counter_reset, self.strobe, self.hit_reset];
        let stop = after(self.stop, &[Edge::Rise], &cuts(&ends));
        // The newest event is in the first stage and goes into the last bin.
        let shift = self.shift.iter().rev().map(|&bit| changes(&rise, bit));
        let both = |cell: usize| {
            let clock = timing.of(cell)[1];
            let [rise, fall] = [One, Zero].map(|to| Time::from_fs(clock.to(to).into()));
            (rise, fall)
        };
        let mut delays = Delays {
            latency: self.toggles.map(both),
            event: changes(&rise, self.event).1,
            shift: shift.collect(),
            strobe: edge(&stop, self.strobe, Edge::Rise),
            hit_release: edge(&stop, self.hit_reset, Edge::Fall),
            slowest: latest(self.arcs(timing, |_| true)),
            slowest_and: latest(self.arcs(timing, |kind| kind == CellKind::And2)),
            fastest_flip_flop: earliest(self.arcs(timing, CellKind::is_flip_flop)),
            counter: None,
        };
        if self.mode == Mode::Conventional {
            return delays;
        }

        let fall = after(self.clk, &[Edge::Fall], &cuts(&[self.block]));
        let clocks: Vec<NetId> = self
            .counting
            .iter()
            .map(|&cell| self.pin(cell, 1))
            .collect();
        // A stage's clock goes no further in a reset: the flip-flop behind it is held.
        let resets = cuts(&[&clocks[..], &[self.strobe]].concat());
        let reset = after(self.counter_reset, &[Edge::Rise], &resets);
        let release = after(self.counter_reset, &[Edge::Fall], &resets);
        let run = after(
            self.run,
            &Edge::BOTH,
            &[self.counter_reset, self.counter_clk],
        );
        let run_changes = changes(&stop, self.run);
        let after_run = |net| {
            let (first, last) = changes(&run, net);
            (run_changes.0 + first, run_changes.1 + last)
        };
        let counter_clk = edge(&fall, self.counter_clk, Edge::Rise);
        let by_counter_clk = self.counting.iter().copied();
        let by_counter_clk = by_counter_clk.filter(|&cell| self.pin(cell, 1) == self.counter_clk);
        let data: Vec<NetId> = by_counter_clk.map(|cell| self.pin(cell, 0)).collect();
        let settled = |arrivals: &Arrivals<'_>| latest(data.iter().map(|&d| arrivals.window(d)));
        let clock_rises = clocks
            .iter()
            .map(|&clock| reset.edge_window(clock, Edge::Rise));
        let controls = self.counting.iter().flat_map(|&cell| {
            let leaf = &self.netlist.cells()[cell];
            leaf.inputs[2..leaf.kind.inputs().len()].iter()
        });
        delays.strobe = edge(&fall, self.strobe, Edge::Rise);
        delays.hit_release = edge(&release, self.hit_reset, Edge::Fall);
        delays.counter = Some(CounterDelays {
            counter_clk,
            local_stop: edge(&fall, self.local_stop, Edge::Rise),
            block: fall.edge_window(self.block, Edge::Rise).map(|w| w.1),
            settled: settled(&fall) - counter_clk.0,
            reset: edge(&stop, self.counter_reset, Edge::Rise),
            release: edge(&stop, self.counter_reset, Edge::Fall),
            released: latest(controls.map(|&net| release.edge_window(net, Edge::Fall))),
            reset_edges: latest(clock_rises),
            reset_settled: settled(&reset),
            hit_reset: edge(&reset, self.hit_reset, Edge::Rise),
            hit_falls: latest(
                self.hit
                    .iter()
                    .map(|&hit| reset.edge_window(hit, Edge::Fall)),
            ),
            clear: after_run(self.clear),
            enabled: after_run(self.counter_clk).1,
        });
        delays
    }

    fn pin(&self, cell: usize, pin: usize) -> NetId {
        self.netlist.cells()[cell].inputs[pin]
    }

    /// Fastest and slowest arc of every cell of some kinds.
    fn arcs(
        &self,
        timing: &Timing,
        is: impl Fn(CellKind) -> bool,
    ) -> impl Iterator<Item = Option<Span>> {
        let cells = self.netlist.cells().iter().enumerate();
        cells
            .filter(move |(_, leaf)| is(leaf.kind))
            .map(|(cell, leaf)| {
                let pins = 0..leaf.kind.inputs().len();
                let arcs = pins.filter(|&pin| leaf.kind.triggers(pin)).flat_map(|pin| {
                    let arc = timing.of(cell)[pin];
                    [arc.rise_fs, arc.fall_fs].map(|fs| Time::from_fs(fs.into()))
                });
                arcs.map(|delay| (delay, delay)).reduce(hull)
            })
    }
}

fn edge(arrivals: &Arrivals<'_>, net: NetId, edge: Edge) -> Span {
    let window = arrivals.edge_window(net, edge);
    window.expect("the macropixel connects these")
}

fn changes(arrivals: &Arrivals<'_>, net: NetId) -> Span {
    arrivals.window(net).expect("the macropixel connects these")
}

/// The span from the earlier beginning to the later end.
pub fn hull(a: Span, b: Span) -> Span {
    (a.0.min(b.0), a.1.max(b.1))
}

fn latest(windows: impl Iterator<Item = Option<Span>>) -> Time {
    let ends = windows.flatten().map(|window| window.1);
    ends.max().unwrap_or(Time::ZERO)
}

fn earliest(windows: impl Iterator<Item = Option<Span>>) -> Time {
    let begins = windows.flatten().map(|window| window.0);
    begins.min().unwrap_or(Time::ZERO)
}
