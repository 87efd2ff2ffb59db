//! Cells of a library that cannot stand for any kind of cell here, and why: latches, buses, three-state drivers, fillers and so on.
//!
//! They are no fault of the library. Whoever misses a cell finds it in [`Liberty::passed_over`](super::Liberty::passed_over), and a
//! library from which nothing can be made is refused with the commonest reasons.

use std::collections::BTreeSet;

use super::cell::{Candidate, Role};
use super::error::LibertyError;
use super::flip_flop::{MAX_PINS, control_pin, shown_states};
use super::function::TruthTable;
use super::group::Group;
use super::kit::LibraryFile;
use crate::netlist::{CellKind, MAX_OUTPUTS};

/// A cell that is not used.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct PassedOver {
    /// Its name.
    pub cell: String,
    /// Name of the file that it is in; empty where there is only text.
    pub file: String,
    /// Line it begins in, from 1.
    pub line: usize,
    /// What keeps it from being used.
    pub why: String,
    /// File and line as messages have them.
    place: String,
    is_flip_flop: bool,
}

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
                Some(Self::new(file, group, "it is marked dont_use".to_owned()))
            }
            Some(_) => None,
        }
    }

    /// A cell whose name another one in an earlier line of the file has.
    pub(super) fn duplicate(file: &LibraryFile<'_, '_>, group: &Group<'_>, line: usize) -> Self {
        let why = format!("line {line} has a cell of this name, which counts");
        Self::new(file, group, why)
    }

    fn new(file: &LibraryFile<'_, '_>, group: &Group<'_>, why: String) -> Self {
        PassedOver {
            cell: group.name().to_owned(),
            file: file.name.to_owned(),
            line: group.line,
            place: file.place(group.line),
            is_flip_flop: group.of_kind("ff").next().is_some(),
            why,
        }
    }
}

/// What keeps a cell from being a candidate.
fn why(cell: &Group<'_>) -> String {
    let of_direction = |direction: &str| {
        let pins = cell.pins();
        let pins = pins.filter(|(_, pin)| pin.value("direction") == Some(direction));
        pins.map(|(name, _)| name).collect::<Vec<_>>()
    };
    let (inputs, outputs) = (of_direction("input"), of_direction("output"));
    why_unusable(cell)
        .or_else(|| outputs.is_empty().then(|| "it has no output".to_owned()))
        .or_else(|| match cell.of_kind("ff").next() {
            Some(ff) => why_no_flip_flop(cell, ff, &inputs, &outputs),
            None => why_no_gate(cell, &inputs, &outputs),
        })
        .unwrap_or_else(|| "it is none of the gates and flip-flops that are used".to_owned())
}

/// What keeps a cell from being used, whatever its function.
fn why_unusable(cell: &Group<'_>) -> Option<String> {
    let kinds = [
        "latch",
        "statetable",
        "ff_bank",
        "latch_bank",
        "bus",
        "bundle",
    ];
    if let Some(group) = cell.groups.iter().find(|group| kinds.contains(&group.kind)) {
        return Some(format!("it has a {}", group.kind));
    }
    if cell.of_kind("ff").count() > 1 {
        return Some("it has several flip-flops".to_owned());
    }
    if cell.of_kind("pin").any(|pin| pin.arguments.is_empty()) {
        return Some("a pin has no name".to_owned());
    }
    let mut names = BTreeSet::new();
    cell.pins().find_map(|(name, pin)| {
        if !names.insert(name) {
            return Some(format!("pin {name} is given twice"));
        }
        if pin.value("three_state").is_some() {
            return Some(format!("pin {name} is a three-state output"));
        }
        match pin.value("direction") {
            Some("input" | "output") => None,
            Some(other) => Some(format!("pin {name} has the direction {other}")),
            None => Some(format!("pin {name} has no direction")),
        }
    })
}

fn why_no_gate(cell: &Group<'_>, inputs: &[&str], outputs: &[&str]) -> Option<String> {
    let most = TruthTable::MOST;
    if outputs.len() > 1 {
        return Some(format!("it has {} outputs and no flip-flop", outputs.len()));
    }
    if !(1..=most).contains(&inputs.len()) {
        let inputs = inputs.len();
        return Some(format!("it has {inputs} inputs; gates have 1 to {most}"));
    }
    let (name, pin) = cell.pins().find(|(name, _)| *name == outputs[0])?;
    Some(match pin.value("function") {
        None => format!("output {name} has no function"),
        Some(text) => format!("the function {text:?} of {name} is none of its inputs"),
    })
}

fn why_no_flip_flop(
    cell: &Group<'_>,
    ff: &Group<'_>,
    inputs: &[&str],
    outputs: &[&str],
) -> Option<String> {
    if outputs.len() > MAX_OUTPUTS || inputs.len() > MAX_PINS {
        let (inputs, outputs) = (inputs.len(), outputs.len());
        return Some(format!(
            "it is a flip-flop of {inputs} inputs and {outputs} outputs"
        ));
    }
    for name in ["clear", "preset", "clocked_on"] {
        match ff.value(name) {
            Some(text) if control_pin(text, inputs).is_none() => {
                return Some(format!("its {name} is {text:?} and not one pin"));
            }
            None if name == "clocked_on" => {
                return Some(format!("its flip-flop has no {name}"));
            }
            _ => {}
        }
    }
    let Some(next_state) = ff.value("next_state") else {
        return Some("its flip-flop has no next_state".to_owned());
    };
    if shown_states(cell, ff, outputs) == [None, None] {
        return Some("no output shows its state".to_owned());
    }
    Some(format!(
        "its next_state is {next_state:?} and not one pin, whatever the others are tied to"
    ))
}

/// Cells that a message names.
const NAMED: usize = 3;

impl LibertyError {
    /// The same with the cells that were passed over and that this may be about: those that it names, or else flip-flops or gates.
    pub(super) fn with_passed_over(mut self, cells: &[PassedOver]) -> Self {
        let words: Vec<String> = (self.message.split([' ', ',', ';', ':']))
            .map(str::to_owned)
            .collect();
        let is_named = |cell: &&PassedOver| words.contains(&cell.cell);
        let misses_flip_flop = (CellKind::ALL.iter())
            .any(|kind| kind.is_flip_flop() && words.iter().any(|word| word == kind.name()));
        let mut told: Vec<&PassedOver> = cells.iter().filter(is_named).collect();
        if told.is_empty() {
            let alike = cells
                .iter()
                .filter(|cell| cell.is_flip_flop == misses_flip_flop);
            told = alike.collect();
        }
        for PassedOver {
            cell, place, why, ..
        } in told.iter().take(NAMED)
        {
            self.message += &format!("; {place}: {cell} is not used: {why}");
        }
        if told.len() > NAMED {
            self.message += &format!("; and so are {} more", told.len() - NAMED);
        }
        self
    }
}
