//! Timing checks of a file put into a design, and those of a design as entries of a file.
//!
//! | SDF | check of the kernel |
//! |---|---|
//! | SETUP, HOLD, SETUPHOLD of D against CK | setup, hold; `posedge` or `negedge` D means that direction alone |
//! | RECOVERY, REMOVAL, RECREM of R or S against CK | recovery, removal |
//! | WIDTH of CK, R, S | clock high (`posedge`), clock low (`negedge`), control high |
//!
//! The clock's edge that counts rises, and controls are active high: checks of other edges and pins concern nothing
//! that a flip-flop of the library does. They are left out and counted. Negative limits become 0, as IEEE 1364
//! (15.8) has it for simulators without delayed copies of the pins.

use super::annotate::Annotator;
use super::error::{SdfError, SdfFault};
use super::skipped::SkippedKind;
use super::{CheckKeyword as Entry, PinEdge, SdfCell, SdfCheck, Triple};
use crate::netlist::{CellId, CellKind, CheckKind, Control, Edge, InstanceLimits, Timing};
use crate::units::Time;

/// A pin of a flip-flop.
#[derive(Clone, Copy, PartialEq, Eq)]
enum Role {
    Data,
    Clock,
    Control(Control),
}

impl Role {
    fn from_pin(pin: &str) -> Self {
        match pin {
            "D" => Role::Data,
            "CK" => Role::Clock,
            "S" => Role::Control(Control::Set),
            _ => Role::Control(Control::Reset),
        }
    }
}

/// A limit in the kernel's terms: check, control, and direction of D where only one is meant.
type Slot = (CheckKind, Control, Option<Edge>);

impl Annotator<'_, '_, '_> {
    /// Gives `cell` the limits of an entry.
    pub(super) fn limits(
        &mut self,
        timing: &mut Timing,
        entry: &SdfCell<'_>,
        cell: CellId,
    ) -> Result<(), SdfError> {
        let kind = self.netlist.cells()[cell.index()].kind;
        let before = *timing.limits(cell, kind);
        let mut limits = before;
        for check in &entry.checks {
            if !kind.is_flip_flop() {
                return self.error(check.line, SdfFault::CheckOfGate { kind });
            }
            for pin in std::iter::once(&check.pin).chain(&check.reference) {
                self.input(kind, &pin.pin, check.line)?;
            }
            let slots = slots(check);
            if slots.iter().all(Option::is_none) {
                self.note(SkippedKind::NoSuchCheck, check.line);
                continue;
            }
            self.result.checks += usize::from(check.has_value(self.corner));
            // Two limits are one for each of two slots; one limit may be for both.
            let of_slot = [0, check.kind.limits() - 1].map(|limit| check.limits[limit]);
            for (slot, limit) in slots.into_iter().zip(of_slot) {
                let (Some(slot), Some(limit)) = (slot, limit.in_corner(self.corner)) else {
                    continue;
                };
                if limit < Time::ZERO {
                    self.note(SkippedKind::NegativeLimit, check.line);
                }
                // The parser lets nothing beyond 32 bits through.
                enter(&mut limits, slot, u32::try_from(limit.as_fs()).unwrap_or(0));
            }
        }
        if limits != before {
            timing.set_limits(cell, limits);
        }
        Ok(())
    }
}

/// What an entry's limits stand for; nothing where a flip-flop does not act on such pins or edges.
fn slots(check: &SdfCheck<'_>) -> [Option<Slot>; 2] {
    let pin = Role::from_pin(&check.pin.pin);
    let edge = check.pin.edge;
    if check.kind == Entry::Width {
        let high = edge != Some(Edge::Fall);
        let low = edge != Some(Edge::Rise);
        let slot = |is: bool, check, control| is.then_some((check, control, None));
        return match pin {
            Role::Clock => [
                slot(high, CheckKind::ClockHigh, Control::Reset),
                slot(low, CheckKind::ClockLow, Control::Reset),
            ],
            Role::Control(control) => [slot(high, CheckKind::ControlHigh, control), None],
            Role::Data => [None; 2],
        };
    }
    let clocked = check.reference.as_ref().is_some_and(|reference| {
        Role::from_pin(&reference.pin) == Role::Clock && reference.edge != Some(Edge::Fall)
    });
    let data = |check| (pin == Role::Data && clocked).then_some((check, Control::Reset, edge));
    let released = clocked && edge != Some(Edge::Rise);
    let control = |check| match pin {
        Role::Control(control) if released => Some((check, control, None)),
        _ => None,
    };
    match check.kind {
        Entry::Setup => [data(CheckKind::Setup), None],
        Entry::Hold => [data(CheckKind::Hold), None],
        Entry::SetupHold => [data(CheckKind::Setup), data(CheckKind::Hold)],
        Entry::Recovery => [control(CheckKind::Recovery), None],
        Entry::Removal => [control(CheckKind::Removal), None],
        Entry::RecRem => [control(CheckKind::Recovery), control(CheckKind::Removal)],
        Entry::Width => [None; 2],
    }
}

fn enter(limits: &mut InstanceLimits, (check, control, edge): Slot, fs: u32) {
    for direction in Edge::BOTH {
        if edge.is_none_or(|edge| edge == direction) {
            limits.set(control, check, direction, fs);
        }
    }
}

/// The checks of a flip-flop with these limits in the three corners.
pub(crate) fn checks_of(kind: CellKind, corners: [&InstanceLimits; 3]) -> Vec<SdfCheck<'static>> {
    let limit = |control, check, edge| {
        Triple(corners.map(|limits| {
            let fs = limits.limit_fs(control, check, edge);
            Some(Time::from_fs(fs.into()))
        }))
    };
    let pin = |edge, pin: &'static str| PinEdge {
        edge: Some(edge),
        pin: pin.into(),
    };
    let entry = |kind, checked, limits| SdfCheck {
        line: 0,
        kind,
        pin: checked,
        reference: (kind != Entry::Width).then(|| pin(Edge::Rise, "CK")),
        limits,
    };
    let mut checks = Vec::new();
    for edge in Edge::BOTH {
        let limits = [CheckKind::Setup, CheckKind::Hold];
        let limits = limits.map(|check| limit(Control::Reset, check, edge));
        checks.push(entry(Entry::SetupHold, pin(edge, "D"), limits));
    }
    let width = |check, control| [limit(control, check, Edge::Rise), Triple::default()];
    for (edge, check) in [
        (Edge::Rise, CheckKind::ClockHigh),
        (Edge::Fall, CheckKind::ClockLow),
    ] {
        let limits = width(check, Control::Reset);
        checks.push(entry(Entry::Width, pin(edge, "CK"), limits));
    }
    for (name, control) in [("R", Control::Reset), ("S", Control::Set)] {
        if !kind.inputs().contains(&name) {
            continue;
        }
        let limits = [CheckKind::Recovery, CheckKind::Removal];
        let limits = limits.map(|check| limit(control, check, Edge::Fall));
        checks.push(entry(Entry::RecRem, pin(Edge::Fall, name), limits));
        let limits = width(CheckKind::ControlHigh, control);
        checks.push(entry(Entry::Width, pin(Edge::Rise, name), limits));
    }
    checks
}

#[cfg(test)]
mod tests {
    use super::super::tests::{annotated, design, export, nominal};
    use super::super::{Annotation, Sdf, SdfOptions, annotate};
    use super::*;
    use crate::netlist::{Corner, ScopeId};

    fn limits_of(body: &str, path: &str) -> (InstanceLimits, Annotation) {
        let (netlist, timing, result) = annotated(body).unwrap();
        let cell = netlist.cell(path).unwrap();
        let kind = netlist.cells()[cell.index()].kind;
        (*timing.limits(cell, kind), result)
    }

    #[test]
    fn limits_reach_the_instance_the_check_and_the_edge_they_are_for() {
        use crate::netlist::CheckKind as Check;
        let nominal = *nominal(&design(), Corner::Typ).limits(CellId::new(0), CellKind::Dffsr);
        let body = |checks: &str| {
            format!("(CELL (CELLTYPE \"DFFSR\") (INSTANCE u1/dffsr) (TIMINGCHECK {checks}))")
        };
        let given = [
            (
                "(SETUP D (posedge CK) (1:2:3))",
                Check::Setup,
                Control::Reset,
                [2_000; 2],
            ),
            (
                "(SETUP (negedge D) CK (7))",
                Check::Setup,
                Control::Reset,
                [39_023, 7_000],
            ),
            (
                "(HOLD (posedge D) (posedge CK) (7))",
                Check::Hold,
                Control::Reset,
                [7_000, 12_511],
            ),
            (
                "(SETUPHOLD D (posedge CK) () (4))",
                Check::Hold,
                Control::Reset,
                [4_000; 2],
            ),
            (
                "(SETUPHOLD D (posedge CK) (4) (-4))",
                Check::Hold,
                Control::Reset,
                [0; 2],
            ),
            (
                "(RECOVERY (negedge S) (posedge CK) (5))",
                Check::Recovery,
                Control::Set,
                [5_000; 2],
            ),
            (
                "(REMOVAL R (posedge CK) (6))",
                Check::Removal,
                Control::Reset,
                [6_000; 2],
            ),
            (
                "(RECREM S CK (6) (9))",
                Check::Removal,
                Control::Set,
                [9_000; 2],
            ),
            (
                "(WIDTH (posedge CK) (8))",
                Check::ClockHigh,
                Control::Reset,
                [8_000; 2],
            ),
            (
                "(WIDTH (negedge CK) (8))",
                Check::ClockLow,
                Control::Reset,
                [8_000; 2],
            ),
            (
                "(WIDTH S (8))",
                Check::ControlHigh,
                Control::Set,
                [8_000; 2],
            ),
        ];
        for (text, check, control, wanted) in given {
            let (limits, result) = limits_of(&body(text), "u1.dffsr");
            let found = Edge::BOTH.map(|edge| limits.limit_fs(control, check, edge));
            assert_eq!((found, result.checks), (wanted, 1), "{text}");
            assert_eq!(limits_of(&body(text), "u2.dffsr").0, nominal, "{text}");
            let differing = [Control::Reset, Control::Set].iter().flat_map(|&control| {
                let all = Check::ALL.iter().map(move |&check| (control, check));
                all.filter(|&(control, check)| {
                    let both_edges = |limits: &InstanceLimits| {
                        limits.limit_fs(control, check, Edge::Rise)
                            ^ limits.limit_fs(control, check, Edge::Fall) << 16
                    };
                    both_edges(&limits) != both_edges(&nominal)
                })
            });
            let alone = !text.contains("RECREM") && !text.contains("SETUPHOLD");
            assert!(
                !alone || differing.count() == 1,
                "{text} changed other checks"
            );
        }
        for text in [
            "(SETUP D (negedge CK) (1))",
            "(SETUP R (posedge CK) (1))",
            "(RECOVERY (posedge R) (posedge CK) (1))",
            "(WIDTH (negedge R) (1))",
            "(WIDTH D (1))",
        ] {
            let (limits, result) = limits_of(&body(text), "u1.dffsr");
            assert_eq!(
                (limits, result.checks, result.notes.len()),
                (nominal, 0, 1),
                "{text}"
            );
        }
    }

    #[test]
    fn limits_written_are_read_back() {
        let netlist = design();
        let corners = Corner::ALL.map(|corner| {
            let mut timing = nominal(&netlist, corner);
            let cell = netlist.cell("u2.dffr").unwrap();
            let mut limits = *timing.limits(cell, CellKind::Dffr);
            for (i, check) in CheckKind::ALL.into_iter().enumerate() {
                for edge in Edge::BOTH {
                    // Only D's limits tell directions apart.
                    let edge_fs = edge as u32 * u32::from(check.concerns_data());
                    let fs = 1_000 * (i as u32 + 1) + 10 * corner as u32 + edge_fs;
                    for control in [Control::Reset, Control::Set] {
                        limits.set(control, check, edge, fs);
                    }
                }
            }
            timing.set_limits(cell, limits);
            timing
        });
        let text = export(&netlist, corners.each_ref(), SdfOptions::default());
        let sdf = Sdf::parse("a.sdf", &text).unwrap();
        for (corner, wanted) in Corner::ALL.into_iter().zip(&corners) {
            let mut timing = nominal(&netlist, Corner::Typ);
            annotate(&mut timing, &netlist, &sdf, corner).unwrap();
            for (cell, flat) in netlist.cells_below(ScopeId::TOP).zip(netlist.cells()) {
                if flat.kind.is_flip_flop() {
                    let [found, wanted] = [&timing, wanted].map(|t| exported(t, cell, flat.kind));
                    assert_eq!(found, wanted, "{}", netlist.cell_path(cell));
                }
            }
        }
    }

    /// What a file says of a flip-flop: nothing of S where it has none.
    fn exported(timing: &Timing, cell: CellId, kind: CellKind) -> Vec<SdfCheck<'static>> {
        checks_of(kind, [timing.limits(cell, kind); 3])
    }
}
