//! Further echoes of a window: what the first one leaves unexplained.
//!
//! ```text
//!   counts    ▁▁▂▇█▃▁▁▁▃▅▂▁▁▁▁
//!   expected  ▁▁▂▇█▃▁▁▁▁▁▁▁▁▁▁   of the first echo, its background and the SPADs that it blinds
//!   taken     ··├───┤·├───┤···   bins of echoes that are known
//! ```
//!
//! A stretch of bins with more counts than are expected is another echo where chance makes as many no more often than the
//! false-alarm rate, somewhere in the window. Chernoff's bound of that chance is taken: ln P(K ≥ k) ≤ k − μ − k·ln(k/μ) of a Poisson
//! number K with mean μ, so that false alarms are rarer than asked for.

use std::ops::Range;

/// One echo of a window.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct WindowReturn {
    /// Where it must lie, bins.
    pub position_bins: f64,
    /// Cramér-Rao bound of the position, bins; `None` where the counts are not those of an echo of this pulse.
    pub bound_bins: Option<f64>,
    /// Photons of it that the SPADs would detect in a laser cycle without dead time; without a bound its counts over the laser cycles.
    pub photons: f64,
    /// Standard deviation of the echo beyond that of the pulse, bins; `None` where it has no bound.
    pub spread_bins: Option<f64>,
    /// −log₁₀ of a bound on the chance that no echo makes as many counts.
    pub confidence: f64,
}

/// Returns besides the first, strongest first.
pub type Others = [Option<WindowReturn>; 3];

/// Another stretch of counts.
#[derive(Debug, Clone, PartialEq)]
pub(super) struct CountStretch {
    /// Its bins, up to where no more counts come than expected.
    pub bins: Range<usize>,
    /// The fullest of them.
    pub peak_bin: usize,
    /// See [`WindowReturn::confidence`].
    pub confidence: f64,
}

/// The search for more echoes.
pub(super) struct Search<'a> {
    pub counts: &'a [f64],
    /// Counts that what is known would make.
    pub expected: Vec<f64>,
    /// Bins of echoes that are known.
    pub taken: Vec<bool>,
    /// Bins of a stretch.
    pub width: usize,
    pub ln_false_alarm: f64,
}

impl Search<'_> {
    /// The bins about `peak_bin`, up to where counts are as expected, rise again or are another echo's.
    pub(super) fn extent(&self, peak_bin: usize) -> Range<usize> {
        let is_of_it = |bin: usize, from: usize| {
            let most = self.expected[bin] + (self.expected[bin] + 1.0).sqrt();
            let rises =
                self.counts[bin] > self.counts[from] + 3.0 * (self.counts[from] + 1.0).sqrt();
            !self.taken[bin] && self.counts[bin] > most && !rises
        };
        let (mut first, mut last) = (peak_bin, peak_bin);
        while first > 0 && is_of_it(first - 1, first) {
            first -= 1;
        }
        while last + 1 < self.counts.len() && is_of_it(last + 1, last) {
            last += 1;
        }
        first..last + 1
    }

    /// Whether counts on both sides of some bins are down to what is expected, so that the echo is seen whole.
    pub(super) fn is_apart(&self, bins: &Range<usize>) -> bool {
        let beside = [bins.start.checked_sub(1), Some(bins.end)];
        let mut beside = beside
            .into_iter()
            .flatten()
            .filter(|&bin| bin < self.counts.len());
        beside.all(|bin| {
            let expected = self.expected[bin];
            self.counts[bin] <= expected + 3.0 * (expected + 1.0).sqrt()
        })
    }

    /// Whether the counts of all other bins scatter about what is expected as they should, to four standard deviations.
    pub(super) fn is_explained(&self) -> bool {
        let bins = (0..self.counts.len()).filter(|&bin| !self.taken[bin]);
        let (freedom, squares) = bins.fold((0.0, 0.0), |(freedom, squares), bin| {
            let off = self.counts[bin] - self.expected[bin];
            (
                freedom + 1.0,
                squares + off * off / self.expected[bin].max(1.0),
            )
        });
        freedom > 2.0 && squares <= freedom + 4.0 * f64::sqrt(2.0 * freedom)
    }

    /// Marks bins as those of a known echo.
    pub(super) fn mark_bins(&mut self, bins: Range<usize>) {
        let end = bins.end.min(self.taken.len());
        let first = bins.start.min(end);
        self.taken[first..end].fill(true);
    }

    /// The next echo, whose bins are then taken.
    pub(super) fn next(&mut self) -> Option<CountStretch> {
        let bins = self.counts.len();
        loop {
            let (ln_chance, first) = (0..=bins - self.width)
                .filter(|&first| !self.taken[first..first + self.width].contains(&true))
                .map(|first| (self.ln_chance(first..first + self.width), first))
                .min_by(|a, b| a.0.total_cmp(&b.0))?;
            let ln_of_all = ln_chance + libm::log(bins as f64);
            if ln_of_all > self.ln_false_alarm {
                return None;
            }
            let more = |bin: &usize| self.counts[*bin] - self.expected[*bin];
            let peak_bin =
                (first..first + self.width).max_by(|a, b| more(a).total_cmp(&more(b)))?;
            let found = self.extent(peak_bin);
            let found = found.start.min(first)..found.end.max(first + self.width);
            let is_flank = self.is_flank(peak_bin);
            self.mark_bins(found.clone());
            if !is_flank {
                return Some(CountStretch {
                    bins: found,
                    peak_bin,
                    confidence: -ln_of_all / std::f64::consts::LN_10,
                });
            }
        }
    }

    /// Whether counts rise from a bin into a known echo's.
    fn is_flank(&self, bin: usize) -> bool {
        let beside = [bin.checked_sub(1), Some(bin + 1)].into_iter().flatten();
        let mut beside = beside.filter(|&beside| beside < self.counts.len());
        beside.any(|beside| self.taken[beside] && self.counts[beside] > self.counts[bin])
    }

    /// ln of a bound on the chance of as many counts.
    fn ln_chance(&self, bins: Range<usize>) -> f64 {
        let counts: f64 = self.counts[bins.clone()].iter().sum();
        // Where nothing is expected, half a count in all bins is.
        let expected: f64 = self.expected[bins].iter().sum();
        let expected = expected.max(0.5 * self.width as f64 / self.counts.len() as f64);
        if counts <= expected {
            return 0.0;
        }
        counts - expected - counts * libm::log(counts / expected)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn search(counts: &[f64], expected: f64, taken: Range<usize>) -> Search<'_> {
        let mut search = Search {
            counts,
            expected: vec![expected; counts.len()],
            taken: vec![false; counts.len()],
            width: 2,
            ln_false_alarm: libm::log(1e-3),
        };
        search.mark_bins(taken);
        search
    }

    #[test]
    fn echoes_beside_a_known_one_are_found_and_its_flanks_are_not() {
        let counts = [
            20., 22., 300., 400., 90., 19., 21., 18., 70., 120., 60., 17., 20., 23., 40., 44.,
        ];
        // Its last bin is left to be a flank.
        let mut search = search(&counts, 20.0, 2..4);
        let first = search.next().unwrap();
        assert_eq!((first.bins, first.peak_bin), (8..11, 9));
        let second = search.next().unwrap();
        assert_eq!((second.bins, second.peak_bin), (14..16, 15));
        assert!(first.confidence > second.confidence && second.confidence > 3.0);
        assert_eq!(search.next(), None);
    }

    #[test]
    fn what_scatters_is_no_echo() {
        let counts = [
            20., 25., 17., 28., 19., 14., 22., 26., 24., 18., 30., 21., 16., 20., 23., 15.,
        ];
        assert_eq!(search(&counts, 20.0, 0..0).next(), None);
    }
}
