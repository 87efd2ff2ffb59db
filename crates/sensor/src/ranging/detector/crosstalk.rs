//! Light of a cover glass: it comes at the same time in every laser cycle, whatever is in front of the sensor.
//!
//! ```text
//!   measured   counts without a target ─► echoes of the pulse ─► their mean histogram
//!                                         └─ no such echoes: light of each bin (Coates), less the background, where it exceeds that
//!   fitted     sum of captures ─► echoes ─► those at nearly no distance ─► their mean histogram
//! ```
//!
//! What is known so goes into the mean histogram beside echo and background. An echo has the noise of three numbers, and bins have that of each.
//! So light that is no echo of the pulse must be measured for much longer than the captures that it is used for.
//!
//! SPADs that fire together count light by about the power of their number, and the light before it matters, too. The light of an echo follows
//! from their counts, and that of single bins does not.

use super::{CountedEvents, DetectedReturn, Detector, NoReturn, SurfaceLight};
use crate::ranging::DepthOptions;
use crate::ranging::peak::median;
use crate::units::SPEED_OF_LIGHT_M_PER_S;

/// Standard deviations by which a bin must exceed the background.
const STANDS_OUT: f64 = 3.0;

/// Counts of SPADs that fire together from which the light of a glass does not follow.
#[derive(Debug, Clone, Copy, PartialEq, Eq, thiserror::Error)]
#[error(
    "has counts of SPADs that fire together which are no echo of a pulse this wide, so that the photons of the glass are not known"
)]
pub struct UnknownCrosstalk;

impl Detector {
    /// Photons of the glass in each bin of a histogram, from `sums`, the counts of all `histograms` without a
    /// target; empty without any light.
    ///
    /// # Errors
    /// SPADs that fire together, and counts that are not echoes of the pulse.
    pub fn measured_crosstalk(
        &self,
        sums: &[u32],
        histograms: u32,
    ) -> Result<Vec<f64>, UnknownCrosstalk> {
        let returns = match self.returns_of_sum(sums, histograms) {
            Err(NoReturn::NoSignificantPeak) if self.coincidence.is_some() => {
                return Ok(Vec::new());
            }
            returns => returns.unwrap_or_default(),
        };
        if !returns.is_empty() && returns.iter().all(|found| found.bound_m.is_some()) {
            return Ok(self.mean_of(&returns, histograms));
        }
        if self.coincidence.is_some() {
            return Err(UnknownCrosstalk);
        }
        let number = f64::from(histograms.max(1));
        let cycles = self.laser_cycles.map(|cycles| number * f64::from(cycles));
        let mut left = cycles.unwrap_or(f64::INFINITY);
        let photons = sums.iter().map(|&count| {
            let count = f64::from(count);
            match cycles {
                Some(cycles) if self.counted == CountedEvents::First => {
                    let share = (count / left.max(1.0)).min(0.999);
                    left -= count;
                    -cycles * libm::log1p(-share)
                }
                _ => count,
            }
        });
        let photons: Vec<f64> = photons.collect();
        let bin_s = self.bin_s();
        let length = |bin: usize| (self.edges_s[bin + 1] - self.edges_s[bin]) / bin_s;
        let levels = photons.iter().enumerate();
        let levels: Vec<f64> = levels.map(|(bin, light)| light / length(bin)).collect();
        let background = median(levels.iter());
        let above = |(bin, light): (usize, &f64)| {
            let dark = background * length(bin);
            if *light > dark + STANDS_OUT * (dark + 1.0).sqrt() {
                (light - dark) / number
            } else {
                0.0
            }
        };
        let glass: Vec<f64> = photons.iter().enumerate().map(above).collect();
        if glass.iter().any(|&photons| photons > 0.0) {
            Ok(glass)
        } else {
            Ok(Vec::new())
        }
    }

    /// The same of the echoes in the sum of some histograms that are no farther away than the width of a pulse or a bin; empty where there are
    /// none.
    ///
    /// # Errors
    /// SPADs that fire together, and a near echo of another form than the pulse.
    pub fn fitted_crosstalk(
        &self,
        sums: &[u32],
        histograms: u32,
    ) -> Result<Vec<f64>, UnknownCrosstalk> {
        let reach_s = (2.0 * self.pulse_sigma_s).max(self.bin_s());
        let reach_m = 0.5 * SPEED_OF_LIGHT_M_PER_S * reach_s;
        let mut returns = match self.returns_of_sum(sums, histograms) {
            Err(NoReturn::Saturated) if self.coincidence.is_some() => return Err(UnknownCrosstalk),
            returns => returns.unwrap_or_default(),
        };
        returns.retain(|found| found.depth_m.abs() <= reach_m);
        if returns.is_empty() {
            return Ok(Vec::new());
        }
        if self.coincidence.is_some() && returns.iter().any(|found| found.bound_m.is_none()) {
            return Err(UnknownCrosstalk);
        }
        Ok(self.mean_of(&returns, histograms))
    }

    /// The echoes in the sum of some histograms.
    fn returns_of_sum(
        &self,
        sums: &[u32],
        histograms: u32,
    ) -> Result<Vec<DetectedReturn>, NoReturn> {
        let cycles = |cycles: u32| cycles.saturating_mul(histograms.max(1));
        let of_sum = Detector {
            laser_cycles: self.laser_cycles.map(cycles),
            most_counts: None,
            ..self.clone()
        };
        of_sum.returns(sums, &DepthOptions::default())
    }

    /// Photons in each bin of one histogram, if the sum of all has these echoes.
    fn mean_of(&self, echoes: &[DetectedReturn], histograms: u32) -> Vec<f64> {
        let mut light = vec![0.0; self.bins()];
        for echo in echoes {
            let spread_m = echo.spread_m.unwrap_or(0.0);
            let spread_s = 2.0 * spread_m / SPEED_OF_LIGHT_M_PER_S;
            let widened = Detector {
                pulse_sigma_s: libm::hypot(self.pulse_sigma_s, spread_s),
                counted: CountedEvents::Every,
                coincidence: None,
                most_counts: None,
                ..self.clone()
            };
            let mean = widened.expected(&SurfaceLight {
                depth_m: echo.depth_m,
                photons: echo.photons / f64::from(histograms.max(1)),
                background: 0.0,
            });
            light
                .iter_mut()
                .zip(mean)
                .for_each(|(sum, mean)| *sum += mean);
        }
        light
    }
}
