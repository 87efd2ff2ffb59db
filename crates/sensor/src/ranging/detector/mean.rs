//! What a detector should count in known light, and whether counts are such.
//!
//! Counts are compared by χ²: bins are put together with the next ones until five counts are expected. Where only first events count,
//! laser cycles without any are a further cell. Source: Pearson 1900; five is the usual least (Cochran 1954).

use super::{CountedEvents, Detector};
use crate::numerics::intervals::chi_squared_above;
use crate::ranging::EchoLight;
use crate::units::SPEED_OF_LIGHT_M_PER_S;

/// Counts that a cell must expect.
const LEAST_EXPECTED: f64 = 5.0;

/// Light of one surface before a background that does not change.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct SurfaceLight {
    /// Distance of the surface, m.
    pub depth_m: f64,
    /// Photons of its echo in all laser cycles.
    pub photons: f64,
    /// Background photons in all bins and all laser cycles.
    pub background: f64,
}

/// How well counts agree with what was expected.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Agreement {
    /// Sum of squared deviations, each over its variance.
    pub chi_squared: f64,
    /// Cells that are compared.
    pub cells: usize,
    /// Chance that counts of the expected light deviate at least as much.
    pub p: f64,
}

impl Detector {
    /// The mean count of each bin in all laser cycles (`ranging/expected/other_bins` has the formulas). A pulse is no shorter than a fiftieth
    /// of a bin.
    pub fn expected(&self, light: &SurfaceLight) -> Vec<f64> {
        let cycles = self.laser_cycles.unwrap_or(1);
        let law = self.law(cycles);
        let (bin_s, all) = (self.bin_s(), f64::from(cycles));
        let flight_s = 2.0 * light.depth_m / SPEED_OF_LIGHT_M_PER_S;
        let response = self.response(&law);
        let chances = response.chances(&EchoLight {
            position_bins: law.position((flight_s - self.edges_s[0]) / bin_s - 0.5),
            signal: light.photons / all,
            background_per_bin: light.background / (all * self.bins() as f64),
            sigma_bins: response.pulse_sigma_bins,
        });
        let means = chances.iter().map(|chance| all * chance);
        // A bin that stops has no more; that its mean is below this where it stops in some histograms only is left out.
        let most = self.most_counts.map_or(f64::INFINITY, f64::from);
        means.map(|mean| mean.min(most)).collect()
    }

    /// Whether `counts` are what a detector has that expects these means.
    pub fn agreement(&self, counts: &[u32], expected: &[f64]) -> Agreement {
        debug_assert_eq!(counts.len(), expected.len());
        let mut cells: Vec<(f64, f64)> = Vec::new();
        let (mut counted, mut mean) = (0.0, 0.0);
        for (&count, &bin) in counts.iter().zip(expected) {
            counted += f64::from(count);
            mean += bin;
            if mean >= LEAST_EXPECTED {
                cells.push((counted, mean));
                (counted, mean) = (0.0, 0.0);
            }
        }
        // What is left belongs to the last cell, or is the only one.
        match cells.last_mut() {
            Some(last) => *last = (last.0 + counted, last.1 + mean),
            None => cells.push((counted, mean)),
        }
        let mut freedom = cells.len();
        if self.counted == CountedEvents::First
            && let Some(laser_cycles) = self.laser_cycles
        {
            let sum = |term: fn(&(f64, f64)) -> f64| cells.iter().map(term).sum::<f64>();
            let without = f64::from(laser_cycles) - sum(|cell| cell.1);
            let counted = f64::from(laser_cycles) - sum(|cell| cell.0);
            if without >= LEAST_EXPECTED {
                cells.push((counted, without));
            } else {
                freedom -= 1;
            }
        }
        let square = |&(counted, mean): &(f64, f64)| {
            let off = counted - mean;
            if mean > 0.0 {
                off * off / mean
            } else if off == 0.0 {
                0.0
            } else {
                f64::INFINITY
            }
        };
        let chi_squared: f64 = cells.iter().map(square).sum();
        Agreement {
            chi_squared,
            cells: cells.len(),
            p: chi_squared_above(chi_squared, freedom.max(1)),
        }
    }
}
