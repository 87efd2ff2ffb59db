//! Probability of detection: that the peak of a histogram is the bin that holds the echo.
//!
//! Thesis 3.2.2, Eq. 17: P_D = Σ f_S(x)·F_B(x)^(M−1), with f_S the probability of x counts in
//! the signal bin and F_B that a background bin has no more than x. The assumptions are the thesis's: the
//! echo falls into one bin, all bins are independent and share one background. Its text wants
//! the others “lower than x”, its formula allows equal counts; [`Ties`] has both, and the fair coin
//! between them that a peak finder amounts to.
//!
//! Everything is a sum of positive terms, P_D and 1 − P_D alike, so that both have full relative
//! accuracy: about 10⁻¹², down to 10⁻²⁹⁰. A tie with k of the M − 1 others is won with probability
//! 1/(k + 1); summed over k that is Σⱼ Fʲ F₋^(M−1−j)/M with F = P(N ≤ x), F₋ = P(N < x), whose
//! geometric series is closed by ratios of 1 − e^(−t), never by Fᴹ − F₋ᴹ.
//!
//! Large means: a sum over every h-th integer differs from the whole sum, divided by h, by the
//! spectrum of the summand at 2π/h and beyond (Poisson's summation formula). That spectrum decays like a
//! Gaussian times e^(−π²β/h), β ≈ σ/√(2 ln M) being how sharply F^M rises; h = σ/24 keeps it below 10⁻¹⁶
//! for any M below 10⁶.

use super::counts::{Counts, Stride, Tails};
use super::gaussian;
use crate::numerics::ln_exprel_neg;

/// Who wins when a background bin holds exactly as many counts as the signal bin.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash, Default)]
pub enum Ties {
    /// The background bin: the signal bin must hold strictly more (the thesis's text).
    Strict,
    /// Each of the tied bins with equal chance.
    #[default]
    Random,
    /// The signal bin: as Eq. 17 is printed.
    Loose,
}

/// How P_D is computed.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash)]
pub enum DetectionModel {
    /// Eq. 17 with Poisson counts: every photon counts.
    Poisson(Ties),
    /// Eq. 17 with binomial counts: a bin takes one hit per laser cycle, as this chip's does.
    Bernoulli(Ties),
    /// Eq. 18–19 as meant, with the standard deviation √mean.
    Gaussian,
    /// Eq. 18–19 as printed, with the mean in place of the standard deviation.
    GaussianAsPrinted,
}

/// Mean detected photons per laser cycle, and the number of bins.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct PerCycle {
    /// Signal photons per laser cycle in the signal bin (γ_s).
    pub signal: f64,
    /// Background photons per laser cycle in each bin (γ_b).
    pub background: f64,
    /// Bins M ≥ 1.
    pub bins: u32,
}

/// A probability and its complement, each with its own full relative accuracy.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Detection {
    /// P_D.
    pub probability: f64,
    /// 1 − P_D.
    pub miss: f64,
}

impl Detection {
    /// From the two sums; the smaller says what the larger is.
    pub(super) fn new(hit: f64, miss: f64) -> Self {
        if hit < miss {
            Detection {
                probability: hit,
                miss: 1.0 - hit,
            }
        } else {
            Detection {
                probability: 1.0 - miss,
                miss,
            }
        }
    }
}

/// P_D after `cycles` laser cycles.
///
/// The Gaussian models are sums over all counts x ≥ 0 as Eq. 17 has it; where their standard deviation is
/// below about one count they are not probabilities and may exceed 1.
pub fn probability(light: &PerCycle, cycles: u64, model: DetectionModel) -> Detection {
    let n = cycles as f64;
    let (signal, background) = (n * light.signal, n * light.background);
    let known = |probability: f64| Detection {
        probability,
        miss: 1.0 - probability,
    };
    match model {
        DetectionModel::Poisson(ties) => poisson(signal, background, light.bins, ties),
        DetectionModel::Bernoulli(ties) => {
            let counts = |photons_per_cycle| Counts::Bernoulli {
                cycles,
                photons_per_cycle,
            };
            let signal_bin = counts(light.signal + light.background);
            compare(&signal_bin, &counts(light.background), light.bins, ties)
        }
        DetectionModel::Gaussian => known(gaussian::as_meant(signal, background, light.bins)),
        DetectionModel::GaussianAsPrinted => {
            known(gaussian::as_printed(signal, background, light.bins))
        }
    }
}

/// Eq. 17 for Poisson counts: `signal` mean signal counts (µ_S) in one of `bins` bins (M), each of which holds
/// `background` mean background counts (µ_B).
pub fn poisson(signal: f64, background: f64, bins: u32, ties: Ties) -> Detection {
    let signal_bin = Counts::poisson(signal, background);
    compare(&signal_bin, &Counts::poisson(background, 0.0), bins, ties)
}

/// Grid points per standard deviation where means are large; see the module's text.
const POINTS_PER_SIGMA: f64 = 24.0;

/// P(a bin of `signal` counts is the peak among `bins` − 1 others of `background` counts).
pub(crate) fn compare(signal: &Counts, background: &Counts, bins: u32, ties: Ties) -> Detection {
    let others = f64::from(bins) - 1.0;
    let (first, last_signal) = signal.support();
    let last = last_signal.min(background.support().1);
    if bins <= 1 || last < first {
        // Nobody to lose against, or out of everyone's reach.
        return Detection::new(1.0, 0.0);
    }
    let sigma = signal.sigma().min(background.sigma());
    let stride = Stride::exact(sigma, POINTS_PER_SIGMA);
    let tails = Tails::new(background, first, last, stride);
    let stride = stride.counts;
    let (mut hit, mut miss) = (0.0, 0.0);
    for i in 0..tails.at.len() {
        let here = signal.probability(first + i as u64 * stride);
        let ln_win = match ties {
            Ties::Strict => others * tails.ln_below(i),
            Ties::Loose => others * tails.ln_at_most(i),
            Ties::Random => ln_win_by_lot(&tails, i, f64::from(bins)),
        };
        hit += here * libm::exp(ln_win);
        miss -= here * libm::expm1(ln_win);
    }
    (hit, miss) = (hit * stride as f64, miss * stride as f64);
    if hit < miss {
        // No background bin reaches beyond the grid; the signal bin may.
        hit += signal.tail_above(first + (tails.at.len() as u64 - 1) * stride);
    }
    Detection::new(hit, miss)
}

/// ln(Σⱼ Fʲ F₋^(M−1−j)/M) = (M − 1) ln F + ln((1 − e^(−Md))/(M(1 − e^(−d)))), d = ln(F/F₋).
fn ln_win_by_lot(tails: &Tails, i: usize, bins: f64) -> f64 {
    let ln_at_most = tails.ln_at_most(i);
    if tails.below[i] == 0.0 {
        return (bins - 1.0) * ln_at_most - libm::log(bins);
    }
    let d = libm::log1p(tails.at[i] / tails.below[i]);
    (bins - 1.0) * ln_at_most + ln_exprel_neg(bins * d) - ln_exprel_neg(d)
}
