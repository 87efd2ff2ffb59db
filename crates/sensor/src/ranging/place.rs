//! Where an echo may lie, where the curvature of the likelihood does not say it.
//!
//! ```text
//!   likelihood   ▁▂███████▂▁      a pulse shorter than a bin, or light that fires every SPAD within a part of one: any place within the bin
//!                                 explains the counts as well
//!                ▁▂▇▂▁▁▁▂▅▂▁      strong light: a weaker echo here or a stronger one there
//!                    ▲
//!                  mean, and five bounds reach to all that is not unlikely
//! ```
//!
//! The Cramér-Rao bound is that of the place where a fit ends, be it the steep end of a flat stretch. So the place is the mean over all
//! places, each weighed by its likelihood under the best signal there, and the bound their standard deviation.

use super::expected::EchoLight;
use super::likelihood::{Fit, Likelihood, OF_A_WIDTH, ONLY_SIGNAL};

/// Standard deviation of a pulse most of which lies within a bin, bins.
pub(super) const SHORT: f64 = 0.4;

/// Bins either side of a fit in which other places are tried: what a short pulse may be off by, and some more.
const AROUND: f64 = 1.25;

/// Places to a bin.
const PLACES: f64 = 16.0;

/// Places about the fit itself, in its bounds.
const NEAR: [f64; 8] = [-3.0, -2.0, -1.0, -0.5, 0.5, 1.0, 2.0, 3.0];

/// Standard deviations of surfaces, bins: between two bins a pulse ends at a place that its width decides, and any surface has some depth.
const DEPTHS: [f64; 3] = [0.1, 0.2, 0.4];

/// Deviance by which a place may be less likely and still is within five bounds: of 2000 echoes one is beyond.
const UNLIKELY: f64 = 12.0;

/// Deviance by which a place may be less likely and still have others behind it that count: chosen, e⁻³⁰ of the fit's likelihood.
const FAR: f64 = 60.0;

/// Bounds within which such places are.
const REACH: f64 = 4.0;

/// A place that an echo may have.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct EchoPlace {
    /// Bins.
    pub(super) bins: f64,
    /// How many places it stands for, bins.
    pub(super) width: f64,
    /// Variance of those, bins².
    pub(super) variance: f64,
    /// Twice the ln likelihood that it lacks.
    pub(super) deviance: f64,
}

/// The mean of places and its bound, bins.
pub(super) fn mean_place(places: &[EchoPlace]) -> (f64, f64) {
    let least = places.iter().map(|place| place.deviance);
    let least = least.fold(f64::INFINITY, f64::min);
    let weight = |place: &EchoPlace| place.width * libm::exp(0.5 * (least - place.deviance));
    let total: f64 = places.iter().map(weight).sum();
    let mean_of = |value: &dyn Fn(&EchoPlace) -> f64| {
        let weighed = places.iter().map(|place| weight(place) * value(place));
        weighed.sum::<f64>() / total
    };
    let mean = mean_of(&|place| place.bins);
    let variance = mean_of(&|place| place.variance + (place.bins - mean).powi(2));
    let likely = places.iter().filter(|p| p.deviance < least + UNLIKELY);
    let farthest = likely
        .map(|place| (place.bins - mean).abs())
        .fold(0.0, f64::max);
    (mean, variance.sqrt().max(farthest / REACH))
}

/// The fit of a short pulse with the mean of all its places: with the pulse's own width about each of the fits `narrow`, with that of `chosen`,
/// and with those of surfaces that are somewhat deep. If one of these explains the counts plainly better than `chosen`, the light is its.
pub(super) fn averaged(likelihood: &Likelihood<'_>, narrow: &[Fit], chosen: &Fit) -> Fit {
    let least = narrow.iter().map(|fit| fit.deviance);
    let least = least.fold(chosen.deviance, f64::min);
    let (first, others) = narrow.split_first().expect("a fit");
    let likely = others.iter().filter(|fit| fit.deviance < least + UNLIKELY);
    // The first one may have stopped where its place is flat.
    let own = std::iter::once(first).chain(likely);
    let own = own.flat_map(|fit| places_of(likelihood, fit));
    let [place, signal, background, _] = likelihood.free;
    let held = Likelihood {
        free: [place, signal, background, false],
        ..likelihood.clone()
    };
    let with_depth = |light: &EchoLight, depth: f64| EchoLight {
        sigma_bins: libm::hypot(light.sigma_bins, depth),
        ..*light
    };
    let starts = narrow.iter().map(|fit| &fit.light);
    let deep = starts.flat_map(|light| DEPTHS.map(|depth| with_depth(light, depth)));
    let deep = held.maximise_each(&deep.collect::<Vec<_>>());
    let is_wider = chosen.light.sigma_bins > first.light.sigma_bins;
    let wider = deep.iter().chain(is_wider.then_some(chosen));
    // Where these tell no place either, those of the pulse's own width reach as far.
    let steep = wider
        .filter(|fit| fit.bound_bins < 0.5)
        .map(|fit| EchoPlace {
            bins: fit.light.position_bins,
            width: (std::f64::consts::TAU).sqrt() * fit.bound_bins,
            variance: fit.bound_bins.powi(2),
            deviance: fit.deviance,
        });
    // Those behind unlikely ones are left out. Of light beyond all measure no chance is known.
    let known = own.chain(steep).filter(|place| place.deviance.is_finite());
    let places: Vec<EchoPlace> = known.collect();
    if places.is_empty() {
        return *chosen;
    }
    let (position_bins, bound_bins) = mean_place(&places);
    let better = deep
        .iter()
        .filter(|fit| fit.deviance + OF_A_WIDTH < chosen.deviance);
    let better = better.min_by(|a, b| a.deviance.total_cmp(&b.deviance));
    let mut averaged = *better.unwrap_or(chosen);
    averaged.light.position_bins = position_bins;
    averaged.bound_bins = bound_bins;
    averaged
}

/// Places about a fit, each with the best signal there.
fn places_of(likelihood: &Likelihood<'_>, fit: &Fit) -> Vec<EchoPlace> {
    let held = Likelihood {
        free: ONLY_SIGNAL,
        ..likelihood.clone()
    };
    let own = fit.bound_bins.min(1.0 / PLACES);
    let steps = (AROUND * PLACES) as i32;
    let offsets = (-steps..=steps).map(|n| f64::from(n) / PLACES);
    let mut offsets: Vec<f64> = offsets.chain(NEAR.map(|by| by * own)).collect();
    offsets.sort_by(f64::total_cmp);
    offsets.dedup_by(|a, b| *a - *b < 1e-9);
    let middle = offsets.partition_point(|off| *off < 0.0);
    let mut deviances = vec![f64::INFINITY; offsets.len()];
    let mut follow = |order: &mut dyn Iterator<Item = usize>| {
        let mut light = fit.light;
        for at in order {
            light.position_bins = fit.light.position_bins + offsets[at];
            let near = held.roughly_near(&light);
            light.signal = near.light.signal;
            deviances[at] = near.deviance;
            if near.deviance > fit.deviance + FAR {
                break;
            }
        }
    };
    follow(&mut (middle..offsets.len()));
    follow(&mut (0..middle).rev());
    let last = offsets.len() - 1;
    let place = |at: usize| {
        let width = 0.5 * (offsets[(at + 1).min(last)] - offsets[at.saturating_sub(1)]);
        EchoPlace {
            bins: fit.light.position_bins + offsets[at],
            width,
            variance: width * width / 12.0,
            deviance: deviances[at],
        }
    };
    (0..=last).map(place).collect()
}
