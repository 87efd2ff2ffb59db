//! Timing checks: every flip-flop's setup, hold, recovery, removal and pulse widths, judged as the simulation runs.
//!
//! [`TimingChecks`] is an [`Observer`]. It keeps two times per net, the last possible rise and the last possible
//! fall, and nothing per flip-flop that changes: every check is the distance between the event that completes
//! it and one of those times.
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

use super::check_report::{CheckReport, CheckSummary, Place, Policy, Violation, slack_bin};
use super::observer::Observer;
use crate::logic::Logic;
use crate::netlist::{CellKind, CheckKind, Corner, Edge, Library, NetId, Netlist};
use crate::units::Time;

/// Violations that are kept one by one; further ones are only counted.
const MOST_VIOLATIONS: usize = 100_000;

/// No such event yet.
const NEVER: i64 = i64::MIN;

const NO_NET: u32 = u32::MAX;

/// Pins of a flip-flop, in the library's order.
const PINS: [&str; 4] = ["D", "CK", "R", "S"];
const DATA: usize = 0;
const CLOCK: usize = 1;
const RESET: usize = 2;
const SET: usize = 3;

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

/// What is fixed of one flip-flop.
#[derive(Clone, Copy)]
struct FlipFlop {
    cell: u32,
    /// D, CK, R, S; [`NO_NET`] where the cell has no such pin.
    nets: [u32; 4],
    has_set: bool,
    is_asynchronous: bool,
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
    /// Limits by "has a set", check and direction of D, fs.
    limits: [[[i64; 2]; CheckKind::ALL.len()]; 2],
    nets: Vec<History>,
    /// Where each net's checked pins begin in `loads`.
    start: Vec<u32>,
    /// Flip-flop and pin.
    loads: Vec<(u32, u8)>,
    flip_flops: Vec<FlipFlop>,
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
    histogram: [u64; super::check_report::BINS],
}

impl TimingChecks {
    /// Checks of every flip-flop from the start of time on, reported only, none excluded.
    pub fn new(netlist: &Netlist, library: &Library, corner: Corner) -> Self {
        let flip_flops: Vec<FlipFlop> = netlist
            .cells()
            .iter()
            .enumerate()
            .filter(|(_, cell)| cell.kind.is_flip_flop())
            .map(|(index, cell)| FlipFlop {
                cell: index as u32,
                nets: cell.inputs.map(|net| {
                    if net.is_some() {
                        net.index() as u32
                    } else {
                        NO_NET
                    }
                }),
                has_set: cell.kind == CellKind::Dffsr,
                is_asynchronous: false,
            })
            .collect();
        let (start, loads) = checked_pins(&flip_flops, netlist.net_count());
        let limits = [CellKind::Dffr, CellKind::Dffsr]
            .map(|kind| library.checks(kind))
            .map(|limits| {
                CheckKind::ALL.map(|c| Edge::BOTH.map(|edge| limits.toward(c, edge, corner).into()))
            });
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
            histogram: [0; super::check_report::BINS],
        };
        TimingChecks {
            policy: Policy::ReportOnly,
            corner,
            not_before_fs: NEVER,
            limits,
            nets: vec![unknown; netlist.net_count()],
            start,
            loads,
            flip_flops,
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
        self
    }

    /// Memory of the tables, bytes; kept violations come on top.
    pub fn memory_bytes(&self) -> usize {
        fn bytes<T>(items: &[T]) -> usize {
            std::mem::size_of_val(items)
        }
        bytes(&self.nets) + bytes(&self.start) + bytes(&self.loads) + bytes(&self.flip_flops)
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
        if self.now_fs >= self.not_before_fs {
            for &net in &touched {
                let net = net as usize;
                for at in self.start[net]..self.start[net + 1] {
                    let (flip_flop, pin) = self.loads[at as usize];
                    self.judge(flip_flop, pin as usize);
                }
            }
        }
        touched.clear();
        self.touched = touched;
    }

    /// Judges what the change of one pin has completed.
    #[inline]
    fn judge(&mut self, index: u32, pin: usize) {
        let now_fs = self.now_fs;
        let flip_flop = &self.flip_flops[index as usize];
        let nets = flip_flop.nets;
        let of = |pin: usize| &self.nets[nets[pin] as usize];
        if of(RESET).now == Logic::One || flip_flop.has_set && of(SET).now == Logic::One {
            return;
        }
        let clock = *of(CLOCK);
        match pin {
            DATA => {
                let edge = of(DATA).last_edge();
                self.measure(index, CheckKind::Hold, DATA, edge, clock.rose_fs);
            }
            CLOCK if clock.rose_fs == now_fs => {
                let (data, reset) = (*of(DATA), *of(RESET));
                let set = flip_flop.has_set.then(|| *of(SET));
                if let Some(edge) = self.edge_nearest_setup(index, data) {
                    self.measure(index, CheckKind::Setup, DATA, edge, data.last(edge));
                }
                self.measure(index, CheckKind::Recovery, RESET, Edge::Fall, reset.fell_fs);
                if let Some(set) = set {
                    self.measure(index, CheckKind::Recovery, SET, Edge::Fall, set.fell_fs);
                }
                self.measure(index, CheckKind::ClockLow, CLOCK, Edge::Rise, clock.fell_fs);
            }
            CLOCK => self.measure(
                index,
                CheckKind::ClockHigh,
                CLOCK,
                Edge::Fall,
                clock.rose_fs,
            ),
            _ => {
                let control = *of(pin);
                // A rise to X completes nothing.
                if control.fell_fs != now_fs {
                    return;
                }
                if clock.rose_fs != now_fs {
                    self.measure(index, CheckKind::Removal, pin, Edge::Fall, clock.rose_fs);
                }
                self.measure(
                    index,
                    CheckKind::ControlHigh,
                    pin,
                    Edge::Fall,
                    control.rose_fs,
                );
            }
        }
    }

    /// Which of the last rise and fall of D before this instant comes nearer to its setup limit.
    #[inline]
    fn edge_nearest_setup(&self, index: u32, data: History) -> Option<Edge> {
        let has_set = self.flip_flops[index as usize].has_set;
        let limits = &self.limits[has_set as usize][CheckKind::Setup as usize];
        let before = |edge: &Edge| ![NEVER, self.now_fs].contains(&data.last(*edge));
        let edges = Edge::BOTH.into_iter().filter(before);
        edges.max_by_key(|&edge| data.last(edge) + limits[edge as usize])
    }

    /// Judges one distance: from `since_fs` to now, where `pin` changes or has changed in the direction of `edge`.
    #[inline]
    fn measure(&mut self, index: u32, kind: CheckKind, pin: usize, edge: Edge, since_fs: i64) {
        if since_fs == NEVER {
            return;
        }
        let flip_flop = self.flip_flops[index as usize];
        let limits = &self.limits[flip_flop.has_set as usize];
        let slack_fs = self.now_fs - since_fs - limits[kind as usize][edge as usize];
        let is_asynchronous = flip_flop.is_asynchronous && kind.concerns_data();
        let tally = &mut self.summaries[kind as usize];
        let found = Found {
            time_fs: self.now_fs,
            slack_fs,
            flip_flop: index,
            kind,
            pin: pin as u8,
            edge,
            is_asynchronous,
        };
        if is_asynchronous {
            tally.asynchronous += 1;
            tally.asynchronous_violated += u64::from(slack_fs < 0);
        } else {
            tally.checked += 1;
            tally.histogram[slack_bin(slack_fs)] += 1;
            if tally.worst.is_none_or(|worst| slack_fs < worst.slack_fs) {
                tally.worst = Some(found);
            }
        }
        if slack_fs < 0 {
            self.violated(found, flip_flop.cell);
        }
    }

    #[cold]
    fn violated(&mut self, found: Found, cell: u32) {
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
        if self.start[index] != self.start[index + 1] {
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

/// Fan-out of every net to the pins that are checked: where each begins, and one list of them all.
fn checked_pins(flip_flops: &[FlipFlop], net_count: usize) -> (Vec<u32>, Vec<(u32, u8)>) {
    let pins = || {
        let indexed = flip_flops.iter().enumerate();
        indexed
            .flat_map(|(index, f)| (0..4).map(move |pin| (index as u32, pin, f.nets[pin as usize])))
            .filter(|&(_, _, net)| net != NO_NET)
    };
    let mut start = vec![0u32; net_count + 1];
    for (_, _, net) in pins() {
        start[net as usize + 1] += 1;
    }
    for i in 1..start.len() {
        start[i] += start[i - 1];
    }
    let mut next = start.clone();
    let mut loads = vec![(0, 0); start[net_count] as usize];
    for (index, pin, net) in pins() {
        let at = &mut next[net as usize];
        loads[*at as usize] = (index, pin);
        *at += 1;
    }
    (start, loads)
}
