//! Laser pulses: when within a pulse a signal photon comes.
//!
//! A pulse is a density in time over equal cells, linear within each cell. A photon takes two steps: Walker's alias
//! table chooses the cell, in constant time whatever the shape. Within it, a linear density is a mixture of an even one
//! and a triangle, and the later (or earlier) of two even draws falls into a triangle. Only comparisons and products are
//! involved, which round alike on every platform.
//!
//! So a measured pulse, linear between its samples, is drawn exactly. Gaussian ones have a shorter way
//! ([`NormalSampler`](super::quantile::NormalSampler)).

use std::sync::Arc;

use crate::units::Time;

/// A measured laser pulse.
#[derive(Debug, Clone, PartialEq)]
pub struct PulseShape {
    /// Time between samples, above 0.
    pub(super) step: Time,
    /// Power at times 0, `step`, 2·`step`, …, in any unit.
    pub(super) samples: Arc<[f64]>,
}

/// Why samples are no laser pulse.
#[derive(Debug, Clone, Copy, PartialEq, Eq, thiserror::Error)]
#[non_exhaustive]
pub enum PulseError {
    /// Fewer than two samples, or far too many.
    #[error("a pulse of {0} samples has no shape; give 2 to 65536")]
    Samples(usize),
    /// A sample is negative, infinite or NaN, or all are zero.
    #[error("a pulse needs finite powers of at least 0, not all of them 0")]
    Power,
    /// The time between samples is not positive.
    #[error("the samples of a pulse need a time above 0 between them")]
    Step,
}

impl PulseShape {
    /// A pulse sampled every `step` from time 0 on, linear in between and dark outside. Units of power do not matter.
    ///
    /// # Errors
    /// When the samples make no pulse.
    pub fn new(step: Time, samples: &[f64]) -> Result<Self, PulseError> {
        if !(2..=1 << 16).contains(&samples.len()) {
            return Err(PulseError::Samples(samples.len()));
        }
        let is_power = |p: &f64| p.is_finite() && *p >= 0.0;
        if !samples.iter().all(is_power) || samples.iter().sum::<f64>() <= 0.0 {
            return Err(PulseError::Power);
        }
        if step <= Time::ZERO {
            return Err(PulseError::Step);
        }
        Ok(PulseShape {
            step,
            samples: samples.into(),
        })
    }

    /// Share of the pulse's photons that come before `time`.
    #[cfg(test)]
    pub(crate) fn cumulative(&self, time: Time) -> f64 {
        let at = time.as_fs() as f64 / self.step.as_fs() as f64;
        let (mut before, mut total) = (0.0, 0.0);
        for (cell, ends) in self.samples.windows(2).enumerate() {
            let (mass, slope) = mass_and_slope(ends);
            let x = (at - cell as f64).clamp(0.0, 1.0);
            before += mass * (x + slope * (x * x - x));
            total += mass;
        }
        before / total
    }
}

impl PulseShape {
    /// Mean time of its photons, fs after its beginning.
    pub fn mean_fs(&self) -> f64 {
        self.moments().0 * self.step.as_fs() as f64
    }

    /// Variance of the times of its photons, fs².
    pub fn variance_fs2(&self) -> f64 {
        let (mean, square) = self.moments();
        let step_fs = self.step.as_fs() as f64;
        (square - mean * mean).max(0.0) * step_fs * step_fs
    }

    /// Skewness and excess kurtosis of the times of its photons, if those of a Gaussian of `sigma` are added: both 0 of a Gaussian pulse.
    pub fn skewness_and_kurtosis(&self, sigma: Time) -> (f64, f64) {
        // Gauss's rule of three points: exact for a linear density times a fourth power.
        const RULE: [(f64, f64); 3] = [
            (0.112_701_665_379_258_3, 5.0 / 18.0),
            (0.5, 8.0 / 18.0),
            (0.887_298_334_620_741_7, 5.0 / 18.0),
        ];
        let (mean, square) = self.moments();
        let (mut total, mut third, mut fourth) = (0.0, 0.0, 0.0);
        for (cell, ends) in self.samples.windows(2).enumerate() {
            for (x, weight) in RULE {
                let mass = weight * (ends[0] + (ends[1] - ends[0]) * x);
                let from_mean = cell as f64 + x - mean;
                total += mass;
                third += mass * from_mean.powi(3);
                fourth += mass * from_mean.powi(4);
            }
        }
        let own = (square - mean * mean).max(0.0);
        let sigma = sigma.as_fs() as f64 / self.step.as_fs() as f64;
        let variance = own + sigma * sigma;
        let cumulants = (third / total, fourth / total - 3.0 * own * own);
        (
            cumulants.0 / (variance * variance.sqrt()),
            cumulants.1 / (variance * variance),
        )
    }

    /// Power `steps` after its beginning.
    pub(super) fn power_at(&self, steps: f64) -> f64 {
        let first = steps as usize;
        let ends = self.samples.get(first).zip(self.samples.get(first + 1));
        match ends {
            Some((from, to)) => from + (to - from) * (steps - first as f64),
            None => *self.samples.get(first).unwrap_or(&0.0),
        }
    }

    /// First and second moment, in steps.
    fn moments(&self) -> (f64, f64) {
        let (mut total, mut first, mut second) = (0.0, 0.0, 0.0);
        for (cell, ends) in self.samples.windows(2).enumerate() {
            let (mass, slope) = mass_and_slope(ends);
            let begin = cell as f64;
            let (mean, square) = (0.5 + slope / 6.0, 1.0 / 3.0 + slope / 6.0);
            total += mass;
            first += mass * (begin + mean);
            second += mass * (begin * begin + 2.0 * begin * mean + square);
        }
        (first / total, second / total)
    }
}

/// Mass of a cell and slope of its density, relative: density 1 + slope·(2x − 1) for x from 0 to 1.
fn mass_and_slope(ends: &[f64]) -> (f64, f64) {
    let sum = ends[0] + ends[1];
    let slope = if sum > 0.0 {
        (ends[1] - ends[0]) / sum
    } else {
        0.0
    };
    (sum / 2.0, slope)
}

/// One column of an alias table: it stands for two cells.
#[derive(Debug, Clone, Copy)]
struct Column {
    /// Words below it mean the column's own cell, others its alias.
    threshold: u32,
    alias: u32,
    /// Words below it mean the triangle of the column's own cell, others the even part.
    steepness: u32,
    /// Whether the triangle rises.
    rises: bool,
}

/// Draws times from a density.
#[derive(Debug, Clone)]
pub(super) struct PulseSampler {
    columns: Vec<Column>,
    first_fs: f64,
    cell_fs: f64,
}

impl PulseSampler {
    /// A measured pulse.
    pub(super) fn measured(shape: &PulseShape) -> Self {
        let cells = shape.samples.windows(2).map(mass_and_slope);
        Self::new(cells, 0.0, shape.step.as_fs() as f64)
    }

    /// Vose's construction of the alias table.
    fn new(cells: impl Iterator<Item = (f64, f64)>, first_fs: f64, cell_fs: f64) -> Self {
        let cells: Vec<(f64, f64)> = cells.collect();
        let total: f64 = cells.iter().map(|(mass, _)| mass).sum();
        let count = cells.len() as f64;
        let mut share: Vec<f64> = cells.iter().map(|(mass, _)| mass * count / total).collect();
        let mut columns: Vec<Column> = cells
            .iter()
            .enumerate()
            .map(|(cell, &(_, slope))| Column {
                threshold: u32::MAX,
                alias: cell as u32,
                steepness: (slope.abs() * 2f64.powi(32)) as u32,
                rises: slope > 0.0,
            })
            .collect();
        let (mut small, mut large): (Vec<usize>, Vec<usize>) =
            (0..cells.len()).partition(|&cell| share[cell] < 1.0);
        while let (Some(&poor), Some(&rich)) = (small.last(), large.last()) {
            small.pop();
            columns[poor].threshold = (share[poor] * 2f64.powi(32)) as u32;
            columns[poor].alias = rich as u32;
            share[rich] -= 1.0 - share[poor];
            if share[rich] < 1.0 {
                large.pop();
                small.push(rich);
            }
        }
        PulseSampler {
            columns,
            first_fs,
            cell_fs,
        }
    }

    /// A time in fs, from four random words.
    #[inline]
    pub(super) fn draw(&self, [tilt, other, place, choice]: [u32; 4]) -> f64 {
        let product = u64::from(choice) * self.columns.len() as u64;
        let own = (product >> 32) as usize;
        let column = &self.columns[own];
        let cell = if (product as u32) < column.threshold {
            own
        } else {
            column.alias as usize
        };
        let column = &self.columns[cell];
        let (earlier, later) = (place.min(other), place.max(other));
        let triangle = if column.rises { later } else { earlier };
        let place = if tilt < column.steepness {
            triangle
        } else {
            place
        };
        let cells = (cell as i64) << 32 | i64::from(place);
        self.first_fs + self.cell_fs * 2f64.powi(-32) * (cells as f64 + 0.5)
    }

    /// Earliest and latest time, fs.
    pub(super) fn range_fs(&self) -> (f64, f64) {
        let width = self.cell_fs * self.columns.len() as f64;
        (self.first_fs, self.first_fs + width)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::photon::{RandomPurpose, random_stream};

    /// Largest distance between the draws' distribution and `cumulative`, times √n (Kolmogorov and Smirnov).
    fn kolmogorov(sampler: &PulseSampler, cumulative: impl Fn(f64) -> f64) -> f64 {
        let mut random = random_stream(5, RandomPurpose::Photons, 0, 0);
        let n = 200_000;
        let mut draws: Vec<f64> = (0..n)
            .map(|_| sampler.draw(std::array::from_fn(|_| random.next_u32())))
            .collect();
        draws.sort_by(f64::total_cmp);
        let distance = |(i, &x): (usize, &f64)| {
            let c = cumulative(x);
            (c - i as f64 / f64::from(n))
                .abs()
                .max((c - (i + 1) as f64 / f64::from(n)).abs())
        };
        let largest = draws.iter().enumerate().map(distance).fold(0.0, f64::max);
        largest * f64::from(n).sqrt()
    }

    /// 1.95 is exceeded once in a thousand samples.
    const LIMIT: f64 = 1.95;

    #[test]
    fn measured_pulses_are_drawn_as_they_are() {
        let samples = [0.0, 5.0, 3.0, 0.0, 0.0, 1.0, 0.5, 0.0];
        let shape = PulseShape::new(Time::from_ps(900), &samples).unwrap();
        assert_eq!(shape.cumulative(Time::from_ps(6_300)), 1.0);
        let sampler = PulseSampler::measured(&shape);
        let d = kolmogorov(&sampler, |x| {
            shape.cumulative(Time::from_fs(x.round() as i64))
        });
        assert!(d < LIMIT, "{d}");
    }

    #[test]
    fn moments_are_those_of_the_draws() {
        let shape = PulseShape::new(Time::from_ps(900), &[0.0, 5.0, 3.0, 0.0, 1.0]).unwrap();
        let sampler = PulseSampler::measured(&shape);
        let mut random = random_stream(6, RandomPurpose::Photons, 0, 0);
        let n = 200_000;
        let draws = (0..n).map(|_| sampler.draw(std::array::from_fn(|_| random.next_u32())));
        let (sum, squares) = draws.fold((0.0, 0.0), |(a, b), x| (a + x, b + x * x));
        let mean = sum / f64::from(n);
        let variance = squares / f64::from(n) - mean * mean;
        let sigma = shape.variance_fs2().sqrt();
        assert!(
            (mean - shape.mean_fs()).abs() < 5.0 * sigma / f64::from(n).sqrt(),
            "{mean}"
        );
        assert!(
            (variance / shape.variance_fs2() - 1.0).abs() < 0.02,
            "{variance}"
        );
    }

    #[test]
    fn every_column_s_probability_ends_up_in_its_cells() {
        let samples: Vec<f64> = (0..500).map(|i| f64::from((i * 37) % 101)).collect();
        let shape = PulseShape::new(Time::from_ps(100), &samples).unwrap();
        let sampler = PulseSampler::measured(&shape);
        let cells = sampler.columns.len();
        let mut mass = vec![0.0; cells];
        for (own, column) in sampler.columns.iter().enumerate() {
            let kept = f64::from(column.threshold) / 2f64.powi(32);
            mass[own] += kept;
            mass[column.alias as usize] += 1.0 - kept;
        }
        let whole: f64 = samples.windows(2).map(|ends| mass_and_slope(ends).0).sum();
        for (cell, (mass, ends)) in mass.iter().zip(samples.windows(2)).enumerate() {
            let expected = mass_and_slope(ends).0 / whole;
            let got = mass / cells as f64;
            // Every threshold is rounded down to a multiple of 2⁻³².
            let rounding = 2f64.powi(-32);
            assert!(
                (got - expected).abs() < rounding,
                "{cell}: {got} {expected}"
            );
        }
    }

    #[test]
    fn shapes_that_are_none_are_refused() {
        let step = Time::from_ns(1);
        assert_eq!(PulseShape::new(step, &[1.0]), Err(PulseError::Samples(1)));
        for bad in [[0.0, 0.0], [1.0, -1.0], [1.0, f64::NAN]] {
            assert_eq!(PulseShape::new(step, &bad), Err(PulseError::Power));
        }
        let still = PulseShape::new(Time::ZERO, &[1.0, 1.0]);
        assert_eq!(still, Err(PulseError::Step));
    }

    #[test]
    fn skewness_and_kurtosis_are_those_of_known_shapes() {
        let shape = |samples: &[f64]| PulseShape::new(Time::from_ns(1), samples).unwrap();
        let rises_at_once = 2.0 * 2f64.sqrt() / 5.0;
        for (samples, skewness, kurtosis) in [
            (&[1.0, 1.0][..], 0.0, -1.2),
            (&[0.0, 1.0, 0.0], 0.0, -0.6),
            (&[1.0, 0.0], rises_at_once, -0.6),
        ] {
            let shape = shape(samples);
            let found = shape.skewness_and_kurtosis(Time::ZERO);
            assert!((found.0 - skewness).abs() < 1e-9, "{samples:?}: {found:?}");
            assert!((found.1 - kurtosis).abs() < 1e-9, "{samples:?}: {found:?}");
            // A Gaussian as wide as the pulse itself doubles the variance.
            let sigma = Time::from_fs(shape.variance_fs2().sqrt().round() as i64);
            let wider = shape.skewness_and_kurtosis(sigma);
            assert!((wider.0 - skewness / 8f64.sqrt()).abs() < 1e-6, "{wider:?}");
            assert!((wider.1 - kurtosis / 4.0).abs() < 1e-6, "{wider:?}");
        }
    }
}
