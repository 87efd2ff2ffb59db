//! From netlist to tape: every change that each cause can bring, at its time of arrival.
//!
//! ```text
//!   cause (CLK↓, CLK↑, COUNTER_RESET↑, …) ─► arcs of gates and flip-flops ─► (net, edge) with arrival times
//!                                                                              │ sorted, modulo the CLK period
//!                                                                              ▼
//!                                                                         actions of a pass
//! ```
//!
//! Causes are the edges of the nets that all macropixels share: CLK in every period, the others at the times
//! that the event kernel gave. The order of two effects, such as a strobe and the change of the shift register,
//! or a count and a reset, is therefore the order of their nominal arrival, whatever the STOP phase.
//!
//! Resets and sets are edges like any other, and may differ from lane to lane. Who is held when is known where a net
//! that all macropixels share does it ([`holds`]), and otherwise seen as the tape runs.
//!
//! A netlist is refused when an order is not certain: when paths of different length reach a flip-flop's reset or set
//! from one cause, or when a reset or set ends before what it does is done. Where it takes a lane's edge to matter, the
//! tape is made and the lanes are watched: clock edges by paths of different length, data that change within setup and
//! hold, and loops (LOCAL_STOP blocks COUNTER_CLK; FULL blocks a bin's clock), which are cut where they close. Should a
//! lane's edge ever go there, the block is the gate engine's.

use std::collections::{BTreeMap, BTreeSet, HashMap};

use super::expression::Expressions;
use super::parts::Parts;
use super::stream::StreamTape;
use super::survey::{Class, Survey, output};
use super::tape::{Action, Code, PassTape, SINK, ZERO};
use super::unlevelled::LevelisationError;
use super::word::inversion;
use crate::chip::{Exposure, SensorConfig, Silicon};
use crate::netlist::{CellId, CellKind, DataLimit, Edge, FlatCell, Library, NetId, caused};
use crate::units::Time;

mod actions;
mod arrivals;
mod early_data;
mod holds;

use early_data::SharedEdges;

/// A net and the direction of its change.
type Node = (NetId, Edge);

/// A place of the pass tape and whether it is read inverted.
pub(super) type Bit = (u16, bool);

/// A macropixel as two tapes.
pub(super) struct LevelisedLogic {
    /// Photons, up to what the strobe samples.
    pub stream: StreamTape,
    /// Everything else.
    pub passes: PassTape,
    /// What of it depends on photons.
    pub parts: Parts,
    /// Counter bits of every bin, bit 0 first.
    pub bins: Vec<Vec<Bit>>,
    /// What each place holds when the exposure starts: (place, net, inverted).
    pub initial: Vec<(u16, NetId, bool)>,
    /// Places of the pass tape.
    pub places: usize,
    /// Causes other than CLK, in order, by group (see [`Survey::uniform_edges`]): pass from the one that the
    /// group's STOP edge lies in at phase 0, and action.
    pub causes: Vec<Vec<(i64, u16)>>,
}

/// An edge that all macropixels share, at one position in the pass.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord)]
struct Cause {
    position_fs: i64,
    net: NetId,
    value: bool,
}

impl Cause {
    fn node(self) -> Node {
        (self.net, if self.value { Edge::Rise } else { Edge::Fall })
    }
}

/// Where a cause goes.
struct Reach {
    cause: Cause,
    /// Changes, causes before effects, loops apart.
    order: Vec<Node>,
    /// Place of each change in the order.
    rank: HashMap<Node, usize>,
    /// Earliest and latest arrival of each.
    arrival: HashMap<Node, (i64, i64)>,
    /// Flip-flops whose clock means nothing, as they are held.
    held: BTreeSet<usize>,
}

/// An action before it has its place on the tape.
struct Draft {
    position_fs: i64,
    arrival_fs: i64,
    action: Action,
    /// Drafts that a rise, and a fall, wakes.
    wakes: [BTreeSet<usize>; 2],
}

struct Arc {
    to: Vec<Node>,
    cell: usize,
    pin: usize,
}

struct Leveliser<'s> {
    survey: &'s Survey,
    cell_library: &'static Library,
    config: &'s SensorConfig,
    period_fs: i64,
    /// No cell is faster.
    fastest_fs: i64,
    /// For how long after each cause a shared net that resets or sets stays high, at least; 0 where it may be low.
    holds_fs: BTreeMap<(Cause, NetId), i64>,
    /// When in a pass a net that resets or sets may fall.
    releases_fs: HashMap<NetId, Vec<i64>>,
    /// Relevant, triggering pins (cell, pin) of live cells, by net.
    loads: HashMap<NetId, Vec<(usize, usize)>>,
    shared: BTreeSet<NetId>,
    shared_edges: SharedEdges,
    sampled: Vec<NetId>,
    places: HashMap<NetId, u16>,
    initial: Vec<(u16, NetId, bool)>,
    next_place: u16,
    drafts: Vec<Draft>,
}

impl LevelisedLogic {
    /// Makes the tapes of a sensor's macropixel in this exposure.
    ///
    /// # Errors
    /// What stands in the way.
    pub(super) fn new(
        survey: &Survey,
        config: &SensorConfig,
        exposure: &Exposure,
    ) -> Result<Self, LevelisationError> {
        let mut leveliser = Leveliser {
            survey,
            cell_library: Silicon::new(config).cell_library.cells(),
            config,
            period_fs: exposure.clock.period().as_fs(),
            fastest_fs: fastest_cell_fs(survey),
            holds_fs: BTreeMap::new(),
            releases_fs: HashMap::new(),
            loads: HashMap::new(),
            shared: BTreeSet::new(),
            shared_edges: SharedEdges::default(),
            sampled: Vec::new(),
            places: HashMap::new(),
            initial: Vec::new(),
            next_place: SINK + 1,
            drafts: Vec::new(),
        };
        leveliser.find_live_cells()?;
        let mut expressions = Expressions::new(survey);
        let sampled = leveliser.sampled.clone();
        let (stream, taps) = StreamTape::new(&mut expressions, survey.spads.len(), &sampled)?;

        let others: Vec<NetId> = leveliser
            .shared
            .iter()
            .copied()
            .filter(|&net| net != survey.clk)
            .collect();
        let groups = survey.uniform_edges(config, exposure, &others);
        let clk_fall = |time: Time| {
            let k = (exposure
                .clock
                .half_periods_until(time + exposure.stop_phase))
            .div_euclid(2);
            (k, (time - exposure.falling(k)).as_fs())
        };
        let mut first_action: BTreeMap<Cause, usize> = BTreeMap::new();
        let mut causes: Vec<Vec<(i64, Cause)>> = Vec::new();
        for group in &groups {
            let of_group = group.iter().map(|edge| {
                let (pass, position_fs) = clk_fall(edge.time);
                (
                    pass,
                    Cause {
                        position_fs,
                        net: edge.net,
                        value: edge.value,
                    },
                )
            });
            causes.push(of_group.collect());
        }
        let clk = |value| Cause {
            position_fs: if value { leveliser.period_fs / 2 } else { 0 },
            net: survey.clk,
            value,
        };
        let clock: Vec<Cause> = [false, true]
            .map(clk)
            .into_iter()
            .filter(|c| leveliser.shared.contains(&c.net))
            .collect();
        let all: BTreeSet<Cause> = causes
            .iter()
            .flatten()
            .map(|c| c.1)
            .chain(clock.iter().copied())
            .collect();
        let edges = (0..).zip(groups.iter().zip(&causes));
        let edges = edges.flat_map(|(cycle, (group, causes))| {
            let times = group.iter().map(move |e| exposure.stop(cycle) + e.time);
            times.zip(causes.iter().map(|&(_, cause)| cause))
        });
        let edges: Vec<(Time, Cause)> = edges.collect();
        leveliser.find_holds(&edges);
        let reaches: Result<Vec<Reach>, _> = all.iter().map(|&c| leveliser.reach(c)).collect();
        let reaches = reaches?;
        leveliser.find_releases(&reaches)?;
        leveliser.shared_edges = SharedEdges::new(&edges, &reaches);
        for reach in &reaches {
            first_action.insert(reach.cause, leveliser.follow(reach)?);
        }
        let order = leveliser.order()?;
        let position = |draft: usize| order[draft] as u16;
        let bins: Result<Vec<Vec<Bit>>, _> = survey
            .bins
            .iter()
            .map(|nets| nets.iter().map(|&net| leveliser.bit(net)).collect())
            .collect();
        let bins = bins?;
        let mut passes = leveliser.tape(&order);
        passes.clock = clock.iter().map(|c| position(first_action[c])).collect();
        passes.taps = taps;
        let causes = causes.iter().map(|group| {
            group
                .iter()
                .map(|(pass, cause)| (*pass, position(first_action[cause])))
                .collect()
        });
        let places = usize::from(leveliser.next_place);
        Ok(LevelisedLogic {
            stream,
            parts: Parts::new(&passes, places),
            passes,
            bins,
            causes: causes.collect(),
            places,
            initial: leveliser.initial,
        })
    }
}

impl Leveliser<'_> {
    /// Walks back from the counts: what they never depend on needs no action.
    fn find_live_cells(&mut self) -> Result<(), LevelisationError> {
        let survey = self.survey;
        let mut open: Vec<NetId> = survey.bins.iter().flatten().copied().collect();
        let mut seen: BTreeSet<usize> = BTreeSet::new();
        while let Some(net) = open.pop() {
            match survey.class(net) {
                Class::Uniform => {
                    self.shared.insert(net);
                }
                Class::Free => {
                    let Some((index, _)) = survey.driver[net.index()] else {
                        return Err(LevelisationError::Structure(survey.name(net)));
                    };
                    if !seen.insert(index) {
                        continue;
                    }
                    let cell = &survey.netlist.cells()[index];
                    let relevant = survey.relevant(cell);
                    for pin in (0..cell.kind.inputs().len()).filter(|&pin| relevant[pin]) {
                        let input = cell.input(pin);
                        if survey.class(input) == Class::Stream {
                            if cell.kind.triggers(pin) {
                                return Err(LevelisationError::Structure(survey.name(input)));
                            }
                            if !self.sampled.contains(&input) {
                                self.sampled.push(input);
                            }
                            continue;
                        }
                        if cell.kind.triggers(pin) {
                            self.loads.entry(input).or_default().push((index, pin));
                        }
                        open.push(input);
                    }
                }
                Class::Constant(_) | Class::Static => {}
                Class::Stream => return Err(LevelisationError::Structure(survey.name(net))),
            }
        }
        Ok(())
    }

    fn new_place(&mut self) -> u16 {
        self.next_place += 1;
        self.next_place - 1
    }

    /// Where the value of a net is found.
    fn bit(&mut self, net: NetId) -> Result<Bit, LevelisationError> {
        let survey = self.survey;
        let inverted = match survey.class(net) {
            Class::Constant(value) => return Ok((ZERO, value)),
            Class::Stream => return Err(LevelisationError::Structure(survey.name(net))),
            Class::Static | Class::Uniform => false,
            // A flip-flop is one bit, whichever of its outputs is read.
            Class::Free => matches!(survey.driver[net.index()], Some((_, 1))),
        };
        let cell = survey.driver[net.index()].map(|(cell, _)| &survey.netlist.cells()[cell]);
        let canonical = match cell {
            Some(cell) if inverted => cell.outputs[0].unwrap_or(net),
            _ => net,
        };
        if let Some(&place) = self.places.get(&canonical) {
            return Ok((place, inverted));
        }
        let place = self.new_place();
        self.initial.push((place, net, inverted));
        self.places.insert(canonical, place);
        Ok((place, inverted))
    }

    /// Position of every draft on the tape.
    fn order(&self) -> Result<Vec<usize>, LevelisationError> {
        for draft in &self.drafts {
            for &woken in draft.wakes.iter().flatten() {
                let wait = self.drafts[woken].arrival_fs - draft.arrival_fs;
                if wait <= 0 || wait >= self.period_fs {
                    return Err(LevelisationError::Structure(format!("a wait of {wait} fs")));
                }
            }
        }
        let mut sorted: Vec<usize> = (0..self.drafts.len()).collect();
        let key = |&d: &usize| (self.drafts[d].position_fs, self.drafts[d].arrival_fs);
        sorted.sort_by_key(key);
        // Of flip-flops that change in the same instant, those that read others come first.
        for group in
            sorted.chunk_by_mut(|a, b| self.drafts[*a].position_fs == self.drafts[*b].position_fs)
        {
            for i in 0..group.len() {
                let reads = |reader: usize, read: usize| {
                    let (reader, read) = (&self.drafts[reader].action, &self.drafts[read].action);
                    matches!(reader.code, Code::FlipFlop)
                        && reader.inputs[0] == read.out
                        && reader.out != read.out
                };
                let rest = &group[i..];
                let free =
                    (0..rest.len()).find(|&j| !rest.iter().any(|&other| reads(other, rest[j])));
                let Some(j) = free else {
                    return Err(LevelisationError::Structure(
                        "a ring of flip-flops".to_owned(),
                    ));
                };
                group[i..=i + j].rotate_right(1);
            }
        }
        let mut position = vec![0; sorted.len()];
        for (place, &draft) in sorted.iter().enumerate() {
            position[draft] = place;
        }
        Ok(position)
    }

    fn tape(&self, position: &[usize]) -> PassTape {
        let mut by_position = vec![0; position.len()];
        for (draft, &place) in position.iter().enumerate() {
            by_position[place] = draft;
        }
        let mut tape = PassTape::default();
        for draft in by_position.into_iter().map(|d| &self.drafts[d]) {
            let mut action = draft.action;
            action.wakes[0] = tape.wakes.len() as u32;
            for direction in 0..2 {
                tape.wakes
                    .extend(draft.wakes[direction].iter().map(|&d| position[d] as u16));
                action.wakes[direction + 1] = tape.wakes.len() as u32;
            }
            tape.actions.push(action);
        }
        // A wait is shorter than a period.
        let arrivals = self.drafts.iter().map(|draft| draft.arrival_fs);
        tape.settling = arrivals.max().unwrap_or(0) / self.period_fs + 2;
        tape
    }
}

fn fastest_cell_fs(survey: &Survey) -> i64 {
    let cells = survey.netlist.cells().iter().enumerate();
    let delays = cells.flat_map(|(index, cell)| {
        let pins = (0..cell.kind.inputs().len()).filter(|&pin| cell.kind.triggers(pin));
        pins.flat_map(move |pin| {
            &survey.timing.cell_delays(CellId::new(index))[pin][..cell.kind.outputs().len()]
        })
    });
    delays
        .map(|arc| arc.rise().min(arc.fall()).as_fs())
        .min()
        .unwrap_or(0)
}

/// Pin of a flip-flop's clock.
const CLOCK: usize = 1;

/// What rounding of clock edges to whole femtoseconds can do to a distance between two of them.
const ROUNDING_FS: i64 = 2;
