//! `--block p_counter=FILE` and the key `p_counter_block`.

use super::{folder, gdtof, refused, replay};
use crate::yosys;

use std::path::Path;

use guided_dtof::chip::{PCounter, SensorConfig, p_counter};
use sha2::{Digest, Sha256};

const LFSR: &str = include_str!("../../../examples/blocks/lfsr_p_counter.json");

/// The counter with the given number of cells more.
fn with_inverters(number: usize) -> String {
    let cell = |n| format!(r#""{n}":{{"type":"$_NOT_","connections":{{"A":[2],"Y":[{n}]}}}},"#);
    let cells: String = (1000..1000 + number).map(cell).collect();
    LFSR.replacen(r#""cells": {"#, &format!(r#""cells": {{{cells}"#), 1)
}

/// The same testbench drives a netlist of one's own; it fails, with its waveform, where the netlist does something else.
#[test]
fn testbenches_drive_blocks_of_ones_own() {
    let folder = folder();
    let dir = folder.path();
    std::fs::write(dir.join("lfsr.json"), LFSR).unwrap();
    // The start value is counted from is another one.
    std::fs::write(
        dir.join("doubled.json"),
        LFSR.replace(r#""D": [ 3 ]"#, r#""D": [ 2 ]"#),
    )
    .unwrap();
    for (file, passes) in [("lfsr.json", true), ("doubled.json", false)] {
        let output = gdtof(
            dir,
            &[
                "tb",
                "--verbose",
                "--out",
                file.trim_end_matches(".json"),
                "--block",
                &format!("p_counter={file}"),
            ],
        );
        let said = String::from_utf8_lossy(&output.stdout);
        assert_eq!(output.status.code(), Some(i32::from(!passes)), "{said}");
        assert!(
            said.contains("tb_p_counter") && !said.contains("tb_readout"),
            "{said}"
        );
        let wave = dir
            .join(file.trim_end_matches(".json"))
            .join("tb_p_counter.vcd");
        assert!(
            std::fs::read_to_string(wave)
                .unwrap()
                .contains("COUNTER_CLK")
        );
    }
    let other = ["tb", "readout", "--block", "p_counter=lfsr.json"];
    refused(
        dir,
        &other,
        "readout: does not drive a sensor that is given; give tb_p_counter",
    );
}

#[test]
fn frames_say_what_was_in_the_netlist() {
    let folder = folder();
    let dir = folder.path();
    std::fs::write(dir.join("lfsr.json"), LFSR).unwrap();
    let arguments = "frame --rows 2 --cols 2 --laser-cycles 5 --block p_counter=lfsr.json:lfsr_p_counter --out mine";
    let output = gdtof(dir, &arguments.split(' ').collect::<Vec<_>>());
    assert!(output.status.success(), "{output:?}");
    let report = std::fs::read_to_string(dir.join("mine/frame.json")).unwrap();
    let report: serde_json::Value = serde_json::from_str(&report).unwrap();
    let digest = Sha256::digest(LFSR);
    let digest: String = digest.iter().map(|byte| format!("{byte:02x}")).collect();
    assert_eq!(report["sha256"], serde_json::json!({ "lfsr.json": digest }));
}

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
        ("tristate.json", LFSR.replacen("$_ANDNOT_", "$_TBUF_", 1)),
        ("million.json", with_inverters(1_000_000)),
        ("many.json", with_inverters(100_000)),
        ("lfsr.json", LFSR.to_owned()),
    ] {
        write(name, &text);
    }
    for (block, says) in [
        (
            "tdc=lfsr.json",
            "--block tdc=lfsr.json: is no BLOCK=FILE with a block; give p_counter, correlation, front_end, metdc or histogram",
        ),
        (
            "lfsr.json",
            "--block lfsr.json: is no BLOCK=FILE with a block; give p_counter",
        ),
        ("p_counter=gone.json", "gdtof: gone.json: cannot be read"),
        (
            "p_counter=no.json",
            "gdtof: no.json: is no netlist of Yosys (line 1: it is no JSON); write one with: yosys -p",
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
        (
            "front_end=lfsr.json",
            "lfsr.json: module lfsr_p_counter has other ports than front_end: input SPAD_RAW of 16 bits is missing, ",
        ),
        (
            "metdc=lfsr.json",
            "lfsr.json: module lfsr_p_counter has other ports than metdc: input CLK of 1 bit is missing, input SPAD_EVENT of 1 bit is missing, LOCAL_STOP is an output instead of an input, ",
        ),
        (
            "histogram=lfsr.json",
            "lfsr.json: module lfsr_p_counter has other ports than histogram: input HIT of 16 bits is missing, ",
        ),
        (
            "p_counter=tristate.json",
            "is a $_TBUF_, which has no counterpart here; run synth -flatten; abc -g simple",
        ),
        (
            "p_counter=million.json",
            "million.json: has more than 32 MiB, the most that is read of such a file",
        ),
        (
            "p_counter=many.json",
            "many.json: module lfsr_p_counter has 100",
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
    let file = folder.path().join("no.json");
    let says = format!("gdtof: {}: is no netlist of Yosys", file.display());
    refused(dir, &both, &says);
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

/// A counter of seven bits is tested with its sensor, and not without.
#[test]
fn testbenches_take_the_sensor_of_a_block() {
    let folder = folder();
    let dir = folder.path();
    let seven = SensorConfig {
        counter_bits: 7,
        p_counter: PCounter::Comparator,
        ..SensorConfig::default()
    };
    std::fs::write(
        dir.join("seven.json"),
        yosys::json(&p_counter::circuit(&seven)),
    )
    .unwrap();
    let with_block = ["tb", "--out", "waves", "--block", "p_counter=seven.json"];
    let bits = ["--set", "sensor.counter_bits=7"];
    for arguments in [
        &[&with_block[..], &bits[..]].concat()[..],
        &["tb", "--out", "waves", "--sensor", "hslidar"],
        &[
            "tb",
            "p_counter",
            "--out",
            "waves",
            "--set",
            "sensor.counter_bits=3",
            "--set",
            "sensor.p_counter=gray",
        ],
        &[
            "tb",
            "p_counter",
            "--out",
            "waves",
            "--set",
            "sensor.after_borrow=wrap",
            "--set",
            "sensor.clk_hz=40e6",
        ],
    ] {
        let output = gdtof(dir, arguments);
        let said = String::from_utf8_lossy(&output.stdout);
        assert!(output.status.success(), "{arguments:?}: {output:?}");
        assert!(
            said.contains("tb_p_counter") && !said.contains("tb_readout"),
            "{said}"
        );
    }
    refused(dir, &with_block, "COUNTER_INIT has 7 bits instead of 9");
    let memoryless = "sensor.p_counter=memoryless";
    let arguments = [
        "tb",
        "p_counter",
        "--set",
        memoryless,
        "--set",
        "sensor.tap=msb",
        "--set",
        "sensor.after_borrow=wrap",
    ];
    refused(dir, &arguments, "has no reset, which tb_p_counter needs");
    let coarse = [
        "tb",
        "macropixel",
        "--set",
        "sensor.step_periods=8",
        "--set",
        "sensor.bins=8",
    ];
    refused(
        dir,
        &coarse,
        "no two of its windows share any of their 8 bins",
    );
}

/// `timing` and `power` print one area of a block, in um2, where there is a library.
#[test]
fn areas_have_their_unit() {
    let folder = folder();
    let dir = folder.path();
    std::fs::write(dir.join("lfsr.json"), LFSR).unwrap();
    let library = concat!(env!("CARGO_MANIFEST_DIR"), "/vectors/liberty/example.lib");
    let block = ["--block", "p_counter=lfsr.json", "--liberty", library];
    let one = ["timing", "--rows", "1", "--cols", "1"];
    let timing = gdtof(dir, &[&one[..], &block].concat());
    let timing = String::from_utf8_lossy(&timing.stdout).into_owned();
    let line = timing.lines().find(|line| line.starts_with("area, um2"));
    let line = line.unwrap_or_else(|| panic!("{timing}"));
    let areas: Vec<&str> = line["area, um2".len()..].split_whitespace().collect();
    let short = [
        "--stop-periods",
        "20",
        "--laser-cycles",
        "1",
        "--start",
        "3",
    ];
    let power = gdtof(dir, &[&["power"], &block[..], &short].concat());
    let power = String::from_utf8_lossy(&power.stdout).into_owned();
    let (_, silicon) = power
        .split_once("Area in the cells of example, um2")
        .unwrap_or_else(|| panic!("{power}"));
    let line = silicon.lines().find(|line| line.starts_with("p_counter "));
    let line = line.unwrap_or_else(|| panic!("{silicon}"));
    // The sensor's own block, and the built-in ripple counter that it is compared with.
    let own = line.split_whitespace().nth(1).unwrap();
    assert_eq!(areas.len(), 2, "{areas:?}");
    assert_eq!(areas[0], own, "{line}");
    assert!(
        line.contains(&format!(" {} (", areas[1])),
        "{areas:?}: {line}"
    );
    let built_in = gdtof(
        dir,
        &[&one[..], &["--block", "p_counter=lfsr.json"]].concat(),
    );
    assert!(String::from_utf8_lossy(&built_in.stdout).contains("\narea, packed transistors "));
}
