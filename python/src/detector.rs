//! Histograms of any sensor.

use guided_dtof::ranging::{
    Agreement, Counted, DepthOptions, DetectedReturn, Detector, NoReturn, SurfaceLight,
};
use guided_dtof::request::{Spelling, check_false_alarm_rate};
use guided_dtof::system::RETURNS;
use numpy::{IntoPyArray, PyArray1, PyReadonlyArray2, PyUntypedArrayMethods};
use pyo3::prelude::*;
use pyo3::types::PyDict;
use rayon::prelude::*;

use crate::arrays::map;
use crate::background::run;
use crate::failure::Failure;

/// Bins, length of a bin (s), begin of the first (s), standard deviation of the pulse (s), and laser cycles if first photons count.
type Spelled = (usize, f64, f64, f64, Option<u32>);

fn spelled((bins, bin_s, begins_s, pulse_sigma_s, laser_cycles): Spelled) -> Detector {
    Detector {
        bins,
        bin_s,
        begins_s,
        pulse_sigma_s,
        counted: match laser_cycles {
            Some(laser_cycles) => Counted::FirstPhoton { laser_cycles },
            None => Counted::EveryPhoton,
        },
    }
}

/// The counts of each zone, checked.
fn zones(
    detector: &Detector,
    counts: &PyReadonlyArray2<'_, u32>,
) -> Result<Vec<Vec<u32>>, Failure> {
    let zones: Vec<Vec<u32>> = (counts.as_array().rows().into_iter())
        .map(|zone| zone.to_vec())
        .collect();
    for (number, zone) in zones.iter().enumerate() {
        let checked = detector.check(zone);
        checked.map_err(|error| Failure::argument("counts", format!("zone {number} {error}")))?;
    }
    Ok(zones)
}

/// Depths of histograms, zones × bins; see `gdtof.Detector.range`.
#[pyfunction]
pub(crate) fn detector_range<'py>(
    py: Python<'py>,
    detector: Spelled,
    counts: PyReadonlyArray2<'py, u32>,
    false_alarm_rate: f64,
    correct_walk: bool,
) -> PyResult<Bound<'py, PyDict>> {
    check_false_alarm_rate(false_alarm_rate, Spelling::Keys).map_err(Failure::from)?;
    let options = DepthOptions {
        false_alarm_rate,
        correct_walk,
        ..DepthOptions::default()
    };
    let detector = spelled(detector);
    let zones = zones(&detector, &counts)?;
    let found = run(py, None, move |_| {
        let found = zones
            .par_iter()
            .map(|zone| detector.returns(zone, &options));
        Ok(found.collect::<Vec<_>>())
    })?;
    let dict = PyDict::new(py);
    let nan = f64::NAN;
    for (name, number) in [
        ("depth", (|r| r.depth_m) as fn(&DetectedReturn) -> f64),
        ("bound", |r| r.bound_m.unwrap_or(f64::NAN)),
        ("spread", |r| r.spread_m.unwrap_or(f64::NAN)),
        ("photons", |r| r.photons),
        ("confidence", |r| r.confidence),
    ] {
        let returns = found.iter().flat_map(|found| {
            let returns = found.as_deref().unwrap_or_default();
            (0..RETURNS).map(move |n| returns.get(n).map_or(nan, number))
        });
        dict.set_item(name, map(py, (found.len(), RETURNS), returns.collect()))?;
    }
    let reason = |found: &Result<_, NoReturn>| match found {
        Ok(_) => String::new(),
        Err(why) => why.to_string(),
    };
    let reasons: Vec<String> = found.iter().map(reason).collect();
    dict.set_item("reason", reasons)?;
    Ok(dict)
}

/// The mean of each bin; see `gdtof.Detector.expected`.
#[pyfunction]
pub(crate) fn detector_expected(
    py: Python<'_>,
    detector: Spelled,
    light: (f64, f64, f64),
) -> Bound<'_, PyArray1<f64>> {
    let (depth_m, photons, background) = light;
    let light = SurfaceLight {
        depth_m,
        photons,
        background,
    };
    spelled(detector).expected(&light).into_pyarray(py)
}

/// How well counts agree, zone by zone: χ², cells and chance; see `gdtof.Detector.check`.
#[pyfunction]
pub(crate) fn detector_agreement(
    detector: Spelled,
    counts: PyReadonlyArray2<'_, u32>,
    expected: PyReadonlyArray2<'_, f64>,
) -> PyResult<Vec<(f64, usize, f64)>> {
    let detector = spelled(detector);
    if counts.shape() != expected.shape() {
        let message = format!(
            "is an array of shape {:?}; give one of {:?}, as counts have",
            expected.shape(),
            counts.shape()
        );
        return Err(Failure::argument("expected", message).into());
    }
    let zones = zones(&detector, &counts)?;
    let expected = expected.as_array();
    let compared = zones.iter().zip(expected.rows()).map(|(counts, expected)| {
        let Agreement {
            chi_squared,
            cells,
            p,
        } = detector.agreement(counts, &expected.to_vec());
        (chi_squared, cells, p)
    });
    Ok(compared.collect())
}
