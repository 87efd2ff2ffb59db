//! What a frame gives: histograms, depths, errors against the ground truth, run times.

use serde::Serialize;

use super::tolerance::Kept;
use crate::engine::Work;
use crate::units::Time;

/// One macropixel of a frame. Distances are radial, in metres.
#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
pub struct PixelDepth {
    /// Ground truth; `None` for the sky.
    pub true_m: Option<f64>,
    /// The guide's estimate.
    pub guide_m: Option<f64>,
    /// Start value, where the guide gave one within reach.
    pub start: Option<u16>,
    /// Whether the echo's centre lies in the time window.
    pub in_window: bool,
    /// Depth from the histogram.
    pub measured_m: Option<f64>,
}

impl PixelDepth {
    /// Measured less true distance, m.
    pub fn error_m(&self) -> Option<f64> {
        Some(self.measured_m? - self.true_m?)
    }
}

/// Wall-clock seconds of each phase of the simulation.
#[derive(Debug, Clone, Copy, Default, PartialEq, Serialize)]
pub struct PhaseTimes {
    /// Ray casting of the ground truth.
    pub scene_s: f64,
    /// Stereo guide.
    pub guide_s: f64,
    /// Start values through the window law.
    pub windows_s: f64,
    /// Serial load at gate level, elaboration included.
    pub load_s: f64,
    /// Light on every macropixel.
    pub light_s: f64,
    /// Photon stream and engine.
    pub exposure_s: f64,
    /// Probed macropixels at gate level, waveforms included.
    pub probes_s: f64,
    /// Peak interpolation.
    pub ranging_s: f64,
}

impl PhaseTimes {
    /// All phases together, s.
    pub fn total_s(&self) -> f64 {
        self.scene_s
            + self.guide_s
            + self.windows_s
            + self.load_s
            + self.light_s
            + self.exposure_s
            + self.probes_s
            + self.ranging_s
    }
}

/// A frame.
#[derive(Debug, Clone, PartialEq)]
pub struct Frame {
    /// Macropixel rows.
    pub rows: usize,
    /// Macropixel columns.
    pub cols: usize,
    /// Bins of each histogram.
    pub bins: usize,
    /// Counts, rows × cols × bins, bin 0 earliest.
    pub histograms: Vec<u16>,
    /// Macropixels, row-major.
    pub pixels: Vec<PixelDepth>,
    /// Photons and dark counts that the light makes of the whole array on average.
    pub photons_expected: f64,
    /// What the engine did, and did not have to do.
    pub work: Work,
    /// Engines chosen by a depth tolerance, and the bound they keep.
    pub kept: Option<Kept>,
    /// Bits of the serial load.
    pub load_bits: usize,
    /// Time the chip needs for the load.
    pub load_time: Time,
    /// Time the chip exposes.
    pub exposure_time: Time,
    /// Macropixels that were also run at gate level and agreed to the count, with the `window` engine on the same
    /// photons where the frame's engine is `cohort`, which has none.
    pub probes: Vec<(usize, usize)>,
    /// What the simulation took.
    pub times: PhaseTimes,
}

/// A frame in a few numbers. Errors are over macropixels whose target lies in their window, in metres.
#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
pub struct Summary {
    /// Macropixels.
    pub pixels: usize,
    /// Macropixels that see a surface at all.
    pub with_target: usize,
    /// Macropixels with a start value from the guide.
    pub guided: usize,
    /// Guided macropixels whose target lies in their window.
    pub in_window: usize,
    /// Root mean square error.
    pub rms_error_m: Option<f64>,
    /// Mean error.
    pub mean_error_m: Option<f64>,
    /// Median of the absolute error.
    pub median_absolute_error_m: Option<f64>,
    /// Share of macropixels within half a metre of the truth.
    pub share_within_half_metre: Option<f64>,
    /// Root mean square error of the guide over the same macropixels.
    pub guide_rms_error_m: Option<f64>,
}

impl Frame {
    /// Measured depth of every macropixel, row-major.
    pub fn depth_m(&self) -> Vec<Option<f32>> {
        self.pixels
            .iter()
            .map(|p| p.measured_m.map(|m| m as f32))
            .collect()
    }

    /// The frame in a few numbers.
    pub fn summary(&self) -> Summary {
        let in_window = || self.pixels.iter().filter(|p| p.in_window);
        let errors: Vec<f64> = in_window().filter_map(PixelDepth::error_m).collect();
        let guide_errors: Vec<f64> = in_window()
            .filter_map(|p| Some(p.guide_m? - p.true_m?))
            .collect();
        let count = |f: fn(&PixelDepth) -> bool| self.pixels.iter().filter(|p| f(p)).count();
        Summary {
            pixels: self.pixels.len(),
            with_target: count(|p| p.true_m.is_some()),
            guided: count(|p| p.start.is_some()),
            in_window: count(|p| p.in_window),
            rms_error_m: mean(errors.iter().map(|e| e * e)).map(f64::sqrt),
            mean_error_m: mean(errors.iter().copied()),
            median_absolute_error_m: median(errors.iter().map(|e| e.abs())),
            share_within_half_metre: mean(errors.iter().map(|e| f64::from(e.abs() <= 0.5))),
            guide_rms_error_m: mean(guide_errors.iter().map(|e| e * e)).map(f64::sqrt),
        }
    }
}

fn mean(values: impl ExactSizeIterator<Item = f64>) -> Option<f64> {
    let count = values.len();
    (count > 0).then(|| values.sum::<f64>() / count as f64)
}

fn median(values: impl Iterator<Item = f64>) -> Option<f64> {
    let mut sorted: Vec<f64> = values.collect();
    sorted.sort_by(f64::total_cmp);
    let middle = sorted.len() / 2;
    match sorted.len() {
        0 => None,
        n if n % 2 == 1 => Some(sorted[middle]),
        _ => Some((sorted[middle - 1] + sorted[middle]) / 2.0),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_summary_counts_what_it_says() {
        let pixel = |true_m, measured_m, in_window| PixelDepth {
            true_m,
            guide_m: true_m,
            start: Some(1),
            in_window,
            measured_m,
        };
        let frame = Frame {
            rows: 1,
            cols: 4,
            bins: 1,
            histograms: vec![0; 4],
            pixels: vec![
                pixel(Some(10.0), Some(10.3), true),
                pixel(Some(10.0), Some(9.6), true),
                pixel(Some(10.0), Some(30.0), false),
                PixelDepth {
                    start: None,
                    ..pixel(None, None, false)
                },
            ],
            photons_expected: 0.0,
            work: Work::default(),
            kept: None,
            load_bits: 36,
            load_time: Time::ZERO,
            exposure_time: Time::ZERO,
            probes: vec![],
            times: PhaseTimes::default(),
        };
        let summary = frame.summary();
        assert_eq!((summary.pixels, summary.with_target), (4, 3));
        assert_eq!((summary.guided, summary.in_window), (3, 2));
        assert!((summary.rms_error_m.unwrap() - 0.125f64.sqrt()).abs() < 1e-12);
        assert!((summary.median_absolute_error_m.unwrap() - 0.35).abs() < 1e-12);
        assert_eq!(summary.share_within_half_metre, Some(1.0));
    }
}
