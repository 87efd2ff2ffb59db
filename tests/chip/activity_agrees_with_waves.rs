//! Switching activity and its SAIF file tell what the waveform of the same run shows, counted from the dump.

use crate::every_edge;
use crate::scenario;

use std::collections::BTreeMap;
use std::io::Cursor;
use std::path::Path;
use std::process::{Command, Output};

use every_edge::circuit::{self, Case};
use every_edge::waves::Waves;
use guided_dtof::engine::GateSimulation;
use guided_dtof::kernel::{Activity, Kernel, in_order};
use guided_dtof::netlist::Netlist;
use guided_dtof::units::Time;
use guided_dtof::waves::{Selection, VcdWriter, write_saif};
use proptest::prelude::*;
use rand::{SeedableRng, rngs::StdRng};
use scenario::Scenario;

/// T0, T1, TX, TC, IG.
type Row = [i64; 5];

/// Duration, and every net of a SAIF file by its path below the top.
fn read_saif(text: &str) -> (i64, BTreeMap<String, Row>) {
    let mut path: Vec<String> = Vec::new();
    let (mut duration, mut nets, mut depth) = (0, BTreeMap::new(), 0);
    for line in text.lines() {
        depth += line.matches('(').count() as i64 - line.matches(')').count() as i64;
        let words: Vec<&str> = line
            .split(['(', ')', ' '])
            .filter(|w| !w.is_empty())
            .collect();
        match words[..] {
            ["DURATION", time] => duration = time.parse().unwrap(),
            ["INSTANCE", name] => path.push(name.to_owned()),
            // A list of nets or an instance ends.
            [] if depth < path.len() as i64 + 1 => _ = path.pop(),
            [name, "T0", t0, "T1", t1, "TX", tx, "TC", tc, "IG", ig] => {
                let row = [t0, t1, tx, tc, ig].map(|n| n.parse().unwrap());
                let name = name.replace('\\', "");
                let below = path[1..].iter().cloned().chain([name]);
                let path = below.collect::<Vec<_>>().join(".");
                assert!(nets.insert(path, row).is_none());
            }
            _ => {}
        }
    }
    assert_eq!(depth, 0, "parentheses");
    (duration, nets)
}

/// The slow obvious count: every bit of every signal, value after value.
fn count(changes: &[(u64, String)], bit: usize, end: i64) -> Row {
    let mut row = [0; 5];
    let (mut known, mut before, mut since) = ('x', 'x', 0);
    for (time, value) in changes {
        let value = value.chars().rev().nth(bit).unwrap().to_ascii_lowercase();
        let slot = |value| match value {
            '0' => 0,
            '1' => 1,
            _ => 2,
        };
        row[slot(before)] += *time as i64 - since;
        if slot(value) < 2 && known != 'x' {
            row[3] += i64::from(value != known);
            row[4] += i64::from(value == known && value != before);
        }
        if slot(value) < 2 {
            known = value;
        }
        (before, since) = (value, *time as i64);
    }
    row[match before {
        '0' => 0,
        '1' => 1,
        _ => 2,
    }] += end - since;
    row
}

/// Compares a SAIF file with a dump of the same run; gives toggles, and nets that have none.
fn compare(saif: &str, dump: Vec<u8>, top: &str, end: Time) -> Result<(i64, usize), TestCaseError> {
    let (duration, nets) = read_saif(saif);
    prop_assert_eq!(duration, end.as_fs());
    let waves = Waves::read(Cursor::new(dump), top);
    let mut seen = 0;
    for (path, changes) in waves.changes() {
        let width = changes.first().map_or(1, |(_, value)| value.len());
        for bit in 0..width {
            let row = nets
                .get(path)
                .or_else(|| nets.get(&format!("{path}[{bit}]")));
            prop_assert!(row.is_some(), "{} is in no list", path);
            prop_assert_eq!(*row.unwrap(), count(changes, bit, end.as_fs()), "{}", path);
            seen += 1;
        }
    }
    prop_assert_eq!(seen, nets.len());
    for (path, row) in &nets {
        prop_assert_eq!(row[..3].iter().sum::<i64>(), duration, "{}", path);
    }
    let quiet = nets.values().filter(|row| row[3] == 0).count();
    Ok((nets.values().map(|row| row[3]).sum(), quiet))
}

fn saif(netlist: &Netlist, activity: &Activity, end: Time) -> String {
    let mut text = Vec::new();
    write_saif(&mut text, netlist, &activity.until(end), end).unwrap();
    String::from_utf8(text).unwrap()
}

fn random_circuit(case: &Case) -> Result<(), TestCaseError> {
    let netlist = Netlist::elaborate(&case.circuit());
    let drives = case.drives(&netlist);
    let end = drives.last().map_or(Time::ZERO, |d| d.time) + Time::from_ns(2);
    let all = Selection::all().with_anonymous();
    let mut dump = VcdWriter::new(Vec::new(), &netlist, &all).unwrap();
    let mut activity = Activity::new(netlist.net_count(), Time::ZERO);
    let mut kernel = Kernel::new(&netlist, &case.timing(&netlist));
    kernel.run(&mut in_order(drives), end, &mut (&mut dump, &mut activity));
    let top = &netlist.scopes()[0].name;
    compare(
        &saif(&netlist, &activity, end),
        dump.finish(end).unwrap(),
        top,
        end,
    )?;
    Ok(())
}

proptest! {
    #![proptest_config(ProptestConfig { cases: 120, ..ProptestConfig::default() })]

    #[test]
    fn in_random_circuits(case in prop_oneof![circuit::flat(), circuit::hierarchical()]) {
        random_circuit(&case)?;
    }
}

#[test]
fn in_an_exposed_sensor() {
    for seed in 0..3 {
        let scenario = Scenario::random(&mut StdRng::seed_from_u64(seed), 1, 2);
        let Scenario {
            config,
            exposure,
            starts,
            ..
        } = &scenario;
        let pulses = scenario.pulses();
        let mut gate = GateSimulation::new(config, exposure, (0, 0), (1, 2), starts, &pulses);
        let netlist = gate.netlist().clone();
        let all = Selection::all().with_anonymous();
        let mut dump = VcdWriter::new(Vec::new(), &netlist, &all).unwrap();
        let mut activity = Activity::new(netlist.net_count(), Time::ZERO);
        gate.run(&mut (&mut dump, &mut activity));
        let end = gate.now();
        let top = &netlist.scopes()[0].name;
        let text = saif(&netlist, &activity, end);
        let (toggles, quiet) = compare(&text, dump.finish(end).unwrap(), top, end).unwrap();
        assert!(toggles > 10_000 && quiet > 100, "{toggles} {quiet}");
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

    let written = replay(folder.path(), &["--engine", "gate"]);
    assert!(written.status.success(), "{written:?}");
    let text = std::fs::read_to_string(folder.path().join("activity.saif")).unwrap();
    let (_, nets) = read_saif(&text);
    assert!(nets["CLK"][3] >= 2 * 160, "{:?}", nets["CLK"]);
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
