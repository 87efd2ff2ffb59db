//! Eq. 18–19: the Gaussian stand-ins for the Poisson counts of Eq. 17.
//!
//! Printed, their standard deviation is the mean itself, which makes P_D independent of the number of
//! laser cycles; √mean is meant. Both are summed over the counts x = 0, 1, 2, … as Eq. 17 says.
//! A long sum is replaced by the integral with Euler and Maclaurin's correction at its lower end, whose
//! first neglected term is below 10⁻¹⁵ once the deviations exceed 1024 counts.

use crate::numerics::{integrate, ln_normal_below, normal_density};

/// Standard deviations from which a sum is taken as an integral.
const SMOOTH_SIGMA: f64 = 1024.0;

/// Beyond this number of standard deviations a normal density is zero.
const REACH: f64 = 39.0;

/// P_D with the standard deviation that is meant, √mean. `signal` µ_S and `background` µ_B are mean counts.
pub(super) fn as_meant(signal: f64, background: f64, bins: u32) -> f64 {
    let total = signal + background;
    sum(total, total.sqrt(), background, background.sqrt(), bins)
}

/// P_D exactly as Eq. 18 and 19 are printed: each mean serves as its own standard deviation.
pub(super) fn as_printed(signal: f64, background: f64, bins: u32) -> f64 {
    let total = signal + background;
    sum(total, total, background, background, bins)
}

/// Σ over x ≥ 0 of the density of N(`mean_s`, `sigma_s`²) times Φ((x − `mean_b`)/`sigma_b`)^(M−1).
fn sum(mean_s: f64, sigma_s: f64, mean_b: f64, sigma_b: f64, bins: u32) -> f64 {
    let others = f64::from(bins) - 1.0;
    let summand = |x: f64| {
        let ln_below = if sigma_b > 0.0 {
            ln_normal_below((x - mean_b) / sigma_b)
        } else {
            0.0
        };
        let z = (x - mean_s) / sigma_s;
        libm::exp(others * ln_below - 0.5 * z * z) * normal_density(0.0) / sigma_s
    };
    if sigma_s == 0.0 {
        return 1.0; // no light: every bin holds nothing, and the formula lets ties win
    }
    let start = (mean_s - REACH * sigma_s).max(0.0).floor();
    let end = mean_s + REACH * sigma_s;
    // Counts below `seam` are added one by one, those from it on as an integral.
    let seam = match (sigma_s < SMOOTH_SIGMA, sigma_b < SMOOTH_SIGMA) {
        (true, _) => end.ceil(),
        (false, true) => (mean_b + REACH * sigma_b).ceil().max(start),
        (false, false) => start,
    };
    let one_by_one: f64 = (start as u64..seam as u64).map(|x| summand(x as f64)).sum();
    if seam >= end {
        return one_by_one;
    }
    let mut breaks = vec![seam, end];
    for (mean, sigma) in [(mean_s, sigma_s), (mean_b, sigma_b)] {
        breaks.extend((-39..=39).map(|k| mean + f64::from(k) * sigma));
    }
    breaks.retain(|x| (seam..=end).contains(x));
    breaks.sort_by(f64::total_cmp);
    let slope = 0.5 * (summand(seam + 1.0) - summand(seam - 1.0));
    one_by_one + integrate(summand, &breaks, 1e-15) + 0.5 * summand(seam) - slope / 12.0
}
