//! A method over all cells in a few numbers.

use serde::Serialize;

use super::{Method, ParetoPoint};

/// One method over all cells: medians, and the worst cell.
#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
pub struct MethodSummary {
    /// Engine and knob.
    pub method: Method,
    /// Run time for a macropixel and laser cycle, ns.
    pub run_time_ns: f64,
    /// Speed-up over the `cycle` engine.
    pub speed_up: f64,
    /// See [`Errors::mismatch`](super::Errors::mismatch).
    pub mismatch: f64,
    /// See [`Errors::mean_shift`](super::Errors::mean_shift).
    pub mean_shift: f64,
    /// See [`Errors::depth_rms_m`](super::Errors::depth_rms_m).
    pub depth_rms_m: Option<f64>,
    /// Mean difference of depths, either way, m.
    pub depth_mean_m: Option<f64>,
    /// Each of these where it is worst.
    pub worst: Worst,
}

/// The worst of each figure over all cells.
#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
pub struct Worst {
    /// Longest run time, ns.
    pub run_time_ns: f64,
    /// Least speed-up.
    pub speed_up: f64,
    /// Largest mismatch.
    pub mismatch: f64,
    /// Largest mean shift.
    pub mean_shift: f64,
    /// Largest, m.
    pub depth_rms_m: Option<f64>,
    /// Largest, m.
    pub depth_mean_m: Option<f64>,
    /// Range of the wall with the largest RMS difference of depths, m; `None` where there is none at all.
    pub range_m: Option<f64>,
    /// Sunlight on it, klux.
    pub illuminance_klux: Option<f64>,
}

/// Sums up one method over the cells; `None` without a point.
pub fn summarise(points: &[ParetoPoint]) -> Option<MethodSummary> {
    let method = points.first()?.method;
    debug_assert!(points.iter().all(|point| point.method == method));
    // Each figure's values in ascending order: the median is in the middle, the worst at an end.
    let sorted = |value: &dyn Fn(&ParetoPoint) -> Option<f64>| {
        let mut values: Vec<f64> = points.iter().filter_map(value).collect();
        values.sort_by(f64::total_cmp);
        values
    };
    let middle = |values: &[f64]| values.get(values.len() / 2).copied();
    let most = |values: &[f64]| values.last().copied();
    let run_time = sorted(&|p| Some(p.run_time_ns));
    let speed_up = sorted(&|p| Some(p.speed_up));
    let mismatch = sorted(&|p| Some(p.errors.mismatch));
    let mean_shift = sorted(&|p| Some(p.errors.mean_shift));
    let depth_rms = sorted(&|p| p.errors.depth_rms_m);
    let depth_mean = sorted(&|p| p.errors.depth_mean_m.map(f64::abs));
    let farthest = points
        .iter()
        .filter(|p| p.errors.depth_rms_m > Some(0.0))
        .max_by(|a, b| {
            a.errors
                .depth_rms_m
                .partial_cmp(&b.errors.depth_rms_m)
                .expect("no NaN")
        });
    Some(MethodSummary {
        method,
        run_time_ns: middle(&run_time)?,
        speed_up: middle(&speed_up)?,
        mismatch: middle(&mismatch)?,
        mean_shift: middle(&mean_shift)?,
        depth_rms_m: middle(&depth_rms),
        depth_mean_m: middle(&depth_mean),
        worst: Worst {
            run_time_ns: most(&run_time)?,
            speed_up: speed_up.first().copied()?,
            mismatch: most(&mismatch)?,
            mean_shift: most(&mean_shift)?,
            depth_rms_m: most(&depth_rms),
            depth_mean_m: most(&depth_mean),
            range_m: farthest.map(|p| p.range_m),
            illuminance_klux: farthest.map(|p| p.illuminance_klux),
        },
    })
}
