//! `gdtof drive`: one recording of many frames, the same whatever is reused, and refusals.

use guided_dtof::files::NpyHead;
use std::path::Path;

use super::tools::gdtof;

/// A small array in little light: its few macropixels share the whole field of view.
const SMALL: [&str; 17] = [
    "drive",
    "--rows",
    "4",
    "--cols",
    "6",
    "--frames",
    "3",
    "--laser-cycles",
    "40",
    "--set",
    "scene.light.illuminance_klux=0",
    "--set",
    "scene.lidar.pulse_energy_uj=0.1",
    "--set",
    "scene.object.car.velocity_m_s=[0, 0, 12]",
    "--noise",
    "still",
];

fn read(folder: &Path, name: &str) -> Vec<u8> {
    std::fs::read(folder.join(name)).unwrap_or_else(|e| panic!("{name}: {e}"))
}

#[test]
fn a_drive_is_one_recording_whatever_is_reused() {
    let dir = tempfile::tempdir().unwrap();
    let with = gdtof(dir.path(), &[&SMALL[..], &["--out", "with"]].concat());
    assert!(with.status.success(), "{with:?}");
    let without = gdtof(
        dir.path(),
        &[
            &SMALL[..],
            &["--no-skip", "--no-pictures", "--out", "without"],
        ]
        .concat(),
    );
    assert!(without.status.success(), "{without:?}");
    let (with, without) = (dir.path().join("with"), dir.path().join("without"));
    for name in ["depth", "guide", "truth", "starts", "histograms"] {
        let name = format!("{name}.npy");
        assert_eq!(read(&with, &name), read(&without, &name), "{name}");
    }
    let stack = read(&with, "histograms.npy");
    let stack = NpyHead::read(&mut &stack[..]).unwrap();
    assert_eq!(stack.shape, [3, 4, 6, 16]);
    assert!(with.join("depth_00002.png").exists() && !without.join("depth_00002.png").exists());

    let json = |folder: &Path| -> serde_json::Value {
        serde_json::from_slice(&read(folder, "drive.json")).unwrap()
    };
    assert!(json(&with)["macropixels_reused"].as_u64() > Some(0));
    assert_eq!(json(&without)["macropixels_reused"], 0);
    let index = String::from_utf8(read(&with, "frames.jsonl")).unwrap();
    let lines = index.lines().map(serde_json::from_str);
    let lines: Vec<serde_json::Value> = lines.collect::<Result<_, _>>().unwrap();
    assert_eq!(lines.len(), 3);
    let images_s = |n: usize| lines[n]["times"]["images_s"].as_f64().unwrap();
    let period_s = json(&with)["frame_period_s"].as_f64().unwrap();
    assert!((images_s(2) - images_s(1) - period_s).abs() < 1e-12);
}

#[test]
fn what_a_drive_cannot_do_is_refused_in_one_sentence() {
    let dir = tempfile::tempdir().unwrap();
    for (arguments, wanted) in [
        (&["drive", "no_such.toml"][..], "no_such.toml"),
        (&["drive", "--guide", "owl"], "owl"),
        (&["drive", "--guide-latency-ms=-1"], "-1 is not a latency"),
        (&["drive", "--start-s", "1e9"], "1000000000 is not a time"),
        (&["drive", "--laser-cycles", "0"], "at least 1"),
        (
            &["demo", "sweep", "--calibration-step-ps", "0"],
            "0 is impossible",
        ),
    ] {
        let output = gdtof(dir.path(), arguments);
        let text = String::from_utf8(output.stderr).unwrap();
        assert_eq!(output.status.code(), Some(2), "{arguments:?}: {text}");
        assert!(text.contains(wanted), "{arguments:?}: {text}");
        assert_eq!(text.lines().count(), 1, "{text}");
    }
    assert_eq!(std::fs::read_dir(dir.path()).unwrap().count(), 0);
}
