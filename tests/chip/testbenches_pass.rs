//! Every testbench passes, and leaves a waveform that a viewer can read and a view beside it.

use std::path::Path;
use std::process::{Command, Output};

use guided_dtof::chip::{SensorConfig, Tap, Tdc};
use guided_dtof::netlist::Corner;
use guided_dtof::testbenches::TESTBENCHES;

const KEPT: &str = concat!(env!("CARGO_MANIFEST_DIR"), "/waves");

fn gdtof(arguments: &[&str]) -> Output {
    let program = env!("CARGO_BIN_EXE_gdtof");
    Command::new(program).args(arguments).output().unwrap()
}

/// Files of a folder whose names end so.
fn files(folder: &Path, extension: &str) -> Vec<String> {
    let names = std::fs::read_dir(folder).unwrap();
    let names = names.map(|entry| entry.unwrap().file_name().into_string().unwrap());
    let mut names: Vec<String> = names.filter(|name| name.ends_with(extension)).collect();
    names.sort();
    names
}

/// Signals that a GTKWave view shows, by their own names, buses without their range.
fn shown(view: &str) -> Vec<&str> {
    let lines = view
        .lines()
        .filter(|line| !line.starts_with(['[', '@', '-', '*']));
    // After the name that it has in the view.
    let lines = lines.map(|line| line.split("} ").last().unwrap());
    let whole = lines.map(|line| line.split('[').next().unwrap());
    whole.filter(|line| !line.is_empty()).collect()
}

#[test]
fn all_pass_and_leave_the_views_that_are_in_the_repository() {
    let folder = tempfile::tempdir().unwrap();
    let run = gdtof(&["tb", "--verbose", "--out", folder.path().to_str().unwrap()]);
    let text = String::from_utf8(run.stdout).unwrap();
    assert!(run.status.success(), "{text}");
    for testbench in TESTBENCHES {
        assert!(files(folder.path(), ".vcd").contains(&format!("{}.vcd", testbench.name)));
    }
    let views = files(folder.path(), ".gtkw");
    assert_eq!(views, files(Path::new(KEPT), ".gtkw"));
    for name in views {
        let view = std::fs::read_to_string(folder.path().join(&name)).unwrap();
        let kept = std::fs::read_to_string(format!("{KEPT}/{name}")).unwrap();
        assert!(
            view == kept,
            "{name}: `gdtof tb` in the repository renews its view"
        );

        let dump = name.replace(".gtkw", ".vcd");
        assert!(view.contains(&format!("[dumpfile] \"{dump}\"")));
        let waves = wellen::simple::read(folder.path().join(dump)).unwrap();
        assert!(waves.time_table().len() > 100);
        let signals = shown(&view);
        assert!(signals.len() > 5, "{name} shows {signals:?}");
        for signal in signals {
            let scopes: Vec<&str> = signal.split('.').collect();
            let (last, scopes) = scopes.split_last().unwrap();
            let found = waves.hierarchy().lookup_var(scopes, last);
            assert!(found.is_some(), "{name}: no {signal}");
        }
    }
}

#[test]
fn those_named_run_and_list_runs_none() {
    let list = gdtof(&["tb", "--list"]);
    let list = String::from_utf8(list.stdout).unwrap();
    assert_eq!(list.lines().count(), TESTBENCHES.len());

    let folder = tempfile::tempdir().unwrap();
    let out = folder.path().join("waves");
    let run = gdtof(&[
        "tb",
        "p_counter",
        "--json",
        "--wave-format",
        "fst",
        "--out",
        out.to_str().unwrap(),
    ]);
    assert!(run.status.success());
    let entries: serde_json::Value = serde_json::from_slice(&run.stdout).unwrap();
    assert_eq!(entries.as_array().unwrap().len(), 1);
    assert_eq!(entries[0]["name"], "tb_p_counter");
    assert_eq!(
        (&entries[0]["passed"], &entries[0]["failed"]),
        (&true.into(), &0.into())
    );
    assert_eq!(entries[0]["failures"], serde_json::json!([]));
    assert_eq!(files(&out, ".fst"), ["tb_p_counter.fst"]);
}

#[test]
fn a_testbench_of_its_own_prints_all_its_checks() {
    let folder = tempfile::tempdir().unwrap();
    let program = env!("CARGO_BIN_EXE_tb_macropixel");
    let run = Command::new(program)
        .arg("--out")
        .arg(folder.path())
        .output()
        .unwrap();
    let text = String::from_utf8(run.stdout).unwrap();
    assert!(
        run.status.success() && text.contains(" checked, 0 failed"),
        "{text}"
    );
}

#[test]
fn expectations_are_those_of_the_sensor_that_is_given() {
    type Change = fn(&mut SensorConfig);
    let sensors: [(&str, Change); 23] = [
        ("clk_hz = 30e6", |sensor| sensor.clk_hz = 30e6),
        ("clk_hz = 500e6", |sensor| sensor.clk_hz = 500e6),
        ("clk_hz = 2e9", |sensor| sensor.clk_hz = 2e9),
        ("temperature_c = 125", |s| s.temperature_c = Some(125.0)),
        ("reset_stages = 60", |sensor| sensor.reset_stages = 60),
        ("reset_stages = 1000", |s| s.reset_stages = 1000),
        ("bin_bits = 1", |sensor| sensor.bin_bits = 1),
        ("corner = slow", |sensor| sensor.corner = Corner::Slow),
        ("tap = msb", |sensor| sensor.tap = Tap::Msb),
        ("tdc = counter", |sensor| sensor.tdc = Tdc::Counter),
        ("counter_bits = 5", |sensor| sensor.counter_bits = 5),
        ("counter_bits = 11", |sensor| {
            (sensor.counter_bits, sensor.clk_hz) = (11, 300e6);
        }),
        ("stop_phase_ps = -1290", |s| s.stop_phase_ps = -1290.0),
        ("stop_phase_ps = -1000", |s| s.stop_phase_ps = -1000.0),
        ("stop_phase_ps = -300", |s| s.stop_phase_ps = -300.0),
        ("stop_phase_ps = 1290", |s| s.stop_phase_ps = 1290.0),
        ("bins = 2", |sensor| sensor.bins = 2),
        ("bins = 64", |sensor| sensor.bins = 64),
        ("clk_skew_ps = 150", |sensor| sensor.clk_skew_ps = 150.0),
        ("spad_rows = 1", |sensor| sensor.spad_rows = 1),
        ("one SPAD", |sensor| {
            (sensor.spad_rows, sensor.spad_cols) = (1, 1);
        }),
        ("spad_rows = 8", |sensor| sensor.spad_rows = 8),
        ("step_periods = 4", |sensor| {
            (sensor.step_periods, sensor.clk_hz) = (4, 200e6);
        }),
    ];
    let folder = tempfile::tempdir().unwrap();
    for (what, change) in sensors {
        let mut sensor = SensorConfig::default();
        change(&mut sensor);
        for testbench in TESTBENCHES.iter().filter(|tb| tb.drives(&sensor)) {
            let waves = folder.path().join("waves.vcd");
            // At 2 GHz the correlation block is too slow, which is said.
            if what == "clk_hz = 2e9" && testbench.name == "tb_macropixel" {
                assert!(testbench.check(&sensor).is_err());
                continue;
            }
            let checks = testbench.run(Some(&sensor), &waves).unwrap();
            assert!(checks.passed(), "{what}, {}:\n{checks}", testbench.name);
        }
    }
}

#[test]
fn a_sensor_whose_signals_race_is_refused_with_what_helps() {
    let run = gdtof(&["tb", "macropixel", "--set", "sensor.step_periods=2"]);
    assert_eq!(run.status.code(), Some(2));
    let said = String::from_utf8(run.stderr).unwrap();
    assert!(said.contains("the strobe meets"), "{said}");
    assert!(said.contains("; give clk_hz of at most 383.6"), "{said}");
}

#[test]
fn unknown_names_and_folders_that_cannot_be_made_are_one_sentence_and_exit_status_2() {
    let file = tempfile::NamedTempFile::new().unwrap();
    let taken = file.path().to_str().unwrap();
    for arguments in [
        &["tb", "histgram"][..],
        &["tb", "macropixel", "--out", taken],
    ] {
        let run = gdtof(arguments);
        assert_eq!(run.status.code(), Some(2), "{arguments:?}");
        assert_eq!(String::from_utf8(run.stderr).unwrap().lines().count(), 1);
    }
}

#[test]
fn the_book_links_every_view_and_testbench_to_files_that_are_there() {
    let commands = Path::new(env!("CARGO_MANIFEST_DIR")).join("docs/src/commands");
    let chapter = std::fs::read_to_string(commands.join("tb.md")).unwrap();
    let links = chapter.split("](").skip(1);
    let links: Vec<&str> = links.map(|rest| rest.split(')').next().unwrap()).collect();
    for link in &links {
        assert!(commands.join(link).is_file(), "{link}");
    }
    for testbench in TESTBENCHES {
        let view = format!("../../../waves/{}.gtkw", testbench.name);
        assert!(links.contains(&&*view), "{view} is in no row");
    }
}
