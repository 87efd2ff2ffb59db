//! What SPADs and laser pulses that differ add to the bound of a depth.
//!
//! Ranging knows mean dead time, mean energy and mean detection efficiency. Counts of those that differ seem to come from another place:
//!
//! ```text
//!   light ── SPADs and pulses that differ ── mean counts ── the most likely light for those that do not
//!     └──────────────────────── difference of places: added to the bound ─────────┘
//! ```
//!
//! | what differs | mean counts |
//! |---|---|
//! | dead times, by s of the mean d | of n SPADs with d·(1 + s/√n): their mean is off by as much, standard deviation |
//! | energies of pulses | the mean of those of each energy |
//! | detection efficiencies | no SPAD fires with the product of the probabilities of each |
//!
//! The first is of first order in s. That some SPADs of a macropixel are blind for longer than others is of second order, and left out.

use super::expected::EchoLight;
use super::likelihood::{ECHO, Likelihood};
use super::walk::WalkCorrection;

/// Energies and efficiencies that stand for all: middles of eight equal parts of a normal distribution, in standard deviations.
const NODES: [f64; 8] = [
    -1.534_120_5,
    -0.887_146_6,
    -0.488_776_4,
    -0.157_310_7,
    0.157_310_7,
    0.488_776_4,
    0.887_146_6,
    1.534_120_5,
];

impl WalkCorrection {
    /// Standard deviation of an echo's place, bins, that comes of what differs from SPAD to SPAD and from pulse to pulse.
    pub(super) fn error_of_spreads(&self, light: &EchoLight) -> f64 {
        let response = &self.response;
        let mut all = 0.0;
        if response.dead_time_spread > 0.0 {
            let of_mean = response.dead_time_spread / (response.counting.spads as f64).sqrt();
            let longer = response.clone().with_dead_times(1.0 + of_mean);
            all = self.seeming_move(light, &longer.chances(light));
        }
        if response.energy_spread > 0.0 {
            let reach = 3f64.sqrt() * response.energy_spread;
            // A pulse's energy is uniform.
            let parts = NODES.len() as f64;
            let energies =
                (0..NODES.len()).map(|part| 1.0 + reach * ((2 * part + 1) as f64 / parts - 1.0));
            let of_energy = |energy: f64| {
                response.chances(&EchoLight {
                    signal: energy * light.signal,
                    ..*light
                })
            };
            let chances = mean(energies.map(of_energy));
            all = libm::hypot(all, self.seeming_move(light, &chances));
        }
        if response.pde_spread > 0.0 {
            let efficiencies = NODES.map(|node| (1.0 + response.pde_spread * node).max(0.0));
            let ln_none = |efficiency: f64| -> Vec<f64> {
                let chances = response.chances(&EchoLight {
                    signal: efficiency * light.signal,
                    background_per_bin: efficiency * light.background_per_bin,
                    ..*light
                });
                let ln_none = |chance: f64| libm::log1p(-chance.min(1.0 - 1e-15));
                chances.into_iter().map(ln_none).collect()
            };
            let chances = mean(efficiencies.into_iter().map(ln_none));
            let chances: Vec<f64> = chances.into_iter().map(|ln| -libm::expm1(ln)).collect();
            all = libm::hypot(all, self.seeming_move(light, &chances));
        }
        all
    }

    /// How far from its place a light seems to be, bins, if its bins count with these chances.
    fn seeming_move(&self, light: &EchoLight, chances: &[f64]) -> f64 {
        let cycles = f64::from(self.laser_cycles);
        let counts: Vec<f64> = chances.iter().map(|chance| chance * cycles).collect();
        let likelihood = Likelihood {
            response: &self.response,
            counts: &counts,
            cycles,
            bins: 0..counts.len(),
            free: ECHO,
            most_background: f64::INFINITY,
        };
        let seeming = likelihood.maximise(light).light;
        (seeming.position_bins - light.position_bins).abs()
    }
}

/// The mean of each bin over all nodes.
fn mean(nodes: impl Iterator<Item = Vec<f64>>) -> Vec<f64> {
    let mut sums: Vec<f64> = Vec::new();
    for of_node in nodes {
        sums.resize(of_node.len(), 0.0);
        for (sum, number) in sums.iter_mut().zip(of_node) {
            *sum += number / NODES.len() as f64;
        }
    }
    sums
}
