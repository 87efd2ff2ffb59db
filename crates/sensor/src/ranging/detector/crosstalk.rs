//! Light of a cover glass: it comes at the same time in every laser cycle, whatever is in front of the sensor.
//!
//! ```text
//!   measured   counts without a target ─► light of each bin (Coates) ─► less the background, where it stands out
//!   fitted     sum of captures ─► echoes ─► the one nearest to the sensor ─► an echo of the pulse at that place
//! ```
//!
//! What is known so goes into the mean histogram beside echo and background.

use super::{Counted, Detector, SurfaceLight};
use crate::ranging::DepthOptions;
use crate::ranging::peak::median;
use crate::units::SPEED_OF_LIGHT_M_PER_S;

/// Standard deviations by which a bin must stand out of the background.
const STANDS_OUT: f64 = 3.0;

impl Detector {
    /// Photons of the glass in each bin of a histogram, from the counts of so many histograms without a target; empty without any.
    pub fn measured_crosstalk(&self, sums: &[u32], histograms: u32) -> Vec<f64> {
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

    /// The same of the echo in the sum of some histograms that is nearest to the sensor and no farther away than the width of a pulse or a bin;
    /// empty where there is none.
    pub fn fitted_crosstalk(&self, sums: &[u32], histograms: u32) -> Vec<f64> {
        let number = histograms.max(1);
        let of_sum = Detector {
            laser_cycles: self
                .laser_cycles
                .map(|cycles| cycles.saturating_mul(number)),
            most_counts: None,
            ..self.clone()
        };
        let returns = of_sum.returns(sums, &DepthOptions::default());
        let returns = returns.unwrap_or_default();
        let reach_s = (2.0 * self.pulse_sigma_s).max(self.bin_s());
        let reach_m = 0.5 * SPEED_OF_LIGHT_M_PER_S * reach_s;
        let near = returns
            .iter()
            .filter(|found| found.depth_m.abs() <= reach_m);
        let nearest = near.min_by(|a, b| a.depth_m.abs().total_cmp(&b.depth_m.abs()));
        let every = Detector {
            counted: Counted::Every,
            ..self.clone()
        };
        nearest.map_or(Vec::new(), |glass| {
            every.expected(&SurfaceLight {
                depth_m: glass.depth_m,
                photons: glass.photons / f64::from(number),
                background: 0.0,
            })
        })
    }
}
