//! Scenes and sensors from which users start: nine tenths of what they have in reach gets a depth, the laser is safe for eyes and timing is met. And
//! their names work wherever a file does.

use std::path::Path;
use std::process::Command;

use serde_json::Value as Json;

/// The standard output of a command that succeeds.
fn said(folder: &Path, arguments: &str) -> String {
    let output = Command::new(env!("CARGO_BIN_EXE_gdtof"))
        .args(arguments.split(' '))
        .current_dir(folder)
        .output()
        .unwrap();
    assert!(output.status.success(), "{arguments}: {output:?}");
    String::from_utf8(output.stdout).unwrap()
}

/// Surfaces up to `reach_m`, and how many of them have a depth.
fn in_reach(frame: &Json, reach_m: f64) -> (usize, usize) {
    let macropixels = frame["macropixels"].as_array().unwrap();
    let is_in_reach = |pixel: &&Json| pixel["true_m"].as_f64().is_some_and(|m| m <= reach_m);
    let in_reach: Vec<&Json> = macropixels.iter().filter(is_in_reach).collect();
    let with_depth = in_reach.iter().filter(|pixel| pixel["measured_m"].is_f64());
    (in_reach.len(), with_depth.count())
}

#[test]
fn nine_tenths_of_what_is_in_reach_have_a_depth() {
    let folder = tempfile::tempdir().unwrap();
    // The street's windows are shorter than the guide's uncertainty far away, and its road reflects little at 2 degrees.
    for (options, reach_m, least) in [
        ("--scene warehouse --sensor vcsel_flash", 35.0, 12_000),
        ("--scene street --sensor quantic4x4", 60.0, 1_500),
    ] {
        let arguments = format!("frame {options} --probe none --json --out frame");
        let frame: Json = serde_json::from_str(&said(folder.path(), &arguments)).unwrap();
        let (surfaces, depths) = in_reach(&frame, reach_m);
        assert!(surfaces > least, "{options}: {surfaces} surfaces");
        let share = depths as f64 / surfaces as f64;
        assert!(share >= 0.9, "{options}: {share}");
        let outliers = frame["summary"]["outlier_share"].as_f64().unwrap();
        assert!(outliers < 0.025, "{options}: {outliers}");
        let of_class_1 = frame["eye_safety"]["times_class_1"].as_f64().unwrap();
        assert!(of_class_1 <= 1.0, "{options}: {of_class_1}");
        assert_eq!(frame["timing"]["met"], true, "{options}");
    }
}

#[test]
fn names_serve_as_files_do() {
    let folder = tempfile::tempdir().unwrap();
    let here = folder.path();
    assert!(said(here, "scene warehouse").contains("name = \"driver\""));
    assert_eq!(
        said(here, "scene warehouse"),
        said(here, "scene --scene warehouse")
    );
    let printed = said(here, "sensor vcsel_flash");
    for line in [
        "rows = 96",
        "cols = 128",
        "bins = 32",
        "clk_hz = 200000000.0",
    ] {
        assert!(printed.lines().any(|printed| printed == line), "{line}");
    }
    let study = "[study]\nkind = \"frame\"\n[fixed]\nsensor = \"vcsel_flash\"\nscene = \"warehouse\"\nsensor.rows = 4\nsensor.cols = 4\n\
                 frame.engine = \"cohort\"\n[vary]\nframe.laser_cycles = [100, 200]\n";
    std::fs::write(here.join("study.toml"), study).unwrap();
    said(here, "sweep study.toml --out results --quiet");
    let table = std::fs::read_to_string(here.join("results/results.csv")).unwrap();
    assert_eq!(table.lines().count(), 3, "{table}");
}
