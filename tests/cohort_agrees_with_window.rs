//! The cohort engine draws from the distribution of the window engine: means, variances and covariances over many
//! seeds, for every TYPE, mode and place of the window, in little light and in much.
//!
//! `COHORT_SEEDS=n` sets the number of seeds; the more, the smaller the difference that shows.

use guided_dtof::chip::{EventType, Exposure, Mode, Overflow, SensorConfig};
use guided_dtof::engine::{Cohort, CohortOptions, Engine, LitPixel, Window, stream_config};
use guided_dtof::photon::{DeadTimeLaw, PhotonStream, PixelLight, StreamConfig};
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

struct Case<'n> {
    name: &'n str,
    sensor: SensorConfig,
    stop_periods: u32,
    laser_cycles: u32,
    start: u16,
    light: PixelLight,
    law: DeadTimeLaw,
    options: CohortOptions,
}

fn case() -> Case<'static> {
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
        law: DeadTimeLaw::NonParalysable,
        options: CohortOptions::default(),
    }
}

fn seeds() -> u64 {
    std::env::var("COHORT_SEEDS")
        .ok()
        .and_then(|n| n.parse().ok())
        .unwrap_or(2_000)
}

impl Case<'_> {
    fn stream(&self, seed: u64) -> StreamConfig {
        let exposure = Exposure::new(&self.sensor, self.stop_periods, self.laser_cycles);
        let mut stream = stream_config(&self.sensor, &exposure, seed, Time::from_ps(1_900));
        stream.spads.law = self.law;
        stream
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
        let saturates = expected
            .iter()
            .any(|mean| mean + 6.0 * mean.sqrt() > (1u32 << self.sensor.bin_bits).into());
        let (mut worst, mut relative) = (0.0f64, 0.0f64);
        for (i, &expected) in expected.iter().enumerate() {
            let variance = by_photons.covariance(i, i);
            let exact = variance == 0.0 && by_photons.mean(i) == drawn.mean(i);
            let error = (variance / by_photons.n + drawn.covariance(i, i) / drawn.n).sqrt();
            let difference = drawn.mean(i) - by_photons.mean(i);
            let z = if exact { 0.0 } else { difference / error };
            let own = (drawn.mean(i) - expected) / (drawn.covariance(i, i) / drawn.n).sqrt();
            worst = worst.max(z.abs());
            if !saturates && !exact {
                worst = worst.max(own.abs());
            }
            relative = relative.max((by_photons.mean(i) / expected - 1.0).abs());
            // The spread of a covariance is known for nearly Gaussian counts, not for those that stop at a limit.
            let others = if saturates { 0..0 } else { 0..i + 1 };
            for j in others {
                let (a, b) = (by_photons.covariance(i, j), drawn.covariance(i, j));
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

fn options(neglect: f64) -> CohortOptions {
    CohortOptions {
        neglect,
        ..CohortOptions::default()
    }
}

#[test]
fn the_pool_of_spads() {
    let light = PixelLight {
        background_hz: 15e6,
        signal_per_cycle: 0.3,
        ..case().light
    };
    let name = "pool, 15 Mcounts/s";
    Case {
        name,
        light,
        options: options(1.0),
        ..case()
    }
    .agrees();
}

#[test]
fn the_joint_state() {
    for (name, sub_bins) in [
        ("joint state, 40 Mcounts/s", 1),
        ("joint state in 4 steps", 4),
    ] {
        let options = CohortOptions {
            sub_bins,
            ..options(0.0)
        };
        Case {
            name,
            options,
            ..case()
        }
        .agrees();
    }
}

#[test]
fn paralysable_spads_in_both_ways() {
    for (name, neglect) in [
        ("paralysable, joint state", 0.0),
        ("paralysable, pool", 1.0),
    ] {
        let (law, options) = (DeadTimeLaw::Paralysable, options(neglect));
        Case {
            name,
            law,
            options,
            ..case()
        }
        .agrees();
    }
}

#[test]
fn the_pool_in_finer_steps() {
    for (name, law) in [
        ("pool in 4 steps", DeadTimeLaw::NonParalysable),
        ("paralysable, pool in 4 steps", DeadTimeLaw::Paralysable),
    ] {
        let options = CohortOptions {
            sub_bins: 4,
            ..options(1.0)
        };
        Case {
            name,
            law,
            options,
            ..case()
        }
        .agrees();
    }
}

#[test]
fn much_light_in_finer_steps() {
    let light = PixelLight {
        background_hz: 400e6,
        signal_per_cycle: 10.0,
        ..case().light
    };
    let options = CohortOptions {
        sub_bins: 4,
        ..options(0.0)
    };
    let name = "joint state, 400 Mcounts/s";
    Case {
        name,
        light,
        options,
        stop_periods: 200,
        laser_cycles: 30,
        ..case()
    }
    .agrees();
}

#[test]
fn coincidences_of_each_type() {
    let light = PixelLight {
        background_hz: 150e6,
        signal_per_cycle: 4.0,
        ..case().light
    };
    for (event_type, threshold, neglect) in [
        (EventType::Greater, 1, 0.0),
        (EventType::Greater, 1, 1.0),
        (EventType::Equal, 1, 0.0),
        (EventType::Less, 2, 0.0),
        (EventType::Less, 1, 1.0),
    ] {
        let sensor = SensorConfig {
            event_type,
            threshold,
            ..SensorConfig::default()
        };
        let name = format!("{event_type:?} {threshold}, neglect {neglect}");
        let options = options(neglect);
        Case {
            name: &name,
            sensor,
            light,
            options,
            stop_periods: 120,
            laser_cycles: 30,
            ..case()
        }
        .agrees();
    }
}

#[test]
fn windows_at_both_ends_and_in_the_conventional_mode() {
    let light = PixelLight {
        arrival: Time::from_ns(4),
        ..case().light
    };
    let conventional = SensorConfig {
        mode: Mode::Conventional,
        event_type: EventType::Less,
        threshold: 1,
        ..SensorConfig::default()
    };
    for (name, start, arrival, sensor) in [
        (
            "first window",
            0,
            Time::from_ns(160),
            SensorConfig::default(),
        ),
        (
            "window across STOP",
            9,
            Time::from_ns(4),
            SensorConfig::default(),
        ),
        (
            "window after an echo",
            22,
            Time::from_ns(9),
            SensorConfig::default(),
        ),
        (
            "last window",
            62,
            Time::from_ns(160),
            SensorConfig::default(),
        ),
        ("conventional", 0, Time::from_ns(140), conventional),
    ] {
        let light = PixelLight { arrival, ..light };
        Case {
            name,
            start,
            light,
            sensor,
            laser_cycles: 12,
            ..case()
        }
        .agrees();
    }
}

#[test]
fn counters_saturate_and_wrap_alike() {
    for overflow in [Overflow::Saturate, Overflow::Wrap] {
        let sensor = SensorConfig {
            bin_bits: 4,
            overflow,
            ..SensorConfig::default()
        };
        let name = format!("{overflow:?}");
        Case {
            name: &name,
            sensor,
            ..case()
        }
        .agrees();
    }
}

#[test]
fn finer_steps_come_nearer_to_the_window_engine() {
    let light = PixelLight {
        background_hz: 600e6,
        signal_per_cycle: 0.0,
        ..case().light
    };
    let (sensor, seeds) = (SensorConfig::default(), seeds() / 8);
    let exposure = Exposure::new(&sensor, 400, 30);
    let stream = |seed| stream_config(&sensor, &exposure, seed, Time::from_ps(1_900));
    let window = Window::new(&sensor, &exposure);
    let pixel = LitPixel {
        number: 0,
        start: 380,
        light: Some(light),
    };
    // The light is even, so all bins share one mean.
    let counts: u64 = (0..seeds)
        .into_par_iter()
        .map(|seed| {
            let stream = PhotonStream::new(&stream(seed));
            let exposed = window.expose(&stream, &[pixel]).unwrap();
            exposed.histograms[0]
                .iter()
                .map(|&n| u64::from(n))
                .sum::<u64>()
        })
        .sum();
    let trials = seeds as f64 * 30.0 * 16.0;
    let by_photons = counts as f64 / trials;
    let error = (by_photons * (1.0 - by_photons) / trials).sqrt();
    let mean = |sub_bins| {
        let options = CohortOptions {
            sub_bins,
            ..CohortOptions::default()
        };
        let expected = Cohort::new(&sensor, &exposure, options).expected(&stream(0), 380, &light);
        expected.unwrap()[8] / 30.0
    };
    let finest = mean(64);
    let offs = [1, 2, 4, 8].map(|sub_bins| (mean(sub_bins) - finest).abs());
    println!(
        "an event: {by_photons:.6} ± {error:.6}, in 64 steps {finest:.6}; 1, 2, 4, 8 off by {offs:.7?}"
    );
    assert!((finest - by_photons).abs() < 5.0 * error);
    assert!(offs.windows(2).all(|o| o[1] < 0.6 * o[0]), "{offs:?}");
}
