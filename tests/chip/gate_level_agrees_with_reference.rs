//! The netlist, the reference models and the window law agree: same LOCAL_STOP times to the femtosecond,
//! same histograms to the count, over random sensors, clocks, STOP phases, start values and photon times.

use guided_dtof::chip::macropixel_model::MacropixelModel;
use guided_dtof::chip::p_counter::starts_high;
use guided_dtof::chip::window_law::{WindowLaw, WindowOutcome as LawWindow};
use guided_dtof::chip::{
    AfterBorrow, EventType, Exposure, Mode, Overflow, PCounter, Probe, Sensor, SensorConfig, Tap,
};
use guided_dtof::engine::{Cycle, EngineError, GateSimulation, Replay, Window};
use guided_dtof::kernel::Recorder;
use guided_dtof::photon::{SpadEvent, apply_dead_time};
use guided_dtof::units::Time;
use proptest::prelude::*;

#[derive(Debug, Clone)]
struct Case {
    config: SensorConfig,
    stop_periods: u32,
    laser_cycles: u32,
    start: u16,
    pulses: Vec<SpadEvent>,
}

fn sensors() -> impl Strategy<Value = SensorConfig> {
    let event_type = prop_oneof![
        4 => Just((EventType::Greater, 0u8)),
        1 => Just((EventType::Greater, 1)),
        1 => (0u8..4).prop_map(|t| (EventType::Equal, t)),
        1 => (0u8..4).prop_map(|t| (EventType::Less, t)),
    ];
    let mode = prop_oneof![3 => Just(Mode::Guided), 1 => Just(Mode::Conventional)];
    let overflow = prop_oneof![Just(Overflow::Saturate), Just(Overflow::Wrap)];
    let p_counter = (
        prop::sample::select(PCounter::ALL.to_vec()),
        prop::sample::select(vec![Tap::Borrow, Tap::Msb]),
        prop::sample::select(vec![AfterBorrow::Hold, AfterBorrow::Wrap]),
    );
    (
        (3usize..10, 1usize..20, 2usize..6, 80f64..480.0),
        (-1.0f64..1.0, 2f64..12.0),
        (event_type, mode, overflow),
        p_counter,
    )
        .prop_map(
            |(
                (counter_bits, bins, bin_bits, clk_mhz),
                (phase, dead_time_ns),
                (event, mode, overflow),
                (p_counter, tap, after_borrow),
            )| {
                SensorConfig {
                    rows: 1,
                    cols: 1,
                    counter_bits,
                    bins,
                    bin_bits,
                    clk_hz: clk_mhz * 1e6,
                    stop_phase_ps: phase * 0.5e6 / clk_mhz,
                    dead_time_ns,
                    event_type: event.0,
                    threshold: event.1,
                    overflow,
                    mode,
                    p_counter,
                    tap,
                    after_borrow,
                    ..SensorConfig::default()
                }
            },
        )
        .prop_filter("possible", |config| config.check().is_ok())
}

fn cases() -> impl Strategy<Value = Case> {
    (
        sensors(),
        (4u32..60, 0u8..4),
        1u32..12,
        any::<u16>(),
        prop::collection::vec((0.0f64..1.0, 0u8..16), 0..120),
    )
        .prop_map(
            |(config, (stop_periods, other), laser_cycles, start, photons)| {
                // Without memory a counter should come round with STOP.
                let wider = usize::from(config.tap == Tap::Borrow);
                let stop_periods = if !config.p_counter.row().has_memory && other > 0 {
                    1 << (config.counter_bits + wider)
                } else {
                    stop_periods
                };
                let exposure = Exposure::new(&config, stop_periods, laser_cycles);
                let end_fs = exposure.end().as_fs() as f64;
                let mut pulses: Vec<SpadEvent> = photons
                    .into_iter()
                    .map(|(at, spad)| SpadEvent {
                        time: Time::from_fs((at * end_fs) as i64),
                        spad,
                    })
                    .collect();
                pulses.sort_unstable();
                apply_dead_time(&mut pulses, &config.spad_model(), 0);
                // Mostly start values that come within the laser cycle.
                let start = if start & 3 == 0 {
                    start
                } else {
                    start >> 2 & 31
                };
                let start = start & config.largest_start();
                Case {
                    config,
                    stop_periods,
                    laser_cycles,
                    start,
                    pulses,
                }
            },
        )
}

proptest! {
    #![proptest_config(ProptestConfig { cases: 400, ..ProptestConfig::default() })]

    #[test]
    fn histograms_and_local_stops_are_the_same(case in cases()) {
        let Case { config, start, .. } = &case;
        let exposure = Exposure::new(config, case.stop_periods, case.laser_cycles);
        let law = WindowLaw::new(config, &exposure);
        let window = law.window(*start);
        if let LawWindow::Race(_) = window {
            let refused = Window::new(config, &exposure).histogram(*start, &case.pulses);
            let is_race = matches!(refused, Err(EngineError::Race { .. }));
            prop_assert!(is_race);
            return Ok(());
        }

        let mut gate = GateSimulation::new(config, &exposure, (0, 0), (1, 1), &[*start], &[&case.pulses]);
        let local_stop = gate.probes()[0].net(Probe::LocalStop);
        let mut recorder = Recorder::new([local_stop]);
        gate.run(&mut recorder);
        let has_memory = config.p_counter.row().has_memory;
        prop_assert_eq!(gate.loaded(), vec![has_memory.then_some(*start)]);
        let by_gates = gate.histograms().unwrap().into_counts();

        let by_cycles = Cycle::new(config, &exposure).histogram(*start, &case.pulses).unwrap();
        prop_assert_eq!(&by_gates, &by_cycles);
        let pulses = case.pulses.iter().map(|p| (p.time, p.spad));
        let sensor = Sensor::from(config);
        let delays = (*sensor.timing(), &**sensor.local_stop_delays());
        let by_model = MacropixelModel::new(config, delays, &exposure).histogram(*start, pulses);
        prop_assert_eq!(&by_gates, &by_model);
        let by_window = Window::new(config, &exposure).histogram(*start, &case.pulses);
        match window {
            LawWindow::Irregular(_) => prop_assert!(matches!(by_window, Err(EngineError::Irregular(_)))),
            _ => prop_assert_eq!(Ok(&by_gates), by_window.as_ref()),
        }

        if config.mode == Mode::Guided {
            let origin = gate.schedule().origin;
            let rises = recorder.rising_edges(local_stop).into_iter().map(|t| t - origin);
            // Loading may raise LOCAL_STOP, too.
            let rises: Vec<Time> = rises.filter(|&t| t > Time::ZERO).collect();
            let mut expected = Vec::new();
            let pulses = case.pulses.iter().map(|p| (p.time, p.spad));
            MacropixelModel::new(config, delays, &exposure).run(*start, pulses, |cause, _| expected.push(cause));
            // A reset may raise LOCAL_STOP, too, while HIT is in reset.
            let in_reset = |t: &Time| {
                let mut cycles = 0..=i64::from(case.laser_cycles);
                cycles.any(|c| (exposure.stop(c)..exposure.stop(c) + law.timing().stop_to_hit_release).contains(t))
            };
            let may_rise_in_reset = starts_high(config, *start) && has_memory;
            let is_false = |t: &Time| may_rise_in_reset && in_reset(t);
            let without_resets = |rises: Vec<Time>| -> Vec<Time> { rises.into_iter().filter(|t| !is_false(t)).collect() };
            match window {
                LawWindow::Open(open) => {
                    prop_assert_eq!(&rises, &expected);
                    let rises = without_resets(rises);
                    prop_assert_eq!(rises.len(), case.laser_cycles as usize);
                    for (cycle, &rise) in rises.iter().enumerate() {
                        let by_law = exposure.stop(cycle as i64) + open.strobe_cause;
                        prop_assert!((rise - by_law).as_fs().abs() <= 1, "{} {}", rise, by_law);
                    }
                }
                // A count that comes with STOP has not reached the MSB when the reset holds it high: the model, which has no
                // delays, sees it fall and rise.
                LawWindow::Irregular(_) => prop_assert_eq!(without_resets(rises), without_resets(expected)),
                _ => prop_assert!(by_gates.iter().all(|&n| n == 0)),
            }
        }
    }

    /// One photon, swept around every edge of every bin: it is counted exactly where the law says.
    #[test]
    fn a_photon_is_counted_in_the_bin_of_the_law(
        clk_mhz in 150f64..400.0,
        phase in -0.9f64..0.9,
        start in 0u16..40,
        bin in 0i64..16,
        edge_fs in -3i64..4,
        cycle in 0i64..3,
        p_counter in prop::sample::select(PCounter::ALL.to_vec()),
    ) {
        let config = SensorConfig {
            rows: 1,
            cols: 1,
            clk_hz: clk_mhz * 1e6,
            stop_phase_ps: phase * 0.5e6 / clk_mhz,
            counter_bits: 6,
            ..p_counter.sensor()
        };
        let stop_periods = if p_counter.row().has_memory { 50 } else { 64 };
        let exposure = Exposure::new(&config, stop_periods, 4);
        let law = WindowLaw::new(&config, &exposure);
        let Some(window) = law.window(start).open() else { return Ok(()) };
        let time = law.bin_interval(&window, cycle, bin).start + Time::from_fs(edge_fs);
        if time < Time::ZERO {
            return Ok(());
        }
        let pulse = SpadEvent { time, spad: 7 };
        let mut gate = GateSimulation::new(&config, &exposure, (0, 0), (1, 1), &[start], &[&[pulse]]);
        gate.run(&mut ());
        let counted = gate.histograms().unwrap().into_counts();
        let expected: Vec<u16> = (0..16)
            .map(|b| {
                let collects = |c| law.bin_interval(&window, c, b).contains(&time);
                (0..4).filter(|&c| collects(c)).count() as u16
            })
            .collect();
        prop_assert_eq!(counted, expected);
    }
}
