//! `gdtof export sdf` and `--sdf`: nominal delays change nothing, others do, bad files are refused.

use std::path::Path;
use std::process::{Command, Output};

const ARRAY: [&str; 4] = ["--rows", "1", "--cols", "2"];
const REPLAY: [&str; 9] = [
    "replay",
    "--inits",
    "inits.csv",
    "--events",
    "events.csv",
    "--stop-periods",
    "60",
    "--laser-cycles",
    "4",
];

fn gdtof(folder: &Path, arguments: &[&str]) -> Output {
    let mut command = Command::new(env!("CARGO_BIN_EXE_gdtof"));
    command.args(arguments).args(ARRAY).current_dir(folder);
    command.output().unwrap()
}

fn replay(folder: &Path, more: &[&str]) -> Output {
    gdtof(folder, &[&REPLAY[..], more].concat())
}

fn folder() -> tempfile::TempDir {
    let folder = tempfile::tempdir().unwrap();
    let mut events = "time_fs,row,col,spad\n".to_owned();
    for i in 0..200i64 {
        events += &format!("{},0,{},{}\n", 1_000_000 + i * 2_777_777, i % 2, i % 16);
    }
    std::fs::write(folder.path().join("events.csv"), events).unwrap();
    let inits = "row,col,init\n0,0,20\n0,1,30\n";
    std::fs::write(folder.path().join("inits.csv"), inits).unwrap();
    folder
}

#[test]
fn an_exported_file_changes_nothing_and_a_slower_one_does() {
    let folder = folder();
    let here = folder.path();
    for (divider, timescale) in [("dot", "fs"), ("slash", "ps")] {
        let export = ["export", "sdf", "--out", "d.sdf", "--divider", divider];
        let written = gdtof(here, &[&export[..], &["--timescale", timescale]].concat());
        assert!(written.status.success(), "{written:?}");
        let plain = replay(here, &["--engine", "gate"]);
        let same = replay(here, &["--engine", "gate", "--sdf", "d.sdf"]);
        assert!(plain.status.success() && same.status.success(), "{same:?}");
        assert_eq!(plain.stdout, same.stdout);
        assert!(String::from_utf8_lossy(&same.stderr).contains("0 wires and"));
        let slower = "(DELAYFILE (TIMESCALE 1ps) (CELL (CELLTYPE \"DFFR\") (INSTANCE *)
            (DELAY (INCREMENT (IOPATH (posedge CK) Q (300))))))";
        std::fs::write(here.join("slower.sdf"), slower).unwrap();
        let slow = replay(here, &["--engine", "gate", "--sdf", "slower.sdf"]);
        assert_ne!(plain.stdout, slow.stdout, "{slow:?}");
    }
}

#[test]
fn delays_of_zero_and_a_cell_twice_are_told() {
    let folder = folder();
    let here = folder.path();
    let cell = |name: &str, delay: &str| {
        format!(
            "(CELL (CELLTYPE \"DFFR\") (INSTANCE mp_r0_c0.metdc.{name})\n(DELAY (ABSOLUTE (IOPATH (posedge CK) Q ({delay})))))\n"
        )
    };
    let said = |cells: &[String]| {
        let text = format!("(DELAYFILE (TIMESCALE 1ps)\n{})", cells.concat());
        std::fs::write(here.join("odd.sdf"), text).unwrap();
        let output = replay(here, &["--engine", "gate", "--sdf", "odd.sdf"]);
        assert!(output.status.success(), "{output:?}");
        String::from_utf8(output.stderr).unwrap()
    };
    let [zero, some] = [("hit_0", "0"), ("hit_1", "90")].map(|(name, delay)| cell(name, delay));
    let all = said(std::slice::from_ref(&zero));
    assert!(
        all.contains("odd.sdf:3: every delay is zero, so that gates switch at once"),
        "{all}"
    );
    let mixed = said(&[some.clone(), zero]);
    assert!(
        mixed.contains("odd.sdf:5: 1 of 2 delays are zero"),
        "{mixed}"
    );
    let twice = said(&[some.clone(), cell("hit_1", "80")]);
    assert!(
        twice.contains(
            "odd.sdf:4: delays of a cell are given again, after line 2, and the last ones count"
        ),
        "{twice}"
    );
    let once = said(&[some]);
    assert!(!once.contains("zero") && !once.contains("again"), "{once}");
}

/// Paths of the flip-flops that break a limit, as the JSON of the checks has them.
fn violating(here: &Path, sdf: &[&str]) -> Vec<String> {
    let checks = ["--checks", "report", "--checks-json", "c.json"];
    let arguments = [&["--engine", "gate"][..], sdf, &checks].concat();
    let output = replay(here, &arguments);
    assert!(output.status.success(), "{output:?}");
    let text = std::fs::read_to_string(here.join("c.json")).unwrap();
    let report: serde_json::Value = serde_json::from_str(&text).unwrap();
    let violations = report["violations"].as_array().unwrap().iter();
    let by_fault = violations.filter(|v| v["is_asynchronous"] == false);
    by_fault
        .map(|v| {
            format!(
                "{} {}",
                v["kind"].as_str().unwrap(),
                v["cell"].as_str().unwrap()
            )
        })
        .collect()
}

#[test]
fn a_setup_tightened_on_one_instance_makes_that_one_violate() {
    let folder = folder();
    let here = folder.path();
    assert_eq!(violating(here, &[]), [""; 0]);
    let cell = "mp_r0_c1.metdc.shift_3";
    let tight = format!(
        "(DELAYFILE (TIMESCALE 1ps) (CELL (CELLTYPE \"DFFR\") (INSTANCE {cell})
            (TIMINGCHECK (SETUP D (posedge CK) (2800)))))"
    );
    std::fs::write(here.join("tight.sdf"), tight).unwrap();
    let found = violating(here, &["--sdf", "tight.sdf"]);
    let is_it = |v: &String| v.starts_with("setup ") && v.ends_with(&format!(".{cell}"));
    assert!(!found.is_empty() && found.iter().all(is_it), "{found:?}");
}

#[test]
fn bad_delay_files_are_refused_in_one_sentence() {
    let folder = folder();
    let here = folder.path();
    std::fs::write(
        here.join("bad.sdf"),
        "(DELAYFILE\n(CELL (CELLTYPE \"INV\") (INSTANCE nobody)))",
    )
    .unwrap();
    let of_shift = |divider: &str, path: &str| {
        format!("(DELAYFILE (DIVIDER {divider})\n(CELL (CELLTYPE \"DFFR\") (INSTANCE {path})))")
    };
    let slashes = of_shift(".", "mp_r0_c1/metdc/shift_3");
    std::fs::write(here.join("slashes.sdf"), slashes).unwrap();
    let below = of_shift("/", "tb/dut/mp_r0_c1/metdc/shift_3");
    std::fs::write(here.join("below.sdf"), below).unwrap();
    for (more, says) in [
        (
            &["--engine", "gate", "--sdf", "bad.sdf"][..],
            "bad.sdf:2: the chip has no instance nobody",
        ),
        (
            &["--engine", "gate", "--sdf", "slashes.sdf"],
            "slashes.sdf:2: the chip has no instance mp_r0_c1/metdc/shift_3, but has mp_r0_c1.metdc.shift_3; give paths below its top and the right DIVIDER",
        ),
        (
            &["--engine", "gate", "--sdf", "below.sdf"],
            "no instance tb.dut.mp_r0_c1.metdc.shift_3, but has mp_r0_c1.metdc.shift_3;",
        ),
        (
            &["--engine", "gate", "--sdf", "none.sdf"],
            "none.sdf: cannot be read",
        ),
        (&["--engine", "window", "--sdf", "bad.sdf"], "--engine gate"),
    ] {
        let output = replay(here, more);
        let error = String::from_utf8(output.stderr).unwrap();
        assert_eq!(output.status.code(), Some(2), "{error}");
        assert!(
            error.contains(says) && error.trim_end().lines().count() == 1,
            "{error}"
        );
    }
    let missing = gdtof(here, &["export", "sdf", "--out", "no/d.sdf"]);
    assert_eq!(missing.status.code(), Some(2));
    assert!(!here.join("no").exists());
}

/// One sentence for each way in which a file may be of no use.
#[test]
fn files_of_which_nothing_is_used_are_refused() {
    let folder = folder();
    let here = folder.path();
    let flip_flops = |kind: &str, body: &str| {
        format!("(DELAYFILE (TIMESCALE 1ns)\n(CELL (CELLTYPE \"{kind}\") (INSTANCE *) {body}))")
    };
    let delay = |kind: &str, body: &str| flip_flops(kind, &format!("(DELAY (ABSOLUTE {body}))"));
    let path = |values: &str| delay("DFFR", &format!("(IOPATH CK Q {values})"));
    let limit = |values: &str| flip_flops("DFFR", &format!("(TIMINGCHECK (SETUP D CK {values}))"));
    for (text, says) in [
        ("(DELAYFILE (TIMESCALE 1ns))".to_owned(), "it has no CELL"),
        (flip_flops("DFFR", ""), "neither delays nor timing checks"),
        (
            flip_flops("DFFR", "(DELAY) (TIMINGCHECK)"),
            "neither delays nor timing checks",
        ),
        (
            path("(0.4::0.6)"),
            "no value for typ, the sensor's corner, and has 1 for min (corner fast), 1 for max (corner slow)",
        ),
        (
            path("(::0.6) ()"),
            "and has 1 for max (corner slow); write the file with all three, or set sensor.corner=slow",
        ),
        (
            limit("(0.1::)"),
            "and has 1 for min (corner fast); write the file with all three, or set sensor.corner=fast",
        ),
        (delay("DFFR", "(PORT CK (0.1::))"), "and has 1 for min"),
        (path("()"), "all of its values are empty"),
        (path("(::) (::)"), "all of its values are empty"),
        (
            delay("DFFR", "(COND R (IOPATH CK Q (0.4)))"),
            "all that its cells have is left out (COND)",
        ),
        (
            flip_flops(
                "DFFR",
                "(TIMINGCHECK (SETUP D (COND R CK) (0.1)) (PERIOD CK (1)))",
            ),
            "all that its cells have is left out (COND, PERIOD)",
        ),
        (
            delay("DFFR", "(PORT D (0.1))"),
            "(wires to D of a flip-flop)",
        ),
        (
            flip_flops("DFFR", "(TIMINGCHECK (SETUP R CK (0.1)))"),
            "(checks of pins or edges that a flip-flop does not act on)",
        ),
        (
            delay("DFFSR", "(IOPATH CK Q (0.4))"),
            "cell types that this chip does not have",
        ),
    ] {
        std::fs::write(here.join("d.sdf"), &text).unwrap();
        let output = replay(here, &["--engine", "gate", "--sdf", "d.sdf"]);
        let error = String::from_utf8(output.stderr).unwrap();
        assert_eq!(output.status.code(), Some(2), "{text}: {error}");
        assert!(
            error.contains("d.sdf: ") && error.contains(says),
            "{text}: {error}"
        );
        assert_eq!(error.trim_end().lines().count(), 1, "{text}: {error}");
        assert!(output.stdout.is_empty(), "{text}");
    }
    // In a corner that it has, the file counts.
    std::fs::write(here.join("d.sdf"), path("(0.4::0.6)")).unwrap();
    let slow = [
        "--engine",
        "gate",
        "--sdf",
        "d.sdf",
        "--set",
        "sensor.corner=slow",
    ];
    let output = replay(here, &slow);
    let said = String::from_utf8(output.stderr).unwrap();
    assert!(
        output.status.success() && !said.contains("no value for"),
        "{said}"
    );
    // Entries without a value for the corner are counted.
    let some = delay("DFFR", "(IOPATH CK Q (0.1)) (IOPATH CK QN (0.1::0.1))");
    std::fs::write(here.join("d.sdf"), some).unwrap();
    let output = replay(here, &["--engine", "gate", "--sdf", "d.sdf"]);
    let said = String::from_utf8(output.stderr).unwrap();
    let missing = "1 of 2 entries have no value for typ and leave the library's; the file has 2 for min (corner fast), 1 for typ, 2 for max (corner slow)";
    assert!(output.status.success() && said.contains(missing), "{said}");
}
