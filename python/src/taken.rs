//! A frame that was taken, as the files of `gdtof frame`.

use std::path::PathBuf;
use std::sync::LazyLock;

use guided_dtof::analysis::TimingVerdict;
use guided_dtof::chip::Silicon;
use guided_dtof::files::ResultSet;
use guided_dtof::request::{FrameReport, FrameRequest, write_frame};
use guided_dtof::system::{Frame, FrameSettings};
use numpy::{PyReadonlyArrayDyn, PyUntypedArrayMethods};
use pyo3::prelude::*;
use pyo3::types::PyTuple;

use crate::arrays::values;
use crate::background::run;
use crate::failure::Failure;

/// What frame.json says, and what the manifest says of it; both JSON.
type Report = (String, String);

/// What a frame's files say of it; see `gdtof.Frame.save`.
#[pyclass(frozen, module = "gdtof._gdtof", name = "Taken")]
pub(crate) struct FrameRecord {
    /// Made when it is asked for: most frames are never saved.
    report: LazyLock<Report, Box<dyn FnOnce() -> Report + Send + Sync>>,
}

impl FrameRecord {
    /// Of a frame without its histograms, which have gone to Python.
    pub(crate) fn new(
        scene_name: String,
        request: FrameRequest,
        settings: FrameSettings,
        frame: Frame,
    ) -> Self {
        let report = move || {
            let silicon = Silicon::new(&settings.sensor);
            let timing = TimingVerdict::analyse(&settings.sensor, &silicon, (0, 0)).report();
            let parts = (&request, &settings, &timing, &frame);
            let report =
                FrameReport::<()>::new(scene_name, parts.0, parts.1, parts.2, parts.3, None);
            let text = |json: serde_json::Result<String>| json.expect("a report is JSON");
            let configuration = serde_json::to_string(&report.configuration);
            (text(serde_json::to_string(&report)), text(configuration))
        };
        FrameRecord {
            report: LazyLock::new(Box::new(report)),
        }
    }
}

#[pymethods]
impl FrameRecord {
    #[new]
    fn unpickled(report: String, configuration: String) -> Self {
        FrameRecord {
            report: LazyLock::new(Box::new(|| (report, configuration))),
        }
    }

    /// Writes the files; a sentence for each of the user's own that was in their way.
    fn save(
        slf: Bound<'_, Self>,
        folder: PathBuf,
        histograms: PyReadonlyArrayDyn<'_, u16>,
    ) -> PyResult<Vec<String>> {
        let histograms = values("histograms", &histograms, histograms.shape())?;
        let (py, taken) = (slf.py(), slf.unbind());
        run(py, None, move |watch| {
            let (report, configuration) = &*taken.get().report;
            watch.check()?;
            let set = ResultSet::begin(&folder, "frame")?;
            write_frame(set.staging(), report, &histograms)?;
            let configuration: serde_json::Value =
                serde_json::from_str(configuration).map_err(|e| Failure::Input(e.to_string()))?;
            Ok(set.commit(configuration)?)
        })
    }

    fn __reduce__<'py>(
        slf: &Bound<'py, Self>,
    ) -> PyResult<(Bound<'py, PyAny>, Bound<'py, PyTuple>)> {
        let py = slf.py();
        let (report, configuration) = &*slf.get().report;
        let class = py.get_type::<Self>().into_any();
        Ok((class, PyTuple::new(py, [report, configuration])?))
    }
}
