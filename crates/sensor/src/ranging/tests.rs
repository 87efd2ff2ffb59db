//! Depths from simulated light: false alarms as often as stated, mean histograms as computed, range walk taken out to the
//! bound of the counts.

use proptest::prelude::*;

use super::*;
use crate::chip::window_law::OpenWindow;
use crate::chip::{EventType, Exposure, SensorConfig, WindowLaw};
use crate::engine::{LitPixel, Window, expose, stream_config};
use crate::photon::{DiffusionTail, EchoWidth, PhotonStream, PixelLight, PulseShape, StreamConfig};
use crate::units::{Time, TimeOfFlight};

mod short_pulses;
mod spreads;

const PULSE_SIGMA: Time = Time::from_ps(1_911);

/// A pulse of which three photons in ten are late by more than a bin.
const LATE: EchoWidth = EchoWidth {
    sigma: PULSE_SIGMA,
    tail: Some(DiffusionTail {
        share: 0.3,
        time: Time::from_ns(3),
    }),
    is_gaussian: true,
    energy_spread: 0.0,
    pde_spread: 0.0,
};

/// A start value, and the chip that counts with it.
struct Bench {
    width: EchoWidth,
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
            width: PULSE_SIGMA.into(),
            config,
            exposure,
            law,
            start,
            window,
        }
    }

    /// Histograms of `number` macropixels under the light of each.
    fn expose(&self, seed: u64, number: u32, light: impl Fn(u32) -> PixelLight) -> Vec<Vec<u32>> {
        let stream = StreamConfig {
            pulse_shape: self.shape(),
            energy_spread: self.width.energy_spread,
            ..stream_config(&self.config, &self.exposure, seed, self.width.sigma)
        };
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

    fn shape(&self) -> Option<PulseShape> {
        self.width
            .tail
            .map(|tail| tail.shape(None, self.width.sigma))
    }

    fn echo(&self, position_bins: f64, signal_per_cycle: f64, background_hz: f64) -> PixelLight {
        let centre_fs = self.shape().map_or(0.0, |shape| shape.mean_fs());
        let mean = self.law.time_of(&self.window, position_bins);
        PixelLight::echo(signal_per_cycle, mean - Time::from_fs(centre_fs as i64))
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
        SensorConfig {
            threshold: 1,
            afterpulse_probability: 0.05,
            crosstalk_probability: 0.05,
            ..default()
        },
        SensorConfig {
            paralysable: true,
            afterpulse_probability: 0.05,
            ..default()
        },
        // Traps that are slow to release: 2 % become some 5 %, and 5 ns become 13.
        SensorConfig {
            afterpulse_probability: 0.02,
            afterpulse_activation_ev: 0.15,
            temperature_c: Some(0.0),
            ..default()
        },
        // Shorter than a bin: SPADs that fire twice count nothing.
        SensorConfig {
            dead_time_ns: 1.0,
            ..default()
        },
        SensorConfig {
            dead_time_ns: 1.3,
            paralysable: true,
            ..default()
        },
    ];
    let gaussian = configs
        .into_iter()
        .map(|config| (config, PULSE_SIGMA.into()));
    let late = [
        default(),
        SensorConfig {
            dead_time_ns: 3.0,
            paralysable: true,
            threshold: 1,
            ..default()
        },
    ];
    for (config, width) in gaussian.chain(late.map(|config| (config, LATE))) {
        for (signal, background_hz, number) in [(0.3, 4e6, 60), (6.0, 1e8, 40), (120.0, 8e6, 10)] {
            let cycles = 2000;
            let bench = Bench {
                width,
                ..Bench::new(config.clone(), cycles, 60.0)
            };
            let light = bench.echo(6.7, signal, background_hz);
            let histograms = bench.expose(5, number, |_| light.clone());
            let bin_s = bench.law.bin_width_s().unwrap();
            let response = Response::new(&bench.config, bin_s, width);
            let chances = response.chances(&EchoLight {
                position_bins: 6.7,
                signal,
                background_per_bin: background_hz * bin_s,
                sigma_bins: response.pulse_sigma_bins,
            });
            let trials = f64::from(cycles * number);
            for (bin, chance) in chances.into_iter().enumerate() {
                let counts: u32 = histograms.iter().map(|counts| counts[bin]).sum();
                let mean = f64::from(counts) / trials;
                // Five standard deviations, four counts where hardly any are expected, and the steps' error.
                let sigma = (chance * (1.0 - chance) / trials).sqrt();
                let secondary = config.afterpulses().0 + config.crosstalk_probability;
                // Squares of the chances of afterpulses and crosstalk are left out.
                let left_out = (1e-3 + 2.0 * secondary * secondary) * chance;
                let most = 5.0 * sigma + 4.0 / trials + left_out;
                assert!(
                    (mean - chance).abs() <= most,
                    "{config:?}, {signal} photons, bin {bin}: {mean} and {chance}"
                );
            }
        }
    }
}

/// Errors of many echoes, mm.
#[derive(Debug)]
struct Errors {
    without_reason: usize,
    mean: f64,
    rms: f64,
    bound: f64,
}

/// Of `number` echoes over four bins, of pulses of this width; the finder takes them to be `known`.
fn errors(
    config: &SensorConfig,
    [width, known]: [EchoWidth; 2],
    cycles: u32,
    signal: f64,
    number: u32,
) -> Errors {
    let bench = Bench {
        width,
        ..Bench::new(config.clone(), cycles, 60.0)
    };
    let position = |n: u32| 5.0 + 4.0 * (f64::from(n) + 0.5) / f64::from(number);
    let histograms = bench.expose(7, number, |n| bench.echo(position(n), signal, 8e6));
    let finder = EchoFinder::new(&bench.law, known, &DepthOptions::default()).unwrap();
    let bin_mm = 1e3 * Time::from_s(bench.law.bin_width_s().unwrap()).as_range_m();
    let sightings = (0..number).zip(&histograms);
    let depths = sightings.filter_map(|(n, counts)| {
        let found = finder.find(counts)?;
        let is_depth = found.is_significant && !found.is_saturated;
        is_depth.then_some((found, position(n)))
    });
    let depths: Vec<(Sighting, f64)> = depths.collect();
    let told = |(found, _): &&(Sighting, f64)| found.walk_left.is_none();
    let square = |x: f64| bin_mm * bin_mm * x * x;
    let (mut sum, mut squares, mut bounds) = (0.0, 0.0, 0.0);
    for (found, position) in depths.iter().filter(told) {
        let error = found.position_bins - position;
        sum += bin_mm * error;
        squares += square(error);
        bounds += square(found.bound_bins.unwrap());
    }
    let without_reason = depths.iter().filter(told).count();
    let n = without_reason as f64;
    Errors {
        without_reason,
        mean: sum / n,
        rms: (squares / n).sqrt(),
        bound: (bounds / n).sqrt(),
    }
}

/// Asserts that what is called corrected is right to the bound of its counts, and hardly anything is not.
fn assert_right(config: &SensorConfig, cycles: u32, signal: f64, number: u32) {
    assert_right_with(config, PULSE_SIGMA.into(), cycles, signal, number);
}

fn assert_right_with(
    config: &SensorConfig,
    width: EchoWidth,
    cycles: u32,
    signal: f64,
    number: u32,
) {
    let errors = errors(config, [width; 2], cycles, signal, number);
    let n = errors.without_reason as f64;
    let case = format!("{signal} photons: {errors:?}, {config:?}");
    // Of strong light some counts tell the bin alone.
    let least = if signal < 500.0 { 0.95 } else { 0.9 };
    assert!(n > least * f64::from(number), "{case}");
    // Three standard deviations of the mean of `n` errors, and of their root mean square.
    assert!(
        errors.mean.abs() < 3.0 + 3.0 * errors.rms / n.sqrt(),
        "{case}"
    );
    assert!(
        errors.rms < (1.3 + 3.0 / (2.0 * n).sqrt()) * errors.bound,
        "{case}"
    );
}

#[test]
fn range_walk_is_taken_out_to_the_bound_of_the_counts() {
    let default = SensorConfig::default();
    for signal in [0.1, 0.3, 1.0, 3.0, 10.0, 30.0, 60.0, 120.0, 300.0] {
        assert_right(&default, 1000, signal, 80);
    }
    assert_right(&default, 1000, 1000.0, 30);
}

/// A finder that knows of late avalanches is right to the bound; one that does not is off.
#[test]
fn late_avalanches_leave_no_bias_and_an_honest_bound() {
    let default = SensorConfig::default();
    for signal in [0.3, 1.0, 3.0, 10.0, 60.0] {
        assert_right_with(&default, LATE, 1000, signal, 80);
    }
    let unknown = errors(&default, [LATE, PULSE_SIGMA.into()], 1000, 10.0, 80);
    let known = errors(&default, [LATE; 2], 1000, 10.0, 80);
    let is_off = |errors: &Errors| errors.rms > 2.0 * errors.bound || errors.without_reason < 40;
    assert!(is_off(&unknown) && !is_off(&known), "{unknown:?} {known:?}");
}

#[test]
fn range_walk_is_taken_out_whatever_the_threshold() {
    for (threshold, signal) in [
        (1, 1.0),
        (2, 2.0),
        (2, 5.0),
        (3, 5.0),
        (3, 10.0),
        (4, 10.0),
        (8, 30.0),
    ] {
        let config = SensorConfig {
            threshold,
            ..SensorConfig::default()
        };
        assert_right(&config, 4000, signal, 60);
    }
    let config = |event_type, threshold| SensorConfig {
        event_type,
        threshold,
        ..SensorConfig::default()
    };
    for signal in [0.3, 3.0, 30.0] {
        assert_right(&config(EventType::Less, 1), 1000, signal, 60);
        assert_right(&config(EventType::Equal, 0), 1000, signal, 60);
    }
    assert_right(&config(EventType::Less, 3), 1000, 5.0, 60);
    assert_right(&config(EventType::Equal, 1), 1000, 3.0, 20);
}

#[test]
fn range_walk_is_taken_out_whatever_the_spads() {
    let default = SensorConfig::default;
    for config in [
        SensorConfig {
            dead_time_ns: 1.0,
            ..default()
        },
        SensorConfig {
            dead_time_ns: 100.0,
            ..default()
        },
        SensorConfig {
            dead_time_ns: 2.0,
            paralysable: true,
            ..default()
        },
        SensorConfig {
            dead_time_ns: 50.0,
            paralysable: true,
            ..default()
        },
        SensorConfig {
            afterpulse_probability: 0.05,
            crosstalk_probability: 0.05,
            ..default()
        },
        SensorConfig {
            spad_rows: 1,
            spad_cols: 1,
            ..default()
        },
    ] {
        for signal in [3.0, 30.0] {
            assert_right(&config, 1000, signal, 60);
        }
    }
    let noisy = SensorConfig {
        threshold: 1,
        afterpulse_probability: 0.05,
        crosstalk_probability: 0.05,
        ..default()
    };
    assert_right(&noisy, 4000, 3.0, 60);
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(48))]

    /// The mean histogram of a light, as counts, is explained by that light or not at all.
    #[test]
    fn a_fit_finds_the_light_of_its_mean_histogram(
        threshold in 0u8..9,
        dead_time_ns in 1.0f64..100.0,
        paralysable: bool,
        afterpulse_probability in 0.0f64..0.05,
        crosstalk_probability in 0.0f64..0.05,
        ln_signal in -2.3f64..7.0,
        position_bins in 4.0f64..11.0,
    ) {
        let config = SensorConfig {
            threshold,
            dead_time_ns,
            paralysable,
            afterpulse_probability,
            crosstalk_probability,
            ..SensorConfig::default()
        };
        let bin_s = 1.0 / config.clk_hz;
        let response = Response::new(&config, bin_s, PULSE_SIGMA);
        let light = EchoLight {
            position_bins,
            signal: ln_signal.exp(),
            background_per_bin: 0.02,
            sigma_bins: response.pulse_sigma_bins,
        };
        let cycles = 100_000;
        let counts: Vec<f64> = response.chances(&light).iter().map(|p| p * f64::from(cycles)).collect();
        let whole: Vec<u32> = counts.iter().map(|&n| n.round() as u32).collect();
        let Some(peak) = interpolate(&whole, &PeakOptions::default()) else {
            return Ok(());
        };
        let walk = WalkCorrection { response, laser_cycles: cycles };
        if let Ok(found) = walk.correct(&counts, &peak) {
            let off = (found.light.position_bins - position_bins).abs();
            // Under a THRESHOLD two lights may give the same counts; the bound reaches from one to the other.
            let share = if threshold == 0 { 0.5 } else { 1.0 };
            prop_assert!(off < 1e-3 + share * found.bound_bins, "{light:?} {found:?}");
        }
    }
}
