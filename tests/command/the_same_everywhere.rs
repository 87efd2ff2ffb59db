//! The same request gives the same bytes with any number of threads, in any build, and whatever vector instructions the
//! processor has: SHA-256 of waveforms, histograms, depths, guides' maps and sweeps' tables beside `vectors/everywhere/hashes.csv`.
//!
//! `cargo test --test command the_same_everywhere -- --nocapture` prints them. `GDTOF_PROGRAM=target/release/gdtof` holds
//! another build to them, `GDTOF_PROGRAM="qemu-aarch64 …/gdtof"` one for another architecture (`.ci/portable`).

use std::fmt::Write as _;
use std::path::{Path, PathBuf};
use std::process::Command;

use serde_json::Value as Json;
use sha2::{Digest, Sha256};

use super::tools::takes_all;

/// Name (and folder of results), arguments, and files that are compared.
const RUNS: [(&str, &str, &[&str]); 10] = [
    (
        "window",
        "frame --rows 8 --cols 8 --probe 2,1",
        &["probe_r2_c1.vcd", "histograms.npy", "frame.json"],
    ),
    (
        "cycle",
        "frame --rows 4 --cols 4 --probe none --engine cycle",
        &["histograms.npy", "frame.json"],
    ),
    (
        "cohort",
        "frame --rows 8 --cols 8 --probe none --tolerance 0.1",
        &["histograms.npy", "frame.json"],
    ),
    (
        "matched",
        "frame --rows 8 --cols 8 --probe none --guide matched",
        &["histograms.npy", "frame.json"],
    ),
    (
        "fog",
        "frame --rows 8 --cols 8 --probe none --scene fog",
        &["histograms.npy", "frame.json"],
    ),
    (
        "delay_line",
        "frame --rows 4 --cols 4 --probe none --set=sensor.tdc=delay_line",
        &["histograms.npy", "frame.json"],
    ),
    (
        "drive",
        "drive --rows 4 --cols 6 --frames 3 --guide stereo --guide kalman",
        &["histograms.npy", "guide.npy", "depth.npy"],
    ),
    ("engines", "sweep engines.toml", &["results.csv"]),
    ("guides", "sweep guides.toml", &["results.csv"]),
    ("sensors", "sweep sensors.toml", &["results.csv"]),
];
/// Those of a frame or drive: the light of a macropixel of the whole array, on fewer of them.
const FRAME: [&str; 3] = [
    "--laser-cycles=300",
    "--set=scene.lidar.fov_deg=2",
    "--quiet",
];

fn vectors() -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join("vectors/everywhere")
}

/// The program that was built with the tests, or another; with what runs it before it.
fn program() -> Vec<String> {
    let built = env!("CARGO_BIN_EXE_gdtof");
    let given = std::env::var("GDTOF_PROGRAM").unwrap_or_else(|_| built.to_owned());
    // Runs have a working folder of their own.
    let place = |word: &str| {
        if Path::new(word).exists() {
            std::path::absolute(word).unwrap().display().to_string()
        } else {
            word.to_owned()
        }
    };
    given.split(' ').map(place).collect()
}

/// What a file holds, but for how long it took.
fn content(file: &Path) -> Vec<u8> {
    let bytes = std::fs::read(file).unwrap();
    if !file.ends_with("frame.json") {
        return bytes;
    }
    let mut frame: Json = serde_json::from_slice(&bytes).unwrap();
    let fields = frame.as_object_mut().unwrap();
    for time in ["run_time_s", "exposure_run_time_s", "run_times"] {
        fields.remove(time).expect("a frame says how long it took");
    }
    frame.to_string().into_bytes()
}

/// The hashes of all runs by `command`, a program and its first arguments, on this many threads.
fn hashes(command: &[&str], threads: usize) -> String {
    let folder = tempfile::tempdir().unwrap();
    for study in ["engines", "guides", "sensors"] {
        let name = format!("{study}.toml");
        std::fs::copy(vectors().join(&name), folder.path().join(&name)).unwrap();
    }
    let mut found = "run,file,sha256\n".to_owned();
    for (name, arguments, files) in RUNS {
        let mut run = Command::new(command[0]);
        run.args(&command[1..]).args(arguments.split(' '));
        if !arguments.starts_with("sweep") {
            run.args(FRAME);
        }
        run.args(["--out", name]).current_dir(folder.path());
        let output = run
            .env("RAYON_NUM_THREADS", threads.to_string())
            .output()
            .unwrap();
        assert!(output.status.success(), "{output:?}");
        for file in files {
            let hash = Sha256::digest(content(&folder.path().join(name).join(file)));
            write!(found, "{name},{file},").unwrap();
            for byte in hash {
                write!(found, "{byte:02x}").unwrap();
            }
            found.push('\n');
        }
    }
    found
}

fn golden() -> String {
    std::fs::read_to_string(vectors().join("hashes.csv")).unwrap()
}

/// Set GDTOF_REMAKE to write the file anew (`vectors/remake.sh` does) after a deliberate change of results.
#[test]
fn with_any_number_of_threads() {
    let program = program();
    let command: Vec<&str> = program.iter().map(String::as_str).collect();
    let alone = hashes(&command, 1);
    println!("{alone}");
    if std::env::var_os("GDTOF_REMAKE").is_some() {
        std::fs::write(vectors().join("hashes.csv"), &alone).unwrap();
    }
    assert_eq!(alone, golden());
    let more = if takes_all() { &[2, 8][..] } else { &[8] };
    for &threads in more {
        assert_eq!(hashes(&command, threads), golden(), "{threads} threads");
    }
}

/// This program on emulated processors: without any vector instructions but those that every x86-64 has, without AVX-512, and
/// (beside the other test, where this machine has it) with it.
#[cfg(all(target_arch = "x86_64", target_os = "linux"))]
#[test]
#[ignore = "emulation takes a minute; run with --include-ignored"]
fn on_processors_with_other_vector_instructions() {
    use std::io::Write as _;

    let emulator = "qemu-x86_64";
    if Command::new(emulator).arg("--version").output().is_err() {
        let said = format!(
            "SKIPPED: {emulator} is not installed (apt-get install qemu-user), so no other processor was tried\n"
        );
        let _ = std::io::stderr().write_all(said.as_bytes());
        assert!(std::env::var_os("CI").is_none(), "CI must have {emulator}");
        return;
    }
    for (processor, has_avx2) in [("qemu64", false), ("Haswell", true)] {
        let program = program();
        let command = [emulator, "-cpu", processor, &program[0]];
        let doctor = Command::new(emulator)
            .args(&command[1..])
            .args(["doctor", "--json"])
            .output()
            .unwrap();
        let doctor: Json = serde_json::from_slice(&doctor.stdout).unwrap();
        let has = |wanted: &str| {
            doctor["vectors"]
                .as_array()
                .unwrap()
                .iter()
                .any(|v| v == wanted)
        };
        assert_eq!(
            [has("avx2"), has("fma"), has("avx512f")],
            [has_avx2, has_avx2, false],
            "{processor}"
        );
        assert_eq!(hashes(&command, 2), golden(), "{processor}");
    }
}
