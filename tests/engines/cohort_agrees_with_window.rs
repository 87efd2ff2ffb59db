//! The cohort engine draws from the distribution of the window engine: means, variances and covariances over many
//! seeds, for every TYPE, mode and place of the window, in little light and in much.
//!
//! `COHORT_SEEDS=n` sets the number of seeds; the more, the smaller the difference that shows.

use guided_dtof::chip::{EventType, Exposure, Mode, Overflow, SensorConfig};
use guided_dtof::engine::{Cohort, CohortOptions, Engine, LitPixel, Window, stream_config};
use guided_dtof::photon::{
    Avalanches, DeadTimeLaw, Photon, PhotonStream, PixelLight, SpadEvent, StreamConfig, philox_key,
};
use guided_dtof::units::Time;
use proptest::prelude::*;
use rand::rngs::StdRng;
use rand::{RngExt, SeedableRng};
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

struct Case<'n> {
    name: &'n str,
    sensor: SensorConfig,
    stop_periods: u32,
    laser_cycles: u32,
    start: u16,
    light: PixelLight,
    law: DeadTimeLaw,
    sigma: Time,
    options: CohortOptions,
    /// Where the photons of the comparison come from.
    photons: Photons,
}

#[derive(Clone, Copy, PartialEq)]
enum Photons {
    /// The photon stream.
    Stream,
    /// Thrown one by one over the whole exposure, by the law's own words.
    Thrown,
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
        sigma: Time::from_ps(1_900),
        options: CohortOptions::default(),
        photons: Photons::Stream,
    }
}

/// Every SPAD pulse of an exposure: background at any time of it, an echo of every laser cycle around its arrival, and
/// nothing else.
fn thrown(stream: &StreamConfig, light: &PixelLight) -> Vec<SpadEvent> {
    let mut random = StdRng::seed_from_u64(stream.seed);
    let mut uniform = move || 1.0 - random.random::<f64>();
    let end_fs = stream.cycle_start(stream.laser_cycles).as_fs() as f64;
    let mut times_fs = Vec::new();
    let mut at_fs = 0.0;
    // In the dark the first one comes after all time.
    let gap_fs = 1e15 / light.background_hz;
    loop {
        at_fs -= uniform().ln() * gap_fs;
        if at_fs >= end_fs || at_fs.is_nan() {
            break;
        }
        times_fs.push(at_fs);
    }
    for cycle in 0..stream.laser_cycles {
        let centre = stream.cycle_start(cycle) + light.arrival;
        let mut photons = -uniform().ln();
        while photons < light.signal_per_cycle {
            let normal = (-2.0 * uniform().ln()).sqrt() * (std::f64::consts::TAU * uniform()).cos();
            let time_fs = centre.as_fs() as f64 + normal * stream.pulse_sigma.as_fs() as f64;
            times_fs.push(time_fs);
            photons -= uniform().ln();
        }
    }
    times_fs.retain(|time_fs| (0.0..end_fs).contains(time_fs));
    let mut photons: Vec<Photon> = times_fs
        .iter()
        .map(|&time_fs| Photon {
            time: Time::from_fs(time_fs as i64),
            spad: (uniform() * 16.0) as u8 % 16,
            breeds: uniform() <= stream.spads.breeding_probability(),
        })
        .collect();
    photons.sort_unstable();
    let mut edges = Vec::new();
    let avalanches = Avalanches::in_the_dark(&stream.spads, philox_key(stream.seed), 5);
    avalanches.run_to_the_end(&photons, &mut edges);
    edges
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
        let mut stream = stream_config(&self.sensor, &exposure, seed, self.sigma);
        stream.spads.law = self.law;
        stream
    }

    /// Seeds of the comparison: photons thrown one by one take their time.
    fn seeds(&self) -> u64 {
        match self.photons {
            Photons::Stream => seeds(),
            Photons::Thrown => seeds() / 4,
        }
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
        let by_photons = (0..self.seeds())
            .into_par_iter()
            .fold(
                || empty.clone(),
                |moments, seed| {
                    let stream = self.stream(seed);
                    let counts = match self.photons {
                        Photons::Stream => {
                            let stream = PhotonStream::new(&stream);
                            window
                                .expose(&stream, &[pixel])
                                .unwrap()
                                .histograms
                                .remove(0)
                        }
                        Photons::Thrown => {
                            let events = thrown(&stream, &self.light);
                            window.histogram(self.start, &events).unwrap()
                        }
                    };
                    moments.add(&counts)
                },
            )
            .reduce(|| empty.clone(), Moments::merge);
        let drawn = (0..4 * self.seeds())
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
        let cycles = f64::from(self.laser_cycles);
        // What is nearly never or nearly always counted shows no spread of its own.
        let variance = |i: usize| {
            let binomial = expected[i] * (1.0 - expected[i] / cycles);
            match saturates {
                true => by_photons.covariance(i, i),
                false => binomial.max(by_photons.covariance(i, i)),
            }
        };
        let standard = |difference: f64, variance: f64, n: f64| match difference == 0.0 {
            true => 0.0,
            // Nor are a few counts one.
            false => (difference.abs() - FEW_COUNTS / n).max(0.0) / (variance / n).sqrt(),
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
            sub_bins: Some(sub_bins),
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
            sub_bins: Some(4),
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
        sub_bins: Some(4),
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
            sub_bins: Some(sub_bins),
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

/// The light in which steps of a CLK period are farthest from the truth.
#[test]
fn blinding_echoes_and_the_tails_behind_them() {
    for law in [DeadTimeLaw::NonParalysable, DeadTimeLaw::Paralysable] {
        for (name, dead_time_ns, sigma, arrival) in [
            ("saturating echo", 8.0, 1_900, 85),
            ("its tail", 8.0, 1_900, 66),
            ("saturating flash", 8.0, 0, 85),
            ("tail of a flash", 8.0, 0, 63),
            ("saturating echo, long dead time", 23.0, 1_900, 75),
            ("tail, dead time of one CLK period", 2.605, 1_900, 66),
            ("a pulse of 200 ps", 8.0, 200, 70),
        ] {
            let name = format!("{name}, {law:?}");
            let light = PixelLight {
                signal_per_cycle: 60.0,
                arrival: Time::from_ns(arrival),
                background_hz: 200e6,
            };
            let sensor = SensorConfig {
                dead_time_ns,
                ..SensorConfig::default()
            };
            Case {
                name: &name,
                sensor,
                light,
                law,
                sigma: Time::from_ps(sigma),
                stop_periods: 240,
                laser_cycles: 12,
                photons: Photons::Thrown,
                ..case()
            }
            .agrees();
        }
    }
}

/// Each of 1 %, and both of 5 % where they show more.
#[test]
fn afterpulses_and_crosstalk() {
    for (name, probability, afterpulse_time_ns, signal_per_cycle, background_hz) in [
        ("daylight", 0.01, 5.0, 0.8, 40e6),
        ("dusk, slow traps", 0.05, 30.0, 0.3, 4e6),
        ("saturating echo", 0.01, 5.0, 60.0, 200e6),
        ("5 %", 0.05, 5.0, 5.0, 80e6),
    ] {
        let sensor = SensorConfig {
            afterpulse_probability: probability,
            afterpulse_time_ns,
            crosstalk_probability: probability,
            ..SensorConfig::default()
        };
        let light = PixelLight {
            signal_per_cycle,
            background_hz,
            ..case().light
        };
        let name = format!("secondaries, {name}");
        Case {
            name: &name,
            sensor,
            light,
            stop_periods: 400,
            laser_cycles: 12,
            photons: Photons::Thrown,
            options: CohortOptions {
                memory: 1.0,
                ..CohortOptions::default()
            },
            ..case()
        }
        .agrees();
    }
}

proptest! {
    #![proptest_config(ProptestConfig { cases: 12, max_shrink_iters: 0, ..ProptestConfig::default() })]
    /// Arrivals from before a laser cycle to after it, pulses from none to longer than a window.
    #[test]
    fn echoes_anywhere(
        place in 0.0f64..1.0,
        sigma_ns in prop_oneof![Just(0.0), 0.05f64..3.0, 3.0f64..60.0],
        start in 0u16..79,
        signal_per_cycle in 0.5f64..20.0,
    ) {
        let cycle_ns = 80.0 * 1e9 / 384e6;
        let arrival_ns = -3.0 * sigma_ns + place * (cycle_ns + 6.0 * sigma_ns);
        let light = PixelLight {
            signal_per_cycle,
            arrival: Time::from_ps((1e3 * arrival_ns) as i64),
            background_hz: 5e6,
        };
        let name = format!("{signal_per_cycle:.1} photons at {arrival_ns:.1} ns, {sigma_ns:.2} ns wide, start {start}");
        Case {
            name: &name,
            light,
            start,
            sigma: Time::from_ps((1e3 * sigma_ns) as i64),
            stop_periods: 80,
            laser_cycles: 6,
            photons: Photons::Thrown,
            options: CohortOptions { memory: 1.0, ..CohortOptions::default() },
            ..case()
        }
        .agrees();
    }
}
