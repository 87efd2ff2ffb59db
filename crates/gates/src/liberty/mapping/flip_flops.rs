//! Which flip-flop of a library stands for one with reset (and set), and what is put around it.
//!
//! Candidates are ordered by these questions; the next one decides between equals:
//!
//! 1. With set: does the file say which of clear and preset wins?
//! 2. May the cell be used (`dont_use`)?
//! 3. Is it a plain flip-flop, without pins to be tied, as a scan chain's are?
//! 4. Which has the least area, its inverters counted?
//!
//! A flip-flop may stand for one of the inverse state, with clear and preset exchanged. Our reset wins over the set; so a cell whose
//! preset wins stands for the inverse state.

use super::super::candidate::{Candidate, FlipFlop, Role};
use super::super::complete::check_flip_flop;
use super::super::error::LibertyError;
use super::super::remark::LibraryRemark;
use super::family::drives;
use super::{Maker, Notes, Recipe, Source, Stage};
use crate::netlist::CellKind;

impl<'g, 't> Maker<'g, 't> {
    /// A flip-flop with reset (and set).
    pub(super) fn flip_flop(&self, kind: CellKind, notes: &mut Notes) -> Option<Recipe> {
        let inverter = self.inverter(Source::Input(0))?;
        let with_set = kind == CellKind::Dffsr;
        let wanted = self.wanted.iter().find(|(k, _)| *k == kind);
        let is_wanted = |c: &Candidate<'_, '_>| wanted.is_none_or(|(_, name)| name == c.name());
        let both = |c: &'g Candidate<'g, 't>| match &c.role {
            Role::FlipFlop(roles) if with_set => {
                let roles = roles.with_outputs_that_agree();
                match roles.preset_wins() {
                    Some(true) => vec![(c, roles.mirrored())],
                    _ => vec![(c, roles)],
                }
            }
            Role::FlipFlop(roles) => vec![(c, *roles), (c, roles.mirrored())],
            Role::Gate(_) => Vec::new(),
        };
        let cells = self
            .candidates
            .iter()
            .filter(|c| is_wanted(c))
            .flat_map(both);
        let fitting = cells
            .filter(|(_, roles)| roles.clear.is_some() && (roles.preset.is_some() || !with_set));
        let mut ranked: Vec<_> = fitting
            .map(|(cell, roles)| {
                let inverters = inverters(&roles, with_set) as f64;
                let area = cell.area + inverters * inverter.drives[0].area;
                let is_open = with_set && roles.preset_wins().is_none();
                ((is_open, cell.dont_use, roles.tied != 0), area, cell, roles)
            })
            .collect();
        ranked.sort_by(|(a, a_area, x, _), (b, b_area, y, _)| {
            let by_area = a.cmp(b).then(a_area.total_cmp(b_area));
            by_area.then_with(|| x.name().cmp(y.name()))
        });
        let complete = |cell: &Candidate<'_, '_>, roles: &FlipFlop| {
            let model = self.model(cell)?;
            if let Err(fault) = check_flip_flop(&model, roles, with_set) {
                self.pass_over(cell, LibertyError::new(cell.group.line, fault));
                return None;
            }
            Some(model)
        };
        let (_, _, chosen, roles) = ranked
            .into_iter()
            .find(|(_, _, cell, roles)| complete(cell, roles).is_some())?;
        self.note_choice(kind, chosen, &roles, notes);
        let mut stages = Vec::new();
        let inputs = 0..chosen.inputs.len();
        let mut sources: Vec<Source> = inputs
            .map(|pin| Source::Constant(roles.tied_levels >> pin & 1 == 1))
            .collect();
        // Pins of the kind: D, CK, R, S.
        let given = [
            Some(roles.data),
            Some(roles.clock),
            roles.clear,
            roles.preset,
        ];
        for (pin, role) in given.into_iter().enumerate() {
            let Some((at, inverted)) = role else { continue };
            sources[at] = match (pin < kind.inputs().len(), inverted) {
                (false, active_low) => Source::Constant(active_low),
                (true, false) => Source::Input(pin),
                (true, true) => {
                    stages.push(self.inverter(Source::Input(pin))?);
                    Source::Stage(stages.len() - 1, 0)
                }
            };
        }
        let alike = self.candidates.iter().filter(|c| {
            is_wanted(c)
                && c.pins() == chosen.pins()
                && (c.dont_use, &c.role) == (chosen.dont_use, &chosen.role)
        });
        let models = alike.filter_map(|c| complete(c, &roles)).collect();
        let flip_flop = stages.len();
        stages.push(Stage {
            drives: drives(models, self.slowest_slew_fs),
            sources,
        });
        let mut show = |own: Option<usize>, other: Option<usize>| match (own, other) {
            (Some(output), _) => Some(Source::Stage(flip_flop, output)),
            (None, other) => {
                let shown = Source::Stage(flip_flop, other.expect("a flip-flop shows its state"));
                stages.push(self.inverter(shown)?);
                Some(Source::Stage(stages.len() - 1, 0))
            }
        };
        let outputs = vec![show(roles.q, roles.qn)?, show(roles.qn, roles.q)?];
        Some(Recipe {
            stages,
            outputs,
            flip_flop: Some((flip_flop, roles)),
        })
    }

    /// Says what is odd about the choice.
    fn note_choice(
        &self,
        kind: CellKind,
        chosen: &Candidate<'_, '_>,
        roles: &FlipFlop,
        notes: &mut Notes,
    ) {
        let cell = || chosen.name().to_owned();
        if kind == CellKind::Dffsr && roles.preset_wins().is_none() {
            notes
                .remarks
                .push(LibraryRemark::OpenState { cell: cell() });
        }
        let tied = chosen.inputs.iter().enumerate();
        let tied = tied.filter(|(pin, _)| roles.tied >> pin & 1 == 1);
        let level = |pin: usize| roles.tied_levels >> pin & 1 == 1;
        let pins: Vec<_> = tied
            .map(|(pin, &input)| (input.to_owned(), level(pin)))
            .collect();
        if !pins.is_empty() {
            let cell = cell();
            notes
                .remarks
                .push(LibraryRemark::TiedPins { kind, cell, pins });
        }
        if chosen.dont_use {
            let cell = cell();
            notes.remarks.push(LibraryRemark::DontUse { kind, cell });
        }
    }
}

/// How many inverters a flip-flop wants around it.
fn inverters(roles: &FlipFlop, with_set: bool) -> usize {
    let pins = [
        Some(roles.data),
        Some(roles.clock),
        roles.clear,
        roles.preset.filter(|_| with_set),
    ];
    let inverted = pins.into_iter().flatten().filter(|pin| pin.1).count();
    inverted + usize::from(roles.q.is_none()) + usize::from(roles.qn.is_none())
}
