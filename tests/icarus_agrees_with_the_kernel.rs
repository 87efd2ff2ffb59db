//! The exported macropixel in Icarus Verilog, on random stimuli: the same LOCAL_STOP times to the
//! femtosecond and the same histogram counts as our kernel. Skipped, loudly, where Icarus is absent.

use std::path::Path;
use std::process::Command;

use guided_dtof::chip::{EventType, Exposure, Mode, SensorConfig};
use guided_dtof::engine::{GateSimulation, StimulusPlan, export_verilog};
use guided_dtof::kernel::Recorder;
use guided_dtof::netlist::Corner;
use guided_dtof::photon::{SpadEvent, apply_dead_time};
use guided_dtof::units::Time;
use rand::{RngExt, SeedableRng, rngs::StdRng};

fn icarus_is_here() -> bool {
    if Command::new("iverilog").arg("-V").output().is_ok() {
        return true;
    }
    eprintln!(
        "SKIPPED: iverilog is not installed, so nothing was compared with Icarus Verilog (apt-get install iverilog)"
    );
    assert!(std::env::var_os("CI").is_none(), "CI must have iverilog");
    false
}

fn run(folder: &Path, program: &str, arguments: &[&str]) -> String {
    let output = Command::new(program)
        .args(arguments)
        .current_dir(folder)
        .output()
        .unwrap();
    let text = String::from_utf8_lossy(&output.stdout) + String::from_utf8_lossy(&output.stderr);
    assert!(output.status.success(), "{program}: {text}");
    text.into_owned()
}

fn table(path: &Path) -> Vec<Vec<i64>> {
    let text = std::fs::read_to_string(path).unwrap();
    text.lines()
        .skip(1)
        .map(|line| line.split(',').map(|n| n.parse().unwrap_or(-1)).collect())
        .collect()
}

fn random_sensor(random: &mut StdRng, rows: usize, cols: usize) -> SensorConfig {
    let clk_hz = random.random_range(100e6..500e6);
    SensorConfig {
        rows,
        cols,
        clk_hz,
        stop_phase_ps: random.random_range(-0.45..0.45) * 1e12 / clk_hz,
        counter_bits: random.random_range(3..10),
        bins: random.random_range(2..17),
        bin_bits: random.random_range(2..15),
        dead_time_ns: random.random_range(3.0..12.0),
        threshold: random.random_range(0..3),
        event_type: [EventType::Greater, EventType::Equal, EventType::Less]
            [random.random_range(0..3)],
        mode: if random.random_bool(0.2) {
            Mode::Conventional
        } else {
            Mode::Guided
        },
        corner: Corner::ALL[random.random_range(0..3)],
        ..SensorConfig::default()
    }
}

fn compare(random: &mut StdRng, rows: usize, cols: usize) {
    let config = random_sensor(random, rows, cols);
    let exposure = Exposure::new(
        &config,
        random.random_range(20..80),
        random.random_range(1..8),
    );
    let most = config.largest_start().min(exposure.stop_periods as u16);
    let pixels = config.pixels();
    let starts: Vec<u16> = (0..pixels).map(|_| random.random_range(0..=most)).collect();
    let pulses: Vec<Vec<SpadEvent>> = (0..pixels)
        .map(|_| {
            let mut pulses: Vec<SpadEvent> = (0..random.random_range(0..200))
                .map(|_| SpadEvent {
                    time: Time::from_fs(random.random_range(0..exposure.end().as_fs())),
                    spad: random.random_range(0..16),
                })
                .collect();
            pulses.sort_unstable();
            apply_dead_time(&mut pulses, config.dead_time());
            pulses
        })
        .collect();
    let pulses: Vec<&[SpadEvent]> = pulses.iter().map(Vec::as_slice).collect();

    let folder = tempfile::tempdir().unwrap();
    let plan = StimulusPlan::new(&config, &exposure, cols, &starts, &pulses);
    export_verilog(folder.path(), &config, &plan).unwrap();
    let compiled = run(
        folder.path(),
        "iverilog",
        &[
            "-g2005", "-Wall", "-o", "sim", "tb.v", "design.v", "cells.v",
        ],
    );
    assert_eq!(compiled, "", "Icarus has something to say about the export");
    run(folder.path(), "vvp", &["sim"]);

    let mut gate = GateSimulation::new(&config, &exposure, (0, 0), (rows, cols), &starts, &pulses);
    let local_stops = gate.netlist().signal("LOCAL_STOP").unwrap();
    let mut recorder = Recorder::new(local_stops.clone());
    gate.run(&mut recorder);
    let loaded: Vec<Option<u16>> = starts.iter().map(|&start| Some(start)).collect();
    assert_eq!(gate.loaded(), loaded);
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
    if icarus_is_here() {
        for seed in 0..40 {
            compare(&mut StdRng::seed_from_u64(seed), 1, 1);
        }
    }
}

#[test]
fn small_arrays_loaded_through_one_serial_pin() {
    if icarus_is_here() {
        for (seed, (rows, cols)) in [(1, 3), (3, 1), (2, 3)].into_iter().enumerate() {
            compare(&mut StdRng::seed_from_u64(1000 + seed as u64), rows, cols);
        }
    }
}
