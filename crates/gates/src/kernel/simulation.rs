//! The event loop.

mod banks;
mod evaluation;
mod shuffle;

use self::shuffle::Shuffle;
use super::compiled::{CLOCK, CellState, DelaySet, FanOut, Tables, initial_cells};
use super::observer::Observer;
use super::oscillation::{MOST_DELTA_CYCLES, Oscillation};
use super::shift_banks::ShiftBank;
use super::stimulus::Stimulus;
use super::transport::TransportQueues;
use super::wheel::{Event, TimeWheel};
use crate::logic::Logic;
use crate::netlist::{CellId, NetId, Netlist, Timing};
use crate::units::Time;

/// No value is pending on a net.
const NONE: u8 = 4;

/// The net's driver has transport delays: what is pending is in its queue.
const QUEUED: u8 = 5;

/// The net is the first output of a bank, whose changes are on their way.
const BANKED: u8 = 6;

/// Generation of a queued change; nets with a queue stay at 0.
const QUEUED_GENERATION: u32 = 1;

/// Bits of a flip-flop's reset and set in its packed inputs.
const RESET_AND_SET: u8 = 0b1111_0000;

#[derive(Clone, Copy)]
struct NetState {
    generation: u32,
    value: u8,
    pending: u8,
    /// As a clock: its value when the flip-flops on it last looked, or 0 where it has fallen since.
    clock_before: u8,
    /// In the list of clocks that have risen.
    has_risen: bool,
}

/// What a simulation did.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub struct Statistics {
    /// Net value changes.
    pub changes: u64,
    /// Cell evaluations.
    pub evaluations: u64,
}

/// An event-driven simulation of one netlist.
pub struct Kernel {
    now_fs: i64,
    nets: Vec<NetState>,
    cells: Vec<CellState>,
    fan_out: FanOut,
    tables: Tables,
    delays: Vec<DelaySet>,
    wheel: TimeWheel,
    /// Cells to evaluate in this round, and nets whose flip-flops are to look at D.
    dirty: Vec<u32>,
    risen: Vec<u32>,
    /// Flip-flops that may change with the present clock edge.
    woken: Vec<usize>,
    transport: TransportQueues,
    banks: Vec<ShiftBank>,
    /// Whether banks may form.
    forms_banks: bool,
    shuffle: Option<Shuffle>,
    statistics: Statistics,
}

impl Kernel {
    /// Prepares a simulation at time 0 with every net and flip-flop unknown.
    pub fn new(netlist: &Netlist, timing: &Timing) -> Self {
        let unknown = NetState {
            generation: 0,
            value: Logic::X.bits(),
            pending: NONE,
            clock_before: Logic::X.bits(),
            has_risen: false,
        };
        let transport = TransportQueues::new(netlist, timing);
        let banks = ShiftBank::all(netlist, timing);
        let mut apart = Vec::new();
        if !banks.is_empty() {
            apart.resize(netlist.cells().len(), false);
        }
        for &cell in banks.iter().flat_map(|bank| &bank.cells) {
            apart[cell as usize] = true;
        }
        let (delays, places) = DelaySet::all(netlist, timing);
        let mut nets = vec![unknown; netlist.net_count()];
        for net in transport.nets() {
            nets[net].pending = QUEUED;
        }
        Kernel {
            now_fs: 0,
            nets,
            cells: initial_cells(netlist, timing, &places),
            delays,
            fan_out: FanOut::new(netlist, &apart),
            tables: Tables::new(),
            wheel: TimeWheel::new(),
            dirty: Vec::new(),
            risen: Vec::new(),
            woken: Vec::new(),
            transport,
            banks,
            forms_banks: true,
            shuffle: None,
            statistics: Statistics::default(),
        }
    }

    /// Handles what happens in one instant in a random order from now on, to show that no result depends on it.
    #[must_use]
    pub fn shuffled(mut self, seed: u64) -> Self {
        // Flip-flop by flip-flop: the obvious way, to compare with.
        self.forms_banks = false;
        self.shuffle = Some(Shuffle {
            state: seed,
            events: Vec::new(),
        });
        self
    }

    /// The present.
    pub fn now(&self) -> Time {
        Time::from_fs(self.now_fs)
    }

    /// Present value of a net.
    #[inline]
    pub fn value(&self, net: NetId) -> Logic {
        Logic::from_bits(self.nets[net.index()].value)
    }

    /// Present value of a bus of at most 64 bits, bit 0 first, where all bits are known.
    pub fn number(&self, nets: &[NetId]) -> Option<u64> {
        nets.iter().rev().try_fold(0, |number, &net| {
            Some(number << 1 | self.value(net).to_bool()? as u64)
        })
    }

    /// What has been done so far.
    pub fn statistics(&self) -> Statistics {
        self.statistics
    }

    /// Simulates everything up to and including `until`, and leaves the present there.
    ///
    /// Drives in the past are a mistake of the caller; they are caught in debug builds and
    /// applied at once otherwise.
    ///
    /// # Errors
    /// When a loop of cells without delay oscillates within one instant.
    ///
    /// # Example
    ///
    /// ```
    /// use femtogate::kernel::{Drive, Kernel, Stimulus};
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
    /// let mut kernel = Kernel::new(&netlist, &timing);
    /// assert_eq!(kernel.value(z), Logic::X);
    ///
    /// let mut stimulus = Stimulus::new([Drive::new(Time::from_ns(1), a, true)]);
    /// kernel.run(&mut stimulus, Time::from_ns(2), &mut ())?;
    /// assert_eq!(kernel.value(z), Logic::Zero);
    /// assert_eq!(kernel.now(), Time::from_ns(2));
    /// # Ok::<(), Box<dyn std::error::Error>>(())
    /// ```
    pub fn run(
        &mut self,
        stimulus: &mut Stimulus<'_>,
        until: Time,
        observer: &mut dyn Observer,
    ) -> Result<(), Oscillation> {
        let ended = self.run_until(stimulus, until.as_fs(), observer);
        self.give_all_values();
        ended
    }

    fn run_until(
        &mut self,
        stimulus: &mut Stimulus<'_>,
        until_fs: i64,
        observer: &mut dyn Observer,
    ) -> Result<(), Oscillation> {
        loop {
            let drive_fs = stimulus.peek().map_or(i64::MAX, |d| d.time.as_fs());
            let limit_fs = drive_fs.min(until_fs);
            let time_fs = match self.wheel.next_time(limit_fs) {
                Some(time_fs) => time_fs,
                None if drive_fs <= until_fs => drive_fs,
                None => break,
            };
            debug_assert!(time_fs >= self.now_fs, "a drive in the past");
            self.now_fs = time_fs.max(self.now_fs);
            self.wheel.advance(self.now_fs);
            while let Some(drive) = stimulus.next_until(self.now()) {
                if self.nets[drive.net.index()].value != drive.value.bits() {
                    self.apply(drive.net.index(), drive.value.bits(), observer);
                }
            }
            self.settle(observer)?;
            while let Some(cell) = observer.doubtful() {
                self.give_all_values();
                self.corrupt(cell.index());
            }
        }
        self.now_fs = self.now_fs.max(until_fs);
        self.wheel.advance(self.now_fs);
        Ok(())
    }

    /// Makes the state of flip-flop `cell` unknown, as far as its reset and set leave it open; its outputs
    /// follow one clock-to-output delay from now.
    ///
    /// # Panics
    /// When there is no such cell.
    #[cold]
    #[inline(never)]
    pub(crate) fn corrupt(&mut self, cell: usize) {
        self.dissolve_bank_of(cell);
        let cell = &mut self.cells[cell];
        debug_assert!(cell.kind.is_flip_flop(), "only a flip-flop has a state");
        // No pin changes: what is left is what reset and set make of an unknown state.
        let unknown = Logic::X.bits();
        let (no_edge, before) = (cell.inputs, 0);
        let state = self.tables.flip_flop(no_edge, before, unknown);
        if state == cell.state {
            return;
        }
        cell.state = state;
        let (outputs, sets) = (cell.outputs, cell.delays);
        let inverted = Logic::from_bits(state).inverted().bits();
        let [to_q, to_qn] = sets.map(|set| *self.delays[set as usize].after_pin(CLOCK));
        // A value that becomes unknown is no pulse.
        self.schedule(outputs[0], state, &to_q, &mut ());
        self.schedule(outputs[1], inverted, &to_qn, &mut ());
    }

    /// Gives flip-flops another state and lets everything that follows from it follow, without time
    /// passing and without a clock edge: the netlist afterwards is as if they had come by it earlier. `observer` hears
    /// of the nets that changed.
    ///
    /// Only at rest: no change may be on its way, and what follows must not reach a reset or set.
    pub fn preset(
        &mut self,
        states: impl IntoIterator<Item = (CellId, bool)>,
        observer: &mut dyn Observer,
    ) {
        debug_assert!(
            self.wheel.next_time(i64::MAX).is_none(),
            "changes are on their way"
        );
        let mut changes: Vec<(u32, u8)> = Vec::new();
        for (cell, state) in states {
            let cell = cell.index();
            self.dissolve_bank_of(cell);
            let cell = &mut self.cells[cell];
            debug_assert!(cell.kind.is_flip_flop(), "only a flip-flop has a state");
            let state = Logic::from(state);
            cell.state = state.bits();
            let [q, q_n] = cell.outputs;
            changes.extend([(q, state.bits()), (q_n, state.inverted().bits())]);
        }
        while let Some((net, value)) = changes.pop() {
            let Some(state) = self.nets.get_mut(net as usize) else {
                continue;
            };
            if state.value == value {
                continue;
            }
            state.value = value;
            state.clock_before = value;
            let (net, value) = (NetId::new(net as usize), Logic::from_bits(value));
            observer.change(Time::from_fs(self.now_fs), net, value);
            for &load in self.fan_out.active.net_loads(net.index()) {
                let cell = &mut self.cells[load.cell()];
                debug_assert!(!cell.kind.is_flip_flop(), "a reset or set");
                let shift = 2 * load.pin();
                cell.inputs = cell.inputs & !(3 << shift) | value.bits() << shift;
                cell.evaluated = cell.inputs;
                changes.push((cell.outputs[0], self.tables.gate(cell.kind, cell.inputs)));
            }
        }
    }

    fn settle(&mut self, observer: &mut dyn Observer) -> Result<(), Oscillation> {
        for _ in 0..MOST_DELTA_CYCLES {
            if self.shuffle.is_some() {
                self.arrive_shuffled(observer);
            } else {
                while let Some(event) = self.wheel.pop_at(self.now_fs) {
                    self.arrive(event, observer);
                }
            }
            if self.dirty.is_empty() && self.risen.is_empty() {
                return Ok(());
            }
            let mut dirty = std::mem::take(&mut self.dirty);
            if let Some(shuffle) = &mut self.shuffle {
                shuffle.permute(&mut dirty);
                shuffle.permute(&mut self.risen);
            }
            self.statistics.evaluations += dirty.len() as u64;
            for &cell in &dirty {
                self.evaluate(cell as usize, observer);
            }
            dirty.clear();
            self.dirty = dirty;
            // After the others: a flip-flop whose reset changed, too, has seen both by now, and this changes nothing.
            while let Some(net) = self.risen.pop() {
                self.clock(net as usize, observer);
            }
        }
        // What is due now is what the last round began.
        let next = self.wheel.pop_at(self.now_fs).map(|event| event.net);
        Err(Oscillation {
            time: self.now(),
            net: NetId::new(next.unwrap_or_default() as usize),
        })
    }

    #[inline]
    fn arrive(&mut self, event: Event, observer: &mut dyn Observer) {
        let index = event.net as usize;
        let net = &mut self.nets[index];
        if net.generation == event.tag >> 2 {
            net.pending = NONE;
            self.apply(index, (event.tag & 3) as u8, observer);
        } else if net.pending == QUEUED
            && let Some(value) = self.transport.arriving(index, self.now_fs)
        {
            self.apply(index, value, observer);
        } else if net.pending == BANKED {
            self.arrive_bank(index, observer);
        }
    }

    #[cold]
    fn arrive_shuffled(&mut self, observer: &mut dyn Observer) {
        let Some(mut shuffle) = self.shuffle.take() else {
            return;
        };
        let due = std::iter::from_fn(|| self.wheel.pop_at(self.now_fs));
        shuffle.events.extend(due);
        let mut events = std::mem::take(&mut shuffle.events);
        shuffle.permute(&mut events);
        for event in events.drain(..) {
            self.arrive(event, observer);
        }
        shuffle.events = events;
        self.shuffle = Some(shuffle);
    }

    #[inline]
    fn apply(&mut self, net: usize, value: u8, observer: &mut dyn Observer) {
        self.nets[net].value = value;
        self.statistics.changes += 1;
        observer.change(
            Time::from_fs(self.now_fs),
            NetId::new(net),
            Logic::from_bits(value),
        );
        if value == Logic::Zero.bits() {
            self.nets[net].clock_before = value;
        } else if !self.nets[net].has_risen
            && (!self.fan_out.clocks.net_loads(net).is_empty() || self.clocks_a_bank(net))
        {
            self.nets[net].has_risen = true;
            self.risen.push(net as u32);
        }
        for &load in self.fan_out.active.net_loads(net) {
            let cell = &mut self.cells[load.cell()];
            let shift = 2 * load.pin();
            cell.inputs = cell.inputs & !(3 << shift) | value << shift;
            if !cell.is_dirty {
                cell.is_dirty = true;
                self.dirty.push(load.cell() as u32);
            }
        }
    }

    #[inline]
    fn schedule(&mut self, net: u32, value: u8, delays_fs: &[u32; 4], observer: &mut dyn Observer) {
        let Some(state) = self.nets.get_mut(net as usize) else {
            return;
        };
        if state.pending == value {
            return;
        }
        if state.pending != NONE {
            if state.pending == QUEUED {
                let time_fs = self.now_fs + delays_fs[value as usize] as i64;
                return self.send(net, value, time_fs, observer);
            }
            // Back to where the net is, from one known value to the other.
            if state.value == value && (value | state.pending) <= Logic::One.bits() {
                observer.inertial_glitch(Time::from_fs(self.now_fs), NetId::new(net as usize), 1);
            }
            state.generation = (state.generation + 1) & (u32::MAX >> 2);
            state.pending = NONE;
        }
        if state.value != value {
            state.pending = value;
            self.wheel.push(Event {
                time_fs: self.now_fs + delays_fs[value as usize] as i64,
                net,
                tag: state.generation << 2 | value as u32,
            });
        }
    }

    /// [`Kernel::schedule`] with a transport delay.
    #[inline(never)]
    fn send(&mut self, net: u32, value: u8, time_fs: i64, observer: &mut dyn Observer) {
        let present = self.nets[net as usize].value;
        let sent = self.transport.send(net as usize, present, value, time_fs);
        if sent.swallowed > 0 {
            let now = Time::from_fs(self.now_fs);
            observer.inertial_glitch(now, NetId::new(net as usize), sent.swallowed);
        }
        if sent.arrives {
            self.wheel.push(Event {
                time_fs,
                net,
                tag: QUEUED_GENERATION << 2,
            });
        }
    }
}
