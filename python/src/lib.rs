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

use guided_dtof::ranging::WalkLeft;
use guided_dtof::report::DEPTH_COLOURS;
use guided_dtof::system::{NoDepth, frame_scale_m};
use pyo3::prelude::*;
use pyo3::types::PyTuple;

/// Depths at the ends of a frame's colour scale, m.
#[pyfunction]
#[pyo3(signature = (depths_m, /))]
fn depth_scale_m(depths_m: Vec<f64>) -> (f32, f32) {
    frame_scale_m(depths_m)
}

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
    use super::depth_scale_m;
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
        let categories = NoDepth::categories();
        let reasons = categories.map(|category| category.name);
        module.add("REASONS", PyTuple::new(module.py(), reasons)?)?;
        let walks = WalkLeft::ALL.map(WalkLeft::name);
        module.add("WALKS_LEFT", PyTuple::new(module.py(), walks)?)?;
        let patterns = categories.map(|category| category.pattern.levels().map(<[u8; 4]>::into));
        let patterns = patterns.map(|rows: [(u8, u8, u8, u8); 4]| <(_, _, _, _)>::from(rows));
        module.add("PATTERNS", PyTuple::new(module.py(), patterns)?)?;
        let colours = DEPTH_COLOURS.map(<(u8, u8, u8)>::from);
        module.add("DEPTH_COLOURS", PyTuple::new(module.py(), colours)?)?;
        module.add("__version__", env!("CARGO_PKG_VERSION"))
    }
}
