//! Testbench of the P-counter with its timing block: the sequence of Fig. 54, and the ripple to LOCAL_STOP for
//! every start value (thesis 4.5, 4.6).
//!
//! ```text
//!   CLK, STOP, RESETB, ENABLE ─► p_counter_timing ─COUNTER_CLK, COUNTER_RESET, MEMORY_RESET─► p_counter ─┬► LOCAL_STOP
//!                                      ▲                         COUNTER_INIT, MEMORY_LOAD ─►            │
//!                                      └────────────────────────────────────────────────────────────────┘
//! ```
//!
//! ENABLE changes with rising STOP edges, as in the sensor, where a flip-flop on STOP sees to it.

mod laser_cycles;
mod start_values;

use std::path::{Path, PathBuf};

use crate::chip::{
    AfterBorrow, CellLibrary, ChipTiming, Exposure, PCounter, Probe, Probes, SensorConfig, Silicon,
    Tap, p_counter, p_counter_timing,
};
use crate::engine::waveform::write_waves;
use crate::files::InputError;
use crate::kernel::{Observer, Recorder};
use crate::logic::Logic;
use crate::netlist::{CellKind, ModuleBuilder, NetId, Netlist};
use crate::report::Checks;
use crate::testbenches::Testbench;
use crate::testbenches::rig::{self, Drives, Rig, finished};
use crate::testbenches::testbench::GivenSensor;
use crate::testbenches::text::{in_a_row, number_text};
use crate::units::Time;
use crate::waves::{Entry, Layout, SignalGroup};

/// Start values of Fig. 54, and of what is loaded afterwards, where they fit.
const FIG_54: [u64; 2] = [5, 9];
/// Least CLK periods between two STOP edges of the sequence.
const STOP_PERIODS: i64 = 14;
/// CLK periods more without STOP at its end than a free-running counter needs to come round.
const HOLD_PERIODS: i64 = 76;
/// First STOP edge of the sequence, or later where CLK is slow.
const ORIGIN: Time = Time::from_ns(20);
/// Half periods of CLK before it.
const BEFORE: i64 = 12;
/// When the chip comes out of reset, or later where the chain of the reset pulse takes longer to fill.
const RESET_END: Time = Time::from_ns(2);
/// From there to the first load.
const TO_LOAD: Time = Time::from_ns(3);
/// What a load takes after STOP, at most.
const LOADED: Time = Time::from_ns(14);

pub(super) const TESTBENCH: Testbench = Testbench {
    name: "tb_p_counter",
    about: "P-counter and timing block: Fig. 54's sequence, and the ripple of every start value",
    run,
    given: Some(GivenSensor {
        blocks: &["p_counter"],
        check,
        run: run_on,
    }),
};

fn run(waves: &Path, checks: &mut Checks) -> Result<(), InputError> {
    run_on(&SensorConfig::default(), waves, checks)
}

fn check(sensor: &SensorConfig) -> Result<(), InputError> {
    if sensor.p_counter.row().has_memory {
        return Ok(());
    }
    let message = "has no reset, which tb_p_counter needs; give another sensor.p_counter, or run tb_p_counter_variants without a sensor";
    Err(InputError::new("p_counter = \"memoryless\"", message))
}

/// The P-counter of a sensor, with the built-in delays. Of any but the built-in ripple counter, static timing bounds the delays,
/// and nothing inside is checked.
fn run_on(sensor: &SensorConfig, waves: &Path, checks: &mut Checks) -> Result<(), InputError> {
    let bench = Bench::new(sensor);
    if let Some(law) = sensor.counter_law() {
        let uneven = law
            .uneven()
            .map_or("a law".to_owned(), |why| why.to_string());
        let what = "LOCAL_STOP by COUNTER_INIT";
        checks.add_verdict(what, "a law", uneven, law.uneven().is_none());
        // A shift register with feedback lacks one state.
        let (codes, silent) = (1 << sensor.counter_bits, law.silent_codes().len());
        let what = "COUNTER_INIT that raise LOCAL_STOP";
        let expected = format!("at least {} of {codes}", codes - 1);
        checks.add_verdict(what, expected, codes - silent, silent <= 1);
    }
    figure_54(&bench, waves, checks)?;
    start_values::ripple(&bench, checks);
    laser_cycles::count_alike(&bench, checks);
    Ok(())
}

/// The circuit under test and its nets.
struct Bench {
    config: SensorConfig,
    timing: ChipTiming,
    /// How much slower cells are than at 50 °C.
    factor: f64,
    rig: Rig,
    /// When the chip comes out of reset.
    reset_end: Time,
    /// The CLK fall after STOP that counts first.
    first_fall: i64,
    clk: NetId,
    stop: NetId,
    resetb: NetId,
    enable: NetId,
    init: Vec<NetId>,
    load: NetId,
    counter_reset: NetId,
    counter_clk: NetId,
    /// First STOP edge.
    origin: Time,
    /// Two start values, and CLK periods between two STOP edges that leave room for both.
    starts: [u64; 2],
    stop_periods: i64,
    /// MEMORY and COUNTER_OUT of the built-in ripple counter.
    inner: Option<[Vec<NetId>; 2]>,
    local_stop: NetId,
}

impl Bench {
    fn new(sensor: &SensorConfig) -> Self {
        let config = SensorConfig {
            liberty: PathBuf::new(),
            liberty_slow: PathBuf::new(),
            liberty_fast: PathBuf::new(),
            ..sensor.clone()
        };
        // Of greater ones the msb is high from the load on.
        let largest = match config.tap {
            Tap::Msb => (1 << (config.counter_bits - 1)) - 1,
            Tap::Borrow => u64::from(config.largest_start()),
        };
        let starts = [FIG_54[0].min(largest - 1), FIG_54[1].min(largest)];
        let last = starts
            .into_iter()
            .filter_map(|start| first_edge(&config, start))
            .max();
        let exposure = Exposure::new(&config, 1, 1);
        let before = exposure.clock.half_periods(BEFORE);
        let timing = ChipTiming::new(&config);
        let reset_end = RESET_END.max(timing.stop_to_reset_release + Time::from_ns(1));
        let loaded = (LOADED.as_s() * config.clk_hz).ceil() as i64;
        let first_fall = first_fall(&timing, &exposure);
        let is_known = config.p_counter == PCounter::Ripple
            && config.tap == Tap::Borrow
            && config.after_borrow == AfterBorrow::Hold
            && config.step_periods == 1
            && config.p_counter_block.is_none();
        let silicon = Silicon::new(&config);
        let rig = circuit(&config, &silicon);
        let probes = Probes::below_instance(&rig.netlist, "");
        let net = |probe| probes.net(probe);
        Bench {
            clk: net(Probe::Clk),
            stop: net(Probe::Stop),
            resetb: rig.net("RESETB"),
            enable: net(Probe::Enable),
            init: probes.bus(Probe::CounterInit).to_vec(),
            load: net(Probe::MemoryLoad),
            counter_reset: net(Probe::CounterReset),
            counter_clk: net(Probe::CounterClk),
            reset_end,
            first_fall,
            origin: ORIGIN.max(reset_end + Time::from_ns(2) + before),
            starts,
            stop_periods: STOP_PERIODS
                .max(last.unwrap_or(0) + 2 * first_fall + 3)
                .max(2 * first_fall + 4)
                .max(loaded),
            inner: is_known
                .then(|| [Probe::Memory, Probe::CounterOut].map(|p| probes.bus(p).to_vec())),
            local_stop: net(Probe::LocalStop),
            timing,
            factor: silicon.factor,
            config,
            rig,
        }
    }

    /// Power-up: everything low but CLK, and RESETB released.
    fn power_up(&self) -> Drives {
        let pins = [self.stop, self.resetb, self.enable, self.load];
        let mut drives = Drives::low(self.init.iter().copied().chain(pins));
        drives.set(Time::ZERO, self.clk, true);
        drives.set(self.reset_end, self.resetb, true);
        drives
    }

    /// COUNTER_INIT at `time`, a pulse of MEMORY_LOAD after it, in which COUNTER_INIT moves on; returns the pulse's rise.
    fn load(&self, drives: &mut Drives, time: Time, start: u64) -> Time {
        let code = u64::from(self.config.load_codes(&[start as u16])[0]);
        drives.number(time, &self.init, code);
        let rise = time + Time::from_ns(2);
        drives.number(rise + Time::from_ns(1), &self.init, !code);
        drives.pulse(self.load, rise, rise + Time::from_ns(2));
        rise
    }

    /// The COUNTER_CLK edge that raises LOCAL_STOP, the first one being 0.
    fn first_edge(&self, start: u64) -> Option<i64> {
        first_edge(&self.config, start)
    }

    /// Checks times from `edge` on: they are what static timing says, or, where one's own gates are quicker than that, at most.
    fn takes(
        &self,
        what: impl Into<String>,
        checks: &mut Checks,
        edge: Time,
        expected: Time,
        found: &[Time],
    ) {
        match self.inner {
            Some(_) => checks.times(what, expected, found),
            None => {
                let last = found.iter().copied().max();
                let fits = !found.is_empty() && found.iter().all(|&t| edge < t && t <= expected);
                let last = last.map_or("never".to_owned(), |last| last.to_string());
                checks.add_verdict(what, format!("at most {expected}"), last, fits);
            }
        }
    }
}

/// The CLK fall after STOP that counts first: the reset pulse is over when it comes. Usually it is fall 1; where STOP comes well before CLK
/// falls, fall 0.
fn first_fall(timing: &ChipTiming, exposure: &Exposure) -> i64 {
    let counter = &timing.counter;
    let released = timing.stop_to_reset_release + counter.release + counter.recovery;
    let ready = released.max(timing.stop_to_reset + counter.settle);
    let counts = |&k: &i64| exposure.falling(k) + timing.clk_to_counter_clk > ready;
    (0..).find(counts).expect("CLK goes on")
}

fn first_edge(config: &SensorConfig, start: u64) -> Option<i64> {
    Some(p_counter::Rises::from_start_value(config, start as u16)?.first)
}

/// P-counter and timing block, connected as in a macropixel.
fn circuit(config: &SensorConfig, silicon: &Silicon) -> Rig {
    let mut m = ModuleBuilder::new("tb_p_counter");
    for pin in ["CLK", "STOP", "RESETB", "ENABLE"] {
        m.input(pin);
    }
    m.input_bus("COUNTER_INIT", config.counter_bits);
    m.input("MEMORY_LOAD");
    m.output("LOCAL_STOP");
    for wire in ["COUNTER_CLK", "COUNTER_RESET", "MEMORY_RESET"] {
        m.wire(wire);
    }
    let timing = p_counter_timing::circuit(config.after_borrow, config.reset_buffers());
    m.instance_by_names("p_counter_timing", &timing, &[]);
    m.instance_by_names("p_counter", &p_counter::circuit(config), &[]);
    Rig::of_silicon(&finished(m), silicon)
}

/// Counts changes to X.
#[derive(Default)]
struct Unknowns(usize);

impl Observer for Unknowns {
    fn change(&mut self, _: Time, _: NetId, value: Logic) {
        self.0 += (value == Logic::X) as usize;
    }
}

/// Cycles 0 and 1 count from the first start value, cycle 2 is disabled and loads the second, cycles 3 and 4 count from it, and then
/// STOP stays away.
fn figure_54(bench: &Bench, waves: &Path, checks: &mut Checks) -> Result<(), InputError> {
    let &Bench {
        ref timing,
        origin,
        stop_periods,
        starts: [first_start, second_start],
        ..
    } = bench;
    let exposure = Exposure::new(&bench.config, stop_periods as u32, 5);
    let stop = |cycle: i64| origin + exposure.stop(cycle);
    let falling = |cycle: i64, k: i64| origin + exposure.falling(cycle * stop_periods + k);
    let round = (bench.config.step_periods as i64) << (bench.config.counter_bits + 1);
    let hold_periods = round + HOLD_PERIODS;
    let end = stop(4) + exposure.clock.periods(stop_periods + hold_periods);
    let waits = bench.config.after_borrow == AfterBorrow::Hold;

    let mut drives = bench.power_up();
    let loads = [
        (
            first_start,
            bench.load(&mut drives, bench.reset_end + TO_LOAD, first_start),
        ),
        (
            second_start,
            bench.load(&mut drives, stop(2) + Time::from_ns(8), second_start),
        ),
    ];
    for cycle in 0..5 {
        drives.pulse(bench.stop, stop(cycle), origin + exposure.stop_fall(cycle));
    }
    for (cycle, enabled) in [(0, true), (2, false), (3, true)] {
        drives.set(stop(cycle), bench.enable, enabled);
    }
    // CLK runs from the release of the reset on.
    let half_periods = 2 * (5 * stop_periods + hold_periods);
    let clk_origin = origin - exposure.stop_phase;
    drives.clock(
        bench.clk,
        exposure.clock,
        clk_origin,
        (-BEFORE, half_periods),
    );

    let rig = &bench.rig;
    let (mut kernel, mut stimulus) = (rig.kernel(), drives.sorted());
    let mut recorder = Recorder::new(rig.nets());
    let mut unknowns = Unknowns::default();
    let mut unknown_at_release = 0;
    let view = view(&rig.netlist, stop(0), stop(5));
    write_waves(waves, &rig.netlist, &view, |waves| {
        let mut observers = (&mut recorder, &mut *waves);
        rig::run(&mut kernel, &mut stimulus, bench.reset_end, &mut observers);
        let is_unknown = |&net: &NetId| kernel.value(net) == Logic::X;
        unknown_at_release = rig.nets().filter(is_unknown).count();
        let mut observers = ((&mut recorder, &mut unknowns), waves);
        rig::run(&mut kernel, &mut stimulus, end, &mut observers);
        end
    })?;

    checks.equal(
        "unknown nets when RESETB is released",
        0,
        unknown_at_release,
    );
    checks.equal("changes to X after that", 0, unknowns.0);
    let corner = bench.config.corner;
    let flop = |pin, to| {
        let cells = CellLibrary::BUILT_IN.cells();
        let delay = cells.delay(CellKind::Dffr, pin, to, corner);
        Time::from_fs((delay.as_fs() as f64 * bench.factor).round() as i64)
    };
    let clk_to_q = flop(1, Logic::One);
    for (value, rise) in loads {
        let Some([memory, counter_out]) = &bench.inner else {
            continue;
        };
        let after = rise + clk_to_q;
        let found = (
            recorder.number_at(memory, after - Time::from_fs(1)),
            recorder.number_at(memory, after),
        );
        let is_new = found.0 != found.1 && found.1 == Some(value);
        let what = format!("MEMORY, clk-to-Q after MEMORY_LOAD rises with {value}");
        checks.add_verdict(what, value, number_text(found.1), is_new);
        let what = format!("COUNTER_OUT follows it to {value} without COUNTER_CLK");
        let found = recorder.number_at(counter_out, after + timing.stop_to_reset);
        checks.equal(what, number_text(Some(value)), number_text(found));
    }
    let local_stops = recorder.rising_edges(bench.local_stop);
    let falls = recorder.falling_edges(bench.local_stop);
    let disabled = |t: &&Time| (stop(2)..stop(3)).contains(*t) || **t < stop(0);
    let while_disabled = local_stops.iter().filter(disabled).count();
    checks.equal("LOCAL_STOP rises while disabled", 0, while_disabled);
    let clocked = recorder.rising_edges(bench.counter_clk);
    let found = clocked.iter().filter(disabled).count();
    checks.equal("COUNTER_CLK rises while disabled", 0, found);

    let reset_to_q = flop(2, Logic::Zero);
    let rises = recorder.rising_edges(bench.counter_reset);
    let releases = recorder.falling_edges(bench.counter_reset);
    for (cycle, start) in [
        (0, first_start),
        (1, first_start),
        (3, second_start),
        (4, second_start),
    ] {
        let next = if cycle == 4 { end } else { stop(cycle + 1) };
        let within = |t: &&Time| (stop(cycle)..next).contains(*t);
        let relative = |t: &Time| *t - stop(cycle);
        let in_reset = stop(cycle) + timing.stop_to_reset_release - Time::from_fs(1);
        if let Some([_, counter_out]) = &bench.inner {
            let found = recorder.number_at(counter_out, in_reset);
            let what = format!("cycle {cycle}: COUNTER_OUT when COUNTER_RESET falls");
            checks.equal(what, number_text(Some(start)), number_text(found));

            // Every count is read when its ripple is over: before the next edge, the last one after the longest ripple. Where that is longer
            // than a CLK period, the roll-over is not over when one more edge comes.
            let mut model = p_counter::PCounterModel::new(&bench.config, start as u16);
            let counts = std::iter::from_fn(|| {
                (!model.local_stop()).then(|| {
                    model.clock();
                    model.counter_out()
                })
            });
            let mut expected: Vec<_> = counts.collect();
            if timing.ripple() > exposure.clock.period() {
                expected.pop();
            }
            let edges = clocked.iter().filter(within).filter(|t| **t > in_reset);
            let edges: Vec<Time> = edges.copied().collect();
            let settled = edges.iter().skip(1).map(|next| *next - Time::from_fs(1));
            let settled = settled.chain(edges.last().map(|last| *last + timing.ripple()));
            let settled = settled.take(expected.len());
            let found = settled.map(|time| recorder.number_at(counter_out, time));
            checks.equal(
                format!("cycle {cycle}: COUNTER_OUT after each rise of COUNTER_CLK"),
                in_a_row(expected),
                in_a_row(found.map(number_text)),
            );
        }
        let mut found: Vec<Time> = local_stops.iter().filter(within).map(relative).collect();
        let first = bench.first_edge(start);
        let once = usize::from(first.is_some());
        if !waits {
            found.truncate(once);
        }
        checks.equal(
            format!("cycle {cycle}: LOCAL_STOP rises"),
            once,
            found.len(),
        );
        let Some(first) = first else { continue };
        let fall = bench.first_fall + first;
        let edge = falling(cycle, fall);
        let expected = edge + timing.ripple() - stop(cycle);
        let what = format!("cycle {cycle}: LOCAL_STOP rises after STOP, by CLK fall {fall}");
        bench.takes(what, checks, edge - stop(cycle), expected, &found);
        if cycle != 4 && waits {
            let expected = next + timing.stop_to_reset + reset_to_q;
            let after_rise = |t: &&Time| **t > edge;
            let found = falls.iter().find(after_rise).copied().unwrap_or(Time::ZERO);
            let what = format!("cycle {cycle}: LOCAL_STOP falls after the next STOP");
            match bench.inner {
                Some(_) => checks.time(what, expected - next, found - next),
                None => bench.takes(
                    what,
                    checks,
                    Time::ZERO,
                    timing.stop_to_reset_release,
                    &[found - next],
                ),
            }
        }
        let found: Vec<Time> = releases
            .iter()
            .filter(within)
            .take(1)
            .map(relative)
            .collect();
        let what = format!("cycle {cycle}: COUNTER_RESET falls after STOP");
        checks.times(what, timing.stop_to_reset_release, &found);
        // Before cycles 0 and 3 the reset is held from the disabled time on.
        if cycle == 1 || cycle == 4 {
            let found: Vec<Time> = rises.iter().filter(within).map(relative).collect();
            let what = format!("cycle {cycle}: COUNTER_RESET rises after STOP");
            checks.times(what, timing.stop_to_reset, &found);
        }
    }
    if !waits {
        return Ok(());
    }
    let last_rise = local_stops.last().copied().unwrap_or(end);
    let held = recorder.value_at(bench.local_stop, end) == Logic::One;
    let clocked_since = clocked.iter().filter(|&&t| t > last_rise).count();
    let fallen_since = falls.iter().filter(|&&t| t > last_rise).count();
    let quiet = recorder.falling_edges(bench.clk);
    let quiet = quiet.iter().filter(|&&t| t > last_rise).count();
    checks.add_verdict(
        "CLK periods without STOP for which LOCAL_STOP stays high",
        format!("at least {hold_periods}"),
        quiet,
        held && fallen_since == 0 && quiet as i64 >= hold_periods,
    );
    checks.equal("COUNTER_CLK rises in that time", 0, clocked_since);
    Ok(())
}

fn view(netlist: &Netlist, first_stop: Time, last: Time) -> Layout {
    let binary = |probe: Probe| Entry::binary(probe.path(""));
    let decimal = |probe: Probe| Entry::decimal(probe.path(""));
    let inputs = [
        Entry::binary("RESETB"),
        binary(Probe::Enable),
        binary(Probe::Clk),
        binary(Probe::Stop),
        decimal(Probe::CounterInit),
        binary(Probe::MemoryLoad),
    ];
    let counter = [
        decimal(Probe::Memory),
        binary(Probe::CounterReset),
        binary(Probe::CounterClk),
        decimal(Probe::CounterOut),
        binary(Probe::LocalStop),
    ];
    let is_there = |entry: &Entry| netlist.signal(&entry.path).is_some();
    let groups = vec![
        SignalGroup::new("Global signals", inputs),
        SignalGroup::new("P-counter (Fig. 54)", counter.into_iter().filter(is_there)),
    ];
    Layout::new(groups, (Time::ZERO, last), first_stop)
}
