//! How much of an echo has come until a time: the edge of a Gaussian pulse, with late avalanches behind it.
//!
//! The share of a Gaussian before a time is from a table, because a histogram of 16 bins asks for a hundred of them. Between its points
//! the table is a cubic of the right values and slopes, which is right to 3·10⁻⁹ of the pulse, and to 10⁻⁵ of the share itself where that
//! is above 10⁻⁹.

use std::sync::LazyLock;

use crate::numerics::{normal_above, normal_density};
use crate::photon::{TAIL_REACH, late_edge};

/// Standard deviations from its centre where a pulse begins and ends: 10⁻¹¹ of it is left out, less than a photon of 10¹⁰.
pub(super) const PULSE_REACH: f64 = 6.7;

/// Photons whose avalanches are late ([`DiffusionTail`](crate::photon::DiffusionTail)).
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct Tail {
    pub(super) share: f64,
    /// Time constant.
    pub(super) bins: f64,
}

/// Light of an echo on a SPAD; times in bins.
#[derive(Debug, Clone, Copy)]
pub(super) struct Pulse {
    signal: f64,
    centre: f64,
    sigma: f64,
    tail: Option<Tail>,
    /// Before and after these nothing comes.
    pub(super) starts: f64,
    pub(super) ends: f64,
}

impl Pulse {
    /// With the mean of its photons at `position`.
    pub(super) fn new(signal: f64, position: f64, sigma: f64, tail: Option<Tail>) -> Self {
        let centre = position - tail.map_or(0.0, |tail| tail.share * tail.bins);
        let last_bins = tail.map_or(0.0, |tail| TAIL_REACH * tail.bins);
        Pulse {
            signal,
            centre,
            sigma,
            tail,
            starts: centre - PULSE_REACH * sigma,
            ends: centre + PULSE_REACH * sigma + last_bins,
        }
    }

    /// From `before` standard deviations before its centre to `after` ones behind it, and its late avalanches.
    pub(super) fn extent(&self, before: f64, after: f64) -> [f64; 2] {
        let late = self.tail.map_or(0.0, |tail| TAIL_REACH * tail.bins);
        let ends = self.centre + after * self.sigma + late;
        [self.centre - before * self.sigma, ends]
    }

    /// Photons until each of some times, which rise, and the slopes of these photons with place and ln width.
    pub(super) fn until_each(&self, times: &[f64]) -> [Vec<f64>; 3] {
        let mut rows = [(); 3].map(|()| vec![0.0; times.len()]);
        self.until_each_in(times, |at, values| {
            for (row, value) in rows.iter_mut().zip(values) {
                row[at] = value;
            }
        });
        rows
    }

    /// The same, told with the number of each time by which some photons have come.
    #[inline(always)]
    pub(super) fn until_each_in(&self, times: &[f64], mut tell: impl FnMut(usize, [f64; 3])) {
        let first = times.partition_point(|time| *time <= self.starts);
        let end = times.partition_point(|time| *time < self.ends);
        let within = (first..end).map(|at| (at, times[at]));
        if let Some(tail) = &self.tail {
            for (at, time) in within {
                tell(at, self.with_tail(tail, time));
            }
        } else {
            let table = &*TABLE;
            let per_sigma = 1.0 / self.sigma;
            for (at, time) in within {
                let z = (time - self.centre) * per_sigma;
                let (share, density) = share_in(table, z);
                let by_z = -self.signal * density;
                tell(at, [self.signal * share, by_z * per_sigma, by_z * z]);
            }
        }
        for at in end..times.len() {
            tell(at, [self.signal, 0.0, 0.0]);
        }
    }

    /// The same at a time at which the pulse goes on, with late avalanches.
    fn with_tail(&self, tail: &Tail, time: f64) -> [f64; 3] {
        let (signal, sigma) = (self.signal, self.sigma);
        let z = (time - self.centre) / sigma;
        let (share, density) = share_before(z);
        let [late, late_density, by_width] = late_edge(time - self.centre, sigma, tail.bins);
        let both = |prompt: f64, late: f64| signal * (prompt + tail.share * (late - prompt));
        [
            both(share, late),
            -both(density / sigma, late_density),
            both(-z * density, by_width),
        ]
    }
}

/// Where the table ends, standard deviations either side, and its points to each.
const REACH: f64 = 7.0;
const POINTS: f64 = 32.0;

/// Share and density.
type Point = (f64, f64);

static TABLE: LazyLock<Vec<Point>> = LazyLock::new(|| {
    let points = (2.0 * REACH * POINTS) as usize;
    let node = |i: usize| i as f64 / POINTS - REACH;
    (0..=points + 1)
        .map(|i| (normal_above(-node(i)), normal_density(node(i))))
        .collect()
});

/// Share of the pulse that comes before `z` standard deviations after its centre, and its slope with z.
pub(super) fn share_before(z: f64) -> (f64, f64) {
    share_in(&TABLE, z)
}

#[inline(always)]
fn share_in(table: &[Point], z: f64) -> (f64, f64) {
    let at = (z + REACH) * POINTS;
    if !(0.0..2.0 * REACH * POINTS).contains(&at) {
        return (f64::from(u8::from(z > 0.0)), 0.0);
    }
    let first = at as usize;
    let ((from, slope_from), (to, slope_to)) = (table[first], table[first + 1]);
    let (u, h) = (at - first as f64, 1.0 / POINTS);
    let v = 1.0 - u;
    let rise = to - from;
    let (a, b) = (slope_from * h - rise, rise - slope_to * h);
    let bend = v * a + u * b;
    let share = from + u * (rise + v * bend);
    (share, POINTS * (rise + (v - u) * bend + u * v * (b - a)))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_table_is_the_normal_distribution() {
        for i in 0..14_000 {
            let z = -7.0 + f64::from(i) * 1e-3 + 3e-4;
            let (share, (found, slope)) = (normal_above(-z), share_before(z));
            let error = (found - share).abs();
            assert!(
                error < 3e-9 && (share < 1e-9 || error < 1e-5 * share),
                "{z}: {error}"
            );
            let error = (slope - normal_density(z)).abs();
            assert!(error < 2e-6, "{z}: slope off by {error}");
        }
        assert_eq!([-7.01, -40.0].map(share_before), [(0.0, 0.0); 2]);
        assert_eq!([7.01, 40.0].map(share_before), [(1.0, 0.0); 2]);
    }
}
