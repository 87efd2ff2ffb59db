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
//! A netlist is refused when that order is not certain: when paths of different length reach a flip-flop's
//! clock or reset from one cause, when data change within setup and hold, or when a clear is slower than the reset
//! that it belongs to. A loop (LOCAL_STOP blocks COUNTER_CLK; FULL blocks a bin's clock) is cut where it closes,
//! and the cut is watched: should a lane's edge ever go through it, the block is the gate engine's.

use std::collections::{BTreeMap, BTreeSet, HashMap};

use super::Unlevelled;
use super::expression::Expressions;
use super::stream::StreamTape;
use super::survey::{Class, Survey, UniformEdge, output};
use super::tape::{Action, Code, PassTape, SINK, ZERO};
use super::word::inversion;
use crate::chip::{Exposure, SensorConfig};
use crate::netlist::{CellKind, DataLimit, Edge, FlatCell, Library, NetId, caused};
use crate::units::Time;

/// A net and the direction of its change.
type Node = (NetId, Edge);

/// A place of the pass tape and whether it is read inverted.
pub type Bit = (u16, bool);

/// A macropixel as two tapes.
pub struct Levelised {
    /// Photons, up to what the strobe samples.
    pub stream: StreamTape,
    /// Everything else.
    pub passes: PassTape,
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
    library: Library,
    config: &'s SensorConfig,
    period_fs: i64,
    /// No cell is faster.
    fastest_fs: i64,
    /// Shortest high pulse of each shared net that has any.
    pulse_fs: HashMap<NetId, i64>,
    /// Every cause.
    causes: BTreeSet<Cause>,
    /// Relevant, triggering pins (cell, pin) of live cells, by net.
    loads: HashMap<NetId, Vec<(usize, usize)>>,
    shared: BTreeSet<NetId>,
    sampled: Vec<NetId>,
    places: HashMap<NetId, u16>,
    initial: Vec<(u16, NetId, bool)>,
    next_place: u16,
    drafts: Vec<Draft>,
}

impl Levelised {
    /// Makes the tapes of a sensor's macropixel in this exposure.
    ///
    /// # Errors
    /// What stands in the way.
    pub fn new(
        survey: &Survey,
        config: &SensorConfig,
        exposure: &Exposure,
    ) -> Result<Self, Unlevelled> {
        let mut leveliser = Leveliser {
            survey,
            library: Library::default(),
            config,
            period_fs: exposure.clock.period().as_fs(),
            fastest_fs: fastest_cell_fs(survey),
            pulse_fs: HashMap::new(),
            causes: BTreeSet::new(),
            loads: HashMap::new(),
            shared: BTreeSet::new(),
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
        leveliser.pulse_fs = shortest_pulses(&groups);
        let at = |time: Time| {
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
                let (pass, position_fs) = at(edge.time);
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
        leveliser.causes.clone_from(&all);
        for &cause in &all {
            first_action.insert(cause, leveliser.follow(cause)?);
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
        Ok(Levelised {
            stream,
            passes,
            bins,
            causes: causes.collect(),
            places: usize::from(leveliser.next_place),
            initial: leveliser.initial,
        })
    }
}

impl Leveliser<'_> {
    /// Walks back from the counts: what they never depend on needs no action.
    fn find_live_cells(&mut self) -> Result<(), Unlevelled> {
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
                        return Err(Unlevelled::Structure(survey.name(net)));
                    };
                    if !seen.insert(index) {
                        continue;
                    }
                    let cell = &survey.netlist.cells()[index];
                    // A set that differs from lane to lane has no static order against the clock.
                    if cell.kind == CellKind::Dffsr {
                        return Err(Unlevelled::Structure(survey.netlist.cell_path(index)));
                    }
                    let relevant = survey.relevant(cell);
                    for pin in (0..cell.kind.inputs().len()).filter(|&pin| relevant[pin]) {
                        let input = cell.inputs[pin];
                        if survey.class(input) == Class::Stream {
                            if cell.kind.triggers(pin) {
                                return Err(Unlevelled::Structure(survey.name(input)));
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
                Class::Stream => return Err(Unlevelled::Structure(survey.name(net))),
            }
        }
        Ok(())
    }

    fn new_place(&mut self) -> u16 {
        self.next_place += 1;
        self.next_place - 1
    }

    /// Where the value of a net is found.
    fn bit(&mut self, net: NetId) -> Result<Bit, Unlevelled> {
        let survey = self.survey;
        let inverted = match survey.class(net) {
            Class::Constant(value) => return Ok((ZERO, value)),
            Class::Stream => return Err(Unlevelled::Structure(survey.name(net))),
            Class::Static | Class::Uniform => false,
            // A flip-flop is one bit, whichever of its outputs is read.
            Class::Free => matches!(survey.driver[net.index()], Some((_, 1))),
        };
        let cell = survey.driver[net.index()].map(|(cell, _)| &survey.netlist.cells()[cell]);
        let canonical = match cell {
            Some(cell) if inverted && cell.outputs[0].is_some() => cell.outputs[0],
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

    /// What a change causes: by cell and pin, the changes of its outputs.
    fn arcs(&self, cause: Cause, from: Node) -> Vec<Arc> {
        let cells = self.survey.netlist.cells();
        let loads = self.loads.get(&from.0).map_or(&[][..], Vec::as_slice);
        let arcs = loads
            .iter()
            .filter(|&&(cell, pin)| !self.is_held(cause, &cells[cell], pin));
        arcs.map(|&(cell, pin)| {
            let leaf = &cells[cell];
            let outputs = leaf
                .outputs
                .iter()
                .enumerate()
                .filter(|(_, net)| net.is_some());
            let to = outputs.flat_map(|(output, &net)| {
                caused(leaf.kind, pin, from.1, output)
                    .iter()
                    .map(move |&edge| (net, edge))
            });
            Arc {
                to: to.collect(),
                cell,
                pin,
            }
        })
        .filter(|arc| !arc.to.is_empty())
        .collect()
    }

    /// Whether this pin clocks a flip-flop that the cause itself resets: it ignores its clock.
    fn is_held(&self, cause: Cause, cell: &FlatCell, pin: usize) -> bool {
        cell.kind.is_flip_flop() && pin == 1 && cause.value && cell.inputs[2] == cause.net
    }

    fn delay(&self, arc: &Arc, edge: Edge) -> i64 {
        i64::from(self.survey.timing.of(arc.cell)[arc.pin].to(edge.level()))
    }

    /// Drafts the actions of one cause; the first of them sets the shared net.
    fn follow(&mut self, cause: Cause) -> Result<usize, Unlevelled> {
        let edge = if cause.value { Edge::Rise } else { Edge::Fall };
        let start = (cause.net, edge);
        let mut search = Search::default();
        search.visit(self, cause, start);
        search.order.reverse();
        let rank: HashMap<Node, usize> = search
            .order
            .iter()
            .enumerate()
            .map(|(i, &n)| (n, i))
            .collect();
        let mut arrival: HashMap<Node, (i64, i64)> = HashMap::from([(start, (0, 0))]);
        for from in &search.order {
            let (early, late) = arrival[from];
            for arc in self.arcs(cause, *from) {
                for to in arc.to.iter().filter(|to| rank[*to] > rank[from]) {
                    let delay = self.delay(&arc, to.1);
                    let window = arrival.entry(*to).or_insert((i64::MAX, i64::MIN));
                    *window = (window.0.min(early + delay), window.1.max(late + delay));
                }
            }
        }
        self.check_clears(cause, &arrival)?;

        let (place, _) = self.bit(cause.net)?;
        let set = Action {
            code: Code::Set(cause.value),
            inputs: [ZERO; 4],
            invert: [0; 5],
            out: place,
            directions: [u64::MAX; 2],
            masks: [SINK; 2],
            wakes: [0; 3],
            traps: [false; 2],
            is_doubtful: false,
        };
        let first = self.draft(cause.position_fs, 0, set);
        // Which drafts make a node, and which evaluate a cell because of one.
        let mut makers: HashMap<Node, Vec<usize>> = HashMap::from([(start, vec![first])]);
        let mut gates: HashMap<Node, usize> = HashMap::new();
        let mut flip_flops: HashMap<(usize, usize), usize> = HashMap::new();
        let mut masks: HashMap<NetId, u16> = HashMap::new();
        for &node in &search.order {
            for arc in self.arcs(cause, node) {
                let kind = self.survey.netlist.cells()[arc.cell].kind;
                let ahead: Vec<Node> = arc
                    .to
                    .iter()
                    .copied()
                    .filter(|to| rank[to] > rank[&node])
                    .collect();
                let is_cut = ahead.len() < arc.to.len();
                let mut targets = Vec::new();
                if kind.is_flip_flop() && !ahead.is_empty() {
                    let (early, late) = arrival[&node];
                    if early != late && arc.pin != 1 {
                        return Err(Unlevelled::Ambiguous {
                            net: self.survey.name(node.0),
                            shortest_fs: early,
                            longest_fs: late,
                        });
                    }
                    let draft = match flip_flops.get(&(arc.cell, arc.pin)) {
                        Some(&draft) => draft,
                        None => {
                            let time = late + self.delay(&arc, Edge::Rise);
                            let made = makers[&node].iter().map(|&m| self.drafts[m].arrival_fs);
                            let instant = made.max().expect("a node has a maker") + 1;
                            let mask = (arc.pin == 1).then(|| {
                                *masks.entry(node.0).or_insert_with(|| {
                                    self.next_place += 1;
                                    self.next_place - 1
                                })
                            });
                            let mask = match mask {
                                Some(mask) => {
                                    let (mask, gate) =
                                        self.sampled_reset(cause, &arc, mask, late, instant)?;
                                    targets.extend(gate);
                                    Some(mask)
                                }
                                None => None,
                            };
                            let draft = self.flip_flop(cause, arc.cell, mask, time)?;
                            self.drafts[draft].action.is_doubtful |= early != late;
                            flip_flops.insert((arc.cell, arc.pin), draft);
                            draft
                        }
                    };
                    for to in &ahead {
                        let made = makers.entry(*to).or_default();
                        if !made.contains(&draft) {
                            made.push(draft);
                        }
                    }
                    targets.push(draft);
                } else {
                    for to in &ahead {
                        let draft = match gates.get(to) {
                            Some(&draft) => draft,
                            None => self.gate(cause, arc.cell, *to, &arrival, &mut gates)?,
                        };
                        makers.insert(*to, vec![draft]);
                        targets.push(draft);
                    }
                }
                let (_, is_inverted) = self.bit(node.0)?;
                let direction = usize::from((node.1 == Edge::Fall) ^ is_inverted);
                for &maker in &makers[&node] {
                    let draft = &mut self.drafts[maker];
                    draft.wakes[direction].extend(&targets);
                    draft.action.traps[direction] |= is_cut;
                    if let (Some(&mask), Edge::Rise) = (masks.get(&node.0), node.1) {
                        draft.action.masks[direction] = mask;
                    }
                }
            }
        }
        Ok(first)
    }

    /// A reset must outlast whatever its own clearing clocks.
    fn check_clears(
        &self,
        cause: Cause,
        arrival: &HashMap<Node, (i64, i64)>,
    ) -> Result<(), Unlevelled> {
        let Some(&width) = self.pulse_fs.get(&cause.net) else {
            return Ok(());
        };
        let cells = self.survey.netlist.cells();
        for (&(net, edge), &(_, late)) in arrival {
            let loads = self.loads.get(&net).map_or(&[][..], Vec::as_slice);
            for &(cell, pin) in loads.iter().filter(|_| edge == Edge::Rise) {
                let removal = self
                    .library
                    .checks(cells[cell].kind)
                    .removal
                    .at(self.config.corner);
                if self.is_held(cause, &cells[cell], pin) && late + i64::from(removal) >= width {
                    return Err(Unlevelled::Clear(self.survey.netlist.cell_path(cell)));
                }
            }
        }
        Ok(())
    }

    fn draft(&mut self, position_fs: i64, arrival_fs: i64, action: Action) -> usize {
        self.drafts.push(Draft {
            position_fs: (position_fs + arrival_fs).rem_euclid(self.period_fs),
            arrival_fs,
            action,
            wakes: Default::default(),
        });
        self.drafts.len() - 1
    }

    /// The clock mask that a flip-flop uses: where its reset is released between the clock's edge and the change of Q,
    /// a mask of its own, gated in the instant of the edge by an action of its own.
    fn sampled_reset(
        &mut self,
        cause: Cause,
        arc: &Arc,
        mask: u16,
        arrival_fs: i64,
        instant_fs: i64,
    ) -> Result<(u16, Option<usize>), Unlevelled> {
        let reset = self.survey.netlist.cells()[arc.cell].inputs[2];
        let clock_to_q = self.delay(arc, Edge::Rise);
        let is_between = |release: &Cause| {
            let after = release.position_fs - cause.position_fs - arrival_fs;
            release.net == reset && !release.value && after.rem_euclid(self.period_fs) <= clock_to_q
        };
        if !self.causes.iter().any(is_between) {
            return Ok((mask, None));
        }
        let (place, inverted) = self.bit(reset)?;
        let gated = self.new_place();
        let action = Action {
            code: Code::And,
            inputs: [mask, place, ZERO, ZERO],
            invert: [0, inversion(!inverted), 0, 0, 0],
            out: gated,
            directions: [u64::MAX; 2],
            masks: [SINK; 2],
            wakes: [0; 3],
            traps: [false; 2],
            is_doubtful: false,
        };
        Ok((
            gated,
            Some(self.draft(cause.position_fs, instant_fs, action)),
        ))
    }

    fn flip_flop(
        &mut self,
        cause: Cause,
        index: usize,
        mask: Option<u16>,
        arrival_fs: i64,
    ) -> Result<usize, Unlevelled> {
        let cell = self.survey.netlist.cells()[index];
        let [d, _, r, s] = cell.inputs;
        let q = if cell.outputs[0].is_some() {
            cell.outputs[0]
        } else {
            cell.outputs[1]
        };
        let (out, _) = self.bit(q)?;
        let mut bit = |net: NetId| {
            if net.is_some() {
                self.bit(net)
            } else {
                Ok((ZERO, false))
            }
        };
        let (reset, set) = (bit(r)?, bit(s)?);
        let mut is_doubtful = false;
        let (code, data) = if mask.is_none() {
            (Code::Async, (ZERO, false))
        } else if self.survey.class(d) == Class::Stream {
            let (code, is_race) = self.sampler(cause, &cell, index, arrival_fs)?;
            is_doubtful = is_race;
            (code, (ZERO, false))
        } else {
            let data = self.bit(d)?;
            let toggles = data == (out, true) && set == (ZERO, false);
            (
                if toggles {
                    Code::Toggle
                } else {
                    Code::FlipFlop
                },
                data,
            )
        };
        let action = Action {
            code,
            inputs: [data.0, mask.unwrap_or(ZERO), reset.0, set.0],
            invert: [
                inversion(data.1),
                0,
                inversion(reset.1),
                inversion(set.1),
                0,
            ],
            out,
            directions: [u64::MAX; 2],
            masks: [SINK; 2],
            wakes: [0; 3],
            traps: [false; 2],
            is_doubtful,
        };
        Ok(self.draft(cause.position_fs, arrival_fs, action))
    }

    /// A flip-flop that samples the stream `arrival_fs − clk-to-Q` after its cause, and whether that is within setup
    /// and hold of a change.
    fn sampler(
        &self,
        cause: Cause,
        cell: &FlatCell,
        index: usize,
        arrival_fs: i64,
    ) -> Result<(Code, bool), Unlevelled> {
        let survey = self.survey;
        let data = cell.inputs[0];
        let (register, _) = survey.driver[data.index()].expect("a stream net has a driver");
        if !survey.netlist.cells()[register].kind.is_flip_flop() {
            return Err(Unlevelled::Structure(survey.name(data)));
        }
        let clock_to_q = |cell: usize| i64::from(survey.timing.of(cell)[1].rise_fs);
        let due = (cause.position_fs + arrival_fs).rem_euclid(self.period_fs);
        let after_change = due - clock_to_q(index) - self.period_fs / 2 - clock_to_q(register);
        let edges = after_change.div_euclid(self.period_fs);
        let after = after_change.rem_euclid(self.period_fs);
        let limits = self.library.checks(cell.kind);
        let limit = |limit: DataLimit| {
            let longest = limit
                .rise
                .at(self.config.corner)
                .max(limit.fall.at(self.config.corner));
            i64::from(longest) + ROUNDING_FS
        };
        let is_race = after <= limit(limits.setup) || self.period_fs - after <= limit(limits.hold);
        let tap = self
            .sampled
            .iter()
            .position(|&net| net == data)
            .expect("noted before");
        let offset = edges as i8 + 1;
        Ok((
            Code::Sampler {
                tap: tap as u16,
                offset,
            },
            is_race,
        ))
    }

    /// The action of a gate for one change of its output, or for both where nothing comes between them.
    fn gate(
        &mut self,
        cause: Cause,
        index: usize,
        to: Node,
        arrival: &HashMap<Node, (i64, i64)>,
        gates: &mut HashMap<Node, usize>,
    ) -> Result<usize, Unlevelled> {
        let cell = self.survey.netlist.cells()[index];
        let times = Edge::BOTH.map(|edge| arrival.get(&(to.0, edge)).map(|window| window.1));
        let is_quiet = |from: i64, until: i64| {
            let inputs = cell
                .inputs
                .iter()
                .flat_map(|&net| Edge::BOTH.map(|edge| (net, edge)));
            let mut times = inputs.filter_map(|node| arrival.get(&node));
            !times.any(|window| window.1 >= from && window.0 < until)
        };
        let both = match times {
            [Some(rise), Some(fall)] => {
                let (first, last) = (rise.min(fall), rise.max(fall));
                (last - first < self.fastest_fs && is_quiet(first, last)).then_some(last)
            }
            _ => None,
        };
        let own = arrival[&to].1;
        let directions = match (both, to.1) {
            (Some(_), _) => [u64::MAX; 2],
            (None, Edge::Rise) => [u64::MAX, 0],
            (None, Edge::Fall) => [0, u64::MAX],
        };
        let (code, inputs, invert) = self.function(&cell)?;
        let action = Action {
            code,
            inputs,
            invert,
            out: self.bit(to.0)?.0,
            directions,
            masks: [SINK; 2],
            wakes: [0; 3],
            traps: [false; 2],
            is_doubtful: false,
        };
        let draft = self.draft(cause.position_fs, both.unwrap_or(own), action);
        gates.insert(to, draft);
        if both.is_some() {
            for edge in Edge::BOTH {
                gates.insert((to.0, edge), draft);
            }
        }
        Ok(draft)
    }

    /// A gate with its constants folded in.
    fn function(&mut self, cell: &FlatCell) -> Result<(Code, [u16; 4], [u64; 5]), Unlevelled> {
        let relevant = self.survey.relevant(cell);
        let pins: Vec<usize> = (0..cell.kind.inputs().len())
            .filter(|&p| relevant[p])
            .collect();
        let mut fixed = 0u8;
        for pin in 0..cell.kind.inputs().len() {
            if self.survey.class(cell.inputs[pin]) == Class::Constant(true) {
                fixed |= 1 << pin;
            }
        }
        let bits: Result<Vec<Bit>, _> =
            pins.iter().map(|&pin| self.bit(cell.inputs[pin])).collect();
        let bits = bits?;
        let value = |on: u8| {
            let set = pins.iter().enumerate().filter(|(i, _)| on >> i & 1 == 1);
            output(cell.kind, set.fold(fixed, |word, (_, pin)| word | 1 << pin))
        };
        let action = |code, places: &[u16], flags: &[bool], inverted: bool| {
            let mut inputs = [ZERO; 4];
            let mut invert = [0; 5];
            inputs[..places.len()].copy_from_slice(places);
            for (mask, &flag) in invert.iter_mut().zip(flags) {
                *mask = inversion(flag);
            }
            invert[4] = inversion(inverted);
            (code, inputs, invert)
        };
        Ok(match bits[..] {
            [(a, ia)] => action(Code::Xor, &[a, ZERO], &[], ia ^ value(0)),
            [(a, ia), (b, ib)] => {
                let table = [0, 1, 2, 3].map(value);
                let ones = table.iter().filter(|&&v| v).count();
                if ones == 2 {
                    action(Code::Xor, &[a, b], &[], ia ^ ib ^ table[0])
                } else {
                    // The one combination of inputs that differs from the others.
                    let odd = (0..4)
                        .find(|&i| table[i] == (ones == 1))
                        .expect("a gate of two inputs");
                    let (wants_a, wants_b) = (odd & 1 == 1, odd & 2 == 2);
                    action(
                        Code::And,
                        &[a, b],
                        &[ia ^ !wants_a, ib ^ !wants_b],
                        ones == 3,
                    )
                }
            }
            // A multiplexer between a flip-flop's outputs.
            [(a, ia), (b, ib), (s, is)] if a == b && ia != ib => {
                action(Code::Xor, &[a, s], &[], ia ^ is)
            }
            [(a, ia), (b, ib), (s, is)] if cell.kind == CellKind::Mux2 => {
                action(Code::Mux, &[a, b, s], &[ia, ib, is], false)
            }
            _ => return Err(Unlevelled::Structure(self.survey.name(cell.outputs[0]))),
        })
    }

    /// Position of every draft on the tape.
    fn order(&self) -> Result<Vec<usize>, Unlevelled> {
        for draft in &self.drafts {
            for &woken in draft.wakes.iter().flatten() {
                let wait = self.drafts[woken].arrival_fs - draft.arrival_fs;
                if wait <= 0 || wait >= self.period_fs {
                    return Err(Unlevelled::Structure(format!("a wait of {wait} fs")));
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
                    return Err(Unlevelled::Structure("a ring of flip-flops".to_owned()));
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
        tape
    }
}

fn fastest_cell_fs(survey: &Survey) -> i64 {
    let cells = survey.netlist.cells().iter().enumerate();
    let delays = cells.flat_map(|(index, cell)| {
        let pins = (0..cell.kind.inputs().len()).filter(|&pin| cell.kind.triggers(pin));
        pins.map(move |pin| survey.timing.of(index)[pin])
    });
    delays
        .map(|arc| i64::from(arc.rise_fs.min(arc.fall_fs)))
        .min()
        .unwrap_or(0)
}

fn shortest_pulses(groups: &[Vec<UniformEdge>]) -> HashMap<NetId, i64> {
    let mut shortest: HashMap<NetId, i64> = HashMap::new();
    for group in groups {
        let mut rose = HashMap::new();
        for edge in group {
            if edge.value {
                rose.insert(edge.net, edge.time);
            } else if let Some(rise) = rose.remove(&edge.net) {
                let width = (edge.time - rise).as_fs();
                shortest
                    .entry(edge.net)
                    .and_modify(|w| *w = width.min(*w))
                    .or_insert(width);
            }
        }
    }
    shortest
}

/// What rounding of clock edges to whole femtoseconds can do to a distance between two of them.
const ROUNDING_FS: i64 = 2;

/// Depth first, so that reversed it is an order in which causes precede effects, loops apart.
#[derive(Default)]
struct Search {
    order: Vec<Node>,
    seen: BTreeSet<(NetId, bool)>,
}

impl Search {
    fn visit(&mut self, leveliser: &Leveliser<'_>, cause: Cause, node: Node) {
        if !self.seen.insert((node.0, node.1 == Edge::Rise)) {
            return;
        }
        for arc in leveliser.arcs(cause, node) {
            for to in arc.to {
                self.visit(leveliser, cause, to);
            }
        }
        self.order.push(node);
    }
}
