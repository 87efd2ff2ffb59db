//! What SPADs of unequal dead time add to the bound of a depth.
//!
//! Ranging knows the mean dead time d of the array. The n SPADs of a macropixel have another mean: with a relative spread s it is
//! off by d·s/√n, standard deviation. Counts of such SPADs seem to come from another place:
//!
//! ```text
//!   light ── SPADs with d·(1 + s/√n) ── mean counts ── the most likely light for SPADs with d
//!     └───────────────────────── difference of places: added to the bound ─────────────┘
//! ```
//!
//! It is of first order in s. That some SPADs of a macropixel are blind for longer than others is of second order, and left out.

use super::expected::EchoLight;
use super::likelihood::{ECHO, Likelihood};
use super::walk::WalkCorrection;

impl WalkCorrection {
    /// Standard deviation of an echo's place, bins, that comes of dead times which are not known one by one.
    pub(super) fn error_of_dead_times(&self, light: &EchoLight) -> f64 {
        let response = &self.response;
        if response.dead_time_spread == 0.0 {
            return 0.0;
        }
        let of_mean = response.dead_time_spread / (response.counting.spads as f64).sqrt();
        let cycles = f64::from(self.laser_cycles);
        let chances = response
            .clone()
            .with_dead_times(1.0 + of_mean)
            .chances(light);
        let counts: Vec<f64> = chances.iter().map(|chance| chance * cycles).collect();
        let likelihood = Likelihood {
            response,
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
