//! A Liberty file: its units, and what its cells are mapped to.

use std::collections::HashMap;

use super::cell::{Candidate, CellFunction};
use super::error::{LibertyError, Units};
use super::group::{self, Group};
use super::mapping::{CellMap, Maker};
use super::passed_over::PassedOver;
use super::table::Templates;
use super::text::joined;
use crate::netlist::CellKind;

/// A library whose cells stand for every [`CellKind`].
#[derive(Debug, Clone, PartialEq)]
pub struct Liberty {
    /// Its name.
    pub name: String,
    /// Supply and temperature it is characterised at, as the file says: V, °C.
    pub conditions: [Option<f64>; 2],
    /// Cells in the file, those that are not used here included.
    pub cells: usize,
    /// What stands for each kind.
    pub map: CellMap,
    /// Cells that stand for nothing here and cannot, in the order of the file.
    pub passed_over: Vec<PassedOver>,
    /// Its unit of capacitance, fF.
    pub(super) load_unit_ff: f64,
    /// Its gates and flip-flops by name.
    functions: HashMap<String, CellFunction>,
}

impl Liberty {
    /// What a cell does, if it is a gate of up to six inputs or a flip-flop.
    pub(in crate::netlist) fn function(&self, cell: &str) -> Option<&CellFunction> {
        self.functions.get(cell)
    }

    /// Reads a library of non-linear delay tables. `wanted` names cells that are to stand for a kind instead of those of least area.
    ///
    /// # Errors
    /// What is no Liberty, units that are not known, and a library from which the cells here cannot be made.
    pub fn read(text: &str, wanted: &[(CellKind, String)]) -> Result<Self, LibertyError> {
        let text = joined(text);
        let library = group::read(&text)?;
        let fault = |message: String| LibertyError {
            line: library.line,
            message,
        };
        let model = library.value("delay_model").unwrap_or("table_lookup");
        if model != "table_lookup" {
            return Err(fault(format!(
                "its delay_model is {model}; give a library with table_lookup"
            )));
        }
        let load_ff = load_unit(&library)
            .ok_or_else(|| fault("it has no capacitive_load_unit of ff or pf".to_owned()))?;
        let volt = match library.value("voltage_unit") {
            Some("1mV") => 1e-3,
            Some("10mV") => 1e-2,
            Some("100mV") => 0.1,
            _ => 1.0,
        };
        let units = Units {
            time_fs: match library.value("time_unit") {
                None | Some("1ns") => 1e6,
                Some("100ps") => 1e5,
                Some("10ps") => 1e4,
                Some("1ps") => 1e3,
                Some(other) => {
                    return Err(fault(format!(
                        "its time_unit is {other:?}; 1ns, 100ps, 10ps and 1ps are known"
                    )));
                }
            },
            load_ff,
            energy_fj: load_ff * volt * volt,
        };
        let leakage_unit_w = match library.value("leakage_power_unit") {
            Some("1uW") => 1e-6,
            Some("1pW") => 1e-12,
            Some("1mW") => 1e-3,
            Some("100pW") => 1e-10,
            Some("10pW") => 1e-11,
            Some("10nW") => 1e-8,
            Some("100nW") => 1e-7,
            _ => 1e-9,
        };
        let templates = Templates::of(&library);
        let (mut candidates, mut passed_over) = (Vec::new(), Vec::new());
        let mut lines = HashMap::new();
        for group in library.of_kind("cell") {
            let before = *lines.entry(group.name()).or_insert(group.line);
            if before != group.line {
                passed_over.push(PassedOver::again(group, before));
            } else if let Some(candidate) = Candidate::of(group)? {
                candidates.push(candidate);
            } else {
                passed_over.push(PassedOver::of(group));
            }
        }
        let maker = Maker {
            candidates: &candidates,
            templates: &templates,
            units,
            leakage_unit_w,
            wanted,
        };
        Ok(Liberty {
            name: library.name().to_owned(),
            conditions: [
                library.number("nom_voltage")?,
                library.number("nom_temperature")?,
            ],
            cells: library.of_kind("cell").count(),
            load_unit_ff: load_ff,
            map: (maker.make(&library)).map_err(|fault| fault.with_passed_over(&passed_over))?,
            passed_over,
            functions: candidates
                .iter()
                .map(|c| (c.name().to_owned(), c.function()))
                .collect(),
        })
    }
}

impl Liberty {
    /// Area of the weakest cells that stand for a kind, in the library's unit.
    pub fn area(&self, kind: CellKind) -> f64 {
        let stages = self.map.recipe(kind).stages.iter();
        stages.map(|stage| stage.drives[0].area).sum()
    }
}

/// fF of the file's unit of capacitance.
fn load_unit(library: &Group<'_>) -> Option<f64> {
    let [number, unit] = library.values("capacitive_load_unit")? else {
        return None;
    };
    let unit = match unit.to_ascii_lowercase().as_str() {
        "ff" => 1.0,
        "pf" => 1e3,
        _ => return None,
    };
    Some(number.parse::<f64>().ok()? * unit)
}
