//! The window engine draws only what a start value can see, and counts exactly what the whole photon stream gives: the
//! same as its own pulse-driven side, and as the cycle engine.

use guided_dtof::chip::window_law::{WindowLaw, WindowOutcome as LawWindow};
use guided_dtof::chip::{EventType, Exposure, Mode, Overflow, SensorConfig};
use guided_dtof::engine::{
    Cycle, Expose, Histograms, LitPixel, Window, expose, expose_without_skipping, full_stream,
    stream_config,
};
use guided_dtof::photon::{
    DeadTimeLaw, PhotonStream, PixelLight, PulseShape, SpadModel, StreamConfig,
};
use guided_dtof::scene::Scene;
use guided_dtof::system::{EngineKind, FrameSettings, take_frame};
use guided_dtof::units::Time;
use proptest::prelude::*;

#[derive(Debug, Clone)]
pub struct Case {
    pub config: SensorConfig,
    pub exposure: Exposure,
    pub stream: StreamConfig,
    pub pixel: LitPixel,
}

/// `slowest_mhz`: lowest CLK frequency.
fn sensors(slowest_mhz: f64) -> impl Strategy<Value = SensorConfig> {
    // Half of them where a slot is a CLK period.
    let clk_mhz = prop_oneof![1 => slowest_mhz..240.0, 1 => 240f64..420.0];
    let event_type = prop_oneof![
        4 => Just((EventType::Greater, 0u8)),
        1 => (1u8..4).prop_map(|t| (EventType::Greater, t)),
        1 => (0u8..4).prop_map(|t| (EventType::Equal, t)),
        1 => (0u8..4).prop_map(|t| (EventType::Less, t)),
    ];
    let mode = prop_oneof![4 => Just(Mode::Guided), 1 => Just(Mode::Conventional)];
    let grid = prop_oneof![
        3 => Just((4, 4)),
        1 => Just((2, 2)),
        1 => Just((8, 8)),
        1 => prop::sample::select(vec![(1, 1), (2, 1), (2, 4), (1, 8)]),
    ];
    (
        (4usize..10, 1usize..33, clk_mhz, grid),
        (-0.9f64..0.9, event_type, mode),
    )
        .prop_map(
            |((counter_bits, bins, clk_mhz, grid), (phase, event, mode))| SensorConfig {
                rows: 1,
                cols: 1,
                spad_rows: grid.0,
                spad_cols: grid.1,
                counter_bits,
                bins,
                clk_hz: clk_mhz * 1e6,
                stop_phase_ps: phase * 0.5e6 / clk_mhz,
                event_type: event.0,
                // One SPAD has one bit of THRESHOLD.
                threshold: event.1.min((2 * grid.0 * grid.1 - 1) as u8),
                overflow: Overflow::Wrap,
                mode,
                ..SensorConfig::default()
            },
        )
}

fn spads() -> impl Strategy<Value = SpadModel> {
    // From none at all to many windows.
    let dead_time_fs = prop_oneof![
        1 => Just(0i64),
        2 => 1i64..3_000_000,
        4 => 3_000_000i64..30_000_000,
        1 => 30_000_000i64..400_000_000,
    ];
    let law =
        prop_oneof![2 => Just(DeadTimeLaw::NonParalysable), 1 => Just(DeadTimeLaw::Paralysable)];
    // Both near one half, each pulse would make about one more, without end: such a case took a minute and a half.
    let secondaries = prop_oneof![
        3 => Just((0.0, 0.0)),
        1 => (0.0f64..0.5, Just(0.0)),
        1 => (0.0f64..0.5, 0.0f64..0.25),
    ];
    (dead_time_fs, law, secondaries, 1i64..8_000_000).prop_map(
        |(dead_time_fs, law, (afterpulse, crosstalk), time_fs)| SpadModel {
            dead_time: Time::from_fs(dead_time_fs),
            law,
            afterpulse_probability: afterpulse,
            afterpulse_time: Time::from_fs(time_fs),
            crosstalk_probability: crosstalk,
            ..SpadModel::default()
        },
    )
}

/// Where an echo is.
#[derive(Debug, Clone, Copy)]
pub enum Arrival {
    /// So many bins before LOCAL_STOP.
    BinsBefore(f64),
    /// A share of the time from 3σ before a laser cycle to 3σ after it.
    InCycle(f64),
}

pub fn arrivals() -> impl Strategy<Value = Arrival> {
    prop_oneof![
        3 => (-4f64..20.0).prop_map(Arrival::BinsBefore),
        1 => (0f64..1.0).prop_map(Arrival::InCycle),
        // An echo about STOP.
        1 => (-0.01f64..0.01).prop_map(|share| Arrival::InCycle(share.rem_euclid(1.0))),
    ]
}

impl Arrival {
    /// Its time in fs, for a start value and CLK period, a laser cycle and a pulse.
    pub fn fs(self, start: u16, clk_fs: f64, cycle_fs: f64, sigma_fs: i64) -> i64 {
        let arrival_fs = match self {
            Arrival::BinsBefore(bins) => (f64::from(start) - bins) * clk_fs,
            Arrival::InCycle(share) => {
                let room_fs = 3.0 * sigma_fs as f64;
                share * (cycle_fs + 2.0 * room_fs) - room_fs
            }
        };
        arrival_fs as i64
    }
}

/// How wide a laser pulse is.
#[derive(Debug, Clone, Copy)]
pub enum Sigma {
    Fs(i64),
    /// In CLK periods: up to longer than a window.
    Bins(f64),
}

impl Sigma {
    pub fn fs(self, clk_fs: f64) -> i64 {
        match self {
            Sigma::Fs(sigma_fs) => sigma_fs,
            Sigma::Bins(wide) => (wide * clk_fs) as i64,
        }
    }
}

pub fn sigmas() -> impl Strategy<Value = Sigma> {
    prop_oneof![
        1 => Just(Sigma::Fs(0)),
        6 => (500_000i64..4_000_000).prop_map(Sigma::Fs),
        1 => (1f64..40.0).prop_map(Sigma::Bins),
    ]
}

/// `most_periods`: longest laser cycle, in CLK periods; `slowest_mhz`: lowest CLK frequency.
pub fn cases(most_periods: u32, slowest_mhz: f64) -> impl Strategy<Value = Case> {
    // Groups of photons end at 128, 256 … 2048 laser cycles.
    let cycles = prop_oneof![6 => 1u32..40, 2 => 500u32..1100, 1 => 2000u32..2200];
    let rate_hz = prop_oneof![1 => Just(0.0), 3 => 1e5f64..2e7, 2 => 2e7f64..5e8];
    let signal = prop_oneof![1 => Just(0.0), 3 => 0.01f64..3.0, 1 => 3.0f64..40.0];
    (
        (sensors(slowest_mhz), spads()),
        (2..most_periods, cycles),
        (any::<u64>(), any::<u32>()),
        (rate_hz, signal, arrivals(), sigmas()),
        (any::<u16>(), 0u8..4, any::<bool>()),
    )
        .prop_map(
            |(
                (config, spads),
                (stop_periods, laser_cycles),
                (seed, number),
                (background_hz, signal_per_cycle, arrival, sigma),
                (start, choice, measured),
            )| {
                // Few laser cycles show what much light does, and take less time.
                let is_bright = background_hz > 2e7 || signal_per_cycle > 3.0;
                let laser_cycles = if is_bright {
                    laser_cycles.min(60)
                } else {
                    laser_cycles
                };
                let exposure = Exposure::new(&config, stop_periods, laser_cycles);
                // Small start values reach into the cycle before; large ones to its end.
                let last = config.largest_start().min(stop_periods as u16 - 2);
                let start = match choice {
                    0 => start % 24,
                    1 => last.saturating_sub(start % 4),
                    _ => start % (last + 1),
                };
                let start = start.min(config.largest_start());
                let clk_fs = 1e9 / config.clk_hz * 1e6;
                let sigma_fs = sigma.fs(clk_fs);
                let cycle_fs = f64::from(stop_periods) * clk_fs;
                let arrival_fs = arrival.fs(start, clk_fs, cycle_fs, sigma_fs);
                let shape = PulseShape::new(Time::from_ps(700), &[0.0, 2.0, 1.0, 0.0]);
                let stream = StreamConfig {
                    spads: SpadModel {
                        grid: config.spad_grid(),
                        ..spads
                    },
                    pulse_shape: measured.then(|| shape.unwrap()),
                    energy_spread: if number % 4 == 0 { 0.3 } else { 0.0 },
                    ..stream_config(&config, &exposure, seed, Time::from_fs(sigma_fs))
                };
                let light = Some(
                    PixelLight::echo(signal_per_cycle, Time::from_fs(arrival_fs))
                        .with_background(background_hz),
                );
                let pixel = LitPixel {
                    number,
                    start,
                    light,
                };
                Case {
                    config,
                    exposure,
                    stream,
                    pixel,
                }
            },
        )
}

/// The histogram of the window engine, after comparing it with the whole stream on both fast engines.
pub fn agreed(case: &Case) -> Option<Vec<u16>> {
    let Case {
        config,
        exposure,
        stream,
        pixel,
    } = case;
    if let LawWindow::Race(_) = WindowLaw::new(config, exposure).window(pixel.start) {
        return None;
    }
    let pixels = std::slice::from_ref(pixel);
    let stream = PhotonStream::new(stream);
    let window = Window::new(config, exposure);
    let seen = window.expose(&stream, pixels).unwrap();
    let all = full_stream(&window, &stream, pixels).unwrap();
    assert_eq!(seen.histograms, all.histograms);
    let cycle = full_stream(&Cycle::new(config, exposure), &stream, pixels).unwrap();
    assert_eq!(seen.histograms, cycle.histograms);
    assert_eq!(seen.work.cancelled, all.work.cancelled);
    assert_eq!(seen.work.cancelled, cycle.work.cancelled);
    Some(seen.histograms[0].to_vec())
}

proptest! {
    #![proptest_config(ProptestConfig { cases: 250, ..ProptestConfig::default() })]

    #[test]
    fn in_long_cycles(case in cases(700, 80.0)) {
        agreed(&case);
    }

    #[test]
    fn in_a_stream_whose_slots_are_no_bins(case in cases(700, 80.0), part in 0.0f64..1.0) {
        let lead = Time::from_s(part / case.config.clk_hz);
        let stream = StreamConfig { lead, ..case.stream.clone() };
        agreed(&Case { stream, ..case });
    }

    #[test]
    fn in_cycles_as_short_as_the_window(case in cases(60, 4.0)) {
        agreed(&case);
    }
}

fn frame() -> (SensorConfig, Exposure, PhotonStream, Vec<LitPixel>) {
    let config = SensorConfig {
        rows: 8,
        cols: 8,
        ..SensorConfig::default()
    };
    let exposure = Exposure::new(&config, 520, 1200);
    let stream = PhotonStream::new(&stream_config(&config, &exposure, 3, Time::from_ps(1_900)));
    let pixels = (0..64u16)
        .map(|number| LitPixel {
            number: u32::from(number),
            start: number * 8,
            light: (number % 7 != 0).then_some(
                PixelLight::echo(0.1, config.clock().periods(i64::from(number) * 8 - 8))
                    .with_background(8e6),
            ),
        })
        .collect();
    (config, exposure, stream, pixels)
}

#[test]
fn threads_order_and_neighbours_change_nothing() {
    let (config, exposure, stream, pixels) = frame();
    let engine = Window::new(&config, &exposure);
    let on = |threads: usize, pixels: &[LitPixel]| {
        let pool = rayon::ThreadPoolBuilder::new()
            .num_threads(threads)
            .build()
            .unwrap();
        pool.install(|| expose(&engine, &stream, pixels, |_| ()).unwrap())
    };
    let one = on(1, &pixels);
    assert_eq!(one, on(4, &pixels));
    let mut backwards = pixels.clone();
    backwards.reverse();
    let reversed = on(3, &backwards);
    assert!(one.histograms.iter().eq(reversed.histograms.iter().rev()));
    assert_eq!(one.work, reversed.work);
    let alone = pixels
        .iter()
        .map(|pixel| on(1, std::slice::from_ref(pixel)).histograms);
    let alone = Histograms::joined(config.bins, alone);
    assert_eq!(one.histograms, alone);
    let all = expose_without_skipping(&engine, &stream, &pixels, |_| ()).unwrap();
    assert_eq!(one.histograms, all.histograms);
}

#[test]
fn photons_that_cancel_are_told_of_by_every_engine() {
    let (config, exposure, _, mut pixels) = frame();
    pixels.truncate(3);
    let told = |dead_time: Time| {
        let stream = stream_config(&config, &exposure, 3, Time::from_ps(1_900));
        let spads = SpadModel {
            dead_time,
            ..stream.spads
        };
        let stream = PhotonStream::new(&StreamConfig { spads, ..stream });
        let window = Window::new(&config, &exposure);
        let seen = window.expose(&stream, &pixels).unwrap().work;
        let all = full_stream(&window, &stream, &pixels).unwrap().work;
        assert_eq!(seen.cancelled, all.cancelled);
        seen
    };
    let none = told(config.clock().period() + Time::from_fs(1));
    assert_eq!(none.cancelled, 0);
    let short = told(Time::from_ps(500));
    assert!(short.cancelled > 0 && short.cancelled.is_multiple_of(2));
    assert!(short.cancelled < short.pulses);
}

#[test]
fn what_is_left_out_is_told() {
    let (config, exposure, stream, mut pixels) = frame();
    let short = Exposure {
        stop_periods: 100,
        ..exposure
    };
    let engine = Window::new(&config, &exposure);
    let all = expose_without_skipping(&engine, &stream, &pixels, |_| ())
        .unwrap()
        .work;
    let seen = expose(&engine, &stream, &pixels, |_| ()).unwrap().work;
    assert_eq!((all.skipped_dark, seen.skipped_dark), (0, 10));
    assert_eq!(all.clk_periods, 64 * 520 * 1200);
    assert_eq!(all.clk_periods_visited, all.clk_periods);
    assert_eq!(seen.clk_periods, all.clk_periods);
    assert!(seen.clk_periods_visited * 50 < seen.clk_periods, "{seen:?}");
    assert!(
        seen.photons_drawn * 10 < all.photons_drawn,
        "{seen:?} {all:?}"
    );
    assert!(seen.clk_periods_visited <= seen.pulses && seen.pulses < seen.photons_drawn);

    // Start values beyond the laser cycle never open.
    pixels.truncate(14);
    let stream = PhotonStream::new(&stream_config(&config, &short, 3, Time::from_ps(1_900)));
    let engine = Window::new(&config, &short);
    let seen = expose(&engine, &stream, &pixels, |_| ()).unwrap();
    assert_eq!((seen.work.skipped_dark, seen.work.skipped_closed), (2, 1));
    assert!(seen.histograms[13].iter().all(|&n| n == 0));
}

#[test]
fn a_frame_without_skipping_is_the_same_frame() {
    let sensor = SensorConfig {
        rows: 8,
        cols: 8,
        ..SensorConfig::default()
    };
    // An array of 8×8 gathers on each macropixel the light of 64 of the real one; it is given as much less.
    let mut scene = Scene::outdoor();
    scene.light.illuminance_klux /= 64.0;
    scene.lidar.pulse_energy_uj /= 64.0;
    let take = |engine, skip| {
        let exposure = Exposure::new(&sensor, 520, 512);
        let settings = FrameSettings {
            seed: 5,
            engine,
            skip,
            ..FrameSettings::new(&sensor, scene.clone(), exposure)
        };
        take_frame(&settings, |_| Vec::new(), |_| ()).unwrap()
    };
    let frame = take(EngineKind::Window, true);
    let skipped = frame
        .pixels
        .iter()
        .filter(|pixel| pixel.start.is_none())
        .count();
    assert!(skipped > 0, "every macropixel has a guide");
    assert_eq!(frame.work.skipped_dark, skipped as u64);
    for (engine, skip) in [(EngineKind::Window, false), (EngineKind::Cycle, true)] {
        let full = take(engine, skip);
        assert_eq!(full.histograms, frame.histograms);
        assert_eq!(full.pixels, frame.pixels);
        let (full, some) = (full.work.photons_drawn, frame.work.photons_drawn);
        assert!(
            full > 5 * some,
            "{full} photons without skipping, {some} with"
        );
    }
}

/// A SPAD fires at most once a dead time, and an exposure costs no more than that, however much light there is.
#[test]
fn an_echo_costs_what_is_detected() {
    let config = SensorConfig::default();
    let exposure = Exposure::new(&config, 520, 400);
    let stream = PhotonStream::new(&stream_config(&config, &exposure, 3, Time::from_ps(1_900)));
    let drawn = |signal_per_cycle| {
        let arrival = config.clock().periods(192);
        let pixels = [LitPixel {
            number: 7,
            start: 200,
            light: Some(PixelLight::echo(signal_per_cycle, arrival).with_background(8e6)),
        }];
        let engine = Window::new(&config, &exposure);
        let exposed = expose(&engine, &stream, &pixels, |_| ()).unwrap();
        let all = full_stream(&engine, &stream, &pixels).unwrap();
        assert_eq!(exposed.histograms, all.histograms);
        (exposed.work.photons_drawn, all.work.photons_drawn)
    };
    // The pulse lasts less than four dead times.
    let most = 16 * 4 * 400;
    for signal_per_cycle in [100.0, 1e3, 1e4] {
        let (seen, all) = drawn(signal_per_cycle);
        assert!(
            seen < most && all < most + 8 * 520 * 400 / 100,
            "{seen} {all} {signal_per_cycle}"
        );
    }
}

/// Afterpulses alone can make a SPAD's state unknown; looking further back must end without a dead time, too.
#[test]
fn afterpulses_without_a_dead_time_in_bright_light() {
    let (config, exposure, stream, mut pixels) = frame();
    let spads = SpadModel {
        afterpulse_probability: 0.4,
        afterpulse_time: Time::from_ns(5),
        crosstalk_probability: 0.2,
        ..SpadModel::with_dead_time(Time::ZERO)
    };
    pixels.truncate(5);
    for pixel in &mut pixels {
        if let Some(light) = &mut pixel.light {
            *light = light.clone().with_background(3e8);
        }
    }
    let stream = PhotonStream::new(&StreamConfig {
        spads,
        ..stream.config().clone()
    });
    let window = Window::new(&config, &exposure);
    let seen = window.expose(&stream, &pixels).unwrap();
    let all = full_stream(&window, &stream, &pixels).unwrap();
    assert_eq!(seen.histograms, all.histograms);
}

#[test]
fn light_that_blinds_is_refused_with_its_numbers() {
    let (config, exposure, stream, mut pixels) = frame();
    let engine = Window::new(&config, &exposure);
    for pixel in &mut pixels {
        if let Some(light) = &mut pixel.light {
            *light = light.clone().with_background(2.1e10);
        }
    }
    let refused = expose(&engine, &stream, &pixels, |_| ()).unwrap_err();
    assert!(refused.is_refusal());
    let says = refused.to_string();
    for part in [
        "1312.5 Mcounts/s a SPAD",
        "91 % of the time",
        "1.8e9",
        "125.0 Mcounts/s",
    ] {
        assert!(says.contains(part), "{says}");
    }
    assert_eq!(
        Err(refused),
        expose_without_skipping(&engine, &stream, &pixels, |_| ())
    );
}
