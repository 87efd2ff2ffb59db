//! HSLIDAR's delay-line mode: the window engine counts what the gates count, in every macropixel, whose delay lines and clock skew are
//! its own.

use guided_dtof::chip::{
    Exposure, Mode, SensorConfig, WindowLaw, WindowOutcome as LawWindow, hslidar_delay_line,
};
use guided_dtof::engine::{
    Cohort, CohortOptions, Cycle, EngineError, Expose, Gate, GateSimulation, LitPixel, PulsedPixel,
    Replay, Window, full_stream, stream_config,
};
use guided_dtof::photon::{
    Echo, PhotonStream, PixelLight, Profile, SpadEvent, SpadModel, apply_dead_time,
};
use guided_dtof::units::Time;
use proptest::prelude::*;

fn sensors() -> impl Strategy<Value = SensorConfig> {
    let grid = prop::sample::select(vec![(4, 4), (4, 4), (1, 1), (2, 2), (8, 8), (1, 8)]);
    let mode = prop_oneof![4 => Just(Mode::Guided), 1 => Just(Mode::Conventional)];
    (
        (1usize..12, 20f64..300.0, -0.4f64..0.4, grid),
        (0.55f64..1.1, 0f64..0.25, any::<u32>(), 0f64..100.0, mode),
    )
        .prop_map(|(clocks, (control_v, sigma, seed, skew_ps, mode))| {
            let (bins, clk_mhz, phase, grid) = clocks;
            SensorConfig {
                rows: 2,
                cols: 20,
                spad_rows: grid.0,
                spad_cols: grid.1,
                bins,
                clk_hz: clk_mhz * 1e6,
                stop_phase_ps: phase * 1e6 / clk_mhz,
                delay_control_v: control_v,
                delay_sigma: sigma,
                delay_seed: seed,
                clk_skew_ps: skew_ps,
                dead_time_ns: 4.0,
                mode,
                ..(*hslidar_delay_line()).clone()
            }
        })
}

/// Pulses of a macropixel, as many as of bright light, and some of them close together.
fn pulses(
    config: &SensorConfig,
    exposure: &Exposure,
) -> impl Strategy<Value = Vec<SpadEvent>> + use<> {
    let (spads, end_fs) = (config.spads() as u8, exposure.end().as_fs());
    let dead_time = config.dead_time();
    let burst = (
        0..end_fs,
        prop::collection::vec((0i64..90_000, 0..spads), 1..5),
    );
    prop::collection::vec(burst, 0..150).prop_map(move |bursts| {
        let mut pulses: Vec<SpadEvent> = bursts
            .into_iter()
            .flat_map(|(at, pulses)| {
                pulses.into_iter().map(move |(after, spad)| SpadEvent {
                    time: Time::from_fs(at + after),
                    spad,
                })
            })
            .filter(|pulse| pulse.time.as_fs() < end_fs)
            .collect();
        pulses.sort_unstable();
        apply_dead_time(&mut pulses, &SpadModel::with_dead_time(dead_time), 0);
        pulses
    })
}

fn cases() -> impl Strategy<Value = (SensorConfig, Exposure, u32, u16, Vec<SpadEvent>)> {
    (sensors(), 20u32..60, 1u32..6, 0u32..40, 0u16..64).prop_flat_map(
        |(config, periods, cycles, number, start)| {
            let exposure = Exposure::new(&config, periods, cycles);
            let pulses = pulses(&config, &exposure);
            (
                Just(config),
                Just(exposure),
                Just(number),
                Just(start),
                pulses,
            )
        },
    )
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(60))]

    #[test]
    fn window_counts_what_the_gates_count(
        (config, exposure, number, start, pulses) in cases()
    ) {
        let law = WindowLaw::new(&config, &exposure).of_macropixel(number);
        if let LawWindow::Race(_) | LawWindow::Irregular(_) = law.window(start) {
            return Ok(());
        }
        let pixel = PulsedPixel { number, start, pulses: &pulses };
        let gate = Gate::new(&config, &exposure).replay(&[pixel]).unwrap();
        let window = Window::new(&config, &exposure).replay(&[pixel]).unwrap();
        prop_assert_eq!(&gate, &window);
    }
}

/// Light on some macropixels, in windows all over the laser cycle.
fn lit(law: &WindowLaw, photons: f64, background_hz: f64) -> Vec<LitPixel> {
    let starts = [(0u32, 0u16), (63, 1), (700, 20), (1001, 77), (2047, 126)];
    starts
        .map(|(number, start)| {
            let law = law.of_macropixel(number);
            let window = law.window(start).open().expect("it opens");
            let arrival = law.time_of(&window, 3.0);
            LitPixel {
                number,
                start,
                light: Some(PixelLight::echo(photons, arrival).with_background(background_hz)),
            }
        })
        .into()
}

#[test]
fn what_a_window_cannot_see_is_not_drawn_and_counts_are_the_same() {
    let sensor = hslidar_delay_line();
    let exposure = Exposure::new(&sensor, 140, 40);
    let law = WindowLaw::new(&sensor, &exposure);
    for (photons, background_hz, seed) in [(0.8, 8e6, 1), (8.0, 3e8, 2), (40.0, 8e6, 3)] {
        let stream = stream_config(&sensor, &exposure, seed, Time::from_ps(1_900));
        let stream = PhotonStream::new(&stream);
        let pixels = lit(&law, photons, background_hz);
        let gate = full_stream(&Gate::new(&sensor, &exposure), &stream, &pixels).unwrap();
        let window = Window::new(&sensor, &exposure);
        let all = full_stream(&window, &stream, &pixels).unwrap();
        let seen = window.expose(&stream, &pixels).unwrap();
        assert_eq!(gate.histograms, all.histograms);
        assert_eq!(gate.histograms, seen.histograms);
        assert!(seen.work.photons_drawn < all.work.photons_drawn);
        let counted: u32 = gate.histograms.counts().iter().map(|&n| u32::from(n)).sum();
        assert!(counted > 40, "{counted} are few to compare");
    }
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(40))]

    /// Photons are drawn together where windows see them, and mostly counted without their history; the reference draws all of them
    /// and runs every pulse.
    #[test]
    fn windows_count_light_of_many_parts_as_if_all_of_it_were_drawn(
        photons in prop_oneof![0.0f64..0.3, 0.3f64..6.0],
        background_hz in prop_oneof![1e5f64..8e6, 8e6f64..8e7],
        start in 0u16..127,
        number in 0u32..2048,
        cycles in prop_oneof![1u32..40, 100u32..3000],
        change in prop::option::of(0.1f64..0.9),
        fog_hz in prop::option::of(1e6f64..4e7),
        later_ns in prop::option::of(-4f64..12.0),
        paralysable: bool,
        dead_time_ns in prop_oneof![Just(8.0f64), 0.2f64..30.0],
        seed: u64,
    ) {
        let sensor = SensorConfig {
            paralysable,
            dead_time_ns,
            ..(*hslidar_delay_line()).clone()
        };
        let exposure = Exposure::new(&sensor, 140, cycles);
        let law = WindowLaw::new(&sensor, &exposure).of_macropixel(number);
        let LawWindow::Open(window) = law.window(start) else {
            return Ok(());
        };
        let arrival = law.time_of(&window, 3.0);
        let mut light = PixelLight::echo(photons, arrival).with_background(background_hz);
        if let Some(later_ns) = later_ns {
            let later = arrival + Time::from_fs((later_ns * 1e6) as i64);
            light = light.with_echo(Echo::new(0.5 * photons, later));
        }
        if let Some(fog_hz) = fog_hz {
            // The first windows of columns near the driver open before the laser cycle begins.
            let thinner = arrival.max(Time::from_fs(1));
            let edges = [Time::ZERO, thinner, thinner + Time::from_ns(9)];
            light = light.with_profile(Profile::new(&edges, &[fog_hz, 0.4 * fog_hz]).unwrap());
        }
        if let Some(change) = change {
            let first = (change * f64::from(cycles)) as u32;
            let moved = PixelLight::echo(photons, arrival + Time::from_ns(3));
            if first > 0 {
                let segments = [(0, light), (first, moved.with_background(0.7 * background_hz))];
                light = PixelLight::timeline(segments).unwrap();
            }
        }
        let stream = stream_config(&sensor, &exposure, seed, Time::from_ps(1_900));
        let stream = PhotonStream::new(&stream);
        let pixels = [LitPixel { number, start, light: Some(light) }];
        let engine = Window::new(&sensor, &exposure);
        let all = full_stream(&engine, &stream, &pixels).unwrap();
        let seen = engine.expose(&stream, &pixels).unwrap();
        prop_assert_eq!(all.histograms, seen.histograms);
        // Photons in the dead time before a window may be drawn for the window before as well.
        prop_assert!(seen.work.photons_drawn <= 2 * all.work.photons_drawn);
    }
}

/// CLK, STOP and RUN of the array come later to a column; a macropixel alone has its pulses earlier instead.
#[test]
fn macropixels_count_in_the_array_what_they_count_alone() {
    let sensor = SensorConfig {
        rows: 1,
        cols: 40,
        ..(*hslidar_delay_line()).clone()
    };
    let exposure = Exposure::new(&sensor, 50, 6);
    let law = WindowLaw::new(&sensor, &exposure);
    let stream = stream_config(&sensor, &exposure, 9, Time::from_ps(1_900));
    let stream = PhotonStream::new(&stream);
    let (first, starts) = (38, [7u16, 48]);
    let mut lists = Vec::new();
    for (number, start) in (first..).zip(starts) {
        let law = law.of_macropixel(number);
        let arrival = law.time_of(&law.window(start).open().unwrap(), 4.0);
        let light = PixelLight::echo(6.0, arrival).with_background(2e8);
        let mut pulses = Vec::new();
        stream.pixel_pulses(number, &light, |some| pulses.extend_from_slice(some));
        lists.push(pulses);
    }
    let lists: Vec<&[SpadEvent]> = lists.iter().map(Vec::as_slice).collect();
    let place = (0, first as usize);
    let mut array = GateSimulation::new(&sensor, &exposure, place, (1, 2), &starts, &lists);
    array.run(&mut ());
    let pixels: Vec<PulsedPixel<'_>> = (first..)
        .zip(starts)
        .zip(&lists)
        .map(|((number, start), pulses)| PulsedPixel {
            number,
            start,
            pulses,
        })
        .collect();
    let gate = Gate::new(&sensor, &exposure).replay(&pixels).unwrap();
    let window = Window::new(&sensor, &exposure).replay(&pixels).unwrap();
    assert_eq!(array.histograms().unwrap(), gate);
    assert_eq!(gate, window);
    assert!(gate.counts().iter().any(|&count| count > 0));
}

#[test]
fn engines_that_need_clk_refuse_by_name() {
    let sensor = hslidar_delay_line();
    let exposure = Exposure::new(&sensor, 140, 4);
    let stream = stream_config(&sensor, &exposure, 1, Time::from_ps(1_900));
    let stream = PhotonStream::new(&stream);
    let pixels = lit(&WindowLaw::new(&sensor, &exposure), 1.0, 8e6);
    let cycle = full_stream(&Cycle::new(&sensor, &exposure), &stream, &pixels);
    assert_eq!(cycle.unwrap_err(), EngineError::OwnLaws);
    let cohort = Cohort::new(&sensor, &exposure, CohortOptions::default());
    let light = pixels[0].light.as_ref().unwrap();
    let of_no_macropixel = cohort.expected(stream.config(), pixels[0].start, light);
    assert_eq!(of_no_macropixel.unwrap_err(), EngineError::OwnLaws);
    assert!(cohort.expose(&stream, &pixels).is_ok());
}
