//! Timing checks: every flip-flop's setup, hold, recovery, removal and pulse widths, judged as the simulation runs.
//!
//! [`TimingChecks`] is an [`Observer`]. It keeps two times per net, the last possible rise and the last possible
//! fall: every check is the distance between the event that completes it and one of those times. Flip-flops for which
//! that is the same are judged together.
//!
//! | check | completed by | since | violated (IEEE 1364, 15.2 and 15.3) |
//! |---|---|---|---|
//! | setup | CK rises | D changed | 0 < distance < limit |
//! | hold | D changes | CK rose | 0 ≤ distance < limit |
//! | recovery | CK rises | R or S released | 0 ≤ distance < limit |
//! | removal | R or S released | CK rose | 0 < distance < limit |
//! | clock high, low | CK falls, rises | CK rose, fell | distance < limit |
//! | control high | R or S falls | it rose | distance < limit |
//!
//! Setup and hold have a limit of their own for each direction of D. Each direction's last change counts, so that a
//! pulse on D before CK is judged at both its edges; the smaller slack is the one reported.
//!
//! Slack is distance − limit; exactly the limit is legal. When two pins change at once, `$setuphold` and `$recrem`
//! of the standard report a hold and a recovery violation, and so does this.
//!
//! * *Instants.* What counts is a net's value before and after an instant. A net that changes and changes
//!   back within one (zero-delay glitches) had no event. Results do not depend on the order within an instant.
//!   (Making a flip-flop unknown comes after an instant; with a clock-to-output delay of zero, which no library cell
//!   has, its outputs would make a second instant of the same time.)
//! * *Unknown values.* Z is seen as X. Every change from or to X is a possible edge of both directions it could
//!   have been part of: 0→X and X→1 are rises, 1→X and X→0 falls, as the standard's `posedge` and
//!   `negedge` have it. This errs towards reporting.
//! * *Held flip-flops.* Nothing is judged while R or S is known to be high at the end of the completing
//!   instant: D and CK then mean nothing. (Control high and removal are completed by the release; the other of the
//!   two pins may still hold.)
//! * *Asynchronous samplers.* A flip-flop that samples an asynchronous signal breaks setup and hold by design. Those
//!   that [`TimingChecks::asynchronous`] names are judged and counted apart, and never made unknown.

use std::collections::HashMap;

use super::check_banks::{
    Bank, CLOCK, CheckedPins, DATA, Data, FlipFlop, RESET, SET, banks, flip_flops,
};
use super::check_report::{BINS, CheckReport, CheckSummary, Place, Policy, Violation, slack_bin};
use super::observer::Observer;
use crate::logic::Logic;
use crate::netlist::{
    CellKind, CheckKind, Control, Corner, Edge, InstanceLimits, Library, NetId, Netlist, Timing,
};
use crate::units::Time;

/// Violations that are kept one by one; further ones are only counted.
const MOST_VIOLATIONS: usize = 100_000;

/// No such event yet.
const NEVER: i64 = i64::MIN;

/// Pins of a flip-flop, in the library's order.
const PINS: [&str; 4] = ["D", "CK", "R", "S"];
/// What is known of one net.
#[derive(Clone, Copy)]
struct History {
    rose_fs: i64,
    fell_fs: i64,
    /// Value before this instant and now, as a pin sees it.
    settled: Logic,
    now: Logic,
}

impl History {
    /// The last possible change in one direction.
    fn last(&self, edge: Edge) -> i64 {
        match edge {
            Edge::Rise => self.rose_fs,
            Edge::Fall => self.fell_fs,
        }
    }

    /// Direction of the last change.
    fn last_edge(&self) -> Edge {
        match self.rose_fs > self.fell_fs {
            true => Edge::Rise,
            false => Edge::Fall,
        }
    }
}

#[derive(Clone, Copy)]
struct Found {
    time_fs: i64,
    slack_fs: i64,
    flip_flop: u32,
    kind: CheckKind,
    pin: u8,
    edge: Edge,
    is_asynchronous: bool,
}

/// Judges every flip-flop of a netlist.
pub struct TimingChecks {
    policy: Policy,
    corner: Corner,
    not_before_fs: i64,
    /// Limits that occur: the library's of each kind, and those of single instances.
    limits: Vec<InstanceLimits>,
    nets: Vec<History>,
    flip_flops: Vec<FlipFlop>,
    banks: Vec<Bank>,
    pins: CheckedPins,
    now_fs: i64,
    /// Nets that changed in this instant.
    touched: Vec<u32>,
    /// Cells to be made unknown.
    doubtful: Vec<u32>,
    summaries: [Tally; CheckKind::ALL.len()],
    found: Vec<Found>,
    left_out: u64,
}

#[derive(Clone, Copy)]
struct Tally {
    checked: u64,
    violated: u64,
    asynchronous: u64,
    asynchronous_violated: u64,
    worst: Option<Found>,
    histogram: [u64; BINS],
}

impl TimingChecks {
    /// Checks of every flip-flop from the start of time on, reported only, none excluded.
    pub fn new(netlist: &Netlist, library: &Library, corner: Corner) -> Self {
        let mut flip_flops = flip_flops(netlist);
        let banks = banks(&mut flip_flops);
        let limits = [CellKind::Dffr, CellKind::Dffsr]
            .map(|kind| InstanceLimits::of(library.checks(kind), corner));
        let unknown = History {
            rose_fs: NEVER,
            fell_fs: NEVER,
            settled: Logic::X,
            now: Logic::X,
        };
        let nothing = Tally {
            checked: 0,
            violated: 0,
            asynchronous: 0,
            asynchronous_violated: 0,
            worst: None,
            histogram: [0; BINS],
        };
        TimingChecks {
            policy: Policy::ReportOnly,
            corner,
            not_before_fs: NEVER,
            limits: limits.into(),
            nets: vec![unknown; netlist.net_count()],
            pins: CheckedPins::new(&flip_flops, &banks, netlist.net_count()),
            flip_flops,
            banks,
            now_fs: NEVER,
            touched: Vec::new(),
            doubtful: Vec::new(),
            summaries: [nothing; CheckKind::ALL.len()],
            found: Vec::new(),
            left_out: 0,
        }
    }

    /// What a violation does.
    #[must_use]
    pub fn policy(mut self, policy: Policy) -> Self {
        self.policy = policy;
        self
    }

    /// Limits of each instance, as annotated.
    #[must_use]
    pub fn limits(mut self, netlist: &Netlist, timing: &Timing) -> Self {
        let mut index_of: HashMap<InstanceLimits, u32> = HashMap::new();
        self.limits.clear();
        for flip_flop in &mut self.flip_flops {
            let cell = flip_flop.cell as usize;
            let limits = *timing.limits(cell, netlist.cells()[cell].kind);
            flip_flop.limits = *index_of.entry(limits).or_insert_with(|| {
                self.limits.push(limits);
                self.limits.len() as u32 - 1
            });
        }
        self.grouped()
    }

    /// Groups the flip-flops anew, before anything was observed.
    fn grouped(mut self) -> Self {
        debug_assert!(self.now_fs == NEVER, "limits change while checks are made");
        self.banks = banks(&mut self.flip_flops);
        self.pins = CheckedPins::new(&self.flip_flops, &self.banks, self.nets.len());
        self
    }

    /// Judges nothing that is completed before `time`, such as power-up. Earlier events still count as the ones
    /// that a later one is measured from.
    #[must_use]
    pub fn not_before(mut self, time: Time) -> Self {
        self.not_before_fs = time.as_fs();
        self
    }

    /// Flip-flops that sample asynchronous signals, by dotted path: their setup and hold are counted apart and never
    /// act. Their other checks are as everyone's.
    #[must_use]
    pub fn asynchronous(mut self, netlist: &Netlist, is: impl Fn(&str) -> bool) -> Self {
        for flip_flop in &mut self.flip_flops {
            flip_flop.is_asynchronous = is(&netlist.cell_path(flip_flop.cell as usize));
        }
        self.grouped()
    }

    /// Memory of the tables, bytes; kept violations come on top.
    pub fn memory_bytes(&self) -> usize {
        let members: usize = self.banks.iter().map(|b| size_of_val(&b.members[..])).sum();
        size_of_val(&self.nets[..])
            + size_of_val(&self.flip_flops[..])
            + size_of_val(&self.banks[..])
            + members
            + self.pins.memory_bytes()
    }

    /// What was found so far; `netlist` is the one that is checked.
    pub fn report(&mut self, netlist: &Netlist) -> CheckReport {
        self.complete();
        let path = |found: &Found| {
            let cell = self.flip_flops[found.flip_flop as usize].cell;
            netlist.cell_path(cell as usize)
        };
        let summaries = CheckKind::ALL.map(|kind| {
            let tally = &self.summaries[kind as usize];
            CheckSummary {
                kind,
                checked: tally.checked,
                violated: tally.violated,
                asynchronous_checked: tally.asynchronous,
                asynchronous_violated: tally.asynchronous_violated,
                worst: tally.worst.as_ref().map(|found| Place {
                    cell: path(found),
                    pin: PINS[found.pin as usize].to_owned(),
                    time_fs: found.time_fs,
                    slack_fs: found.slack_fs,
                }),
                histogram: tally.histogram.to_vec(),
            }
        });
        // Within an instant in the order of the netlist.
        self.found
            .sort_by_key(|f| (f.time_fs, f.flip_flop, f.kind, f.pin));
        let path = |found: &Found| {
            let cell = self.flip_flops[found.flip_flop as usize].cell;
            netlist.cell_path(cell as usize)
        };
        let violations = self.found.iter().map(|found| Violation {
            kind: found.kind,
            cell: path(found),
            pin: PINS[found.pin as usize].to_owned(),
            edge: found.edge,
            time_fs: found.time_fs,
            slack_fs: found.slack_fs,
            is_asynchronous: found.is_asynchronous,
        });
        let asynchronous = self.flip_flops.iter().filter(|f| f.is_asynchronous);
        CheckReport {
            policy: self.policy,
            corner: self.corner,
            not_before_fs: (self.not_before_fs != NEVER).then_some(self.not_before_fs),
            flip_flops: self.flip_flops.len(),
            asynchronous_flip_flops: asynchronous.count(),
            memory_bytes: self.memory_bytes(),
            summaries: summaries.to_vec(),
            violations: violations.collect(),
            violations_left_out: self.left_out,
        }
    }

    /// Judges the instant that has just ended.
    fn complete(&mut self) {
        if self.touched.is_empty() {
            return;
        }
        let mut touched = std::mem::take(&mut self.touched);
        // All histories first, so that the judgement sees the whole instant.
        touched.retain(|&net| self.nets[net as usize].advance(self.now_fs));
        for &net in &touched {
            for position in self.pins.of(net as usize) {
                let (index, pin) = self.pins.at(position);
                if pin == DATA {
                    self.unsettle(index);
                }
            }
        }
        if self.now_fs >= self.not_before_fs {
            for &net in &touched {
                for position in self.pins.of(net as usize) {
                    match self.pins.at(position) {
                        (flip_flop, DATA) => self.judge_data(flip_flop),
                        (bank, pin) => self.judge_bank(bank as usize, pin),
                    }
                }
            }
        }
        touched.clear();
        self.touched = touched;
    }

    /// Puts a flip-flop whose D has changed on the list of those whose setup is judged.
    #[inline]
    fn unsettle(&mut self, index: u32) {
        let flip_flop = &mut self.flip_flops[index as usize];
        let bank = &mut self.banks[flip_flop.bank as usize];
        match flip_flop.data {
            Data::Recent => return,
            Data::Settled => bank.settled -= 1,
            Data::Still => {}
        }
        flip_flop.data = Data::Recent;
        bank.recent.push(index);
    }

    /// Whether R or S holds the flip-flops of a bank.
    #[inline]
    fn is_held(&self, bank: &Bank) -> bool {
        let is_high = |pin: usize| {
            let net = self.nets.get(bank.nets[pin] as usize);
            net.is_some_and(|net| net.now == Logic::One)
        };
        is_high(RESET) || is_high(SET)
    }

    /// Judges what a change of D has completed.
    #[inline]
    fn judge_data(&mut self, index: u32) {
        let flip_flop = &self.flip_flops[index as usize];
        let bank = flip_flop.bank as usize;
        if self.is_held(&self.banks[bank]) {
            return;
        }
        let edge = self.nets[flip_flop.nets[DATA] as usize].last_edge();
        let clock = &self.nets[flip_flop.nets[CLOCK] as usize];
        let since_fs = clock.rose_fs;
        self.measure(bank, &[index], CheckKind::Hold, DATA, edge, since_fs);
    }

    /// Judges what the change of one pin other than D has completed.
    #[inline]
    fn judge_bank(&mut self, index: usize, pin: usize) {
        let now_fs = self.now_fs;
        if self.is_held(&self.banks[index]) {
            return;
        }
        let nets = self.banks[index].nets;
        let clock = self.nets[nets[CLOCK] as usize];
        if pin != CLOCK {
            let control = self.nets[nets[pin] as usize];
            // A rise to X completes nothing.
            if control.fell_fs != now_fs {
                return;
            }
            if clock.rose_fs != now_fs {
                self.measure_all(index, CheckKind::Removal, pin, Edge::Fall, clock.rose_fs);
            }
            let rose_fs = control.rose_fs;
            self.measure_all(index, CheckKind::ControlHigh, pin, Edge::Fall, rose_fs);
        } else if clock.rose_fs == now_fs {
            self.judge_setup(index);
            for control in [RESET, SET] {
                if let Some(net) = self.nets.get(nets[control] as usize) {
                    let fell_fs = net.fell_fs;
                    self.measure_all(index, CheckKind::Recovery, control, Edge::Fall, fell_fs);
                }
            }
            self.measure_all(index, CheckKind::ClockLow, CLOCK, Edge::Rise, clock.fell_fs);
        } else {
            self.measure_all(
                index,
                CheckKind::ClockHigh,
                CLOCK,
                Edge::Fall,
                clock.rose_fs,
            );
        }
    }

    /// Judges the setup of a bank whose clock has risen.
    #[inline]
    fn judge_setup(&mut self, index: usize) {
        let bank = &mut self.banks[index];
        let (settled, is_asynchronous) = (bank.settled, bank.is_asynchronous);
        let tally = &mut self.summaries[CheckKind::Setup as usize];
        if is_asynchronous {
            tally.asynchronous += settled;
        } else {
            tally.checked += settled;
            tally.histogram[BINS - 1] += settled;
        }
        if bank.recent.is_empty() {
            return;
        }
        let mut recent = std::mem::take(&mut bank.recent);
        recent.retain(|&flip_flop| {
            let data = self.nets[self.flip_flops[flip_flop as usize].nets[DATA] as usize];
            let Some(edge) = self.edge_nearest_setup(flip_flop, data) else {
                return true;
            };
            let since_fs = data.last(edge);
            let of_one = &[flip_flop];
            let slack_fs = self.measure(index, of_one, CheckKind::Setup, DATA, edge, since_fs);
            let changes_now = data.last(data.last_edge()) == self.now_fs;
            let is_recent = changes_now || slack_bin(slack_fs) < BINS - 1;
            if !is_recent {
                self.flip_flops[flip_flop as usize].data = Data::Settled;
                self.banks[index].settled += 1;
            }
            is_recent
        });
        self.banks[index].recent = recent;
    }

    /// Which of the last rise and fall of D before this instant comes nearer to its setup limit.
    #[inline]
    fn edge_nearest_setup(&self, index: u32, data: History) -> Option<Edge> {
        let limits = &self.limits[self.flip_flops[index as usize].limits as usize];
        let limit = |edge| limits.at(Control::Reset, CheckKind::Setup, edge);
        let before = |edge: &Edge| ![NEVER, self.now_fs].contains(&data.last(*edge));
        let edges = Edge::BOTH.into_iter().filter(before);
        edges.max_by_key(|&edge| data.last(edge) + i64::from(limit(edge)))
    }

    /// Judges one distance of every flip-flop of a bank.
    #[inline]
    fn measure_all(&mut self, bank: usize, kind: CheckKind, pin: usize, edge: Edge, since_fs: i64) {
        let members = std::mem::take(&mut self.banks[bank].members);
        self.measure(bank, &members, kind, pin, edge, since_fs);
        self.banks[bank].members = members;
    }

    /// Judges one distance for some flip-flops of a bank: from `since_fs` to now, where `pin` changes or has changed
    /// in the direction of `edge`. Returns its slack, fs.
    #[inline]
    fn measure(
        &mut self,
        bank: usize,
        members: &[u32],
        kind: CheckKind,
        pin: usize,
        edge: Edge,
        since_fs: i64,
    ) -> i64 {
        if since_fs == NEVER {
            return i64::MAX;
        }
        let bank = &self.banks[bank];
        let control = match pin {
            SET => Control::Set,
            _ => Control::Reset,
        };
        let limit_fs = self.limits[bank.limits as usize].at(control, kind, edge);
        let slack_fs = self.now_fs - since_fs - i64::from(limit_fs);
        let is_asynchronous = bank.is_asynchronous && kind.concerns_data();
        let tally = &mut self.summaries[kind as usize];
        let count = members.len() as u64;
        let found = Found {
            time_fs: self.now_fs,
            slack_fs,
            flip_flop: members[0],
            kind,
            pin: pin as u8,
            edge,
            is_asynchronous,
        };
        if is_asynchronous {
            tally.asynchronous += count;
            tally.asynchronous_violated += count * u64::from(slack_fs < 0);
        } else {
            tally.checked += count;
            tally.histogram[slack_bin(slack_fs)] += count;
            // The first smallest; of one instant, the first in the netlist.
            let rank = |f: &Found| (f.slack_fs, f.time_fs, f.flip_flop);
            if tally.worst.is_none_or(|worst| rank(&found) < rank(&worst)) {
                tally.worst = Some(found);
            }
        }
        if slack_fs < 0 {
            for &flip_flop in members {
                self.violated(Found { flip_flop, ..found });
            }
        }
        slack_fs
    }

    #[cold]
    fn violated(&mut self, found: Found) {
        if self.found.len() < MOST_VIOLATIONS {
            self.found.push(found);
        } else {
            self.left_out += 1;
        }
        if found.is_asynchronous {
            return;
        }
        self.summaries[found.kind as usize].violated += 1;
        if self.policy == Policy::XOnViolation && found.kind.spoils_state() {
            let cell = self.flip_flops[found.flip_flop as usize].cell;
            self.doubtful.push(cell);
        }
    }
}

impl History {
    /// Ends an instant; returns whether the net has changed in it.
    fn advance(&mut self, now_fs: i64) -> bool {
        let (before, now) = (self.settled, self.now);
        self.settled = now;
        // Rank 0 < X < 1: every step up is a possible rise, every step down a possible fall.
        let rank = |value: Logic| match value {
            Logic::Zero => 0,
            Logic::X | Logic::Z => 1,
            Logic::One => 2,
        };
        match rank(now).cmp(&rank(before)) {
            std::cmp::Ordering::Greater => self.rose_fs = now_fs,
            std::cmp::Ordering::Less => self.fell_fs = now_fs,
            std::cmp::Ordering::Equal => return false,
        }
        true
    }
}

impl Observer for TimingChecks {
    #[inline]
    fn change(&mut self, time: Time, net: NetId, value: Logic) {
        if time.as_fs() != self.now_fs {
            self.complete();
            self.now_fs = time.as_fs();
        }
        let index = net.index();
        if self.pins.has_any(index) {
            self.nets[index].now = value.seen();
            self.touched.push(index as u32);
        }
    }

    #[inline]
    fn doubtful(&mut self) -> Option<usize> {
        if self.policy == Policy::ReportOnly {
            return None;
        }
        self.complete();
        self.doubtful.pop().map(|cell| cell as usize)
    }
}
