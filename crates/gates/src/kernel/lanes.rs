//! Lane-parallel events: up to 64 copies of one netlist, each with its own stimulus, in one event queue.
//!
//! Equal blocks of an array share netlist, delays and clocks, and differ in their data. Most of
//! their activity therefore falls into the same instants. Here a net holds one value for each of 64 lanes, an
//! event carries the lanes it is for, and a cell evaluates all lanes with a few word operations.
//!
//! ```text
//!   value of a net:     one  = ...0110   lanes that are 1        lanes in neither are X
//!                       zero = ...1001   lanes that are 0
//!   pending on a net:   groups (time, lanes, values), earliest first; cancelling a lane takes its bit out
//! ```
//!
//! Every lane sees exactly the value changes that [`Kernel`](super::Kernel) would give it alone: the same two
//! phases, the same inertial and transport rules, and the delay of the pin that changed in *that* lane. Two differences of
//! input only: Z is driven as X, and a clock must not be driven up and down again within one instant.
//!
//! All lanes have the delays of one [`Timing`]: nominal, or annotated, or the mismatch of one block. Delays
//! that differ from lane to lane would give each lane events of its own, and nothing would be left to share.

use super::compiled::{CLOCK, DelaySet, FanOut};
use super::lane_word::Lanes;
use super::oscillation::{MOST_DELTA_CYCLES, Oscillation};
use super::wheel::{Event, TimeWheel};
use crate::logic::Logic;
use crate::netlist::{CellId, CellKind, DelayModel, MAX_INPUTS, NetId, Netlist, Timing};
use crate::units::Time;

/// Some lanes of one input take a value at one time.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct LaneDrive {
    /// When.
    pub time: Time,
    /// Which input.
    pub net: NetId,
    /// Which lanes.
    pub mask: u64,
    /// To what, in those lanes.
    pub values: Lanes,
}

/// Hears of every net change, in time order.
pub trait LaneObserver {
    /// The lanes in `mask` of `net` took `values` at `time`.
    fn change(&mut self, time: Time, net: NetId, mask: u64, values: Lanes);
}

impl LaneObserver for () {
    #[inline]
    fn change(&mut self, _: Time, _: NetId, _: u64, _: Lanes) {}
}

/// No group.
const NONE: u32 = u32::MAX;

#[derive(Clone, Copy)]
struct NetState {
    value: Lanes,
    /// What its driver computed last: its value, once everything on its way has arrived.
    target: Lanes,
    /// First of the net's groups, which are in order of time.
    groups: u32,
}

/// Changes on their way to one net at one time.
#[derive(Clone, Copy)]
struct Group {
    time_fs: i64,
    mask: u64,
    values: Lanes,
    next: u32,
}

#[derive(Clone, Copy)]
struct CellState {
    kind: CellKind,
    is_dirty: bool,
    model: DelayModel,
    inputs: [u32; MAX_INPUTS],
    outputs: [u32; 2],
    /// Index of the delays to each output.
    delays: [u32; 2],
    /// Lanes in which each pin changed since the last evaluation; a flip-flop's clock is in its net's [`ClockEdge`].
    changed: [u64; MAX_INPUTS],
    state: Lanes,
}

/// What a clock did in this round of an instant.
#[derive(Clone, Copy, Default)]
struct ClockEdge {
    /// Lanes in which it went high or unknown.
    changed: u64,
    /// Lanes in which it rose.
    rose: u64,
    /// Lanes in which it may have risen.
    may_have_risen: u64,
}

/// An event-driven simulation of up to 64 copies of one netlist.
///
/// # Example
///
/// ```
/// use femtogate::kernel::{LaneDrive, LaneKernel, Lanes};
/// use femtogate::logic::Logic;
/// use femtogate::netlist::{CellKind, Corner, Library, ModuleBuilder, Netlist, Timing};
/// use femtogate::units::Time;
///
/// let mut m = ModuleBuilder::new("top");
/// let (a, z) = (m.input("A"), m.output("Z"));
/// m.cell("inverter", CellKind::Inv, &[a], &[z]);
/// let netlist = Netlist::elaborate(&m.finish()?);
/// let [a, z] = ["A", "Z"].map(|name| netlist.net(name).unwrap());
/// let timing = Timing::nominal(&netlist, &Library::generic_40nm(), Corner::Typ);
/// // Every lane starts at 0; lane 1 rises a nanosecond later.
/// let drives = [(0, u64::MAX, Logic::Zero), (1, 0b10, Logic::One)];
/// let mut stimulus = drives
///     .into_iter()
///     .map(|(ns, mask, value)| LaneDrive {
///         time: Time::from_ns(ns),
///         net: a,
///         mask,
///         values: Lanes::all(value),
///     })
///     .peekable();
/// let mut kernel = LaneKernel::new(&netlist, &timing);
/// kernel.run(&mut stimulus, Time::from_ns(2), &mut ())?;
/// assert_eq!(kernel.value(z).lane(0), Logic::One);
/// assert_eq!(kernel.value(z).lane(1), Logic::Zero);
/// # Ok::<(), Box<dyn std::error::Error>>(())
/// ```
pub struct LaneKernel {
    now_fs: i64,
    nets: Vec<NetState>,
    cells: Vec<CellState>,
    fan_out: FanOut,
    delays: Vec<DelaySet>,
    wheel: TimeWheel,
    groups: Vec<Group>,
    free_group: u32,
    dirty: Vec<u32>,
    /// By net; of clocks only.
    edges: Vec<ClockEdge>,
    /// Clocks with an edge in this round.
    risen: Vec<u32>,
    events: u64,
    lane_changes: u64,
}

impl LaneKernel {
    /// Prepares a simulation at time 0 with every net and flip-flop of every lane unknown.
    pub fn new(netlist: &Netlist, timing: &Timing) -> Self {
        let unknown = Lanes::all(Logic::X);
        let net = NetState {
            value: unknown,
            target: unknown,
            groups: NONE,
        };
        let (delays, places) = DelaySet::all(netlist, timing);
        let index = |n: Option<NetId>| n.map_or(NONE, |n| n.index() as u32);
        let cells = netlist
            .cells()
            .iter()
            .enumerate()
            .map(|(i, cell)| CellState {
                kind: cell.kind,
                is_dirty: false,
                model: timing.model(CellId::new(i)),
                inputs: cell.inputs.map(index),
                outputs: cell.outputs.map(index),
                delays: places[timing.set_of(CellId::new(i)) as usize],
                changed: [0; MAX_INPUTS],
                state: unknown,
            });
        LaneKernel {
            now_fs: 0,
            nets: vec![net; netlist.net_count()],
            cells: cells.collect(),
            fan_out: FanOut::new(netlist, &[]),
            delays,
            wheel: TimeWheel::new(),
            groups: Vec::new(),
            free_group: NONE,
            dirty: Vec::new(),
            edges: vec![ClockEdge::default(); netlist.net_count()],
            risen: Vec::new(),
            events: 0,
            lane_changes: 0,
        }
    }

    /// Present value of a net in every lane.
    pub fn value(&self, net: NetId) -> Lanes {
        self.nets[net.index()].value
    }

    /// Present value of a bus of at most 64 bits in one lane, bit 0 first, where all bits are known.
    pub fn number(&self, nets: &[NetId], lane: usize) -> Option<u64> {
        nets.iter().rev().try_fold(0, |number, &net| {
            Some(number << 1 | self.value(net).lane(lane).to_bool()? as u64)
        })
    }

    /// Net changes so far, a change in several lanes counted once.
    pub fn events(&self) -> u64 {
        self.events
    }

    /// Net changes so far, summed over the lanes.
    pub fn lane_changes(&self) -> u64 {
        self.lane_changes
    }

    /// Simulates everything up to and including `until`. `stimulus` must be in time order.
    ///
    /// # Errors
    /// When a loop of cells without delay oscillates within one instant.
    pub fn run<O: LaneObserver>(
        &mut self,
        stimulus: &mut std::iter::Peekable<impl Iterator<Item = LaneDrive>>,
        until: Time,
        observer: &mut O,
    ) -> Result<(), Oscillation> {
        let until_fs = until.as_fs();
        loop {
            let drive_fs = stimulus.peek().map_or(i64::MAX, |d| d.time.as_fs());
            let time_fs = match self.wheel.next_time(drive_fs.min(until_fs)) {
                Some(time_fs) => time_fs,
                None if drive_fs <= until_fs => drive_fs,
                None => break,
            };
            debug_assert!(time_fs >= self.now_fs, "a drive in the past");
            self.now_fs = time_fs;
            self.wheel.advance(time_fs);
            while let Some(drive) = stimulus.next_if(|d| d.time.as_fs() <= time_fs) {
                let net = drive.net.index();
                let mask = drive.mask & self.nets[net].value.differs(drive.values);
                if mask != 0 {
                    self.apply(net, mask, drive.values, observer);
                }
            }
            self.settle(observer)?;
        }
        self.now_fs = self.now_fs.max(until_fs);
        self.wheel.advance(self.now_fs);
        Ok(())
    }

    fn settle<O: LaneObserver>(&mut self, observer: &mut O) -> Result<(), Oscillation> {
        for _ in 0..MOST_DELTA_CYCLES {
            while let Some(event) = self.wheel.pop_at(self.now_fs) {
                let net = event.net as usize;
                let (mask, values) = self.take_group(net);
                if mask != 0 {
                    self.apply(net, mask, values, observer);
                }
            }
            if self.dirty.is_empty() && self.risen.is_empty() {
                return Ok(());
            }
            let mut dirty = std::mem::take(&mut self.dirty);
            for &cell in &dirty {
                self.evaluate(cell as usize);
            }
            dirty.clear();
            self.dirty = dirty;
            // After the others: a flip-flop whose reset changed, too, has seen both by now, and this changes nothing.
            while let Some(net) = self.risen.pop() {
                self.clock(net as usize);
            }
        }
        // What is due now is what the last round began.
        let next = self.wheel.pop_at(self.now_fs).map(|event| event.net);
        Err(Oscillation {
            time: Time::from_fs(self.now_fs),
            net: NetId::new(next.unwrap_or_default() as usize),
        })
    }

    /// The flip-flops on a clock that has risen look at D; most hold already what they would take.
    fn clock(&mut self, net: usize) {
        let edge = self.edges[net];
        for at in self.fan_out.clocks.range_of(net) {
            let index = self.fan_out.clocks.load(at).cell();
            let cell = &self.cells[index];
            let data = self.nets[cell.inputs[0] as usize].value;
            if edge.may_have_risen | edge.rose & cell.state.differs(data) != 0 {
                self.evaluate(index);
            }
        }
        self.edges[net] = ClockEdge::default();
    }

    /// Unlinks the group of `net` that is due now; returns its lanes and their values.
    fn take_group(&mut self, net: usize) -> (u64, Lanes) {
        let index = self.nets[net].groups;
        match self.groups.get(index as usize) {
            Some(&group) if group.time_fs == self.now_fs => {
                self.nets[net].groups = group.next;
                self.groups[index as usize].next = self.free_group;
                self.free_group = index;
                (group.mask, group.values)
            }
            _ => (0, Lanes::default()),
        }
    }

    fn apply<O: LaneObserver>(&mut self, net: usize, mask: u64, values: Lanes, observer: &mut O) {
        let before = self.nets[net].value;
        let after = before.replaced(mask, values);
        self.nets[net].value = after;
        self.events += 1;
        self.lane_changes += u64::from(mask.count_ones());
        observer.change(Time::from_fs(self.now_fs), NetId::new(net), mask, after);
        let rose = mask & before.zero & after.one;
        let may_have_risen = mask & (before.zero & after.unknown() | before.unknown() & after.one);
        for &load in self.fan_out.active.net_loads(net) {
            let cell = &mut self.cells[load.cell()];
            cell.changed[load.pin()] |= mask;
            if !cell.is_dirty {
                cell.is_dirty = true;
                self.dirty.push(load.cell() as u32);
            }
        }
        // A clock going low causes nothing.
        let changed = mask & !after.zero;
        if changed != 0 && !self.fan_out.clocks.net_loads(net).is_empty() {
            let edge = &mut self.edges[net];
            if edge.changed == 0 {
                self.risen.push(net as u32);
            }
            edge.changed |= changed;
            edge.rose |= rose;
            edge.may_have_risen |= may_have_risen;
        }
    }

    fn evaluate(&mut self, index: usize) {
        let cell = &mut self.cells[index];
        cell.is_dirty = false;
        let nets = &self.nets;
        let input = |pin: usize| nets[cell.inputs[pin] as usize].value;
        let value = match cell.kind {
            CellKind::Inv => input(0).not(),
            CellKind::Buf => input(0),
            CellKind::Nand2 => input(0).and(input(1)).not(),
            CellKind::Nor2 => input(0).or(input(1)).not(),
            CellKind::And2 => input(0).and(input(1)),
            CellKind::Or2 => input(0).or(input(1)),
            CellKind::Xor2 => input(0).xor(input(1)),
            CellKind::Xnor2 => input(0).xor(input(1)).not(),
            CellKind::Mux2 => Lanes::mux(input(0), input(1), input(2)),
            CellKind::Dffr | CellKind::Dffsr => {
                let data = input(0);
                let edge = &self.edges[cell.inputs[CLOCK] as usize];
                cell.changed[CLOCK] = edge.changed;
                let clocked = cell
                    .state
                    .replaced(edge.rose, data)
                    .blurred(edge.may_have_risen, data);
                let set = match cell.kind {
                    CellKind::Dffsr => input(3),
                    _ => Lanes::all(Logic::Zero),
                };
                let one = Lanes::all(Logic::One);
                let zero = Lanes::all(Logic::Zero);
                let after_set = clocked.replaced(set.one, one).blurred(set.unknown(), one);
                let reset = input(2);
                let next = after_set
                    .replaced(reset.one, zero)
                    .blurred(reset.unknown(), zero);
                cell.state = next;
                next
            }
        };
        let (outputs, model, sets) = (cell.outputs, cell.model, cell.delays);
        let changed = std::mem::take(&mut cell.changed);
        self.schedule(outputs[0], value, (model, sets[0]), &changed);
        if outputs[1] != NONE {
            self.schedule(outputs[1], value.not(), (model, sets[1]), &changed);
        }
    }

    fn schedule(
        &mut self,
        net: u32,
        value: Lanes,
        (model, set): (DelayModel, u32),
        changed: &[u64; MAX_INPUTS],
    ) {
        let Some(state) = self.nets.get_mut(net as usize) else {
            return;
        };
        let mut left = state.target.differs(value);
        if left == 0 {
            return;
        }
        let pending = left & state.target.differs(state.value);
        state.target = value;
        if model == DelayModel::Inertial {
            let differs = state.value.differs(value);
            if pending != 0 {
                self.overtake(net, pending, i64::MIN);
            }
            left &= differs;
        }
        // Lanes with the same pins changed have the same delays.
        while left != 0 {
            let lane = left.trailing_zeros();
            let mut alike = left;
            let mut pins = 0u8;
            for (pin, lanes) in changed.iter().enumerate() {
                if lanes >> lane & 1 == 1 {
                    alike &= lanes;
                    pins |= 1 << (2 * pin);
                } else {
                    alike &= !lanes;
                }
            }
            left &= !alike;
            debug_assert!(pins != 0, "an output moved without a cause");
            let delays_fs = self.delays[set as usize].shortest_delays(pins, 0);
            for (mask, to) in [
                (value.one, Logic::One),
                (value.zero, Logic::Zero),
                (value.unknown(), Logic::X),
            ] {
                let mut mask = mask & alike;
                if mask == 0 {
                    continue;
                }
                let time_fs = self.now_fs + i64::from(delays_fs[to as usize]);
                if model == DelayModel::Transport {
                    mask &= self.overtake(net, mask, time_fs).differs(value);
                }
                if mask != 0 {
                    self.add(net, time_fs, mask, value);
                }
            }
        }
    }

    /// Cancels what is to arrive on `net` in the lanes of `mask` at `time_fs` or later; returns the values that are
    /// left after everything earlier.
    fn overtake(&mut self, net: u32, mask: u64, time_fs: i64) -> Lanes {
        let state = &self.nets[net as usize];
        let (mut index, mut last) = (state.groups, state.value);
        while let Some(group) = self.groups.get_mut(index as usize) {
            if group.time_fs >= time_fs {
                group.mask &= !mask;
            } else {
                last = last.replaced(group.mask, group.values);
            }
            index = group.next;
        }
        last
    }

    /// Adds lanes to the group of `net` at `time_fs`, making it where there is none.
    fn add(&mut self, net: u32, time_fs: i64, mask: u64, values: Lanes) {
        let (mut before, mut index) = (NONE, self.nets[net as usize].groups);
        while let Some(group) = self.groups.get_mut(index as usize) {
            if group.time_fs == time_fs {
                group.mask |= mask;
                group.values = group.values.replaced(mask, values);
                return;
            }
            if group.time_fs > time_fs {
                break;
            }
            (before, index) = (index, group.next);
        }
        let group = Group {
            time_fs,
            mask,
            values,
            next: index,
        };
        let new = match self.free_group {
            NONE => {
                self.groups.push(group);
                self.groups.len() as u32 - 1
            }
            free => {
                self.free_group = self.groups[free as usize].next;
                self.groups[free as usize] = group;
                free
            }
        };
        match before {
            NONE => self.nets[net as usize].groups = new,
            before => self.groups[before as usize].next = new,
        }
        self.wheel.push(Event {
            time_fs,
            net,
            tag: 0,
        });
    }
}
