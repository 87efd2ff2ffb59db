//! Scenes as objects of Python.

use std::path::PathBuf;

use guided_dtof::request::Sources;
use guided_dtof::scene::{GroundTruth, Scene as World};
use guided_dtof::settings::Document;
use numpy::PyArray2;
use pyo3::prelude::*;
use pyo3::types::{PyDict, PyTuple};
use toml::Table;

use crate::arrays::map;
use crate::background::run;
use crate::failure::Failure;
use crate::values::{
    assignments, hash_of, html_of, item, reassigned, table_to_python, to_table, value_at, warn_of,
};

/// A scene: one that is built in, a file, and single keys of it.
///
/// Scene()                                        the street
/// Scene("van", {"lidar.pde": 0.2})               a built-in scene: street, warehouse, van, fog, glass, sweep, night or empty
/// Scene("my_street.toml", {"object.car.reflectivity": "10 %"})
///
/// Keys are those of `gdtof scene`, with dots; objects go by their name, or their number from 1. A scene cannot be changed: `with_`
/// makes another one.
///
/// Raises InputError for what cannot be.
#[pyclass(frozen, module = "gdtof")]
#[derive(Clone)]
pub(crate) struct Scene {
    pub(crate) world: World,
    #[pyo3(get)]
    pub(crate) name: String,
}

/// Most objects that `repr` names.
const NAMED: usize = 5;

impl Scene {
    pub(crate) fn or_default(scene: Option<&Bound<'_, Self>>) -> World {
        scene.map_or_else(World::outdoor, |scene| scene.get().world.clone())
    }

    /// What reports call it.
    pub(crate) fn name_or_default(scene: Option<&Bound<'_, Self>>) -> String {
        let usual = || Sources::default().scene_name();
        scene.map_or_else(usual, |scene| scene.get().name.clone())
    }

    fn table(&self) -> Table {
        Table::try_from(&self.world).expect("a scene is numbers and texts")
    }

    /// A scene as its user gave it, who is told of odd values.
    fn given(py: Python<'_>, world: World, name: String) -> PyResult<Self> {
        warn_of(py, &name, &world.remarks(), 1)?;
        Ok(Scene { world, name })
    }
}

#[pymethods]
impl Scene {
    #[new]
    #[pyo3(signature = (source=None, keys=None, /))]
    fn new(
        py: Python<'_>,
        source: Option<PathBuf>,
        keys: Option<&Bound<'_, PyDict>>,
    ) -> PyResult<Self> {
        let sources = Sources {
            scene: source,
            set: assignments("scene.", "Scene", keys)?,
            ..Sources::default()
        };
        let (_, world) = sources.read().map_err(Failure::from)?;
        Self::given(py, world, sources.scene_name())
    }

    /// A scene from the text of a scene file (TOML); files that it names are relative to the current folder.
    #[staticmethod]
    #[pyo3(signature = (text, name="scene"))]
    fn from_toml(py: Python<'_>, text: &str, name: &str) -> PyResult<Self> {
        let world = World::parse(name, text).map_err(Failure::from)?;
        Self::given(py, world, name.to_owned())
    }

    /// A scene from a dict of sections, as `to_dict` gives it; keys that it leaves out have the defaults of a scene file, and files that it
    /// names are relative to the current folder.
    #[staticmethod]
    #[pyo3(signature = (sections, name="scene"))]
    fn from_dict(py: Python<'_>, sections: &Bound<'_, PyDict>, name: &str) -> PyResult<Self> {
        let document = Document::from_table(name, to_table(sections)?);
        let world = World::read(&document).map_err(Failure::from)?;
        Self::given(py, world, name.to_owned())
    }

    /// The same scene with other keys.
    #[pyo3(signature = (keys, /))]
    fn with_(&self, py: Python<'_>, keys: &Bound<'_, PyDict>) -> PyResult<Self> {
        let document = reassigned(&self.name, self.table(), Some(keys))?;
        let world = World::read(&document).map_err(Failure::from)?;
        Self::given(py, world, self.name.clone())
    }

    /// All keys and their values, section by section; `from_dict` reads it.
    fn to_dict<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyDict>> {
        table_to_python(py, &self.table())
    }

    /// A scene file, every key with its unit, range and source.
    fn to_toml(&self) -> String {
        self.world.commented()
    }

    /// What is really there for an array of macropixels, at a time of the scene: distances along the ray (not z), m,
    /// shape (rows, cols), NaN for the sky.
    #[pyo3(signature = (rows=64, cols=64, time_s=0.0))]
    fn truth<'py>(
        &self,
        py: Python<'py>,
        rows: u32,
        cols: u32,
        time_s: f64,
    ) -> PyResult<Bound<'py, PyArray2<f64>>> {
        let world = self.world.clone();
        let truth = run(py, None, move |_| {
            Ok(GroundTruth::render(&world.snapshot(time_s), rows, cols))
        })?;
        let metres = truth.range_m.iter().map(|m| m.unwrap_or(f64::NAN));
        Ok(map(py, (rows as usize, cols as usize), metres.collect()))
    }

    fn __getitem__<'py>(&self, py: Python<'py>, key: &str) -> PyResult<Bound<'py, PyAny>> {
        item(py, key, value_at(&self.table(), key))
    }

    fn __eq__(&self, other: &Bound<'_, PyAny>) -> bool {
        let other = other.cast::<Self>();
        other.is_ok_and(|other| other.get().world == self.world)
    }

    fn __hash__(&self) -> u64 {
        hash_of(&self.table())
    }

    fn __repr__(&self) -> String {
        let objects = &self.world.objects;
        let first = objects.iter().take(NAMED).map(|o| o.name.as_str());
        let first = first.collect::<Vec<&str>>().join(", ");
        let more = match objects.len().saturating_sub(NAMED) {
            0 => String::new(),
            more => format!(" and {more} more"),
        };
        format!("<Scene {}: {first}{more}>", self.name)
    }

    fn _repr_html_(&self, py: Python<'_>) -> PyResult<String> {
        html_of(py, format!("Scene {}", self.name), &self.table())
    }

    fn __reduce__<'py>(
        &self,
        py: Python<'py>,
    ) -> PyResult<(Bound<'py, PyAny>, Bound<'py, PyTuple>)> {
        let make = py.get_type::<Self>().getattr("from_toml")?;
        Ok((
            make,
            PyTuple::new(py, [self.world.commented(), self.name.clone()])?,
        ))
    }
}
