//! Timing and windows of a sensor.

use guided_dtof::analysis::TimingVerdict;
use guided_dtof::chip::{
    ChipTiming, Exposure, SensorConfig, Silicon, UnknownConditions, WindowLaw,
};
use guided_dtof::netlist::{Conditions, Corner};
use guided_dtof::request::{Spelling, exposure, of_no_aim};
use guided_dtof::units::{Time, TimeOfFlight};
use numpy::{PyArray1, PyArray2, PyArray3, PyReadonlyArrayDyn};
use pyo3::prelude::*;
use pyo3::types::PyDict;

use crate::arrays::{cube, map, of_start, starts as start_values, values};
use crate::background::run;
use crate::failure::Failure;
use crate::frame::bin_edges_ns;
use crate::sensor::Sensor;

/// Static timing of a sensor; see `gdtof.timing`.
#[pyfunction]
pub(crate) fn timing<'py>(
    py: Python<'py>,
    sensor: Option<&Bound<'py, Sensor>>,
    process: &str,
    voltage_v: f64,
    temperature_c: Option<f64>,
) -> PyResult<Bound<'py, PyDict>> {
    let sensor = Sensor::or_default(sensor);
    let corners = [Corner::Slow, Corner::Typ, Corner::Fast];
    let named = corners.into_iter().find(|corner| corner.name() == process);
    let process = named.ok_or_else(|| {
        let message = format!("{process:?} is impossible; give slow, typ or fast");
        Failure::argument("process", message)
    })?;
    let conditions = Conditions {
        process,
        voltage_v,
        temperature_c: temperature_c.unwrap_or(sensor.conditions().temperature_c),
    };
    let silicon = Silicon::new(&sensor).in_conditions(conditions);
    let silicon = silicon.map_err(|why| {
        let arguments = match why {
            UnknownConditions::OfLibrary => "process, voltage_v, temperature_c",
            UnknownConditions::Far => "voltage_v, temperature_c",
        };
        Failure::argument(arguments, why.to_string())
    })?;
    let (verdict, chip, clk_period) = run(py, None, move |_| {
        let verdict = TimingVerdict::analyse(&sensor, &silicon, (0, 0));
        Ok((
            verdict,
            ChipTiming::measure(&sensor, &silicon),
            sensor.clock().period(),
        ))
    })?;
    let ps = |time: Time| time.as_ns() * 1e3;
    let report = verdict.report();
    let dict = PyDict::new(py);
    dict.set_item("met", report.met)?;
    dict.set_item("slack_ps", report.slack_ps)?;
    dict.set_item("check", report.check)?;
    dict.set_item("path", report.path)?;
    dict.set_item("verdict", report.verdict)?;
    dict.set_item("notes", report.notes)?;
    dict.set_item("clk_period_ps", ps(clk_period))?;
    dict.set_item("ripple_ps", ps(chip.ripple()))?;
    dict.set_item("counter_period_ps", ps(chip.counter.period))?;
    dict.set_item("strobe_ps", ps(chip.local_stop_to_strobe))?;
    let margins = verdict
        .margins
        .iter()
        .map(|m| (m.check.clone(), m.path.clone(), ps(m.slack)));
    dict.set_item("margins", margins.collect::<Vec<_>>())?;
    Ok(dict)
}

fn exposed(sensor: &SensorConfig, stop_periods: u32) -> Result<Exposure, Failure> {
    Ok(exposure(sensor, stop_periods, 1, Spelling::Keys)?)
}

/// What the window of each start value sees, m; see `gdtof.windows`.
#[pyfunction]
pub(crate) fn windows<'py>(
    py: Python<'py>,
    sensor: Option<&Bound<'py, Sensor>>,
    stop_periods: u32,
) -> PyResult<Bound<'py, PyArray2<f64>>> {
    let sensor = Sensor::or_default(sensor);
    let exposure = exposed(&sensor, stop_periods)?;
    let ends = py.detach(move || {
        let law = WindowLaw::new(sensor.alike(), &exposure);
        let ends = (0..=sensor.largest_start()).flat_map(|start| match law.window(start).open() {
            None => [f64::NAN; 2],
            Some(open) => {
                let seen = law.interval(&open);
                [seen.start.as_range_m(), seen.end.as_range_m()]
            }
        });
        ends.collect::<Vec<f64>>()
    });
    Ok(map(py, (ends.len() / 2, 2), ends))
}

/// Edges of bins; see `gdtof.bin_edges`.
#[pyfunction]
pub(crate) fn bin_edges<'py>(
    py: Python<'py>,
    sensor: Option<&Bound<'py, Sensor>>,
    starts: PyReadonlyArrayDyn<'py, i64>,
    stop_periods: u32,
) -> PyResult<Bound<'py, PyArray3<f64>>> {
    let sensor = Sensor::or_default(sensor);
    let exposure = exposed(&sensor, stop_periods)?;
    let (rows, cols, bins) = (sensor.rows, sensor.cols, sensor.bins);
    let starts = start_values(&starts, &[rows, cols], sensor.largest_start())?;
    let edges = py.detach(move || bin_edges_ns(&sensor, &exposure, &starts));
    Ok(cube(py, (rows, cols, bins + 1), edges))
}

/// Start values whose windows have distances nearest to their middle, −1 where none reaches; see `gdtof.starts_for`.
#[pyfunction]
pub(crate) fn starts_for<'py>(
    py: Python<'py>,
    sensor: Option<&Bound<'py, Sensor>>,
    range_m: PyReadonlyArrayDyn<'py, f64>,
    stop_periods: u32,
) -> PyResult<Bound<'py, PyArray1<i32>>> {
    let sensor = Sensor::or_default(sensor);
    let exposure = exposed(&sensor, stop_periods)?;
    let law = WindowLaw::new(sensor.alike(), &exposure);
    if let Some(why) = law.refusal() {
        let (why, cure) = of_no_aim(&why, Spelling::Keys);
        let message = format!("{why}, so that windows cannot be aimed; {cure}");
        return Err(Failure::argument("sensor", message).into());
    }
    let metres = values("range_m", &range_m, &[range_m.len()?])?;
    let starts = metres.iter().map(|&m| {
        if m.is_finite() && m >= 0.0 {
            of_start(law.start_for(Time::of_flight(m)))
        } else {
            -1
        }
    });
    Ok(PyArray1::from_vec(py, starts.collect()))
}
