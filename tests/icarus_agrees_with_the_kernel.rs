//! The exported macropixel in Icarus Verilog, on random stimuli: the same LOCAL_STOP times to the
//! femtosecond and the same histogram counts as our kernel. Skipped, loudly, where Icarus is absent.

mod icarus;
mod scenario;

use std::path::Path;

use guided_dtof::engine::{GateSimulation, StimulusPlan, export_verilog};
use guided_dtof::kernel::Recorder;
use rand::{SeedableRng, rngs::StdRng};
use scenario::Scenario;

fn table(path: &Path) -> Vec<Vec<i64>> {
    let text = std::fs::read_to_string(path).unwrap();
    text.lines()
        .skip(1)
        .map(|line| line.split(',').map(|n| n.parse().unwrap_or(-1)).collect())
        .collect()
}

fn compare(random: &mut StdRng, rows: usize, cols: usize) {
    let scenario = Scenario::random(random, rows, cols);
    let pulses = scenario.pulses();
    let Scenario {
        config,
        exposure,
        starts,
        ..
    } = &scenario;

    let folder = tempfile::tempdir().unwrap();
    let plan = StimulusPlan::new(config, exposure, cols, starts, &pulses);
    export_verilog(folder.path(), config, &plan).unwrap();
    icarus::simulate(folder.path(), &["tb.v", "design.v", "cells.v"], &[]);

    let mut gate = GateSimulation::new(config, exposure, (0, 0), (rows, cols), starts, &pulses);
    let local_stops = gate.netlist().signal("LOCAL_STOP").unwrap();
    let mut recorder = Recorder::new(local_stops.clone());
    gate.run(&mut recorder);
    assert_eq!(gate.loaded(), scenario.loaded());
    let ours: Vec<Vec<i64>> = gate
        .histograms()
        .unwrap()
        .iter()
        .enumerate()
        .flat_map(|(pixel, counts)| {
            counts.iter().enumerate().map(move |(bin, &count)| {
                vec![
                    (pixel / cols) as i64,
                    (pixel % cols) as i64,
                    bin as i64,
                    count as i64,
                ]
            })
        })
        .collect();
    assert_eq!(
        table(&folder.path().join("histograms.csv")),
        ours,
        "{config:?}"
    );

    let origin = gate.schedule().origin;
    let mut ours: Vec<Vec<i64>> = local_stops
        .iter()
        .enumerate()
        .flat_map(|(pixel, &net)| {
            let rises = recorder
                .rising_edges(net)
                .into_iter()
                .filter(|&t| t >= origin);
            rises.map(move |t| {
                vec![
                    (pixel / cols) as i64,
                    (pixel % cols) as i64,
                    (t - origin).as_fs(),
                ]
            })
        })
        .collect();
    let mut theirs = table(&folder.path().join("local_stops.csv"));
    ours.sort();
    theirs.sort();
    assert_eq!(theirs, ours, "{config:?}");
}

#[test]
fn single_macropixels() {
    if icarus::is_here() {
        for seed in 0..40 {
            compare(&mut StdRng::seed_from_u64(seed), 1, 1);
        }
    }
}

#[test]
fn small_arrays_loaded_through_one_serial_pin() {
    if icarus::is_here() {
        for (seed, (rows, cols)) in [(1, 3), (3, 1), (2, 3)].into_iter().enumerate() {
            compare(&mut StdRng::seed_from_u64(1000 + seed as u64), rows, cols);
        }
    }
}
