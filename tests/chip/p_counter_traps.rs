//! What goes wrong with a P-counter when it is loaded, reset, enabled or aimed carelessly, and what keeps the sensor
//! from it. Each trap is shown to be one: a test here fails if the circuit stops falling into it.

use crate::bench;
use crate::scenario;

use bench::{Bench, SETTLING};
use guided_dtof::chip::window_law::WindowOutcome as LawWindow;
use guided_dtof::chip::{
    AfterBorrow, Exposure, PCounter, Probe, Probes, SensorConfig, Tap, WindowLaw, macropixel,
    p_counter, p_counter_timing,
};
use guided_dtof::engine::{Cycle, EngineError, Gate, GateSimulation, Replay, Window};
use guided_dtof::kernel::Recorder;
use guided_dtof::logic::Logic::One;
use guided_dtof::netlist::{CellKind, Corner, ModuleBuilder, NetId};
use guided_dtof::photon::SpadEvent;
use guided_dtof::units::Time;
use scenario::p_counters;

/// Half of [`SETTLING`].
const HALF: Time = Time::from_ps(2500);

fn sensor(p_counter: PCounter) -> SensorConfig {
    SensorConfig {
        rows: 1,
        cols: 1,
        ..p_counter.sensor()
    }
}

/// P-counters that each STOP resets.
fn with_memory() -> impl Iterator<Item = PCounter> {
    let all = PCounter::ALL.into_iter();
    all.filter(|p_counter| p_counter.row().has_memory)
}

/// A P-counter alone, out of reset with start value 0 at `SETTLING * 2`.
fn counter(config: &SensorConfig) -> Bench {
    let mut bench = Bench::new(&p_counter::circuit(config), Corner::Typ);
    bench.pulse(Time::ZERO, SETTLING, "MEMORY_RESET");
    bench.pulse(Time::ZERO, SETTLING * 2, "COUNTER_RESET");
    bench
}

/// The ways through gates into a net: flip-flops' outputs or inputs of the circuit, each with the gates' delay.
fn ways(bench: &Bench, net: NetId, behind: Time) -> Vec<(NetId, Time)> {
    let mut cells = bench.netlist.cells().iter();
    match cells.find(|cell| cell.outputs.contains(&Some(net))) {
        Some(gate) if !gate.kind.is_flip_flop() => {
            let inputs = gate.input_nets().enumerate();
            let delay = |pin| behind + bench.delay(gate.kind, pin, One);
            let ways = |(pin, input)| ways(bench, input, delay(pin));
            inputs.flat_map(ways).collect()
        }
        _ => vec![(net, behind)],
    }
}

/// The longest way from a flip-flop's output through gates to another's clock where bits of the memory take part in it, if they do anywhere.
fn way_past_the_memory(bench: &Bench) -> Option<Time> {
    let probes = Probes::of_block(&bench.netlist);
    let memory = probes.find(Probe::Memory)?;
    let flip_flops = bench.netlist.cells().iter();
    let clocks = flip_flops.filter(|cell| cell.kind.is_flip_flop());
    let ways = clocks.map(|cell| ways(bench, cell.input(1), Time::ZERO));
    let mixed = ways.filter(|ways| ways.iter().any(|way| memory.contains(&way.0)));
    let from_counter = mixed.flatten().filter(|way| !memory.contains(&way.0));
    from_counter.map(|way| way.1).max()
}

/// Of random loads one after the other, how many leave another count than they should, and how many raise
/// LOCAL_STOP.
fn loads(p_counter: PCounter, holds_reset: bool) -> (usize, usize) {
    const LOADS: u64 = 200;
    let config = sensor(p_counter);
    let mut bench = counter(&config);
    let start = |load: u64| load.wrapping_mul(0x9e37_79b9_7f4a_7c15) >> 55;
    let load_time = |load: u64| SETTLING * (3 + 4 * load as i64);
    for load in 0..LOADS {
        bench.number(load_time(load), "COUNTER_INIT", start(load));
        bench.pulse(load_time(load) + SETTLING, SETTLING, "MEMORY_LOAD");
        let reset = if holds_reset {
            (load_time(load), SETTLING * 3)
        } else {
            (load_time(load), Time::from_ns(1))
        };
        bench.pulse(reset.0, reset.1, "COUNTER_RESET");
    }
    let probes = Probes::of_block(&bench.netlist);
    let (out, local_stop) = (probes.bus(Probe::CounterOut), bench.net("LOCAL_STOP"));
    let mut run = bench.start(&["LOCAL_STOP"]);
    let is_wrong = |&load: &u64| {
        let model = p_counter::PCounterModel::new(&config, start(load) as u16);
        run.number_at(load_time(load + 1) - Time::from_fs(1), out) != Some(model.counter_out())
    };
    let wrong = (0..LOADS).filter(is_wrong).count();
    (wrong, run.recorder.rising_edges(local_stop).len())
}

#[test]
fn a_memory_bit_that_changes_clocks_the_next_stage_unless_the_reset_is_held() {
    let mut fall_into_it = 0;
    for p_counter in PCounter::ALL {
        let [held, let_go] = [true, false].map(|holds_reset| loads(p_counter, holds_reset));
        assert_eq!(held.0, 0, "{p_counter:?}");
        if !p_counter.row().has_memory {
            assert_eq!(let_go.0, 0, "{p_counter:?}");
            continue;
        }
        assert_eq!(held.1, 0, "{p_counter:?}");
        if way_past_the_memory(&counter(&sensor(p_counter))).is_some() {
            fall_into_it += 1;
            let (wrong, local_stops) = let_go;
            assert!(wrong > 80 && local_stops > 50, "{p_counter:?}: {let_go:?}");
        } else {
            // Nothing ripples, or flip-flops take the memory at the reset only.
            assert_eq!(let_go.1, 0, "{p_counter:?}");
        }
    }
    assert!(fall_into_it >= 2, "{fall_into_it}");
}

#[test]
fn a_counter_is_unknown_until_its_first_reset() {
    for p_counter in PCounter::ALL {
        let mut bench = Bench::new(&p_counter::circuit(&sensor(p_counter)), Corner::Typ);
        for edge in 0..20 {
            bench.pulse(SETTLING * (1 + edge), HALF, "COUNTER_CLK");
        }
        let probes = Probes::of_block(&bench.netlist);
        let (out, local_stop) = (probes.bus(Probe::CounterOut), bench.net("LOCAL_STOP"));
        bench.pulse(SETTLING * 30, SETTLING, "MEMORY_RESET");
        bench.pulse(SETTLING * 30, SETTLING, "COUNTER_RESET");
        let mut run = bench.start(&[]);
        assert_eq!(run.number_at(SETTLING * 25, out), None, "{p_counter:?}");
        assert_eq!(
            run.is_high_at(SETTLING * 25, local_stop),
            None,
            "{p_counter:?}"
        );
        assert_eq!(run.number_at(SETTLING * 35, out), Some(0), "{p_counter:?}");
    }
}

/// Timing block and P-counter, with the pins of both.
fn timed_counter(config: &SensorConfig) -> Bench {
    let mut m = ModuleBuilder::new("timed_counter");
    for pin in ["CLK", "STOP", "RESETB", "ENABLE", "MEMORY_LOAD"] {
        m.input(pin);
    }
    m.input_bus("COUNTER_INIT", config.counter_bits);
    for wire in ["LOCAL_STOP", "COUNTER_CLK", "COUNTER_RESET", "MEMORY_RESET"] {
        m.wire(wire);
    }
    let timing = p_counter_timing::circuit(config.after_borrow, config.reset_buffers());
    m.instance_by_names("p_counter_timing", &timing, &[]);
    m.instance_by_names("p_counter", &p_counter::circuit(config), &[]);
    Bench::new(&m.finish().unwrap(), Corner::Typ)
}

#[test]
fn releasing_the_chips_reset_while_enabled_gives_one_false_local_stop() {
    for p_counter in with_memory() {
        for enabled in [false, true] {
            let mut bench = timed_counter(&sensor(p_counter));
            bench.drive(Time::ZERO, "ENABLE", enabled);
            bench.drive(SETTLING * 4 + Time::from_ns(1), "RESETB", true);
            for edge in 0..40 {
                bench.pulse(SETTLING * (1 + edge), HALF, "CLK");
            }
            let local_stop = bench.net("LOCAL_STOP");
            let mut run = bench.start(&["LOCAL_STOP"]);
            run.until(SETTLING * 45);
            let rises = run.recorder.rising_edges(local_stop).len();
            assert_eq!(rises, usize::from(enabled), "{p_counter:?}");
        }
    }
    // The sensor's RUN flip-flop is reset with the chip and waits for STOP.
    let config = sensor(PCounter::Ripple);
    let exposure = Exposure::new(&config, 40, 1);
    let mut gate = GateSimulation::new(&config, &exposure, (0, 0), (1, 1), &[0], &[&[]]);
    let local_stop = gate.probes()[0].net(Probe::LocalStop);
    let mut recorder = Recorder::new([local_stop]);
    gate.run(&mut recorder);
    let rises = recorder.rising_edges(local_stop);
    assert!(
        rises.len() == 1 && rises[0] > gate.schedule().origin,
        "{rises:?}"
    );
}

/// Whether a COUNTER_RESET pulse of this width brings every count of a small counter back to every start value.
fn pulse_resets(config: &SensorConfig, width: Time) -> bool {
    let all = 1 << config.counter_bits;
    (0..all).all(|start| {
        let mut bench = counter(config);
        let mut now = SETTLING * 3;
        bench.pulse(now, SETTLING * 4, "COUNTER_RESET");
        bench.number(now, "COUNTER_INIT", start);
        bench.pulse(now + SETTLING, SETTLING, "MEMORY_LOAD");
        now += SETTLING * 5;
        let mut ends = Vec::new();
        for counts in 0..=2 * all {
            for _ in 0..counts {
                bench.pulse(now, HALF, "COUNTER_CLK");
                now += SETTLING;
            }
            bench.pulse(now, width, "COUNTER_RESET");
            now += SETTLING;
            ends.push(now - Time::from_fs(1));
            // The next try starts from a good reset.
            bench.pulse(now, SETTLING, "COUNTER_RESET");
            now += SETTLING * 2;
        }
        let probes = Probes::of_block(&bench.netlist);
        let (out, local_stop) = (probes.bus(Probe::CounterOut), bench.net("LOCAL_STOP"));
        let mut run = bench.start(&[]);
        ends.into_iter().all(|end| {
            run.number_at(end, out) == Some(start) && run.is_high_at(end, local_stop) == Some(false)
        })
    })
}

#[test]
fn the_reset_pulse_must_outlast_the_way_to_the_next_stages_clock() {
    let mut p_counters = 0;
    for p_counter in PCounter::ALL {
        let config = SensorConfig {
            // Two segments where there are any.
            counter_bits: 4,
            ..sensor(p_counter)
        };
        let bench = counter(&config);
        let Some(gates) = way_past_the_memory(&bench) else {
            continue;
        };
        p_counters += 1;
        let way = bench.delay(CellKind::Dffr, 2, One) + gates;
        assert!((way.as_ns() - 0.126).abs() < 0.001, "{way}");
        let ps = Time::from_ps(1);
        assert!(!pulse_resets(&config, way - ps), "{p_counter:?}");
        assert!(pulse_resets(&config, way + ps), "{p_counter:?}");
        let timing = bench.timing();
        assert!(timing.stop_to_reset_release - timing.stop_to_reset > way * 2);
    }
    assert!(p_counters >= 2, "{p_counters}");
}

fn local_stops(config: &SensorConfig, exposure: &Exposure, start: u16) -> Vec<Time> {
    let mut gate = GateSimulation::new(config, exposure, (0, 0), (1, 1), &[start], &[&[]]);
    let local_stop = gate.probes()[0].net(Probe::LocalStop);
    let mut recorder = Recorder::new([local_stop]);
    gate.run(&mut recorder);
    let origin = gate.schedule().origin;
    let rises = recorder.rising_edges(local_stop).into_iter();
    rises
        .map(|t| t - origin)
        .filter(|&t| t > Time::ZERO)
        .collect()
}

#[test]
fn a_start_value_beyond_the_laser_cycle_never_stops() {
    for p_counter in with_memory() {
        let config = sensor(p_counter);
        let exposure = Exposure::new(&config, 60, 3);
        let law = WindowLaw::new(&config, &exposure);
        for (start, rises) in [(57, 3), (60, 0), (511, 0)] {
            assert_eq!(
                local_stops(&config, &exposure, start).len(),
                rises,
                "{p_counter:?} {start}"
            );
            assert_eq!(
                law.window(start).open().is_some(),
                rises > 0,
                "{p_counter:?} {start}"
            );
        }
    }
}

#[test]
fn a_counter_that_wraps_stops_again_and_again() {
    for (p_counter, tap, after_borrow) in p_counters() {
        let is_bit = p_counter.row().no_msb.is_none();
        if !p_counter.row().has_memory || after_borrow == AfterBorrow::Hold {
            continue;
        }
        let every = if is_bit && tap == Tap::Borrow { 32 } else { 16 };
        let config = SensorConfig {
            tap,
            after_borrow: AfterBorrow::Wrap,
            counter_bits: 4,
            ..sensor(p_counter)
        };
        let exposure = Exposure::new(&config, 98, 1);
        let law = WindowLaw::new(&config, &exposure);
        let expected: Vec<Time> = (4..98)
            .step_by(every)
            .map(|edge| exposure.falling(edge) + law.timing().ripple())
            .collect();
        assert_eq!(
            local_stops(&config, &exposure, 3),
            expected,
            "{p_counter:?} {tap:?}"
        );
        assert!(matches!(law.window(3), LawWindow::Irregular(_)));
        assert!(Window::new(&config, &exposure).histogram(3, &[]).is_err());
        assert_eq!(
            Cycle::new(&config, &exposure).histogram(3, &[]),
            Ok(vec![0; 16])
        );
    }
}

/// A comparator that wraps comes round after 2ⁿ counts, a down counter with its borrow after 2ⁿ⁺¹: in laser cycles between
/// the two it has several windows, where the other has one.
#[test]
fn a_comparator_that_wraps_has_more_windows_than_a_down_counter() {
    let exposure = Exposure::new(&sensor(PCounter::Ripple), 28, 6);
    // A photon every third CLK period, of one SPAD after the other.
    let pulses: Vec<SpadEvent> = (2..160)
        .step_by(3)
        .map(|edge| SpadEvent {
            time: exposure.rising(edge) - Time::from_ps(1_250),
            spad: (edge % 16) as u8,
        })
        .collect();
    let counts = |p_counter| {
        let config = SensorConfig {
            after_borrow: AfterBorrow::Wrap,
            counter_bits: 4,
            bins: 6,
            ..sensor(p_counter)
        };
        let law = WindowLaw::new(&config, &exposure).window(7);
        let gate = Gate::new(&config, &exposure).histogram(7, &pulses).unwrap();
        let cycle = Cycle::new(&config, &exposure).histogram(7, &pulses);
        assert_eq!(cycle.as_ref(), Ok(&gate));
        let window = Window::new(&config, &exposure).histogram(7, &pulses);
        (law, gate, window)
    };
    let (law, one, window) = counts(PCounter::Ripple);
    assert!(matches!(law, LawWindow::Open(_)));
    assert_eq!(window, Ok(one.clone()));
    let (law, several, window) = counts(PCounter::Comparator);
    assert!(matches!(law, LawWindow::Irregular(_)));
    assert!(matches!(window, Err(EngineError::Irregular(_))));
    assert_ne!(one, several);
}

/// Enabled in CLK's low phase, a counter that no reset holds takes that for an edge.
#[test]
fn enabling_while_clk_is_low_counts_one_step_too_many() {
    for enabled_low in [false, true] {
        let mut bench = timed_counter(&sensor(PCounter::Memoryless));
        bench.drive(SETTLING, "RESETB", true);
        bench.number(SETTLING, "COUNTER_INIT", 100);
        bench.pulse(SETTLING * 2, SETTLING, "MEMORY_LOAD");
        for edge in 0..10 {
            bench.pulse(SETTLING * (10 + 2 * edge), SETTLING, "CLK");
        }
        // CLK falls at 11, 13, 15 and 17 SETTLING.
        let enable = SETTLING * if enabled_low { 11 } else { 10 } + HALF;
        bench.drive(enable, "ENABLE", true);
        let falls = if enabled_low { 3 } else { 4 };
        let probes = Probes::below_instance(&bench.netlist, "");
        let out = probes.bus(Probe::CounterOut);
        let mut run = bench.start(&[]);
        let found = run.number_at(SETTLING * 18, out);
        assert_eq!(found, Some(100 - falls - u64::from(enabled_low)));
    }
}

#[test]
fn small_start_values_reach_into_the_laser_cycle_before() {
    let config = sensor(PCounter::Ripple);
    let exposure = Exposure::new(&config, 60, 2);
    let law = WindowLaw::new(&config, &exposure);
    for start in 0..30 {
        let window = law.window(start).open().unwrap();
        assert_eq!(
            law.interval(&window).start < Time::ZERO,
            start < 17,
            "{start}"
        );
    }
    // The first bins of the second laser cycle's window lie before its STOP.
    let window = law.window(5).open().unwrap();
    let bin = law.bin_interval(&window, 1, 2);
    assert!(bin.end < exposure.stop(1));
    let pulse = SpadEvent {
        time: bin.start + Time::from_ps(100),
        spad: 0,
    };
    let mut gate = GateSimulation::new(&config, &exposure, (0, 0), (1, 1), &[5], &[&[pulse]]);
    gate.run(&mut ());
    let mut expected = vec![0; 16];
    expected[2] = 1;
    assert_eq!(gate.histograms().unwrap().counts(), expected);
}

#[test]
fn the_msb_tap_with_hold_is_dead_for_the_upper_half() {
    for p_counter in with_memory().filter(|p_counter| p_counter.row().no_msb.is_none()) {
        let config = SensorConfig {
            tap: Tap::Msb,
            counter_bits: 5,
            ..sensor(p_counter)
        };
        let exposure = Exposure::new(&config, 60, 2);
        let law = WindowLaw::new(&config, &exposure);
        for start in 0..32 {
            let rises = local_stops(&config, &exposure, start).len();
            let expected = if start < 16 { 2 } else { 0 };
            assert_eq!(rises, expected, "{p_counter:?} {start}");
            let opens = law.window(start).open().is_some();
            assert_eq!(opens, start < 16, "{p_counter:?} {start}");
        }
    }
}

/// The tap's false rise at STOP finds HIT in reset, in every corner. (With set/reset flip-flops by less than a removal
/// time, so that the window law does not rely on it.)
#[test]
fn the_msb_taps_rise_at_stop_is_not_counted() {
    for p_counter in with_memory().filter(|p_counter| p_counter.row().no_msb.is_none()) {
        for corner in Corner::ALL {
            let config = SensorConfig {
                tap: Tap::Msb,
                after_borrow: AfterBorrow::Wrap,
                counter_bits: 5,
                corner,
                clk_hz: 200e6,
                ..sensor(p_counter)
            };
            let exposure = Exposure::new(&config, 38, 4);
            // From 20, CLK fall 21 raises LOCAL_STOP; it falls 16 counts later, one before STOP.
            let start = 20;
            let rises = local_stops(&config, &exposure, start);
            assert_eq!(rises.len(), 8, "{p_counter:?} {corner:?}: {rises:?}");
            let pulses: Vec<SpadEvent> = (0..4 * 38 * 5)
                .filter(|ns| ns % 9 == 0)
                .map(|ns| SpadEvent {
                    time: Time::from_ns(ns),
                    spad: (ns % 16) as u8,
                })
                .collect();
            let mut gate =
                GateSimulation::new(&config, &exposure, (0, 0), (1, 1), &[start], &[&pulses]);
            gate.run(&mut ());
            let counted = gate.histograms().unwrap().into_counts();
            assert!(counted.iter().map(|&n| u32::from(n)).sum::<u32>() > 10);
            let hold = SensorConfig {
                tap: Tap::Borrow,
                after_borrow: AfterBorrow::Hold,
                ..config
            };
            let true_windows = Cycle::new(&hold, &exposure)
                .histogram(start, &pulses)
                .unwrap();
            assert_eq!(counted, true_windows, "{p_counter:?} {corner:?}");
        }
    }
}

/// In the macropixel, too, the held reset keeps a load from being counted.
#[test]
fn the_sensor_holds_the_reset_while_it_loads() {
    for p_counter in with_memory() {
        let mut bench = Bench::new(&macropixel::circuit(&sensor(p_counter)), Corner::Typ);
        bench.pulse(Time::ZERO, SETTLING, "PIXEL_CLEAR");
        bench.drive(SETTLING, "RESETB", true);
        for load in 0..50u64 {
            let at = SETTLING * (2 + 3 * load as i64);
            bench.number(
                at,
                "COUNTER_INIT",
                load.wrapping_mul(0x9e37_79b9_7f4a_7c15) >> 55,
            );
            bench.pulse(at + SETTLING, SETTLING, "MEMORY_LOAD");
        }
        let local_stop = bench.net("LOCAL_STOP");
        let mut run = bench.start(&["LOCAL_STOP"]);
        run.until(SETTLING * 160);
        assert_eq!(run.recorder.rising_edges(local_stop), [], "{p_counter:?}");
    }
}
