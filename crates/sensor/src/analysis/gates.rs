//! The event kernel's answers to the questions of static timing.

use std::sync::Arc;

use crate::chip::p_counter::Rises;
use crate::chip::{Exposure, Limits, Probe, Sensor, SensorConfig, Silicon, WindowLaw, array};
use crate::engine::GateSimulation;
use crate::kernel::{Policy, Recorder, TimingChecks};
use crate::netlist::{Netlist, Timing};
use crate::photon::SpadEvent;
use crate::units::{Frequency, Time};

/// A clock at which every delay is short.
const SLOW_HZ: f64 = 20e6;
/// When a load is sure to be out of its power-up reset.
pub(super) const RESET_RELEASED: Time = Time::from_ns(4);

/// A macropixel of this silicon, ready to run.
pub(super) fn simulation(
    config: &SensorConfig,
    silicon: &Silicon,
    exposure: &Exposure,
    start: u16,
    pulses: &[SpadEvent],
) -> GateSimulation {
    let sensor = Sensor::from(config).made_of(silicon);
    GateSimulation::new(sensor, exposure, (0, 0), (1, 1), &[start], &[pulses])
}

/// Timing checks with this silicon's limits, SPAD samplers excepted.
pub(super) fn checks(silicon: &Silicon, gate: &GateSimulation) -> TimingChecks {
    let library = silicon.limits(Limits::Kept);
    let samplers = gate.samplers();
    TimingChecks::new(gate.netlist(), &library, silicon.corner)
        .policy(Policy::ReportOnly)
        .not_before(gate.schedule().reset_end)
        .asynchronous(gate.netlist(), |cell| samplers.contains(cell))
}

/// The start value with the latest LOCAL_STOP, or one in the middle of a laser cycle where the window of that is not whole.
fn slowest_start(config: &SensorConfig, silicon: &Silicon) -> u16 {
    let sensor = Sensor::from(config).made_of(silicon);
    let middle = (config.largest_start() / 2).min(2 * config.bins as u16);
    sensor.local_stop_delays().latest().0.max(middle)
}

/// Whether a gate-level macropixel counts a pattern of photons into the bins of a slow clock, or as many bins later, and,
/// if limits are to be kept, breaks none: at a CLK period and a STOP phase.
pub fn gate_works(
    config: &SensorConfig,
    silicon: &Silicon,
    limits: Limits,
    moved: i64,
) -> impl Fn((Time, Time)) -> bool + use<> {
    // The netlist and its delays are those of all clocks.
    let array = array::subarray(config, (0, 0), (1, 1));
    let netlist = Arc::new(Netlist::elaborate(&array));
    let timing = silicon.timing(&netlist);
    let start = slowest_start(config, silicon);
    let (config, silicon) = (config.clone(), *silicon);
    move |at| {
        let built = (netlist.clone(), timing.clone());
        counts_pattern(built, &config, &silicon, limits, (at, start), moved)
    }
}

fn counts_pattern(
    built: (Arc<Netlist>, Timing),
    config: &SensorConfig,
    silicon: &Silicon,
    limits: Limits,
    ((period, phase), start): ((Time, Time), u16),
    moved: i64,
) -> bool {
    let Ok(clock) = Frequency::from_period(period) else {
        return false;
    };
    let every = Rises::from_start_value(config, start).and_then(|rises| rises.every);
    let exposure = Exposure {
        clock,
        stop_phase: phase,
        stop_periods: match (config.p_counter.row().has_memory, every) {
            (false, Some(every)) => every as u32,
            _ => u32::from(start) * config.step_periods as u32 + 12,
        },
        laser_cycles: 1,
    };
    let slow = Exposure {
        clock: Frequency::from_hz_f64(SLOW_HZ).expect("a frequency"),
        stop_phase: Time::ZERO,
        ..exposure
    };
    // A counter of few bits that wraps has no window at any clock.
    let Some(window) = WindowLaw::new(config, &slow).window(start).open() else {
        return false;
    };
    let mut config = config.clone();
    config.clk_hz = clock.as_hz();
    // A pattern that no shift maps to itself.
    let has_photon = |bin: i64| [0, 1, 3, 4, 8, 13, 15].contains(&(bin % 16));
    let mut pulses = Vec::new();
    let mut expected = vec![0; config.bins];
    for bin in 0..config.bins as i64 {
        let edge = window.first_edge + moved + bin;
        if has_photon(bin) && edge > 1 {
            expected[bin as usize] = 1;
            let together = config.spads_of_an_event() as i64;
            pulses.extend((0..together).map(|of_event| SpadEvent {
                time: exposure.rising(edge) - Time::from_fs(period.as_fs() / 2),
                // One SPAD after the other: dead time plays a part only where there are few.
                spad: ((bin * together + of_event) % config.spads() as i64) as u8,
            }));
        }
    }
    pulses.sort_unstable();
    let sensor = Sensor::from(config).made_of(silicon);
    let place = ((0, 0), (1, 1));
    let mut gate =
        GateSimulation::of_netlist(built, sensor, &exposure, place, &[start], &[&pulses]);
    let violated = match limits {
        Limits::Ignored => {
            gate.run(&mut ());
            0
        }
        Limits::Kept => {
            let mut checks = checks(silicon, &gate);
            gate.run(&mut checks);
            checks.report(gate.netlist()).violated()
        }
    };
    let counted = gate.histograms();
    violated == 0 && counted.is_ok_and(|found| found[0] == expected)
}

/// COUNTER_CLK rises → LOCAL_STOP rises for the P-counter of macropixel (0, 0).
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct RippleTiming {
    /// The longest path, whatever values are.
    pub longest_path: Time,
    /// The latest of all start values, as simulated.
    pub latest: Time,
    /// The start value that is the latest.
    pub start: u16,
}

/// The ripple of macropixel (0, 0), by paths and by events.
pub fn ripple(config: &SensorConfig, silicon: &Silicon) -> RippleTiming {
    let sensor = Sensor::from(config).made_of(silicon);
    let delays = sensor.local_stop_delays();
    let (start, latest) = delays.latest();
    RippleTiming {
        longest_path: delays.bounds().1,
        latest,
        start,
    }
}

/// What a simulated reset pulse is, and what it meets.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct ResetTiming {
    /// Width of COUNTER_RESET.
    pub width: Time,
    /// COUNTER_RESET rises → the last rise of a stage output, which clocks the next stage, from a counter that
    /// was interrupted on its way down.
    pub to_stage_clock: Time,
    /// COUNTER_RESET rises → COUNTER_CLK rises, let through by LOCAL_STOP's fall.
    pub to_counter_clk: Time,
}

/// Simulates the reset of the second laser cycle, of an interrupted count and after LOCAL_STOP.
pub fn reset(config: &SensorConfig, silicon: &Silicon) -> ResetTiming {
    const PERIODS: u32 = 40;
    // All ones on the way down: interrupted, about every second stage has to rise again.
    let interrupted = after_reset(config, silicon, config.largest_start(), PERIODS);
    let stopped = after_reset(config, silicon, 1, PERIODS);
    ResetTiming {
        to_counter_clk: stopped.to_counter_clk,
        ..interrupted
    }
}

fn after_reset(config: &SensorConfig, silicon: &Silicon, start: u16, periods: u32) -> ResetTiming {
    let mut config = config.clone();
    config.stop_phase_ps = 0.0;
    let exposure = Exposure::new(&config, periods, 2);
    let mut gate = simulation(&config, silicon, &exposure, start, &[]);
    let probes = &gate.probes()[0];
    let (reset, clk) = (
        probes.net(Probe::CounterReset),
        probes.net(Probe::CounterClk),
    );
    let stages = probes.find(Probe::CounterOut).unwrap_or_default().to_vec();
    let mut recorder = Recorder::new(stages.iter().copied().chain([reset, clk]));
    let stop = gate.schedule().origin + exposure.stop(1);
    gate.run(&mut recorder);
    let first_after =
        |times: Vec<Time>, from: Time| times.into_iter().find(|t| *t >= from).unwrap_or(Time::MAX);
    let rise = first_after(recorder.rising_edges(reset), stop);
    let fall = first_after(recorder.falling_edges(reset), rise);
    let within = |t: &Time| (rise..fall).contains(t);
    let stage_rises = stages.iter().flat_map(|&net| recorder.rising_edges(net));
    let last_rise = stage_rises.filter(within).max();
    ResetTiming {
        width: fall - rise,
        to_stage_clock: last_rise.map_or(Time::ZERO, |t| t - rise),
        to_counter_clk: first_after(recorder.rising_edges(clk), rise) - rise,
    }
}
