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

use super::check_banks::{Bank, CheckedPins, FlipFlop, banks, flip_flops};
use super::check_report::{BINS, CheckReport, CheckSummary, Policy, SlackLocation, Violation};
use super::observer::Observer;
use crate::logic::Logic;
use crate::netlist::{
    CellId, CellKind, CheckKind, Corner, Edge, InstanceLimits, Library, NetId, Netlist, Timing,
};
use crate::units::Time;

/// No such event yet.
pub(super) const NEVER: i64 = i64::MIN;

/// Pins of a flip-flop, in the library's order.
const PINS: [&str; 4] = ["D", "CK", "R", "S"];

/// What is known of one net.
#[derive(Clone, Copy)]
pub(super) struct History {
    pub rose_fs: i64,
    pub fell_fs: i64,
    /// Value before this instant and now, as a pin sees it.
    pub settled: Logic,
    pub now: Logic,
}

impl History {
    /// The last possible change in one direction.
    pub(super) fn last(&self, edge: Edge) -> i64 {
        match edge {
            Edge::Rise => self.rose_fs,
            Edge::Fall => self.fell_fs,
        }
    }

    /// Direction of the last change.
    pub(super) fn last_edge(&self) -> Edge {
        if self.rose_fs > self.fell_fs {
            Edge::Rise
        } else {
            Edge::Fall
        }
    }
}

#[derive(Clone, Copy)]
pub(super) struct MeasuredSlack {
    pub time_fs: i64,
    pub slack_fs: i64,
    pub flip_flop: u32,
    pub kind: CheckKind,
    pub pin: u8,
    pub edge: Edge,
    pub is_asynchronous: bool,
}

/// Judges every flip-flop of a netlist.
///
/// # Example
///
/// ```
/// use femtogate::kernel::{Drive, Kernel, Stimulus, TimingChecks};
/// use femtogate::netlist::{
///     CellKind, CheckKind, Corner, Library, ModuleBuilder, Netlist, Timing,
/// };
/// use femtogate::units::Time;
///
/// let mut m = ModuleBuilder::new("top");
/// let (d, ck, r, q) = (m.input("D"), m.input("CK"), m.input("R"), m.output("Q"));
/// m.cell("bit", CellKind::Dffr, &[d, ck, r], &[Some(q), None]);
/// let netlist = Netlist::elaborate(&m.finish()?);
/// let library = Library::generic_40nm();
/// let timing = Timing::nominal(&netlist, &library, Corner::Typ);
///
/// // D rises a picosecond before CK.
/// let [d, ck, r] = ["D", "CK", "R"].map(|name| netlist.net(name).unwrap());
/// let low = [d, ck, r].map(|net| Drive::new(Time::ZERO, net, false));
/// let rises = [(9_999, d), (10_000, ck)];
/// let rises = rises.map(|(ps, net)| Drive::new(Time::from_ps(ps), net, true));
/// let mut stimulus = Stimulus::new(low).with_drives(rises);
/// let mut checks = TimingChecks::new(&netlist, &library, Corner::Typ);
/// Kernel::new(&netlist, &timing).run(&mut stimulus, Time::from_ns(20), &mut checks)?;
///
/// let report = checks.report(&netlist);
/// assert_eq!(report.summary(CheckKind::Setup).violated, 1);
/// assert_eq!(report.violations[0].cell, "top.bit");
/// # Ok::<(), Box<dyn std::error::Error>>(())
/// ```
pub struct TimingChecks {
    pub(super) policy: Policy,
    pub(super) corner: Corner,
    pub(super) not_before_fs: i64,
    /// Limits that occur: the library's of each kind, and those of single instances.
    pub(super) limits: Vec<InstanceLimits>,
    pub(super) nets: Vec<History>,
    pub(super) flip_flops: Vec<FlipFlop>,
    pub(super) banks: Vec<Bank>,
    pub(super) pins: CheckedPins,
    pub(super) now_fs: i64,
    /// Nets that changed in this instant.
    pub(super) touched: Vec<u32>,
    /// Cells to be made unknown.
    pub(super) doubtful: Vec<u32>,
    pub(super) summaries: [Tally; CheckKind::ALL.len()],
    pub(super) found: Vec<MeasuredSlack>,
    pub(super) left_out: u64,
}

#[derive(Clone, Copy)]
pub(super) struct Tally {
    pub checked: u64,
    pub violated: u64,
    pub asynchronous: u64,
    pub asynchronous_violated: u64,
    pub worst: Option<MeasuredSlack>,
    pub histogram: [u64; BINS],
}

impl TimingChecks {
    /// Checks of every flip-flop from the start of time on, reported only, none excluded.
    pub fn new(netlist: &Netlist, library: &Library, corner: Corner) -> Self {
        let mut flip_flops = flip_flops(netlist);
        let banks = banks(&mut flip_flops);
        let limits = [CellKind::Dffr, CellKind::Dffsr]
            .map(|kind| InstanceLimits::from_library(library.checks(kind), corner));
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
            let cell = CellId::new(flip_flop.cell as usize);
            let limits = *timing.limits(cell, netlist.cells()[cell.index()].kind);
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
            flip_flop.is_asynchronous =
                is(&netlist.cell_path(CellId::new(flip_flop.cell as usize)));
        }
        self.grouped()
    }

    /// Memory of the tables, bytes; kept violations come on top.
    pub(crate) fn memory_bytes(&self) -> usize {
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
        // Within an instant in the order of the netlist.
        self.found
            .sort_by_key(|f| (f.time_fs, f.flip_flop, f.kind, f.pin));
        let path = |found: &MeasuredSlack| {
            let cell = self.flip_flops[found.flip_flop as usize].cell;
            netlist.cell_path(CellId::new(cell as usize))
        };
        let summaries = CheckKind::ALL.map(|kind| {
            let tally = &self.summaries[kind as usize];
            CheckSummary {
                kind,
                checked: tally.checked,
                violated: tally.violated,
                asynchronous_checked: tally.asynchronous,
                asynchronous_violated: tally.asynchronous_violated,
                worst: tally.worst.as_ref().map(|found| SlackLocation {
                    cell: path(found),
                    pin: PINS[found.pin as usize].to_owned(),
                    time: Time::from_fs(found.time_fs),
                    slack: Time::from_fs(found.slack_fs),
                }),
                histogram: tally.histogram.to_vec(),
            }
        });
        let violations = self.found.iter().map(|found| Violation {
            kind: found.kind,
            cell: path(found),
            pin: PINS[found.pin as usize].to_owned(),
            edge: found.edge,
            time: Time::from_fs(found.time_fs),
            slack: Time::from_fs(found.slack_fs),
            is_asynchronous: found.is_asynchronous,
        });
        let asynchronous = self.flip_flops.iter().filter(|f| f.is_asynchronous);
        CheckReport {
            policy: self.policy,
            corner: self.corner,
            not_before: (self.not_before_fs != NEVER).then_some(Time::from_fs(self.not_before_fs)),
            flip_flops: self.flip_flops.len(),
            asynchronous_flip_flops: asynchronous.count(),
            memory_bytes: self.memory_bytes(),
            summaries: summaries.to_vec(),
            violations: violations.collect(),
            violations_left_out: self.left_out,
        }
    }
}

impl History {
    /// Ends an instant; returns whether the net has changed in it.
    pub(super) fn advance(&mut self, now_fs: i64) -> bool {
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
            self.nets[index].now = value.as_gate_input();
            self.touched.push(index as u32);
        }
    }

    #[inline]
    fn doubtful(&mut self) -> Option<CellId> {
        if self.policy == Policy::ReportOnly {
            return None;
        }
        self.complete();
        let cell = self.doubtful.pop()?;
        Some(CellId::new(cell as usize))
    }
}
