//! Bad input to the command line: one sentence on standard error that names what is wrong, exit status 2, no
//! output file, no panic.

use std::path::Path;
use std::process::{Command, Output};

use proptest::prelude::*;

const INITS: &str = "row,col,init\n0,0,20\n0,1,30\n";
const EVENTS: &str = "time_fs,row,col,spad\n20000000,0,0,3\n";

fn gdtof(folder: &Path, arguments: &[&str]) -> Output {
    Command::new(env!("CARGO_BIN_EXE_gdtof"))
        .args(arguments)
        .current_dir(folder)
        .output()
        .unwrap()
}

fn refused(folder: &Path, arguments: &[&str], says: &str) {
    let before = std::fs::read_dir(folder).unwrap().count();
    let output = gdtof(folder, arguments);
    let error = String::from_utf8(output.stderr).unwrap();
    assert_eq!(output.status.code(), Some(2), "{arguments:?}: {error}");
    assert!(
        error.contains(says),
        "{arguments:?}: {error:?} does not say {says:?}"
    );
    assert_eq!(
        error.trim_end().lines().count(),
        1,
        "{arguments:?}: {error}"
    );
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
fn with<'a>(arguments: &[&'a str], option: &str, value: &'a str) -> Vec<&'a str> {
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
            "unknown.toml:2: unknown field `colour`",
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
            with(&replay(&[]), "--inits", "twice.csv"),
            "twice.csv:4: macropixel (0, 0) already has",
        ),
        (
            with(&replay(&[]), "--inits", "big.csv"),
            "big.csv:2: start value 512",
        ),
        (
            with(&replay(&[]), "--inits", "missing.csv"),
            "missing.csv: macropixel (0, 1) has no",
        ),
        (
            with(&replay(&[]), "--inits", "none.csv"),
            "none.csv: cannot be read",
        ),
        (with(&replay(&[]), "--inits", "."), ".: cannot be read"),
        (
            with(&replay(&[]), "--events", "outside.csv"),
            "outside.csv:2: macropixel (0, 2) is outside",
        ),
        (
            with(&replay(&[]), "--events", "early.csv"),
            "early.csv:3: an event at -5 fs",
        ),
        (
            with(&replay(&[]), "--events", "spad.csv"),
            "spad.csv:2: SPAD 16",
        ),
        (with(&replay(&[]), "--stop-periods", "1"), "--stop-periods"),
        (with(&replay(&[]), "--laser-cycles", "0"), "--laser-cycles"),
        (
            with(&replay(&[]), "--laser-cycles", "4000000000"),
            "--laser-cycles",
        ),
        (
            with(&replay(&[]), "--rows", "0"),
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
            "--mismatch: 0.7 is no relative spread",
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
            replay(&["--mismatch", "0.1", "--engine", "gate", "--checks", "x"]),
            "--checks: takes delays and limits from elsewhere",
        ),
        (
            replay(&["--process", "slow", "--engine", "gate", "--sdf", "d.sdf"]),
            "--sdf: takes delays and limits from elsewhere",
        ),
        (
            vec!["frame", "--scene", "scene_key.toml"],
            "scene_key.toml:3: in [light], unknown field `shade`",
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
            "--probe: \"centre\" is no macropixel",
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

/// Runs a command with little address space: one that fills its memory aborts (status 134) instead of taking ours.
#[cfg(unix)]
fn gdtof_in_a_gigabyte(folder: &Path, arguments: &[&str]) -> Output {
    let mut child = Command::new("sh")
        .args([
            "-c",
            "ulimit -v 1048576; exec \"$0\" \"$@\"",
            env!("CARGO_BIN_EXE_gdtof"),
        ])
        .args(arguments)
        .current_dir(folder)
        .env("RAYON_NUM_THREADS", "2")
        .stdout(std::process::Stdio::piped())
        .stderr(std::process::Stdio::piped())
        .spawn()
        .unwrap();
    // Far longer than a refusal takes: what never ends fails here.
    let begun = std::time::Instant::now();
    while child.try_wait().unwrap().is_none() {
        if begun.elapsed().as_secs() > 60 {
            child.kill().unwrap();
            panic!("{arguments:?} does not end");
        }
        std::thread::sleep(std::time::Duration::from_millis(5));
    }
    child.wait_with_output().unwrap()
}

/// Devices, pipes and binaries in the place of every kind of input file.
#[test]
#[cfg(unix)]
fn input_that_is_no_text_or_never_ends_is_refused_early() {
    let folder = folder();
    let dir = folder.path();
    let status = Command::new("mkfifo").arg(dir.join("pipe")).status();
    assert!(status.unwrap().success());
    // A sparse file of a terabyte of zeros.
    let huge = std::fs::File::create(dir.join("huge")).unwrap();
    huge.set_len(1 << 40).unwrap();
    std::fs::write(dir.join("utf16"), [0xff, 0xfe, b'r', 0]).unwrap();
    let sources = [
        ("/dev/zero", "/dev/zero"),
        ("/dev/urandom", "/dev/urandom"),
        ("pipe", "pipe: is a named pipe"),
        ("huge", "huge"),
        ("utf16", "UTF-16; save it as UTF-8"),
        (".", ".: cannot be read"),
    ];
    for (source, says) in sources {
        let gate = replay(&["--engine", "gate", "--sdf", source]);
        for arguments in [
            with(&replay(&[]), "--inits", source),
            with(&replay(&[]), "--events", source),
            replay(&["--sensor", source]),
            gate,
            vec!["frame", "--scene", source],
            vec!["range", "--format", "tmf8820", "--histograms", source],
        ] {
            let output = gdtof_in_a_gigabyte(dir, &arguments);
            let error = String::from_utf8_lossy(&output.stderr).into_owned();
            assert_eq!(output.status.code(), Some(2), "{arguments:?}: {error}");
            assert!(error.contains(says), "{arguments:?}: {error}");
            assert_eq!(
                error.trim_end().lines().count(),
                1,
                "{arguments:?}: {error}"
            );
            // Not a megabyte of what it found.
            assert!(error.len() < 400, "{arguments:?}: {error}");
        }
    }
}

/// Text without an end through a pipe that the shell has made, and a table that is as long and fine.
#[test]
#[cfg(unix)]
fn endless_text_is_refused_and_long_tables_are_read() {
    let folder = folder();
    let dir = folder.path();
    let fed = |producer: &str, arguments: &[&str]| {
        let command = format!("{producer} | \"$0\" \"$@\"");
        let mut shell = Command::new("sh");
        shell.args(["-c", &command, env!("CARGO_BIN_EXE_gdtof")]);
        shell.args(arguments).current_dir(dir).output().unwrap()
    };
    let events = with(&replay(&[]), "--events", "/dev/stdin");
    let scene = ["frame", "--scene", "/dev/stdin"];
    let captures = ["range", "--format", "tmf8820", "--histograms", "/dev/stdin"];
    for (producer, arguments, says) in [
        ("yes", &events[..], "the header is \"y\""),
        (
            "yes '#'",
            &events[..],
            "nothing but blank lines and comments",
        ),
        ("cat /dev/zero", &events[..], "binary"),
        (
            "yes | tr -d '\\n'",
            &events[..],
            "a line of more than a mebibyte",
        ),
        ("yes 'a = 1'", &scene[..], "may never end"),
        ("yes ' '", &captures[..], "may never end"),
    ] {
        let output = fed(producer, arguments);
        let error = String::from_utf8_lossy(&output.stderr).into_owned();
        assert_eq!(output.status.code(), Some(2), "{producer}: {error}");
        assert!(error.contains(says), "{producer}: {error}");
    }
    // 2.4 MB, from a pipe.
    let table = "(echo time_fs,row,col,spad; yes 20000000,0,0,3 | head -n 150000)";
    let output = fed(table, &events);
    assert!(output.status.success(), "{output:?}");
    assert!(String::from_utf8_lossy(&output.stderr).contains("149999 of 150000 events"));
}

#[test]
fn a_byte_order_mark_is_read_over_everywhere() {
    let folder = folder();
    let dir = folder.path();
    let mark =
        |name: &str, text: &str| std::fs::write(dir.join(name), format!("\u{feff}{text}")).unwrap();
    let plain = gdtof(dir, &replay(&[]));
    mark("inits.csv", INITS);
    mark("events.csv", EVENTS);
    mark("sensor.toml", "rows = 1\r\ncols = 2\r\n");
    let marked = gdtof(dir, &replay(&["--sensor", "sensor.toml"]));
    assert!(marked.status.success(), "{marked:?}");
    assert_eq!(marked.stdout, plain.stdout);
    mark("scene.toml", "[light]\nilluminance_klux = 5\n");
    assert!(
        gdtof(dir, &["scene", "--scene", "scene.toml"])
            .status
            .success()
    );
    mark("captures.json", "[]");
    let captures = [
        "range",
        "--format",
        "tmf8820",
        "--histograms",
        "captures.json",
    ];
    refused(dir, &captures, "has no captures");
}

#[test]
fn set_changes_single_keys_and_names_itself_in_complaints() {
    let folder = folder();
    let dir = folder.path();
    let printed = |arguments: &[&str]| {
        let output = gdtof(dir, arguments);
        assert!(output.status.success(), "{output:?}");
        String::from_utf8(output.stdout).unwrap()
    };
    let has = |text: &str, line: &str| assert!(text.lines().any(|l| l == line), "{line}: {text}");
    std::fs::write(dir.join("s.toml"), "bins = 8\nclk_hz = 200e6\n").unwrap();
    let sensor = printed(&[
        "sensor",
        "--sensor",
        "s.toml",
        "--set",
        "sensor.clk_hz=300 MHz",
        "--set",
        "sensor.p_counter=comparator",
        "--set",
        "sensor.rows=3",
        "--set",
        "sensor.rows=4",
        "--cols",
        "5",
    ]);
    for line in [
        "bins = 8",
        "clk_hz = 300000000.0",
        "p_counter = \"comparator\"",
        "rows = 4",
        "cols = 5",
    ] {
        has(&sensor, line);
    }
    // What is printed is input.
    std::fs::write(dir.join("printed.toml"), &sensor).unwrap();
    assert_eq!(printed(&["sensor", "--sensor", "printed.toml"]), sensor);
    let scene = printed(&[
        "scene",
        "--set",
        "scene.lidar.pde=20 %",
        "--set",
        "scene.stereo.position_m=[0, \"20 cm\", 0]",
        "--set",
        "scene.object.car.reflectivity=0.77",
        "--set",
        "scene.object.1.depth_m=3",
    ]);
    for line in [
        "pde = 0.2",
        "position_m = [0.0, 0.2, 0.0]",
        "reflectivity = 0.77",
        "depth_m = 3.0",
    ] {
        has(&scene, line);
    }
    std::fs::write(dir.join("printed.toml"), &scene).unwrap();
    assert_eq!(printed(&["scene", "--scene", "printed.toml"]), scene);

    let timing = |value| vec!["timing", "--set", value];
    for (arguments, says) in [
        (
            timing("sensor.rows=0"),
            "--set sensor.rows=0: rows = 0 is impossible; give 1 to 256",
        ),
        (
            timing("sensor.clk_hz=8 ns"),
            "--set sensor.clk_hz=8 ns: clk_hz = \"8 ns\" is a time; give a frequency",
        ),
        (
            timing("sensor.clk=8"),
            "--set sensor.clk=8: unknown field `clk`",
        ),
        (timing("sensor.clk_hz"), "has no value; give key=value"),
        (
            timing("clk_hz=3e8"),
            "give sensor.KEY=VALUE or scene.SECTION.KEY=VALUE",
        ),
        (timing("scene.lidar.pde=0.1"), "this command reads no scene"),
        (
            vec!["scene", "--set", "scene.object.bus.reflectivity=1"],
            "there is no object \"bus\"",
        ),
        (
            vec!["scene", "--set", "scene.object.reflectivity=1"],
            "object is a list",
        ),
        (
            vec!["frame", "--set", "scene.light.illuminance_klux=1e5"],
            "illuminance_klux = 100000 is impossible",
        ),
        (
            vec!["frame", "--set", "scene.light.illuminance_klux=700"],
            "the sun with bright clouds about it stays below 150 klux",
        ),
        (
            vec!["frame", "--set", "scene.lidar.solar_irradiance_w_m2=1e6"],
            "the sun has no more outside the atmosphere",
        ),
        (
            vec!["frame", "--set", "scene.lidar.dark_count_hz=1e9"],
            "16 hot SPADs have 10 MHz each",
        ),
        (
            vec!["frame", "--set", "scene.lidar.pulse_energy_uj=1e7"],
            "lasers of flash lidars stay below 1 J a pulse",
        ),
        (
            replay(&["--set", "sensor.bins=0"]),
            "bins = 0 is impossible",
        ),
        (
            vec!["pareto", "--set", "scene.lidar.pde=-1"],
            "in [lidar], pde = -1 is impossible; give 0 to 1",
        ),
    ] {
        refused(dir, &arguments, says);
    }
    let both = gdtof(
        dir,
        &[
            "frame",
            "--set",
            "scene.lidar.pde=2",
            "--set",
            "sensor.bins=0",
        ],
    );
    let error = String::from_utf8(both.stderr).unwrap();
    assert_eq!(
        (both.status.code(), error.lines().count()),
        (Some(2), 2),
        "{error}"
    );
}

#[test]
fn an_existing_result_survives_a_failed_run() {
    let folder = folder();
    let out = folder.path().join("h.csv");
    std::fs::write(&out, "precious").unwrap();
    let arguments = with(&replay(&["--out", "h.csv"]), "--events", "early.csv");
    assert_eq!(gdtof(folder.path(), &arguments).status.code(), Some(2));
    assert_eq!(std::fs::read_to_string(&out).unwrap(), "precious");
}

#[test]
fn all_engines_give_the_same_histograms_in_both_formats() {
    let folder = folder();
    let mut texts = Vec::new();
    for engine in ["gate", "cycle", "window"] {
        let output = gdtof(folder.path(), &replay(&["--engine", engine]));
        assert!(output.status.success(), "{output:?}");
        texts.push(String::from_utf8(output.stdout).unwrap());
        let npy = format!("{engine}.npy");
        let output = gdtof(folder.path(), &replay(&["--engine", engine, "--out", &npy]));
        assert!(
            output.status.success() && output.stdout.is_empty(),
            "{output:?}"
        );
    }
    assert!(
        texts[0].lines().any(|l| l.ends_with(",1")),
        "nothing was counted"
    );
    assert!(texts.iter().all(|t| *t == texts[0]));
    let bytes = |engine: &str| std::fs::read(folder.path().join(format!("{engine}.npy"))).unwrap();
    assert_eq!(bytes("gate"), bytes("cycle"));
    assert_eq!(bytes("gate"), bytes("window"));
    let gate = bytes("gate");
    let array = npyz::NpyFile::new(&gate[..]).unwrap();
    assert_eq!(array.shape(), [1, 2, 16]);
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
            0 => with(&replay(&[]), "--inits", "garbage"),
            1 => with(&replay(&[]), "--events", "garbage"),
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

/// A reader that stops early, such as `head`, ends the command quietly.
#[test]
fn a_closed_pipe_is_no_crash() {
    let folder = folder();
    let mut child = Command::new(env!("CARGO_BIN_EXE_gdtof"))
        .args(replay(&[]))
        .current_dir(folder.path())
        .stdout(std::process::Stdio::piped())
        .stderr(std::process::Stdio::piped())
        .spawn()
        .unwrap();
    drop(child.stdout.take());
    let output = child.wait_with_output().unwrap();
    assert!(
        output.stderr.is_empty(),
        "{}",
        String::from_utf8_lossy(&output.stderr)
    );
    assert!(output.status.success());
}
