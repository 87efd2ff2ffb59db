//! The cohort engine draws from the distribution of the window engine: means, variances and covariances over many
//! seeds, for every TYPE, mode and place of the window, in little light and in much.
//!
//! `COHORT_SEEDS=n` sets the number of seeds; the more, the smaller the difference that shows.

use guided_dtof::chip::{EventType, Exposure, Mode, SensorConfig};
use guided_dtof::engine::{Cohort, CohortOptions, Engine, LitPixel, Window, stream_config};
use guided_dtof::photon::{PhotonStream, PixelLight, StreamConfig};
use guided_dtof::units::Time;
use rayon::prelude::*;

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

struct Case {
    name: &'static str,
    sensor: SensorConfig,
    stop_periods: u32,
    laser_cycles: u32,
    start: u16,
    light: PixelLight,
    options: CohortOptions,
}

fn case() -> Case {
    Case {
        name: "",
        sensor: SensorConfig::default(),
        stop_periods: 64,
        laser_cycles: 60,
        start: 40,
        light: PixelLight {
            signal_per_cycle: 0.8,
            arrival: Time::from_ns(85),
            background_hz: 40e6,
        },
        options: CohortOptions::default(),
    }
}

fn seeds() -> u64 {
    std::env::var("COHORT_SEEDS")
        .ok()
        .and_then(|n| n.parse().ok())
        .unwrap_or(4_000)
}

impl Case {
    fn stream(&self, seed: u64) -> StreamConfig {
        let exposure = Exposure::new(&self.sensor, self.stop_periods, self.laser_cycles);
        stream_config(&self.sensor, &exposure, seed, Time::from_ps(1_900))
    }

    /// Compares both engines; differences in standard errors may not exceed what their number lets expect.
    fn agrees(&self) {
        let exposure = Exposure::new(&self.sensor, self.stop_periods, self.laser_cycles);
        let window = Window::new(&self.sensor, &exposure);
        let cohort = Cohort::new(&self.sensor, &exposure, self.options);
        let expected = cohort
            .expected(&self.stream(0), self.start, &self.light)
            .unwrap();
        let empty = Moments::new(&expected);
        let pixel = LitPixel {
            number: 5,
            start: self.start,
            light: Some(self.light),
        };
        let by_photons = (0..seeds())
            .into_par_iter()
            .fold(
                || empty.clone(),
                |moments, seed| {
                    let stream = PhotonStream::new(&self.stream(seed));
                    moments.add(&window.expose(&stream, &[pixel]).unwrap().histograms[0])
                },
            )
            .reduce(|| empty.clone(), Moments::merge);
        let drawn = (0..4 * seeds())
            .into_par_iter()
            .fold(
                || empty.clone(),
                |moments, seed| {
                    let stream = self.stream(seed);
                    moments.add(&cohort.draw(&stream, 5, self.start, &self.light).unwrap())
                },
            )
            .reduce(|| empty.clone(), Moments::merge);
        let bins = expected.len();
        let (mut worst, mut relative) = (0.0f64, 0.0f64);
        for i in 0..bins {
            let variance = by_photons.covariance(i, i);
            let exact = variance == 0.0 && by_photons.mean(i) == drawn.mean(i);
            let error = (variance / by_photons.n + drawn.covariance(i, i) / drawn.n).sqrt();
            let difference = drawn.mean(i) - by_photons.mean(i);
            let z = if exact { 0.0 } else { difference / error };
            let own = (drawn.mean(i) - expected[i]) / (drawn.covariance(i, i) / drawn.n).sqrt();
            worst = worst.max(z.abs()).max(if exact { 0.0 } else { own.abs() });
            relative = relative.max((by_photons.mean(i) / expected[i] - 1.0).abs());
            for j in 0..=i {
                let (a, b) = (by_photons.covariance(i, j), drawn.covariance(i, j));
                // Of nearly Gaussian counts.
                let spread = by_photons.covariance(i, i) * by_photons.covariance(j, j) + a * a;
                let z = (a - b) / (spread * (1.0 / by_photons.n + 1.0 / drawn.n)).sqrt();
                worst = worst.max(if spread == 0.0 { 0.0 } else { z.abs() });
            }
        }
        println!(
            "{}: worst difference {worst:.2} standard errors; means within {relative:.1e}",
            self.name
        );
        // 152 comparisons, some of skewed counts: one in 10⁵ such sets passes 6.
        assert!(worst < 6.0, "{}: {worst} standard errors", self.name);
    }
}

#[test]
fn little_light_pooled() {
    Case {
        name: "little light",
        ..case()
    }
    .agrees();
}

#[test]
fn little_light_in_the_joint_state() {
    let options = CohortOptions {
        neglect: 0.0,
        ..CohortOptions::default()
    };
    Case {
        name: "little light, joint",
        options,
        ..case()
    }
    .agrees();
}
