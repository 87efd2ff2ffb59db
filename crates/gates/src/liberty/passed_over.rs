//! Cells of a library that cannot stand for any kind of cell here, and why: latches, buses, three-state drivers, fillers and so on.
//!
//! They are no fault of the library. Whoever misses a cell finds it in [`Liberty::passed_over`](super::Liberty::passed_over), and a
//! library from which nothing can be made is refused with the commonest reasons.

use std::collections::BTreeSet;

use super::candidate::{Candidate, Role};
use super::error::{LibertyFault, PassedOver, PassedOverReason as Reason};
use super::flip_flop::{MAX_PINS, control_pin, shown_states};
use super::function::TruthTable;
use super::group::Group;
use super::kit::LibraryFile;
use crate::netlist::{CellKind, MAX_OUTPUTS};

impl PassedOver {
    /// A cell that is no candidate, or a gate that the library says not to use and that is not `wanted` by name.
    pub(super) fn from_group(
        file: &LibraryFile<'_, '_>,
        group: &Group<'_>,
        candidate: Option<&Candidate<'_, '_>>,
        wanted: &[(CellKind, String)],
    ) -> Option<Self> {
        let is_wanted = || wanted.iter().any(|(_, name)| name == group.name());
        match candidate {
            None => Some(Self::new(file, group, why(group))),
            Some(cell) if cell.dont_use && matches!(cell.role, Role::Gate(_)) && !is_wanted() => {
                Some(Self::new(file, group, Reason::DontUse))
            }
            Some(_) => None,
        }
    }

    /// A cell whose name another one in an earlier line of the file has.
    pub(super) fn duplicate(file: &LibraryFile<'_, '_>, group: &Group<'_>, line: usize) -> Self {
        Self::new(file, group, Reason::Duplicate { line })
    }

    pub(super) fn new(file: &LibraryFile<'_, '_>, group: &Group<'_>, why: Reason) -> Self {
        PassedOver {
            cell: group.name().to_owned(),
            file: file.name.to_owned(),
            line: group.line,
            is_flip_flop: group.of_kind("ff").next().is_some(),
            why,
        }
    }
}

/// What keeps a cell from being a candidate.
fn why(cell: &Group<'_>) -> Reason {
    let of_direction = |direction: &str| {
        let pins = cell.pins();
        let pins = pins.filter(|(_, pin)| pin.value("direction") == Some(direction));
        pins.map(|(name, _)| name).collect::<Vec<_>>()
    };
    let (inputs, outputs) = (of_direction("input"), of_direction("output"));
    why_unusable(cell)
        .or_else(|| outputs.is_empty().then_some(Reason::NoOutput))
        .or_else(|| match cell.of_kind("ff").next() {
            Some(ff) => why_no_flip_flop(cell, ff, &inputs, &outputs),
            None => why_no_gate(cell, &inputs, &outputs),
        })
        .unwrap_or(Reason::OtherKind)
}

/// What keeps a cell from being used, whatever its function.
fn why_unusable(cell: &Group<'_>) -> Option<Reason> {
    let kinds = [
        "latch",
        "statetable",
        "ff_bank",
        "latch_bank",
        "bus",
        "bundle",
    ];
    if let Some(group) = cell.groups.iter().find(|group| kinds.contains(&group.kind)) {
        let group = group.kind.to_owned();
        return Some(Reason::UnusableGroup { group });
    }
    if cell.of_kind("ff").count() > 1 {
        return Some(Reason::SeveralFlipFlops);
    }
    if cell.of_kind("pin").any(|pin| pin.arguments.is_empty()) {
        return Some(Reason::UnnamedPin);
    }
    let mut names = BTreeSet::new();
    cell.pins().find_map(|(name, pin)| {
        let pin_name = || name.to_owned();
        if !names.insert(name) {
            return Some(Reason::PinTwice { pin: pin_name() });
        }
        if pin.value("three_state").is_some() {
            return Some(Reason::ThreeState { pin: pin_name() });
        }
        match pin.value("direction") {
            Some("input" | "output") => None,
            Some(other) => Some(Reason::Direction {
                pin: pin_name(),
                direction: other.to_owned(),
            }),
            None => Some(Reason::NoDirection { pin: pin_name() }),
        }
    })
}

fn why_no_gate(cell: &Group<'_>, inputs: &[&str], outputs: &[&str]) -> Option<Reason> {
    let most = TruthTable::MOST;
    if outputs.len() > 1 {
        let outputs = outputs.len();
        return Some(Reason::SeveralOutputs { outputs });
    }
    if !(1..=most).contains(&inputs.len()) {
        let inputs = inputs.len();
        return Some(Reason::InputCount { inputs, most });
    }
    let (name, pin) = cell.pins().find(|(name, _)| *name == outputs[0])?;
    let output = name.to_owned();
    Some(match pin.value("function") {
        None => Reason::NoFunction { output },
        Some(text) => Reason::OtherFunction {
            output,
            function: text.to_owned(),
        },
    })
}

fn why_no_flip_flop(
    cell: &Group<'_>,
    ff: &Group<'_>,
    inputs: &[&str],
    outputs: &[&str],
) -> Option<Reason> {
    if outputs.len() > MAX_OUTPUTS || inputs.len() > MAX_PINS {
        let (inputs, outputs) = (inputs.len(), outputs.len());
        return Some(Reason::FlipFlopPins { inputs, outputs });
    }
    for attribute in ["clear", "preset", "clocked_on"] {
        match ff.value(attribute) {
            Some(text) if control_pin(text, inputs).is_none() => {
                let function = text.to_owned();
                return Some(Reason::ControlFunction {
                    attribute,
                    function,
                });
            }
            None if attribute == "clocked_on" => return Some(Reason::NoAttribute { attribute }),
            _ => {}
        }
    }
    let Some(next_state) = ff.value("next_state") else {
        let attribute = "next_state";
        return Some(Reason::NoAttribute { attribute });
    };
    if shown_states(cell, ff, outputs) == [None, None] {
        return Some(Reason::HiddenState);
    }
    let function = next_state.to_owned();
    Some(Reason::NextState { function })
}

/// Those of the `cells` that a fault may be about: the ones that its sentence names, or else flip-flops or gates.
pub(super) fn cells_behind(fault: &LibertyFault, cells: &[PassedOver]) -> Vec<PassedOver> {
    let sentence = fault.to_string();
    let words: Vec<&str> = sentence.split([' ', ',', ';', ':']).collect();
    let is_named = |cell: &&PassedOver| words.contains(&cell.cell.as_str());
    let named: Vec<PassedOver> = cells.iter().filter(is_named).cloned().collect();
    if !named.is_empty() {
        return named;
    }
    let misses_flip_flop =
        (CellKind::ALL.iter()).any(|kind| kind.is_flip_flop() && words.contains(&kind.name()));
    let alike = cells
        .iter()
        .filter(|cell| cell.is_flip_flop == misses_flip_flop);
    alike.cloned().collect()
}
