//! `gdtof replay --mismatch` and the conditions: every engine writes the same file, and says how it came about.

use std::path::Path;

use rand::{RngExt, SeedableRng, rngs::StdRng};

use super::tools::gdtof;

const SIDE: u32 = 6;

fn folder() -> tempfile::TempDir {
    let random = &mut StdRng::seed_from_u64(5);
    let (mut inits, mut events) = (
        "row,col,init\n".to_owned(),
        "time_fs,row,col,spad\n".to_owned(),
    );
    for row in 0..SIDE {
        for col in 0..SIDE {
            // The first one's LOCAL_STOP is cut off by the next laser cycle's reset.
            let start = match (row, col) {
                (0, 0) => 59,
                _ => random.random_range(10..58),
            };
            inits += &format!("{row},{col},{start}\n");
            for _ in 0..300 {
                let time_fs = random.random_range(0..1_000_000_000);
                events += &format!("{time_fs},{row},{col},{}\n", random.random_range(0..16));
            }
        }
    }
    let folder = tempfile::tempdir().unwrap();
    std::fs::write(folder.path().join("inits.csv"), inits).unwrap();
    std::fs::write(folder.path().join("events.csv"), events).unwrap();
    // At this clock the strobe meets the change of the shift register in some macropixels.
    std::fs::write(folder.path().join("limit.toml"), "clk_hz = 411e6\n").unwrap();
    folder
}

/// Counts as CSV, and what was said.
fn replay(folder: &Path, engine: &str, more: &str) -> (String, String) {
    let side = SIDE.to_string();
    let array = ["--rows", &side, "--cols", &side];
    let stimuli = "replay --inits inits.csv --events events.csv --stop-periods 60 --laser-cycles 6";
    let mut arguments: Vec<&str> = stimuli.split(' ').collect();
    arguments.extend_from_slice(&array);
    arguments.extend(["--engine", engine].into_iter().chain(more.split(' ')));
    let output = gdtof(folder, &arguments);
    let said = String::from_utf8(output.stderr).unwrap();
    assert!(output.status.success(), "{arguments:?}: {said}");
    (String::from_utf8(output.stdout).unwrap(), said)
}

/// The number at the end of a line of the table.
fn number(said: &str, line: &str) -> usize {
    let found = said.lines().find(|l| l.contains(line));
    let found = found.unwrap_or_else(|| panic!("no {line:?} in {said}"));
    found.split_whitespace().last().unwrap().parse().unwrap()
}

#[test]
fn engines_agree_under_mismatch_and_tell_what_was_replayed() {
    let folder = folder();
    for more in [
        "--mismatch 0.2",
        "--mismatch 0.2 --mismatch-seed 2 --sensor limit.toml",
        "--process slow --voltage 1.05 --temperature 90",
        "--process fast --mismatch 0.1",
    ] {
        let (gates, _) = replay(folder.path(), "gate", more);
        for engine in ["window", "cycle"] {
            let (counts, said) = replay(folder.path(), engine, more);
            assert!(counts == gates, "{engine} {more}");
            let kept = number(&said, "in closed form");
            let replayed = number(&said, "replayed at gate level");
            assert_eq!(kept + replayed, (SIDE * SIDE) as usize, "{said}");
            // Only start values at the end of the laser cycle.
            assert!(kept > 30, "{said}");
            assert_eq!(
                number(&said, "next laser cycle's reset"),
                replayed,
                "{said}"
            );
        }
    }
}

#[test]
fn another_chip_counts_otherwise_at_the_limit() {
    let folder = folder();
    let chip = |seed: &str| {
        let more = format!("--mismatch 0.2 --sensor limit.toml --mismatch-seed {seed}");
        replay(folder.path(), "window", &more).0
    };
    assert_eq!(chip("2"), chip("2"));
    assert_ne!(chip("2"), chip("3"));
}

#[test]
fn waveforms_have_the_delays_of_the_chip() {
    let folder = folder();
    let more = "--mismatch 0.2 --sensor limit.toml --vcd array.vcd";
    let (counts, _) = replay(folder.path(), "gate", more);
    let (alone, _) = replay(folder.path(), "gate", "--mismatch 0.2 --sensor limit.toml");
    assert!(counts == alone);
    assert!(folder.path().join("array.vcd").exists());
}
