//! A library says the same however it is written, and what is not used of it is told.

use crate::command::gdtof;

use std::fs;
use std::io::Write;
use std::path::Path;

use flate2::{Compression, write::GzEncoder};

/// The library of invented numbers.
fn example() -> String {
    let here = Path::new(env!("CARGO_MANIFEST_DIR"));
    fs::read_to_string(here.join("vectors/liberty/example.lib")).unwrap()
}

/// The same library with comments behind values, continued strings, groups of several pins, variables and colons in names.
fn rewritten(text: &str) -> String {
    let mut lines: Vec<String> = Vec::new();
    for line in text.lines() {
        let value = line
            .strip_suffix(';')
            .and_then(|line| line.split_once(" : "));
        let line = match value {
            Some((name, value)) if value.starts_with('"') => {
                format!("{name} : \"\\\n{};", &value[1..])
            }
            Some((name, value)) if !value.contains([':', ';', '{']) => {
                format!("{name} : {value} /* no }} part; \"of it */;")
            }
            _ => line.to_owned(),
        };
        let before = lines.last().cloned().unwrap_or_default();
        // Two pins that are alike are one group.
        let pin = |line: &str| {
            let (name, rest) = line.strip_prefix("    pin (")?.split_once(')')?;
            rest.ends_with('}')
                .then(|| (name.to_owned(), rest.to_owned()))
        };
        match (pin(&before), pin(&line)) {
            (Some((first, a)), Some((second, b))) if a == b => {
                lines.pop();
                lines.push(format!("    pin ({first}, {second}){a}"));
            }
            _ => lines.push(line),
        }
    }
    let head = "library (example) {\n  VDD = 1.1;\n  define_cell_area (a:b, c[3:0]);\n  comment : \"a \\\"quoted\\\" word\";";
    let text = lines.join("\n").replacen("library (example) {", head, 1) + ";\n";
    let counts = ["/* no", "\"\\\n", "pin (A, B)", "VDD ="].map(|odd| text.matches(odd).count());
    assert!(counts.iter().all(|&count| count > 0), "{counts:?}");
    text
}

/// Delays and limits of a macropixel, and its netlist in library cells.
fn outcome(folder: &Path, library: &str) -> Vec<String> {
    let exports: [&[&str]; 2] = [
        &["sdf", "--rows", "1", "--cols", "1", "--out", "d.sdf"],
        &["verilog", "--mapped", "--out", "m"],
    ];
    for arguments in exports {
        let output = gdtof(
            folder,
            &[&["export"], arguments, &["--liberty", library]].concat(),
        );
        let said = String::from_utf8_lossy(&output.stderr);
        assert!(output.status.success(), "{library}: {said}");
    }
    let files = ["d.sdf", "m/mapped.v", "m/mapped.sdf", "m/mapped_cells.v"];
    files
        .map(|file| fs::read_to_string(folder.join(file)).unwrap())
        .into()
}

#[test]
fn comments_strings_names_and_bytes_change_nothing() {
    let folder = tempfile::tempdir().unwrap();
    let here = folder.path();
    let plain = example();
    let odd = rewritten(&plain);
    let member = |text: &str| {
        let mut packer = GzEncoder::new(Vec::new(), Compression::fast());
        packer.write_all(text.as_bytes()).unwrap();
        packer.finish().unwrap()
    };
    let (first, second) = odd.split_at(odd.len() / 2);
    let latin_1 = [&b"/* 50 \xb0C */\n"[..], odd.as_bytes()].concat();
    let marked = format!("\u{feff}{odd}");
    fs::write(here.join("plain.lib"), &plain).unwrap();
    fs::write(here.join("latin_1.lib"), latin_1).unwrap();
    fs::write(here.join("marked.lib"), marked.replace('\n', "\r\n")).unwrap();
    fs::write(
        here.join("members.lib.gz"),
        [member(first), member(second)].concat(),
    )
    .unwrap();
    let wanted = outcome(here, "plain.lib");
    assert!(wanted[0].contains("(SETUP"));
    for library in ["latin_1.lib", "marked.lib", "members.lib.gz"] {
        assert!(outcome(here, library) == wanted, "{library}");
    }
}

#[test]
fn cells_that_are_passed_over_are_listed_with_the_reason() {
    let folder = tempfile::tempdir().unwrap();
    let pins = |names: &[&str]| {
        let pin = |name: &&str| format!("pin ({name}) {{ direction : input; }} ");
        names.iter().map(pin).collect::<String>()
    };
    let output = |function: &str| format!("pin (Y) {{ direction : output; {function} }}");
    let cells = [
        (
            "LATCH",
            "latch (IQ, IQN) { enable : G; }".to_owned(),
            "it has a latch",
        ),
        ("BUSED", "bus (A) { }".to_owned(), "it has a bus"),
        ("FILL", String::new(), "it has no output"),
        (
            "TIE",
            output("function : \"1\";"),
            "it has 0 inputs; gates have 1 to 6",
        ),
        (
            "SPARE",
            "dont_use : true;".to_owned() + &pins(&["A"]) + &output("function : \"!A\";"),
            "it is marked dont_use",
        ),
        (
            "OPEN",
            pins(&["A"]) + &output(""),
            "output Y has no function",
        ),
        (
            "OTHER",
            pins(&["A"]) + &output("function : \"!B\";"),
            "the function \"!B\" of Y is none of its inputs",
        ),
        (
            "TRI",
            pins(&["A", "E"]) + &output("function : \"A\"; three_state : \"E\";"),
            "pin Y is a three-state output",
        ),
        (
            "PAD",
            "pin (P) { direction : inout; }".to_owned() + &output("function : \"1\";"),
            "pin P has the direction inout",
        ),
        (
            "TWICE",
            pins(&["A", "A"]) + &output("function : \"A\";"),
            "pin A is given twice",
        ),
        (
            "SEQ",
            pins(&["D", "EN", "CK"])
                + "ff (IQ, IQN) { next_state : \"D ^ EN ^ IQ\"; clocked_on : \"CK\"; }"
                + &output("function : \"IQ\";"),
            "its next_state is \"D ^ EN ^ IQ\" and not one pin, whatever the others are tied to",
        ),
        (
            "GATED",
            pins(&["D", "EN", "CK"])
                + "ff (IQ, IQN) { next_state : \"D\"; clocked_on : \"CK EN\"; }"
                + &output("function : \"IQ\";"),
            "its clocked_on is \"CK EN\" and not one pin",
        ),
        (
            "HIDDEN",
            pins(&["D", "CK"])
                + "ff (IQ, IQN) { next_state : \"D\"; clocked_on : \"CK\"; }"
                + &output("function : \"D\";"),
            "no output shows its state",
        ),
        (
            "INV_1",
            pins(&["A"]) + &output("function : \"A\";"),
            "line 31 has a cell of this name, which counts",
        ),
    ];
    let mut library = example().trim_end().strip_suffix('}').unwrap().to_owned();
    let first = library.lines().count() + 1;
    for (name, contents, _) in &cells {
        library += &format!("cell ({name}) {{ {contents} }}\n");
    }
    fs::write(folder.path().join("odd.lib"), library + "}\n").unwrap();
    let explain = [
        "timing",
        "--explain",
        "--json",
        "--rows",
        "1",
        "--cols",
        "1",
        "--liberty",
        "odd.lib",
    ];
    let output = gdtof(folder.path(), &explain);
    let said = String::from_utf8_lossy(&output.stderr);
    assert!(output.status.success(), "{said}");
    let report: serde_json::Value = serde_json::from_slice(&output.stdout).unwrap();
    let listed = report["passed_over"].as_array().unwrap().iter();
    let listed = listed.map(|row| {
        let text = |key: &str| row[key].as_str().unwrap().to_owned();
        (
            text("cell"),
            text("file"),
            row["line"].as_f64().unwrap() as usize,
            text("why"),
        )
    });
    let wanted = (first..).zip(&cells);
    let wanted = wanted.map(|(line, (name, _, why))| {
        (
            name.to_string(),
            "odd.lib".to_owned(),
            line,
            why.to_string(),
        )
    });
    assert_eq!(listed.collect::<Vec<_>>(), wanted.collect::<Vec<_>>());
    let kinds = report["library_cells"].as_array().unwrap();
    assert!(
        kinds
            .iter()
            .any(|row| row["kind"] == "NOR2" && row["cells"] == "NOR2_1"),
        "{kinds:?}"
    );

    // A library that lacks something says what might have been it.
    let cut = example().replace("preset : \"!SN\";", "preset : \"!SN & D\";");
    fs::write(folder.path().join("cut.lib"), cut).unwrap();
    let output = gdtof(folder.path(), &["timing", "--liberty", "cut.lib"]);
    let said = String::from_utf8_lossy(&output.stderr);
    assert_eq!(output.status.code(), Some(2), "{said}");
    assert!(
        said.contains("; cut.lib:")
            && said.contains(": DFFSRN_1 is not used: its preset is \"!SN & D\" and not one pin"),
        "{said}"
    );

    let output = gdtof(folder.path(), &["timing", "--explain"]);
    let said = String::from_utf8_lossy(&output.stderr);
    assert_eq!(output.status.code(), Some(2), "{said}");
    assert!(said.contains("add --liberty FILE"), "{said}");
}
