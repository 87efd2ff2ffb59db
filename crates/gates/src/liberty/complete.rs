//! What a cell must state, so that nothing that is missing counts as zero; and what it leaves out or states in vain, for the user to know.

use super::candidate::{Candidate, FlipFlop, Role};
use super::cell::CellModel;
use super::error::{LibertyError, LibertyFault};
use super::function::TruthTable;
use super::group::Group;
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
