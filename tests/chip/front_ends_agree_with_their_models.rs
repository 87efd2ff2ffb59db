//! Front ends that join SPADs on one wire, alone and in their macropixel: the circuit gives what the plain-Rust model says,
//! for pulses of which no two meet within a gate's delay.

use crate::bench;

use bench::{Bench, SETTLING, corners};
use guided_dtof::chip::{
    ChipTiming, Exposure, FrontEnd, Sensor, SensorConfig, WindowLaw, front_end, macropixel_model,
};
use guided_dtof::engine::{
    Cohort, CohortOptions, Cycle, EngineError, Expose, Gate, LitPixel, Replay, Window,
    stream_config,
};
use guided_dtof::photon::{PhotonStream, PixelLight, SpadEvent};
use guided_dtof::units::Time;
use proptest::prelude::*;

/// Pulses, or a pulse and a CLK edge, that are farther apart than this see each other in one order only.
const GUARD: Time = Time::from_ps(300);

fn joined() -> impl Strategy<Value = FrontEnd> {
    let joined = FrontEnd::ALL.into_iter().filter(|kind| kind.joins());
    prop::sample::select(joined.collect::<Vec<_>>())
}

/// Those pulses, sorted, that are clear of each other's beginning and end, of their SPAD's last one and of CLK's edges.
fn clear(
    mut pulses: Vec<(Time, u8)>,
    timing: &ChipTiming,
    dead_time: Time,
    to_next_edge: impl Fn(Time) -> Time,
) -> Vec<(Time, u8)> {
    pulses.sort_unstable();
    let width = timing.pulses.shaped.unwrap_or_default();
    let mut kept: Vec<(Time, u8)> = Vec::new();
    for (time, spad) in pulses {
        let near = |other: Time| (time - other).as_fs().abs() < GUARD.as_fs();
        let meets = |&(before, same): &(Time, u8)| {
            near(before)
                || near(before + width)
                || same == spad && time < before + dead_time + GUARD
        };
        let sampled = time + timing.spad_to_sampled;
        let is_near_edge = to_next_edge(sampled - GUARD) < GUARD * 2;
        if !is_near_edge && !kept.iter().any(meets) {
            kept.push((time, spad));
        }
    }
    kept
}

proptest! {
    #![proptest_config(ProptestConfig { cases: 60, ..ProptestConfig::default() })]

    #[test]
    fn alone_they_give_what_the_model_says(
        corner in corners(),
        front_end in joined(),
        sides in prop::sample::select(vec![(1usize, 1usize), (2, 1), (2, 4), (4, 4)]),
        coincident_spads in 1usize..5,
        period_ps in 1_500i64..5_000,
        pulses in prop::collection::vec((0u8..16, 0i64..200_000), 0..200),
    ) {
        let config = SensorConfig {
            corner,
            front_end,
            spad_rows: sides.0,
            spad_cols: sides.1,
            coincident_spads: coincident_spads.min(sides.0 * sides.1),
            ..SensorConfig::default()
        };
        let mut bench = Bench::new(&front_end::circuit(&config), corner);
        let timing = ChipTiming::new(&config);
        let dead_time = Time::from_ns(2);
        let rise = |k: i64| SETTLING * 2 + Time::from_ps(period_ps) * k;
        let to_next_edge = |time: Time| {
            let since = (time - rise(0)).as_fs().rem_euclid(period_ps * 1_000);
            Time::from_fs(period_ps * 1_000 - since)
        };
        let spads = config.spads() as u8;
        let pulses = pulses.into_iter().map(|(spad, ps)| (rise(0) + Time::from_ps(ps), spad % spads));
        let pulses = clear(pulses.collect(), &timing, dead_time, to_next_edge);
        bench.pulse(Time::ZERO, SETTLING, "PIXEL_CLEAR");
        for &(time, spad) in &pulses {
            bench.pulse(time, dead_time, &format!("SPAD_RAW[{spad}]"));
        }
        let edges = 205_000 / period_ps;
        for k in 0..edges {
            bench.pulse(rise(k), Time::from_ps(period_ps / 2), "CLK");
        }
        let timed = bench.bus("SPAD_TIMED");
        prop_assert_eq!(timed.len(), 1);
        let mut run = bench.start(&[]);
        let mut model = front_end::FrontEndModel::new(&config, &timing);
        let mut pulses = pulses.into_iter().peekable();
        for k in 0..edges {
            while let Some((time, spad)) = pulses.next_if(|(t, _)| *t + timing.spad_to_sampled <= rise(k)) {
                model.pulse(time, spad);
            }
            model.clock();
            let found = run.number_at(rise(k + 1) - Time::from_fs(1), &timed);
            prop_assert_eq!(found, Some(model.spad_timed()), "after edge {}", k);
        }
    }

    #[test]
    fn in_a_macropixel_the_gates_count_what_the_model_counts(
        corner in corners(),
        front_end in joined(),
        coincident_spads in 1usize..4,
        clk_mhz in 100f64..400.0,
        start in 0u16..30,
        pulses in prop::collection::vec((0u8..16, 0.0f64..1.0), 0..300),
    ) {
        let config = SensorConfig {
            rows: 1,
            cols: 1,
            corner,
            front_end,
            coincident_spads,
            clk_hz: clk_mhz * 1e6,
            dead_time_ns: 3.0,
            bins: 12,
            ..SensorConfig::default()
        };
        prop_assert_eq!(config.check(), Ok(()));
        let exposure = Exposure::new(&config, 48, 4);
        let timing = ChipTiming::new(&config);
        let to_next_edge = |time: Time| {
            let mut edges = (time.as_fs() as f64 * config.clk_hz * 1e-15) as i64 - 2..;
            edges.find_map(|edge| {
                let left = exposure.rising(edge) - time;
                (left > Time::ZERO).then_some(left)
            }).unwrap()
        };
        let time_at_share = |share: f64| Time::from_fs((share * exposure.end().as_fs() as f64) as i64);
        let pulses = pulses.into_iter().map(|(spad, share)| (time_at_share(share), spad));
        let pulses = clear(pulses.collect(), &timing, config.dead_time(), to_next_edge);
        let events: Vec<SpadEvent> = pulses.iter().map(|&(time, spad)| SpadEvent { time, spad }).collect();
        let sensor = Sensor::from(&config);
        let delays = (timing, &**sensor.local_stop_delays());
        let by_model = macropixel_model::MacropixelModel::new(&config, delays, &exposure).histogram(start, pulses);
        let by_gates = Gate::new(&config, &exposure).histogram(start, &events);
        prop_assert_eq!(by_gates.as_ref(), Ok(&by_model));
        let refused = Window::new(&config, &exposure).histogram(start, &events);
        prop_assert_eq!(refused, Err(EngineError::Joined(front_end)));
        // The gates run it for the cycle engine, which promises nothing where signals race.
        match Cycle::new(&config, &exposure).histogram(start, &events) {
            Err(why) => prop_assert!(matches!(why, EngineError::Race { .. }), "{}", why),
            by_cycle => prop_assert_eq!(by_cycle, by_gates),
        }
    }
}

/// A pulse a bin, of another SPAD each, is counted once there, whatever joins the SPADs; a coincidence counts it nowhere.
#[test]
fn lone_pulses_are_counted_by_all_but_a_coincidence() {
    for front_end in FrontEnd::ALL {
        let config = SensorConfig {
            rows: 1,
            cols: 1,
            front_end,
            ..SensorConfig::default()
        };
        let exposure = Exposure::new(&config, 64, 1);
        let law = WindowLaw::new(&config, &exposure);
        let window = law.window(30).open().unwrap();
        let middle = |bin: i64| {
            let bin = law.bin_interval(&window, 0, bin);
            Time::from_fs((bin.start + bin.end).as_fs() / 2)
        };
        let pulses: Vec<SpadEvent> = (0..16)
            .map(|bin| SpadEvent {
                time: middle(bin),
                spad: bin as u8,
            })
            .collect();
        let counted = Gate::new(&config, &exposure)
            .histogram(30, &pulses)
            .unwrap();
        let each = u16::from(front_end != FrontEnd::Coincidence);
        assert_eq!(counted, [each; 16], "{front_end:?}");
    }
}

#[test]
fn engines_without_gates_refuse_a_shared_wire_by_name() {
    let config = SensorConfig {
        front_end: FrontEnd::OrTree,
        ..SensorConfig::default()
    };
    let exposure = Exposure::new(&config, 64, 10);
    let stream = stream_config(&config, &exposure, 1, Time::from_ns(1));
    let stream = PhotonStream::new(&stream);
    let pixels = [LitPixel {
        number: 0,
        start: 20,
        light: Some(PixelLight::echo(1.0, Time::from_ns(50))),
    }];
    let engines: [&dyn Expose; 2] = [
        &Window::new(&config, &exposure),
        &Cohort::new(&config, &exposure, CohortOptions::default()),
    ];
    for engine in engines {
        let why = engine.expose(&stream, &pixels).unwrap_err();
        assert_eq!(why, EngineError::Joined(FrontEnd::OrTree));
        assert!(why.to_string().contains("front_end = \"or_tree\""), "{why}");
    }
}
