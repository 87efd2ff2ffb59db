//! Coupled ring oscillators: neighbours in a row that pull each other's phases (thesis 2.4.3, injection locking).
//!
//! ```text
//!   ring 0 ──h── ring 1 ──h── ring 2 ──h── …        f′ᵢ = fᵢ + h Σ sin 2π(θⱼ − θᵢ)   over the neighbours j
//! ```
//!
//! Rings are coupled by resistors or capacitors between like nodes, which a netlist of gates does not have. This is Adler's
//! law (Proc. IRE 34, 1946) of each pair: h is how far one neighbour can pull a frequency. Of two rings the difference
//! obeys δ′ = Δf − 2 h sin 2πδ, so that they lock where |Δf| ≤ 2 h. In a row that runs at one frequency, the mean, each link
//! carries the sum of what the rings on one side of it have too much: they lock where none of these sums exceeds h.

use std::f64::consts::TAU;

/// A row of coupled rings.
#[derive(Debug, Clone, PartialEq)]
pub struct RingRow {
    /// Frequency of each ring alone, Hz.
    pub free_hz: Vec<f64>,
    /// How far a neighbour can pull a ring's frequency, Hz.
    pub pull_hz: f64,
}

impl RingRow {
    /// The frequency that they share once they have locked: the mean of their own, Hz.
    pub fn locked_hz(&self) -> f64 {
        self.free_hz.iter().sum::<f64>() / self.free_hz.len() as f64
    }

    /// The least pull with which these rings lock, Hz.
    pub fn least_pull_hz(&self) -> f64 {
        let mean = self.locked_hz();
        let carried = self.free_hz.iter().scan(0.0, |sum, hz| {
            *sum += hz - mean;
            Some(*sum)
        });
        carried.fold(0.0, |most: f64, sum| most.max(sum.abs()))
    }

    /// Mean frequency of each ring, Hz, over the second half of `seconds` from a common start, by Runge and Kutta's method.
    pub fn mean_frequencies_hz(&self, seconds: f64) -> Vec<f64> {
        // The fastest change is that of a ring between two neighbours; phases are taken relative to the mean.
        let mean = self.locked_hz();
        let spread = self.free_hz.iter().map(|hz| (hz - mean).abs());
        let fastest = spread.fold(2.0 * TAU * self.pull_hz, f64::max);
        let steps = 2 * (seconds * fastest / 0.1).ceil().max(1.0) as usize;
        let step = seconds / steps as f64;
        let own: Vec<f64> = self.free_hz.iter().map(|hz| hz - mean).collect();
        let mut phases = vec![0.0; own.len()];
        let mut halfway = phases.clone();
        for number in 0..steps {
            if number == steps / 2 {
                halfway.clone_from(&phases);
            }
            let a = self.slopes(&own, &phases);
            let b = self.slopes(&own, &moved(&phases, &a, step / 2.0));
            let c = self.slopes(&own, &moved(&phases, &b, step / 2.0));
            let d = self.slopes(&own, &moved(&phases, &c, step));
            for (ring, phase) in phases.iter_mut().enumerate() {
                *phase += step / 6.0 * (a[ring] + 2.0 * (b[ring] + c[ring]) + d[ring]);
            }
        }
        let turned = phases.iter().zip(&halfway);
        turned
            .map(|(end, half)| mean + 2.0 * (end - half) / seconds)
            .collect()
    }

    fn slopes(&self, own: &[f64], phases: &[f64]) -> Vec<f64> {
        let mut slopes = own.to_vec();
        for (ring, pair) in phases.windows(2).enumerate() {
            let pull = self.pull_hz * libm::sin(TAU * (pair[1] - pair[0]));
            slopes[ring] += pull;
            slopes[ring + 1] -= pull;
        }
        slopes
    }
}

fn moved(phases: &[f64], slopes: &[f64], by: f64) -> Vec<f64> {
    phases
        .iter()
        .zip(slopes)
        .map(|(phase, slope)| phase + by * slope)
        .collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Largest difference between two rings of a row, Hz.
    fn spread(hz: &[f64]) -> f64 {
        let most = hz.iter().copied().fold(f64::MIN, f64::max);
        most - hz.iter().copied().fold(f64::MAX, f64::min)
    }

    #[test]
    fn rings_lock_where_no_link_carries_more_than_it_can() {
        for free_hz in [
            vec![1.00e9, 1.02e9],
            vec![1.0e9, 0.97e9, 1.01e9, 1.05e9, 0.99e9],
        ] {
            let row = |share: f64| {
                let free = RingRow {
                    free_hz: free_hz.clone(),
                    pull_hz: 0.0,
                };
                RingRow {
                    pull_hz: share * free.least_pull_hz(),
                    ..free
                }
            };
            let locked = row(1.05);
            let found = locked.mean_frequencies_hz(20e-6);
            assert!(spread(&found) < 1.0, "{found:?}");
            assert!((found[0] - locked.locked_hz()).abs() < 1.0);
            assert!(spread(&row(0.95).mean_frequencies_hz(20e-6)) > 1e5);
            let alone = row(0.0).mean_frequencies_hz(1e-6);
            assert!((alone[1] - free_hz[1]).abs() < 1.0);
        }
    }

    /// Below its lock, Adler's pair beats at √(Δf² − (2h)²).
    #[test]
    fn two_rings_beat_as_adler_has_it() {
        let row = RingRow {
            free_hz: vec![1.00e9, 1.02e9],
            pull_hz: 6e6,
        };
        let found = row.mean_frequencies_hz(200e-6);
        let beat = (20e6f64.powi(2) - 12e6f64.powi(2)).sqrt();
        let off = (found[1] - found[0]) / beat - 1.0;
        assert!(off.abs() < 1e-3, "{off}");
    }
}
