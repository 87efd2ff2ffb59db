//! Precision of the measured time of flight: Thompson's formula and the Cramér-Rao bound.
//!
//! Thesis 3.2.3, Eq. 20 to 22. The four parameters are its own: bin interval a, pulse standard deviation σ,
//! mean background counts per bin µ_B and mean signal counts µ_S after all laser cycles. Precisions are
//! standard deviations in nanoseconds; [`range_m`] makes metres of them.
//!
//! Cramér-Rao: bin i holds λᵢ = µ_B + µ_S·shareᵢ(ε) counts when the pulse lies at ε within a bin, and no
//! unbiased estimator does better than 1/FI(ε), FI = Σ (dλᵢ/dε)²/λᵢ. Targets lie anywhere, so
//! δ = √⟨1/FI⟩ over one bin. All of it is computed in logarithms. For σ ≪ a a pulse in mid-bin tells
//! next to nothing: 1/FI grows like e^(a²/8σ²) and is carried by a sliver around the middle, σ²/a wide,
//! where the quadrature puts its panels. `ln_` functions give what no `f64` could hold.
//!
//! Both µ grow with the number of laser cycles N, and FI with them: δ = δ(1 cycle)/√N without search.

use libm::{exp, log};

use super::pulse::Pulse;
use crate::numerics::{integrate, ln_sum_exp};
use crate::units::SPEED_OF_LIGHT_M_PER_S;

/// Range in metres of `time_ns` of round trip; also of its standard deviation.
pub fn range_m(time_ns: f64) -> f64 {
    0.5e-9 * SPEED_OF_LIGHT_M_PER_S * time_ns
}

/// Round-trip time in nanoseconds of `range_m` metres; also of its standard deviation.
pub fn time_ns(range_m: f64) -> f64 {
    range_m / (0.5e-9 * SPEED_OF_LIGHT_M_PER_S)
}

/// Precision after Thompson, ns (Eq. 20).
///
/// `bin_ns` a, `sigma_ns` σ, `background` µ_B per bin, `signal` µ_S > 0.
pub fn thompson(bin_ns: f64, sigma_ns: f64, background: f64, signal: f64) -> f64 {
    let quantised = (sigma_ns * sigma_ns + bin_ns * bin_ns / 12.0) / signal;
    let root_pi = std::f64::consts::PI.sqrt();
    let noise = 4.0 * root_pi * sigma_ns.powi(3) / bin_ns * (background / signal) / signal;
    (quantised + noise).sqrt()
}

/// The bin interval, in units of σ, at which Eq. 20 is smallest for a given µ_B/µ_S: (24√π·µ_B/µ_S)^(1/3).
///
/// µ_B is held per bin, as in Fig. 33. Eq. 21's 1.5 belongs to µ_B/µ_S = 0.08. At a fixed background *rate*
/// narrower bins are always better.
pub fn thompson_best_ratio(background: f64, signal: f64) -> f64 {
    libm::cbrt(24.0 * std::f64::consts::PI.sqrt() * background / signal)
}

/// The Cramér-Rao bound of a Gaussian pulse, ns; arguments as in [`thompson`].
///
/// Always finite: values beyond `f64` (σ below about a/100, or 0) are returned as the largest one.
pub fn cramer_rao(bin_ns: f64, sigma_ns: f64, background: f64, signal: f64) -> f64 {
    exp(ln_cramer_rao(bin_ns, sigma_ns, background, signal)).min(f64::MAX)
}

/// ln of [`cramer_rao`], which never overflows.
pub fn ln_cramer_rao(bin_ns: f64, sigma_ns: f64, background: f64, signal: f64) -> f64 {
    let pulse = Pulse::Gaussian { sigma_ns };
    ln_bound(&pulse, bin_ns, background, signal, |ln_photons| ln_photons)
}

/// The Cramér-Rao bound of a Gaussian pulse, ns, after one laser cycle in which a bin counts one hit at most, however many photons come;
/// `background` and `signal` are photons of one laser cycle. After N of them it is less by √N.
///
/// A bin counts with probability p = 1 − e^(−λ), so that its information is (dp/dε)²/(p(1 − p)) = (dλ/dε)²/(e^λ − 1): λ of
/// [`cramer_rao`] becomes e^λ − 1. Finite as that is.
pub fn cramer_rao_one_a_cycle(bin_ns: f64, sigma_ns: f64, background: f64, signal: f64) -> f64 {
    let pulse = Pulse::Gaussian { sigma_ns };
    let ln_expm1 = |ln_photons: f64| {
        let photons = exp(ln_photons);
        if photons < 1e-9 {
            ln_photons
        } else {
            photons + log(-libm::expm1(-photons))
        }
    };
    exp(ln_bound(&pulse, bin_ns, background, signal, ln_expm1)).min(f64::MAX)
}

/// The Cramér-Rao bound, ns, for a `pulse` of any shape; infinite when the pulse fits into a bin with room to
/// spare, because such a pulse tells nothing of its place. `background` µ_B per bin, `signal` µ_S.
pub fn bound(pulse: &Pulse, bin_ns: f64, background: f64, signal: f64) -> f64 {
    exp(ln_bound(pulse, bin_ns, background, signal, |ln_photons| {
        ln_photons
    }))
}

/// ln of the bound where counts of mean λ tell (dλ/dε)²/v of the place; `ln_v` gives ln v of ln λ.
fn ln_bound(
    pulse: &Pulse,
    bin_ns: f64,
    background: f64,
    signal: f64,
    ln_v: impl Fn(f64) -> f64,
) -> f64 {
    if pulse.sigma_ns() == 0.0 {
        return f64::INFINITY;
    }
    let (before, after) = pulse.reach_ns();
    let first = (before / bin_ns).floor() as i64 - 2;
    let last = (after / bin_ns).ceil() as i64 + 2;
    // Bins much narrower than the pulse sample a smooth function: every `stride`-th stands for its neighbours.
    let stride = match pulse {
        Pulse::Gaussian { sigma_ns } => ((sigma_ns / bin_ns / 24.0) as i64).max(1),
        Pulse::Measured(_) => 1,
    };
    let information = |position: f64| {
        let terms = (first..=last).step_by(stride as usize).map(|i| {
            let from = (i as f64 - 0.5) * bin_ns - position;
            ln_information(pulse, from, from + bin_ns, (background, signal), &ln_v)
        });
        terms.fold(f64::NEG_INFINITY, ln_sum_exp) + log(stride as f64)
    };
    let edge = |i: i64| (i as f64 - 0.5) * bin_ns;
    let bins = (first..=last).map(|i| (edge(i), edge(i + 1)));
    ln_root_mean(information, &position_breaks(pulse, bins, edge(0), edge(1)))
}

/// The Cramér-Rao bound, ns, in bins of unequal width, as delay lines make them.
///
/// `edges_ns` ascending bin edges; `background_per_ns` counts per nanosecond of bin width; `signal` counts of
/// the whole pulse. δ = √⟨1/FI⟩ over pulse positions from `from_ns` to `to_ns`; what falls outside the edges
/// is lost.
pub fn bound_in_bins(
    pulse: &Pulse,
    edges_ns: &[f64],
    background_per_ns: f64,
    signal: f64,
    (from_ns, to_ns): (f64, f64),
) -> f64 {
    let (before, after) = pulse.reach_ns();
    let information = |position: f64| {
        let start = edges_ns
            .partition_point(|e| *e < position + before)
            .saturating_sub(2);
        let end = (edges_ns.partition_point(|e| *e < position + after) + 2).min(edges_ns.len());
        let bins = edges_ns[start..end].windows(2);
        let terms = bins.map(|bin| {
            let background = background_per_ns * (bin[1] - bin[0]);
            ln_information(
                pulse,
                bin[0] - position,
                bin[1] - position,
                (background, signal),
                &|ln_photons| ln_photons,
            )
        });
        terms.fold(f64::NEG_INFINITY, ln_sum_exp)
    };
    let bins = edges_ns.windows(2).map(|bin| (bin[0], bin[1]));
    exp(ln_root_mean(
        information,
        &position_breaks(pulse, bins, from_ns, to_ns),
    ))
}

/// ln of what one bin contributes to the information about the pulse's position: ln((µ_S·slope)²/v(µ_B + µ_S·share)).
fn ln_information(
    pulse: &Pulse,
    from: f64,
    to: f64,
    (background, signal): (f64, f64),
    ln_v: &impl Fn(f64) -> f64,
) -> f64 {
    let bin = pulse.ln_bin(from, to);
    if bin.slope == f64::NEG_INFINITY {
        return f64::NEG_INFINITY;
    }
    let ln_photons = ln_sum_exp(log(background), log(signal) + bin.share);
    2.0 * (log(signal) + bin.slope) - ln_v(ln_photons)
}

/// Pulse positions in \[`first`, `last`\] between which 1/FI is smooth: halving steps towards the middle of each of
/// `bins` for a Gaussian, a sample on an edge for a measured pulse.
fn position_breaks(
    pulse: &Pulse,
    bins: impl Iterator<Item = (f64, f64)>,
    first: f64,
    last: f64,
) -> Vec<f64> {
    let mut breaks = vec![first, last];
    for (from, to) in bins {
        match pulse {
            Pulse::Gaussian { sigma_ns } => {
                let (middle, half) = (0.5 * (from + to), 0.5 * (to - from));
                let sliver = sigma_ns / half * sigma_ns;
                breaks.extend([from, middle, to]);
                let halved = |step: &f64| Some(0.5 * step);
                let steps = std::iter::successors(Some(0.5 * half), halved);
                for step in steps.take_while(|step| *step > 0.25 * sliver) {
                    breaks.extend([middle - step, middle + step]);
                }
            }
            Pulse::Measured(pulse) => breaks.extend(pulse.knots_ns().map(|t| from - t)),
        }
    }
    breaks.retain(|t| (first..=last).contains(t));
    breaks.sort_by(f64::total_cmp);
    breaks
}

/// ln √⟨e^(−ln_information)⟩ over the positions from the first to the last of `breaks`.
fn ln_root_mean(ln_information: impl Fn(f64) -> f64, breaks: &[f64]) -> f64 {
    let least = breaks
        .iter()
        .map(|&t| ln_information(t))
        .fold(f64::INFINITY, f64::min);
    if least == f64::NEG_INFINITY {
        return f64::INFINITY;
    }
    let span = breaks[breaks.len() - 1] - breaks[0];
    // Logarithms are rounded in proportion to their size, which no quadrature gets below.
    let tolerance = 1e-15 * (1.0 + least.abs());
    let mean = integrate(|t| exp(least - ln_information(t)), breaks, tolerance) / span;
    // A place so much worse than all others that the quadrature misses it decides alone.
    0.5 * (log(mean.max(f64::MIN_POSITIVE)) - least)
}

/// Laser cycles for a precision of `target_ns` by the Cramér-Rao bound, when one cycle brings `background` counts
/// per bin (γ_b) and `signal` counts (γ_s). Round up for a whole number.
pub fn cramer_rao_laser_cycles(
    target_ns: f64,
    bin_ns: f64,
    sigma_ns: f64,
    background: f64,
    signal: f64,
) -> f64 {
    (cramer_rao(bin_ns, sigma_ns, background, signal) / target_ns).powi(2)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::numerics::normal_above;

    /// The chances of bins, moved a little either way, at places all over a bin.
    fn one_a_cycle_by_differences(sigma: f64, background: f64, signal: f64) -> f64 {
        const PLACES: u32 = 400;
        const MOVE: f64 = 1e-5;
        let chance = |bin: i32, place: f64| {
            let from = (f64::from(bin) - 0.5 - place) / sigma;
            let share = normal_above(from) - normal_above(from + 1.0 / sigma);
            -libm::expm1(-(background + signal * share))
        };
        let variance = |place: f64| {
            let of_bin = |bin: i32| {
                let slope = (chance(bin, place + MOVE) - chance(bin, place - MOVE)) / (2.0 * MOVE);
                let here = chance(bin, place);
                slope * slope / (here * (1.0 - here))
            };
            1.0 / (-12..=12).map(of_bin).sum::<f64>()
        };
        let places = (0..PLACES).map(|n| (f64::from(n) + 0.5) / f64::from(PLACES) - 0.5);
        (places.map(variance).sum::<f64>() / f64::from(PLACES)).sqrt()
    }

    #[test]
    fn one_hit_a_cycle_tells_less_in_strong_light() {
        for (sigma, background, signal) in [
            (0.7, 0.01, 0.3),
            (0.7, 0.05, 3.0),
            (1.5, 0.2, 1.0),
            (1.5, 1e-6, 8.0),
        ] {
            let found = cramer_rao_one_a_cycle(1.0, sigma, background, signal);
            let slow = one_a_cycle_by_differences(sigma, background, signal);
            assert!((found / slow - 1.0).abs() < 1e-3, "{found} {slow}");
            assert!(found > cramer_rao(1.0, sigma, background, signal));
        }
        let dim = cramer_rao_one_a_cycle(1.0, 0.7, 1e-7, 1e-6);
        assert!((dim / cramer_rao(1.0, 0.7, 1e-7, 1e-6) - 1.0).abs() < 1e-5);
    }

    #[test]
    fn bounds_are_finite_at_every_extreme() {
        for sigma in [0.0, 1e-6, 1.0, 1e4] {
            for background in [0.0, 1e-9, 1.0, 1e9] {
                for signal in [1e-12, 1.0, 1e12] {
                    let found = cramer_rao_one_a_cycle(1.0, sigma, background, signal);
                    assert!(
                        found > 0.0 && found.is_finite(),
                        "{sigma} {background} {signal}: {found}"
                    );
                }
            }
        }
    }
}
