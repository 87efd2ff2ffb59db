//! Input from anywhere: devices, pipes, binaries, text without an end, byte-order marks.

use std::path::Path;
use std::process::{Command, Output};

use super::{EVENTS, INITS, folder, gdtof, refused, replay, with_value};

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
        ("/dev/zero", "/dev/zero: is a device"),
        ("/dev/urandom", "/dev/urandom: is a device"),
        ("pipe", "pipe: is a named pipe"),
        ("huge", "huge"),
        ("utf16", "UTF-16; save it as UTF-8"),
        (".", ".: is a folder"),
    ];
    for (source, says) in sources {
        let gate = replay(&["--engine", "gate", "--sdf", source]);
        for arguments in [
            with_value(&replay(&[]), "--inits", source),
            with_value(&replay(&[]), "--events", source),
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
    let events = with_value(&replay(&[]), "--events", "/dev/stdin");
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
    mark("wall.obj", "v -9 -9 0\nv 9 -9 0\nv 0 9 0\nf 1 2 3\n");
    // Four spaces are a number of single precision, 1.4e-19.
    mark("wall.pfm", "Pf\n1 1\n-1\n    ");
    for object in [
        "kind = \"mesh\"\ncentre_m = [0, 0, 30]\nfile = \"wall.obj\"",
        "kind = \"map\"\nfocal_px = 50\ndepth_file = \"wall.pfm\"",
    ] {
        mark(
            "objects.toml",
            &format!("[[object]]\nname = \"wall\"\nreflectivity = 0.5\n{object}\n"),
        );
        let scene = gdtof(dir, &["scene", "--scene", "objects.toml"]);
        assert!(scene.status.success(), "{scene:?}");
    }
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
