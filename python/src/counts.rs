//! Depths from histograms of whatever origin.

use std::path::PathBuf;

use guided_dtof::ranging::{DepthOptions, WalkLeft};
use guided_dtof::request::{Spelling, check_false_alarm_rate, guided_exposure, read_calibration};
use guided_dtof::system::{self, NoDepth};
use numpy::PyReadonlyArrayDyn;
use pyo3::prelude::*;
use pyo3::types::PyDict;

use crate::arrays::{map, set_returns, starts as start_values, values};
use crate::background::run;
use crate::failure::Failure;
use crate::scene::Scene;
use crate::sensor::Sensor;

/// Finds depths; see `gdtof.range`.
#[pyfunction]
#[expect(
    clippy::too_many_arguments,
    reason = "gdtof.range gives them their names"
)]
pub(crate) fn range_counts<'py>(
    py: Python<'py>,
    sensor: Option<&Bound<'py, Sensor>>,
    scene: Option<&Bound<'py, Scene>>,
    histograms: PyReadonlyArrayDyn<'py, u16>,
    starts: PyReadonlyArrayDyn<'py, i64>,
    periods: (u32, u32),
    false_alarm_rate: f64,
    correct_walk: bool,
    calibration: Option<PathBuf>,
) -> PyResult<Bound<'py, PyDict>> {
    let (sensor, world) = (Sensor::or_default(sensor), Scene::or_default(scene));
    let shape = (sensor.rows, sensor.cols);
    let counts = values("histograms", &histograms, &[shape.0, shape.1, sensor.bins])?;
    let starts = start_values(&starts, &[shape.0, shape.1], sensor.largest_start())?;
    let exposure = guided_exposure(&sensor, periods.0, periods.1, Spelling::Keys);
    let exposure = exposure.map_err(Failure::from)?;
    check_false_alarm_rate(false_alarm_rate, Spelling::Keys).map_err(Failure::from)?;
    let options = DepthOptions {
        false_alarm_rate,
        correct_walk,
        ..DepthOptions::default()
    };
    system::check_counts("histograms", (&sensor, &exposure), &counts).map_err(Failure::from)?;
    let readings = run(py, None, move |_| {
        let profile = calibration
            .map(|path| read_calibration(&path, &sensor))
            .transpose()?;
        let chip = (&sensor, &exposure);
        Ok(system::range_counts(
            chip,
            &world,
            &options,
            profile.as_ref(),
            &starts,
            &counts,
        )?)
    })?;
    let dict = PyDict::new(py);
    let metres = |distance: fn(&system::Reading) -> Option<f64>| {
        map(
            py,
            shape,
            readings
                .iter()
                .map(|r| distance(r).unwrap_or(f64::NAN))
                .collect(),
        )
    };
    dict.set_item("depth", metres(|r| r.measured_m))?;
    dict.set_item("bound", metres(|r| r.bound_m))?;
    dict.set_item("spread", metres(|r| r.spread_m))?;
    set_returns(&dict, shape, || readings.iter().map(|r| &r.returns))?;
    dict.set_item("peak", metres(|r| r.peak_m))?;
    dict.set_item("confidence", metres(|r| r.confidence))?;
    let reasons = readings
        .iter()
        .map(|r| NoDepth::number(r.no_depth))
        .collect();
    dict.set_item("reason", map(py, shape, reasons))?;
    let walk_left = readings.iter().map(|r| WalkLeft::number(r.walk_left));
    dict.set_item("walk_left", map(py, shape, walk_left.collect()))?;
    Ok(dict)
}
