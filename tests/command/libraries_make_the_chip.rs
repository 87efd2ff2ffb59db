//! `--liberty` and what follows from it, as one gives them on the command line.

use crate::command::gdtof;

use std::path::Path;

/// The library of invented numbers.
fn example() -> String {
    let here = Path::new(env!("CARGO_MANIFEST_DIR"));
    let file = here.join("vectors/liberty/example.lib");
    file.to_str().unwrap().to_owned()
}

#[test]
fn gates_and_window_count_alike_in_a_librarys_cells() {
    let folder = tempfile::tempdir().unwrap();
    let arguments =
        "frame --rows 4 --cols 4 --laser-cycles 60 --probe 1,2 --quiet --out frame --liberty";
    let mut arguments: Vec<&str> = arguments.split(' ').collect();
    let library = example();
    arguments.push(&library);
    let output = gdtof(folder.path(), &arguments);
    let said = String::from_utf8_lossy(&output.stderr);
    assert!(output.status.success(), "{said}");
    let written = std::fs::read_to_string(folder.path().join("frame/frame.json")).unwrap();
    assert!(written.contains("example.lib"));
    // The waveform of a later cycle is made of the same cells.
    let wave = [
        "wave",
        "--frame",
        "frame/frame.json",
        "--pixel",
        "1,2",
        "--cycle",
        "40",
    ];
    let output = gdtof(folder.path(), &wave);
    assert!(
        output.status.success(),
        "{}",
        String::from_utf8_lossy(&output.stderr)
    );
}

#[test]
fn a_macropixel_is_exported_in_library_cells() {
    let folder = tempfile::tempdir().unwrap();
    let library = example();
    let arguments = [
        "export",
        "verilog",
        "--mapped",
        "--out",
        "m",
        "--liberty",
        &library,
    ];
    let output = gdtof(folder.path(), &arguments);
    assert!(
        output.status.success(),
        "{}",
        String::from_utf8_lossy(&output.stderr)
    );
    let read = |name: &str| std::fs::read_to_string(folder.path().join("m").join(name)).unwrap();
    assert!(read("mapped.v").contains("DFFRN_1"));
    assert!(read("mapped.sdf").contains("(IOPATH CK Q"));
    assert!(read("mapped_cells.v").contains("module DFFRN_1(output Q, input CK, D, RN);"));
    // A clock at both outputs of each of the nine stages that clock the next one, and LOCAL_STOP.
    assert_eq!(
        read("mapped.sdc").matches("create_generated_clock").count(),
        19
    );
}

#[test]
fn libraries_stand_beside_the_thesis() {
    let folder = tempfile::tempdir().unwrap();
    let arguments = ["reproduce", "--liberty", &example(), "--out", "here"];
    let output = gdtof(folder.path(), &arguments);
    let said = String::from_utf8_lossy(&output.stdout);
    let row = said.lines().nth(1).unwrap_or_default();
    let cells: Vec<&str> = row.rsplit("  ").filter(|cell| !cell.is_empty()).collect();
    assert_eq!(
        cells
            .iter()
            .map(|cell| cell.trim())
            .take(3)
            .collect::<Vec<_>>(),
        ["1.11", "1.20", "1.2"]
    );
    let written = std::fs::read_to_string(folder.path().join("here/libraries.csv")).unwrap();
    assert_eq!(written.lines().count(), said.lines().count());
    // Energies of the same library, of every block.
    let output = gdtof(
        folder.path(),
        &[
            "power",
            "--json",
            "--laser-cycles",
            "1",
            "--liberty",
            &example(),
        ],
    );
    let said = String::from_utf8_lossy(&output.stdout);
    let first: serde_json::Value = serde_json::from_str(&said).unwrap();
    let blocks = first[0]["silicon"].as_array().unwrap();
    let energy = |block: &serde_json::Value| {
        block["internal_j"].as_f64().unwrap() + block["loads_j"].as_f64().unwrap()
    };
    let (whole, parts) = blocks.split_last().unwrap();
    let sum: f64 = parts.iter().map(energy).sum();
    assert_eq!(whole["block"], "macropixel");
    assert!(
        sum > 1e-12 && (sum / energy(whole) - 1.0).abs() < 1e-9,
        "{blocks:?}"
    );
}

#[test]
fn what_is_no_library_is_refused_in_a_sentence() {
    let folder = tempfile::tempdir().unwrap();
    let library = example();
    std::fs::write(
        folder.path().join("cut.lib"),
        "library (cut) {\n  cell (INV) {\n",
    )
    .unwrap();
    std::fs::write(
        folder.path().join("empty.lib"),
        "library (none) { capacitive_load_unit (1, pf); }\n",
    )
    .unwrap();
    let voltage: &[&str] = &["--liberty", &library, "--voltage", "1.0"];
    for (arguments, says) in [
        (
            &["--liberty", "nothing.lib"][..],
            "nothing.lib: cannot be read",
        ),
        (
            &["--liberty", "cut.lib"],
            "cut.lib:3: the cell INV of line 2 has no closing brace",
        ),
        (
            &["--liberty", "empty.lib"],
            "empty.lib:1: the library none has nothing to make a INV from; an inverter would be enough",
        ),
        (
            &["--liberty", &library, "--cell", "DFFR=foo"],
            "has no cell foo that does what DFFR does",
        ),
        (
            &["--liberty", &library, "--cell", "FOO=INV_1"],
            "is not KIND=NAME",
        ),
        (
            &["--liberty", &library, "--set", "sensor.corner=slow"],
            "give liberty_slow, too",
        ),
        (
            voltage,
            "a library is characterised at conditions of its own",
        ),
    ] {
        let output = gdtof(folder.path(), &[&["timing"], arguments].concat());
        let said = String::from_utf8_lossy(&output.stderr);
        assert_eq!(output.status.code(), Some(2), "{arguments:?}: {said}");
        assert!(said.contains(says), "{arguments:?}: {said}");
        assert_eq!(said.lines().count(), 1, "{said}");
    }
    let output = gdtof(folder.path(), &["export", "sdc", "--out", "a.sdc"]);
    assert_eq!(output.status.code(), Some(2));
    assert!(!folder.path().join("a.sdc").exists());
}

/// `example.lib` as a kit: gates in one file, and flip-flops in another.
fn write_kit(folder: &Path) {
    let text = std::fs::read_to_string(example()).unwrap();
    let (head, cells) = text.split_once("  cell (").unwrap();
    let cells: Vec<&str> = cells
        .trim_end()
        .trim_end_matches('}')
        .split("  cell (")
        .collect();
    let file = |is_ours: fn(&str) -> bool| {
        let ours = cells.iter().filter(|cell| is_ours(cell));
        let ours = ours.map(|cell| format!("  cell ({cell}"));
        format!("{head}{}}}", ours.collect::<String>())
    };
    std::fs::write(
        folder.join("gates.lib"),
        file(|cell| !cell.starts_with("DFF")),
    )
    .unwrap();
    let flip_flops = file(|cell| cell.starts_with("DFF")).replace("example", "more");
    std::fs::write(folder.join("flip_flops.lib"), flip_flops).unwrap();
}

#[test]
fn a_kit_of_several_files_is_one_library() {
    let folder = tempfile::tempdir().unwrap();
    write_kit(folder.path());
    let library = example();
    std::fs::write(
        folder.path().join("chip.toml"),
        "liberty = \"gates.lib, flip_flops.lib\"\nliberty_slow = \"gates.lib,flip_flops.lib\"\n",
    )
    .unwrap();
    let slow = "sensor.corner=slow";
    let mut written = Vec::new();
    for arguments in [
        &["--liberty", &library][..],
        &["--liberty", "gates.lib", "--liberty", "flip_flops.lib"],
        &["--liberty", "flip_flops.lib,gates.lib"],
        &["--sensor", "chip.toml"],
        &["--sensor", "chip.toml", "--set", slow],
    ] {
        let out = ["export", "verilog", "--mapped", "--out", "m"];
        let output = gdtof(folder.path(), &[&out[..], arguments].concat());
        let said = String::from_utf8_lossy(&output.stderr);
        assert!(output.status.success(), "{arguments:?}: {said}");
        let read =
            |name: &str| std::fs::read_to_string(folder.path().join("m").join(name)).unwrap();
        written.push(["mapped.v", "mapped.sdf", "mapped.sdc"].map(read));
    }
    assert!(
        written.iter().all(|files| *files == written[0]),
        "not the same"
    );
    let flip_flops = std::fs::read_to_string(folder.path().join("flip_flops.lib")).unwrap();
    let cut = flip_flops.replace("preset : \"!SN\";", "preset : \"!SN & D\";");
    std::fs::write(folder.path().join("cut.lib"), cut).unwrap();
    // One of both is no library, both together with the whole have cells twice, and a cell that has no use is told with its file.
    for (arguments, says) in [
        (
            &["--liberty", "gates.lib"][..],
            "gates.lib:2: the library example has nothing to make a DFFR from; a flip-flop with an asynchronous clear or preset",
        ),
        (
            &["--liberty", "gates.lib", "--liberty", &library],
            "the cell INV_1 is in gates.lib as well",
        ),
        (
            &["--liberty", "gates.lib", "--liberty", "cut.lib"],
            "; cut.lib:148: DFFSRN_1 is not used: its preset is \"!SN & D\" and not one pin",
        ),
        (
            &["--liberty", "gates.lib", "--liberty", "nothing.lib"],
            "nothing.lib: cannot be read",
        ),
    ] {
        let output = gdtof(
            folder.path(),
            &[&["export", "sdc", "--out", "a.sdc"], arguments].concat(),
        );
        let said = String::from_utf8_lossy(&output.stderr);
        assert_eq!(output.status.code(), Some(2), "{arguments:?}: {said}");
        assert!(said.contains(says), "{arguments:?}: {said}");
    }
    // A frame names every file that it depends on.
    let frame = "frame --sensor chip.toml --rows 1 --cols 1 --laser-cycles 1 --probe none --quiet --out frame";
    let output = gdtof(folder.path(), &frame.split(' ').collect::<Vec<_>>());
    assert!(
        output.status.success(),
        "{}",
        String::from_utf8_lossy(&output.stderr)
    );
    let written = std::fs::read_to_string(folder.path().join("frame/frame.json")).unwrap();
    let frame: serde_json::Value = serde_json::from_str(&written).unwrap();
    let hashes = frame["sha256"]
        .as_object()
        .unwrap_or_else(|| panic!("{written}"));
    let hashed = |name: &str| {
        hashes
            .keys()
            .any(|file| file.ends_with(name) && !file.contains(','))
    };
    assert!(
        hashed("/gates.lib") && hashed("/flip_flops.lib"),
        "{hashes:?}"
    );
}

/// What is odd about a library is said by every command that uses it.
#[test]
fn what_a_library_leaves_out_is_told() {
    let folder = tempfile::tempdir().unwrap();
    let text = std::fs::read_to_string(example()).unwrap();
    let scan = text.replace("next_state : \"D\"", "next_state : \"(SE SI) + (!SE D)\"").replace(
        "    pin (D) {",
        "    pin (SE) { direction : input; capacitance : 0.001; } pin (SI) { direction : input; capacitance : 0.001; }\n    pin (D) {",
    );
    // The library's smallest inverter has no delay for its output's fall.
    let (head, inverter) = scan.split_once("cell (INV_1)").unwrap();
    let odd = format!(
        "{head}cell (INV_1){}",
        inverter.replacen("cell_fall", "cell_gone", 1)
    );
    std::fs::write(folder.path().join("odd.lib"), odd).unwrap();
    let output = gdtof(
        folder.path(),
        &["export", "sdc", "--out", "a.sdc", "--liberty", "odd.lib"],
    );
    let said = String::from_utf8_lossy(&output.stderr);
    assert!(output.status.success(), "{said}");
    for says in [
        "DFFSR is made of DFFSRN_1 with pins tied (SE = 0, SI = 0)",
        "odd.lib:31: INV_1 is not used: it has no delay and slew from the rise of A to the fall of Y",
    ] {
        assert!(said.contains(says), "{says}: {said}");
    }
}

/// Of a library nobody says how its delays move with voltage and temperature.
#[test]
fn timing_names_all_clocks_and_no_conditions_of_a_library() {
    let folder = tempfile::tempdir().unwrap();
    let library = example();
    for (arguments, conditions) in [
        (&["timing", "--json"][..], 3),
        (&["timing", "--json", "--liberty", &library], 0),
    ] {
        let output = gdtof(folder.path(), arguments);
        let timing: serde_json::Value = serde_json::from_slice(&output.stdout).unwrap();
        assert_eq!(timing["corners"].as_array().unwrap().len(), conditions);
        let ranges = timing["clk_ranges"].as_array().unwrap();
        assert!(
            ranges.len() > 1 && ranges[0]["from_mhz"].is_null(),
            "{ranges:?}"
        );
        let ends = ranges
            .iter()
            .flat_map(|range| [&range["from_mhz"], &range["to_mhz"]]);
        let ends: Vec<f64> = ends.filter_map(serde_json::Value::as_f64).collect();
        assert!(ends.is_sorted(), "{ends:?}");
        assert!(
            ranges.iter().all(|range| range["check"].is_string()),
            "{ranges:?}"
        );
    }
}
