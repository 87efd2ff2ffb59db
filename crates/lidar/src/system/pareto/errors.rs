//! How far a method's histograms and depths are from those of the `cycle` engine.

use serde::Serialize;

use crate::chip::WindowLaw;
use crate::engine::{ExposureResult, LitPixel};
use crate::ranging::{PeakOptions, interpolate};
use crate::units::TimeOfFlight;

/// How far a method is from the `cycle` engine, over the macropixels of a cell.
#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
pub struct Errors {
    /// Sum of the differences of all counts, over the sum of all counts.
    pub mismatch: f64,
    /// Root mean square over the bins of the difference between mean counts, in standard deviations of one
    /// histogram's counts. Two exact methods that share no photons come to about √(2 / macropixels).
    pub mean_shift: f64,
    /// Root mean square difference of depths, m; `None` without a macropixel in which both find a peak.
    pub depth_rms_m: Option<f64>,
    /// Mean difference of depths, m.
    pub depth_mean_m: Option<f64>,
}

impl Errors {
    /// Of a cell's macropixels `pixels`: `found`, its counts times `scale`, against `exact`.
    pub(super) fn compare(
        law: &WindowLaw,
        pixels: &[LitPixel],
        found: &ExposureResult,
        exact: &ExposureResult,
        scale: f64,
    ) -> Self {
        let (mut differences, mut counts) = (0.0, 0.0);
        let mut moments = vec![[0.0; 3]; exact.histograms.bins()];
        let mut depths = Vec::new();
        for ((pixel, found), exact) in pixels.iter().zip(&found.histograms).zip(&exact.histograms) {
            for ((&found, &exact), moments) in found.iter().zip(exact).zip(&mut moments) {
                let (found, exact) = (scale * f64::from(found), f64::from(exact));
                differences += (found - exact).abs();
                counts += exact;
                moments[0] += found - exact;
                moments[1] += exact;
                moments[2] += exact * exact;
            }
            if let (Some(found), Some(exact)) =
                (depth_m(law, pixel, found), depth_m(law, pixel, exact))
            {
                depths.push(found - exact);
            }
        }
        let n = pixels.len() as f64;
        let shifts = moments.iter().map(|[difference, sum, squares]| {
            let variance = (squares / n - (sum / n).powi(2)).max(1.0 / n);
            (difference / n).powi(2) / variance
        });
        let mean = |values: &mut dyn Iterator<Item = f64>| {
            let values: Vec<f64> = values.collect();
            (!values.is_empty()).then(|| values.iter().sum::<f64>() / values.len() as f64)
        };
        Errors {
            mismatch: if counts > 0.0 {
                differences / counts
            } else {
                0.0
            },
            mean_shift: f64::sqrt(shifts.sum::<f64>() / exact.histograms.bins() as f64),
            depth_rms_m: mean(&mut depths.iter().map(|d| d * d)).map(f64::sqrt),
            depth_mean_m: mean(&mut depths.iter().copied()),
        }
    }
}

fn depth_m(law: &WindowLaw, pixel: &LitPixel, counts: &[u16]) -> Option<f64> {
    let window = law.window(pixel.start).open()?;
    let counts: Vec<u32> = counts.iter().map(|&n| n.into()).collect();
    let peak = interpolate(&counts, &PeakOptions::default())?;
    Some(law.time_of(&window, peak.position_bins).as_range_m())
}
