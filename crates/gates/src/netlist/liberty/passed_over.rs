//! Cells of a library that cannot stand for any kind of cell here, and why: latches, buses, three-state drivers, fillers and so on.
//!
//! They are no fault of the library. Whoever misses a cell finds it in [`Liberty::passed_over`](super::Liberty::passed_over), and a
//! library from which nothing can be made is refused with the commonest reasons.

use std::collections::BTreeSet;

use super::error::LibertyError;
use super::function::{TruthTable, truth_table};
use super::group::Group;
use crate::netlist::{CellKind, MAX_OUTPUTS};

/// A cell that is not used.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct PassedOver {
    /// Its name.
    pub cell: String,
    /// Line it begins in, from 1.
    pub line: usize,
    /// What keeps it from being used.
    pub why: String,
    is_flip_flop: bool,
}

impl PassedOver {
    /// A cell that is no [`Candidate`](super::cell::Candidate).
    pub(super) fn of(group: &Group<'_>) -> Self {
        Self::new(group, why(group))
    }

    /// A cell whose name another one in an earlier line has.
    pub(super) fn again(group: &Group<'_>, line: usize) -> Self {
        Self::new(
            group,
            format!("line {line} has a cell of this name, which counts"),
        )
    }

    fn new(group: &Group<'_>, why: String) -> Self {
        PassedOver {
            cell: group.name().to_owned(),
            line: group.line,
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
            Some(ff) => why_no_flip_flop(ff, &inputs, &outputs),
            None => why_no_gate(cell, &inputs, &outputs),
        })
        .unwrap_or_else(|| "it is none of the gates and flip-flops that are used".to_owned())
}

/// What keeps a cell from being used, whatever its function.
fn why_unusable(cell: &Group<'_>) -> Option<String> {
    if cell.value("dont_use") == Some("true") {
        return Some("it is marked dont_use".to_owned());
    }
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

fn why_no_flip_flop(ff: &Group<'_>, inputs: &[&str], outputs: &[&str]) -> Option<String> {
    if outputs.len() > MAX_OUTPUTS || inputs.len() > TruthTable::MOST {
        let (inputs, outputs) = (inputs.len(), outputs.len());
        return Some(format!(
            "it is a flip-flop of {inputs} inputs and {outputs} outputs"
        ));
    }
    for name in ["clear", "preset", "next_state", "clocked_on"] {
        match ff.value(name) {
            Some(text)
                if truth_table(text, inputs)
                    .and_then(TruthTable::literal)
                    .is_none() =>
            {
                return Some(format!("its {name} is {text:?} and not one pin"));
            }
            None if name == "next_state" || name == "clocked_on" => {
                return Some(format!("its flip-flop has no {name}"));
            }
            _ => {}
        }
    }
    let controls = ["clear", "preset"].map(|name| ff.value(name).is_some());
    let pins = 2 + controls.into_iter().filter(|&is_there| is_there).count();
    let why = if inputs.len() == pins {
        "no output shows its state"
    } else {
        "it has inputs besides data, clock, clear and preset"
    };
    Some(why.to_owned())
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
            cell, line, why, ..
        } in told.iter().take(NAMED)
        {
            self.message += &format!("; {cell} in line {line} is passed over: {why}");
        }
        if told.len() > NAMED {
            self.message += &format!("; and so are {} more", told.len() - NAMED);
        }
        self
    }
}
