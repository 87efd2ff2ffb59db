//! What a cell must state, so that nothing that is missing counts as zero; and what it leaves out or states in vain, for the user to know.

use super::cell::{Candidate, CellModel, FlipFlop, Role};
use super::error::{LibertyError, LibertyFault};
use super::function::TruthTable;
use super::group::Group;
use super::syntax_fault::LibertySyntaxFault;
use super::verilog_name::is_possible;
use crate::netlist::{CheckKind, Edge};

/// Limits that a flip-flop should state and does not.
pub(super) fn missing_limits(model: &CellModel) -> Vec<CheckKind> {
    let has_control = match &model.role {
        Role::FlipFlop(roles) => roles.clear.is_some() || roles.preset.is_some(),
        Role::Gate(_) => false,
    };
    let is_stated = |kind| model.checks.iter().any(|check| check.kind == kind);
    let kinds = CheckKind::ALL.into_iter().filter(|&kind| {
        let concerns_control = matches!(
            kind,
            CheckKind::Recovery | CheckKind::Removal | CheckKind::ControlHigh
        );
        !is_stated(kind) && (has_control || !concerns_control)
    });
    kinds.collect()
}

/// Checks that a gate has an arc for every edge that its function makes.
///
/// # Errors
/// The first edge without one.
pub(super) fn check_gate(model: &CellModel, function: TruthTable) -> Result<(), LibertyFault> {
    for pin in 0..model.inputs.len() {
        let (same, inverse) = function.unate(pin as u32);
        for cause in Edge::BOTH {
            let effects = [(same, cause), (inverse, cause.opposite())];
            for (_, effect) in effects.into_iter().filter(|(is_made, _)| *is_made) {
                check_arc(model, (pin, cause), (0, effect))?;
            }
        }
    }
    Ok(())
}

/// Checks that a flip-flop of these pins has an arc for every edge that its clock, reset and (if it is used) set make.
///
/// # Errors
/// The first edge without one.
pub(super) fn check_flip_flop(
    model: &CellModel,
    roles: &FlipFlop,
    with_set: bool,
) -> Result<(), LibertyFault> {
    use Edge::{Fall, Rise};
    let active = |(pin, inverted): (usize, bool)| (pin, if inverted { Fall } else { Rise });
    for (output, set) in [(roles.q, Rise), (roles.qn, Fall)] {
        let Some(output) = output else { continue };
        for edge in Edge::BOTH {
            check_arc(model, active(roles.clock), (output, edge))?;
        }
        if let Some(clear) = roles.clear {
            check_arc(model, active(clear), (output, set.opposite()))?;
        }
        if let Some(preset) = roles.preset.filter(|_| with_set) {
            check_arc(model, active(preset), (output, set))?;
        }
    }
    Ok(())
}

fn check_arc(
    model: &CellModel,
    (from, cause): (usize, Edge),
    (to, effect): (usize, Edge),
) -> Result<(), LibertyFault> {
    let mut arcs = model.arcs.iter();
    let is_there =
        arcs.any(|arc| (arc.from, arc.cause, arc.to, arc.effect) == (from, cause, to, effect));
    if is_there {
        return Ok(());
    }
    Err(LibertyFault::NoDelay {
        from: model.inputs[from].name.clone(),
        cause,
        to: model.outputs[to].name.clone(),
        effect,
    })
}

/// Checks that a cell's area is not negative, and that Verilog can have its names.
///
/// # Errors
/// What is not so, with the cell's line.
pub(super) fn check_area_and_names(cell: &Candidate<'_, '_>) -> Result<(), LibertyError> {
    let fault = |fault| LibertyError::new(cell.group.line, fault);
    let area = cell.area;
    if area < 0.0 {
        return Err(fault(LibertyFault::NegativeArea { area }));
    }
    let pins = cell.inputs.iter().chain(&cell.outputs).copied();
    let mut names = std::iter::once(cell.name()).chain(pins);
    match names.find(|name| !is_possible(name)) {
        None => Ok(()),
        Some(name) => {
            let name = name.to_owned();
            Err(fault(LibertyFault::NoVerilogName { name }))
        }
    }
}

/// Capacitance of a pin while it rises and falls, in the file's unit; `missing` where it states none.
///
/// # Errors
/// None where none may be missing, and a negative one.
pub(super) fn capacitance(
    name: &str,
    pin: &Group<'_>,
    missing: Option<f64>,
) -> Result<[f64; 2], LibertyError> {
    let fault = |fault| LibertyError::new(pin.line, fault);
    let pin_name = || name.to_owned();
    let either = pin.number("capacitance")?.or(missing);
    let mut loads = [0.0; 2];
    for (load, attribute) in loads
        .iter_mut()
        .zip(["rise_capacitance", "fall_capacitance"])
    {
        let stated = pin.number(attribute)?.or(either);
        *load = stated.ok_or_else(|| fault(LibertyFault::NoCapacitance { pin: pin_name() }))?;
        if *load < 0.0 {
            return Err(fault(LibertyFault::NegativeCapacitance {
                pin: pin_name(),
                capacitance: *load,
            }));
        }
    }
    Ok(loads)
}

/// Checks that an attribute, if it is there, is one of these words.
///
/// # Errors
/// Another one.
pub(super) fn check_word(
    group: &Group<'_>,
    attribute: &'static str,
    known: &'static [&'static str],
) -> Result<(), LibertyError> {
    match group.value(attribute) {
        Some(word) if !known.contains(&word) => {
            let word = word.to_owned();
            let fault = LibertySyntaxFault::UnknownWord {
                attribute,
                word,
                known,
            };
            Err(LibertyError::new(group.line, fault))
        }
        _ => Ok(()),
    }
}

/// What a `timing` group is of.
///
/// # Errors
/// A word that is not in the Liberty manual.
pub(super) fn timing_type<'t>(timing: &Group<'t>) -> Result<&'t str, LibertyError> {
    let word = timing.value("timing_type").unwrap_or("combinational");
    let begins = [
        "combinational",
        "three_state_disable",
        "three_state_enable",
        "setup",
        "hold",
        "recovery",
        "removal",
        "skew",
        "non_seq_setup",
        "non_seq_hold",
    ];
    let with_edge = begins.into_iter().any(|begin| {
        matches!(
            word.strip_prefix(begin),
            Some("_rising" | "_falling" | "_rise" | "_fall" | "")
        )
    });
    let others = [
        "rising_edge",
        "falling_edge",
        "clear",
        "preset",
        "min_pulse_width",
        "minimum_period",
        "max_clock_tree_path",
        "min_clock_tree_path",
        "nochange_high_high",
        "nochange_high_low",
        "nochange_low_high",
        "nochange_low_low",
    ];
    if with_edge || others.contains(&word) {
        return Ok(word);
    }
    let word = word.to_owned();
    let fault = LibertySyntaxFault::UnknownTimingType { word };
    Err(LibertyError::new(timing.line, fault))
}

/// Which edge of the input makes which of the output, where a `timing` group says so.
///
/// # Errors
/// A word that is not in the Liberty manual.
pub(super) fn timing_sense<'t>(timing: &Group<'t>) -> Result<Option<&'t str>, LibertyError> {
    let known = &["positive_unate", "negative_unate", "non_unate"];
    check_word(timing, "timing_sense", known)?;
    Ok(timing.value("timing_sense"))
}
