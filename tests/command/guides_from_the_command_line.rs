//! `--guide` and `--windows` of `gdtof frame`.

use std::path::Path;
use std::process::{Command, Output};

use guided_dtof::files::write_npy;

/// A small frame of the street with these further arguments.
fn frame(folder: &Path, out: &str, further: &[&str]) -> Output {
    Command::new(env!("CARGO_BIN_EXE_gdtof"))
        .args([
            "frame",
            "--rows",
            "16",
            "--cols",
            "16",
            "--laser-cycles",
            "100",
        ])
        .args(["--probe", "none", "--out", out])
        .args(further)
        .current_dir(folder)
        .output()
        .unwrap()
}

fn taken(folder: &Path, out: &str, further: &[&str]) -> serde_json::Value {
    let output = frame(folder, out, further);
    let error = String::from_utf8_lossy(&output.stderr).into_owned();
    assert!(output.status.success(), "{further:?}: {error}");
    let text = std::fs::read(folder.join(out).join("frame.json")).unwrap();
    serde_json::from_slice(&text).unwrap()
}

fn guided(frame: &serde_json::Value) -> usize {
    let pixels = frame["macropixels"].as_array().unwrap();
    pixels.iter().filter(|p| !p["start"].is_null()).count()
}

fn write_map(path: &Path, rows: usize, cols: usize, range_m: f64) {
    let mut file = std::fs::File::create(path).unwrap();
    write_npy(&mut file, &[rows, cols], &vec![range_m; rows * cols]).unwrap();
}

#[test]
fn every_guide_takes_a_frame_and_the_camera_pair_is_the_one_without() {
    let dir = tempfile::tempdir().unwrap();
    let folder = dir.path();
    let without = taken(folder, "without", &[]);
    let stereo = taken(folder, "stereo", &["--guide", "stereo"]);
    assert_eq!(stereo["macropixels"], without["macropixels"]);
    let histograms = |out: &str| std::fs::read(folder.join(out).join("histograms.npy")).unwrap();
    assert_eq!(histograms("stereo"), histograms("without"));
    write_map(&folder.join("map.npy"), 16, 16, 40.0);
    for (guide, at_least) in [
        ("truth:sigma_m=20 cm", 100),
        ("monocular", 100),
        ("radar:azimuth_beam_deg=4", 100),
        ("file:path=map.npy,sigma_m=0.5", 256),
    ] {
        let frame = taken(folder, "out", &["--guide", guide]);
        assert!(guided(&frame) >= at_least, "{guide}: {}", guided(&frame));
        assert_eq!(frame["guides"][0], guide);
    }
    // Fused with one that knows nothing yet, the camera pair is itself; the windows of a neighbour fill gaps.
    let fused = taken(folder, "fused", &["--guide", "stereo", "--guide", "kalman"]);
    assert_eq!(fused["macropixels"], without["macropixels"]);
    let filled = taken(folder, "filled", &["--windows", "unguided=neighbour"]);
    assert!(guided(&filled) > guided(&without));
}

#[test]
fn a_frame_by_another_guide_replays() {
    let dir = tempfile::tempdir().unwrap();
    taken(
        dir.path(),
        "out",
        &["--guide", "radar", "--windows", "unguided=neighbour"],
    );
    let replay = Command::new(env!("CARGO_BIN_EXE_gdtof"))
        .args([
            "wave",
            "--frame",
            "out/frame.json",
            "--pixel",
            "8,8",
            "--cycle",
            "70",
        ])
        .current_dir(dir.path())
        .output()
        .unwrap();
    let error = String::from_utf8_lossy(&replay.stderr).into_owned();
    assert!(replay.status.success(), "{error}");
}

#[test]
fn guides_that_cannot_be_are_refused_in_one_sentence() {
    let dir = tempfile::tempdir().unwrap();
    let folder = dir.path();
    write_map(&folder.join("small.npy"), 4, 4, 40.0);
    write_map(&folder.join("behind.npy"), 16, 16, -1.0);
    std::fs::write(folder.join("text.npy"), "40, 41\n").unwrap();
    let before = std::fs::read_dir(folder).unwrap().count();
    for (further, says) in [
        (
            ["--guide", "sonar"],
            "--guide: \"sonar\" is not a guide; give stereo, truth",
        ),
        (
            ["--guide", "file:path=small.npy"],
            "small.npy: this map has 4x4 macropixels and the sensor 16x16",
        ),
        (
            ["--guide", "file:path=behind.npy"],
            "behind.npy: has -1 at row 0, column 0",
        ),
        (
            ["--guide", "file:path=text.npy"],
            "text.npy: is not a PNG, .npy, PFM or EXR",
        ),
        (["--guide", "file"], "names no file"),
        (["--guide", "radar:reach_m=0"], "reach_m = 0 is impossible"),
        (["--windows", "overlap=2"], "overlap = 2 is impossible"),
    ] {
        let output = frame(folder, "out", &further);
        let error = String::from_utf8_lossy(&output.stderr).into_owned();
        assert_eq!(output.status.code(), Some(2), "{further:?}: {error}");
        assert!(error.contains(says), "{further:?}: {error}");
        assert_eq!(error.trim_end().lines().count(), 1, "{error}");
        assert_eq!(
            std::fs::read_dir(folder).unwrap().count(),
            before,
            "{further:?}"
        );
    }
}
