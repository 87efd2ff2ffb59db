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

mod figure_54;
mod laser_cycles;
mod start_values;

use std::path::{Path, PathBuf};

use crate::chip::{
    AfterBorrow, ChipTiming, Exposure, PCounter, Probe, Probes, SensorConfig, Silicon, Tap,
    p_counter, p_counter_timing,
};
use crate::files::InputError;
use crate::netlist::{ModuleBuilder, NetId};
use crate::report::Checks;
use crate::testbenches::Testbench;
use crate::testbenches::rig::{Drives, Rig, finished};
use crate::testbenches::testbench::GivenSensor;
use crate::units::Time;

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
    figure_54::run_sequence(&bench, waves, checks)?;
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

    /// Half periods `first` to `end` of CLK, which falls before STOP rises by the exposure's phase.
    fn drive_clk(&self, drives: &mut Drives, exposure: &Exposure, (first, end): (i64, i64)) {
        let origin = self.origin - exposure.stop_phase;
        drives.clock(self.clk, exposure.clock, origin, (first, end));
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
