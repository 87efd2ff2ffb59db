//! The cells of a library that chips here can be made of: gates by their function, flip-flops by their `ff` group.

use std::collections::BTreeSet;

use super::error::LibertyError;
pub(crate) use super::flip_flop::FlipFlop;
use super::function::{TruthTable, truth_table};
use super::group::Group;
use super::words::{check_word, is_true};

/// What a cell does, told without a look at its tables.
#[derive(Debug, Clone, PartialEq)]
pub(crate) enum Role {
    /// One output that is a function of the inputs, in the order of [`Candidate::inputs`].
    Gate(TruthTable),
    /// A flip-flop whose next state is its data, once some inputs are tied to a level.
    FlipFlop(FlipFlop),
}

/// What a cell of the library does, for netlists that are mapped to it.
#[derive(Debug, Clone, PartialEq)]
pub(crate) struct CellFunction {
    pub inputs: Vec<String>,
    pub outputs: Vec<String>,
    pub role: Role,
}

/// A cell that may be chosen.
pub(super) struct Candidate<'g, 't> {
    pub group: &'g Group<'t>,
    /// Which of the library's files it is in.
    pub file: usize,
    /// Whether the library says not to use it.
    pub dont_use: bool,
    pub area: f64,
    pub inputs: Vec<&'t str>,
    pub outputs: Vec<&'t str>,
    pub role: Role,
}

impl<'g, 't> Candidate<'g, 't> {
    /// The cell of a library's file, if it is a gate or flip-flop of the kinds used here; [`super::passed_over`] says why another is not.
    ///
    /// # Errors
    /// An area that is not a number, and words that mean nothing.
    pub(super) fn from_group(
        group: &'g Group<'t>,
        file: usize,
    ) -> Result<Option<Self>, LibertyError> {
        let area = group.number("area")?.unwrap_or(0.0);
        let pins = || group.pins();
        let of_direction = |direction: &str| {
            let pins_of_direction =
                pins().filter(|(_, pin)| pin.value("direction") == Some(direction));
            pins_of_direction.map(|(name, _)| name).collect::<Vec<_>>()
        };
        let (mut inputs, outputs) = (of_direction("input"), of_direction("output"));
        // In one order in every drive of a family, whatever the file's is.
        inputs.sort_unstable();
        for pin in group.of_kind("pin") {
            check_word(pin, "direction", &["input", "output", "inout", "internal"])?;
        }
        let dont_use = is_true(group, "dont_use")?;
        let shared = pins().any(|(_, pin)| pin.value("three_state").is_some());
        let names: BTreeSet<&str> = pins().map(|(name, _)| name).collect();
        let is_named = group.of_kind("pin").all(|pin| !pin.arguments.is_empty());
        let unclear = !is_named || names.len() < pins().count() || group.of_kind("ff").count() > 1;
        let kinds = [
            "latch",
            "statetable",
            "ff_bank",
            "latch_bank",
            "bus",
            "bundle",
        ];
        let other = group.groups.iter().any(|g| kinds.contains(&g.kind));
        let whole = inputs.len() + outputs.len() == pins().count();
        if shared || unclear || other || !whole || outputs.is_empty() {
            return Ok(None);
        }
        let role = match group.of_kind("ff").next() {
            Some(ff) => FlipFlop::read(group, ff, &inputs, &outputs)?.map(Role::FlipFlop),
            None if outputs.len() == 1 && (1..=TruthTable::MOST).contains(&inputs.len()) => {
                let output = group.pin(outputs[0]);
                let function = output.and_then(|pin| pin.value("function"));
                function
                    .and_then(|text| truth_table(text, &inputs))
                    .map(Role::Gate)
            }
            None => None,
        };
        Ok(role.map(|role| Candidate {
            group,
            file,
            dont_use,
            area,
            inputs,
            outputs,
            role,
        }))
    }

    /// The cell's name.
    pub(super) fn name(&self) -> &'t str {
        self.group.name()
    }

    /// Its inputs and outputs: drives of one family have the same.
    pub(super) fn pins(&self) -> (&[&'t str], &[&'t str]) {
        (&self.inputs, &self.outputs)
    }

    /// What it does.
    pub(super) fn function(&self) -> CellFunction {
        let owned = |names: &[&str]| names.iter().map(|&name| name.to_owned()).collect();
        CellFunction {
            inputs: owned(&self.inputs),
            outputs: owned(&self.outputs),
            role: self.role.clone(),
        }
    }
}
