//! The counter TDC (thesis 4.9.3): gates, cycle engine, window engine and the model in plain Rust count the same of random sensors and pulses;
//! where it differs from the shift register and from delay lines; and which engines leave it out, by name.

use guided_dtof::analysis::TimingVerdict;
use guided_dtof::chip::macropixel_model::MacropixelModel;
use guided_dtof::chip::race::Irregular;
use guided_dtof::chip::{
    AfterBorrow, Exposure, Overflow, PCounter, Sensor, SensorConfig, Silicon, Tap, Tdc, WindowLaw,
    WindowOutcome as LawWindow, hslidar,
};
use guided_dtof::engine::{
    Cohort, CohortOptions, Cycle, EngineError, Expose, Gate, LitPixel, NotModelled, PulsedPixel,
    Replay, Runner, Timed, Window, full_stream, stream_config,
};
use guided_dtof::photon::{PhotonStream, PixelLight, SpadEvent, SpadModel, apply_dead_time};
use guided_dtof::units::Time;
use proptest::prelude::*;

fn sensors() -> impl Strategy<Value = SensorConfig> {
    let grid = prop::sample::select(vec![(4, 4), (4, 4), (1, 1), (2, 2), (8, 8), (1, 8)]);
    let overflow = prop::sample::select(vec![Overflow::Saturate, Overflow::Wrap]);
    let p_counter = (
        prop::sample::select(PCounter::ALL.to_vec()),
        prop::sample::select(vec![Tap::Borrow, Tap::Borrow, Tap::Msb]),
        prop::sample::select(vec![
            AfterBorrow::Hold,
            AfterBorrow::Hold,
            AfterBorrow::Wrap,
        ]),
        prop::sample::select(vec![1usize, 4]),
    );
    (
        (3usize..8, 1usize..20, 1usize..7, 40f64..400.0),
        (-1.0f64..1.0, 1f64..12.0, 0f64..60.0),
        (grid, overflow),
        p_counter,
    )
        .prop_map(
            |((counter_bits, bins, bin_bits, clk_mhz), times, (grid, overflow), counter)| {
                let (phase, dead_time_ns, clk_skew_ps) = times;
                let (p_counter, tap, after_borrow, step_periods) = counter;
                SensorConfig {
                    rows: 1,
                    cols: 4,
                    spad_rows: grid.0,
                    spad_cols: grid.1,
                    counter_bits,
                    bins,
                    bin_bits,
                    clk_hz: clk_mhz * 1e6,
                    stop_phase_ps: phase * 0.5e6 / clk_mhz,
                    dead_time_ns,
                    clk_skew_ps,
                    overflow,
                    p_counter,
                    tap,
                    after_borrow,
                    step_periods,
                    ..(*hslidar()).clone()
                }
            },
        )
        .prop_filter("possible", |config| config.check().is_ok())
}

/// Pulses of a macropixel, many of them together.
fn pulses(
    config: &SensorConfig,
    exposure: &Exposure,
) -> impl Strategy<Value = Vec<SpadEvent>> + use<> {
    let (spads, end_fs) = (config.spads() as u8, exposure.end().as_fs());
    let dead_time = config.dead_time();
    let burst = (
        0..end_fs,
        prop::collection::vec((0i64..9_000_000, 0..spads), 1..6),
    );
    prop::collection::vec(burst, 0..60).prop_map(move |bursts| {
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

type Case = (SensorConfig, Exposure, u32, u16, Vec<SpadEvent>);

fn cases() -> impl Strategy<Value = Case> {
    (sensors(), 8u32..60, 1u32..8, 0u32..4, 0u16..24).prop_flat_map(
        |(config, periods, cycles, number, start)| {
            let exposure = Exposure::new(&config, periods, cycles);
            let start = start.min(config.largest_start());
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
    #![proptest_config(ProptestConfig::with_cases(150))]

    #[test]
    fn gates_cycle_window_and_the_model_count_the_same(
        (config, exposure, number, start, pulses) in cases()
    ) {
        let law = WindowLaw::new(&config, &exposure).of_macropixel(number);
        let pixel = PulsedPixel { number, start, pulses: &pulses };
        let gate = || Gate::new(&config, &exposure).replay(&[pixel]).unwrap();
        let cycle = Cycle::new(&config, &exposure);
        match law.window(start) {
            LawWindow::Race(_) => {
                let is_race = matches!(cycle.replay(&[pixel]), Err(EngineError::Race { .. }));
                prop_assert!(is_race);
                return Ok(());
            }
            // START as it changes within a laser cycle is the gates' and the cycle engine's to follow.
            LawWindow::Irregular(_) => {
                prop_assert_eq!(gate(), cycle.replay(&[pixel]).unwrap());
                let window = Window::new(&config, &exposure).replay(&[pixel]);
                prop_assert!(matches!(window, Err(EngineError::Irregular(_))));
                return Ok(());
            }
            LawWindow::Open(_) | LawWindow::Never => {}
        }
        let gate = gate();
        prop_assert_eq!(&gate, &cycle.replay(&[pixel]).unwrap());
        prop_assert_eq!(&gate, &Window::new(&config, &exposure).replay(&[pixel]).unwrap());
        if config.clk_skew_ps == 0.0 || number == 0 {
            let sensor = Sensor::from(&config);
            let delays = (*sensor.timing(), &**sensor.local_stop_delays());
            let model = MacropixelModel::new(&config, delays, &exposure);
            let pulses = pulses.iter().map(|pulse| (pulse.time, pulse.spad));
            prop_assert_eq!(&gate[0], &model.histogram(start, pulses)[..]);
        }
    }
}

fn chip(tdc: Tdc) -> SensorConfig {
    SensorConfig {
        rows: 1,
        cols: 1,
        tdc,
        delay_sigma: 0.0,
        delay_control_v: 0.6,
        ..(*hslidar()).clone()
    }
}

/// Counts of the bins by the gates and the window engine, where the given number of SPADs fires at once in bin 3, in each of 5 laser cycles.
fn counted(tdc: Tdc, spads: u8) -> Vec<u16> {
    let (config, start) = (chip(tdc), 3);
    let exposure = Exposure::new(&config, 60, 5);
    let law = WindowLaw::new(&config, &exposure);
    let window = law.window(start).open().expect("it opens");
    let pulses: Vec<SpadEvent> = (0..exposure.laser_cycles)
        .flat_map(|cycle| {
            let bin = law.edges(&window, i64::from(cycle)).bin(3);
            let step = Time::from_fs((bin.end - bin.start).as_fs() / 8);
            (0..spads).map(move |spad| SpadEvent {
                time: bin.start + step * i64::from(2 + spad),
                spad,
            })
        })
        .collect();
    let pixel = PulsedPixel {
        number: 0,
        start,
        pulses: &pulses,
    };
    let gate = Gate::new(&config, &exposure).replay(&[pixel]).unwrap();
    let window = Window::new(&config, &exposure).replay(&[pixel]).unwrap();
    assert_eq!(gate, window);
    gate.into_counts()
}

/// Two events in one bin and laser cycle: the counter counts both, the shift register one, delay lines none.
#[test]
fn events_that_share_a_bin_all_count() {
    let in_bin_3 = |count: u16| {
        let mut counts = vec![0; 8];
        counts[3] = count;
        counts
    };
    for (spads, of_counter, of_shift_register, of_delay_line) in
        [(1, 5, 5, 5), (2, 10, 5, 0), (3, 15, 5, 5)]
    {
        assert_eq!(counted(Tdc::Counter, spads), in_bin_3(of_counter));
        assert_eq!(counted(Tdc::Clocked, spads), in_bin_3(of_shift_register));
        assert_eq!(counted(Tdc::DelayLine, spads), in_bin_3(of_delay_line));
    }
}

/// The window of the same start value, by a window and one CLK period.
#[test]
fn the_counter_s_window_lies_later_than_the_shift_register_s() {
    for start in [1, 5, 9] {
        let [counter, shift_register] = [Tdc::Counter, Tdc::Clocked].map(|tdc| {
            let config = chip(tdc);
            let law = WindowLaw::new(&config, &Exposure::new(&config, 60, 1));
            let window = law.window(start).open().expect("it opens");
            law.interval(&window)
        });
        let period = chip(Tdc::Counter).clock().period();
        let later = (chip(Tdc::Counter).bins as i64 + 1) * period.as_fs();
        assert_eq!((counter.start - shift_register.start).as_fs(), later);
        assert_eq!((counter.end - shift_register.end).as_fs(), later);
    }
}

/// The window engine draws what it needs, and counts what the gates count of the full stream, in dim and in bright light.
#[test]
fn what_a_window_cannot_see_is_not_drawn_and_counts_are_the_same() {
    let sensor = hslidar();
    let exposure = Exposure::new(&sensor, 524, 30);
    let law = WindowLaw::new(&sensor, &exposure);
    for (photons, background_hz, seed) in [(0.8, 8e6, 1), (8.0, 3e8, 2), (60.0, 8e6, 3)] {
        let stream = stream_config(&sensor, &exposure, seed, Time::from_ps(1_900));
        let stream = PhotonStream::new(&stream);
        let pixels: Vec<LitPixel> = [(0u32, 0u16), (63, 1), (700, 20), (2047, 127)]
            .into_iter()
            .map(|(number, start)| {
                let window = law.window(start).open().expect("it opens");
                let arrival = law.time_of(&window, 3.0);
                let light = PixelLight::echo(photons, arrival).with_background(background_hz);
                LitPixel {
                    number,
                    start,
                    light: Some(light),
                }
            })
            .collect();
        let gate = full_stream(&Gate::new(&sensor, &exposure), &stream, &pixels).unwrap();
        let window = Window::new(&sensor, &exposure);
        let drawn = window.expose(&stream, &pixels).unwrap();
        assert_eq!(gate.histograms, drawn.histograms);
        let full = full_stream(&window, &stream, &pixels).unwrap();
        assert_eq!(drawn.histograms, full.histograms);
        assert!(drawn.work.photons_drawn < full.work.photons_drawn);
    }
}

#[test]
fn engines_that_leave_it_out_say_so() {
    let config = chip(Tdc::Counter);
    let exposure = Exposure::new(&config, 60, 3);
    let stream = stream_config(&config, &exposure, 1, Time::from_ps(1_000));
    let stream = PhotonStream::new(&stream);
    let pixel = LitPixel {
        number: 0,
        start: 3,
        light: Some(PixelLight::echo(1.0, Time::from_ns(100))),
    };
    let cohort = Cohort::new(&config, &exposure, CohortOptions::default());
    let refusal = cohort.expose(&stream, &[pixel]).unwrap_err();
    let expected = EngineError::NotInCohorts(NotModelled::CounterTdc);
    assert_eq!(refusal, expected);
    // `timed` leaves it to the gates, and tells.
    let timed = Timed::new(&config, &exposure, Runner::Window);
    let pulsed = PulsedPixel {
        number: 0,
        start: 3,
        pulses: &[],
    };
    assert_eq!(timed.replay(&[pulsed]).unwrap().into_counts(), [0; 8]);
    let replayed = timed.coverage().replayed;
    let reasons: Vec<String> = replayed.keys().map(ToString::to_string).collect();
    assert_eq!(reasons, ["a counter TDC is left to the gates"]);
}

/// 60 CLK periods: LOCAL_STOP of start value 13 comes after 53 or more of them, and 8 bins do not fit behind it.
#[test]
fn a_window_that_the_next_laser_cycle_cuts_is_refused() {
    let config = chip(Tdc::Counter);
    let exposure = Exposure::new(&config, 60, 3);
    let law = WindowLaw::new(&config, &exposure);
    assert!(law.window(12).open().is_some());
    assert_eq!(law.window(13), LawWindow::Irregular(Irregular::CutWindow));
}

/// A timing that is met opens windows. START meets a CLK edge at 438 to 457 MHz.
#[test]
fn the_verdict_on_the_timing_knows_when_start_races() {
    for clk_mhz in [200.0, 400.0, 437.0, 447.0, 458.0, 500.0, 600.0] {
        let config = SensorConfig {
            clk_hz: clk_mhz * 1e6,
            ..chip(Tdc::Counter)
        };
        let verdict = TimingVerdict::analyse(&config, &Silicon::new(&config), (0, 0));
        let law = WindowLaw::new(&config, &Exposure::new(&config, 60, 1));
        let opens = law.window(3).open().is_some();
        assert!(opens || !verdict.is_met(), "{clk_mhz} MHz: {verdict}");
        assert!(
            verdict.is_met() || clk_mhz > 437.0,
            "{clk_mhz} MHz: {verdict}"
        );
        let races = verdict
            .to_string()
            .contains("START rises as CLK samples it");
        assert_eq!(races, clk_mhz == 447.0, "{clk_mhz} MHz: {verdict}");
    }
}
