//! Liberty files: their units, and what their cells are mapped to.

use std::collections::HashMap;

use super::candidate::{Candidate, CellFunction, Role};
use super::error::{KitError, LibertyError, PassedOver, PassedOverReason};
use super::group;
use super::kit::{self, LibraryFile};
use super::mapping::{CellMap, Maker};
use super::remark::LibraryRemark;
use super::text::joined;
use super::units::Units;
use crate::netlist::CellKind;

/// A library whose cells stand for every [`CellKind`].
#[derive(Debug, Clone, PartialEq)]
pub struct Liberty {
    /// Its name; of several files the first one's and their number.
    pub name: String,
    /// Supply and temperature it is characterised at, as the file says: V, °C.
    pub conditions: [Option<f64>; 2],
    /// Cells in the files, those that are not used here included.
    pub cells: usize,
    /// What stands for each kind.
    pub map: CellMap,
    /// Cells that stand for nothing here and cannot, in the order of the files. Gates that the library says not to use are among them, but for
    /// wanted ones.
    pub passed_over: Vec<PassedOver>,
    /// Units of the first file, in which other tools take times and loads.
    pub(super) units: Units,
    /// Its gates and flip-flops by name.
    functions: HashMap<String, CellFunction>,
}

impl Liberty {
    /// What a cell does, if it is a gate of up to six inputs or a flip-flop.
    #[cfg(feature = "yosys")]
    pub(crate) fn function(&self, cell: &str) -> Option<&CellFunction> {
        self.functions.get(cell)
    }

    /// Reads a library of non-linear delay tables. `wanted` names cells that are to stand for a kind instead of those of least area.
    ///
    /// # Errors
    /// What is no Liberty, units that are not known, and a library from which the cells here cannot be made.
    ///
    /// # Example
    ///
    /// ```
    /// use femtogate::liberty::{Liberty, LibertyFault, LibertyTableFault, LibertyUnit};
    /// use femtogate::netlist::CellKind;
    ///
    /// let file = concat!(env!("CARGO_MANIFEST_DIR"), "/examples/three_cells.lib");
    /// let text = std::fs::read_to_string(file)?;
    /// let library = Liberty::read(&text, &[])?;
    /// assert_eq!(library.name, "three_cells");
    /// assert_eq!(library.map.cells(CellKind::And2), ["NAND", "INV"]);
    ///
    /// let error = Liberty::read(&text.replace("1ns", "1h"), &[]).unwrap_err();
    /// let unit = LibertyUnit::Time;
    /// let text = "1h".to_owned();
    /// let fault = LibertyTableFault::UnknownUnit { unit, text };
    /// assert_eq!((error.line, error.fault), (1, LibertyFault::Table(fault.clone())));
    /// assert_eq!(
    ///     fault.to_string(),
    ///     "its time_unit is \"1h\"; give a number, a prefix and s, as in 1ns"
    /// );
    /// # Ok::<(), Box<dyn std::error::Error>>(())
    /// ```
    pub fn read(text: &str, wanted: &[(CellKind, String)]) -> Result<Self, LibertyError> {
        Self::read_files(&[("", text)], wanted).map_err(|e| e.error)
    }

    /// Reads a library of several files, each with the name that messages call it.
    ///
    /// # Errors
    /// Those of [`Liberty::read`], and files that do not belong together: of different corners, or with the same cell.
    pub fn read_files(
        files: &[(&str, &str)],
        wanted: &[(CellKind, String)],
    ) -> Result<Self, KitError> {
        let in_file = |file: usize| move |error: LibertyError| KitError { file, error };
        let texts: Vec<_> = files.iter().map(|(_, text)| joined(text)).collect();
        let mut groups = Vec::new();
        for (index, text) in texts.iter().enumerate() {
            groups.push(group::read(text).map_err(in_file(index))?);
        }
        let mut read = Vec::new();
        for (index, (group, (name, _))) in groups.iter().zip(files).enumerate() {
            read.push(LibraryFile::new(name, group).map_err(in_file(index))?);
        }
        kit::check_files(&read)?;
        let (mut candidates, mut passed_over) = (Vec::new(), Vec::new());
        for (index, file) in read.iter().enumerate() {
            let mut lines = HashMap::new();
            for cell in file.group.of_kind("cell") {
                if let Some(&before) = lines.get(cell.name()) {
                    passed_over.push(PassedOver::duplicate(file, cell, before));
                    continue;
                }
                lines.insert(cell.name(), cell.line);
                let candidate = Candidate::from_group(cell, index).map_err(in_file(index))?;
                passed_over.extend(PassedOver::from_group(
                    file,
                    cell,
                    candidate.as_ref(),
                    wanted,
                ));
                candidates.extend(candidate);
            }
        }
        let first = &groups[0];
        // A library states its conditions itself, or names a group of them.
        let number = |own: &str, of_group: &str| {
            let name = first.value("default_operating_conditions");
            let mut groups = first.of_kind("operating_conditions");
            let group = groups.find(|group| Some(group.name()) == name);
            let stated = first.number(own).transpose();
            let stated = stated.or_else(|| group?.number(of_group).transpose());
            stated.transpose().map_err(in_file(0))
        };
        let conditions = [
            number("nom_voltage", "voltage")?,
            number("nom_temperature", "temperature")?,
        ];
        let mut map = Maker::new(&read, &candidates, &passed_over, wanted).make()?;
        if conditions[0].is_none() {
            map.remarks.push(LibraryRemark::NoSupply);
        }
        if groups
            .iter()
            .any(|group| group.value("time_unit").is_none())
        {
            map.remarks.push(LibraryRemark::NoTimeUnit);
        }
        let twice = passed_over
            .iter()
            .filter(|cell| matches!(cell.why, PassedOverReason::Duplicate { .. }));
        let mut twice: Vec<String> = twice.map(|cell| cell.cell.clone()).collect();
        twice.sort_unstable();
        twice.dedup();
        if !twice.is_empty() {
            map.remarks.push(LibraryRemark::Duplicates { cells: twice });
        }
        // A cell with tied pins does what it says only where they are tied.
        let is_plain = |role: &Role| !matches!(role, Role::FlipFlop(roles) if roles.tied != 0);
        let plain = candidates.iter().filter(|c| is_plain(&c.role));
        Ok(Liberty {
            name: match groups.len() {
                1 => first.name().to_owned(),
                files => format!("{} and {} more files", first.name(), files - 1),
            },
            conditions,
            cells: groups
                .iter()
                .map(|group| group.of_kind("cell").count())
                .sum(),
            map,
            passed_over,
            units: read[0].units,
            functions: plain.map(|c| (c.name().to_owned(), c.function())).collect(),
        })
    }

    /// Area of the weakest cells that stand for a kind, in the library's unit.
    pub fn area(&self, kind: CellKind) -> f64 {
        let stages = self.map.recipe(kind).stages.iter();
        stages.map(|stage| stage.drives[0].area).sum()
    }
}
