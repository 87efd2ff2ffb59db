//! The exported macropixel in Icarus Verilog, on random stimuli: the same LOCAL_STOP times to the
//! femtosecond and the same histogram counts as our kernel. Skipped, loudly, where Icarus is absent.

use crate::cases;
use crate::icarus;
use crate::scenario;

use guided_dtof::engine::GateSimulation;
use guided_dtof::stimulus::{StimulusPlan, export_verilog};
use icarus::IcarusChanges;
use rand::{SeedableRng, rngs::StdRng};
use scenario::Scenario;

fn compare(random: &mut StdRng, rows: usize, cols: usize) {
    let scenario = scenario::random(random, rows, cols);
    let pulses = scenario.pulses();
    let Scenario {
        config,
        exposure,
        starts,
        ..
    } = &scenario;

    let folder = tempfile::tempdir().unwrap();
    let plan = StimulusPlan::new(config, exposure, cols, starts, &pulses);
    export_verilog(folder.path(), config, Some(&plan), None).unwrap();
    icarus::simulate(folder.path(), &["tb.v", "design.v", "cells.v"], &[]);

    let mut gate = GateSimulation::new(config, exposure, (0, 0), (rows, cols), starts, &pulses);
    let ours = IcarusChanges::by_kernel(&mut gate, cols);
    assert_eq!(gate.loaded(), scenario.loaded());
    assert_eq!(
        IcarusChanges::by_testbench(folder.path()),
        ours,
        "{config:?}"
    );
}

#[test]
fn single_macropixels() {
    if icarus::is_here() {
        for seed in 0..cases::cases(6).into() {
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
