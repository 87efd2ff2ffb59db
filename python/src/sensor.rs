//! Sensors as objects of Python.

use std::path::PathBuf;

use guided_dtof::chip::sensors::{self, CHIPS};
use guided_dtof::chip::{Sensor as Chip, SensorConfig};
use guided_dtof::request::Sources;
use pyo3::exceptions::PyAttributeError;
use pyo3::prelude::*;
use pyo3::types::{PyDict, PyTuple};
use toml::{Table, Value};

use crate::failure::Failure;
use crate::values::{
    assignments, hash_of, html_of, item, reassigned, table_to_python, to_python, to_table, warn_of,
};

/// A sensor: a chip by name, a file, or keys.
///
/// Sensor()                                   the QuantIC4x4
/// Sensor("vcsel_flash", clk_hz="150 MHz")    a chip by name (vcsel_flash, hslidar, hslidar_delay_line), and a key of it
/// Sensor("my_chip.toml", rows=16, cols=16)   a file
///
/// Keys are those of `gdtof sensor`, which also lists their units and ranges; numbers may be texts with a unit. They are read as
/// attributes or by name, and cannot be changed: `with_` makes another sensor.
///
/// Raises InputError for what cannot be.
#[pyclass(frozen, module = "gdtof")]
#[derive(Clone)]
pub(crate) struct Sensor {
    pub(crate) chip: Chip,
}

impl Sensor {
    pub(crate) fn or_default(sensor: Option<&Bound<'_, Self>>) -> Chip {
        sensor.map_or_else(Chip::default, |sensor| sensor.get().chip.clone())
    }

    fn table(&self) -> Table {
        Table::try_from(&*self.chip).expect("numbers and words")
    }

    /// A sensor as its user gave it, who is told of odd values.
    fn given(py: Python<'_>, chip: impl Into<Chip>) -> PyResult<Self> {
        let chip = chip.into();
        warn_of(py, "the sensor", &chip.remarks(), 1)?;
        Ok(Sensor { chip })
    }
}

#[pymethods]
impl Sensor {
    #[new]
    #[pyo3(signature = (source=None, /, **keys))]
    fn new(
        py: Python<'_>,
        source: Option<PathBuf>,
        keys: Option<&Bound<'_, PyDict>>,
    ) -> PyResult<Self> {
        let sources = Sources {
            sensor: source,
            set: assignments("sensor.", "Sensor", keys)?,
            ..Sources::default()
        };
        Self::given(py, sources.read_sensor().map_err(Failure::from)?)
    }

    /// A sensor from the text of a sensor file (TOML); keys that it leaves out are the QuantIC4x4's.
    #[staticmethod]
    fn from_toml(py: Python<'_>, text: &str) -> PyResult<Self> {
        let config = SensorConfig::parse("sensor", text).map_err(Failure::from)?;
        Self::given(py, config)
    }

    /// A sensor from a dict, as `to_dict` gives it; keys that it leaves out are the QuantIC4x4's.
    #[staticmethod]
    fn from_dict(py: Python<'_>, keys: &Bound<'_, PyDict>) -> PyResult<Self> {
        let document = reassigned("sensor", to_table(keys)?, None)?;
        let config = SensorConfig::read_document(&document).map_err(Failure::from)?;
        Self::given(py, config)
    }

    /// The same sensor with other keys.
    #[pyo3(signature = (**keys))]
    fn with_(&self, py: Python<'_>, keys: Option<&Bound<'_, PyDict>>) -> PyResult<Self> {
        let document = reassigned("the sensor", self.table(), keys)?;
        let config = SensorConfig::read_document(&document).map_err(Failure::from)?;
        Self::given(py, config)
    }

    /// All keys and their values; `from_dict` reads it.
    fn to_dict<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyDict>> {
        table_to_python(py, &self.table())
    }

    /// A sensor file, every key with its unit, range and source.
    fn to_toml(&self) -> String {
        self.chip.commented()
    }

    /// Names of all keys.
    fn keys(&self) -> Vec<String> {
        self.table().keys().cloned().collect()
    }

    /// Rows and columns of macropixels, and bins of each.
    #[getter]
    fn shape(&self) -> (usize, usize, usize) {
        (self.chip.rows, self.chip.cols, self.chip.bins)
    }

    /// The largest start value of its P-counter.
    #[getter]
    fn largest_start(&self) -> u16 {
        self.chip.largest_start()
    }

    fn __getitem__<'py>(&self, py: Python<'py>, key: &str) -> PyResult<Bound<'py, PyAny>> {
        item(py, key, self.table().get(key))
    }

    fn __getattr__<'py>(&self, py: Python<'py>, key: &str) -> PyResult<Bound<'py, PyAny>> {
        match self.table().get(key) {
            Some(value) => to_python(py, value),
            None => Err(PyAttributeError::new_err(format!(
                "a sensor has no key {key:?}; Sensor.keys() lists all"
            ))),
        }
    }

    fn __dir__(&self, py: Python<'_>) -> PyResult<Vec<String>> {
        let mut names: Vec<String> = (py.get_type::<Self>().dir()?.iter())
            .map(|name| name.extract())
            .collect::<PyResult<_>>()?;
        names.extend(self.keys());
        Ok(names)
    }

    fn __eq__(&self, other: &Bound<'_, PyAny>) -> bool {
        let other = other.cast::<Self>();
        other.is_ok_and(|other| other.get().chip == self.chip)
    }

    fn __hash__(&self) -> u64 {
        hash_of(&self.table())
    }

    /// The call that makes it, from the chip that it shares most keys with.
    fn __repr__(&self) -> String {
        let own = self.table();
        let arguments_after = |chip: &sensors::Chip| {
            let usual = Table::try_from(&*(chip.sensor)()).expect("numbers and words");
            let is_other = |(key, value): &(&String, &Value)| usual.get(*key) != Some(*value);
            let keys = own.iter().filter(is_other).map(|(key, value)| match value {
                Value::Boolean(true) => format!("{key}=True"),
                Value::Boolean(false) => format!("{key}=False"),
                value => format!("{key}={value}"),
            });
            let is_default = chip.name == CHIPS[0].name;
            let name = (!is_default).then(|| format!("{:?}", chip.name));
            name.into_iter().chain(keys).collect::<Vec<String>>()
        };
        let calls = CHIPS.iter().map(arguments_after);
        let shortest = calls.min_by_key(Vec::len).unwrap_or_default();
        format!("Sensor({})", shortest.join(", "))
    }

    fn _repr_html_(&self, py: Python<'_>) -> PyResult<String> {
        html_of(py, "Sensor".to_owned(), &self.table())
    }

    fn __reduce__<'py>(
        &self,
        py: Python<'py>,
    ) -> PyResult<(Bound<'py, PyAny>, Bound<'py, PyTuple>)> {
        let make = py.get_type::<Self>().getattr("from_toml")?;
        Ok((make, PyTuple::new(py, [self.chip.commented()])?))
    }
}
