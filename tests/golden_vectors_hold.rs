//! Recorded stimuli in `vectors/replay` still give the recorded histograms, on every engine.

use std::path::{Path, PathBuf};
use std::process::Command;

fn vectors() -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join("vectors/replay")
}

#[test]
fn on_every_engine() {
    let golden = std::fs::read_to_string(vectors().join("histograms.csv")).unwrap();
    let counts: Vec<u32> = golden
        .lines()
        .skip(1)
        .map(|line| line.rsplit(',').next().unwrap().parse().unwrap())
        .collect();
    assert_eq!(counts.len(), 2 * 3 * 8);
    assert!(counts.contains(&15), "no bin saturates");
    assert!(
        counts[5 * 8..].iter().all(|&n| n == 0),
        "a start value beyond the laser cycle counted"
    );
    for engine in ["gate", "cycle", "window"] {
        let output = Command::new(env!("CARGO_BIN_EXE_gdtof"))
            .args(["replay", "--sensor", "sensor.toml", "--inits", "inits.csv"])
            .args([
                "--events",
                "events.csv",
                "--stop-periods",
                "80",
                "--laser-cycles",
                "40",
            ])
            .args(["--engine", engine])
            .current_dir(vectors())
            .output()
            .unwrap();
        assert!(output.status.success(), "{output:?}");
        assert_eq!(
            String::from_utf8(output.stdout).unwrap(),
            golden,
            "{engine}"
        );
    }
}
