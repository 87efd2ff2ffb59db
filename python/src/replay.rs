//! Photons of one's own.

use std::path::PathBuf;

use guided_dtof::chip::{Exposure, SensorConfig};
use guided_dtof::engine::waveform::{View, record};
use guided_dtof::engine::{GateSimulation, Histograms, PulsedPixel, Replay, cancelled};
use guided_dtof::photon::SpadEvent;
use guided_dtof::request::{Spelling, exposure};
use guided_dtof::stimulus::recording::Recording;
use guided_dtof::units::Time;
use guided_dtof::waves::WaveFormat;
use numpy::{PyReadonlyArray1, PyReadonlyArrayDyn};
use pyo3::prelude::*;
use pyo3::types::PyDict;
use rayon::prelude::*;

use crate::arrays::{cube, starts as start_values};
use crate::background::{Watch, run};
use crate::failure::Failure;
use crate::light::engine_named;
use crate::sensor::Sensor;

/// Runs SPAD pulses through the chip; see `gdtof.replay`.
#[pyfunction]
#[expect(
    clippy::too_many_arguments,
    reason = "gdtof.replay gives them their names"
)]
pub(crate) fn replay<'py>(
    py: Python<'py>,
    sensor: Option<&Bound<'py, Sensor>>,
    starts: PyReadonlyArrayDyn<'py, i64>,
    time_fs: PyReadonlyArray1<'py, i64>,
    pixel: PyReadonlyArray1<'py, i64>,
    spad: PyReadonlyArray1<'py, i64>,
    periods: (u32, u32),
    engine: &str,
    waves: Option<PathBuf>,
    progress: Option<&Bound<'py, PyAny>>,
) -> PyResult<Bound<'py, PyDict>> {
    let sensor = Sensor::or_default(sensor);
    let exposure =
        exposure(&sensor, periods.0, periods.1, Spelling::Keys).map_err(Failure::from)?;
    let kind = engine_named(engine)?;
    if waves.is_some() && engine != "gate" {
        let message = "only the gate engine has waveforms; give engine = \"gate\", or leave it out";
        return Err(Failure::argument("waves", message).into());
    }
    let farthest = sensor.largest_start();
    let starts = start_values(&starts, &[sensor.rows, sensor.cols], farthest)?;
    let is_on: Vec<bool> = starts.iter().map(Option::is_some).collect();
    let starts: Vec<u16> = starts
        .into_iter()
        .map(|start| start.unwrap_or(farthest))
        .collect();
    let events = events(&sensor, &time_fs, &pixel, &spad)?;
    let shape = (sensor.rows, sensor.cols, sensor.bins);
    let (recording, histograms, cancel) = run(py, progress, move |watch| {
        let recording = Recording::from_events(events, &sensor, &exposure);
        watch.check()?;
        let pulses = recording.pulses.iter().zip(&is_on);
        let pulses = pulses.map(|(pulses, is_on)| if *is_on { &pulses[..] } else { &[] });
        let pulses: Vec<&[SpadEvent]> = pulses.collect();
        let pixels = PulsedPixel::array(&starts, &pulses);
        let engine = kind.replay(&sensor, &exposure)?;
        let histograms = match &waves {
            Some(waves) => with_waves((&sensor, &exposure), &starts, &pulses, waves)?,
            None => batches(&*engine, &pixels, watch)?,
        };
        let cancel = cancelled(&*engine, &sensor, &pixels);
        Ok((recording, histograms, cancel))
    })?;
    let dict = PyDict::new(py);
    dict.set_item("histograms", cube(py, shape, histograms.into_counts()))?;
    dict.set_item("photons", recording.read)?;
    dict.set_item("lost_to_dead_time", recording.lost_to_dead_time)?;
    dict.set_item("after_the_end", recording.after_the_end)?;
    dict.set_item("cancelled", cancel)?;
    Ok(dict)
}

/// Events with the numbers of their macropixels, checked.
///
/// # Errors
/// Arrays of unlike lengths, and what is outside the array or the exposure's beginning.
fn events(
    sensor: &SensorConfig,
    time_fs: &PyReadonlyArray1<'_, i64>,
    pixel: &PyReadonlyArray1<'_, i64>,
    spad: &PyReadonlyArray1<'_, i64>,
) -> Result<Vec<(usize, SpadEvent)>, Failure> {
    let arrays = [time_fs.as_array(), pixel.as_array(), spad.as_array()];
    let lengths = arrays.map(|array| array.len());
    let [times, pixels, spads] = arrays;
    if lengths.iter().any(|length| *length != lengths[0]) {
        let message = format!(
            "are {} times, {} macropixels and {} SPADs; give as many of each",
            lengths[0], lengths[1], lengths[2]
        );
        return Err(Failure::argument("time_fs, pixel, spad", message));
    }
    let (most_pixels, most_spads) = (sensor.pixels() as i64, sensor.spads() as i64);
    let event = |((&time_fs, &pixel), &spad): ((&i64, &i64), &i64)| {
        if !(0..most_pixels).contains(&pixel) {
            let message = format!(
                "macropixel {pixel} does not exist; give 0 to {}, row-major",
                most_pixels - 1
            );
            return Err(Failure::argument("pixel", message));
        }
        if !(0..most_spads).contains(&spad) {
            let message = format!("SPAD {spad} does not exist; give 0 to {}", most_spads - 1);
            return Err(Failure::argument("spad", message));
        }
        if time_fs < 0 {
            let message = format!(
                "an event at {time_fs} fs is before time 0, the first rising edge of STOP; shift or remove it"
            );
            return Err(Failure::argument("time_fs", message));
        }
        let event = SpadEvent {
            time: Time::from_fs(time_fs),
            spad: spad as u8,
        };
        Ok((pixel as usize, event))
    };
    times.iter().zip(&pixels).zip(&spads).map(event).collect()
}

/// The whole array as one netlist, with its waveform.
fn with_waves(
    (sensor, exposure): (&SensorConfig, &Exposure),
    starts: &[u16],
    pulses: &[&[SpadEvent]],
    waves: &std::path::Path,
) -> Result<Histograms, Failure> {
    let size = (sensor.rows, sensor.cols);
    let mut simulation = GateSimulation::new(sensor, exposure, (0, 0), size, starts, pulses);
    let pixels = (0..sensor.rows).flat_map(|row| (0..sensor.cols).map(move |col| (row, col)));
    let view = View::of_array(pixels.collect(), sensor, exposure, starts[0]);
    record(
        &mut simulation,
        waves,
        WaveFormat::from_path(waves),
        &view,
        &mut (),
    )?;
    Ok(simulation.histograms()?)
}

/// Batches of the engine's liking, on as many threads as there are.
fn batches(
    engine: &dyn Replay,
    pixels: &[PulsedPixel<'_>],
    watch: &Watch,
) -> Result<Histograms, Failure> {
    let parts = pixels.par_chunks(engine.batch()).map(|batch| {
        watch.check()?;
        let histograms = engine.replay(batch)?;
        let _ = watch.done(batch.len());
        Ok(histograms)
    });
    let parts = parts.collect::<Result<Vec<Histograms>, Failure>>()?;
    Ok(Histograms::joined(engine.bins(), parts))
}
