//! Static timing of one macropixel, and the CLK periods that it allows.
//!
//! A period *works* when the histogram is the one of a slow clock: bin b holds the photons taken by rising
//! CLK edge start − bins + b. The counter counts falling CLK edges, so a STOP phase does not move the strobe
//! against CLK. It can only make the counter start one edge earlier, once STOP leads CLK's fall by more than
//! the reset pulse lasts, and so undo a shift by one whole bin: a period near the crossing itself stays
//! forbidden at every phase.
//!
//! All flip-flops of the macropixel count, with setup, hold, recovery, removal and pulse widths. Left out are, by
//! design, the sixteen that sample SPADs. The histogram's counters run on HIT, once in a laser cycle.

use crate::chip::timing::macropixel::{CounterDelays, MacropixelCircuit, MacropixelDelays, hull};
use crate::chip::timing::measure::ResetPulse;
use crate::chip::{Conflict, Limits, Mode, Probe, Probes, Race, SensorConfig, Silicon};
use crate::netlist::{
    Bound, CellId, CellKind, CheckKind, Edge, NetId, Netlist, Path, Requirement, Requirements,
};
use crate::units::Time;

/// Static windows of one macropixel, all from the edge named first: (earliest, latest) or a path.
#[derive(Debug, Clone)]
pub struct MacropixelTiming {
    /// The netlist that is analysed, which names the nets of the paths.
    pub netlist: Netlist,
    /// Handles of the macropixel's nets.
    pub probes: Probes,
    /// CLK falls → LOCAL_STOP rises: the ripple delay of the thesis (4.6, Fig. 56).
    pub ripple: Path,
    /// CLK falls → STROBE rises.
    pub strobe: (Time, Time),
    /// CLK rises → SHIFT changes, all stages together.
    pub shift: Option<(Time, Time)>,
    /// CLK rises → SPAD_EVENT settled.
    pub event: Option<Path>,
    /// The shortest path from CLK to the data of a flip-flop on the same edge, by its hold.
    pub shortest: Path,
    /// CLK falls → COUNTER_CLK rises.
    pub counter_clk: (Time, Time),
    /// CLK falls → LOCAL_STOP → BLOCK rises, and BLOCK rises → COUNTER_CLK falls at the earliest, where LOCAL_STOP blocks.
    block: Option<((Time, Time), Time)>,
    /// Shortest high pulse of COUNTER_CLK.
    counter_clk_high: Time,
    /// STOP rises → COUNTER_RESET rises.
    pub reset: (Time, Time),
    /// STOP rises → COUNTER_RESET falls.
    pub release: (Time, Time),
    /// COUNTER_RESET rises → the last edge it can send into a stage's clock, latest.
    pub reset_to_stage_clock: Time,
    /// COUNTER_RESET rises → LOCAL_STOP falls → COUNTER_CLK rises, latest.
    pub reset_to_counter_clk: Time,
    /// What the flip-flops behind CLK ask of its period, those that catch the strobe left out.
    pub clk: Vec<Requirement>,
    /// Strobe to the METDC's HIT flip-flops: setup after one change of SHIFT, hold before the next.
    pub hits: Vec<Requirement>,
    /// STOP rises → STROBE rises, where STOP makes the strobe: in the conventional mode.
    stop_strobe: Option<(Time, Time)>,
    /// Whether the first count is the first that ENABLE lets through, and not the first after a reset.
    counts_at_once: bool,
    recovery: Time,
    removal: Time,
    reset_need: Time,
    /// By how much HIT is ready before STOP's strobe, at the least: in the conventional mode.
    pub strobe_lead: Option<Time>,
    /// What half a LOAD_CLK period leaves of the pulse that loads start values, where there is no memory.
    pub load_pulse_slack: Option<Time>,
}

/// Which CLK edges a start value is counted and caught by.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Aim {
    /// Rising edges that the strobe comes after. A slow clock's comes before all of them.
    pub edges: i64,
    /// The first falling edge that counts. A slow clock's is edge 1.
    pub first: i64,
}

impl Aim {
    /// A slow clock's.
    pub const SLOW: Aim = Aim { edges: 0, first: 1 };

    /// Bins by which windows end later than at a slow clock.
    pub(crate) const fn moved(self) -> i64 {
        self.edges + self.first - 1
    }

    /// The same with a strobe one rising edge earlier.
    pub(crate) const fn earlier(self) -> Self {
        Aim {
            edges: self.edges - 1,
            ..self
        }
    }
}

impl MacropixelTiming {
    /// Analyses the macropixel at `position` (row, column) of this sensor: mismatch differs from one to the next.
    pub fn analyse(
        config: &SensorConfig,
        silicon: &Silicon,
        limits: Limits,
        position: (usize, usize),
    ) -> Self {
        // The very netlist that the gate engine simulates, so that a cell's mismatch is the same in both.
        let circuit = MacropixelCircuit::new(config, position);
        let timing = silicon.timing(&circuit.netlist);
        let (library, corner) = (silicon.limits(limits), silicon.corner);
        let paths = circuit.paths(&timing);
        let delays = MacropixelDelays::measure(&paths);
        let counter = CounterDelays::measure(&paths, &delays);
        let reset = ResetPulse::from_delays(&circuit, (&delays, &counter), (&library, corner));
        let half_load_period = Time::from_fs(config.load_clock().period().as_fs() / 2);
        let (netlist, probes) = (&circuit.netlist, &circuit.probes);
        let clk = Edge::BOTH.map(|edge| paths.after_clk(edge));
        let clk = Requirements::behind(netlist, clk, &library, corner);
        let (rise, fall) = (clk.arrivals(Edge::Rise), clk.arrivals(Edge::Fall));

        // Which CLK edge takes START is the window law's to say, in the library's delays.
        let is_library = *silicon == Silicon::new(config);
        let (hits, clk_rest) = circuit.split(clk.all(), !is_library);
        let limit = |kind: CheckKind| {
            let limits = library.checks(CellKind::Dffr);
            limits.limit(kind, corner)
        };
        let whole = "the macropixel connects these";
        MacropixelTiming {
            ripple: fall
                .path(probes.net(Probe::LocalStop), Edge::Rise, Bound::Longest)
                .expect(whole),
            strobe: counter.strobe,
            shift: delays.shift.iter().copied().reduce(hull),
            event: probes
                .find(Probe::SpadEvent)
                .and_then(|nets| rise.path_to(nets[0], Bound::Longest)),
            shortest: worst_path(&clk, clk_rest.iter(), CheckKind::Hold).expect(whole),
            counter_clk: counter.counter_clk,
            block: counter.block.zip(counter.block_to_counter_clk),
            counter_clk_high: circuit
                .clocked_by_counter_clk()
                .map(|cell| library.checks(netlist.cells()[cell.index()].kind))
                .map(|checks| checks.limit(CheckKind::ClockHigh, corner))
                .max()
                .expect("a P-counter counts"),
            reset: delays.reset,
            release: delays.release,
            reset_to_stage_clock: counter.reset_to_stage_clock.unwrap_or(Time::ZERO),
            reset_to_counter_clk: counter.reset_to_counter_clk.unwrap_or(Time::ZERO),
            stop_strobe: (config.mode == Mode::Conventional).then_some(delays.stop_strobe),
            counts_at_once: !config.p_counter.row().has_memory,
            hits,
            clk: clk_rest,
            recovery: limit(CheckKind::Recovery),
            removal: limit(CheckKind::Removal),
            reset_need: reset.need,
            strobe_lead: (config.mode == Mode::Conventional).then_some(reset.strobe_lead),
            load_pulse_slack: counter.load_pulse.map(|pulse| half_load_period - pulse),
            probes: circuit.probes,
            netlist: circuit.netlist,
        }
    }

    /// Width of the reset pulse, at its shortest.
    pub fn reset_width(&self) -> Time {
        self.release.0 - self.reset.1
    }

    /// What the reset pulse must outlast.
    pub fn reset_need(&self) -> Time {
        self.reset_need
    }

    /// Latest strobe with its hold time, from CLK's fall, less the earliest change of the bit it captures.
    fn hit_hold(&self) -> Time {
        worst(&self.hits, CheckKind::Hold)
    }

    /// Latest change of SHIFT with the setup time less the earliest strobe.
    fn hit_setup(&self) -> Time {
        worst(&self.hits, CheckKind::Setup)
    }

    /// Shortest CLK period of the path CLK → SPAD_EVENT → shift register.
    pub fn correlation_period(&self) -> Option<Time> {
        let stages: Vec<CellId> = self.probes.event_stages(&self.netlist).collect();
        let first = |r: &&Requirement| stages.contains(&r.cell);
        let setups = self.clk.iter().filter(|r| r.kind == CheckKind::Setup);
        longest(setups.filter(first))
    }

    /// Shortest CLK period of everything but the strobe.
    pub(crate) fn clk_period(&self) -> Option<Time> {
        longest(self.clk.iter())
    }

    /// CLK periods at which the strobe meets the change of the shift register `edges` rising CLK edges late: no
    /// STOP phase helps there.
    pub fn forbidden(&self, edges: i64) -> (Time, Time) {
        let period = |need: Time| Time::from_fs(2 * need.as_fs() / (2 * edges + 1));
        (period(-self.hit_setup()), period(self.hit_hold()))
    }

    /// Shortest CLK period with STOP on CLK's falling edge as far as the strobe goes: it must precede the shift
    /// register's change.
    pub fn strobe_period(&self) -> Time {
        self.forbidden(0).1
    }

    /// Between which edges this macropixel strobes and counts first: by the middle of what is certain, whatever limits say.
    pub fn aim(&self, period: Time, phase: Time) -> Aim {
        let t = period.as_fs();
        let middle = |window: (Time, Time)| (window.0 + window.1).as_fs();
        // Twice the time from the first rising edge's change of SHIFT to the strobe.
        let (earlier, later) = self.strobe_offsets(phase);
        let strobe = (self.strobe.0 + earlier, self.strobe.1 + later);
        // HIT takes what delay lines have sampled just before, at the strobe that comes after the same edge.
        let after = self
            .shift
            .map_or(0, |shift| middle(strobe) - middle(shift) - t);
        let (ignored_until, counts_from) = self.first_in_doubt(phase);
        let doubt = middle((ignored_until, counts_from));
        Aim {
            edges: after.div_euclid(2 * t) + 1,
            first: if self.counts_from_reset() {
                (-(-doubt).div_euclid(2 * t)).max(0)
            } else {
                1
            },
        }
    }

    /// By how much STOP's strobe comes after that of LOCAL_STOP, seen from CLK's fall: earliest and latest. Delay lines are sampled by
    /// what strobes, so that it does not matter when that comes.
    fn strobe_offsets(&self, phase: Time) -> (Time, Time) {
        let strobe = self.stop_strobe.filter(|_| self.shift.is_some());
        strobe.map_or((Time::ZERO, Time::ZERO), |strobe| {
            (
                strobe.0 + phase - self.strobe.0,
                strobe.1 + phase - self.strobe.1,
            )
        })
    }

    /// Whether each laser cycle's first count is the first after its reset, and counts at all.
    fn counts_from_reset(&self) -> bool {
        !self.counts_at_once && self.stop_strobe.is_none()
    }

    /// What a period and phase leave over of a limit of the flip-flops that catch the strobe, if it comes where `aim` says.
    pub fn strobe_slack(
        &self,
        requirement: &Requirement,
        period: Time,
        phase: Time,
        aim: Aim,
    ) -> Time {
        let (earlier, later) = self.strobe_offsets(phase);
        match requirement.kind {
            CheckKind::Setup => requirement.slack(period) - period * aim.edges + earlier,
            CheckKind::Hold => requirement.slack(period) + period * aim.edges - later,
            _ => requirement.slack(period),
        }
    }

    /// The strobe and the change of the shift register that is nearest to it; none where there is no shift register.
    pub(crate) fn strobe_race(&self, period: Time, phase: Time) -> Option<Race> {
        let changes = self.shift?;
        let (strobe, shift) = (self.strobe.1, changes.0);
        let hold = self.hit_hold() - (strobe - shift);
        let setup = self.hit_setup() - (changes.1 - self.strobe.0);
        let nearest = |strobe: Time| (strobe - shift).as_fs().div_euclid(period.as_fs());
        let Some(stop_strobe) = self.stop_strobe else {
            let shortest = self.clk_period().unwrap_or(period);
            let signals = (strobe, shift);
            let all = (self.strobe, shortest);
            let race = Race::strobe_at_shift(period, nearest(strobe), signals, (setup, hold), all);
            return Some(race);
        };
        let half = Time::from_fs(period.as_fs() / 2);
        let change = half + period * nearest(stop_strobe.1 + phase) + shift - phase;
        let what = Conflict::ShiftAtStrobe;
        let forbidden = (stop_strobe.0 - setup, stop_strobe.1 + hold);
        Some(Race::with_stop(what, change, forbidden, phase, period))
    }

    /// Falling CLK edges after CLK's fall nearest to STOP: until when they are sure not to count, and from when on they are
    /// sure to.
    fn first_in_doubt(&self, phase: Time) -> (Time, Time) {
        (
            self.release.0 - self.counter_clk.1 - self.removal + phase,
            self.release.1 - self.counter_clk.0 + self.recovery + phase,
        )
    }

    /// What is left over between the reset's release and the CLK edges before and after it, and what meets what if
    /// nothing is; none where the P-counter is not reset.
    pub(crate) fn first_count(&self, period: Time, phase: Time, aim: Aim) -> Option<(Time, Race)> {
        if !self.counts_from_reset() {
            return None;
        }
        let (ignored_until, counts_from) = self.first_in_doubt(phase);
        let (before, after) = (period * (aim.first - 1), period * aim.first);
        let recovery = after - counts_from;
        // CLK has no edge before number 0.
        let removal = (aim.first > 0).then(|| ignored_until - before);
        let slack = removal.map_or(recovery, |removal| removal.min(recovery));
        let edge = if slack == recovery { after } else { before };
        let to_counter_clk = self.counter_clk.1 - phase;
        let what = Conflict::ClkAtResetEnd;
        let forbidden = (ignored_until + to_counter_clk, counts_from + to_counter_clk);
        let race = Race::with_stop(what, edge + to_counter_clk, forbidden, phase, period);
        Some((slack, race))
    }

    /// What LOCAL_STOP leaves over that blocks COUNTER_CLK: it comes before a pulse begins, or so late in one that the rest is long
    /// enough. None where LOCAL_STOP does not block.
    pub(crate) fn block_slack(&self, period: Time) -> Option<Time> {
        let (block, to_counter_clk) = self.block?;
        let (first, last) = self.counter_clk;
        let pulses = (block.1 - first).as_fs().div_euclid(period.as_fs());
        let before = period * (pulses + 1) + first - block.1;
        // The first pulse is the one that made LOCAL_STOP.
        let rest = block.0 + to_counter_clk - period * pulses - last - self.counter_clk_high;
        Some(before.min(rest))
    }

    /// CLK periods next to `period` at which LOCAL_STOP cuts a pulse of COUNTER_CLK too short: from, until.
    pub(crate) fn cutting(&self, period: Time) -> Option<(Time, Time)> {
        let (block, to_counter_clk) = self.block?;
        let (first, last) = self.counter_clk;
        let pulses = (block.1 - first).as_fs().div_euclid(period.as_fs()).max(1);
        let rest = block.0 + to_counter_clk - last - self.counter_clk_high;
        let per_pulse = |time: Time| Time::from_fs(time.as_fs() / pulses);
        Some((per_pulse(rest), per_pulse(block.1 - first)))
    }

    /// What a period and phase leave over of the tightest limit, if the macropixel is to count as `aim` says.
    pub(crate) fn slack(&self, period: Time, phase: Time, aim: Aim) -> Time {
        let clk = self.clk.iter().map(|r| r.slack(period)).min();
        let strobe = self
            .hits
            .iter()
            .map(|r| self.strobe_slack(r, period, phase, aim))
            .min();
        let first = self.first_count(period, phase, aim).map(|(slack, _)| slack);
        let all = [clk, strobe, first, self.block_slack(period)]
            .into_iter()
            .flatten();
        all.min().unwrap_or(Time::MAX)
    }

    /// Whether a start value selects the CLK periods it selects at a slow clock, STOP `phase` after CLK's fall.
    pub fn works(&self, period: Time, phase: Time) -> bool {
        let (t, fs) = (period.as_fs(), Time::as_fs);
        // Falling edge k, at k T, counts if it comes after the release, and does not if before.
        let (ignored_until, counts_from) = self.first_in_doubt(phase);
        let first = (-(-fs(counts_from)).div_euclid(t)).max(0);
        let is_ambiguous = first > 0 && (first - 1) * t > fs(ignored_until);
        let (first, is_ambiguous) = if self.counts_at_once {
            (1, false)
        } else {
            (first, is_ambiguous)
        };
        // A slow clock counts from edge 1 on and strobes before the next rising edge.
        let edges = 1 - first;
        // The rising edge after the strobe; its forerunner is a period before.
        let next = t / 2 + edges * t;
        !is_ambiguous
            && edges >= 0
            && fs(self.hit_hold()) < next
            && fs(self.hit_setup()) <= t - next
            && self.clk_period().is_some_and(|shortest| shortest <= period)
    }
}

/// What the flip-flops of a macropixel ask that have clocks of their own.
#[derive(Debug, Clone)]
pub struct LocalClocks {
    /// The netlist that is analysed, which names the flip-flops.
    pub netlist: Netlist,
    /// Histogram counters, of the time between two rises of HIT: the laser cycle.
    pub counts: Vec<Requirement>,
    /// Toggle flip-flops, of the time between two pulses of one SPAD.
    pub toggles: Vec<Requirement>,
}

impl LocalClocks {
    /// Analyses macropixel (0, 0), limits kept.
    pub fn analyse(config: &SensorConfig, silicon: &Silicon) -> Self {
        let circuit = MacropixelCircuit::new(config, (0, 0));
        let (netlist, probes) = (&circuit.netlist, &circuit.probes);
        let timing = silicon.timing(netlist);
        let library = silicon.limits(Limits::Kept);
        let paths = circuit.paths(&timing);
        let toggles = probes.toggle_cells(netlist);
        let requirements = |clock: NetId, cuts: &[NetId]| {
            let corner = silicon.corner;
            let analysis = paths.analysis();
            let found = Requirements::new(netlist, analysis, clock, cuts, &library, corner);
            found.expect("every loop is cut").all().to_vec()
        };
        // A count's Q only tells whether the bin is full; what else one's own histogram does with it, nobody knows.
        let hits = probes.find(Probe::Hit).unwrap_or_default();
        let of_hits = hits.iter().zip(probes.bins());
        let of_hits = of_hits.filter(|_| config.histogram_block.is_none());
        let raw = probes.bus(Probe::SpadRaw).iter();
        LocalClocks {
            counts: of_hits
                .flat_map(|(&hit, count)| requirements(hit, count))
                .collect(),
            // The flip-flop behind a toggle has CLK for its clock. One behind a wire that SPADs share is none of a SPAD.
            toggles: raw
                .flat_map(|&raw| requirements(raw, hits))
                .filter(|r| toggles.contains(&r.cell))
                .collect(),
            netlist: circuit.netlist,
        }
    }

    /// What a dead time leaves over of a limit of a toggle flip-flop. Pulses last the dead time; how soon the next one
    /// follows is chance, and a limit on the time between them has none.
    pub fn toggle_slack(&self, requirement: &Requirement, dead_time: Time) -> Option<Time> {
        match requirement.kind {
            CheckKind::ClockHigh => Some(dead_time - requirement.need),
            CheckKind::ClockLow => None,
            _ => Some(requirement.slack(dead_time)),
        }
    }
}

fn worst(requirements: &[Requirement], kind: CheckKind) -> Time {
    let of_kind = requirements.iter().filter(|r| r.kind == kind);
    of_kind.map(|r| r.need).max().expect("a METDC has bins")
}

/// The data path of the requirement of one kind with the largest need.
pub(super) fn worst_path<'r>(
    behind: &Requirements<'_>,
    requirements: impl Iterator<Item = &'r Requirement>,
    kind: CheckKind,
) -> Option<Path> {
    let of_kind = requirements.filter(|r| r.kind == kind);
    Some(behind.paths(of_kind.max_by_key(|r| r.need)?)?.0)
}

/// Shortest period that keeps all of them; none if no period does.
pub fn longest<'r>(mut requirements: impl Iterator<Item = &'r Requirement>) -> Option<Time> {
    requirements.try_fold(Time::ZERO, |longest, r| Some(longest.max(r.period()?)))
}
