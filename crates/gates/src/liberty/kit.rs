//! The files of one kit: some foundries put gates, inverters and flip-flops into files of their own.
//!
//! Their cells are one library. Units may differ from file to file; what delays are measured at and between may not, because it would be
//! another corner or another meaning of a slew.

use super::error::{KitError, LibertyError, LibertyFault, place};
use super::group::Group;
use super::table::Templates;
use super::units::Units;

/// One file of a library.
pub(super) struct LibraryFile<'g, 't> {
    /// What messages call it; nothing where there is only text.
    pub name: &'g str,
    pub group: &'g Group<'t>,
    pub templates: Templates<'g, 't>,
    pub units: Units,
}

impl<'g, 't> LibraryFile<'g, 't> {
    /// A file that is read.
    ///
    /// # Errors
    /// Units that are not known, and delays that are not in tables.
    pub(super) fn new(name: &'g str, group: &'g Group<'t>) -> Result<Self, LibertyError> {
        let model = group.value("delay_model").unwrap_or("table_lookup");
        if model != "table_lookup" {
            let model = model.to_owned();
            return Err(LibertyError::new(
                group.line,
                LibertyFault::DelayModel { model },
            ));
        }
        Ok(LibraryFile {
            name,
            group,
            templates: Templates::from_library(group),
            units: Units::read(group)?,
        })
    }

    /// A line of it as messages have it.
    pub(super) fn place(&self, line: usize) -> String {
        place(self.name, line)
    }
}

/// Attributes that must be the same in all files, each with what it is of.
const SHARED: [(&str, &str); 12] = [
    ("nom_voltage", "V"),
    ("nom_temperature", "°C"),
    ("nom_process", "of process"),
    ("slew_derate_from_library", "of slews"),
    ("input_threshold_pct_rise", "%"),
    ("input_threshold_pct_fall", "%"),
    ("output_threshold_pct_rise", "%"),
    ("output_threshold_pct_fall", "%"),
    ("slew_lower_threshold_pct_rise", "%"),
    ("slew_upper_threshold_pct_rise", "%"),
    ("slew_lower_threshold_pct_fall", "%"),
    ("slew_upper_threshold_pct_fall", "%"),
];

/// Checks that files are of one kit and corner, and that no cell is in two of them.
///
/// # Errors
/// The first file that differs from the first of all, and a cell that is there twice.
pub(super) fn check_files(files: &[LibraryFile<'_, '_>]) -> Result<(), KitError> {
    let mut cells = std::collections::HashMap::new();
    for (index, file) in files.iter().enumerate() {
        let kit_error = |line: usize, fault: LibertyFault| KitError {
            file: index,
            error: LibertyError::new(line, fault),
        };
        let first = &files[0];
        let numbers = |name: &str| {
            let own = file.group.number(name);
            let own = own.map_err(|error| KitError { file: index, error })?;
            Ok([own, first.group.number(name).ok().flatten()])
        };
        for (name, unit) in SHARED {
            if let [Some(own), Some(of_first)] = numbers(name)?
                && own != of_first
            {
                let fault = LibertyFault::OtherCorner {
                    attribute: name,
                    unit,
                    own,
                    first: first.group.name().to_owned(),
                    of_first,
                };
                return Err(kit_error(file.group.line, fault));
            }
        }
        for cell in file.group.of_kind("cell") {
            if let Some(before) = cells.insert(cell.name(), index)
                && before != index
            {
                let other = &files[before];
                let other = if other.name.is_empty() {
                    other.group.name()
                } else {
                    other.name
                };
                let fault = LibertyFault::CellTwice {
                    cell: cell.name().to_owned(),
                    other: other.to_owned(),
                };
                return Err(kit_error(cell.line, fault));
            }
        }
    }
    Ok(())
}
