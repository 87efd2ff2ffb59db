//! The cells of a library that chips here can be made of: gates by their function, flip-flops by their `ff` group.
//!
//! ```text
//!   every cell ─► Candidate: pins and function ─(the few that are chosen)─► CellModel: arcs, limits, capacitances
//! ```

use std::collections::BTreeSet;

use super::error::{LibertyError, Units};
use super::function::{TruthTable, truth_table};
use super::group::Group;
use super::table::{Table, Templates};
use crate::netlist::{CheckKind, Edge, MAX_OUTPUTS};

/// What a cell does, told without a look at its tables.
#[derive(Debug, Clone, PartialEq)]
pub(in crate::netlist) enum Role {
    /// One output that is a function of the inputs, in the order of [`Candidate::inputs`].
    Gate(TruthTable),
    /// A flip-flop whose next state is its data.
    FlipFlop(FlipFlop),
}

/// Pins of a flip-flop: indices of inputs, each with whether it is inverted.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(in crate::netlist) struct FlipFlop {
    pub data: (usize, bool),
    pub clock: (usize, bool),
    pub clear: Option<(usize, bool)>,
    pub preset: Option<(usize, bool)>,
    /// Outputs that show the state, and its inverse.
    pub q: Option<usize>,
    pub qn: Option<usize>,
    /// Whether the preset wins where clear and preset are both active.
    pub preset_wins: bool,
}

/// What a cell of the library does, for netlists that are mapped to it.
#[derive(Debug, Clone, PartialEq)]
pub(in crate::netlist) struct CellFunction {
    pub inputs: Vec<String>,
    pub outputs: Vec<String>,
    pub role: Role,
}

/// A cell that may be chosen.
pub(super) struct Candidate<'g, 't> {
    pub group: &'g Group<'t>,
    pub area: f64,
    pub inputs: Vec<&'t str>,
    pub outputs: Vec<&'t str>,
    pub role: Role,
}

impl<'g, 't> Candidate<'g, 't> {
    /// The cell, if it is a gate or flip-flop of the kinds used here and not marked `dont_use`; [`super::passed_over`] says why another is not.
    ///
    /// # Errors
    /// An area that is not a number.
    pub(super) fn of(group: &'g Group<'t>) -> Result<Option<Self>, LibertyError> {
        let area = group.number("area")?.unwrap_or(0.0);
        let pins = || group.pins();
        let of_direction = |direction: &str| {
            let of = pins().filter(|(_, pin)| pin.value("direction") == Some(direction));
            of.map(|(name, _)| name).collect::<Vec<_>>()
        };
        let (inputs, outputs) = (of_direction("input"), of_direction("output"));
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
        if group.value("dont_use") == Some("true")
            || shared
            || unclear
            || other
            || !whole
            || outputs.is_empty()
        {
            return Ok(None);
        }
        let role = match group.of_kind("ff").next() {
            Some(ff) => flip_flop(group, ff, &inputs, &outputs).map(Role::FlipFlop),
            None if outputs.len() == 1 && (1..=TruthTable::MOST).contains(&inputs.len()) => {
                let output = pins().find(|(name, _)| *name == outputs[0]);
                let function = output.and_then(|(_, pin)| pin.value("function"));
                function
                    .and_then(|text| truth_table(text, &inputs))
                    .map(Role::Gate)
            }
            None => None,
        };
        Ok(role.map(|role| Candidate {
            group,
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

fn flip_flop(
    cell: &Group<'_>,
    ff: &Group<'_>,
    inputs: &[&str],
    outputs: &[&str],
) -> Option<FlipFlop> {
    let literal = |name: &str| truth_table(ff.value(name)?, inputs)?.literal();
    let control = |name: &str| match ff.value(name) {
        None => Some(None),
        Some(_) => literal(name).map(Some),
    };
    let state = ff.arguments.as_slice();
    let shows = |inverted: bool| {
        outputs.iter().position(|output| {
            let pin = cell.pins().find(|(name, _)| name == output);
            let function = pin.and_then(|(_, pin)| pin.value("function"));
            let shown = function.and_then(|text| truth_table(text, state)?.literal());
            // The second name of an `ff` is its state inverted.
            shown.is_some_and(|(which, inverts)| inverts ^ (which == 1) == inverted)
        })
    };
    let (clear, preset) = (control("clear")?, control("preset")?);
    let found = FlipFlop {
        data: literal("next_state")?,
        clock: literal("clocked_on")?,
        clear,
        preset,
        q: shows(false),
        qn: shows(true),
        preset_wins: ff.value("clear_preset_var1") == Some("H"),
    };
    let pins = 2 + usize::from(clear.is_some()) + usize::from(preset.is_some());
    let fits = inputs.len() == pins && outputs.len() <= MAX_OUTPUTS;
    (fits && (found.q.is_some() || found.qn.is_some())).then_some(found)
}

/// An input pin.
#[derive(Debug, Clone, PartialEq)]
pub(super) struct InputPin {
    pub name: String,
    /// Capacitance while it rises and falls, fF.
    pub load_ff: [f64; 2],
}

/// How an edge of an input makes one of an output.
#[derive(Debug, Clone, PartialEq)]
pub(super) struct CellArc {
    pub from: usize,
    pub to: usize,
    pub cause: Edge,
    pub effect: Edge,
    pub delay: Table,
    pub slew: Table,
}

/// A limit on a flip-flop's pins.
#[derive(Debug, Clone, PartialEq)]
pub(super) struct CellCheck {
    pub kind: CheckKind,
    pub pin: usize,
    /// Direction of the pin that is bound.
    pub edge: Edge,
    /// Over the slews of clock and pin; of the pin alone for a pulse's width.
    pub limit: Table,
}

/// Energy within a cell when a pin changes, besides that of the loads at its outputs.
#[derive(Debug, Clone, PartialEq)]
pub(super) struct CellEnergy {
    /// Output; none where an input takes it by itself.
    pub to: Option<usize>,
    /// The input that changes, or is behind the output's change; any where the file does not say.
    pub from: Option<usize>,
    /// Of the pin's rise and fall, fJ over the input's slew and the output's load.
    pub of: [Table; 2],
}

/// A chosen cell with its tables.
#[derive(Debug, Clone, PartialEq)]
pub(super) struct CellModel {
    pub name: String,
    pub role: Role,
    pub area: f64,
    /// Leakage, W.
    pub leakage_w: f64,
    pub inputs: Vec<InputPin>,
    pub outputs: Vec<String>,
    pub arcs: Vec<CellArc>,
    pub checks: Vec<CellCheck>,
    pub energies: Vec<CellEnergy>,
}

impl CellModel {
    /// Reads a candidate's tables.
    ///
    /// # Errors
    /// Tables and numbers that are malformed.
    pub(super) fn read(
        candidate: &Candidate<'_, '_>,
        templates: &Templates<'_, '_>,
        units: Units,
        leakage_unit_w: f64,
    ) -> Result<Self, LibertyError> {
        let pin = |name: &str| {
            let mut pins = candidate.group.pins();
            let found = pins.find(|(own, _)| *own == name);
            found.expect("a candidate's pin").1
        };
        let mut model = CellModel {
            name: candidate.name().to_owned(),
            role: candidate.role.clone(),
            area: candidate.area,
            leakage_w: candidate.group.number("cell_leakage_power")?.unwrap_or(0.0)
                * leakage_unit_w,
            inputs: Vec::new(),
            outputs: candidate
                .outputs
                .iter()
                .map(|&name| name.to_owned())
                .collect(),
            arcs: Vec::new(),
            checks: Vec::new(),
            energies: Vec::new(),
        };
        for (index, &name) in candidate.inputs.iter().enumerate() {
            let group = pin(name);
            let either = group.number("capacitance")?.unwrap_or(0.0);
            let load = |name| Ok(group.number(name)?.unwrap_or(either) * units.load_ff);
            model.inputs.push(InputPin {
                name: name.to_owned(),
                load_ff: [load("rise_capacitance")?, load("fall_capacitance")?],
            });
            for (attribute, kind, edge) in [
                ("min_pulse_width_high", PulseWidth::High, Edge::Rise),
                ("min_pulse_width_low", PulseWidth::Low, Edge::Fall),
            ] {
                if let Some(width) = group.number(attribute)? {
                    let limit = Table::fixed(width * units.time_fs);
                    model.add_width(candidate, index, kind, edge, limit);
                }
            }
            for timing in group.of_kind("timing") {
                model.add_checks(candidate, index, timing, templates, units)?;
            }
            for power in group.of_kind("internal_power") {
                model.add_energy((None, Some(index)), power, templates, units);
            }
        }
        for (index, &name) in candidate.outputs.iter().enumerate() {
            for timing in pin(name).of_kind("timing") {
                model.add_arcs(candidate, index, timing, templates, units)?;
            }
            for power in pin(name).of_kind("internal_power") {
                let related = power.value("related_pin").unwrap_or_default();
                let from = |name| candidate.inputs.iter().position(|input| *input == name);
                let from = related.split_whitespace().next().and_then(from);
                model.add_energy((Some(index), from), power, templates, units);
            }
        }
        Ok(model)
    }

    /// Tables over anything but slews and loads are passed over.
    fn add_energy(
        &mut self,
        (to, from): (Option<usize>, Option<usize>),
        power: &Group<'_>,
        templates: &Templates<'_, '_>,
        units: Units,
    ) {
        let table = |kind: &str| {
            let mut groups = power.of_kind(kind).chain(power.of_kind("power"));
            let read = |group| templates.table_in(group, units, units.energy_fj);
            groups.next().map_or(Ok(Table::fixed(0.0)), read)
        };
        if let (Ok(rise), Ok(fall)) = (table("rise_power"), table("fall_power")) {
            let of = [rise, fall];
            self.energies.push(CellEnergy { to, from, of });
        }
    }

    fn add_arcs(
        &mut self,
        candidate: &Candidate<'_, '_>,
        to: usize,
        timing: &Group<'_>,
        templates: &Templates<'_, '_>,
        units: Units,
    ) -> Result<(), LibertyError> {
        use Edge::{Fall, Rise};
        let related = timing.value("related_pin").unwrap_or_default();
        for name in related.split_whitespace() {
            let Some(from) = candidate.inputs.iter().position(|input| *input == name) else {
                continue;
            };
            let sense = match (timing.value("timing_sense"), &candidate.role) {
                (None, Role::Gate(function)) => match function.unate(from as u32) {
                    (true, false) => Some("positive_unate"),
                    (false, true) => Some("negative_unate"),
                    _ => None,
                },
                (sense, _) => sense,
            };
            let causes = |effect: Edge| -> &[Edge] {
                match (
                    timing.value("timing_type").unwrap_or("combinational"),
                    sense,
                ) {
                    ("rising_edge", _) => &[Rise],
                    ("falling_edge", _) => &[Fall],
                    (
                        "combinational" | "combinational_rise" | "combinational_fall" | "clear"
                        | "preset",
                        sense,
                    ) => match (sense, effect) {
                        (Some("positive_unate"), Rise) | (Some("negative_unate"), Fall) => &[Rise],
                        (Some("positive_unate"), Fall) | (Some("negative_unate"), Rise) => &[Fall],
                        _ => &Edge::BOTH,
                    },
                    _ => &[],
                }
            };
            let tables = [
                (Rise, "cell_rise", "rise_transition"),
                (Fall, "cell_fall", "fall_transition"),
            ];
            for (effect, delay, slew) in tables {
                let one = |kind| timing.of_kind(kind).next();
                let (Some(delay), Some(slew)) = (one(delay), one(slew)) else {
                    continue;
                };
                for &cause in causes(effect) {
                    self.arcs.push(CellArc {
                        from,
                        to,
                        cause,
                        effect,
                        delay: templates.table(delay, units)?,
                        slew: templates.table(slew, units)?,
                    });
                }
            }
        }
        Ok(())
    }

    fn add_checks(
        &mut self,
        candidate: &Candidate<'_, '_>,
        pin: usize,
        timing: &Group<'_>,
        templates: &Templates<'_, '_>,
        units: Units,
    ) -> Result<(), LibertyError> {
        let kind = match timing.value("timing_type").unwrap_or_default() {
            "setup_rising" | "setup_falling" => CheckKind::Setup,
            "hold_rising" | "hold_falling" => CheckKind::Hold,
            "recovery_rising" | "recovery_falling" => CheckKind::Recovery,
            "removal_rising" | "removal_falling" => CheckKind::Removal,
            "min_pulse_width" => {
                for (table, kind, edge) in [
                    ("rise_constraint", PulseWidth::High, Edge::Rise),
                    ("fall_constraint", PulseWidth::Low, Edge::Fall),
                ] {
                    if let Some(group) = timing.of_kind(table).next() {
                        let limit = templates.table(group, units)?;
                        self.add_width(candidate, pin, kind, edge, limit);
                    }
                }
                return Ok(());
            }
            _ => return Ok(()),
        };
        // Some libraries also relate clear and preset to each other.
        let related = timing.value("related_pin").unwrap_or_default();
        let is_clock = |roles: &FlipFlop| candidate.inputs[roles.clock.0] == related.trim();
        if !matches!(&candidate.role, Role::FlipFlop(roles) if is_clock(roles)) {
            return Ok(());
        }
        for (edge, table) in [
            (Edge::Rise, "rise_constraint"),
            (Edge::Fall, "fall_constraint"),
        ] {
            if let Some(group) = timing.of_kind(table).next() {
                self.checks.push(CellCheck {
                    kind,
                    pin,
                    edge,
                    limit: templates.table(group, units)?,
                });
            }
        }
        Ok(())
    }

    /// A pulse's width is a limit of the clock's or a control's, by what the pin is and when it is active.
    fn add_width(
        &mut self,
        candidate: &Candidate<'_, '_>,
        pin: usize,
        width: PulseWidth,
        edge: Edge,
        limit: Table,
    ) {
        let Role::FlipFlop(roles) = &candidate.role else {
            return;
        };
        let high = (width == PulseWidth::High) != (roles.clock.0 == pin && roles.clock.1);
        let kind = if roles.clock.0 == pin {
            if high {
                CheckKind::ClockHigh
            } else {
                CheckKind::ClockLow
            }
        } else {
            let control = [roles.clear, roles.preset]
                .into_iter()
                .flatten()
                .find(|c| c.0 == pin);
            match control {
                Some((_, active_low)) if active_low == (width == PulseWidth::Low) => {
                    CheckKind::ControlHigh
                }
                _ => return,
            }
        };
        self.checks.push(CellCheck {
            kind,
            pin,
            edge,
            limit,
        });
    }
}

#[derive(Clone, Copy, PartialEq, Eq)]
enum PulseWidth {
    High,
    Low,
}
