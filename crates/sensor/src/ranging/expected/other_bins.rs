//! Mean histograms of sensors other than ours, whose bins no dead time ties together, or only that a laser cycle counts once.
//!
//! ```text
//!   every photon   chance of bin i ∝ λᵢ                                     a count is a Poisson number
//!   first photon   chance of bin i ∝ e^(−λ₀ − … − λᵢ₋₁)·(1 − e^(−λᵢ))       a laser cycle counts at most once, in any of the bins
//! ```
//!
//! Chances are of laser cycles that are cut into many: with few counts in each, binomial counts of bins that are taken for independent have
//! the variances of Poisson numbers. Those of first photons have no more, so that bounds are rather too long there.

use super::{EchoLight, OfBins, PARAMETERS, Response};
use crate::numerics::Dual;

/// How a bin of another sensor counts.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(in crate::ranging) enum OtherBins {
    /// Each photon.
    EveryPhoton,
    /// The first of `parts` laser cycles, as many as one is cut into.
    FirstPhoton { parts: f64 },
}

impl OtherBins {
    /// The chance of every bin, with its slopes with the first K parameters.
    pub(super) fn chances<const K: usize>(
        self,
        response: &Response,
        light: &EchoLight,
    ) -> OfBins<K> {
        let edges: Vec<f64> = (0..=response.bins).map(|edge| edge as f64 - 0.5).collect();
        let [until, by_place, by_width] = response.pulse(light).until_each(&edges);
        let background = light.background_per_bin;
        let mut before = Dual::ZERO;
        let bin = |bin: usize| {
            let growth = |row: &[f64]| row[bin + 1] - row[bin];
            let signal = growth(&until);
            let slopes: [f64; PARAMETERS] =
                [growth(&by_place), signal, background, growth(&by_width)];
            let photons = Dual {
                value: signal + background,
                slope: std::array::from_fn(|parameter| slopes[parameter]),
            };
            match self {
                OtherBins::EveryPhoton => photons,
                OtherBins::FirstPhoton { parts } => {
                    let (hit, _) = (photons * parts).hits();
                    let is_first = (before * -parts).exp();
                    before += photons;
                    is_first * hit * parts.recip()
                }
            }
        };
        (0..response.bins).map(bin).collect()
    }
}
