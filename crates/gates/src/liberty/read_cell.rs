//! The tables of a chosen cell, read: its `timing` and `internal_power` groups, capacitances and widths of pulses.

use super::candidate::{Candidate, FlipFlop, Role};
use super::cell::{CellArc, CellCheck, CellEnergy, CellModel, InputPin, OutputPin};
use super::complete;
use super::error::LibertyError;
use super::group::Group;
use super::kit::LibraryFile;
use super::leakage::leakage_of;
use super::remark::CellRemark;
use super::table::Table;
use super::words::{timing_sense, timing_type};
use crate::netlist::{CheckKind, Edge};

impl CellModel {
    /// Reads a candidate's tables.
    ///
    /// # Errors
    /// Tables and numbers that are malformed, negative or beyond what delays are kept in, pins without capacitance, edges of a gate
    /// without an arc, and names that Verilog cannot have.
    pub(super) fn read(
        candidate: &Candidate<'_, '_>,
        file: &LibraryFile<'_, '_>,
    ) -> Result<Self, LibertyError> {
        let units = file.units;
        let group = candidate.group;
        let pin = |name: &str| group.pin(name).expect("a candidate's pin");
        complete::check_area_and_names(candidate)?;
        let load = |name: &str, missing: Option<f64>| {
            let loads = complete::capacitance(name, pin(name), missing)?;
            Ok(loads.map(|load| load * units.load_ff))
        };
        let leakage = leakage_of(group, file.group)?;
        let mut model = CellModel {
            name: candidate.name().to_owned(),
            place: file.place(group.line),
            role: candidate.role.clone(),
            area: candidate.area,
            leakage_w: leakage.unwrap_or(0.0) * units.leakage_w,
            inputs: Vec::new(),
            outputs: Vec::new(),
            arcs: Vec::new(),
            checks: Vec::new(),
            energies: Vec::new(),
            remarks: Vec::new(),
        };
        let unstated = [
            (group.value("area").is_none(), CellRemark::NoArea),
            (leakage.is_none(), CellRemark::NoLeakage),
        ];
        let unstated = unstated.into_iter().filter(|(is_missing, _)| *is_missing);
        model.remarks.extend(unstated.map(|(_, remark)| remark));
        // A default of 0, which many files have, states nothing.
        let default = |name| Ok(file.group.number(name)?.filter(|&default| default > 0.0));
        let of_inputs = default("default_input_pin_cap")?;
        let of_outputs = default("default_output_pin_cap")?.or(Some(0.0));
        for (index, &name) in candidate.inputs.iter().enumerate() {
            let group = pin(name);
            let load_ff = load(name, of_inputs)?;
            let name = name.to_owned();
            model.inputs.push(InputPin { name, load_ff });
            if group.value("min_period").is_some() {
                model.remark(CellRemark::PeriodNotUsed);
            }
            for (attribute, kind, edge) in [
                ("min_pulse_width_high", PulseWidth::High, Edge::Rise),
                ("min_pulse_width_low", PulseWidth::Low, Edge::Fall),
            ] {
                if let Some(width) = group.number(attribute)? {
                    let limit = Table::fixed(width * units.time_fs);
                    limit.check_range(group.line, attribute)?;
                    model.add_width(candidate, index, kind, edge, limit);
                }
            }
            for timing in group.of_kind("timing") {
                model.add_checks(candidate, index, timing, file)?;
            }
            for power in group.of_kind("internal_power") {
                model.add_energy((None, Some(index)), power, file);
            }
        }
        for (index, &name) in candidate.outputs.iter().enumerate() {
            let load_ff = load(name, of_outputs)?;
            let output = name.to_owned();
            model.outputs.push(OutputPin {
                name: output,
                load_ff,
            });
            for timing in pin(name).of_kind("timing") {
                model.add_arcs(candidate, index, timing, file)?;
            }
            for power in pin(name).of_kind("internal_power") {
                let related = power.value("related_pin").unwrap_or_default();
                let from = |name| candidate.inputs.iter().position(|input| *input == name);
                let from = related.split_whitespace().next().and_then(from);
                model.add_energy((Some(index), from), power, file);
            }
        }
        if model.energies.is_empty() {
            model.remark(CellRemark::NoEnergy);
        }
        match model.role {
            Role::Gate(function) => complete::check_gate(&model, function)
                .map_err(|fault| LibertyError::new(group.line, fault))?,
            Role::FlipFlop(_) => {
                let missing = complete::missing_limits(&model);
                if !missing.is_empty() {
                    model.remark(CellRemark::NoLimits(missing));
                }
            }
        }
        Ok(model)
    }

    fn remark(&mut self, remark: CellRemark) {
        if !self.remarks.contains(&remark) {
            self.remarks.push(remark);
        }
    }

    /// Tables over anything but slews and loads are passed over, with a remark.
    fn add_energy(
        &mut self,
        (to, from): (Option<usize>, Option<usize>),
        power: &Group<'_>,
        file: &LibraryFile<'_, '_>,
    ) {
        let table = |kind: &str| {
            let mut groups = power.of_kind(kind).chain(power.of_kind("power"));
            let read = |group| {
                let unit = file.units.energy_fj;
                file.templates.table_in(group, file.units, unit)
            };
            groups.next().map_or(Ok(Table::fixed(0.0)), read)
        };
        if let (Ok(rise), Ok(fall)) = (table("rise_power"), table("fall_power")) {
            let tables = [rise, fall];
            self.energies.push(CellEnergy { to, from, tables });
        } else {
            self.remark(CellRemark::EnergyNotUsed);
        }
    }

    fn add_arcs(
        &mut self,
        candidate: &Candidate<'_, '_>,
        to: usize,
        timing: &Group<'_>,
        file: &LibraryFile<'_, '_>,
    ) -> Result<(), LibertyError> {
        use Edge::{Fall, Rise};
        let kind = timing_type(timing)?;
        let sense = timing_sense(timing)?;
        let delays = [
            "combinational",
            "combinational_rise",
            "combinational_fall",
            "rising_edge",
            "falling_edge",
            "clear",
            "preset",
        ];
        if !delays.contains(&kind) {
            return Ok(());
        }
        let related = timing.value("related_pin").unwrap_or_default();
        for name in related.split_whitespace() {
            let Some(from) = candidate.inputs.iter().position(|input| *input == name) else {
                continue;
            };
            let sense = match (sense, &candidate.role) {
                (None, Role::Gate(function)) => match function.unate(from as u32) {
                    (true, false) => Some("positive_unate"),
                    (false, true) => Some("negative_unate"),
                    _ => None,
                },
                (sense, _) => sense,
            };
            let causes = |effect: Edge| -> &[Edge] {
                match (kind, sense, effect) {
                    ("rising_edge", ..) => &[Rise],
                    ("falling_edge", ..) => &[Fall],
                    ("combinational_rise", _, Fall) | ("combinational_fall", _, Rise) => &[],
                    (_, Some("positive_unate"), Rise) | (_, Some("negative_unate"), Fall) => {
                        &[Rise]
                    }
                    (_, Some("positive_unate"), Fall) | (_, Some("negative_unate"), Rise) => {
                        &[Fall]
                    }
                    _ => &Edge::BOTH,
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
                        delay: file.templates.table(delay, file.units)?,
                        slew: file.templates.table(slew, file.units)?,
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
        file: &LibraryFile<'_, '_>,
    ) -> Result<(), LibertyError> {
        let kind = match timing_type(timing)? {
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
                        let limit = file.templates.table(group, file.units)?;
                        self.add_width(candidate, pin, kind, edge, limit);
                    }
                }
                return Ok(());
            }
            "minimum_period" => {
                self.remark(CellRemark::PeriodNotUsed);
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
                    limit: file.templates.table(group, file.units)?,
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
