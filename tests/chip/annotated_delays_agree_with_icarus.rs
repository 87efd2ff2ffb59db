//! A macropixel with random delays of every arc of every cell, annotated from SDF, in Icarus Verilog: the same LOCAL_STOP
//! times to the femtosecond and the same histograms as our kernel, whether we annotate the file onto our cells or Icarus
//! onto the standard ones. Skipped, loudly, where Icarus is absent.

use crate::cases::cases;
use crate::icarus;

use std::collections::HashSet;

use guided_dtof::chip::{Exposure, SensorConfig, array};
use guided_dtof::engine::GateSimulation;
use guided_dtof::netlist::{Corner, Library, Netlist, Timing};
use guided_dtof::photon::{SpadEvent, apply_dead_time};
use guided_dtof::sdf::{Sdf, SdfOptions, annotate, write_sdf};
use guided_dtof::stimulus::{StimulusPlan, export_verilog};
use guided_dtof::units::Time;
use icarus::{IcarusChanges, random_delays};
use rand::{RngExt, SeedableRng, rngs::StdRng};

/// Compares one random macropixel with the delays of an SDF file; gives its LOCAL_STOP times after the first STOP.
fn compare(seed: u64, sdf: impl FnOnce(&Netlist, &Timing, &mut StdRng) -> String) -> Vec<Vec<i64>> {
    let random = &mut StdRng::seed_from_u64(seed);
    let config = SensorConfig {
        rows: 1,
        cols: 1,
        clk_hz: random.random_range(100e6..350e6),
        corner: Corner::ALL[random.random_range(0..3)],
        ..SensorConfig::default()
    };
    let exposure = Exposure::new(&config, random.random_range(40..80), 4);
    let starts = [random.random_range(0..40)];
    let mut pulses: Vec<SpadEvent> = (0..150)
        .map(|_| SpadEvent {
            time: Time::from_fs(random.random_range(0..exposure.end().as_fs())),
            spad: random.random_range(0..16),
        })
        .collect();
    pulses.sort_unstable();
    apply_dead_time(&mut pulses, &config.spad_model(), 0);
    let pulses = [&pulses[..]];

    let netlist = Netlist::elaborate(&array::circuit(&config));
    let nominal = Timing::nominal(&netlist, &Library::generic_40nm(), config.corner);
    let text = sdf(&netlist, &nominal, random);
    let sdf = Sdf::parse("chip.sdf", &text).unwrap();
    let mut timing = nominal;
    annotate(&mut timing, &netlist, &sdf, config.corner).unwrap();

    let folder = tempfile::tempdir().unwrap();
    let plan = StimulusPlan::new(&config, &exposure, 1, &starts, &pulses);
    export_verilog(folder.path(), &config, Some(&plan), Some(&timing)).unwrap();
    icarus::simulate(folder.path(), &["tb.v", "design.v", "cells.v"], &[]);
    let exact = IcarusChanges::by_testbench(folder.path());
    std::fs::write(folder.path().join("chip.sdf"), &text).unwrap();
    let standard_cells = icarus::standard_cells(config.corner);
    let said = icarus::simulate(folder.path(), &standard_cells, &["-sdf-warn"]);
    assert_eq!(said, "", "every entry finds its path");
    let standard = IcarusChanges::by_testbench(folder.path());

    let gate = GateSimulation::new(&config, &exposure, (0, 0), (1, 1), &starts, &pulses);
    let ours = IcarusChanges::by_kernel(&mut gate.with_timing(&timing), 1);
    assert_eq!(exact, ours, "seed {seed}");
    assert_eq!(standard, ours, "seed {seed}, standard cells");
    ours.stops
}

/// Every arc of every cell.
fn drawn(netlist: &Netlist, nominal: &Timing, random: &mut StdRng) -> String {
    let drawn = random_delays(netlist, nominal, random);
    let mut text = Vec::new();
    write_sdf(&mut text, netlist, [&drawn; 3], SdfOptions::default()).unwrap();
    String::from_utf8(text).unwrap()
}

/// The start value decides whether Q or QN of the first flip-flop clocks the second: a slow one delays LOCAL_STOP, the
/// other does not.
#[test]
fn a_slow_qn_is_not_a_slow_q() {
    if icarus::is_here() {
        let moves = |seed| {
            let stops = |cell, output| {
                compare(seed, |_, _, _| {
                    format!(
                        "(DELAYFILE (SDFVERSION \"3.0\") (DIVIDER .) (TIMESCALE 1ps)
                         (CELL (CELLTYPE \"DFFR\") (INSTANCE mp_r0_c0.p_counter.{cell})
                           (DELAY (ABSOLUTE (IOPATH (posedge CK) {output} (500))))))"
                    )
                })
            };
            // QN of a memory is not connected.
            let nominal = stops("memory.memory_0", "QN");
            ["Q", "QN"].map(|output| stops("counter_0", output) != nominal)
        };
        let seen: HashSet<_> = (0..2).map(moves).collect();
        assert_eq!(seen, HashSet::from([[true, false], [false, true]]));
    }
}

#[test]
fn macropixels_with_random_delays() {
    if icarus::is_here() {
        let seeds = if cases(1) > 1 { 12 } else { 5 };
        let all: Vec<_> = (0..seeds).map(|seed| compare(seed, drawn)).collect();
        assert!(all.iter().all(|stops| !stops.is_empty()), "{all:?}");
        let different: HashSet<_> = all.iter().collect();
        assert_eq!(different.len(), all.len(), "the delays must show");
    }
}
