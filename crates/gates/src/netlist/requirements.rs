//! What every flip-flop asks of a clock's period: setup, hold and pulse widths, by static timing.
//!
//! ```text
//!            launch ─► D arrives        capture ─► CK arrives          asked of the period T (50 % duty)
//!   clock    ╱▔▔▔▔▔▔▔╲▁▁▁▁▁▁▁╱▔▔▔▔▔▔▔╲▁▁▁▁▁▁▁
//!   setup    │◄─── T or T/2 ──►│              share·T ≥ latest D + setup − earliest CK      share 1 or ½
//!   hold     │  next launch ──►│              share·T ≥ latest CK + hold − earliest D       share 0 or ½
//!   width    rise ◄── T or T/2 ──► fall       share·T ≥ latest begin + limit − earliest end
//! ```
//!
//! Launch and capture are edges of the same clock net. Between equal edges lies a whole period, between opposite
//! ones half a period: data launched by one edge is captured by the next edge of the capturing kind, and must hold
//! until that edge is past. What a flip-flop changes at its own D is told from the edge that clocked it. Flip-flops whose clock or data the clock does not reach ask nothing.
//!
//! As [`StaticTiming`] does, this knows of no values: a flip-flop is asked for what no stimulus may ever do.

use super::cell::CellKind;
use super::check_limits::CheckKind;
use super::corner::Corner;
use super::corner::Edge;
use super::flat::Netlist;
use super::id::{CellId, NetId};
use super::library::Library;
use super::static_timing::{Arrivals, Bound, Path, StaticTiming, TimingLoop};
use crate::units::Time;

/// One limit of one flip-flop, as a condition on the clock's period.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Requirement {
    /// Setup, hold, clock high or clock low.
    pub kind: CheckKind,
    /// The flip-flop.
    pub cell: CellId,
    /// Edge of the clock that launches the data, or begins the pulse.
    pub launch: Edge,
    /// Edge of the clock that captures them, or ends the pulse.
    pub capture: Edge,
    /// Direction of D's change; of the pulse's end.
    pub edge: Edge,
    /// How many half periods there are for it: 0, 1 or 2.
    pub halves: i64,
    /// What they must reach.
    pub need: Time,
}

impl Requirement {
    /// What a period leaves over, negative where the limit is broken.
    pub fn slack(&self, period: Time) -> Time {
        Time::from_fs(period.as_fs() * self.halves / 2) - self.need
    }

    /// The ends of its path in words: the clock's edge that launches, the flip-flop, the edge that captures.
    pub fn ends(&self, netlist: &Netlist, clock: &str) -> String {
        let name = |edge| match edge {
            Edge::Rise => "rise",
            Edge::Fall => "fall",
        };
        let (from, cell, to) = (
            name(self.launch),
            netlist.cell_path(self.cell),
            name(self.capture),
        );
        if self.kind.concerns_data() {
            format!(
                "{clock} {from} to {cell} D {}, against {clock} {to}",
                name(self.edge)
            )
        } else {
            format!("{clock} {from} to {to} at {cell}")
        }
    }

    /// The shortest period that keeps the limit; none if no period does.
    pub fn period(&self) -> Option<Time> {
        match self.halves {
            0 => (self.need <= Time::ZERO).then_some(Time::ZERO),
            halves => {
                let fs = 2 * self.need.as_fs();
                let whole = fs.div_euclid(halves) + (fs.rem_euclid(halves) > 0) as i64;
                Some(Time::from_fs(whole.max(0)))
            }
        }
    }
}

/// Everything that the flip-flops behind one clock ask of it.
pub struct Requirements<'n> {
    netlist: &'n Netlist,
    /// After the clock's rise and after its fall.
    arrivals: [Arrivals<'n>; 2],
    all: Vec<Requirement>,
}

impl<'n> Requirements<'n> {
    /// Follows both edges of `clock` up to `barriers`; the limits are those of `library` in `corner`.
    ///
    /// # Errors
    /// When edges come back to where they were without meeting a barrier.
    pub fn new(
        netlist: &'n Netlist,
        analysis: &StaticTiming<'n>,
        clock: NetId,
        barriers: &[NetId],
        library: &Library,
        corner: Corner,
    ) -> Result<Self, TimingLoop> {
        let after = |edge| analysis.arrivals(&[(clock, edge)], barriers);
        let arrivals = [after(Edge::Rise)?, after(Edge::Fall)?];
        Ok(Self::behind(netlist, arrivals, library, corner))
    }

    /// The same for known `arrivals` after the clock's rise and after its fall.
    pub fn behind(
        netlist: &'n Netlist,
        arrivals: [Arrivals<'n>; 2],
        library: &Library,
        corner: Corner,
    ) -> Self {
        let mut found = Requirements {
            netlist,
            arrivals,
            all: Vec::new(),
        };
        for (cell, leaf) in netlist.cells().iter().enumerate() {
            if leaf.kind.is_flip_flop() {
                found.add(CellId::new(cell), leaf.kind, library, corner);
            }
        }
        found
    }

    fn add(&mut self, cell: CellId, kind: CellKind, library: &Library, corner: Corner) {
        let limits = library.checks(kind);
        let limit = |check, edge| limits.edge_limit(check, edge, corner);
        let leaf = &self.netlist.cells()[cell.index()];
        let (data, clock) = (leaf.input(0), leaf.input(1));
        for launch in Edge::BOTH {
            for capture in Edge::BOTH {
                let same = launch == capture;
                let window =
                    |after: Edge, net, edge| self.arrivals[after as usize].edge_window(net, edge);
                let mut all = Vec::new();
                let mut push = |kind, edge, halves, need| {
                    all.push(Requirement {
                        kind,
                        cell,
                        launch,
                        capture,
                        edge,
                        halves,
                        need,
                    });
                };
                if let Some((early, late)) = window(capture, clock, Edge::Rise) {
                    for edge in Edge::BOTH {
                        if let Some((first, last)) = window(launch, data, edge) {
                            let need = last + limit(CheckKind::Setup, edge) - early;
                            push(CheckKind::Setup, edge, 1 + same as i64, need);
                            // D of a toggle flip-flop follows the very edge that clocked it, early or late.
                            let own = self.arrivals[launch as usize].own_data(cell, edge);
                            let apart = match own.filter(|_| same) {
                                Some(own) => -own,
                                None => late - first,
                            };
                            let need = apart + limit(CheckKind::Hold, edge);
                            push(CheckKind::Hold, edge, 1 - same as i64, need);
                        }
                    }
                }
                let pulses = [
                    (CheckKind::ClockHigh, Edge::Rise, Edge::Fall),
                    (CheckKind::ClockLow, Edge::Fall, Edge::Rise),
                ];
                for (kind, begin, end) in pulses {
                    let begins = window(launch, clock, begin);
                    if let (Some((_, last)), Some((first, _))) =
                        (begins, window(capture, clock, end))
                    {
                        push(kind, end, 1 + same as i64, last + limit(kind, end) - first);
                    }
                }
                self.all.extend(all);
            }
        }
    }

    /// Every requirement, by flip-flop.
    pub fn all(&self) -> &[Requirement] {
        &self.all
    }

    /// After the clock's rise or fall.
    pub fn arrivals(&self, edge: Edge) -> &Arrivals<'n> {
        &self.arrivals[edge as usize]
    }

    /// The paths that a requirement is about: of the data (or the pulse's begin), and of the clock (or its end).
    pub fn paths(&self, requirement: &Requirement) -> Option<(Path, Path)> {
        let leaf = &self.netlist.cells()[requirement.cell.index()];
        let (data, clock) = (leaf.input(0), leaf.input(1));
        let path =
            |after: Edge, net, edge, bound| self.arrivals[after as usize].path(net, edge, bound);
        let (launch, capture) = (requirement.launch, requirement.capture);
        let (begin, end) = match requirement.kind {
            CheckKind::Setup => (
                path(launch, data, requirement.edge, Bound::Longest),
                path(capture, clock, Edge::Rise, Bound::Shortest),
            ),
            CheckKind::Hold => (
                path(launch, data, requirement.edge, Bound::Shortest),
                path(capture, clock, Edge::Rise, Bound::Longest),
            ),
            _ => (
                path(launch, clock, requirement.edge.opposite(), Bound::Longest),
                path(capture, clock, requirement.edge, Bound::Shortest),
            ),
        };
        Some((begin?, end?))
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::logic::Logic;
    use crate::netlist::{ModuleBuilder, Timing};

    /// A flip-flop behind an inverter, captured by the same clock or by its inverse.
    fn pair(inverted: bool) -> Netlist {
        let mut m = ModuleBuilder::new("pair");
        let (d, ck, r) = (m.input("D"), m.input("CK"), m.input("R"));
        let (q, z) = (m.wire("Q"), m.output("Z"));
        m.cell("first", CellKind::Dffr, &[d, ck, r], &[Some(q), None]);
        let data = m.gate(CellKind::Inv, &[q]);
        let clock = if inverted {
            m.gate(CellKind::Inv, &[ck])
        } else {
            ck
        };
        m.cell(
            "second",
            CellKind::Dffr,
            &[data, clock, r],
            &[Some(z), None],
        );
        Netlist::elaborate(&m.finish().unwrap())
    }

    /// Longest need of one check of the second flip-flop, with its half periods.
    fn need(inverted: bool, kind: CheckKind) -> (i64, Time) {
        let (netlist, library) = (pair(inverted), Library::generic_40nm());
        let timing = Timing::nominal(&netlist, &library, Corner::Typ);
        let analysis = StaticTiming::new(&netlist, &timing);
        let clock = netlist.net("CK").unwrap();
        let found =
            Requirements::new(&netlist, &analysis, clock, &[], &library, Corner::Typ).unwrap();
        let second =
            |r: &&Requirement| netlist.cell_path(r.cell) == "pair.second" && r.kind == kind;
        let worst = found.all().iter().filter(second).max_by_key(|r| r.need);
        let worst = worst.unwrap();
        (worst.halves, worst.need)
    }

    #[test]
    fn data_have_a_period_to_the_same_edge_and_half_of_one_to_the_opposite() {
        let library = Library::generic_40nm();
        let delay = |kind, pin, to| library.delay(kind, pin, to, Corner::Typ);
        let clock_to_q = delay(CellKind::Dffr, 1, Logic::One);
        let (rise, fall) = (
            delay(CellKind::Inv, 0, Logic::One),
            delay(CellKind::Inv, 0, Logic::Zero),
        );
        let limits = library.checks(CellKind::Dffr);
        let limit = |kind, edge| limits.edge_limit(kind, edge, Corner::Typ);
        let setup = (rise + limit(CheckKind::Setup, Edge::Rise))
            .max(fall + limit(CheckKind::Setup, Edge::Fall));
        assert_eq!(need(false, CheckKind::Setup), (2, clock_to_q + setup));
        // The inverted clock rises an inverter's delay after the clock's fall.
        assert_eq!(need(true, CheckKind::Setup), (1, clock_to_q + setup - rise));
        let hold = (limit(CheckKind::Hold, Edge::Rise) - rise)
            .max(limit(CheckKind::Hold, Edge::Fall) - fall);
        assert_eq!(need(false, CheckKind::Hold), (0, hold - clock_to_q));
        assert_eq!(need(true, CheckKind::Hold), (1, hold + rise - clock_to_q));
    }

    /// D follows the edge that clocks it, so hold has all of that delay.
    #[test]
    fn a_toggle_flip_flop_holds_its_own_data() {
        let mut m = ModuleBuilder::new("toggle");
        let (ck, r, q) = (m.input("CK"), m.input("R"), m.output("Q"));
        let qn = m.wire("QN");
        m.cell("bit", CellKind::Dffr, &[qn, ck, r], &[q, qn]);
        let (netlist, library) = (
            Netlist::elaborate(&m.finish().unwrap()),
            Library::generic_40nm(),
        );
        let timing = Timing::nominal(&netlist, &library, Corner::Typ);
        let analysis = StaticTiming::new(&netlist, &timing);
        let clock = netlist.net("CK").unwrap();
        let found =
            Requirements::new(&netlist, &analysis, clock, &[], &library, Corner::Typ).unwrap();
        for edge in Edge::BOTH {
            let is_its = |r: &&Requirement| r.kind == CheckKind::Hold && r.edge == edge;
            let need = found.all().iter().find(is_its).unwrap().need;
            let limit =
                library
                    .checks(CellKind::Dffr)
                    .edge_limit(CheckKind::Hold, edge, Corner::Typ);
            let arc = library.arcs(CellKind::Dffr)[1][1];
            let to_qn = arc.delay(Corner::Typ, edge.level());
            assert_eq!(need, limit - to_qn, "{edge:?}");
        }
    }

    #[test]
    fn a_period_is_rounded_up_and_a_broken_hold_has_none() {
        let requirement = |halves, fs| Requirement {
            kind: CheckKind::Hold,
            cell: CellId::new(0),
            launch: Edge::Rise,
            capture: Edge::Rise,
            edge: Edge::Rise,
            halves,
            need: Time::from_fs(fs),
        };
        assert_eq!(requirement(1, 7).period(), Some(Time::from_fs(14)));
        assert_eq!(requirement(2, 7).period(), Some(Time::from_fs(7)));
        assert_eq!(requirement(0, 7).period(), None);
        assert_eq!(requirement(0, -7).period(), Some(Time::ZERO));
        assert_eq!(
            requirement(1, 7).slack(Time::from_fs(13)),
            Time::from_fs(-1)
        );
    }
}
