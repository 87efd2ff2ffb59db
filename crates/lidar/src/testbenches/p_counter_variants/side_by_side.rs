//! Every variant of the P-counter on the same pins, in one waveform: how each counts, and when its LOCAL_STOP comes.

use std::path::Path;

use crate::chip::{ChipTiming, Exposure, PCounter, Probe, Probes, SensorConfig, p_counter};
use crate::files::InputError;
use crate::kernel::Recorder;
use crate::netlist::{ModuleBuilder, Netlist};
use crate::report::Checks;
use crate::testbenches::rig::{Drives, Rig, beside, finished};
use crate::testbenches::text::{in_a_row, listed};
use crate::units::Time;
use crate::waves::{Entry, Layout, SignalGroup};

use super::circuit::{ORIGIN, RESET_END, place_counter};

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

fn circuit() -> Rig {
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
    Rig::new(&finished(top), SensorConfig::default().corner)
}

/// Loads [`START`] and counts through the laser cycles; leaves the waveform `tb_p_counters` beside `waves`.
pub(super) fn run(waves: &Path, checks: &mut Checks) -> Result<(), InputError> {
    let rig = circuit();
    let exposure = Exposure::new(&config(PCounter::ALL[0]), STOP_PERIODS, CYCLES);
    let fall = |period: i64| ORIGIN + exposure.falling(period);
    let end = fall(exposure.stop_periods as i64 * i64::from(CYCLES));
    let mut recorder = Recorder::new(rig.nets());
    let file = beside(waves, "tb_p_counters");
    let drives = drives(&rig, &exposure);
    rig.record(&file, &view(&rig.netlist, end), drives, end, &mut recorder)?;

    for p_counter in PCounter::ALL {
        let (name, config) = (p_counter.name(), config(p_counter));
        let probes = Probes::below_instance(&rig.netlist, name);
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
            in_a_row(&expected),
            in_a_row(&found),
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

fn drives(rig: &Rig, exposure: &Exposure) -> Drives {
    let mut drives = rig.power_up();
    drives.set(Time::ZERO, rig.net("CLK"), true);
    drives.set(RESET_END, rig.net("RESETB"), true);
    let load = ORIGIN - Time::from_ns(15);
    drives.pulse(rig.net("MEMORY_LOAD"), load, load + Time::from_ns(2));
    drives.set(ORIGIN, rig.net("ENABLE"), true);
    for cycle in 0..i64::from(CYCLES) {
        let [rise, fall] = [exposure.stop(cycle), exposure.stop_fall(cycle)];
        drives.pulse(rig.net("STOP"), ORIGIN + rise, ORIGIN + fall);
    }
    let init = rig.bus("COUNTER_INIT");
    drives.number(load - Time::from_ns(2), &init, START.into());
    let half_periods = 2 * i64::from(STOP_PERIODS * CYCLES);
    drives.clock(rig.net("CLK"), exposure.clock, ORIGIN, (-12, half_periods));
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
    Layout::new(groups, (ORIGIN - Time::from_ns(10), end), ORIGIN)
}
