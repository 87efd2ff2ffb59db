//! Histograms of any sensor.

use guided_dtof::files::{parse_toml, read_text};
use guided_dtof::ranging::{
    Agreement, DepthOptions, DetectedReturn, Detector, DetectorDescription, NoReturn, SurfaceLight,
    WalkLeft,
};
use guided_dtof::request::{Spelling, check_false_alarm_rate};
use guided_dtof::settings::said_remarks;
use guided_dtof::system::RETURNS;
use numpy::{IntoPyArray, PyArray1, PyReadonlyArray2, PyUntypedArrayMethods};
use pyo3::prelude::*;
use pyo3::types::PyDict;
use rayon::prelude::*;

use crate::arrays::map;
use crate::background::run;
use crate::failure::Failure;

/// Bins, and the detector's description as JSON.
type BinsAndDescription = (usize, String);

fn parse(description: &str) -> Result<DetectorDescription, Failure> {
    serde_json::from_str(description)
        .map_err(|error| Failure::argument("detector", error.to_string()))
}

fn detector((bins, description): BinsAndDescription) -> Result<Detector, Failure> {
    let description = parse(&description)?;
    let detector = description.detector(bins);
    detector.map_err(|bad| {
        let key = match bad.key {
            "bin_width_ns" => "bin_ns",
            key => key,
        };
        Failure::argument(key, bad.message)
    })
}

/// Checks a description, and says what in it is probably in another unit.
#[pyfunction]
pub(crate) fn detector_checked(described: BinsAndDescription) -> PyResult<Vec<String>> {
    let remarks = parse(&described.1)?.remarks();
    detector(described)?;
    let said = said_remarks("the detector", &remarks).into_iter();
    Ok(said
        .map(|said| said.replace("bin_width_ns", "bin_ns"))
        .collect())
}

/// The description in a file, as JSON.
#[pyfunction]
pub(crate) fn detector_file(path: std::path::PathBuf) -> PyResult<String> {
    let text = read_text(&path).map_err(Failure::from)?;
    let description: DetectorDescription =
        parse_toml(path.display(), &text).map_err(Failure::from)?;
    Ok(serde_json::to_string(&description).expect("numbers and words"))
}

/// Photons of a cover glass in each bin of all zones, from the sums of `histograms` histograms; see `gdtof.Detector.crosstalk`.
#[pyfunction]
pub(crate) fn detector_crosstalk<'py>(
    py: Python<'py>,
    described: BinsAndDescription,
    sums: PyReadonlyArray2<'py, u32>,
    histograms: u32,
    is_fit: bool,
) -> PyResult<Bound<'py, PyAny>> {
    let detector = detector(described)?;
    let bins = detector.bins();
    let zones: Vec<Vec<u32>> = (sums.as_array().rows().into_iter())
        .map(|zone| zone.to_vec())
        .collect();
    let light_of = |(number, zone): (usize, &Vec<u32>)| {
        let light = if is_fit {
            detector.fitted_crosstalk(zone, histograms)
        } else {
            detector.measured_crosstalk(zone, histograms)
        };
        let mut light = light.map_err(|error| {
            let message = format!("zone {number} {error}; correct pulse_fwhm_ns and start_ns, or leave the bins of the glass out");
            Failure::argument("counts", message)
        })?;
        light.resize(bins, 0.0);
        Ok(light)
    };
    let light: Vec<Result<Vec<f64>, Failure>> =
        zones.par_iter().enumerate().map(light_of).collect();
    let light: Vec<Vec<f64>> = light.into_iter().collect::<Result<_, _>>()?;
    let light: Vec<f64> = light.into_iter().flatten().collect();
    Ok(map(py, (zones.len(), bins), light).into_any())
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
    described: BinsAndDescription,
    counts: PyReadonlyArray2<'py, u32>,
    crosstalk: Option<PyReadonlyArray2<'py, f64>>,
    false_alarm_rate: f64,
    correct_walk: bool,
) -> PyResult<Bound<'py, PyDict>> {
    check_false_alarm_rate(false_alarm_rate, Spelling::Keys).map_err(Failure::from)?;
    let options = DepthOptions {
        false_alarm_rate,
        correct_walk,
        ..DepthOptions::default()
    };
    let detector = detector(described)?;
    let zones = zones(&detector, &counts)?;
    let crosstalk: Vec<Vec<f64>> = match &crosstalk {
        Some(light) => {
            let light = light.as_array();
            light.rows().into_iter().map(|zone| zone.to_vec()).collect()
        }
        None => Vec::new(),
    };
    let (found, remark) = run(py, None, move |_| {
        let remark = detector.remark_on_echoes(zones.iter().map(Vec::as_slice));
        let found = zones.par_iter().enumerate().map(|(number, zone)| {
            let crosstalk = crosstalk.get(number).cloned().unwrap_or_default();
            let detector = Detector {
                crosstalk,
                ..detector.clone()
            };
            detector.returns(zone, &options)
        });
        Ok((found.collect::<Vec<_>>(), remark))
    })?;
    let dict = PyDict::new(py);
    dict.set_item("remark", remark)?;
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
    let walk_left = found.iter().map(|found| {
        let first = found.as_deref().unwrap_or_default().first();
        WalkLeft::number(first.and_then(|of| of.no_bound))
    });
    dict.set_item("walk_left", map(py, (found.len(), 1), walk_left.collect()))?;
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
    described: BinsAndDescription,
    light: (f64, f64, f64),
) -> PyResult<Bound<'_, PyArray1<f64>>> {
    let (depth_m, photons, background) = light;
    let light = SurfaceLight {
        depth_m,
        photons,
        background,
    };
    Ok(detector(described)?.expected(&light).into_pyarray(py))
}

/// How well counts agree, zone by zone: χ², cells and chance; see `gdtof.Detector.check`.
#[pyfunction]
pub(crate) fn detector_agreement(
    described: BinsAndDescription,
    counts: PyReadonlyArray2<'_, u32>,
    expected: PyReadonlyArray2<'_, f64>,
) -> PyResult<Vec<(f64, usize, f64)>> {
    let detector = detector(described)?;
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
