//! Depths from simulated light: false alarms as often as stated, mean histograms as computed, range walk taken out.

use super::*;
use crate::chip::window_law::OpenWindow;
use crate::chip::{EventType, Exposure, SensorConfig, WindowLaw};
use crate::engine::{LitPixel, Window, expose, stream_config};
use crate::photon::{PhotonStream, PixelLight};
use crate::units::Time;

const PULSE_SIGMA: Time = Time::from_ps(1_911);

/// A start value, and the chip that counts with it.
struct Bench {
    config: SensorConfig,
    exposure: Exposure,
    law: WindowLaw,
    start: u16,
    window: OpenWindow,
}

impl Bench {
    /// Windows about a surface at `range_m`.
    fn new(config: SensorConfig, laser_cycles: u32, range_m: f64) -> Self {
        let exposure = Exposure::new(&config, 520, laser_cycles);
        let law = WindowLaw::new(&config, &exposure);
        let start = law.start_for(Time::of_flight(range_m)).unwrap();
        let window = law.window(start).open().unwrap();
        Bench {
            config,
            exposure,
            law,
            start,
            window,
        }
    }

    /// Histograms of `number` macropixels under the light of each.
    fn expose(&self, seed: u64, number: u32, light: impl Fn(u32) -> PixelLight) -> Vec<Vec<u32>> {
        let stream = stream_config(&self.config, &self.exposure, seed, PULSE_SIGMA);
        let pixels: Vec<LitPixel> = (0..number)
            .map(|number| LitPixel {
                number,
                start: self.start,
                light: Some(light(number)),
            })
            .collect();
        let engine = Window::new(&self.config, &self.exposure);
        let exposed = expose(&engine, &PhotonStream::new(&stream), &pixels, |_| {}).unwrap();
        let real = |counts: &[u16]| counts.iter().copied().map(u32::from).collect();
        exposed.histograms.iter().map(real).collect()
    }

    fn echo(&self, position_bins: f64, signal_per_cycle: f64, background_hz: f64) -> PixelLight {
        PixelLight::echo(
            signal_per_cycle,
            self.law.time_of(&self.window, position_bins),
        )
        .with_background(background_hz)
    }
}

#[test]
fn dark_windows_alarm_as_often_as_stated() {
    // Counts a bin: 0.05, 2, 10, 60 and 130 of 200 laser cycles.
    for (background_hz, laser_cycles, windows) in [
        (2e4, 1000, 16_384),
        (8e5, 1000, 16_384),
        (8e6, 500, 16_384),
        (8e7, 300, 16_384),
        (4e8, 200, 2_048),
    ] {
        let bench = Bench::new(SensorConfig::default(), laser_cycles, 60.0);
        let dark = bench.echo(0.0, 0.0, background_hz);
        let options = DepthOptions::default();
        let finder = EchoFinder::new(&bench.law, PULSE_SIGMA, &options).unwrap();
        let histograms = bench.expose(3, windows, |_| dark.clone());
        let sightings: Vec<Sighting> = histograms.iter().filter_map(|h| finder.find(h)).collect();
        for rate in [1e-2, 1e-3] {
            let alarms = sightings
                .iter()
                .filter(|s| s.confidence >= -f64::log10(rate));
            let alarms = alarms.count() as f64;
            let stated = rate * f64::from(windows);
            // Three standard deviations and a bit for the smallest numbers.
            assert!(
                alarms <= stated + 3.0 * stated.sqrt() + 1.0,
                "{background_hz}: {alarms} of {stated}"
            );
            // Two counts or three in a bin can hardly meet a rate; and of two expected alarms there may be none.
            if background_hz > 1e5 && stated > 10.0 {
                assert!(
                    alarms >= 0.3 * stated,
                    "{background_hz}: {alarms} of {stated}"
                );
            }
        }
        let significant = sightings.iter().filter(|s| s.is_significant).count();
        let confident = sightings.iter().filter(|s| s.confidence >= 3.0).count();
        assert_eq!(significant, confident);
    }
}

#[test]
fn the_mean_histogram_is_that_of_simulated_light() {
    let default = SensorConfig::default;
    let configs = [
        default(),
        SensorConfig {
            paralysable: true,
            ..default()
        },
        SensorConfig {
            threshold: 2,
            ..default()
        },
        SensorConfig {
            event_type: EventType::Equal,
            threshold: 1,
            dead_time_ns: 21.3,
            ..default()
        },
        SensorConfig {
            event_type: EventType::Less,
            threshold: 2,
            ..default()
        },
    ];
    for config in configs {
        for (signal, background_hz) in [(0.3, 4e6), (6.0, 1e8)] {
            let (cycles, number) = (2000, 100);
            let bench = Bench::new(config.clone(), cycles, 60.0);
            let light = bench.echo(6.7, signal, background_hz);
            let histograms = bench.expose(5, number, |_| light.clone());
            let bin_s = bench.law.bin_width_s().unwrap();
            let response = Response::new(&bench.config, bin_s, PULSE_SIGMA);
            let chances = response.chances(&EchoLight {
                position_bins: 6.7,
                signal,
                background_per_bin: background_hz * bin_s,
                sigma_bins: response.pulse_sigma_bins(),
            });
            let trials = f64::from(cycles * number);
            for (bin, chance) in chances.into_iter().enumerate() {
                let counts: u32 = histograms.iter().map(|counts| counts[bin]).sum();
                let mean = f64::from(counts) / trials;
                // Five standard deviations, four counts where hardly any are expected, and the steps' error.
                let sigma = (chance * (1.0 - chance) / trials).sqrt();
                let most = 5.0 * sigma + 4.0 / trials + 1e-3 * chance;
                assert!(
                    (mean - chance).abs() <= most,
                    "{config:?}, {signal} photons, bin {bin}: {mean} and {chance}"
                );
            }
        }
    }
}

#[test]
fn range_walk_is_taken_out() {
    for (range_m, signal, paralysable) in [
        (16.0, 0.1, false),
        (16.0, 0.3, false),
        (16.0, 1.0, false),
        (16.0, 3.0, false),
        (16.0, 8.0, false),
        (16.0, 5.0, true),
        (60.0, 2.0, false),
        (150.0, 1.0, true),
    ] {
        let config = SensorConfig {
            paralysable,
            ..SensorConfig::default()
        };
        let bench = Bench::new(config, 1000, range_m);
        let number = 300;
        // Four bins, evenly.
        let position = |n: u32| 5.0 + 4.0 * (f64::from(n) + 0.5) / f64::from(number);
        let histograms = bench.expose(7, number, |n| bench.echo(position(n), signal, 8e6));
        let errors_mm = |correct_walk| -> (f64, f64) {
            let options = DepthOptions {
                correct_walk,
                ..DepthOptions::default()
            };
            let finder = EchoFinder::new(&bench.law, PULSE_SIGMA, &options).unwrap();
            let bin_mm = 1e3 * Time::from_s(bench.law.bin_width_s().unwrap()).as_range_m();
            let errors = (0..number).zip(&histograms).map(|(n, counts)| {
                let found = finder.find(counts).unwrap();
                assert!(found.is_significant && found.light.is_some() == correct_walk);
                bin_mm * (found.position_bins - position(n))
            });
            let errors: Vec<f64> = errors.collect();
            let mean = errors.iter().sum::<f64>() / f64::from(number);
            let squares = errors.iter().map(|e| (e - mean).powi(2)).sum::<f64>();
            (mean, (squares / f64::from(number)).sqrt())
        };
        let (walk, _) = errors_mm(false);
        let (left, noise) = errors_mm(true);
        // The mean of 300 is known to 0.06 of the noise of one.
        assert!(
            left.abs() < 0.25 * noise,
            "{range_m} m, {signal} photons: {left} mm left, noise {noise} mm"
        );
        if signal >= 1.0 {
            assert!(
                walk < -5.0 && left.abs() < 0.3 * walk.abs(),
                "{range_m} m, {signal} photons: {walk} mm, {left} mm left"
            );
        }
    }
}

#[test]
fn full_bins_are_told_from_peaks() {
    let config = SensorConfig {
        bin_bits: 5,
        ..SensorConfig::default()
    };
    let bench = Bench::new(config, 1000, 60.0);
    let finder = EchoFinder::new(&bench.law, PULSE_SIGMA, &DepthOptions::default()).unwrap();
    let saturated = |counts: &[u32]| finder.find(counts).unwrap().is_saturated;
    assert!(saturated(&[31; 16]));
    let mut counts = [2; 16];
    counts[7..10].copy_from_slice(&[20, 31, 18]);
    assert!(saturated(&counts));
    counts[8] = 30;
    assert!(!saturated(&counts));
    assert_eq!(finder.find(&[0; 16]), None);
}
