//! Switching activity of a sensor and its SAIF file tell what the waveform of the same run shows.

use std::fs::File;
use std::io::{BufReader, Cursor};
use std::path::Path;
use std::process::{Command, Output};

use guided_dtof::engine::GateSimulation;
use guided_dtof::kernel::Activity;
use guided_dtof::stimulus::{StimulusPlan, export_verilog};
use guided_dtof::units::Time;
use guided_dtof::waves::{VcdWriter, WaveSelection};
use rand::{SeedableRng, rngs::StdRng};

use crate::every_edge::waves::Waves;
use crate::icarus;
use crate::saif::{compare, read_saif, saif};
use crate::scenario::{self, Scenario};

#[test]
fn in_an_exposed_sensor() {
    for seed in 0..3 {
        let scenario = scenario::random(&mut StdRng::seed_from_u64(seed), 1, 2);
        let Scenario {
            config,
            exposure,
            starts,
            ..
        } = &scenario;
        let pulses = scenario.pulses();
        let mut gate = GateSimulation::new(config, exposure, (0, 0), (1, 2), starts, &pulses);
        let netlist = gate.netlist().clone();
        let all = WaveSelection::all().with_anonymous();
        let mut dump = VcdWriter::new(Vec::new(), &netlist, &all).unwrap();
        let mut activity = Activity::new(&netlist, Time::ZERO);
        gate.run(&mut (&mut dump, &mut activity));
        let end = gate.now();
        let text = saif(&netlist, &activity, end);
        let ours = Cursor::new(dump.finish(end).unwrap());
        let ours = Waves::read(ours, &netlist.scopes()[0].name);
        let compare = |waves: &Waves| {
            let nets = compare(&text, (&netlist, gate.timing()), waves, end).unwrap();
            // TC, TG and IG.
            let [toggles, through, swallowed] =
                [3, 4, 5].map(|column| nets.values().map(|row| row[column]).sum::<i64>());
            let quiet = nets.values().filter(|row| row[3] == 0).count();
            assert!(toggles > 1_000 && quiet > 100, "{toggles} {quiet}");
            assert!(through > 0 && swallowed > 0, "{through} {swallowed}");
        };
        compare(&ours);
        if seed == 0 && icarus::is_here() {
            let folder = tempfile::tempdir().unwrap();
            let plan = StimulusPlan::new(config, exposure, 2, starts, &pulses);
            export_verilog(folder.path(), config, Some(&plan), None).unwrap();
            icarus::simulate(folder.path(), &["tb.v", "design.v", "cells.v"], &["+vcd"]);
            let dump = File::open(folder.path().join("dut.vcd")).unwrap();
            compare(&Waves::read(BufReader::new(dump), "tb.dut"));
        }
    }
}

fn replay(folder: &Path, arguments: &[&str]) -> Output {
    let vectors = concat!(env!("CARGO_MANIFEST_DIR"), "/vectors/replay");
    let file = |name: &str| format!("{vectors}/{name}");
    Command::new(env!("CARGO_BIN_EXE_gdtof"))
        .args([
            "replay",
            "--sensor",
            &file("sensor.toml"),
            "--inits",
            &file("inits.csv"),
        ])
        .args(["--events", &file("events.csv"), "--stop-periods", "80"])
        .args(["--laser-cycles", "2", "--saif", "activity.saif"])
        .args(arguments)
        .current_dir(folder)
        .output()
        .unwrap()
}

#[test]
fn replay_writes_it_from_the_gates_and_from_nothing_else() {
    let folder = tempfile::tempdir().unwrap();
    let refused = replay(folder.path(), &["--engine", "window"]);
    assert_eq!(refused.status.code(), Some(2));
    assert_eq!(
        String::from_utf8(refused.stderr).unwrap().lines().count(),
        1
    );
    assert!(!folder.path().join("activity.saif").exists());

    let written = |arguments: &[&str]| {
        let written = replay(folder.path(), &[&["--engine", "gate"], arguments].concat());
        assert!(written.status.success(), "{written:?}");
        std::fs::read_to_string(folder.path().join("activity.saif")).unwrap()
    };
    let text = written(&[]);
    let (_, nets) = read_saif(&text);
    assert!(nets["CLK"][3] >= 2 * 160, "{:?}", nets["CLK"]);
    // Transport glitches are there on request and change nothing else.
    let with_glitches = written(&["--saif-glitches"]);
    let without: Vec<String> = with_glitches
        .lines()
        .map(|line| match line.split_once(" (TG ") {
            Some((before, after)) => format!("{before}{}", &after[after.find(')').unwrap() + 1..]),
            None => line.to_owned(),
        })
        .collect();
    assert!(without.iter().eq(text.lines()));
    let (_, glitches) = read_saif(&with_glitches);
    assert!(glitches.values().any(|row| row[4] > 0));
}

#[test]
fn power_says_what_each_block_takes_and_refuses_what_is_impossible() {
    let power = |arguments: &[&str]| {
        Command::new(env!("CARGO_BIN_EXE_gdtof"))
            .args(["power", "--stop-periods", "600", "--laser-cycles", "1"])
            .args(arguments)
            .output()
            .unwrap()
    };
    let energies = |arguments: &[&str]| -> Vec<f64> {
        let found = power(&[arguments, &["--json"]].concat());
        assert!(found.status.success(), "{found:?}");
        let found: serde_json::Value = serde_json::from_slice(&found.stdout).unwrap();
        let variants = found.as_array().unwrap();
        variants
            .iter()
            .map(|v| v["cycle_j"].as_f64().unwrap())
            .collect()
    };
    let found = energies(&[]);
    // Ripple, synchronous, conventional.
    assert!(found.len() == 3 && found[0] < found[1], "{found:?}");
    // Twice the supply, four times the energy.
    for (twice, once) in energies(&["--supply-v", "2.2"]).iter().zip(&found) {
        assert!((twice / once - 4.0).abs() < 1e-9);
    }
    for wrong in [["--start", "512"], ["--supply-v", "-1"]] {
        let refused = power(&wrong);
        assert_eq!(refused.status.code(), Some(2), "{wrong:?}");
        assert!(refused.stdout.is_empty());
    }
}
