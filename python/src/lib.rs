//! `gdtof._gdtof`: what the Python package asks of the library.
//!
//! ```text
//!   python/gdtof/*.py  ──keys and arrays──►  here  ──requests──►  guided_dtof
//!   arrays, dicts      ◄──moved, not copied──┘ └─ on a thread of its own, GIL released, signals polled
//! ```
//!
//! It is a thin layer. Requests are the library's own ([`guided_dtof::request`]), so that the command line and Python take
//! the same road; results leave as NumPy arrays that own the library's vectors. What users see of it is in
//! `python/gdtof/`.

mod arrays;
mod background;
mod counts;
mod detector;
mod drive;
mod failure;
mod frame;
mod guide;
mod light;
mod photons;
mod propose;
mod replay;
mod scene;
mod sensor;
mod sweep;
mod taken;
mod theory;
mod timing;
mod values;

use guided_dtof::system::NoDepth;
use pyo3::prelude::*;
use pyo3::types::PyTuple;

/// What the package `gdtof` is made on.
#[pymodule]
mod _gdtof {
    use super::*;

    #[pymodule_export]
    use super::drive::Drive;
    #[pymodule_export]
    use super::guide::Guide;
    #[pymodule_export]
    use super::propose::Problem;
    #[pymodule_export]
    use super::scene::Scene;
    #[pymodule_export]
    use super::sensor::Sensor;
    #[pymodule_export]
    use super::taken::FrameRecord;

    #[pymodule_export]
    use super::counts::range_counts;
    #[pymodule_export]
    use super::detector::{
        detector_agreement, detector_checked, detector_crosstalk, detector_expected, detector_file,
        detector_range,
    };
    #[pymodule_export]
    use super::frame::frame;
    #[pymodule_export]
    use super::light::expose;
    #[pymodule_export]
    use super::photons::{light, photons};
    #[pymodule_export]
    use super::replay::replay;
    #[pymodule_export]
    use super::sweep::{sweep_outline, sweep_part, sweep_table, sweep_text};
    #[pymodule_export]
    use super::theory::{confidence, theory};
    #[pymodule_export]
    use super::timing::{bin_edges, starts_for, timing, windows};

    #[pymodule_init]
    fn init(module: &Bound<'_, PyModule>) -> PyResult<()> {
        let reasons = NoDepth::ALL.map(NoDepth::name);
        module.add("REASONS", PyTuple::new(module.py(), reasons)?)?;
        module.add("__version__", env!("CARGO_PKG_VERSION"))
    }
}
