//! The lights that may have made a strong echo: fits from many starts.
//!
//! ```text
//!   for each of many signals: the place at which the rising edge is as it was counted ─► the likeliest of these ─► fits ─► the best
//!   no light explains the counts, or it is strong ─► the same again, in fine steps of time
//! ```
//!
//! Strong light leaves the rising edge and little else, so that a weaker echo here and a stronger one there may explain the same counts.

use super::{WalkCorrection, WalkLeft};
use crate::chip::EventType;
use crate::ranging::expected::{EchoLight, Steps};
use crate::ranging::likelihood::{BESIDE, Fit, Likelihood};
use crate::ranging::peak::Peak;
use crate::ranging::pulse::share_before;

/// Ambiguity: another light whose deviance is larger by less than [`AS_GOOD`], at a place more than [`ELSEWHERE`]
/// bounds away.
const AS_GOOD: f64 = 9.0;
const ELSEWHERE: f64 = 4.0;

/// Deviance by which another light may be less likely and still be within a standard deviation.
const RIVAL: f64 = 1.0;

/// How much more the deviance of a fit may be than the least of them before it is left out. Of 3100 random lights the best of those with the
/// fewest steps, and those as good as it, had at most 20 more, where a third of all had more than 30. With a THRESHOLD it was up to 28 000,
/// and none is left out.
const FAR: f64 = 30.0;

/// Decades from signal to signal, and fits at most, where the edge is seen and few signals do not lead to all lights.
const DENSE: (f64, usize) = (0.1, 4);

impl WalkCorrection {
    /// Fits from many starts, the best first: for each of many signals the best place. Under a THRESHOLD the best alone.
    ///
    /// # Errors
    /// Under a THRESHOLD, two lights that explain the counts from different places.
    pub(super) fn of_many(
        &self,
        likelihood: &Likelihood<'_>,
        (peak, background_per_bin): (&Peak, f64),
    ) -> Result<Vec<Fit>, WalkLeft> {
        let edge = self.rising_edge(likelihood, background_per_bin);
        let has_threshold = self.response.counting.threshold > 0;
        let follows_edge = edge.is_some_and(|(bin, _)| self.edge_is_seen(bin)) && !has_threshold;
        let near = |steps: Steps, (decades, fits): (f64, usize)| {
            let places = |signal: f64| {
                let places = self.places(edge, peak.peak_bin, signal).into_iter();
                let light = |position_bins| EchoLight {
                    position_bins,
                    signal,
                    background_per_bin,
                    sigma_bins: self.response.pulse_sigma_bins,
                };
                places.map(light).collect()
            };
            let mut starts = best_of_each(likelihood, steps, decades, places);
            if decades == DENSE.0 {
                starts = least_of(&starts);
            }
            starts.sort_by(|a, b| a.0.total_cmp(&b.0));
            let starts = starts.iter().take(fits).map(|(_, start)| *start);
            let mut near: Vec<Fit> = Vec::new();
            for fit in likelihood.near_each(&starts.collect::<Vec<_>>(), steps) {
                add_new(&mut near, fit);
            }
            if has_threshold { near } else { likely(near) }
        };
        // Where light makes bins count less, too, each light has its own places.
        let signals = match edge {
            Some(_) if follows_edge && self.has_short_pulses() => DENSE,
            Some(_) if follows_edge => (0.4, 2),
            // With a THRESHOLD few bins count, and several lights may explain them: with 8 fits for 24, one more depth of 512 was a hundredth of its bound beside.
            Some(_) if has_threshold => (0.2, 8),
            Some(_) => (0.2, 24),
            None => (0.2, 8),
        };
        let mut fits = likelihood.refined_each(&near(Steps::Coarse, signals));
        // The fewest steps take strong light for some other.
        let is_told = |fit: &Fit| fit.explains() && !self.is_sharp(fit);
        if !has_threshold && !fits.iter().any(is_told) {
            let signals = if follows_edge { DENSE } else { signals };
            for fit in near(Steps::Fine, signals) {
                add_new(&mut fits, fit);
            }
            fits = likely(fits);
        }
        // Those that have converged first, then the most likely. Under a THRESHOLD the most likely may converge slowly.
        let is_behind = |fit: &Fit| !has_threshold && !fit.has_converged;
        fits.sort_by(|a, b| {
            let behind = is_behind(a).cmp(&is_behind(b));
            behind.then(a.deviance.total_cmp(&b.deviance))
        });
        let best = *fits.first().ok_or(WalkLeft::NotConverged)?;
        if !has_threshold {
            return Ok(fits);
        }
        if has_another(&fits) {
            return Err(WalkLeft::Ambiguous);
        }
        Ok(vec![with_rivals(best, &fits, likelihood)])
    }

    /// Whether an echo whose edge is in this bin begins within the window.
    fn edge_is_seen(&self, bin: usize) -> bool {
        bin as f64 > 1.0 + self.response.pulse_sigma_bins
    }

    /// Places at which an echo of `signal` photons may lie.
    fn places(&self, edge: Option<(usize, f64)>, peak_bin: usize, signal: f64) -> Vec<f64> {
        let sigma_bins = self.response.pulse_sigma_bins;
        let Some((bin, photons)) = edge else {
            let places = (-10..=40).map(|n| 0.15 * f64::from(n) * (1.0 + sigma_bins));
            return places.map(|off| peak_bin as f64 + off).collect();
        };
        // The light until the end of the edge's bin says how much of the pulse has come.
        let end = bin as f64 + 0.5 - sigma_bins * quantile(photons / signal);
        let beside: &[f64] = if self.has_short_pulses() {
            &[-0.3, -sigma_bins, 0.0, sigma_bins, 0.3]
        } else {
            &[-0.3, 0.0, 0.3]
        };
        let mut places: Vec<f64> = beside.iter().map(|off| end + off).collect();
        if !self.edge_is_seen(bin) {
            let early = (-12..=12).map(|n| 0.3 * f64::from(n));
            places.extend(early.filter(|place| *place >= -BESIDE * sigma_bins));
        }
        places
    }

    /// The first bin of an echo's rising edge, and the photons of the echo until its end. Of a full bin these are not known: where pulses are
    /// short, the edge is then the bin before it, with half a photon of all laser cycles at least.
    pub(super) fn rising_edge(
        &self,
        likelihood: &Likelihood<'_>,
        background: f64,
    ) -> Option<(usize, f64)> {
        let counting = self.response.counting;
        if counting.event_type != EventType::Greater {
            return None;
        }
        let reached = self.response.reached(likelihood.counts, likelihood.cycles);
        let light = |(counts, reached): (&f64, &f64)| {
            self.response.steady_light((counts / reached).min(0.99)) - background
        };
        let bins = likelihood.counts.iter().zip(&reached).map(light);
        let bins: Vec<f64> = bins.collect();
        let most = bins.iter().copied().fold(0.0, f64::max);
        let bin = bins.iter().position(|&photons| photons > 0.2 * most)?;
        let is_full = likelihood.counts[bin] > 0.98 * likelihood.cycles;
        if is_full && bin > 0 && self.has_short_pulses() {
            let least = self.response.steady_light(0.5 / likelihood.cycles);
            return Some((bin - 1, bins[bin - 1].max(least)));
        }
        Some((bin, bins[bin]))
    }
}

/// The best place of each of many signals, and its deviance.
fn best_of_each(
    likelihood: &Likelihood<'_>,
    steps: Steps,
    decades: f64,
    places: impl Fn(f64) -> Vec<EchoLight>,
) -> Vec<(f64, EchoLight)> {
    let numbers = (-0.6 / decades) as i32..=(4.0 / decades) as i32;
    let signals = numbers.map(|number| libm::pow(10f64, decades * f64::from(number)));
    let of_each: Vec<Vec<EchoLight>> = signals.map(places).collect();
    let mut deviances = likelihood.deviances(&of_each.concat(), steps).into_iter();
    let best_of = |lights: &Vec<EchoLight>| {
        let judged = lights.iter().copied().zip(deviances.by_ref());
        let best = judged.min_by(|a, b| a.1.total_cmp(&b.1));
        best.map(|(light, deviance)| (deviance, light))
    };
    of_each.iter().filter_map(best_of).collect()
}

/// The fits that are not much less likely than the best.
fn likely(mut fits: Vec<Fit>) -> Vec<Fit> {
    let deviances = fits.iter().map(|fit| fit.deviance);
    let least = deviances.fold(f64::INFINITY, f64::min);
    fits.retain(|fit| fit.deviance < least + FAR);
    fits
}

/// Starts of signals in a row that are better than their neighbours: those between lead to the same light.
fn least_of(starts: &[(f64, EchoLight)]) -> Vec<(f64, EchoLight)> {
    let deviance = |at: usize| starts.get(at).map_or(f64::INFINITY, |start| start.0);
    let is_least = |at: &usize| {
        deviance(*at) <= deviance(at + 1) && deviance(*at) < deviance(at.wrapping_sub(1))
    };
    let least = (0..starts.len()).filter(is_least);
    least.map(|at| starts[at]).collect()
}

/// Standard deviations before which this share of a Gaussian pulse has come; no farther than its ends.
pub(super) fn quantile(share: f64) -> f64 {
    let (mut low, mut high) = (-6.0, 6.0);
    for _ in 0..20 {
        let middle = 0.5 * (low + high);
        if share_before(middle).0 < share {
            low = middle;
        } else {
            high = middle;
        }
    }
    0.5 * (low + high)
}

/// Whether another light than the first one explains the counts about as well from elsewhere.
pub(super) fn has_another(fits: &[Fit]) -> bool {
    let best = fits[0];
    let is_another = |fit: &Fit| {
        let off = (fit.light.position_bins - best.light.position_bins).abs();
        fit.deviance < best.deviance + AS_GOOD
            && off > ELSEWHERE * best.bound_bins.max(fit.bound_bins)
    };
    fits.iter().filter(|fit| fit.has_converged).any(is_another)
}

/// The best fit, with a bound that reaches to every other light with which the counts are about as likely.
pub(super) fn with_rivals(best: Fit, fits: &[Fit], likelihood: &Likelihood<'_>) -> Fit {
    let rivals = fits.iter().filter(|fit| {
        fit.deviance < best.deviance + RIVAL
            && fit.light.background_per_bin <= likelihood.most_background
    });
    let offs = rivals.map(|fit| (fit.light.position_bins - best.light.position_bins).abs());
    Fit {
        bound_bins: offs.fold(best.bound_bins, f64::max),
        ..best
    }
}

/// Adds a fit unless one before found the same light; whether it did.
pub(super) fn add_new(fits: &mut Vec<Fit>, fit: Fit) -> bool {
    let is_same = |other: &Fit| {
        let off = (fit.light.position_bins - other.light.position_bins).abs();
        let times = libm::log(fit.light.signal / other.light.signal).abs();
        (fit.deviance - other.deviance).abs() < 0.1 + 1e-3 * fit.deviance
            && off < 0.1 * fit.bound_bins.min(1.0)
            && times < 0.1
    };
    let is_new = !fits.iter().any(is_same);
    if is_new {
        fits.push(fit);
    }
    is_new
}
