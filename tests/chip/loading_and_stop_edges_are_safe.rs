//! What may go wrong between the clocks either does no harm or is reported: loading while counting, a STOP edge
//! anywhere in the CLK period, a reset pulse too short, two pulses of a SPAD within a period.

use guided_dtof::chip::{
    Exposure, Probe, Probes, SensorConfig, WindowLaw, WindowOutcome, macropixel,
};
use guided_dtof::engine::{self as fast, Cancelling, Cycle, Gate, GateSimulation, Replay};
use guided_dtof::kernel::{Drive, Kernel, Policy, Recorder, Stimulus, TimingChecks, clock};
use guided_dtof::netlist::{
    ArcDelay, CellKind, CheckKind, Corner, Library, NetId, Netlist, Timing,
};
use guided_dtof::photon::{SpadEvent, apply_dead_time};
use guided_dtof::stimulus::{HardwareEventKind, HardwareEvents};
use guided_dtof::units::{Frequency, Time};
use proptest::prelude::*;

use crate::scenario::p_counters;

/// First STOP edge of the macropixel that is driven by hand.
const ORIGIN: Time = Time::from_ns(40);
const STOP_PERIODS: i64 = 48;

/// A macropixel alone, its pins driven by hand: start value `first` at power-up, `second` written at `load` after the
/// first STOP edge. `enabled` says in which laser cycles ENABLE is high.
struct Bench {
    netlist: Netlist,
    exposure: Exposure,
    local_stops: Vec<Time>,
    events: Vec<(HardwareEventKind, Time)>,
    violations: usize,
}

impl Bench {
    fn run(first: u16, second: u16, load: Time, enabled: [bool; 4]) -> Self {
        let config = SensorConfig::default();
        let netlist = Netlist::elaborate(&macropixel::circuit(&config));
        let exposure = Exposure::new(&config, STOP_PERIODS as u32, 4);
        let nets = |name: &str| netlist.signal(name).unwrap();
        let mut drives: Vec<Drive> = netlist
            .inputs()
            .into_iter()
            .map(|net| Drive::new(Time::ZERO, net, false))
            .collect();
        let mut drive = |time, net: NetId, value: bool| drives.push(Drive::new(time, net, value));
        let ns = Time::from_ns;
        drive(ns(1), nets("CLK")[0], true);
        drive(ns(1), nets("PIXEL_CLEAR")[0], true);
        drive(ns(2), nets("RESETB")[0], true);
        drive(ns(10), nets("PIXEL_CLEAR")[0], false);
        for (time, value) in [(ns(4), first), (ORIGIN + load - ns(3), second)] {
            for (bit, &net) in nets("COUNTER_INIT").iter().enumerate() {
                drive(time, net, value >> bit & 1 == 1);
            }
            drive(time + ns(3), nets("MEMORY_LOAD")[0], true);
            drive(time + ns(5), nets("MEMORY_LOAD")[0], false);
        }
        let stop = |cycle: i64| ORIGIN + exposure.stop(cycle);
        for cycle in 0..4 {
            drive(stop(cycle), nets("STOP")[0], true);
            drive(ORIGIN + exposure.stop_fall(cycle), nets("STOP")[0], false);
            // As the sensor's RUN flip-flop has it: with STOP.
            drive(stop(cycle), nets("ENABLE")[0], enabled[cycle as usize]);
        }
        let half_periods = 8 * STOP_PERIODS;
        drives.extend(clock(
            nets("CLK")[0],
            exposure.clock,
            ORIGIN,
            -8,
            half_periods,
        ));
        let library = Library::generic_40nm();
        let mut kernel = Kernel::new(&netlist, &Timing::nominal(&netlist, &library, Corner::Typ));
        let local_stop = nets("LOCAL_STOP")[0];
        let mut recorder = Recorder::new([local_stop]);
        let mut events = HardwareEvents::new(
            &netlist,
            &config,
            &[Probes::below_instance(&netlist, "")],
            ns(3),
        );
        let mut checks = TimingChecks::new(&netlist, &library, Corner::Typ)
            .policy(Policy::ReportOnly)
            .not_before(ns(20));
        let end = stop(4);
        kernel
            .run(
                &mut Stimulus::sorted(drives),
                end,
                &mut (&mut recorder, (&mut events, &mut checks)),
            )
            .unwrap();
        let found = events.report.hardware_events.iter();
        Bench {
            exposure,
            local_stops: recorder.rising_edges(local_stop),
            events: found.map(|e| (e.kind, Time::from_fs(e.time_fs))).collect(),
            violations: checks.report(&netlist).violated() as usize,
            netlist,
        }
    }

    /// LOCAL_STOPs of a laser cycle, from its STOP edge.
    fn in_cycle(&self, cycle: i64) -> Vec<Time> {
        let stop = |cycle| ORIGIN + self.exposure.stop(cycle);
        let within = self
            .local_stops
            .iter()
            .filter(|t| (stop(cycle)..stop(cycle + 1)).contains(*t));
        within.map(|&t| t - stop(cycle)).collect()
    }

    /// When LOCAL_STOP should rise for a start value; edges are rounded to a femtosecond.
    fn is_right(&self, cycle: i64, start: u16) -> bool {
        let config = SensorConfig::default();
        let law = WindowLaw::new(&config, &self.exposure);
        let WindowOutcome::Open(window) = law.window(start) else {
            panic!("a start value within the laser cycle");
        };
        let found = self.in_cycle(cycle);
        found.len() == 1 && (found[0] - window.strobe_cause).as_fs().abs() <= 1
    }
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(96))]

    /// Whenever in a disabled laser cycle the new value is written, nothing counts, and the next cycle counts from it.
    #[test]
    fn loading_while_the_counter_is_held_in_reset_does_no_harm(
        first in 0u16..40, second in 0u16..40, load_ps in 4_000i64..118_000,
    ) {
        let cycle = Exposure::new(&SensorConfig::default(), STOP_PERIODS as u32, 4).stop(1);
        let load = cycle + Time::from_ps(load_ps);
        let bench = Bench::run(first, second, load, [true, false, true, true]);
        prop_assert!(bench.is_right(0, first));
        prop_assert_eq!(bench.in_cycle(1), []);
        prop_assert!(bench.is_right(2, second) && bench.is_right(3, second));
        prop_assert_eq!(&bench.events, &[]);
        prop_assert_eq!(bench.violations, 0);
    }

    /// While it counts, every write that changes a bit is reported at its time, and one that changes none does nothing.
    /// Wherever the count has gone, the next STOP edge mends it.
    #[test]
    fn loading_while_counting_is_reported_and_the_next_stop_edge_mends_it(
        first in 0u16..40, second in 0u16..40, same: bool, load_ps in 4_000i64..118_000,
    ) {
        let second = if same { first } else { second };
        let cycle = Exposure::new(&SensorConfig::default(), STOP_PERIODS as u32, 4).stop(1);
        let load = cycle + Time::from_ps(load_ps);
        let bench = Bench::run(first, second, load, [true; 4]);
        prop_assert!(bench.is_right(0, first));
        let bits = (first ^ second).count_ones() as usize;
        let written = Library::generic_40nm().delay(CellKind::Dffr, 1, guided_dtof::logic::Logic::One, Corner::Typ);
        let expected = (HardwareEventKind::MemoryWrittenWhileCounting, ORIGIN + load + written);
        prop_assert_eq!(&bench.events, &vec![expected; bits]);
        if first == second {
            prop_assert!(bench.is_right(1, first));
        }
        prop_assert!(bench.is_right(2, second) && bench.is_right(3, second), "{:?}", bench.netlist.inputs().len());
    }

    /// At any phase, to the femtosecond, of any clock: a capture that is not the window law's comes with a violation.
    #[test]
    fn a_stop_edge_anywhere_in_the_clk_period_is_harmless_or_reported(
        period_ps in 2_300i64..6_000, share in -0.5f64..0.5, start in 4u16..24,
    ) {
        let period = Time::from_ps(period_ps);
        let exposure = Exposure {
            clock: Frequency::from_period(period).unwrap(),
            stop_phase: Time::from_fs((period.as_fs() as f64 * share) as i64),
            stop_periods: 40,
            laser_cycles: 3,
        };
        let config = SensorConfig { rows: 1, cols: 1, clk_hz: exposure.clock.as_hz(), ..SensorConfig::default() };
        let law = WindowLaw::new(&config, &exposure).window(start);
        let found = captured(&config, &exposure, start, None);
        match law {
            WindowOutcome::Open(window) => {
                prop_assert_eq!(&found.violations, &[]);
                prop_assert!(found.is_right(&exposure, window.strobe_cause));
            }
            // The law calls a race what comes within 2 fs of a limit as well.
            WindowOutcome::Race(_) => prop_assert!(!found.violations.is_empty() || found.local_stops.len() == 3),
            WindowOutcome::Never | WindowOutcome::Irregular(_) => {
                prop_assert!(false, "the laser cycle is long enough, the P-counter the default one");
            }
        }
        prop_assert_eq!(found.events, []);
    }

    /// Of every kind of P-counter, from the first start value to those whose LOCAL_STOP meets the end of the laser cycle: what the law
    /// opens rises there in every laser cycle and breaks no limit.
    #[test]
    fn local_stop_rises_where_the_law_has_it(
        (p_counter, tap, after_borrow) in prop::sample::select(p_counters()),
        period_ps in 2_300i64..6_000,
        share in -0.5f64..0.5,
        periods in 20u32..60,
        start in prop_oneof![0u16..60, 500u16..512],
        before_end in prop::option::of(0u16..6),
    ) {
        // One without memory opens windows where STOP comes as often as it comes round.
        let has_memory = p_counter.row().has_memory;
        let stop_periods = if has_memory { periods } else { 512 };
        let start = before_end.map_or(start, |before| stop_periods as u16 - 1 - before);
        let period = Time::from_ps(period_ps);
        let exposure = Exposure {
            clock: Frequency::from_period(period).unwrap(),
            stop_phase: Time::from_fs((period.as_fs() as f64 * share) as i64),
            stop_periods,
            laser_cycles: 3,
        };
        let clk_hz = exposure.clock.as_hz();
        let config = SensorConfig { rows: 1, cols: 1, clk_hz, p_counter, tap, after_borrow, ..SensorConfig::default() };
        let law = WindowLaw::new(&config, &exposure);
        let mut found = captured(&config, &exposure, start, None);
        // One without memory raises LOCAL_STOP before the exposure, too.
        found.local_stops.retain(|&time| has_memory || time > Time::ZERO);
        if let WindowOutcome::Open(window) = law.window(start) {
            // As LOCAL_STOP falls in the reset pulse it may cut a pulse of COUNTER_CLK short. That counts nothing, but ends, too
            // soon for its width, up to that width after the reset.
            let timing = law.timing();
            let released = timing.stop_to_reset_release + timing.counter.clock_high;
            let is_in_reset = |t: Time| (0..3).any(|cycle| (Time::ZERO..released).contains(&(t - exposure.stop(cycle))));
            // What happens after the exposure spoils no window.
            found.violations.retain(|&(kind, time)| {
                time <= exposure.end() && !(kind == CheckKind::ClockHigh && is_in_reset(time))
            });
            prop_assert_eq!(&found.violations, &[]);
            prop_assert!(found.is_right(&exposure, window.strobe_cause), "{:?} {:?}", window, found);
        }
    }

    /// A shorter and shorter delay chain: as soon as a count goes wrong, an event or a violation says so.
    #[test]
    fn a_reset_pulse_that_is_too_short_is_reported(chain in 0.01f64..1.0, start in 3u16..512) {
        let config = SensorConfig { rows: 1, cols: 1, ..SensorConfig::default() };
        // Long enough for some start values; the others are interrupted on their way down.
        let exposure = Exposure::new(&config, 40, 4);
        let found = captured(&config, &exposure, start, Some(chain));
        let is_reported = !found.violations.is_empty() || !found.events.is_empty();
        let nominal = captured(&config, &exposure, start, None);
        let moved = found.local_stops != nominal.local_stops;
        prop_assert!(!moved || is_reported, "{:?} {:?}", found.local_stops, nominal.local_stops);
        if chain > 0.8 {
            prop_assert!(!is_reported);
        }
    }
}

/// What a simulated macropixel did.
#[derive(Debug)]
struct MacropixelOutcome {
    local_stops: Vec<Time>,
    events: Vec<HardwareEventKind>,
    violations: Vec<(CheckKind, Time)>,
}

impl MacropixelOutcome {
    fn is_right(&self, exposure: &Exposure, strobe_cause: Time) -> bool {
        let stops = self.local_stops.iter().enumerate();
        let mut near = stops.map(|(cycle, &t)| t - exposure.stop(cycle as i64) - strobe_cause);
        self.local_stops.len() == exposure.laser_cycles as usize
            && near.all(|t| t.as_fs().abs() <= 2)
    }
}

/// Exposes one macropixel; the delays of its reset's delay chain are multiplied by `chain`.
fn captured(
    config: &SensorConfig,
    exposure: &Exposure,
    start: u16,
    chain: Option<f64>,
) -> MacropixelOutcome {
    let mut gate = GateSimulation::new(config, exposure, (0, 0), (1, 1), &[start], &[&[]]);
    if let Some(factor) = chain {
        let timing = shortened(gate.netlist(), factor);
        gate = gate.with_timing(&timing);
    }
    let local_stop = gate.probes()[0].net(Probe::LocalStop);
    let mut recorder = Recorder::new([local_stop]);
    let mut events = gate.hardware_events();
    let mut checks = gate.timing_checks(Policy::ReportOnly);
    gate.run(&mut (&mut recorder, (&mut events, &mut checks)));
    let origin = gate.schedule().origin;
    let found = events.report.hardware_events.iter();
    let report = checks.report(gate.netlist());
    let violations = report.violations.iter();
    MacropixelOutcome {
        local_stops: recorder
            .rising_edges(local_stop)
            .iter()
            .map(|&t| t - origin)
            .collect(),
        events: found.map(|e| e.kind).collect(),
        violations: violations.map(|v| (v.kind, v.time - origin)).collect(),
    }
}

fn shortened(netlist: &Netlist, factor: f64) -> Timing {
    let mut timing = Timing::nominal(netlist, &Library::generic_40nm(), Corner::Typ);
    for cell in Probes::of_macropixel(netlist, 0, 0).timing_block_cells(netlist) {
        if netlist.cells()[cell.index()].kind == CellKind::Buf {
            let mut delays = *timing.cell_delays(cell);
            for arc in delays.as_flattened_mut() {
                let scaled = |time: Time| Time::from_fs((time.as_fs() as f64 * factor) as i64);
                *arc = ArcDelay::new(scaled(arc.rise()), scaled(arc.fall()));
            }
            timing.set(cell, delays);
        }
    }
    timing
}

/// An interrupted count whose stages must rise again, and a chain that does not give them the time.
#[test]
fn the_shortest_pulses_leave_a_wrong_count_and_say_so() {
    let config = SensorConfig {
        rows: 1,
        cols: 1,
        ..SensorConfig::default()
    };
    let exposure = Exposure::new(&config, 40, 4);
    // Of 511: interrupted. Of 3 and 20: after LOCAL_STOP, whose fall lets an edge of COUNTER_CLK through. At a
    // hundredth of the delays, the pulse is shorter than the gates behind it, and there is none.
    for (start, chain) in [(511, 0.2), (20, 0.2), (3, 0.371), (511, 0.01), (20, 0.01)] {
        let found = captured(&config, &exposure, start, Some(chain));
        let is_found = found.events.contains(&HardwareEventKind::ResetTooShort);
        assert!(is_found, "{start} {chain} {found:?}");
    }
    let nominal = captured(&config, &exposure, 511, Some(1.0));
    assert_eq!((nominal.events, nominal.violations), (vec![], vec![]));
}

#[test]
fn two_pulses_of_a_spad_within_a_clk_period_are_reported() {
    let config = SensorConfig {
        rows: 1,
        cols: 1,
        dead_time_ns: 0.5,
        ..SensorConfig::default()
    };
    let exposure = Exposure::new(&config, 40, 1);
    let edge = exposure.rising(12);
    let pulse = |before_ps| SpadEvent {
        time: edge - Time::from_ps(before_ps),
        spad: 3,
    };
    for (pulses, expected) in [
        (
            [pulse(1_500), pulse(500)],
            vec![HardwareEventKind::PulsesCancelled],
        ),
        ([pulse(3_000), pulse(500)], vec![]),
    ] {
        let mut gate = GateSimulation::new(&config, &exposure, (0, 0), (1, 1), &[20], &[&pulses]);
        let mut events = gate.hardware_events();
        gate.run(&mut events);
        let report = events.report;
        let kinds: Vec<_> = report.hardware_events.iter().map(|e| e.kind).collect();
        assert_eq!(kinds, expected, "{report}");
        for event in &report.hardware_events {
            assert_eq!(event.instance, "mp_r0_c0.front_end.spad_3");
        }
        let counted = gate.histograms().unwrap()[0].iter().sum::<u16>();
        assert_eq!(counted as usize, if expected.is_empty() { 2 } else { 0 });
    }
}

proptest! {
    #![proptest_config(ProptestConfig { cases: 12, ..ProptestConfig::default() })]

    /// What is told of photons that cancel without simulating is what the gates do.
    #[test]
    fn photons_that_cancel_are_those_that_the_gates_report(
        times in prop::collection::vec((0i64..400_000_000, 0u8..3), 1..120),
        clk_mhz in 60f64..300.0,
        phase in -0.9f64..0.9,
    ) {
        let config = SensorConfig {
            rows: 1,
            cols: 1,
            clk_hz: clk_mhz * 1e6,
            stop_phase_ps: phase * 0.5e6 / clk_mhz,
            dead_time_ns: 1.0,
            ..SensorConfig::default()
        };
        let exposure = Exposure::new(&config, 40, 3);
        let events = times.iter().map(|&(fs, spad)| SpadEvent { time: Time::from_fs(fs), spad });
        let mut pulses: Vec<SpadEvent> = events.filter(|e| e.time < exposure.end()).collect();
        pulses.sort_unstable();
        apply_dead_time(&mut pulses, &config.spad_model(), 0);

        let law = WindowLaw::new(&config, &exposure);
        let latency = law.timing().spad_to_sampled;
        let cancelling = Cancelling::from_law(config.dead_time(), exposure.clock, || law).unwrap();
        let mut gate = GateSimulation::new(&config, &exposure, (0, 0), (1, 1), &[20], &[&pulses]);
        let toggled = gate.schedule().origin + latency;
        let told: Vec<(i64, String)> = cancelling
            .pairs(&pulses)
            .map(|(_, p)| ((toggled + p.time).as_fs(), format!("mp_r0_c0.front_end.spad_{}", p.spad)))
            .collect();
        let mut events = gate.hardware_events();
        gate.run(&mut events);
        let of_kind = events.report.hardware_events.iter();
        let of_kind = of_kind.filter(|e| e.kind == HardwareEventKind::PulsesCancelled);
        let seen: Vec<_> = of_kind.map(|e| (e.time_fs, e.instance.clone())).collect();
        prop_assert_eq!(events.count(HardwareEventKind::PulsesCancelled), seen.len() as u64);
        prop_assert_eq!(told, seen);
    }
}

#[test]
fn pulses_that_the_front_end_cannot_follow_are_refused_by_every_engine() {
    // One SPAD twice within clk-to-Q.
    let times = [30_000_000, 30_060_001].map(Time::from_fs);
    let pulses = times.map(|time| SpadEvent { time, spad: 3 });
    let config = SensorConfig {
        dead_time_ns: 0.06,
        ..SensorConfig::default()
    };
    let exposure = Exposure::new(&config, 100, 1);
    let engines: [&dyn Replay; 3] = [
        &Gate::new(&config, &exposure),
        &Cycle::new(&config, &exposure),
        &fast::Window::new(&config, &exposure),
    ];
    let refusal = engines[0].histogram(20, &pulses).unwrap_err();
    assert!(
        refusal.is_refusal() && refusal.to_string().contains("110.334 ps"),
        "{refusal}"
    );
    for engine in engines {
        assert_eq!(engine.histogram(20, &pulses), Err(refusal.clone()));
    }
}
