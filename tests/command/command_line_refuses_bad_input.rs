//! Bad input to the command line: one sentence on standard error that names what is wrong, exit status 2, no
//! output file, no panic.

mod blocks;
mod results;
mod set_option;
mod sources;

use std::path::Path;

use proptest::prelude::*;

use super::tools::gdtof;

const INITS: &str = "row,col,init\n0,0,20\n0,1,30\n";
const EVENTS: &str = "time_fs,row,col,spad\n20000000,0,0,3\n";

fn refused(folder: &Path, arguments: &[&str], says: &str) {
    let before = std::fs::read_dir(folder).unwrap().count();
    let output = gdtof(folder, arguments);
    let error = String::from_utf8(output.stderr).unwrap();
    assert_eq!(output.status.code(), Some(2), "{arguments:?}: {error}");
    assert!(
        error.contains(says),
        "{arguments:?}: {error:?} does not say {says:?}"
    );
    // Notes on the sensor may come before.
    let is_note = |line: &&str| line.ends_with("no window opens from these");
    let sentences = error.trim_end().lines().filter(|line| !is_note(line));
    assert_eq!(sentences.count(), 1, "{arguments:?}: {error}");
    assert!(output.stdout.is_empty(), "{arguments:?}");
    let after = std::fs::read_dir(folder).unwrap().count();
    assert_eq!(before, after, "{arguments:?} left something behind");
}

const REPLAY: [&str; 13] = [
    "replay",
    "--rows",
    "1",
    "--cols",
    "2",
    "--inits",
    "inits.csv",
    "--events",
    "events.csv",
    "--stop-periods",
    "100",
    "--laser-cycles",
    "5",
];

fn replay<'a>(more: &[&'a str]) -> Vec<&'a str> {
    let mut arguments = REPLAY.to_vec();
    arguments.extend_from_slice(more);
    arguments
}

/// Replaces the value of an option.
fn with_value<'a>(arguments: &[&'a str], option: &str, value: &'a str) -> Vec<&'a str> {
    let at = arguments.iter().position(|a| *a == option).unwrap();
    let mut changed = arguments.to_vec();
    changed[at + 1] = value;
    changed
}

fn folder() -> tempfile::TempDir {
    let folder = tempfile::tempdir().unwrap();
    for (name, text) in [
        ("inits.csv", INITS),
        ("events.csv", EVENTS),
        ("unknown.toml", "rows = 2\ncolour = 3\n"),
        ("zero_rows.toml", "# array\nrows = 0\n"),
        ("zero_hz.toml", "clk_hz = 0.0\n"),
        ("nan.toml", "rows = 2\n\nclk_hz = nan\n"),
        ("dead.toml", "dead_time_ns = -3.0\n"),
        ("syntax.toml", "rows = = 2\n"),
        ("slow_corner.toml", "clk_hz = 900e6\n"),
        ("twice.csv", "row,col,init\n0,0,20\n0,1,30\n0,0,21\n"),
        ("big.csv", "row,col,init\n0,0,512\n0,1,30\n"),
        ("missing.csv", "row,col,init\n0,0,1\n"),
        ("outside.csv", "time_fs,row,col,spad\n5,0,2,0\n"),
        ("early.csv", "time_fs,row,col,spad\n5,0,0,0\n-5,0,0,0\n"),
        ("spad.csv", "time_fs,row,col,spad\n5,0,0,16\n"),
        (
            "scene_key.toml",
            "[light]\nilluminance_klux = 5.0\nshade = 1\n",
        ),
        ("scene_empty.toml", ""),
    ] {
        std::fs::write(folder.path().join(name), text).unwrap();
    }
    folder
}

#[test]
fn every_kind_of_bad_input_is_one_sentence_and_status_2() {
    let folder = folder();
    let dir = folder.path();
    let sensor = |file| replay(&["--sensor", file, "--out", "h.csv"]);
    for (arguments, says) in [
        (
            sensor("unknown.toml"),
            "unknown.toml:2: unknown key `colour`",
        ),
        (
            sensor("zero_hz.toml"),
            "zero_hz.toml:1: clk_hz = 0 is impossible",
        ),
        (sensor("nan.toml"), "nan.toml:3: clk_hz = NaN"),
        (sensor("dead.toml"), "dead.toml:1: dead_time_ns = -3"),
        (sensor("syntax.toml"), "syntax.toml:1:"),
        (sensor("none.toml"), "none.toml: cannot be read"),
        (sensor("slow_corner.toml"), "only the gate engine can tell"),
        (
            vec!["frame", "--sensor", "zero_rows.toml"],
            "zero_rows.toml:2: rows = 0 is impossible",
        ),
        (
            with_value(&replay(&[]), "--inits", "twice.csv"),
            "twice.csv:4: macropixel (0, 0) already has",
        ),
        (
            with_value(&replay(&[]), "--inits", "big.csv"),
            "big.csv:2: start value 512",
        ),
        (
            with_value(&replay(&[]), "--inits", "missing.csv"),
            "missing.csv: macropixel (0, 1) has no",
        ),
        (
            with_value(&replay(&[]), "--inits", "none.csv"),
            "none.csv: cannot be read",
        ),
        (with_value(&replay(&[]), "--inits", "."), ".: is a folder"),
        (
            with_value(&replay(&[]), "--events", "outside.csv"),
            "outside.csv:2: macropixel (0, 2) is outside",
        ),
        (
            with_value(&replay(&[]), "--events", "early.csv"),
            "early.csv:3: an event at -5 fs",
        ),
        (
            with_value(&replay(&[]), "--events", "spad.csv"),
            "spad.csv:2: SPAD 16",
        ),
        (
            with_value(&replay(&[]), "--stop-periods", "1"),
            "--stop-periods",
        ),
        (
            with_value(&replay(&[]), "--laser-cycles", "0"),
            "--laser-cycles",
        ),
        (
            with_value(&replay(&[]), "--laser-cycles", "4000000000"),
            "--laser-cycles",
        ),
        (
            with_value(&replay(&[]), "--rows", "0"),
            "--rows: rows = 0 is impossible",
        ),
        (replay(&["--out", "h.txt"]), "neither .npy nor .csv"),
        (
            replay(&["--out", "no/such/folder/h.csv"]),
            "no/such/folder/h.csv: cannot be written",
        ),
        (
            replay(&["--vcd", "x.vcd"]),
            "--vcd x.vcd: only the gate engine has waveforms",
        ),
        (
            replay(&["--engine", "gate", "--vcd", "no/x.vcd"]),
            "no/x.vcd: cannot be written",
        ),
        (
            replay(&["--checks", "report"]),
            "--checks: only the gate engine has timing checks",
        ),
        (
            replay(&["--engine", "gate", "--checks-json", "c.json"]),
            "--checks-json c.json: there are no timing checks",
        ),
        (
            replay(&["--checks-json", "c.json"]),
            "--checks-json c.json: there are no timing checks",
        ),
        (
            replay(&["--mismatch", "0.7"]),
            "--mismatch: 0.7 is not a relative spread",
        ),
        (
            replay(&["--voltage", "0.3"]),
            "--voltage, --temperature: no delays are known there",
        ),
        (
            replay(&["--mismatch", "0.1", "--engine", "cohort"]),
            "the cohort engine knows no single photons",
        ),
        (
            replay(&["--process", "slow", "--engine", "gate", "--sdf", "d.sdf"]),
            "--sdf: takes delays and limits from elsewhere",
        ),
        (
            vec!["frame", "--scene", "scene_key.toml"],
            "scene_key.toml:3: in [light], unknown key `shade`",
        ),
        (
            vec!["frame", "--scene", "scene_empty.toml"],
            "scene_empty.toml",
        ),
        (
            vec!["frame", "--probe", "64,0"],
            "--probe: macropixel (64, 0) is outside",
        ),
        (
            vec!["frame", "--probe", "centre"],
            "--probe: \"centre\" is not a macropixel",
        ),
        (
            vec!["frame", "--out", "inits.csv/x"],
            "inits.csv/x: cannot be written",
        ),
        (vec!["frame", "--laser-cycles", "0"], "--laser-cycles"),
        (
            vec!["frame", "--false-alarm-rate", "0"],
            "give a number above 0, up to 1",
        ),
    ] {
        refused(dir, &arguments, says);
    }
}

proptest! {
    #![proptest_config(ProptestConfig { cases: 48, ..ProptestConfig::default() })]

    /// Whatever is in the files: success or status 2 with one sentence, never a panic (status 101).
    #[test]
    fn garbage_files_never_crash(
        which in 0usize..4,
        garbage in prop::collection::vec(any::<u8>(), 0..200),
        text in "(rows|clk_hz|\\[\\[object\\]\\]|row,col,init|time_fs,row,col,spad|kind)?[ =\n0-9,.eE+\"a-z\\[\\]-]{0,80}",
        as_text: bool,
    ) {
        let folder = folder();
        let bytes = if as_text { text.into_bytes() } else { garbage };
        std::fs::write(folder.path().join("garbage"), bytes).unwrap();
        let arguments = match which {
            0 => with_value(&replay(&[]), "--inits", "garbage"),
            1 => with_value(&replay(&[]), "--events", "garbage"),
            2 => replay(&["--sensor", "garbage"]),
            _ => vec!["frame", "--rows", "2", "--cols", "2", "--laser-cycles", "2", "--scene", "garbage"],
        };
        let output = gdtof(folder.path(), &arguments);
        let error = String::from_utf8_lossy(&output.stderr).into_owned();
        let code = output.status.code();
        prop_assert!(code == Some(0) || code == Some(2), "{:?} {}", code, error);
        if code == Some(2) {
            prop_assert_eq!(error.trim_end().lines().count(), 1, "{}", error);
        }
    }
}
