//! A macropixel with random delays of every cell, annotated from SDF, in Icarus Verilog: the same LOCAL_STOP
//! times to the femtosecond and the same histograms as our kernel. Skipped, loudly, where Icarus is absent.

mod icarus;

use std::collections::HashSet;
use std::path::Path;

use guided_dtof::chip::{Exposure, SensorConfig, sensor};
use guided_dtof::engine::{GateSimulation, StimulusPlan, export_annotated_verilog};
use guided_dtof::kernel::Recorder;
use guided_dtof::netlist::sdf::{Sdf, SdfOptions, annotate, write_sdf};
use guided_dtof::netlist::{Corner, Library, Netlist, Timing};
use guided_dtof::photon::{SpadEvent, apply_dead_time};
use guided_dtof::units::Time;
use rand::{RngExt, SeedableRng, rngs::StdRng};

fn lines(path: &Path) -> Vec<String> {
    let text = std::fs::read_to_string(path).unwrap();
    let mut lines: Vec<String> = text.lines().skip(1).map(str::to_owned).collect();
    lines.sort();
    lines
}

/// Every arc of every cell 0.7 to 1.4 times as slow as in the library, each by itself.
fn random_delays(netlist: &Netlist, nominal: &Timing, random: &mut StdRng) -> Timing {
    let mut timing = nominal.clone();
    for cell in 0..netlist.cells().len() {
        let delays = nominal.of(cell).map(|mut arc| {
            arc.rise_fs = (arc.rise_fs as f64 * random.random_range(0.7..1.4)) as u32;
            arc.fall_fs = (arc.fall_fs as f64 * random.random_range(0.7..1.4)) as u32;
            arc
        });
        timing.set(cell, delays);
    }
    timing
}

/// Compares one random macropixel; gives its LOCAL_STOP times after the first STOP.
fn compare(seed: u64) -> Vec<String> {
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
    apply_dead_time(&mut pulses, config.dead_time());
    let pulses = [&pulses[..]];

    let netlist = Netlist::elaborate(&sensor::circuit(&config));
    let nominal = Timing::nominal(&netlist, &Library::default(), config.corner);
    let drawn = random_delays(&netlist, &nominal, random);
    let mut text = Vec::new();
    write_sdf(&mut text, &netlist, [&drawn; 3], SdfOptions::default()).unwrap();
    let text = String::from_utf8(text).unwrap();
    let sdf = Sdf::parse("drawn.sdf", &text).unwrap();
    let mut timing = nominal;
    annotate(&mut timing, &netlist, &sdf, config.corner).unwrap();

    let folder = tempfile::tempdir().unwrap();
    let plan = StimulusPlan::new(&config, &exposure, 1, &starts, &pulses);
    export_annotated_verilog(folder.path(), &config, &plan, &timing).unwrap();
    icarus::simulate(folder.path(), &["tb.v", "design.v", "cells.v"], &[]);

    let gate = GateSimulation::new(&config, &exposure, (0, 0), (1, 1), &starts, &pulses);
    let mut gate = gate.with_timing(&timing);
    let local_stop = gate.netlist().signal("LOCAL_STOP").unwrap();
    let mut recorder = Recorder::new(local_stop.clone());
    gate.run(&mut recorder);
    let counts = gate.histograms().unwrap().remove(0).into_iter().enumerate();
    let mut ours: Vec<String> = counts.map(|(bin, n)| format!("0,0,{bin},{n}")).collect();
    ours.sort();
    assert_eq!(
        lines(&folder.path().join("histograms.csv")),
        ours,
        "seed {seed}"
    );
    let origin = gate.schedule().origin;
    let mut ours: Vec<String> = recorder
        .rising_edges(local_stop[0])
        .into_iter()
        .filter(|&t| t >= origin)
        .map(|t| format!("0,0,{}", (t - origin).as_fs()))
        .collect();
    ours.sort();
    assert_eq!(
        lines(&folder.path().join("local_stops.csv")),
        ours,
        "seed {seed}"
    );
    ours
}

#[test]
fn macropixels_with_random_delays() {
    if icarus::is_here() {
        let all: Vec<Vec<String>> = (0..12).map(compare).collect();
        assert!(all.iter().all(|stops| !stops.is_empty()), "{all:?}");
        let different: HashSet<_> = all.iter().collect();
        assert_eq!(different.len(), all.len(), "the delays must show");
    }
}
