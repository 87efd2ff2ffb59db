//! How wide the echoes of histograms are, whatever pulse was stated.
//!
//! ```text
//!   each histogram, less its median, laid with the middle of its bins above half over 0:
//!
//!                    ▂▅█▅▂          the sum of all has its full width at half maximum in time,
//!   ────────────┄┄┄┄┄┄┄0┄┄┄┄┄┄──    less what the length of a bin adds (in squares)
//! ```
//!
//! Counts are spread over the length of their bin. That adds a twelfth of its square to the variance.

use std::f64::consts::LN_2;

use super::Detector;

/// Counts of the fullest bin above the median, in standard deviations of the median and in counts, from which on it is an echo's.
const CLEAR: f64 = 6.0;

/// Counts of all echoes together from which on their width is told.
const ENOUGH: f64 = 300.0;

/// Cells of the sum in a bin.
const FINE: usize = 8;

/// How many times wider or narrower than the stated pulse echoes are said to be unlike it: chosen. Slanted surfaces widen echoes, too.
const UNLIKE: f64 = 2.0;

/// Bins from which on an echo is longer than one: chosen.
const CLEARLY_A_BIN: f64 = 1.25;

impl Detector {
    /// A sentence, where echoes in `histograms` are far wider or narrower than the stated pulse.
    pub fn remark_on_echoes<'a>(
        &self,
        histograms: impl Iterator<Item = &'a [u32]>,
    ) -> Option<String> {
        let seen_ns = 1e9 * self.echo_fwhm_s(histograms)?;
        let stated_ns = 1e9 * self.pulse_sigma_s * (8.0 * LN_2).sqrt();
        let bin_ns = 1e9 * self.bin_s();
        // What is shorter than a bin looks like a bin.
        let is_wide = seen_ns > UNLIKE * stated_ns && seen_ns > CLEARLY_A_BIN * bin_ns;
        let is_narrow = seen_ns.max(bin_ns) < stated_ns / UNLIKE;
        let (times, than) = if is_wide {
            (seen_ns / stated_ns, "wider")
        } else {
            (stated_ns / seen_ns, "narrower")
        };
        let ratio = if times < 1000.0 {
            format!("{times:.1} times {than}")
        } else {
            format!("far {than}")
        };
        (is_wide || is_narrow).then(|| {
            format!("echoes are about {seen_ns:.1} ns wide at half maximum, {ratio} than pulse_fwhm_ns = {stated_ns:.3}; give the width of the echoes, with all jitter, so that depths and bounds hold")
        })
    }

    /// The full width at half maximum of echoes in `histograms`, s; `None` without enough counts of echoes that lie within the bins.
    /// An echo shorter than half a bin has that half.
    pub fn echo_fwhm_s<'a>(&self, histograms: impl Iterator<Item = &'a [u32]>) -> Option<f64> {
        let (bins, bin_s) = (self.bins(), self.bin_s());
        let middle = FINE * bins;
        let mut sum = vec![0.0; 2 * middle + FINE];
        let mut echoes = 0.0;
        for counts in histograms {
            let lengths = self
                .edges_s
                .windows(2)
                .map(|ends| (ends[1] - ends[0]) / bin_s);
            let densities = counts
                .iter()
                .zip(lengths)
                .map(|(&n, length)| f64::from(n) / length);
            let densities: Vec<f64> = densities.collect();
            let mut sorted = densities.clone();
            sorted.sort_by(f64::total_cmp);
            let level = sorted[bins / 2];
            let Some(fullest) = (0..bins).max_by(|&a, &b| densities[a].total_cmp(&densities[b]))
            else {
                continue;
            };
            let above = densities[fullest] - level;
            if above < CLEAR * (1.0 + level.sqrt()) || fullest == 0 || fullest == bins - 1 {
                continue;
            }
            echoes += densities
                .iter()
                .map(|density| (density - level).max(0.0))
                .sum::<f64>();
            let is_above = |bin: &usize| densities[*bin] - level > 0.5 * above;
            let earlier = (0..fullest).rev().take_while(is_above);
            let later = (fullest..bins).take_while(is_above);
            let (mut weight, mut moment_s) = (0.0, 0.0);
            for bin in earlier.chain(later) {
                let counts = densities[bin] - level;
                weight += counts;
                moment_s += counts * 0.5 * (self.edges_s[bin] + self.edges_s[bin + 1]);
            }
            let centre_s = moment_s / weight;
            let cell = |time_s: f64| {
                let cells = ((time_s - centre_s) / bin_s * FINE as f64).round();
                (cells + middle as f64).clamp(0.0, (sum.len() - 1) as f64) as usize
            };
            let ends: Vec<usize> = self.edges_s.iter().map(|&edge_s| cell(edge_s)).collect();
            for (bin, density) in densities.iter().enumerate() {
                for cell in &mut sum[ends[bin]..ends[bin + 1]] {
                    *cell += density - level;
                }
            }
        }
        if echoes < ENOUGH {
            return None;
        }
        let half = 0.5 * sum.iter().copied().fold(0.0, f64::max);
        let is_below = |cell: &&f64| **cell < half;
        let after = sum[middle..].iter().position(|cell| is_below(&cell))?;
        let before = sum[..middle]
            .iter()
            .rev()
            .position(|cell| is_below(&cell))?;
        let fwhm_bins = (after + before) as f64 / FINE as f64;
        let of_a_bin = 8.0 * LN_2 / 12.0;
        Some(bin_s * (fwhm_bins * fwhm_bins - of_a_bin).max(0.25).sqrt())
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::ranging::{DetectorDescription, SurfaceLight};

    fn detector(fwhm_ns: f64) -> Detector {
        let description = DetectorDescription {
            bin_width_ns: Some(1.0),
            pulse_fwhm_ns: Some(fwhm_ns),
            ..DetectorDescription::default()
        };
        description.detector(64).unwrap()
    }

    /// Twenty zones at distances of all kinds within a bin.
    fn counts(fwhm_ns: f64, photons: f64) -> Vec<Vec<u32>> {
        let zone = |zone: i32| {
            let light = SurfaceLight {
                depth_m: 4.0 + 0.043 * f64::from(zone),
                photons,
                background: 640.0,
            };
            let mean = detector(fwhm_ns).expected(&light);
            mean.iter().map(|mean| mean.round() as u32).collect()
        };
        (0..20).map(zone).collect()
    }

    #[test]
    fn the_width_of_echoes_does_not_depend_on_the_stated_pulse() {
        for fwhm_ns in [2.0, 4.0, 8.0, 12.0] {
            let counts = counts(fwhm_ns, 2000.0);
            for stated_ns in [0.01, 5.0, 30.0] {
                let zones = counts.iter().map(Vec::as_slice);
                let found_ns = 1e9 * detector(stated_ns).echo_fwhm_s(zones).unwrap();
                assert!(
                    (found_ns / fwhm_ns - 1.0).abs() < 0.25,
                    "{found_ns} {fwhm_ns}"
                );
            }
        }
        let short = counts(0.1, 2000.0);
        let zones = short.iter().map(Vec::as_slice);
        assert!(detector(1.0).echo_fwhm_s(zones).unwrap() < 1.1e-9);
    }

    #[test]
    fn background_has_no_width() {
        let none = counts(2.0, 0.0);
        assert_eq!(
            detector(2.0).echo_fwhm_s(none.iter().map(Vec::as_slice)),
            None
        );
        assert_eq!(detector(2.0).echo_fwhm_s(std::iter::empty()), None);
    }
}
