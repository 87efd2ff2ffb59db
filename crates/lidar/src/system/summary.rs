//! A frame in a few numbers.
//!
//! Nothing that went wrong is left out of them without a word: errors are over all depths, with outliers and once more without;
//! over all macropixels that see a surface, with no depth counted as an error without limit; and as they would be if
//! every peak were taken for a depth.

use std::collections::BTreeMap;

use serde::Serialize;

use super::pixel::{NoDepth, PixelDepth};
use crate::ranging::WalkLeft;

/// A frame in a few numbers, distances in metres.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct FrameSummary {
    /// Macropixels.
    pub pixels: usize,
    /// Macropixels that see a surface at all.
    pub with_target: usize,
    /// Macropixels with a start value from the guide; in the conventional mode all of them.
    pub guided: usize,
    /// Those of them whose target lies in their window.
    pub in_window: usize,
    /// Macropixels with a depth.
    pub depths: usize,
    /// Those that see no surface: false alarms for certain.
    pub depths_without_surface: usize,
    /// Macropixels without a depth, by reason.
    pub no_depth: BTreeMap<NoDepth, usize>,
    /// Light's way there and back in one bin, as a distance.
    pub bin_m: f64,
    /// Depths of surfaces that are wrong by more than a bin.
    pub outliers: usize,
    /// Their share of all depths of surfaces.
    pub outlier_share: Option<f64>,
    /// Root mean square error of all depths of surfaces.
    pub rms_error_m: Option<f64>,
    /// Root mean square of what their counts allow at best (Cramér-Rao), of those whose range walk is taken out.
    pub rms_bound_m: Option<f64>,
    /// Depths whose range walk is not taken out, by reason.
    pub walk_left: BTreeMap<WalkLeft, usize>,
    /// Median of their absolute error.
    pub median_absolute_error_m: Option<f64>,
    /// Root mean square error without outliers.
    pub rms_error_without_outliers_m: Option<f64>,
    /// Mean error without outliers: what is left of the range walk.
    pub mean_error_m: Option<f64>,
    /// The same of the peaks as the counts have them: with range walk.
    pub mean_error_with_walk_m: Option<f64>,
    /// Median of the absolute error over all macropixels that see a surface, without limit where there is no depth;
    /// `None` if that is so for half of them.
    pub median_absolute_error_of_all_m: Option<f64>,
    /// Share of all macropixels that see a surface whose depth is right to a bin.
    pub share_within_a_bin: Option<f64>,
    /// Root mean square error over all macropixels that see a surface and have a peak, if each peak were taken for a
    /// depth.
    pub rms_error_of_every_peak_m: Option<f64>,
    /// Root mean square error of the guide, where the target lies in the window.
    pub guide_rms_error_m: Option<f64>,
}

impl FrameSummary {
    /// Of macropixels with bins of `bin_m`.
    pub(crate) fn new(pixels: &[PixelDepth], bin_m: f64) -> Self {
        let count = |f: &dyn Fn(&PixelDepth) -> bool| pixels.iter().filter(|p| f(p)).count();
        let errors: Vec<f64> = pixels.iter().filter_map(PixelDepth::error_m).collect();
        let is_inlier = |error: f64| error.abs() <= bin_m;
        let inliers = || pixels.iter().filter(|p| p.error_m().is_some_and(is_inlier));
        let without_outliers: Vec<f64> = inliers().filter_map(PixelDepth::error_m).collect();
        let with_walk: Vec<f64> = inliers().filter_map(PixelDepth::peak_error_m).collect();
        let every_peak: Vec<f64> = pixels.iter().filter_map(PixelDepth::peak_error_m).collect();
        let in_window = pixels.iter().filter(|p| p.in_window);
        let guide_errors: Vec<f64> = in_window
            .filter_map(|p| Some(p.guide_m? - p.true_m?))
            .collect();
        let with_target = count(&|p| p.true_m.is_some());
        let outliers = errors.len() - without_outliers.len();
        let share = |part: usize, whole: usize| (whole > 0).then(|| part as f64 / whole as f64);
        let missing = std::iter::repeat_n(f64::INFINITY, with_target - errors.len());
        let of_all = errors.iter().map(|e| e.abs()).chain(missing);
        let mut no_depth = BTreeMap::new();
        for reason in pixels.iter().filter_map(|p| p.no_depth) {
            *no_depth.entry(reason).or_default() += 1;
        }
        let bounded = pixels.iter().filter(|p| p.error_m().is_some());
        let bounds: Vec<f64> = bounded.filter_map(|p| p.bound_m).collect();
        let mut walk_left = BTreeMap::new();
        for reason in pixels.iter().filter_map(|p| p.walk_left) {
            *walk_left.entry(reason).or_default() += 1;
        }
        FrameSummary {
            pixels: pixels.len(),
            with_target,
            guided: count(&|p| p.start.is_some()),
            in_window: count(&|p| p.in_window),
            depths: count(&|p| p.measured_m.is_some()),
            depths_without_surface: count(&|p| p.measured_m.is_some() && p.true_m.is_none()),
            no_depth,
            bin_m,
            outliers,
            outlier_share: share(outliers, errors.len()),
            rms_error_m: rms(&errors),
            rms_bound_m: rms(&bounds),
            walk_left,
            median_absolute_error_m: median(errors.iter().map(|e| e.abs())),
            rms_error_without_outliers_m: rms(&without_outliers),
            mean_error_m: mean(&without_outliers),
            mean_error_with_walk_m: mean(&with_walk),
            median_absolute_error_of_all_m: median(of_all).filter(|m| m.is_finite()),
            share_within_a_bin: share(without_outliers.len(), with_target),
            rms_error_of_every_peak_m: rms(&every_peak),
            guide_rms_error_m: rms(&guide_errors),
        }
    }
}

fn mean(values: &[f64]) -> Option<f64> {
    (!values.is_empty()).then(|| values.iter().sum::<f64>() / values.len() as f64)
}

fn rms(values: &[f64]) -> Option<f64> {
    let squares: Vec<f64> = values.iter().map(|v| v * v).collect();
    mean(&squares).map(f64::sqrt)
}

/// The median, between the middle two of an even number of values; `None` of none.
pub fn median(values: impl Iterator<Item = f64>) -> Option<f64> {
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

    /// A macropixel that sees a surface at 10 m, or nothing.
    fn pixel(sees: bool, measured_m: Option<f64>, peak_m: Option<f64>) -> PixelDepth {
        let true_m = sees.then_some(10.0);
        PixelDepth {
            true_m,
            guide_m: true_m,
            start: true_m.map(|_| 1),
            in_window: sees,
            measured_m,
            bound_m: None,
            spread_m: None,
            returns: Default::default(),
            walk_left: None,
            no_depth: match (measured_m, sees) {
                (Some(_), _) => None,
                (None, true) => Some(NoDepth::NoSignificantPeak),
                (None, false) => Some(NoDepth::NoSurface),
            },
            peak_m,
            confidence: peak_m.map(|_| 5.0),
        }
    }

    #[test]
    fn failed_macropixels_are_in_the_numbers() {
        let depth = |m: f64| pixel(true, Some(m), Some(m - 0.02));
        let pixels = [
            depth(10.3),
            depth(9.6),
            depth(30.0),
            pixel(true, None, Some(17.0)),
            pixel(false, None, None),
            pixel(false, Some(50.0), Some(50.0)),
        ];
        let summary = FrameSummary::new(&pixels, 0.5);
        let near = |value: Option<f64>, wanted: f64| (value.unwrap() - wanted).abs() < 1e-12;
        assert_eq!((summary.pixels, summary.with_target), (6, 4));
        assert_eq!((summary.depths, summary.depths_without_surface), (4, 1));
        assert_eq!(summary.outliers, 1);
        assert!(near(summary.outlier_share, 1.0 / 3.0));
        let rms = ((0.09 + 0.16 + 400.0) / 3.0f64).sqrt();
        assert!(near(summary.rms_error_m, rms));
        assert!(near(summary.median_absolute_error_m, 0.4));
        assert!(near(summary.rms_error_without_outliers_m, 0.125f64.sqrt()));
        assert!(near(summary.mean_error_m, -0.05));
        assert!(near(summary.mean_error_with_walk_m, -0.07));
        // Of 0.3, 0.4, 20 and none.
        assert!(near(summary.median_absolute_error_of_all_m, 10.2));
        assert!(near(summary.share_within_a_bin, 0.5));
        let squares = 0.28 * 0.28 + 0.42 * 0.42 + 19.98 * 19.98 + 49.0;
        assert!(near(
            summary.rms_error_of_every_peak_m,
            (squares / 4.0f64).sqrt()
        ));
        assert_eq!(
            summary.no_depth,
            BTreeMap::from([(NoDepth::NoSurface, 1), (NoDepth::NoSignificantPeak, 1)])
        );
        let half_missing = FrameSummary::new(&pixels[2..4], 0.5);
        assert_eq!(half_missing.median_absolute_error_of_all_m, None);
    }

    #[test]
    fn an_empty_frame_has_no_errors() {
        let summary = FrameSummary::new(&[pixel(false, None, None)], 0.4);
        assert_eq!(summary.rms_error_m, None);
        assert_eq!(summary.median_absolute_error_of_all_m, None);
        assert_eq!(summary.share_within_a_bin, None);
    }
}
