//! A laser cycle that is simulated without most of those before it is, net for net and change for change, that of the whole
//! exposure, and so is what comes after it.

use guided_dtof::chip::{Exposure, Mode, Overflow, SensorConfig};
use guided_dtof::engine::{GateSimulation, late_cycle};
use guided_dtof::kernel::Observer;
use guided_dtof::logic::Logic;
use guided_dtof::netlist::NetId;
use guided_dtof::photon::SpadEvent;
use guided_dtof::units::Time;
use proptest::prelude::*;
use rand::{SeedableRng, rngs::StdRng};

use crate::cases::cases;
use crate::scenario;

/// What all nets are at a time, and their changes from then on.
#[derive(PartialEq)]
struct Trace {
    from: Time,
    before: Vec<Logic>,
    changes: Vec<(Time, NetId, Logic)>,
    /// Changes of all nets, before it as well.
    total: usize,
}

impl Observer for Trace {
    fn change(&mut self, time: Time, net: NetId, value: Logic) {
        self.total += 1;
        if time < self.from {
            self.before[net.index()] = value;
        } else {
            self.changes.push((time, net, value));
        }
    }
}

fn trace(mut gate: GateSimulation, from: Time) -> Trace {
    let mut trace = Trace {
        from: gate.schedule().origin + from,
        before: vec![Logic::X; gate.netlist().net_count()],
        changes: Vec::new(),
        total: 0,
    };
    gate.run(&mut trace);
    // The order within an instant is nobody's business.
    trace
        .changes
        .sort_by_key(|&(time, net, _)| (time, net.index()));
    trace
}

/// Whether the laser cycles up to `cycle` can be left out; returns by how much that lessens the changes.
fn same(
    config: &SensorConfig,
    exposure: &Exposure,
    start: u16,
    pulses: &[SpadEvent],
    cycle: u32,
) -> f64 {
    // The last column, to which CLK comes latest.
    let at = (0, config.cols - 1);
    let whole = GateSimulation::new(config, exposure, at, (1, 1), &[start], &[pulses]);
    let netlist = whole.netlist().clone();
    let from = exposure.stop(i64::from(cycle));
    let late = late_cycle(config, exposure, at, start, pulses, cycle);
    let (whole, late) = (trace(whole, from), trace(late, from));
    for net in (0..netlist.net_count()).map(NetId::new) {
        let (a, b) = (whole.before[net.index()], late.before[net.index()]);
        assert_eq!(
            a,
            b,
            "{:?} before cycle {cycle}, start value {start}",
            netlist.net_path(net)
        );
    }
    for (a, b) in whole.changes.iter().zip(&late.changes) {
        assert_eq!(
            a,
            b,
            "{:?}, {:?}",
            netlist.net_path(a.1),
            netlist.net_path(b.1)
        );
    }
    assert_eq!(whole.changes.len(), late.changes.len());
    late.total as f64 / whole.total as f64
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(cases(40)))]

    #[test]
    fn of_any_sensor(
        seed: u64,
        cycles in 3u32..12,
        conventional: bool,
        cols in 1usize..6,
        clk_skew_ps in 0f64..=200.0,
    ) {
        let mut random = StdRng::seed_from_u64(seed);
        let mut config = scenario::random(&mut random, 1, 1).config;
        config.bin_bits = config.bin_bits.min(4);
        (config.cols, config.clk_skew_ps) = (cols, clk_skew_ps);
        if conventional {
            config.mode = Mode::Conventional;
        }
        let memoryless = !config.p_counter.row().has_memory;
        let round = 1 << (config.counter_bits + 1);
        let stop_periods = if memoryless && round < 200 { round } else { 40 };
        let exposure = Exposure::new(&config, stop_periods, cycles);
        let scenario = scenario::in_exposure(&mut random, config, exposure);
        let (start, pulses) = (scenario.starts[0], &scenario.pulses[0]);
        for cycle in [cycles - 1, cycles / 2] {
            same(&scenario.config, &exposure, start, pulses, cycle);
        }
    }
}

#[test]
fn most_of_the_run_is_left_out_and_full_bins_stay_full() {
    for (overflow, mode) in [
        (Overflow::Saturate, Mode::Guided),
        (Overflow::Wrap, Mode::Guided),
        (Overflow::Saturate, Mode::Conventional),
    ] {
        let config = SensorConfig {
            bin_bits: 3,
            overflow,
            mode,
            ..SensorConfig::default()
        };
        let exposure = Exposure::new(&config, 60, 40);
        let pulses: Vec<SpadEvent> = (0..600)
            .map(|k| SpadEvent {
                time: Time::from_ps(7 + 10_300 * k),
                spad: (k % 16) as u8,
            })
            .collect();
        let share = same(&config, &exposure, 40, &pulses, 37);
        assert!(share < 0.25, "{share} of all changes");
    }
}
