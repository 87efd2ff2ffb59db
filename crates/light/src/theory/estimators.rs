//! Estimates of the pulse's position in a histogram, whose spread the bounds of [`super::precision`] foretell.
//!
//! Maximum likelihood knows shape, signal and background and reaches the Cramér-Rao bound when the signal is strong.

use super::pulse::Pulse;

/// Stands for a background of zero in likelihoods.
pub const NO_BACKGROUND: f64 = 1e-200;

/// What a histogram with a pulse in it is made of.
#[derive(Debug, Clone, PartialEq)]
pub struct ExpectedHistogram {
    /// Shape of the pulse.
    pub pulse: Pulse,
    /// Width of a bin, ns (a).
    pub bin_ns: f64,
    /// Mean background counts per bin (µ_B).
    pub background: f64,
    /// Mean signal counts of the whole pulse (µ_S).
    pub signal: f64,
}

impl ExpectedHistogram {
    /// Mean counts of each of `bins` bins when the pulse lies `position_ns` after the first bin's beginning.
    #[cfg(test)]
    pub(crate) fn counts(&self, bins: usize, position_ns: f64) -> Vec<f64> {
        (0..bins)
            .map(|i| self.background + self.echo(i, position_ns))
            .collect()
    }

    /// Mean signal counts in bin `i`.
    fn echo(&self, i: usize, position_ns: f64) -> f64 {
        let from = i as f64 * self.bin_ns - position_ns;
        self.signal * self.pulse.share(from, from + self.bin_ns)
    }

    /// Bins that a pulse at `position_ns` touches, of `bins`.
    fn touched(&self, bins: usize, position_ns: f64) -> std::ops::Range<usize> {
        let (before, after) = self.pulse.reach_ns();
        let bin = |t: f64| ((position_ns + t) / self.bin_ns).floor();
        let first = bin(before).clamp(0.0, bins as f64);
        first as usize..(bin(after) + 1.0).clamp(first, bins as f64) as usize
    }

    /// ln of how much likelier `counts` are with a pulse at `position_ns` than without any.
    ///
    /// A background of zero is taken as [`NO_BACKGROUND`], so that one stray count does not forbid every position.
    pub(crate) fn ln_likelihood(&self, counts: &[u32], position_ns: f64) -> f64 {
        let background = self.background.max(NO_BACKGROUND);
        let touched = self.touched(counts.len(), position_ns);
        let terms = touched.map(|i| {
            let echo = self.echo(i, position_ns);
            f64::from(counts[i]) * libm::log1p(echo / background) - echo
        });
        terms.sum()
    }

    /// The position of greatest likelihood, ns after the beginning of the first bin, anywhere within `counts`.
    ///
    /// A scan in steps of half a bin or half a σ, whichever is less, then a golden section around the best.
    pub fn maximum_likelihood(&self, counts: &[u32]) -> f64 {
        let step = 0.5 * self.bin_ns.min(self.pulse.sigma_ns());
        let end = counts.len() as f64 * self.bin_ns;
        greatest(|t| self.ln_likelihood(counts, t), 0.0..end, step)
    }
}

/// What a histogram is made of whose bins are unequal, as those of a delay line.
#[derive(Debug, Clone, PartialEq)]
pub struct InEdges<'a> {
    /// Shape of the pulse.
    pub pulse: &'a Pulse,
    /// Where bins begin, in ascending order, and the last one ends, ns.
    pub edges_ns: &'a [f64],
    /// Mean background counts per ns.
    pub background_per_ns: f64,
    /// Mean signal counts of the whole pulse.
    pub signal: f64,
}

impl InEdges<'_> {
    /// ln of how much likelier `counts`, one for each bin, are with a pulse at `position_ns` than without any. A background of zero
    /// is taken as [`NO_BACKGROUND`].
    pub(crate) fn ln_likelihood(&self, counts: &[u32], position_ns: f64) -> f64 {
        let bins = self.edges_ns.windows(2).zip(counts);
        let terms = bins.map(|(ends, &count)| {
            let [from, to] = [ends[0], ends[1]];
            let background = (self.background_per_ns * (to - from)).max(NO_BACKGROUND);
            let share = self.pulse.share(from - position_ns, to - position_ns);
            let echo = self.signal * share;
            f64::from(count) * libm::log1p(echo / background) - echo
        });
        terms.sum()
    }

    /// The position of greatest likelihood between the first edge and the last, ns; found as by [`ExpectedHistogram::maximum_likelihood`].
    pub fn maximum_likelihood(&self, counts: &[u32]) -> f64 {
        let lengths = self.edges_ns.windows(2).map(|ends| ends[1] - ends[0]);
        let step = 0.5 * lengths.fold(self.pulse.sigma_ns(), f64::min);
        let range = self.edges_ns[0]..self.edges_ns[self.edges_ns.len() - 1];
        greatest(|t| self.ln_likelihood(counts, t), range, step)
    }
}

/// Where `f` is greatest: a scan of `range` in steps, then a golden section around the best.
fn greatest(f: impl Fn(f64) -> f64, range: std::ops::Range<f64>, step: f64) -> f64 {
    let steps = ((range.end - range.start) / step).ceil() as usize;
    let places = (0..=steps).map(|k| range.start + k as f64 * step);
    let scan = places.map(|t| (t, f(t)));
    let best = scan.max_by(|a, b| a.1.total_cmp(&b.1));
    let best = best.map_or(range.start, |(t, _)| t);
    maximum_within(f, best - step, best + step)
}

/// Golden section: where `f` is greatest between `from` and `to`, to the limit that rounding sets.
fn maximum_within(f: impl Fn(f64) -> f64, mut from: f64, mut to: f64) -> f64 {
    let golden = 0.5 * (5f64.sqrt() - 1.0);
    let mut left = to - golden * (to - from);
    let mut right = from + golden * (to - from);
    let (mut at_left, mut at_right) = (f(left), f(right));
    for _ in 0..40 {
        if at_left < at_right {
            (from, left, at_left) = (left, right, at_right);
            right = from + golden * (to - from);
            at_right = f(right);
        } else {
            (to, right, at_right) = (right, left, at_left);
            left = to - golden * (to - from);
            at_left = f(left);
        }
    }
    0.5 * (from + to)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::photon::{Poisson, RandomPurpose, random_stream};
    use crate::theory::precision::cramer_rao;

    const BINS: usize = 24;

    /// RMS error of the maximum likelihood over random positions in mid-histogram.
    fn spread(expected: &ExpectedHistogram, runs: u32) -> f64 {
        let mut squares = 0.0;
        for run in 0..runs {
            let mut random = random_stream(21, RandomPurpose::Photons, run, 0);
            let phase = f64::from(run) / f64::from(runs);
            let position = (BINS as f64 / 2.0 + phase) * expected.bin_ns;
            let counts: Vec<u32> = (expected.counts(BINS, position).iter())
                .map(|&mean| Poisson::new(mean).draw(&mut random))
                .collect();
            squares += (expected.maximum_likelihood(&counts) - position).powi(2);
        }
        (squares / f64::from(runs)).sqrt()
    }

    fn expected(sigma_ns: f64, background: f64, signal: f64) -> ExpectedHistogram {
        ExpectedHistogram {
            pulse: Pulse::Gaussian { sigma_ns },
            bin_ns: 1.0,
            background,
            signal,
        }
    }

    /// An RMS over n runs has a relative standard error of 1/√2n; four of them are allowed.
    #[test]
    fn maximum_likelihood_reaches_the_cramer_rao_bound() {
        let runs = 1_000;
        let error = 4.0 / (2.0 * f64::from(runs)).sqrt();
        for (sigma, background, signal) in [(1.5, 100.0, 3e3), (1.5, 0.5, 300.0), (0.7, 10.0, 2e3)]
        {
            let rms = spread(&expected(sigma, background, signal), runs);
            let ratio = rms / cramer_rao(1.0, sigma, background, signal);
            assert!(
                (ratio - 1.0).abs() < error,
                "{sigma} {background} {signal}: {ratio}"
            );
        }
    }

    #[test]
    fn equal_bins_between_edges_are_those_without() {
        let (offset_ns, e) = (40.0, expected(1.5, 10.0, 2e3));
        let edges_ns: Vec<f64> = (0..=BINS).map(|i| offset_ns + i as f64).collect();
        let in_edges = InEdges {
            pulse: &e.pulse,
            edges_ns: &edges_ns,
            background_per_ns: e.background / e.bin_ns,
            signal: e.signal,
        };
        for position in [3.2, 11.7] {
            let counts: Vec<u32> = (e.counts(BINS, position).iter())
                .map(|&mean| mean as u32)
                .collect();
            let found = in_edges.maximum_likelihood(&counts) - offset_ns;
            assert!(
                (found - e.maximum_likelihood(&counts)).abs() < 1e-6,
                "{found}"
            );
        }
    }

    /// Counts as they are expected, of bins from 0.4 to 1.6 ns: a pulse is found where it is, and not where equal bins put it.
    #[test]
    fn unequal_bins_put_a_pulse_where_it_is() {
        let lengths = (0..BINS).map(|i| 1.0 + 0.6 * (2.1 * i as f64).sin());
        let mut edges_ns = vec![0.0];
        edges_ns.extend(lengths.scan(0.0, |end, length| {
            *end += length;
            Some(*end)
        }));
        let pulse = Pulse::Gaussian { sigma_ns: 1.5 };
        let in_edges = InEdges {
            pulse: &pulse,
            edges_ns: &edges_ns,
            background_per_ns: 1e4,
            signal: 1e6,
        };
        let position = 11.3;
        let counts: Vec<u32> = (edges_ns.windows(2))
            .map(|ends| {
                let echo = 1e6 * pulse.share(ends[0] - position, ends[1] - position);
                (1e4 * (ends[1] - ends[0]) + echo).round() as u32
            })
            .collect();
        let found = in_edges.maximum_likelihood(&counts);
        assert!((found - position).abs() < 1e-3, "{found}");
        let equal = expected(1.5, 1e4, 1e6).maximum_likelihood(&counts);
        assert!((equal - position).abs() > 0.1, "{equal}");
    }

    #[test]
    fn a_lone_count_is_where_the_estimator_puts_the_pulse() {
        let e = expected(1.0, 0.0, 1.0);
        let mut counts = [0; BINS];
        counts[7] = 1;
        assert!((e.maximum_likelihood(&counts) - 7.5).abs() < 1e-6);
    }
}
