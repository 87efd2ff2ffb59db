//! Every variant of the P-counter on the same pins, in one waveform: how each counts, and when its LOCAL_STOP comes.

use std::path::Path;

use crate::chip::{
    CellLibrary, ChipTiming, Exposure, PCounter, Probe, Probes, SensorConfig, p_counter,
};
use crate::engine::waveform::write_waves;
use crate::files::InputError;
use crate::kernel::{Drive, Kernel, Recorder, Stimulus, clock};
use crate::netlist::{ModuleBuilder, NetId, Netlist, Timing};
use crate::report::Checks;
use crate::units::Time;
use crate::waves::{Entry, Layout, SignalGroup};

use super::circuit::{ORIGIN, RESET_END, finished, place_counter};
use super::text::{listed, numbers};

const START: u16 = 5;
/// Bits of the counters, and CLK periods of a laser cycle, after which the counter without memory comes round.
const BITS: usize = 4;
const STOP_PERIODS: u32 = 1 << BITS;
const CYCLES: u32 = 3;
const PINS: [&str; 5] = ["CLK", "STOP", "RESETB", "ENABLE", "MEMORY_LOAD"];

fn config(p_counter: PCounter) -> SensorConfig {
    SensorConfig {
        counter_bits: BITS,
        ..p_counter.sensor()
    }
}

fn circuit() -> Netlist {
    let mut top = ModuleBuilder::new("tb_p_counters");
    for pin in PINS {
        top.input(pin);
    }
    top.input_bus("COUNTER_INIT", BITS);
    for p_counter in PCounter::ALL {
        let mut m = ModuleBuilder::new(p_counter.name());
        for pin in PINS {
            m.input(pin);
        }
        place_counter(&mut m, &config(p_counter));
        top.instance_by_names(p_counter.name(), &finished(m), &[]);
    }
    Netlist::elaborate(&finished(top))
}

/// Loads [`START`] and counts through the laser cycles; leaves the waveform `tb_p_counters` beside `waves`.
pub(super) fn run(waves: &Path, checks: &mut Checks) -> Result<(), InputError> {
    let netlist = circuit();
    let exposure = Exposure::new(&config(PCounter::ALL[0]), STOP_PERIODS, CYCLES);
    let fall = |period: i64| ORIGIN + exposure.falling(period);
    let end = fall(exposure.stop_periods as i64 * i64::from(CYCLES));
    let mut recorder = Recorder::new((0..netlist.net_count()).map(NetId::new));
    let corner = SensorConfig::default().corner;
    let timing = Timing::nominal(&netlist, CellLibrary::BUILT_IN.cells(), corner);
    let mut kernel = Kernel::new(&netlist, &timing);
    let file = waves
        .with_file_name("tb_p_counters")
        .with_extension(waves.extension().unwrap_or_default());
    write_waves(&file, &netlist, &view(&netlist, end), |waves| {
        let mut drives = Stimulus::sorted(drives(&netlist, &exposure));
        kernel
            .run(&mut drives, end, &mut (&mut recorder, waves))
            .expect("no loop of cells without delay");
        end
    })?;

    for p_counter in PCounter::ALL {
        let (name, config) = (p_counter.name(), config(p_counter));
        let probes = Probes::below_instance(&netlist, name);
        let is_reset = p_counter.row().has_memory;
        let first = i64::from(START) + i64::from(is_reset);
        let edges = (first..).step_by(STOP_PERIODS as usize);
        let ripple = ChipTiming::new(&config).ripple();
        let expected: Vec<Time> = edges
            .take(CYCLES as usize)
            .map(|edge| fall(edge) + ripple)
            .collect();
        let rises = recorder.rising_edges(probes.net(Probe::LocalStop));
        let found: Vec<Time> = rises.into_iter().filter(|&t| t > fall(0)).collect();
        checks.equal(
            format!("{name}, start {START}: LOCAL_STOP rises (ns)"),
            listed(&expected),
            listed(&found),
        );

        let mut model = p_counter::PCounterModel::new(&config, START);
        let mut counted = |period: i64| {
            match period {
                0 if is_reset => model.reset(),
                _ => model.clock(),
            };
            model.counter_out() as usize
        };
        let expected: Vec<usize> = (0..STOP_PERIODS.into()).map(&mut counted).collect();
        let out = probes.bus(Probe::CounterOut);
        let shown = |period: i64| recorder.number_at(out, fall(period + 1) - Time::from_fs(1));
        let found = (0..STOP_PERIODS.into()).map(shown);
        let found: Vec<usize> = found
            .map(|n| n.map_or(usize::MAX, |n| n as usize))
            .collect();
        checks.equal(
            format!("{name}, start {START}: COUNTER_OUT in each CLK period of a laser cycle"),
            numbers(&expected),
            numbers(&found),
        );
        if p_counter == PCounter::Gray {
            let bits = found.windows(2).map(|two| (two[0] ^ two[1]).count_ones());
            checks.equal(
                format!("{name}: most bits of COUNTER_OUT that change in a CLK period"),
                1,
                bits.max().unwrap_or(0),
            );
        }
    }
    Ok(())
}

fn drives(netlist: &Netlist, exposure: &Exposure) -> Vec<Drive> {
    let pin = |name| netlist.net(name).expect("a pin of the testbench");
    let mut drives: Vec<Drive> = netlist
        .inputs()
        .into_iter()
        .map(|net| Drive::new(Time::ZERO, net, false))
        .collect();
    let mut drive = |time, name, value: bool| drives.push(Drive::new(time, pin(name), value));
    drive(Time::ZERO, "CLK", true);
    drive(RESET_END, "RESETB", true);
    let load = ORIGIN - Time::from_ns(15);
    drive(load, "MEMORY_LOAD", true);
    drive(load + Time::from_ns(2), "MEMORY_LOAD", false);
    drive(ORIGIN, "ENABLE", true);
    for cycle in 0..i64::from(CYCLES) {
        drive(ORIGIN + exposure.stop(cycle), "STOP", true);
        drive(ORIGIN + exposure.stop_fall(cycle), "STOP", false);
    }
    let init = netlist.signal("COUNTER_INIT");
    let init = init
        .expect("a bus of the testbench")
        .into_iter()
        .enumerate();
    drives.extend(init.map(|(bit, net)| {
        let value = START >> bit & 1 == 1;
        Drive::new(load - Time::from_ns(2), net, value)
    }));
    let half_periods = 2 * i64::from(STOP_PERIODS * CYCLES);
    drives.extend(clock(pin("CLK"), exposure.clock, ORIGIN, -12, half_periods));
    drives
}

fn view(netlist: &Netlist, end: Time) -> Layout {
    let shared = ["CLK", "STOP", "ENABLE"].map(Entry::binary);
    let mut groups = vec![SignalGroup::new("Global signals", shared)];
    for p_counter in PCounter::ALL {
        let probes = Probes::below_instance(netlist, p_counter.name());
        let own = p_counter.row().nets.iter();
        let own = own.map(|net| Entry::binary(format!("{}.{net}", probes.p_counter())));
        let shown = [
            Probe::CounterReset,
            Probe::CounterClk,
            Probe::Memory,
            Probe::CounterOut,
            Probe::LocalStop,
        ];
        let shown = shown
            .into_iter()
            .filter(|&probe| probes.find(probe).is_some());
        let shown = shown.map(|probe| match probe {
            Probe::Memory | Probe::CounterOut => Entry::decimal(probes.path(probe)),
            _ => Entry::binary(probes.path(probe)),
        });
        let name = format!("P-counter {}", p_counter.name());
        groups.push(SignalGroup::new(name, shown.chain(own)));
    }
    Layout {
        groups,
        zoom: (ORIGIN - Time::from_ns(10), end),
        marker: Some(ORIGIN),
        marks: Vec::new(),
    }
}
