//! Binomial numbers of large mean, by rejection from a transformed uniform number: Hörmann's BTRS, *The generation of
//! binomial random variates*, J. Stat. Comput. Simul. 46 (1993).
//!
//! Four proposals of five are taken unseen. The others are weighed without a branch, so that several go abreast.

use super::words::RandomWords;
use crate::numerics::{branchless, stirling_error, stirling_series};

/// The number of successes in `trials` trials, each with probability `p` = 1 − `q` up to a half; the mean is at least
/// 10.
#[derive(Debug, Clone, Copy)]
pub(super) struct Rejection {
    trials: f64,
    p: f64,
    q: f64,
    deviation: f64,
    a: f64,
    b: f64,
}

/// Two uniform numbers, and the place that the first leads to.
#[derive(Debug, Clone, Copy)]
pub(super) struct Proposal {
    /// How far from the ends of its interval the first number is.
    us: f64,
    v: f64,
    pub place: f64,
}

impl Rejection {
    #[inline(always)]
    pub(super) fn new(trials: f64, p: f64, q: f64) -> Self {
        let deviation = (trials * p * q).sqrt();
        let b = 1.15 + 2.53 * deviation;
        Rejection {
            trials,
            p,
            q,
            deviation,
            a: -0.0873 + 0.0248 * b + 0.01 * p,
            b,
        }
    }

    /// The proposal that `u` and `v` in [0, 1) make.
    #[inline(always)]
    pub(super) fn propose(&self, u: f64, v: f64) -> Proposal {
        let u = u - 0.5;
        let us = 0.5 - u.abs();
        let centre = self.trials * self.p + 0.5;
        let place = (2.0 * self.a / us + self.b) * u + centre;
        Proposal { us, v, place }
    }

    /// Whether a proposal is taken unseen.
    #[inline(always)]
    pub(super) fn takes(&self, proposal: &Proposal) -> bool {
        (proposal.us >= 0.07) & (proposal.v <= 0.92 - 4.2 / self.b)
    }

    /// Whether a proposal that is not taken unseen passes, unless it lies [at an end](Self::is_at_an_end).
    #[inline(always)]
    pub(super) fn passes(&self, proposal: &Proposal) -> bool {
        self.weigh(proposal, stirling_series)
    }

    /// Whether a proposal is one that [`Rejection::passes`] cannot weigh.
    #[inline(always)]
    pub(super) fn is_at_an_end(&self, proposal: &Proposal) -> bool {
        // The series is in powers of k + 1 and good from 11 on.
        let (k, mode) = (branchless::floor(proposal.place), self.mode());
        k.min(mode).min(self.trials - k.max(mode)) < 10.0
    }

    /// Draws on until a proposal passes.
    #[inline]
    pub(super) fn draw(&self, random: &mut RandomWords) -> u64 {
        loop {
            let proposal = self.propose(random.uniform(), random.coarse());
            if self.takes(&proposal) || self.passes_anywhere(&proposal) {
                return proposal.place as u64;
            }
        }
    }

    /// As [`Rejection::passes`], also at the ends.
    #[cold]
    pub(super) fn passes_anywhere(&self, proposal: &Proposal) -> bool {
        if self.is_at_an_end(proposal) {
            self.weigh(proposal, |n| stirling_error(n as u64))
        } else {
            self.passes(proposal)
        }
    }

    #[inline(always)]
    fn weigh(&self, proposal: &Proposal, stirling: impl Fn(f64) -> f64) -> bool {
        let &Proposal { us, v, place } = proposal;
        let alpha = (2.83 + 5.1 / self.b) * self.deviation;
        let height = branchless::ln(v * alpha / (self.a / (us * us) + self.b));
        let k = branchless::floor(place);
        // Both are asked for: the likelihood of what cannot be may be any number.
        (k >= 0.0) & (k <= self.trials) & (height <= self.log_likelihood_to_mode(k, stirling))
    }

    /// The most likely number.
    #[inline(always)]
    fn mode(&self) -> f64 {
        branchless::floor((self.trials + 1.0) * self.p)
    }

    /// ln of the probability of `k` successes, less that of the most likely number.
    #[inline(always)]
    fn log_likelihood_to_mode(&self, k: f64, stirling: impl Fn(f64) -> f64) -> f64 {
        let (n, odds, mode) = (self.trials, self.p / self.q, self.mode());
        let ln = branchless::ln;
        // Stirling's formula is in powers of k + 1 here, which 0! suits, too.
        (mode + 0.5) * ln((mode + 1.0) / (odds * (n - mode + 1.0)))
            + (n + 1.0) * ln((n - mode + 1.0) / (n - k + 1.0))
            + (k + 0.5) * ln(odds * (n - k + 1.0) / (k + 1.0))
            + stirling(mode + 1.0)
            + stirling(n - mode + 1.0)
            - stirling(k + 1.0)
            - stirling(n - k + 1.0)
    }
}
