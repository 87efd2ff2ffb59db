//! Designs of chip, laser and guide by theory, one at a time: the space of `gdtof propose` for other optimisers.

use guided_dtof::propose::{Choice, Goal, Problem as Designs};
use pyo3::prelude::*;
use pyo3::types::PyDict;
use toml::Table;

use crate::background::run;
use crate::failure::Failure;
use crate::scene::Scene;
use crate::sensor::Sensor;
use crate::values::table_to_python;

/// What a chip has to do, and what all designs have in common; see `gdtof propose`.
///
/// `sensor` gives array, SPADs, dead time and cell library, `scene` optics and laser, but for its energy; the target is a surface that
/// every macropixel sees at `range_m`.
///
/// Raises InputError for what cannot be.
#[pyclass(frozen, module = "gdtof")]
pub(crate) struct Problem(std::sync::Arc<Designs>);

#[pymethods]
impl Problem {
    #[new]
    #[pyo3(signature = (sensor=None, scene=None, *, range_m, reflectivity, illuminance_klux, fps, detection=0.99, precision_m=0.1))]
    #[expect(clippy::too_many_arguments, reason = "they are keywords")]
    fn new(
        sensor: Option<&Bound<'_, Sensor>>,
        scene: Option<&Bound<'_, Scene>>,
        range_m: f64,
        reflectivity: f64,
        illuminance_klux: f64,
        fps: f64,
        detection: f64,
        precision_m: f64,
    ) -> PyResult<Self> {
        let goal = Goal {
            range_m,
            reflectivity,
            illuminance_klux,
            fps,
            detection,
            precision_m,
        };
        if let Some(fault) = goal.fault() {
            return Err(Failure::Input(fault).into());
        }
        let scene = Scene::or_default(scene);
        let designs = Designs::new(goal, Sensor::or_default(sensor), &scene);
        Ok(Problem(designs.map_err(Failure::from)?.into()))
    }

    /// One design by theory, with as many laser cycles as it takes: a dict of the design and what it costs, with `possible`, `limit` (why
    /// it is not, or None) and `excess`: by how much class 1, the time of a frame and what bins hold are exceeded, each within
    /// up to 0. Where no number of laser cycles will do, there are only `possible` and `limit`.
    ///
    /// `bins` of CLK periods, `rate_hz` laser pulses a second during an exposure (fewer, where the range allows no more), a guide whose
    /// estimates have a standard deviation of `guide_sigma_m`, and as few `bin_bits` as hold the counts, if left out.
    #[pyo3(signature = (*, bins, clk_hz, pulse_energy_uj, rate_hz, guide_sigma_m, threshold=0, bin_bits=None))]
    #[expect(clippy::too_many_arguments, reason = "they are keywords")]
    fn judge<'py>(
        &self,
        py: Python<'py>,
        bins: usize,
        clk_hz: f64,
        pulse_energy_uj: f64,
        rate_hz: f64,
        guide_sigma_m: f64,
        threshold: u8,
        bin_bits: Option<usize>,
    ) -> PyResult<Bound<'py, PyDict>> {
        let choice = Choice {
            bins,
            bin_bits,
            counter_bits: None,
            clk_hz,
            threshold,
            pulse_energy_uj,
            rate_hz,
            guide_sigma_m,
        };
        if let Some(fault) = choice.fault() {
            return Err(Failure::Input(fault).into());
        }
        let designs = self.0.clone();
        let (judged, timing) = run(py, None, move |_| {
            let judged = designs.evaluate(&choice);
            let timing = judged.as_ref().ok().and_then(|candidate| {
                let config = designs.config_of(&candidate.point.design);
                designs.timing(&config).err()
            });
            Ok((judged, timing))
        })?;
        let candidate = match judged {
            Ok(candidate) => candidate,
            Err(limit) => {
                let dict = PyDict::new(py);
                dict.set_item("possible", false)?;
                dict.set_item("limit", limit.to_string())?;
                return Ok(dict);
            }
        };
        let table = Table::try_from(candidate.point).expect("numbers");
        let dict = table_to_python(py, &table)?;
        let limit = candidate.limit().map(|limit| limit.to_string()).or(timing);
        dict.set_item("possible", limit.is_none())?;
        dict.set_item("limit", limit)?;
        let excess = [candidate.eye.0, candidate.time, candidate.counts];
        dict.set_item("excess", excess.map(|times| times - 1.0))?;
        Ok(dict)
    }
}
