//! The commands that the book's chapter on libraries prints for OpenSTA, as printed, give the agreement that it states: the ripple of `gdtof timing`, and every arc.
//!
//! They are run with `example.lib` as it is, with a default wire load in it, which OpenSTA would take of itself, and with wires of ours.

use crate::command::gdtof;
use crate::opensta_agrees_on_library_delays::arcs;
use crate::tool;

use std::fs;
use std::path::Path;
use std::process::Command;

/// What stands between a line of three accents and the language, and the next line of accents.
fn printed<'t>(chapter: &'t str, language: &str) -> &'t str {
    let (_, block) = chapter.split_once(&format!("\n```{language}\n")).unwrap();
    block.split("\n```\n").next().unwrap()
}

/// A wire load that every net has, unless SDC says otherwise.
const WIRE_LOAD: &str = "library (example) {
  default_wire_load : \"some\";
  wire_load (\"some\") { resistance : 0; capacitance : 1; area : 1; slope : 0.01; fanout_length (1, 0.01); }";

/// Runs the recipe in a folder of its own; gives the ripple that OpenSTA reports, ns.
fn run(chapter: &str, library: &str, settings: &[&str]) -> f64 {
    let folder = tempfile::tempdir().unwrap();
    let here = folder.path();
    fs::create_dir_all(here.join("vectors/liberty")).unwrap();
    fs::write(here.join("vectors/liberty/example.lib"), library).unwrap();
    let mut lines = printed(chapter, "sh").lines();
    let export = lines.find(|line| line.contains("--mapped")).unwrap();
    let words: Vec<&str> = export
        .split(' ')
        .skip(1)
        .chain(settings.iter().copied())
        .collect();
    let exported = gdtof(here, &words);
    assert!(exported.status.success(), "{exported:?}");
    fs::write(here.join("recipe.tcl"), printed(chapter, "tcl")).unwrap();
    let output = Command::new("sta")
        .args(["-no_splash", "-exit", "recipe.tcl"])
        .current_dir(here)
        .output()
        .unwrap();
    let said = String::from_utf8_lossy(&output.stdout);
    assert!(
        !said.contains("Error") && !said.contains("Warning"),
        "{said}"
    );

    let text = |file: &str| fs::read_to_string(here.join(file)).unwrap();
    let (ours, theirs) = (
        arcs(&text("mapped/mapped.sdf"), 1.0),
        arcs(&text("sta.sdf"), 1e3),
    );
    let (mut compared, mut of_controls) = (0, 0);
    for (arc, own) in &ours {
        for (own, other) in own
            .iter()
            .zip(theirs.get(arc).unwrap_or_else(|| panic!("no {arc:?}")))
        {
            let (Some(own), Some(other)) = (own, other) else {
                continue;
            };
            // Arcs of pins at a constant have none there.
            if *other == 0.0 {
                continue;
            }
            compared += 1;
            of_controls += usize::from(["RN", "SN"].contains(&&*arc.1));
            let apart = (own - other).abs();
            assert!(
                apart <= f64::max(1.0, 0.005 * other),
                "{arc:?}: {own} ps, OpenSTA {other}"
            );
        }
    }
    assert!(
        compared > 5000 && of_controls > 300,
        "{compared}, {of_controls}"
    );

    // From CLK's fall to the rise of the last flip-flop, in the path that the book shows.
    let time = |what: &str| {
        let mut lines = said.lines().filter(|line| line.contains(what));
        let line = lines.next().unwrap_or_else(|| panic!("no {what}: {said}"));
        line.split_whitespace()
            .nth(1)
            .unwrap()
            .parse::<f64>()
            .unwrap()
    };
    time("^ macropixel__p_counter__borrow__1/Q (")
        - time("clock macropixel__p_counter__borrow__1/Q (rise edge)")
}

/// The latest ripple by `gdtof timing`, ns.
fn ripple(library: &str, settings: &[&str]) -> f64 {
    let folder = tempfile::tempdir().unwrap();
    fs::write(folder.path().join("cells.lib"), library).unwrap();
    // An array of one macropixel takes a third of the time.
    let one = ["--rows", "1", "--cols", "1"];
    let arguments = [&["timing", "--json", "--liberty", "cells.lib"], &one[..]].concat();
    let output = gdtof(folder.path(), &[&arguments[..], settings].concat());
    assert!(output.status.success(), "{output:?}");
    let report: serde_json::Value = serde_json::from_slice(&output.stdout).unwrap();
    let mut rows = report["windows"].as_array().unwrap().iter();
    let row = rows
        .find(|row| row["from,_to"].as_str().unwrap().contains("(ripple)"))
        .unwrap();
    row["longest"].as_f64().unwrap() * 1e-3
}

#[test]
fn by_the_commands_that_it_prints() {
    if !tool::is_here("sta", "the book's commands for OpenSTA were not run") {
        return;
    }
    let book = Path::new(env!("CARGO_MANIFEST_DIR")).join("docs/src/libraries.md");
    let chapter = fs::read_to_string(book).unwrap();
    let plain = crate::scenario::example_library();
    let plain = fs::read_to_string(plain).unwrap();
    let loaded = plain.replacen("library (example) {", WIRE_LOAD, 1);
    let mut ripples = Vec::new();
    for (library, settings) in [
        (&plain, &[][..]),
        (&loaded, &[]),
        (&loaded, &["--set", "sensor.wire_ff=0.7"]),
    ] {
        let (theirs, ours) = (run(&chapter, library, settings), ripple(library, settings));
        assert!(
            (theirs - ours).abs() < 2e-3,
            "{settings:?}: {ours} ns, OpenSTA {theirs}"
        );
        ripples.push(theirs);
    }
    let stated = format!("{:.4} ns after CLK's fall", ripples[0]);
    assert!(
        chapter.replace('\n', " ").contains(&stated),
        "the book does not say {stated}"
    );
    assert!(
        ripples[1] == ripples[0] && ripples[2] > 1.1 * ripples[0],
        "{ripples:?}"
    );
}
