//! Memory and time are estimated before they are spent: a sentence, and no abort.

use std::path::Path;
use std::process::{Command, Output};
use std::time::{Duration, Instant};

/// Runs it with a gigabyte and a half of address space.
fn limited(here: &Path, words: &str) -> Output {
    let script = "ulimit -v 1572864; exec timeout 60 \"$0\" \"$@\" --threads 2";
    Command::new("sh")
        .args(["-c", script, env!("CARGO_BIN_EXE_gdtof")])
        .args(words.split(' '))
        .current_dir(here)
        .output()
        .unwrap()
}

#[test]
fn what_does_not_fit_is_refused() {
    let dir = tempfile::tempdir().unwrap();
    let here = dir.path();
    std::fs::write(here.join("lines.toml"), "\n".repeat(20 << 20)).unwrap();
    std::fs::write(here.join("picture.png"), "none").unwrap();
    for (words, says) in [
        (
            "frame --rows 1 --cols 1 --scene empty --laser-cycles 20 --set scene.medium.extinction_1_m=10 --set scene.medium.overlap_m=1e-3 --set sensor.mode=conventional",
            "photons a laser cycle on a macropixel, of which 1e6 are held in memory",
        ),
        (
            "power --laser-cycles 1000000",
            "--laser-cycles: 4800 CLK periods times 1000000",
        ),
        (
            "power --laser-cycles 100000",
            "--laser-cycles: 100000 laser cycles of",
        ),
        ("power --stop-periods 4294967295", "CLK periods"),
        ("power --counts-hz 1e15", "--counts-hz"),
        (
            "frame --left picture.png --right picture.png --calib lines.toml",
            "lines.toml: has",
        ),
        ("timing --liberty /dev/urandom", "/dev/urandom: is a device"),
    ] {
        let run = limited(here, words);
        let error = String::from_utf8_lossy(&run.stderr);
        assert_eq!(run.status.code(), Some(2), "{words}: {error}");
        assert!(error.contains(says), "{words}: {error}");
        let is_note = |line: &&str| line.contains("is far from the usual");
        let sentences = error.trim_end().lines().filter(|line| !is_note(line));
        assert_eq!(sentences.count(), 1, "{words}: {error}");
    }
}

/// A face whose corners are all in one place, beside one that is seen.
#[test]
fn a_face_without_area_costs_nothing() {
    let dir = tempfile::tempdir().unwrap();
    let here = dir.path();
    let mut mesh = "v -5 -5 0\nv 5 -5 0\nv 0 5 0\nf 1 2 3\nf".to_owned();
    mesh += &" 1".repeat(60_000);
    std::fs::write(here.join("a.obj"), mesh + "\n").unwrap();
    let scene = "[[object]]\nname = \"a\"\nkind = \"mesh\"\nfile = \"a.obj\"\nreflectivity = 0.5\ncentre_m = [0, 0, 20]\n";
    std::fs::write(here.join("scene.toml"), scene).unwrap();
    let begun = Instant::now();
    let run = limited(
        here,
        "frame scene.toml --rows 16 --cols 16 --laser-cycles 2 --probe none",
    );
    assert!(run.status.success(), "{run:?}");
    assert!(begun.elapsed() < Duration::from_secs(30));
}
