//! Light of a cover glass: it comes at the same time in every laser cycle, whatever is in front of the sensor.
//!
//! ```text
//!   measured   counts without a target ─► echoes of the pulse ─► their mean histogram
//!                                         └─ no such echoes: light of each bin (Coates), less the background, where it stands out
//!   fitted     sum of captures ─► echoes ─► those at nearly no distance ─► their mean histogram
//! ```
//!
//! What is known so goes into the mean histogram beside echo and background. An echo has the noise of three numbers, and bins have that of each.
//! So light that is no echo of the pulse must be measured for much longer than the captures that it is used for.

use super::{Counted, DetectedReturn, Detector, SurfaceLight};
use crate::ranging::DepthOptions;
use crate::ranging::peak::median;
use crate::units::SPEED_OF_LIGHT_M_PER_S;

/// Standard deviations by which a bin must stand out of the background.
const STANDS_OUT: f64 = 3.0;

impl Detector {
    /// Photons of the glass in each bin of a histogram, from the counts of so many histograms without a target; empty without any.
    pub fn measured_crosstalk(&self, sums: &[u32], histograms: u32) -> Vec<f64> {
        if let Some(glass) = self.echoes(sums, histograms, |_| true) {
            return glass;
        }
        let number = f64::from(histograms.max(1));
        let cycles = self.laser_cycles.map(|cycles| number * f64::from(cycles));
        let mut left = cycles.unwrap_or(f64::INFINITY);
        let photons = sums.iter().map(|&count| {
            let count = f64::from(count);
            match cycles {
                Some(cycles) if self.counted == Counted::First => {
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
            glass
        } else {
            Vec::new()
        }
    }

    /// The same of the echoes in the sum of some histograms that are no farther away than the width of a pulse or a bin; empty where there are
    /// none of this pulse.
    pub fn fitted_crosstalk(&self, sums: &[u32], histograms: u32) -> Vec<f64> {
        let reach_s = (2.0 * self.pulse_sigma_s).max(self.bin_s());
        let reach_m = 0.5 * SPEED_OF_LIGHT_M_PER_S * reach_s;
        let is_near = |found: &DetectedReturn| found.depth_m.abs() <= reach_m;
        let glass = self.echoes(sums, histograms, is_near);
        glass.unwrap_or_default()
    }

    /// The mean histogram of some echoes in the sum of so many histograms; `None` where there are none, or not of this pulse.
    fn echoes(
        &self,
        sums: &[u32],
        histograms: u32,
        is_wanted: impl Fn(&DetectedReturn) -> bool,
    ) -> Option<Vec<f64>> {
        let number = histograms.max(1);
        let of_sum = Detector {
            laser_cycles: self
                .laser_cycles
                .map(|cycles| cycles.saturating_mul(number)),
            most_counts: None,
            ..self.clone()
        };
        let every = Detector {
            counted: Counted::Every,
            ..self.clone()
        };
        let found = of_sum.returns(sums, &DepthOptions::default()).ok()?;
        let mut wanted = found.iter().filter(|found| is_wanted(found)).peekable();
        wanted.peek()?;
        let mut light = vec![0.0; self.bins()];
        for echo in wanted {
            // Without a bound it is no echo of this pulse.
            echo.bound_m?;
            let widened = Detector {
                pulse_sigma_s: libm::hypot(
                    self.pulse_sigma_s,
                    2.0 * echo.spread_m.unwrap_or(0.0) / SPEED_OF_LIGHT_M_PER_S,
                ),
                ..every.clone()
            };
            let mean = widened.expected(&SurfaceLight {
                depth_m: echo.depth_m,
                photons: echo.photons / f64::from(number),
                background: 0.0,
            });
            light
                .iter_mut()
                .zip(mean)
                .for_each(|(sum, mean)| *sum += mean);
        }
        Some(light)
    }
}
