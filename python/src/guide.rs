//! Guides as objects of Python: by name, or maps of one's own.

use std::hash::{DefaultHasher, Hash, Hasher};
use std::sync::Arc;

use guided_dtof::guide::{
    BehaviouralStereo, FileMap, Fused, Guide as Estimates, GuideInput, MOST_GUIDES, options,
};
use numpy::{PyArray2, PyReadonlyArrayDyn, PyUntypedArrayMethods};
use pyo3::IntoPyObjectExt;
use pyo3::prelude::*;
use pyo3::types::{PyString, PyTuple};

use crate::arrays::{map, values};
use crate::background::run;
use crate::failure::Failure;
use crate::scene::Scene;

/// A map of one's own.
#[derive(Clone)]
struct Map {
    shape: (usize, usize),
    range_m: Vec<f64>,
    sigma_m: Vec<f64>,
}

/// One of the guides that are fused.
#[derive(Clone)]
enum Part {
    Named(String),
    Map(Arc<Map>),
}

/// What tells where targets roughly are.
///
/// Guide()                              the scene's camera pair, with drawn errors
/// Guide("radar:range_sigma_m=0.2")     another one, with its keys, as `gdtof frame --guide` takes it
/// Guide("stereo", "radar")             several, fused by their variances
/// Guide.from_map(metres, sigma_m=0.5)  a map of one's own
///
/// Guides are equal when they say the same, however they are written: Guide() == Guide("stereo"), and a key at its default is as good as
/// none.
///
/// Raises InputError for what is no guide.
#[pyclass(frozen, module = "gdtof")]
pub(crate) struct Guide {
    parts: Vec<Part>,
    pub(crate) guide: Arc<dyn Estimates>,
}

impl Guide {
    pub(crate) fn or_default(guide: Option<&Bound<'_, Self>>) -> Arc<dyn Estimates> {
        guide.map_or_else(
            || Arc::new(BehaviouralStereo) as Arc<dyn Estimates>,
            |guide| guide.get().guide.clone(),
        )
    }

    /// Its parts as frame.json has them; none for the scene's camera pair.
    pub(crate) fn texts(&self) -> Vec<String> {
        let text = |part: &Part| match part {
            Part::Named(text) => text.clone(),
            Part::Map(map) => format!("map of {}x{}", map.shape.0, map.shape.1),
        };
        self.parts.iter().map(text).collect()
    }

    /// All that it does follows from this: what it is, with every key, and every value of maps.
    fn debug_text(&self) -> String {
        format!("{:?}", self.guide)
    }

    fn from_parts(parts: Vec<Part>) -> Result<Self, Failure> {
        if parts.len() > MOST_GUIDES {
            let message = format!("{} guides; give 1 to {MOST_GUIDES}", parts.len());
            return Err(Failure::argument("guide", message));
        }
        let guides = parts.iter().map(|part| match part {
            Part::Named(text) => Ok(options::parse(text, "guide")?),
            Part::Map(map) => map.guide(),
        });
        let mut guides = guides.collect::<Result<Vec<_>, Failure>>()?;
        let guide: Arc<dyn Estimates> = match guides.len() {
            0 => Arc::new(BehaviouralStereo),
            1 => guides.swap_remove(0),
            _ => Arc::new(Fused::new(guides)),
        };
        Ok(Guide { parts, guide })
    }
}

impl Map {
    fn guide(&self) -> Result<Arc<dyn Estimates>, Failure> {
        let pairs = self.range_m.iter().zip(&self.sigma_m);
        let estimate = |(at, (&range_m, &sigma_m)): (usize, (&f64, &f64))| {
            if range_m == 0.0 || !range_m.is_finite() || !sigma_m.is_finite() {
                return Ok(None);
            }
            let wrong = |name: &str, value: f64| {
                let (row, col) = (at / self.shape.1, at % self.shape.1);
                let message =
                    format!("{value} in row {row}, column {col} is no length; give metres");
                Err(Failure::argument(name, message))
            };
            match (range_m > 0.0, sigma_m >= 0.0) {
                (true, true) => Ok(Some((range_m, sigma_m))),
                (false, _) => wrong("range_m", range_m),
                (_, false) => wrong("sigma_m", sigma_m),
            }
        };
        let estimates = pairs.enumerate().map(estimate).collect::<Result<_, _>>()?;
        Ok(Arc::new(FileMap::new("guide", self.shape, estimates)))
    }
}

#[pymethods]
impl Guide {
    #[new]
    #[pyo3(signature = (*guides))]
    fn new(guides: &Bound<'_, PyTuple>) -> PyResult<Self> {
        let mut parts = Vec::new();
        for guide in guides {
            match guide.cast::<Self>() {
                Ok(guide) => parts.extend(guide.get().parts.iter().cloned()),
                Err(_) => parts.push(Part::Named(guide.cast::<PyString>()?.extract()?)),
            }
        }
        Ok(Guide::from_parts(parts)?)
    }

    /// A map of one's own: distances along the ray, m, shape (rows, cols), NaN, infinite, 0 or masked where there is no estimate; `sigma_m` is the
    /// standard deviation that it claims for itself, m, a number or an array of the same shape.
    #[staticmethod]
    #[pyo3(signature = (range_m, sigma_m=None))]
    fn from_map<'py>(
        py: Python<'py>,
        range_m: Bound<'py, PyAny>,
        sigma_m: Option<Bound<'py, PyAny>>,
    ) -> PyResult<Self> {
        let numpy = py.import("numpy")?;
        // What is masked has no value.
        let masked = numpy.getattr("ma")?;
        let real = |values: Bound<'py, PyAny>| {
            let values = masked.call_method1("asarray", (values, "float64"))?;
            values.call_method1("filled", (f64::NAN,))
        };
        let range_m = real(range_m)?.extract::<PyReadonlyArrayDyn<'_, f64>>()?;
        let &[rows, cols] = range_m.shape() else {
            let message = format!(
                "is an array of shape {:?}; give rows and columns",
                range_m.shape()
            );
            return Err(Failure::argument("range_m", message).into());
        };
        let sigma_m = match sigma_m {
            None => 1.0.into_bound_py_any(py)?,
            Some(sigma_m) => real(sigma_m)?,
        };
        let sigma_m = match sigma_m.extract::<f64>() {
            Ok(same) => vec![same; rows * cols],
            Err(_) => values("sigma_m", &sigma_m.extract()?, &[rows, cols])?,
        };
        let own = Map {
            shape: (rows, cols),
            sigma_m,
            range_m: values("range_m", &range_m, &[rows, cols])?,
        };
        Ok(Guide::from_parts(vec![Part::Map(Arc::new(own))])?)
    }

    /// What it is.
    #[getter]
    fn name(&self) -> String {
        self.guide.name().to_owned()
    }

    /// Its estimate for an array of macropixels: distances along the ray, NaN where it has none, and the standard deviation that it
    /// claims for them, infinite there; both m, shape (rows, cols).
    #[pyo3(signature = (scene=None, rows=64, cols=64, seed=1))]
    #[expect(clippy::type_complexity, reason = "a pair of maps")]
    fn estimate<'py>(
        &self,
        py: Python<'py>,
        scene: Option<&Bound<'py, Scene>>,
        rows: u32,
        cols: u32,
        seed: u64,
    ) -> PyResult<(Bound<'py, PyArray2<f64>>, Bound<'py, PyArray2<f64>>)> {
        let (guide, world) = (self.guide.clone(), Scene::or_default(scene));
        let found = run(py, None, move |_| {
            Ok(guide.estimate(&GuideInput::still(&world, rows, cols, seed))?)
        })?;
        let metres = found
            .range_m
            .iter()
            .map(|m| m.unwrap_or(f64::NAN))
            .collect();
        let shape = (rows as usize, cols as usize);
        Ok((map(py, shape, metres), map(py, shape, found.sigma_m)))
    }

    fn __eq__(&self, other: &Bound<'_, PyAny>) -> bool {
        let other = other.cast::<Self>();
        other.is_ok_and(|other| {
            let other = other.get();
            Arc::ptr_eq(&self.guide, &other.guide) || self.debug_text() == other.debug_text()
        })
    }

    fn __hash__(&self) -> u64 {
        let mut hasher = DefaultHasher::new();
        self.debug_text().hash(&mut hasher);
        hasher.finish()
    }

    fn __repr__(&self) -> String {
        let part = |part: &Part| match part {
            Part::Named(text) => format!("{text:?}"),
            Part::Map(map) => format!("<map of {}x{}>", map.shape.0, map.shape.1),
        };
        let parts: Vec<String> = self.parts.iter().map(part).collect();
        format!("Guide({})", parts.join(", "))
    }

    fn __reduce__<'py>(
        &self,
        py: Python<'py>,
    ) -> PyResult<(Bound<'py, PyAny>, Bound<'py, PyTuple>)> {
        let class = py.get_type::<Self>();
        if let [Part::Map(own)] = &self.parts[..] {
            let maps =
                [own.range_m.clone(), own.sigma_m.clone()].map(|values| map(py, own.shape, values));
            return Ok((class.getattr("from_map")?, PyTuple::new(py, maps)?));
        }
        let parts = self.parts.iter().map(|part| match part {
            Part::Named(text) => Ok(PyString::new(py, text).into_any()),
            Part::Map(_) => Ok(Bound::new(py, Guide::from_parts(vec![part.clone()])?)?.into_any()),
        });
        let parts = parts.collect::<PyResult<Vec<_>>>()?;
        Ok((class.into_any(), PyTuple::new(py, parts)?))
    }
}
