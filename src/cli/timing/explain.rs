//! `gdtof timing --explain`: what the cells of a library are used for, and which were passed over.

use super::section::{Section, SectionCell};
use crate::chip::Silicon;
use crate::files::InputError;
use crate::netlist::CellKind;

/// What stands for each kind of cell, and the cells that stand for nothing and cannot.
///
/// # Errors
/// A sensor of the built-in cells.
pub(super) fn cells(silicon: &Silicon) -> Result<[Section; 2], InputError> {
    let Some(library) = silicon.cell_library.from_file() else {
        let message = "the built-in cells are no library's; add --liberty FILE";
        return Err(InputError::new("--explain", message));
    };
    let liberty = &library.liberty;
    let notes = liberty
        .map
        .notes
        .iter()
        .map(|note| format!("\n  note: {note}"));
    let title = format!(
        "Cells of {} that stand for each kind, the weakest of each",
        liberty.name
    );
    let title = title + &notes.collect::<String>();
    let mut used = Section::new("library_cells", title, &["kind", "cells"]);
    for kind in CellKind::ALL {
        used.push([
            kind.name().into(),
            liberty.map.cells(kind).join(" + ").into(),
        ]);
    }
    let title = format!(
        "Passed over: {} of the {} cells of {}",
        liberty.passed_over.len(),
        liberty.cells,
        liberty.name
    );
    let columns = &["cell", "file", "line", "why"];
    let mut passed_over = Section::new("passed_over", title, columns);
    for cell in &liberty.passed_over {
        let line = SectionCell::Number(Some(cell.line as f64), 0);
        let [name, file] = [&cell.cell, &cell.file].map(|text| text.as_str().into());
        passed_over.push([name, file, line, cell.why.to_string().into()]);
    }
    Ok([used, passed_over])
}
