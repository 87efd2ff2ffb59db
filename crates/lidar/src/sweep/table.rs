//! The table of a study: a row for each point, in their order, as CSV and Parquet. Rows are read from the journals one by one.

use std::io;
use std::path::{Path, PathBuf};

use rayon::prelude::*;

use super::cell::{Column, Holds, TableCell};
use super::error::SweepError;
use super::parquet::Parquet;
use super::row::{Index, StudyRow, journals_in};
use super::study::{Study, StudyKind};
use super::subject::{Scratch, Subject};
use crate::files::{InputError, OutputFile};

/// Points whose keys are made at once.
const CHUNK: u64 = 4096;

/// The table, as CSV.
pub const CSV: &str = "results.csv";
/// The table, as Parquet.
pub const PARQUET: &str = "results.parquet";
/// Run time of each frame as it was taken, s, as CSV: apart from the results, which are the same on any machine.
pub const TIMES: &str = "times.csv";

/// The columns of a study's table.
pub fn columns(study: &Study) -> Vec<Column> {
    let mut columns = vec![Column::new("point", "", Holds::Whole)];
    columns.extend(study.varied().map(|varied| varied.column.clone()));
    if study.kind == StudyKind::Frame {
        columns.push(Column::new("seed", "", Holds::Whole));
    }
    columns.extend(Subject::columns(study.kind));
    columns.push(Column::new("error", "", Holds::Word));
    columns
}

/// The rows of a study that are in the journals of some folders.
pub struct Results<'a> {
    study: &'a Study,
    index: Index,
}

impl<'a> Results<'a> {
    /// Looks through the journals.
    ///
    /// # Errors
    /// When one cannot be read.
    pub fn read(study: &'a Study, folders: &[PathBuf]) -> Result<Self, InputError> {
        let journals = folders
            .iter()
            .flat_map(|folder| journals_in(folder))
            .collect();
        let index = Index::read(journals, &Subject::columns(study.kind))?;
        Ok(Results { study, index })
    }

    /// Tells `found` of every point's row, in order: the cells of [`columns`], and its run time, s. Returns how many points have no row.
    ///
    /// # Errors
    /// When a journal cannot be read, and those of `found`, as ones of writing to `out`.
    pub(crate) fn each(
        &self,
        mut found: impl FnMut(Vec<TableCell>, f64) -> io::Result<()>,
        out: &Path,
    ) -> Result<u64, SweepError> {
        let study = self.study;
        let subject = Subject::new(study);
        let results = Subject::columns(study.kind);
        let mut rows = self.index.rows(&results)?;
        let mut missing = 0;
        let mut begin = 0;
        while begin < study.len() {
            let end = (begin + CHUNK).min(study.len());
            let ready: Vec<_> = (begin..end)
                .into_par_iter()
                .map_init(Scratch::default, |scratch, index| {
                    let point = study.point(index);
                    let ready = subject.ready(&point, scratch);
                    (point, ready.map(|ready| ready.key))
                })
                .collect();
            for (index, (point, key)) in (begin..end).zip(ready) {
                let row = match key {
                    Ok(key) => rows.get(key)?,
                    Err(why) => Some(StudyRow {
                        run_time_s: 0.0,
                        error: Some(why.to_string()),
                        cells: Vec::new(),
                    }),
                };
                let Some(row) = row else {
                    missing += 1;
                    continue;
                };
                let mut cells = vec![TableCell::Whole(index as i64)];
                cells.extend(
                    study
                        .varied()
                        .zip(&point.values)
                        .map(|(v, value)| v.cell(value)),
                );
                if study.kind == StudyKind::Frame {
                    cells.push(TableCell::Whole(point.seed as i64));
                }
                match row.error {
                    None => {
                        cells.extend(row.cells);
                        cells.push(TableCell::Empty);
                    }
                    Some(why) => {
                        cells.extend(std::iter::repeat_n(TableCell::Empty, results.len()));
                        cells.push(TableCell::Word(why));
                    }
                }
                found(cells, row.run_time_s).map_err(|e| InputError::unwritable(out, &e))?;
            }
            begin = end;
        }
        Ok(missing)
    }

    /// Writes [`CSV`], [`PARQUET`] and, of frames, [`TIMES`] into `folder`; `also` sees every row.
    ///
    /// # Errors
    /// As those of `Results::each`.
    pub fn write(
        &self,
        folder: &Path,
        mut also: impl FnMut(&[TableCell]),
    ) -> Result<WrittenTable, SweepError> {
        let columns = columns(self.study);
        let (mut rows, mut without_results, mut fault) = (0, 0, None);
        let mut csv = OutputFile::create(&folder.join(CSV))?;
        let mut times = match self.study.kind {
            StudyKind::Frame => Some(OutputFile::create(&folder.join(TIMES))?),
            StudyKind::Theory => None,
        };
        let failed = |e| InputError::unwritable(folder, &e);
        let parquet = OutputFile::create(&folder.join(PARQUET))?;
        let mut parquet = Parquet::begin(parquet, &columns).map_err(failed)?;
        let names = columns
            .iter()
            .map(|column| TableCell::Word(column.name.clone()));
        write_line(&mut csv, names).map_err(failed)?;
        if let Some(times) = &mut times {
            let names = ["point", "run_time_s"].map(|name| TableCell::Word(name.into()));
            write_line(times, names).map_err(failed)?;
        }
        let write = |cells: Vec<TableCell>, run_time_s| {
            write_line(&mut csv, &cells)?;
            if let Some(times) = &mut times {
                write_line(times, [&cells[0], &TableCell::Number(run_time_s)])?;
            }
            rows += 1;
            // The last column says why there is no result.
            if let Some(TableCell::Word(why)) = cells.last() {
                without_results += 1;
                fault.get_or_insert_with(|| why.clone());
            }
            also(&cells);
            parquet.push(cells)
        };
        let missing = self.each(write, folder)?;
        csv.commit()?;
        times.map_or(Ok(()), OutputFile::commit)?;
        parquet.finish().map_err(failed)?.commit()?;
        Ok(WrittenTable {
            missing,
            without_results,
            fault: fault.filter(|_| without_results == rows),
        })
    }
}

/// What stands in a table that has been written.
#[derive(Debug, Clone, PartialEq, Eq)]
#[non_exhaustive]
pub struct WrittenTable {
    /// Points that have no row.
    pub missing: u64,
    /// Rows that say why there is no result.
    pub without_results: u64,
    /// Why the first row has no result, if no row has one.
    pub fault: Option<String>,
}

impl WrittenTable {
    /// Complains of a study whose settings are wrong at every point.
    ///
    /// # Errors
    /// Why the first point has no result, if no point has one.
    pub fn check(&self, study: &Study) -> Result<(), InputError> {
        match &self.fault {
            Some(why) => {
                let message = format!("no point has a result: {why}");
                Err(InputError::new(&study.name, message))
            }
            None => Ok(()),
        }
    }
}

fn write_line<C: std::borrow::Borrow<TableCell>>(
    out: &mut impl io::Write,
    cells: impl IntoIterator<Item = C>,
) -> io::Result<()> {
    for (column, cell) in cells.into_iter().enumerate() {
        if column > 0 {
            out.write_all(b",")?;
        }
        out.write_all(cell.borrow().csv().as_bytes())?;
    }
    out.write_all(b"\n")
}
