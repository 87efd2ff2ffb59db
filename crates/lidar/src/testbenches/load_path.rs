//! Testbench of the load path: deserialiser, row scanner and the memories behind them (thesis 4.7, Fig. 57).
//!
//! ```text
//!   RESETB, LOAD_ENABLE, LOAD_CLK ─► deserialiser ─COUNTER_INIT_ROW─► memory_r{row}_c{col}
//!   COUNTER_INITS ─────────────────►     └─ROW_DONE─► row_scanner ─MEMORY_LOAD<row>─┘
//! ```
//!
//! A small array is loaded four times in one power-up, the third time only in part; then a whole sensor once.

use std::path::Path;

use crate::chip::{CellLibrary, LoadPins, LoadProbe, Probe, SensorConfig, load_path, probes};
use crate::engine::load::{load, load_netlist};
use crate::engine::waveform::write_waves;
use crate::files::InputError;
use crate::kernel::{Kernel, Recorder};
use crate::logic::Logic::{One, X, Zero};
use crate::netlist::{CellKind, NetId};
use crate::report::Checks;
use crate::testbenches::Testbench;
use crate::testbenches::rig::{self, Drives, Rig};
use crate::testbenches::text::in_a_row;
use crate::units::{Frequency, Time};
use crate::waves::{Entry, Layout, SignalGroup};
use bitvec::slice::BitSlice;

/// When the chip comes out of reset.
const RESET_END: Time = Time::from_ns(2);
/// Falling LOAD_CLK edge before the first bit of the first load.
const FIRST_LOAD: Time = Time::from_ns(10);
/// Quiet time between two loads.
const PAUSE: Time = Time::from_ns(50);

pub(super) const TESTBENCH: Testbench = Testbench {
    name: "tb_load_path",
    about: "Load path: every start value arrives, MEMORY_LOAD row by row, load time",
    run,
    given: None,
};

fn run(waves: &Path, checks: &mut Checks) -> Result<(), InputError> {
    small_array(waves, checks)?;
    whole_sensor(checks);
    Ok(())
}

/// Start values without a pattern, different for every `seed`.
fn start_values(config: &SensorConfig, seed: u32) -> Vec<u16> {
    let value = |i: u32| i.wrapping_add(seed).wrapping_mul(2_654_435_761) >> 7;
    let pixels = 0..config.pixels() as u32;
    pixels
        .map(|i| value(i) as u16 & config.largest_start())
        .collect()
}

/// The load path under test, and its pins.
struct Bench {
    config: SensorConfig,
    rig: Rig,
    pins: LoadPins,
    row_bits: Vec<NetId>,
    memory_load: Vec<NetId>,
}

impl Bench {
    fn new(config: SensorConfig) -> Self {
        let rig = Rig::of_netlist(load_netlist(&config), config.corner);
        Bench {
            pins: LoadPins::find(&rig.netlist),
            row_bits: LoadProbe::Row.bus(&rig.netlist),
            memory_load: LoadProbe::MemoryLoad.bus(&rig.netlist),
            config,
            rig,
        }
    }

    fn clock(&self) -> Frequency {
        self.config.load_clock()
    }

    /// Sends `bits` from `start` on, changing them with falling LOAD_CLK edges; LOAD_ENABLE falls half a period
    /// after the last LOAD_CLK pulse. Returns that time.
    fn send(&self, drives: &mut Drives, start: Time, bits: &BitSlice) -> Time {
        let clock = self.clock();
        let half = |k: usize| start + clock.half_periods(k as i64);
        for (k, bit) in bits.iter().enumerate() {
            drives.set(half(2 * k), self.pins.serial, *bit);
            drives.pulse(self.pins.clk, half(2 * k + 1), half(2 * k + 2));
        }
        let end = half(2 * bits.len() + 1);
        drives.pulse(self.pins.enable, start - RESET_END, end);
        end
    }

    /// Start values in the memories now; `None` where a bit is unknown.
    fn memories(&self, kernel: &Kernel) -> Vec<Option<u64>> {
        let memories = probes::memories(&self.rig.netlist, self.config.rows, self.config.cols);
        memories.iter().map(|nets| kernel.number(nets)).collect()
    }
}

/// One pulse of MEMORY_LOAD.
#[derive(Clone, Copy)]
struct Pulse {
    row: usize,
    rise: Time,
    fall: Time,
}

fn pulses(recorder: &Recorder, memory_load: &[NetId]) -> Vec<Pulse> {
    let of_row = |(row, &net): (usize, &NetId)| {
        let rises = recorder.rising_edges(net).into_iter();
        // Low since the reset, so that every rise has its fall after it.
        let falls = recorder
            .falling_edges(net)
            .into_iter()
            .filter(|&t| t > RESET_END);
        rises
            .zip(falls)
            .map(move |(rise, fall)| Pulse { row, rise, fall })
    };
    let mut all: Vec<Pulse> = memory_load.iter().enumerate().flat_map(of_row).collect();
    all.sort_by_key(|pulse| pulse.rise);
    all
}

fn small_array(waves: &Path, checks: &mut Checks) -> Result<(), InputError> {
    let config = SensorConfig {
        rows: 4,
        cols: 3,
        ..SensorConfig::default()
    };
    let bits_per_row = config.cols * config.counter_bits;
    let bench = Bench::new(config.clone());
    let pins = &bench.pins;
    let mut drives = Drives::low([pins.resetb, pins.enable, pins.clk, pins.serial]);
    drives.set(RESET_END, pins.resetb, true);
    let stream = |codes: &[u16]| load_path::stream(codes, config.cols, config.counter_bits);
    let values: Vec<Vec<u16>> = (1..=4)
        .map(|seed| start_values(&config, 1000 * seed))
        .collect();

    // (what, start values in the memories afterwards, rows written)
    let cut = bits_per_row + bits_per_row / 3;
    let mut partly = values[1].clone();
    partly[..config.cols].copy_from_slice(&values[2][..config.cols]);
    let loads = [
        ("first load", values[0].clone(), config.rows),
        (
            "second load, no reset between",
            values[1].clone(),
            config.rows,
        ),
        ("load cut off in row 1", partly, 1),
        ("full load after it", values[3].clone(), config.rows),
    ];
    let mut spans = Vec::new();
    let mut start = FIRST_LOAD;
    for (codes, length) in values.iter().zip([None, None, Some(cut), None]) {
        let stream = stream(codes);
        let end = bench.send(
            &mut drives,
            start,
            &stream[..length.unwrap_or(stream.len())],
        );
        spans.push((start, end));
        start = end + PAUSE;
    }

    let (mut kernel, mut stimulus) = (bench.rig.kernel(), drives.sorted());
    let mut recorder = Recorder::new(bench.rig.nets());
    let mut found = Vec::new();
    let view = view(&config, spans[0]);
    write_waves(waves, &bench.rig.netlist, &view, |waves| {
        let mut observers = (&mut recorder, waves);
        for &(_, end) in &spans {
            let end = end + bench.clock().periods(2);
            rig::run(&mut kernel, &mut stimulus, end, &mut observers);
            found.push(bench.memories(&kernel));
        }
        kernel.now()
    })?;

    let unknown = |c: &&(Time, NetId, _)| c.0 > RESET_END && c.2 == X;
    let unknown = recorder.changes().iter().filter(unknown).count();
    checks.equal("changes to X after RESETB is released", 0, unknown);
    let all = pulses(&recorder, &bench.memory_load);
    for (((what, codes, rows), found), &(start, end)) in loads.iter().zip(&found).zip(&spans) {
        let arrived = codes
            .iter()
            .zip(found)
            .filter(|(a, b)| Some(**a as u64) == **b);
        checks.equal(
            format!("{what}: start values right"),
            codes.len(),
            arrived.count(),
        );
        let within = all
            .iter()
            .filter(|p| (start..end + PAUSE).contains(&p.rise));
        checks.equal(
            format!("{what}: MEMORY_LOAD pulses, by row"),
            in_a_row(0..*rows),
            in_a_row(within.map(|pulse| pulse.row)),
        );
    }
    let changes = |net: &NetId, to| {
        let changes = recorder.changes().iter();
        changes
            .filter(|c| c.0 > RESET_END && c.1 == *net && c.2 == to)
            .count()
    };
    for (what, to) in [("rises", One), ("falls", Zero)] {
        let found: usize = bench.memory_load.iter().map(|net| changes(net, to)).sum();
        let expected: usize = loads.iter().map(|(_, _, rows)| rows).sum();
        checks.equal(format!("MEMORY_LOAD {what}, all loads"), expected, found);
    }
    let overlaps = all.windows(2).filter(|p| p[1].rise <= p[0].fall).count();
    checks.equal("MEMORY_LOAD pulses that overlap another", 0, overlaps);
    timing(&bench, &recorder, &all, checks);
    duration(&config, &recorder, &bench, spans[0], "4 x 3", checks);
    Ok(())
}

/// Widths of MEMORY_LOAD and its distances to COUNTER_INIT_ROW, against the delays of the cells on their paths.
fn timing(bench: &Bench, recorder: &Recorder, all: &[Pulse], checks: &mut Checks) {
    let library = CellLibrary::BUILT_IN.cells();
    let delay = |kind, to| library.delay(kind, 0, to, bench.config.corner);
    let clock_to_q = library.delay(CellKind::Dffr, 1, One, bench.config.corner);
    let half = bench.clock().half_periods(1);
    let rise = delay(CellKind::Or2, Zero) + delay(CellKind::Nor2, One) + delay(CellKind::And2, One);
    let fall =
        delay(CellKind::Or2, One) + delay(CellKind::Nor2, Zero) + delay(CellKind::And2, Zero);
    // The last pulse of a load is ended by LOAD_ENABLE, all others by LOAD_CLK.
    let cut =
        delay(CellKind::Nand2, One) + delay(CellKind::Nor2, Zero) + delay(CellKind::And2, Zero);
    let last_row = bench.config.rows - 1;
    let widths = |is_last: bool| {
        let pulses = all.iter().filter(move |p| (p.row == last_row) == is_last);
        pulses.map(|p| p.fall - p.rise).collect::<Vec<Time>>()
    };
    checks.times(
        "MEMORY_LOAD width, ended by LOAD_CLK",
        half + fall - rise,
        &widths(false),
    );
    checks.times(
        "MEMORY_LOAD width, ended by LOAD_ENABLE",
        half + cut - rise,
        &widths(true),
    );

    let row_changes: Vec<Time> = recorder
        .changes()
        .iter()
        .filter(|(_, net, _)| bench.row_bits.contains(net))
        .map(|(time, _, _)| *time)
        .collect();
    let mut setup = Vec::new();
    let mut hold = Vec::new();
    for pulse in all {
        let next = row_changes.partition_point(|&t| t <= pulse.rise);
        setup.extend(next.checked_sub(1).map(|i| pulse.rise - row_changes[i]));
        // Bits that stay the same make later edges the first that change anything.
        hold.extend(row_changes.get(next).map(|&t| t - pulse.rise));
    }
    let mut closest = |what, expected: Time, found: Vec<Time>| {
        let found = found.into_iter().min().unwrap_or(Time::ZERO);
        checks.time(what, expected, found);
    };
    closest(
        "COUNTER_INIT_ROW stable before MEMORY_LOAD rises",
        half + rise - clock_to_q,
        setup,
    );
    let reset_to_q = library.delay(CellKind::Dffr, 2, Zero, bench.config.corner);
    let cleared = delay(CellKind::Nand2, One) + reset_to_q;
    let expected = half + clock_to_q.min(cleared) - rise;
    closest(
        "COUNTER_INIT_ROW stable after MEMORY_LOAD rises",
        expected,
        hold,
    );
}

/// Bits and time of the first load.
fn duration(
    config: &SensorConfig,
    recorder: &Recorder,
    bench: &Bench,
    (start, end): (Time, Time),
    what: &str,
    checks: &mut Checks,
) {
    let within = |t: &Time| (start..=end).contains(t);
    let mut rises = recorder.rising_edges(bench.pins.clk);
    rises.retain(within);
    checks.equal(
        format!("{what}: LOAD_CLK rises in a load"),
        config.load_bits(),
        rises.len(),
    );
    let disabled = recorder
        .falling_edges(bench.pins.enable)
        .into_iter()
        .find(|t| *t > start);
    let first = rises.first().copied().unwrap_or(Time::ZERO);
    let found = disabled.unwrap_or(Time::ZERO) - first;
    let clock = config.load_clock();
    let periods = config.rows * config.cols * config.counter_bits;
    checks.time(
        format!("{what}: load time, rows x cols x bits = {periods} LOAD_CLK periods"),
        clock.periods(periods as i64),
        found,
    );
}

/// The whole sensor, through the same netlist that a frame is loaded through.
fn whole_sensor(checks: &mut Checks) {
    let bench = Bench::new(SensorConfig::default());
    let config = &bench.config;
    let starts = start_values(config, 0);
    let mut recorder = Recorder::new([bench.pins.clk, bench.pins.enable]);
    let found = load(config, &bench.rig.netlist, &starts, &mut recorder);
    let right = found
        .starts
        .iter()
        .zip(&starts)
        .filter(|(a, b)| **a == Some(**b));
    let what = format!("{} x {}", config.rows, config.cols);
    checks.equal(
        format!("{what}: start values right"),
        starts.len(),
        right.count(),
    );
    let all = (Time::ZERO, Time::MAX);
    duration(config, &recorder, &bench, all, &what, checks);
    let (bits, us) = (config.load_bits(), found.duration.as_s() * 1e6);
    checks.add_verdict(
        format!(
            "{what}: kbit, and time at {} MHz (4.7)",
            config.load_clk_hz / 1e6
        ),
        "36.9 kbit, a few hundred us",
        format!("{:.1} kbit, {us:.1} us", bits as f64 / 1e3),
        (bits as f64 / 1e3 - 36.9).abs() < 0.05 && (100.0..1000.0).contains(&us),
    );
}

/// The first load: Fig. 57's signals, then every row with its macropixels' memories.
fn view(config: &SensorConfig, (start, end): (Time, Time)) -> Layout {
    let shared = [
        Entry::binary("RESETB"),
        Entry::binary(LoadProbe::Enable.path()),
        Entry::binary(LoadProbe::Clk.path()),
        Entry::binary(LoadProbe::Serial.path()),
        Entry::hex(LoadProbe::Row.path()),
        Entry::binary(LoadProbe::RowDone.path()),
    ];
    let mut groups = vec![SignalGroup::new("Load path (Fig. 57)", shared)];
    for row in 0..config.rows {
        let load = Probe::MemoryLoad.path(&load_path::memory_name(row, 0));
        let memories = (0..config.cols).map(|col| {
            let memory = Entry::decimal(probes::memory_path(row, col));
            memory.named(format!("MEMORY of column {col}"))
        });
        groups.push(SignalGroup::new(
            format!("Row {row}, columns 0 to {}", config.cols - 1),
            [Entry::binary(load)].into_iter().chain(memories),
        ));
    }
    Layout::new(groups, (Time::ZERO, end + PAUSE), start)
}
