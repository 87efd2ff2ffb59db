//! Light without a chip, and its pulses.

use guided_dtof::photon::SpadEvent;
use guided_dtof::photons::LightSource;
use guided_dtof::request::{LightRequest, Spelling};
use guided_dtof::units::Time;
use numpy::IntoPyArray;
use pyo3::prelude::*;
use pyo3::types::PyDict;

use crate::arrays::map;
use crate::background::run;
use crate::failure::Failure;
use crate::scene::Scene;
use crate::sensor::Sensor;

/// Pulses that are held in memory at most: 17 bytes each.
const MOST_PULSES: f64 = 1e9;

/// The means of the light on every macropixel; see `gdtof.light`.
#[pyfunction]
pub(crate) fn light<'py>(
    py: Python<'py>,
    sensor: Option<&Bound<'py, Sensor>>,
    scene: Option<&Bound<'py, Scene>>,
    spads: Option<usize>,
    fov_deg: Option<f64>,
) -> PyResult<Bound<'py, PyDict>> {
    let (chip, world) = (Sensor::or_default(sensor), Scene::or_default(scene));
    let request = LightRequest {
        laser_cycles: 1,
        spads,
        fov_deg,
        spelling: Spelling::Keys,
        ..LightRequest::default()
    };
    let source = run(py, None, move |_| Ok(request.source(chip, world)?))?;
    let size = (source.rows, source.cols);
    let facts: Vec<_> = (0..source.pixels() as u32)
        .map(|pixel| source.facts(pixel))
        .collect();
    let or_nan = |number: Option<f64>| number.unwrap_or(f64::NAN);
    let dict = PyDict::new(py);
    for (name, values) in [
        ("signal", facts.iter().map(|of| of.signal).collect()),
        (
            "background_hz",
            facts.iter().map(|of| of.background_hz).collect(),
        ),
        (
            "arrival_ns",
            (facts.iter())
                .map(|of| or_nan(of.arrival.map(Time::as_ns)))
                .collect(),
        ),
        (
            "truth_m",
            facts.iter().map(|of| or_nan(of.truth_m)).collect(),
        ),
    ] {
        let values: Vec<f64> = values;
        dict.set_item(name, map(py, size, values))?;
    }
    dict.set_item("spads", source.exposure.layout.spads())?;
    dict.set_item("pulse_ns", source.pulse_width().as_ns())?;
    Ok(dict)
}

/// Pulses as columns.
#[derive(Default)]
struct Columns {
    time_fs: Vec<i64>,
    laser_cycle: Vec<u32>,
    row: Vec<u16>,
    col: Vec<u16>,
    spad: Vec<u8>,
}

impl Columns {
    /// Adds pulses of a macropixel, in the order of their times; those before them of the same one ended with laser cycle `cycle`.
    fn extend(&mut self, source: &LightSource, pixel: u32, pulses: &[SpadEvent], cycle: &mut u32) {
        let (row, col) = source.position(pixel);
        for pulse in pulses {
            while source.cycle_start(*cycle + 1) <= pulse.time {
                *cycle += 1;
            }
            self.time_fs.push(pulse.time.as_fs());
            self.laser_cycle.push(*cycle);
            self.row.push(row as u16);
            self.col.push(col as u16);
            self.spad.push(pulse.spad);
        }
    }
}

/// The pulses of an exposure; see `gdtof.Light.photons`.
#[pyfunction]
#[expect(
    clippy::too_many_arguments,
    reason = "gdtof.Light.photons gives them their names"
)]
pub(crate) fn photons<'py>(
    py: Python<'py>,
    sensor: Option<&Bound<'py, Sensor>>,
    scene: Option<&Bound<'py, Scene>>,
    spads: Option<usize>,
    fov_deg: Option<f64>,
    period_ns: Option<f64>,
    periods: (u32, u32),
    seed: u64,
    progress: Option<&Bound<'py, PyAny>>,
) -> PyResult<Bound<'py, PyDict>> {
    let (chip, world) = (Sensor::or_default(sensor), Scene::or_default(scene));
    let request = LightRequest {
        period_ns,
        stop_periods: periods.0,
        laser_cycles: periods.1,
        seed,
        spads,
        fov_deg,
        spelling: Spelling::Keys,
    };
    let columns = run(py, progress, move |watch| {
        let source = request.source(chip, world)?;
        let pixels: Vec<u32> = (0..source.pixels() as u32).collect();
        let pulses: f64 = pixels.iter().map(|p| source.expected_pulses(*p)).sum();
        if pulses > MOST_PULSES {
            let message = format!(
                "about {pulses:.1e} pulses do not fit into memory; give fewer laser cycles or macropixels, or write files with `gdtof photons`"
            );
            return Err(Failure::argument("laser_cycles", message));
        }
        let mut columns = Columns::default();
        let (mut last, mut cycle) = (None, 0);
        let each = |pixel, pulses: &[SpadEvent]| {
            watch.check()?;
            if last != Some(pixel) {
                (last, cycle) = (Some(pixel), 0);
            }
            columns.extend(&source, pixel, pulses, &mut cycle);
            Ok::<(), Failure>(())
        };
        source.for_each(&pixels, each, |n| {
            let _ = watch.done(n);
        })?;
        Ok(columns)
    })?;
    let dict = PyDict::new(py);
    dict.set_item("time_fs", columns.time_fs.into_pyarray(py))?;
    dict.set_item("laser_cycle", columns.laser_cycle.into_pyarray(py))?;
    dict.set_item("row", columns.row.into_pyarray(py))?;
    dict.set_item("col", columns.col.into_pyarray(py))?;
    dict.set_item("spad", columns.spad.into_pyarray(py))?;
    Ok(dict)
}
