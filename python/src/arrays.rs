//! Arrays that come and go. What goes owns the vector that the library made: nothing is copied.

use guided_dtof::system::{DepthReturn, DepthReturns, RETURNS};
use numpy::ndarray::{Array2, Array3};
use numpy::{Element, IntoPyArray, PyArray2, PyArray3, PyReadonlyArrayDyn, PyUntypedArrayMethods};
use pyo3::prelude::*;
use pyo3::types::PyDict;

use crate::failure::Failure;

/// A map, row-major, as an array of its shape.
pub(crate) fn map<T: Element>(
    py: Python<'_>,
    (rows, cols): (usize, usize),
    values: Vec<T>,
) -> Bound<'_, PyArray2<T>> {
    let array = Array2::from_shape_vec((rows, cols), values).expect("one of each macropixel");
    array.into_pyarray(py)
}

/// The same of something with several values for each macropixel.
pub(crate) fn cube<T: Element>(
    py: Python<'_>,
    (rows, cols, depth): (usize, usize, usize),
    values: Vec<T>,
) -> Bound<'_, PyArray3<T>> {
    let array = Array3::from_shape_vec((rows, cols, depth), values);
    array.expect("as many of each macropixel").into_pyarray(py)
}

/// Sets the arrays of an array's returns: rows × columns × as many as are told, not a number where there are fewer.
pub(crate) fn set_returns<'r, I: Iterator<Item = &'r DepthReturns>>(
    dict: &Bound<'_, PyDict>,
    (rows, cols): (usize, usize),
    of_pixels: impl Fn() -> I,
) -> PyResult<()> {
    for (name, number) in [
        (
            "returns",
            (|r| Some(r.depth_m)) as fn(&DepthReturn) -> Option<f64>,
        ),
        ("returns_bound", |r| r.bound_m),
        ("returns_photons", |r| Some(r.photons)),
    ] {
        let all = of_pixels().flat_map(|of| of.numbers(number)).collect();
        dict.set_item(name, cube(dict.py(), (rows, cols, RETURNS), all))?;
    }
    Ok(())
}

/// The values of an array that must have this shape, row-major.
///
/// # Errors
/// When it has another one.
pub(crate) fn values<T: Element + Copy>(
    name: &str,
    array: &PyReadonlyArrayDyn<'_, T>,
    shape: &[usize],
) -> Result<Vec<T>, Failure> {
    if array.shape() != shape {
        return Err(Failure::argument(
            name,
            format!(
                "is an array of shape {:?}; give one of {shape:?}",
                array.shape()
            ),
        ));
    }
    Ok(array.as_array().iter().copied().collect())
}

/// Start values: −1 where SPADs are off.
///
/// # Errors
/// Another shape, and what is no start value.
pub(crate) fn starts(
    array: &PyReadonlyArrayDyn<'_, i64>,
    shape: &[usize],
    largest: u16,
) -> Result<Vec<Option<u16>>, Failure> {
    let start = |(at, start): (usize, i64)| match start {
        -1 => Ok(None),
        _ => match u16::try_from(start).ok().filter(|start| *start <= largest) {
            Some(start) => Ok(Some(start)),
            None => Err(Failure::argument(
                "starts",
                format!(
                    "{start} of macropixel {at} is not a start value; give 0 to {largest}, or -1 where SPADs are off"
                ),
            )),
        },
    };
    let starts = values("starts", array, shape)?;
    starts.into_iter().enumerate().map(start).collect()
}

/// A start value as an array has it.
pub(crate) fn of_start(start: Option<u16>) -> i32 {
    start.map_or(-1, i32::from)
}
