//! Means, variances and covariances of both engines over many seeds, for one macropixel under one light.

use guided_dtof::chip::{Exposure, SensorConfig};
use guided_dtof::engine::{Cohort, CohortOptions, Expose, LitPixel, Window, stream_config};
use guided_dtof::photon::{DeadTimeLaw, PhotonStream, PixelLight, StreamConfig};
use guided_dtof::units::Time;
use rayon::prelude::*;

/// Counts over all seeds that are no difference of means.
const FEW_COUNTS: f64 = 5.0;

/// Sums over seeds of counts and of their products.
#[derive(Clone)]
struct Moments {
    n: f64,
    sums: Vec<f64>,
    /// Products of counts less `about`, bin by bin.
    products: Vec<f64>,
    about: Vec<f64>,
}

impl Moments {
    fn new(about: &[f64]) -> Self {
        let bins = about.len();
        Moments {
            n: 0.0,
            sums: vec![0.0; bins],
            products: vec![0.0; bins * bins],
            about: about.to_vec(),
        }
    }

    fn add(mut self, counts: &[u16]) -> Self {
        let bins = counts.len();
        let d: Vec<f64> = counts
            .iter()
            .zip(&self.about)
            .map(|(&c, a)| f64::from(c) - a)
            .collect();
        self.n += 1.0;
        for i in 0..bins {
            self.sums[i] += d[i];
            for j in 0..=i {
                self.products[i * bins + j] += d[i] * d[j];
            }
        }
        self
    }

    fn merge(mut self, other: Self) -> Self {
        self.n += other.n;
        self.sums
            .iter_mut()
            .zip(&other.sums)
            .for_each(|(a, b)| *a += b);
        self.products
            .iter_mut()
            .zip(&other.products)
            .for_each(|(a, b)| *a += b);
        self
    }

    fn mean(&self, i: usize) -> f64 {
        self.about[i] + self.sums[i] / self.n
    }

    fn covariance(&self, i: usize, j: usize) -> f64 {
        let (i, j) = (i.max(j), i.min(j));
        let bins = self.sums.len();
        self.products[i * bins + j] / self.n - self.sums[i] * self.sums[j] / (self.n * self.n)
    }
}

/// A macropixel, its light and its exposure.
pub struct Case<'n> {
    pub name: &'n str,
    pub sensor: SensorConfig,
    pub stop_periods: u32,
    pub laser_cycles: u32,
    pub start: u16,
    pub light: PixelLight,
    pub law: DeadTimeLaw,
    pub sigma: Time,
    pub options: CohortOptions,
    /// Seeds of the comparison.
    pub seeds: u64,
}

/// A target in bright daylight.
pub fn case() -> Case<'static> {
    Case {
        name: "",
        sensor: SensorConfig::default(),
        stop_periods: 64,
        laser_cycles: 60,
        start: 40,
        light: PixelLight::echo(0.8, Time::from_ns(85)).with_background(40e6),
        law: DeadTimeLaw::NonParalysable,
        sigma: Time::from_ps(1_900),
        options: CohortOptions::default(),
        seeds: seeds(),
    }
}

/// `COHORT_SEEDS`, or as many as show a difference of a fiftieth of a standard deviation.
pub fn seeds() -> u64 {
    std::env::var("COHORT_SEEDS")
        .ok()
        .and_then(|n| n.parse().ok())
        .unwrap_or(2_000)
}

impl Case<'_> {
    fn stream(&self, seed: u64) -> StreamConfig {
        let exposure = Exposure::new(&self.sensor, self.stop_periods, self.laser_cycles);
        let mut stream = stream_config(&self.sensor, &exposure, seed, self.sigma);
        stream.spads.law = self.law;
        stream
    }

    /// Compares both engines; differences in standard errors may not exceed what their number lets expect.
    pub fn agrees(&self) {
        let exposure = Exposure::new(&self.sensor, self.stop_periods, self.laser_cycles);
        let window = Window::new(&self.sensor, &exposure);
        let cohort = Cohort::new(&self.sensor, &exposure, self.options);
        // Other lasers' pulses come at the same times for all seeds.
        let light = PhotonStream::new(&self.stream(0))
            .with_trains_as_echoes(&self.light, 0..exposure.stop(1).as_fs());
        let expected = cohort
            .of_macropixel(5)
            .expected(&self.stream(0), self.start, &light)
            .unwrap();
        let empty = Moments::new(&expected);
        let pixels = [LitPixel {
            number: 5,
            start: self.start,
            light: Some(self.light.clone()),
        }];
        let by_photons = (0..self.seeds)
            .into_par_iter()
            .fold(
                || empty.clone(),
                |moments, seed| {
                    let stream = PhotonStream::new(&self.stream(seed));
                    let exposed = window.expose(&stream, &pixels).unwrap();
                    moments.add(&exposed.histograms[0])
                },
            )
            .reduce(|| empty.clone(), Moments::merge);
        let drawn = (0..4 * self.seeds)
            .into_par_iter()
            .fold(
                || empty.clone(),
                |moments, seed| {
                    let stream = PhotonStream::new(&self.stream(seed));
                    let exposed = cohort.expose(&stream, &pixels).unwrap();
                    moments.add(&exposed.histograms[0])
                },
            )
            .reduce(|| empty.clone(), Moments::merge);
        let saturates = expected
            .iter()
            .any(|mean| mean + 6.0 * mean.sqrt() > (1u32 << self.sensor.bin_bits).into());
        let (mut worst, mut relative) = (0.0f64, 0.0f64);
        let cycles = f64::from(self.laser_cycles);
        // What is nearly never or nearly always counted shows no spread of its own.
        let variance = |i: usize| {
            let binomial = expected[i] * (1.0 - expected[i] / cycles);
            if saturates {
                by_photons.covariance(i, i)
            } else {
                binomial.max(by_photons.covariance(i, i))
            }
        };
        let standard = |difference: f64, variance: f64, n: f64| {
            if difference == 0.0 {
                0.0
            } else {
                // Nor are a few counts one.
                (difference.abs() - FEW_COUNTS / n).max(0.0) / (variance / n).sqrt()
            }
        };
        for (i, &expected) in expected.iter().enumerate() {
            let (photons, own) = (by_photons.mean(i), drawn.mean(i));
            worst = worst.max(standard(own - photons, 1.25 * variance(i), by_photons.n));
            if !saturates {
                worst = worst.max(standard(own - expected, variance(i), drawn.n));
            }
            relative = relative.max((photons / expected - 1.0).abs());
            // The spread of a covariance is known for nearly Gaussian counts, not for those that stop at a limit.
            let others = if saturates { 0..0 } else { 0..i + 1 };
            for j in others {
                let (a, b) = (by_photons.covariance(i, j), drawn.covariance(i, j));
                // Counts that are rare spread as their own fourth moments do.
                let spread =
                    variance(i) * variance(j) + a * a + a.abs().min(variance(i).min(variance(j)));
                worst = worst.max(standard(a - b, 1.25 * spread, by_photons.n));
            }
        }
        println!(
            "{}: worst difference {worst:.2} standard errors; means within {relative:.1e}",
            self.name
        );
        if worst >= 6.0 {
            for (i, &expected) in expected.iter().enumerate() {
                let (photons, drawn) = (by_photons.mean(i), drawn.mean(i));
                let error = (by_photons.covariance(i, i) / by_photons.n).sqrt();
                println!(
                    "bin {i}: by photons {photons:.5} ± {error:.5}, drawn {drawn:.5}, computed {expected:.5}"
                );
            }
        }
        // 152 comparisons, some of skewed counts: one in 10⁵ such sets passes 6.
        assert!(worst < 6.0, "{}: {worst} standard errors", self.name);
    }
}
