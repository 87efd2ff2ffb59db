//! Static timing: between which times every net can change after given edges, without simulating any.
//!
//! ```text
//!   starts (net, edge) ─► arcs of gates ─► CK→Q, R→Q, S→Q arcs of flip-flops ─► [shortest, longest] of every
//!                                                                               (net, edge), with the paths
//! ```
//!
//! Rising and falling edges are kept apart: an inverter's output falls when its input rises, a multiplexer's
//! follows its data either way on a change of select. Flip-flops pass edges on from their clock, reset and
//! set, so that a ripple counter, whose every flip-flop is clocked by the one before, is one path. D passes
//! nothing on: it is where paths end.
//!
//! The bounds are never optimistic against the event kernel. A net changes only if its cell's function does,
//! one arc after a change of an input in a direction that can do it; that arc is the *shortest* one of all
//! inputs that change in the same instant, so the shortest bound takes the shortest arc of every input that
//! can change at all. Nothing is known here of values: a path that no values can excite is still a path.
//!
//! Paths that come back to where they were are an error, and are cut by naming barriers: nets that edges
//! arrive at but do not leave. Time in whole femtoseconds; work is linear in the arcs reached.

use super::cell::CellKind;
use super::corner::Edge;
use super::flat::{FlatCell, Netlist};
use super::id::{CellId, NetId};
use super::timing::Timing;
use crate::units::Time;

/// Which of the two bounds.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Bound {
    /// The earliest possible change.
    Shortest,
    /// The latest possible change.
    Longest,
}

/// A (net, edge) as one number.
type Node = usize;

fn node(net: NetId, edge: Edge) -> Node {
    net.index() * 2 + edge as usize
}

fn net_of(node: Node) -> NetId {
    NetId::new(node / 2)
}

fn edge_of(node: Node) -> Edge {
    Edge::BOTH[node % 2]
}

/// Directions of a cell's output `output` that an `edge` on input `pin` can cause.
pub fn caused(kind: CellKind, pin: usize, edge: Edge, output: usize) -> &'static [Edge] {
    use CellKind::*;
    const NONE: &[Edge] = &[];
    let one = |edge| match edge {
        Edge::Rise => &Edge::BOTH[..1],
        Edge::Fall => &Edge::BOTH[1..],
    };
    // What Q does, Q̄ does the other way round.
    let state = |q: Edge| one(if output == 0 { q } else { q.opposite() });
    match (kind, pin, edge) {
        (Inv | Nand2 | Nor2, ..) => one(edge.opposite()),
        (Buf | And2 | Or2, ..) | (Mux2, 0 | 1, _) => one(edge),
        (Xor2 | Xnor2, ..) | (Mux2, ..) => &Edge::BOTH,
        (Dffr | Dffsr, 1, Edge::Rise) => &Edge::BOTH,
        (Dffr | Dffsr, 2, Edge::Rise) => state(Edge::Fall),
        (Dffsr, 3, Edge::Rise) => state(Edge::Rise),
        // A set that was held takes effect when the stronger reset is released.
        (Dffsr, 2, Edge::Fall) => state(Edge::Rise),
        (Dffr | Dffsr, ..) => NONE,
    }
}

/// Edges go round in a circle.
#[derive(Debug, Clone, PartialEq, Eq, thiserror::Error)]
#[error("edges come back to net {path}: name a net of the loop as a barrier")]
#[non_exhaustive]
pub struct TimingLoop {
    /// A net in or behind the loop.
    pub net: NetId,
    /// Its dotted path.
    pub path: String,
}

/// One netlist with its delays, ready for questions.
pub struct StaticTiming<'n> {
    netlist: &'n Netlist,
    timing: &'n Timing,
    /// Loads (cell, pin), by net.
    loads: Vec<(u32, u8)>,
    /// First load of every net, and the end.
    first_load: Vec<u32>,
}

/// One arc of the graph.
struct ArcTo {
    to: Node,
    cell: CellId,
    pin: usize,
    output: usize,
}

impl<'n> StaticTiming<'n> {
    /// Prepares the graph of arcs.
    pub fn new(netlist: &'n Netlist, timing: &'n Timing) -> Self {
        let triggers = |cell: &FlatCell| {
            let kind = cell.kind;
            (0..kind.inputs().len()).filter(move |&pin| kind.triggers(pin))
        };
        let pins = || {
            let cells = (0u32..).zip(netlist.cells());
            cells.flat_map(|(index, cell)| {
                triggers(cell).map(move |pin| (cell.input(pin).index(), (index, pin as u8)))
            })
        };
        let mut first_load = vec![0; netlist.net_count() + 1];
        pins().for_each(|(net, _)| first_load[net + 1] += 1);
        for net in 0..netlist.net_count() {
            first_load[net + 1] += first_load[net];
        }
        let mut next = first_load.clone();
        let mut loads = vec![(0, 0); first_load[netlist.net_count()] as usize];
        for (net, load) in pins() {
            loads[next[net] as usize] = load;
            next[net] += 1;
        }
        StaticTiming {
            netlist,
            timing,
            loads,
            first_load,
        }
    }

    fn arcs_from(&self, from: Node) -> impl Iterator<Item = ArcTo> + '_ {
        let edge = edge_of(from);
        let net = net_of(from).index();
        let loads = self.first_load[net] as usize..self.first_load[net + 1] as usize;
        self.loads[loads].iter().flat_map(move |&(cell, pin)| {
            let (cell, pin) = (CellId::new(cell as usize), pin as usize);
            let leaf = &self.netlist.cells()[cell.index()];
            let outputs = leaf.outputs.iter().enumerate();
            outputs
                .filter_map(|(output, net)| Some((output, (*net)?)))
                .flat_map(move |(output, net)| {
                    let edges = caused(leaf.kind, pin, edge, output).iter();
                    edges.map(move |&edge| ArcTo {
                        to: node(net, edge),
                        cell,
                        pin,
                        output,
                    })
                })
        })
    }

    /// Arrival windows of every net after `starts`, all at time 0. Other changes of the starting nets are
    /// not followed, and neither is what `barriers` would cause.
    ///
    /// # Errors
    /// When edges come back to where they were without meeting a barrier.
    ///
    /// # Example
    ///
    /// ```
    /// use femtogate::netlist::{
    ///     CellKind, Corner, Edge, Library, ModuleBuilder, Netlist, StaticTiming, Timing,
    /// };
    /// use femtogate::units::Time;
    ///
    /// let mut m = ModuleBuilder::new("top");
    /// let (a, z) = (m.input("A"), m.output("Z"));
    /// m.cell("inverter", CellKind::Inv, &[a], &[z]);
    /// let netlist = Netlist::elaborate(&m.finish()?);
    /// let [a, z] = ["A", "Z"].map(|name| netlist.net(name).unwrap());
    ///
    /// let timing = Timing::nominal(&netlist, &Library::generic_40nm(), Corner::Typ);
    /// let analysis = StaticTiming::new(&netlist, &timing);
    /// let arrivals = analysis.arrivals(&[(a, Edge::Rise)], &[])?;
    /// let falls = Time::from_fs(18_979);
    /// assert_eq!(arrivals.edge_window(z, Edge::Fall), Some((falls, falls)));
    /// assert_eq!(arrivals.edge_window(z, Edge::Rise), None);
    /// # Ok::<(), Box<dyn std::error::Error>>(())
    /// ```
    pub fn arrivals(
        &self,
        starts: &[(NetId, Edge)],
        barriers: &[NetId],
    ) -> Result<Arrivals<'n>, TimingLoop> {
        let nodes = self.netlist.net_count() * 2;
        let mut is_start = vec![false; nodes];
        for &(net, edge) in starts {
            is_start[node(net, edge)] = true;
        }
        let mut is_barrier = vec![false; self.netlist.net_count()];
        for net in barriers {
            is_barrier[net.index()] = true;
        }
        let leaves = |from: Node| !is_barrier[net_of(from).index()];
        let arcs = |from: Node| {
            let is_start = &is_start;
            let arcs = leaves(from).then(|| self.arcs_from(from));
            arcs.into_iter()
                .flatten()
                .filter(move |arc| !is_start[arc.to])
        };

        // What can change at all, and how many arcs lead there.
        let mut reached = is_start.clone();
        let mut waiting_for = vec![0u32; nodes];
        let mut open: Vec<Node> = (0..nodes).filter(|&n| is_start[n]).collect();
        while let Some(from) = open.pop() {
            for arc in arcs(from) {
                waiting_for[arc.to] += 1;
                if !std::mem::replace(&mut reached[arc.to], true) {
                    open.push(arc.to);
                }
            }
        }
        let can_change = |net: NetId| {
            Edge::BOTH
                .iter()
                .any(|&edge| reached[node(net, edge)] && leaves(node(net, edge)))
        };

        let mut shortest: Vec<Option<Arrival>> = vec![None; nodes];
        let mut longest: Vec<Option<Arrival>> = vec![None; nodes];
        let mut ready: Vec<Node> = (0..nodes).filter(|&n| is_start[n]).collect();
        for &start in &ready {
            shortest[start] = Some(Arrival::START);
            longest[start] = Some(Arrival::START);
        }
        while let Some(from) = ready.pop() {
            let (early, late) = (
                shortest[from].expect("arrived").time_fs,
                longest[from].expect("arrived").time_fs,
            );
            for arc in arcs(from) {
                let (cell, pin) = (arc.cell, arc.pin);
                let level = edge_of(arc.to).level();
                let delays = self.timing.cell_delays(cell);
                let own = delays[pin][arc.output].delay_fs(level);
                let leaf = &self.netlist.cells()[cell.index()];
                let quickest = (0..leaf.kind.inputs().len())
                    .filter(|&other| leaf.kind.triggers(other) && can_change(leaf.input(other)))
                    .map(|other| delays[other][arc.output].delay_fs(level))
                    .fold(own, u32::min);
                let arrival = |time_fs| Arrival {
                    time_fs,
                    cause: Some(Cause { from, cell, pin }),
                };
                let first = arrival(early + quickest as i64);
                let last = arrival(late + own as i64);
                let (best, worst) = (&mut shortest[arc.to], &mut longest[arc.to]);
                if best.is_none_or(|a| first.time_fs < a.time_fs) {
                    *best = Some(first);
                }
                if worst.is_none_or(|a| last.time_fs > a.time_fs) {
                    *worst = Some(last);
                }
                waiting_for[arc.to] -= 1;
                if waiting_for[arc.to] == 0 {
                    ready.push(arc.to);
                }
            }
        }
        if let Some(stuck) = (0..nodes).find(|&n| waiting_for[n] > 0) {
            let net = net_of(stuck);
            let path = self.netlist.net_path(net);
            let path = path.unwrap_or_else(|| "without a name".to_owned());
            return Err(TimingLoop { net, path });
        }
        Ok(Arrivals {
            netlist: self.netlist,
            timing: self.timing,
            shortest,
            longest,
        })
    }
}

#[derive(Debug, Clone, Copy)]
struct Cause {
    from: Node,
    cell: CellId,
    pin: usize,
}

#[derive(Debug, Clone, Copy)]
struct Arrival {
    time_fs: i64,
    cause: Option<Cause>,
}

impl Arrival {
    const START: Arrival = Arrival {
        time_fs: 0,
        cause: None,
    };
}

/// When every net can change after the starts.
pub struct Arrivals<'n> {
    netlist: &'n Netlist,
    timing: &'n Timing,
    shortest: Vec<Option<Arrival>>,
    longest: Vec<Option<Arrival>>,
}

impl Arrivals<'_> {
    /// How long after its clock a flip-flop changes its own D, in the direction of `edge`, where D is one of its outputs.
    pub(crate) fn own_data(&self, cell: CellId, edge: Edge) -> Option<Time> {
        const CLOCK: usize = 1;
        let leaf = &self.netlist.cells()[cell.index()];
        let [data, ..] = leaf.inputs;
        let output = leaf.outputs.iter().position(|&net| net == data)?;
        let delay = self.timing.cell_delays(cell)[CLOCK][output].delay_fs(edge.level());
        Some(Time::from_fs(delay.into()))
    }

    /// Earliest and latest change of `net` in the direction of `edge`; `None` where there can be none.
    pub fn edge_window(&self, net: NetId, edge: Edge) -> Option<(Time, Time)> {
        let time = |arrival: Arrival| Time::from_fs(arrival.time_fs);
        let index = node(net, edge);
        Some((time(self.shortest[index]?), time(self.longest[index]?)))
    }

    /// Earliest and latest change of `net` in either direction.
    pub fn window(&self, net: NetId) -> Option<(Time, Time)> {
        let windows = Edge::BOTH.map(|edge| self.edge_window(net, edge));
        let windows = windows.into_iter().flatten();
        windows.reduce(|a, b| (a.0.min(b.0), a.1.max(b.1)))
    }

    /// The path to the earliest or latest change of `net` in the direction of `edge`.
    ///
    /// # Example
    ///
    /// ```
    /// use femtogate::netlist::{
    ///     Bound, CellKind, Corner, Edge, Library, ModuleBuilder, Netlist, StaticTiming, Timing,
    /// };
    ///
    /// let mut m = ModuleBuilder::new("top");
    /// let (a, z) = (m.input("A"), m.output("Z"));
    /// m.cell("inverter", CellKind::Inv, &[a], &[z]);
    /// let netlist = Netlist::elaborate(&m.finish()?);
    /// let [a, z] = ["A", "Z"].map(|name| netlist.net(name).unwrap());
    ///
    /// let timing = Timing::nominal(&netlist, &Library::generic_40nm(), Corner::Typ);
    /// let arrivals = StaticTiming::new(&netlist, &timing).arrivals(&[(a, Edge::Rise)], &[])?;
    /// let path = arrivals.path(z, Edge::Fall, Bound::Longest).unwrap();
    /// assert_eq!(path.steps[0].net, a);
    /// assert_eq!(path.steps[1].arc.as_deref(), Some("top.inverter INV A"));
    /// # Ok::<(), Box<dyn std::error::Error>>(())
    /// ```
    pub fn path(&self, net: NetId, edge: Edge, bound: Bound) -> Option<Path> {
        let arrivals = match bound {
            Bound::Shortest => &self.shortest,
            Bound::Longest => &self.longest,
        };
        let mut steps = Vec::new();
        let mut at = Some(node(net, edge));
        while let Some(index) = at {
            let arrival = arrivals[index]?;
            let cell = |cause: Cause| {
                let kind = self.netlist.cells()[cause.cell.index()].kind;
                let path = self.netlist.cell_path(cause.cell);
                format!("{path} {} {}", kind.name(), kind.inputs()[cause.pin])
            };
            steps.push(PathStep {
                arc: arrival.cause.map(cell),
                net: net_of(index),
                edge: edge_of(index),
                time: Time::from_fs(arrival.time_fs),
            });
            at = arrival.cause.map(|cause| cause.from);
        }
        steps.reverse();
        Some(Path { steps })
    }

    /// The later (or earlier) of the paths to either edge of `net`.
    pub fn path_to(&self, net: NetId, bound: Bound) -> Option<Path> {
        let paths = Edge::BOTH.map(|edge| self.path(net, edge, bound));
        let paths = paths.into_iter().flatten();
        match bound {
            Bound::Shortest => paths.min_by_key(Path::delay),
            Bound::Longest => paths.max_by_key(Path::delay),
        }
    }
}

/// One change on a path.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct PathStep {
    /// The arc that causes it: cell path, kind and input pin. `None` at the start.
    pub arc: Option<String>,
    /// Which net changes.
    pub net: NetId,
    /// In which direction.
    pub edge: Edge,
    /// When, from the start of the path.
    pub time: Time,
}

/// A path from a start to an end.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Path {
    /// Changes in order, the start first.
    pub steps: Vec<PathStep>,
}

impl Path {
    /// Time from the first change to the last.
    pub fn delay(&self) -> Time {
        self.steps.last().map_or(Time::ZERO, |step| step.time)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::logic::Logic;
    use crate::netlist::{Corner, Library, ModuleBuilder};

    #[test]
    fn rise_and_fall_alternate_through_inverters() {
        let mut m = ModuleBuilder::new("chain");
        let mut net = m.input("A");
        for _ in 0..4 {
            net = m.gate(CellKind::Inv, &[net]);
        }
        let library = Library::generic_40nm();
        let netlist = Netlist::elaborate(&m.finish().unwrap());
        let timing = Timing::nominal(&netlist, &library, Corner::Typ);
        let analysis = StaticTiming::new(&netlist, &timing);
        let input = netlist.net("A").unwrap();
        let arrivals = analysis.arrivals(&[(input, Edge::Rise)], &[]).unwrap();
        let end = netlist.cells()[3].outputs[0].unwrap();
        let delay = |to| library.delay(CellKind::Inv, 0, to, Corner::Typ);
        let sum = (delay(Logic::Zero) + delay(Logic::One)) * 2;
        assert_eq!(arrivals.edge_window(end, Edge::Rise), Some((sum, sum)));
        assert_eq!(arrivals.edge_window(end, Edge::Fall), None);
        let path = arrivals.path_to(end, Bound::Longest).unwrap();
        assert_eq!((path.steps.len(), path.delay()), (5, sum));
        assert!(path.steps[1].arc.as_deref().unwrap().ends_with("INV A"));
    }

    #[test]
    fn a_loop_is_an_error_until_it_is_cut() {
        let mut m = ModuleBuilder::new("ring");
        let (a, z) = (m.input("A"), m.output("Z"));
        let inner = m.gate(CellKind::Nand2, &[a, z]);
        m.gate_into(CellKind::Inv, &[inner], z);
        let netlist = Netlist::elaborate(&m.finish().unwrap());
        let timing = Timing::nominal(&netlist, &Library::generic_40nm(), Corner::Typ);
        let analysis = StaticTiming::new(&netlist, &timing);
        let (a, z) = (netlist.net("A").unwrap(), netlist.net("Z").unwrap());
        assert!(analysis.arrivals(&[(a, Edge::Rise)], &[]).is_err());
        let cut = analysis.arrivals(&[(a, Edge::Rise)], &[z]).unwrap();
        assert!(cut.edge_window(z, Edge::Rise).is_some());
    }

    #[test]
    fn a_flip_flops_data_starts_no_path() {
        let mut m = ModuleBuilder::new("m");
        let (d, ck, r) = (m.input("D"), m.input("CK"), m.input("R"));
        let q = m.output("Q");
        m.cell("ff", CellKind::Dffr, &[d, ck, r], &[Some(q), None]);
        let netlist = Netlist::elaborate(&m.finish().unwrap());
        let timing = Timing::nominal(&netlist, &Library::generic_40nm(), Corner::Typ);
        let analysis = StaticTiming::new(&netlist, &timing);
        let net = |name| netlist.net(name).unwrap();
        let after = |name, edge| {
            let arrivals = analysis.arrivals(&[(net(name), edge)], &[]).unwrap();
            Edge::BOTH.map(|edge| arrivals.edge_window(net("Q"), edge).is_some())
        };
        assert_eq!(after("D", Edge::Rise), [false, false]);
        assert_eq!(after("CK", Edge::Fall), [false, false]);
        assert_eq!(after("CK", Edge::Rise), [true, true]);
        assert_eq!(after("R", Edge::Rise), [false, true]);
    }
}
