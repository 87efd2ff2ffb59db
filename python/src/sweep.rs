//! Sweeps: parts of a study, and its table.

use std::path::{Path, PathBuf};

use guided_dtof::files::{InputError, ResultSet};
use guided_dtof::sweep::{
    Results, Shard, Study, SweepError, WrittenTable, run as take_points, study_of,
};
use pyo3::prelude::*;
use pyo3::types::PyDict;

use crate::background::run;
use crate::failure::Failure;
use crate::values::{by_json, to_text, warn_of};

impl From<SweepError> for Failure {
    fn from(error: SweepError) -> Self {
        match error {
            SweepError::Input(error) => error.into(),
            SweepError::Frame(error) => error.into(),
            SweepError::Stopped => Failure::Stopped,
        }
    }
}

/// Reads a study: the file, or `text` as if it stood there.
///
/// # Errors
/// What cannot be in it; of a text without lines, which nobody has seen.
fn read(study: &Path, text: Option<&str>) -> Result<Study, InputError> {
    let Some(text) = text else {
        return Study::load(study);
    };
    let folder = study.parent().unwrap_or(Path::new(""));
    Study::parse("study", text, folder, "study").map_err(|mut fault| {
        fault.line = None;
        fault.further.iter_mut().for_each(|other| other.line = None);
        fault
    })
}

/// A dict as the text of a study file.
#[pyfunction]
pub(crate) fn sweep_text(study: &Bound<'_, PyDict>) -> PyResult<String> {
    to_text(study)
}

/// Points of a study, its folder for results and its name.
#[pyfunction]
pub(crate) fn sweep_outline(
    py: Python<'_>,
    study: PathBuf,
    text: Option<&str>,
) -> PyResult<(u64, PathBuf, String)> {
    let study = read(&study, text).map_err(Failure::from)?;
    warn_of(py, "the study", &study.remarks(), 2)?;
    Ok((study.len(), study.out.clone(), study.name))
}

/// Takes a part of a study on `threads` threads, 0 for all; see `gdtof.sweep`.
#[pyfunction]
pub(crate) fn sweep_part<'py>(
    py: Python<'py>,
    study: PathBuf,
    text: Option<String>,
    folder: PathBuf,
    shard: (u64, u64),
    threads: usize,
    progress: Option<&Bound<'py, PyAny>>,
) -> PyResult<Bound<'py, PyAny>> {
    let outcome = run(py, progress, move |watch| {
        let study = read(&study, text.as_deref())?;
        let shard = Shard {
            part: shard.0,
            parts: shard.1,
        };
        let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build();
        let pool = pool.map_err(|why| Failure::Simulation(why.to_string()))?;
        let done = |points: u64| watch.done(points as usize);
        Ok(pool.install(|| take_points(&study, &folder, shard, done))?)
    })?;
    by_json(py, &outcome)
}

/// Writes the table of all rows in a folder; how many points have none, and how many of the rows have no result.
///
/// # Errors
/// Why the first point has no result, if no point has one.
#[pyfunction]
pub(crate) fn sweep_table<'py>(py: Python<'py>, folder: PathBuf) -> PyResult<Bound<'py, PyDict>> {
    let written = run(py, None, move |_| Ok(write(&folder)?))?;
    let dict = PyDict::new(py);
    dict.set_item("missing", written.missing)?;
    dict.set_item("without_results", written.without_results)?;
    Ok(dict)
}

fn write(folder: &Path) -> Result<WrittenTable, SweepError> {
    let study = study_of(folder)?;
    let set = ResultSet::begin(folder, "sweep")?;
    let results = Results::read(&study, &[folder.to_owned()])?;
    let written = results.write(set.staging(), |_| ())?;
    let configuration = serde_json::json!({
        "study": study.text(),
        "points": study.len() - written.missing,
    });
    set.commit(configuration)?;
    if written.missing == 0 {
        written.check(&study)?;
    }
    Ok(written)
}
