//! Light of one's own on every macropixel.

use guided_dtof::engine::{CohortOptions, LitPixel, expose as expose_to};
use guided_dtof::photon::{Echo, PixelLight, Profile};
use guided_dtof::request::{Spelling, exposure};
use guided_dtof::system::{EngineKind, photon_stream};
use guided_dtof::units::Time;
use numpy::PyReadonlyArrayDyn;
use numpy::PyUntypedArrayMethods;
use pyo3::prelude::*;
use pyo3::types::PyDict;
use serde::Deserialize;

use crate::arrays::{cube, starts as start_values, values};
use crate::background::run;
use crate::failure::Failure;
use crate::scene::Scene;
use crate::sensor::Sensor;
use crate::values::by_json;

/// An engine by its name.
///
/// # Errors
/// When there is none of this name.
pub(crate) fn engine_named(name: &str) -> Result<EngineKind, Failure> {
    let name = toml::Value::from(name);
    EngineKind::deserialize(name.clone()).map_err(|_| {
        let message = format!("{name} is not an engine; give gate, cycle, window or cohort");
        Failure::argument("engine", message)
    })
}

/// Light as arrays: all have one value for each macropixel, and echoes one more axis.
struct Arrays {
    background_hz: Vec<f64>,
    echoes: usize,
    signal: Vec<f64>,
    arrival_ns: Vec<f64>,
    sigma_ns: Option<Vec<f64>>,
    profile: Option<(Vec<Time>, Vec<f64>)>,
}

impl Arrays {
    fn pixel_light(&self, pixel: usize) -> Result<PixelLight, Failure> {
        let amount = |name: &str, value: f64| {
            if value.is_finite() && value >= 0.0 {
                Ok(value)
            } else {
                let message =
                    format!("{value} of macropixel {pixel} is impossible; give 0 or more");
                Err(Failure::argument(name, message))
            }
        };
        let background_hz = amount("background_hz", self.background_hz[pixel])?;
        let mut light = PixelLight::background(background_hz);
        for echo in pixel * self.echoes..(pixel + 1) * self.echoes {
            let photons = amount("signal", self.signal[echo])?;
            if photons == 0.0 {
                continue;
            }
            let arrival_ns = amount("arrival_ns", self.arrival_ns[echo])?;
            let mut echo_light = Echo::new(photons, Time::from_s(arrival_ns * 1e-9));
            if let Some(sigma_ns) = &self.sigma_ns {
                let sigma_ns = amount("sigma_ns", sigma_ns[echo])?;
                echo_light = echo_light.with_sigma(Time::from_s(sigma_ns * 1e-9));
            }
            light = light.with_echo(echo_light);
        }
        if let Some((edges, rates_hz)) = &self.profile {
            let pieces = edges.len() - 1;
            let rates_hz = &rates_hz[pixel * pieces..][..pieces];
            let profile = Profile::new(edges, rates_hz)
                .map_err(|why| Failure::argument("profile_hz", why))?;
            light = light.with_profile(profile);
        }
        Ok(light)
    }
}

/// Exposes an array to light of one's own; see `gdtof.expose`.
#[pyfunction]
#[expect(
    clippy::too_many_arguments,
    reason = "gdtof.expose gives them their names"
)]
pub(crate) fn expose<'py>(
    py: Python<'py>,
    sensor: Option<&Bound<'py, Sensor>>,
    scene: Option<&Bound<'py, Scene>>,
    starts: PyReadonlyArrayDyn<'py, i64>,
    background_hz: PyReadonlyArrayDyn<'py, f64>,
    signal: PyReadonlyArrayDyn<'py, f64>,
    arrival_ns: PyReadonlyArrayDyn<'py, f64>,
    sigma_ns: Option<PyReadonlyArrayDyn<'py, f64>>,
    profile: Option<(Vec<f64>, PyReadonlyArrayDyn<'py, f64>)>,
    periods: (u32, u32),
    seed: u64,
    engine: &str,
    progress: Option<&Bound<'py, PyAny>>,
) -> PyResult<Bound<'py, PyDict>> {
    let (sensor, world) = (Sensor::or_default(sensor), Scene::or_default(scene));
    let (rows, cols, bins) = (sensor.rows, sensor.cols, sensor.bins);
    let exposure =
        exposure(&sensor, periods.0, periods.1, Spelling::Keys).map_err(Failure::from)?;
    let engine = engine_named(engine)?;
    let starts = start_values(&starts, &[rows, cols], sensor.largest_start())?;
    let echoes = *signal.shape().last().unwrap_or(&0);
    let of_echoes = [rows, cols, echoes];
    let profile = profile.map(|(edges_ns, rates_hz)| {
        let edges: Vec<Time> = edges_ns.iter().map(|ns| Time::from_s(ns * 1e-9)).collect();
        let pieces = edges.len().saturating_sub(1);
        let rates_hz = values("profile_hz", &rates_hz, &[rows, cols, pieces])?;
        Ok::<_, Failure>((edges, rates_hz))
    });
    let sigma_ns = sigma_ns.map(|sigma_ns| values("sigma_ns", &sigma_ns, &of_echoes));
    let arrays = Arrays {
        background_hz: values("background_hz", &background_hz, &[rows, cols])?,
        echoes,
        signal: values("signal", &signal, &of_echoes)?,
        arrival_ns: values("arrival_ns", &arrival_ns, &of_echoes)?,
        sigma_ns: sigma_ns.transpose()?,
        profile: profile.transpose()?,
    };
    let exposed = run(py, progress, move |watch| {
        let farthest = sensor.largest_start();
        let pixels = starts.iter().enumerate().map(|(pixel, start)| {
            Ok(LitPixel {
                number: pixel as u32,
                start: start.unwrap_or(farthest),
                light: start.map(|_| arrays.pixel_light(pixel)).transpose()?,
            })
        });
        let pixels = pixels.collect::<Result<Vec<LitPixel>, Failure>>()?;
        let stream = photon_stream(&sensor, &exposure, seed, &world);
        let engine = engine.expose(&sensor, &exposure, CohortOptions::default());
        Ok(expose_to(&*engine, &stream, &pixels, |n| watch.done(n))?)
    })?;
    let dict = PyDict::new(py);
    let counts = exposed.histograms.into_counts();
    dict.set_item("histograms", cube(py, (rows, cols, bins), counts))?;
    dict.set_item("work", by_json(py, &exposed.work)?)?;
    Ok(dict)
}
