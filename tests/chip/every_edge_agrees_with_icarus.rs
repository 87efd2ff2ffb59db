//! Every value change of every net of whole macropixels, at the same femtosecond and to the same value, in our kernel and in Icarus
//! Verilog, with their load path. Skipped, loudly, where Icarus is absent. Random circuits are compared in the same way by the tests
//! of femtogate (`crates/gates/tests/kernel`).

use std::fs::File;
use std::io::{BufReader, Cursor};
use std::time::Instant;

use guided_dtof::chip::{
    FrontEnd, Sensor, SensorConfig, Silicon, array, hslidar, hslidar_delay_line, vcsel_flash,
};
use guided_dtof::engine::GateSimulation;
use guided_dtof::netlist::{Corner, Netlist};
use guided_dtof::stimulus::{StimulusPlan, export_verilog};
use guided_dtof::waves::{VcdWriter, WaveSelection};
use rand::{RngExt, SeedableRng, rngs::StdRng};

use crate::cases::cases;
use crate::every_edge::waves::{Figures, Waves};
use crate::icarus;
use crate::scenario::{self, Scenario};
use crate::wide8x8::wide8x8;
use crate::yosys;

/// Whose waves are compared.
const NAMES: [&str; 2] = ["the kernel", "Icarus"];

/// Runs all macropixels of a small sensor, with their load path, in both simulators.
fn compare_sensor(scenario: &Scenario) -> Figures {
    compare_silicon(scenario, &Silicon::new(&scenario.config))
}

/// The same with the delays of this silicon.
fn compare_silicon(scenario: &Scenario, silicon: &Silicon) -> Figures {
    let Scenario {
        config,
        exposure,
        starts,
        ..
    } = scenario;
    let pulses = scenario.pulses();
    let folder = tempfile::tempdir().unwrap();
    let size = (config.rows, config.cols);
    let sensor = Sensor::from(config).made_of(silicon);
    let plan = StimulusPlan::new(&sensor, exposure, size.1, starts, &pulses);
    if *silicon == Silicon::new(config) {
        export_verilog(folder.path(), config, Some(&plan), None).unwrap();
    } else {
        let timing = silicon.timing(&Netlist::elaborate(&array::circuit(config)));
        export_verilog(folder.path(), config, Some(&plan), Some(&timing)).unwrap();
    }
    icarus::simulate(folder.path(), &["tb.v", "design.v", "cells.v"], &["+vcd"]);
    let dump = File::open(folder.path().join("dut.vcd")).unwrap();
    let theirs = Waves::read(BufReader::new(dump), "tb.dut");

    let mut gate = GateSimulation::new(&sensor, exposure, (0, 0), size, starts, &pulses);
    let selection = WaveSelection::all().with_anonymous();
    let mut writer = VcdWriter::new(Vec::new(), gate.netlist(), &selection).unwrap();
    gate.run(&mut writer);
    let end = gate.schedule().end;
    let top = gate.netlist().scopes()[0].name.clone();
    let ours = Waves::read(Cursor::new(writer.finish(end).unwrap()), &top);
    ours.compare(&theirs, NAMES, end.as_fs() as u64)
        .unwrap_or_else(|difference| panic!("{difference}\n{config:?} {silicon:?}"))
}

#[test]
fn random_macropixels() {
    if !icarus::is_here() {
        return;
    }
    let start = Instant::now();
    let mut all = Figures::default();
    // One with every P-counter there is.
    let mut wanted = scenario::p_counters();
    let sensors = wanted.len() as u64;
    let mut seeds = 0..10_000;
    while !wanted.is_empty() {
        let seed = seeds.next().expect("every P-counter is drawn now and then");
        let scenario = scenario::random(&mut StdRng::seed_from_u64(seed), 1, 1);
        let config = &scenario.config;
        let p_counter = (config.p_counter, config.tap, config.after_borrow);
        if let Some(index) = wanted.iter().position(|&wanted| wanted == p_counter) {
            wanted.swap_remove(index);
            all = all + compare_sensor(&scenario);
        }
    }
    all.print("macropixels", sensors, start);
}

#[test]
fn sensors_of_another_kind() {
    if !icarus::is_here() {
        return;
    }
    let start = Instant::now();
    let mut all = Figures::default();
    // Where CLK is skewed, the second column shows it.
    let sensors = [
        (wide8x8().unwrap(), 1),
        (hslidar(), 2),
        (hslidar_delay_line(), 2),
        (vcsel_flash(), 1),
        (yosys::lfsr().into(), 1),
    ];
    let mut compared = 0;
    for (kind, (sensor, cols)) in (0..).zip(sensors) {
        // Each kind in one of both silicons.
        let seeds = if cases(1) > 1 {
            0..2
        } else {
            kind % 2..kind % 2 + 1
        };
        for seed in seeds {
            compared += 1;
            let random = &mut StdRng::seed_from_u64(seed);
            let mut config = SensorConfig {
                rows: 1,
                cols,
                ..(*sensor).clone()
            };
            // The chip as it is, and then in any silicon.
            let mut silicon = Silicon::new(&config);
            if seed > 0 {
                config.corner = Corner::ALL[random.random_range(0..3)];
                config.clk_skew_ps = random.random_range(0.0..=200.0);
                silicon = scenario::silicon(random, &config);
            }
            let scenario = scenario::of_sensor(random, config);
            all = all + compare_silicon(&scenario, &silicon);
        }
    }
    all.print("sensors of another kind", compared, start);
}

#[test]
fn macropixels_whose_spads_share_a_wire() {
    if !icarus::is_here() {
        return;
    }
    let start = Instant::now();
    let mut all = Figures::default();
    let joined = FrontEnd::ALL.into_iter().filter(|kind| kind.joins());
    for (seed, front_end) in (0..).zip(joined.clone()) {
        let random = &mut StdRng::seed_from_u64(seed);
        let config = SensorConfig {
            rows: 1,
            cols: 1,
            front_end,
            coincident_spads: 3,
            dead_time_ns: 2.0,
            ..SensorConfig::default()
        };
        all = all + compare_sensor(&scenario::of_sensor(random, config));
    }
    all.print(
        "macropixels whose SPADs share a wire",
        joined.count() as u64,
        start,
    );
}
