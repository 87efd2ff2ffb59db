//! `--block p_counter=FILE` and the key `p_counter_block`.

use super::{folder, gdtof, refused, replay};

use std::path::Path;

const LFSR: &str = include_str!("../../../examples/blocks/lfsr_p_counter.json");

#[test]
fn netlists_are_refused_with_file_and_cure() {
    let folder = folder();
    let dir = folder.path();
    let write = |name: &str, text: &str| std::fs::write(dir.join(name), text).unwrap();
    let port = r#""MEMORY_RESET": {"#;
    assert_eq!(LFSR.matches(port).count(), 2, "a port and a net");
    let two = |attributes: &str| {
        format!(r#"{{"modules": {{"a": {{{attributes}}}, "b": {{{attributes}}}}}}}"#)
    };
    for (name, text) in [
        ("no.json", "module m; endmodule".to_owned()),
        ("none.json", r#"{"modules": {}}"#.to_owned()),
        ("two.json", two("")),
        ("ports.json", LFSR.replacen("MEMORY_RESET", "MINE", 1)),
        ("latch.json", LFSR.replacen("$_ANDNOT_", "$_DLATCH_P_", 1)),
        ("lfsr.json", LFSR.to_owned()),
    ] {
        write(name, &text);
    }
    for (block, says) in [
        (
            "metdc=lfsr.json",
            "--block metdc=lfsr.json: is no block; give p_counter=FILE or correlation=FILE",
        ),
        (
            "lfsr.json",
            "--block lfsr.json: is no block; give p_counter=FILE or correlation=FILE",
        ),
        (
            "p_counter=gone.json",
            "--block p_counter=gone.json: gone.json: ",
        ),
        (
            "p_counter=no.json",
            "--block p_counter=no.json: no.json: is no netlist of Yosys (expected value at line 1 column 1); write one with: yosys -p",
        ),
        (
            "p_counter=none.json",
            "none.json: is no netlist of Yosys (it has no module)",
        ),
        (
            "p_counter=two.json",
            "two.json: has several modules and no top; name one as FILE:MODULE, a or b, or run synth -flatten -top",
        ),
        (
            "p_counter=two.json:c",
            "two.json: has no module c; give a or b",
        ),
        (
            "p_counter=two.json:a",
            "two.json:a: module a has other ports than p_counter: input COUNTER_INIT of 9 bits is missing",
        ),
        (
            "p_counter=ports.json",
            "ports.json: module lfsr_p_counter has other ports than p_counter: input MEMORY_RESET of 1 bit is missing, input MINE is too much",
        ),
        (
            "p_counter=latch.json",
            "is a $_DLATCH_P_, a latch, which has no counterpart here; write it as a flip-flop",
        ),
        (
            "correlation=lfsr.json",
            "lfsr.json: module lfsr_p_counter has other ports than correlation: input SPAD_TIMED of 16 bits is missing, ",
        ),
    ] {
        refused(dir, &["timing", "--block", block], says);
        refused(dir, &["frame", "--block", block], says);
    }
    let bits = [
        "timing",
        "--block",
        "p_counter=lfsr.json",
        "--set",
        "sensor.counter_bits=7",
    ];
    refused(
        dir,
        &bits,
        "lfsr.json: module lfsr_p_counter has other ports than p_counter: COUNTER_INIT has 9 bits instead of 7",
    );
    // In a sensor file it is beside that file.
    std::fs::create_dir(dir.join("chips")).unwrap();
    write("chips/s.toml", "bins = 8\np_counter_block = \"two.json\"\n");
    let file = Path::new("chips").join("two.json").display().to_string();
    refused(
        dir,
        &["timing", "--sensor", "chips/s.toml"],
        &format!("chips/s.toml:2: {file}: cannot be read"),
    );
    let both = [
        "timing",
        "--sensor",
        "chips/s.toml",
        "--block",
        "p_counter=no.json",
    ];
    refused(dir, &both, "--block p_counter=no.json: ");
}

#[test]
fn a_counter_without_a_law_is_replayed_by_gates_and_cycles_and_aims_nothing() {
    let folder = folder();
    let dir = folder.path();
    // The memory's second bit takes the first one's input.
    let from = r#""D": [ 3 ]"#;
    assert_eq!(LFSR.matches(from).count(), 1);
    std::fs::write(
        dir.join("doubled.json"),
        LFSR.replace(from, r#""D": [ 2 ]"#),
    )
    .unwrap();
    refused(
        dir,
        &["frame", "--block", "p_counter=doubled.json"],
        "COUNTER_INIT 0 and 2 raise LOCAL_STOP with the same edge of COUNTER_CLK: no window law describes this P-counter, so the guide cannot aim time windows; give a P-counter that raises LOCAL_STOP once, a step later from each start value on",
    );
    let replay = |engine| {
        let out = if engine == "gate" {
            "gate.csv"
        } else {
            "cycle.csv"
        };
        let own = ["--block", "p_counter=doubled.json"];
        replay(&[&own[..], &["--engine", engine, "--out", out]].concat())
    };
    refused(
        dir,
        &replay("window"),
        "use --engine cycle or gate, or give a P-counter",
    );
    for engine in ["gate", "cycle"] {
        let output = gdtof(dir, &replay(engine));
        assert!(output.status.success(), "{output:?}");
    }
    let read = |name| std::fs::read(dir.join(name)).unwrap();
    assert_eq!(read("gate.csv"), read("cycle.csv"));
}
