//! Whether a target is found in a frame, and if not, why not.

use std::collections::BTreeMap;
use std::fmt;

use crate::system::{NoDepth, PixelDepth};

/// What became of the macropixels that see a target.
#[derive(Debug, Clone, PartialEq, Default, serde::Serialize)]
pub struct TargetSummary {
    /// Macropixels that see it.
    pub seen_by: usize,
    /// Those with it in their window.
    pub in_window: usize,
    /// Those whose depth is right to a bin.
    pub right: usize,
    /// Those whose depth is not.
    pub wrong: usize,
    /// Those without depth, by reason.
    pub without: BTreeMap<NoDepth, usize>,
    /// Mean true distance, m.
    pub(crate) true_m: Option<f64>,
    /// Mean of the depths that are right, m.
    pub(crate) measured_m: Option<f64>,
    /// Mean of their errors, m.
    pub mean_error_m: Option<f64>,
    /// Root mean square of their errors, m.
    pub rms_m: Option<f64>,
    /// Root mean square error of the guide, m.
    pub guide_rms_m: Option<f64>,
}

/// Of the macropixels on a target, this share has to be right for it to be found: chosen, so that what is missed is the minority.
const ENOUGH: f64 = 0.5;

impl TargetSummary {
    /// These macropixels, with bins of `bin_m`.
    pub(crate) fn summarise<'p>(pixels: impl Iterator<Item = &'p PixelDepth>, bin_m: f64) -> Self {
        let mut found = TargetSummary::default();
        let (mut truths, mut depths, mut guides) = (Vec::new(), Vec::new(), Vec::new());
        for pixel in pixels {
            found.seen_by += 1;
            found.in_window += usize::from(pixel.in_window);
            truths.extend(pixel.true_m);
            guides.extend(pixel.guide_m.zip(pixel.true_m).map(|(g, t)| g - t));
            match (pixel.error_m(), pixel.no_depth) {
                (Some(error_m), _) if error_m.abs() <= bin_m => {
                    found.right += 1;
                    depths.extend(pixel.measured_m.zip(Some(error_m)));
                }
                (Some(_), _) => found.wrong += 1,
                (None, Some(why)) => *found.without.entry(why).or_default() += 1,
                (None, None) => (),
            }
        }
        found.true_m = mean(truths.iter().copied());
        found.measured_m = mean(depths.iter().map(|d| d.0));
        found.mean_error_m = mean(depths.iter().map(|d| d.1));
        found.rms_m = mean(depths.iter().map(|d| d.1 * d.1)).map(f64::sqrt);
        found.guide_rms_m = mean(guides.iter().map(|g| g * g)).map(f64::sqrt);
        found
    }

    /// Share of the macropixels on the target whose depth is right; none, if there are none.
    pub(crate) fn share(&self) -> f64 {
        self.right as f64 / self.seen_by.max(1) as f64
    }

    /// Whether most of the target is where it is.
    pub(crate) fn is_found(&self) -> bool {
        self.seen_by > 0 && self.share() >= ENOUGH
    }
}

impl fmt::Display for TargetSummary {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let Some(true_m) = self.true_m else {
            return write!(f, "out of view");
        };
        let word = if self.is_found() {
            "found"
        } else {
            "NOT found"
        };
        let (right, of) = (self.right, self.seen_by);
        write!(f, "{word} at {true_m:.1} m: {right} of {of} right to a bin")?;
        if let Some(rms_m) = self.rms_m {
            write!(f, " (RMS {rms_m:.3} m)")?;
        }
        if self.wrong > 0 {
            write!(f, ", {} wrong", self.wrong)?;
        }
        for (why, n) in &self.without {
            write!(f, ", {n} {}", why.name())?;
        }
        Ok(())
    }
}

/// The mean; `None` of nothing.
pub(crate) fn mean(values: impl Iterator<Item = f64>) -> Option<f64> {
    let (n, sum) = values.fold((0usize, 0.0), |(n, sum), value| (n + 1, sum + value));
    (n > 0).then(|| sum / n as f64)
}

#[cfg(test)]
mod tests {
    use super::*;

    fn pixel(measured_m: Option<f64>, in_window: bool) -> PixelDepth {
        PixelDepth {
            true_m: Some(40.0),
            guide_m: Some(41.0),
            start: Some(20),
            in_window,
            measured_m,
            bound_m: None,
            spread_m: None,
            returns: Default::default(),
            walk_left: None,
            no_depth: measured_m.is_none().then_some(NoDepth::OutsideWindow),
            peak_m: measured_m,
            confidence: None,
        }
    }

    #[test]
    fn a_target_is_found_where_most_of_it_is_right() {
        let right = pixel(Some(40.1), true);
        let wrong = pixel(Some(42.0), true);
        let missed = pixel(None, false);
        let found = TargetSummary::summarise([&right, &right, &wrong, &missed].into_iter(), 0.39);
        assert!(found.is_found());
        assert_eq!((found.seen_by, found.right, found.wrong), (4, 2, 1));
        assert_eq!(
            (found.in_window, found.without[&NoDepth::OutsideWindow]),
            (3, 1)
        );
        assert!((found.rms_m.unwrap() - 0.1).abs() < 1e-9);
        assert_eq!(found.guide_rms_m, Some(1.0));
        let text = found.to_string();
        assert_eq!(
            text,
            "found at 40.0 m: 2 of 4 right to a bin (RMS 0.100 m), 1 wrong, 1 target outside window"
        );
        let lost = TargetSummary::summarise([&right, &missed, &missed].into_iter(), 0.39);
        assert!(!lost.is_found());
        assert_eq!(
            TargetSummary::summarise([].into_iter(), 0.39).to_string(),
            "out of view"
        );
    }
}
