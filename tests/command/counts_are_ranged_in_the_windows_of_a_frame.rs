//! `gdtof range --format frame`: depths from counts that are given, in the windows of a frame.

use std::path::Path;

use guided_dtof::files::write_npy;

use super::tools::gdtof_words;

fn run_frame(folder: &Path) -> serde_json::Value {
    let frame = gdtof_words(
        folder,
        "frame --rows 8 --cols 8 --probe none --laser-cycles 400 --set scene.light.illuminance_klux=0 --set scene.lidar.pulse_energy_uj=1 --json",
    );
    assert!(frame.status.success(), "{frame:?}");
    serde_json::from_slice(&frame.stdout).unwrap()
}

fn write(path: &Path, shape: &[usize], counts: &[i64]) {
    let mut file = std::fs::File::create(path).unwrap();
    write_npy(&mut file, shape, counts).unwrap();
}

#[test]
fn a_frame_ranged_once_more_is_the_same_and_a_table_of_it_has_every_macropixel() {
    let folder = tempfile::tempdir().unwrap();
    let folder = folder.path();
    let frame = run_frame(folder);
    let range = "range --format frame --histograms out/histograms.npy";
    let again = gdtof_words(folder, &format!("{range} --json"));
    let again: serde_json::Value = serde_json::from_slice(&again.stdout).unwrap();
    assert_eq!(again["macropixels"], frame["macropixels"]);
    assert_eq!(again["summary"], frame["summary"]);
    assert!(frame["summary"]["depths"].as_u64() > Some(10));

    let with_table = gdtof_words(folder, &format!("{range} --out depths.csv"));
    assert!(with_table.status.success());
    let table = std::fs::read_to_string(folder.join("depths.csv")).unwrap();
    assert_eq!(table.lines().count(), 65);
    let depths = table.lines().skip(1).map(|line| line.split(',').nth(5));
    let with_depth = depths.filter(|depth| !depth.unwrap().is_empty()).count();
    assert_eq!(Some(with_depth as u64), frame["summary"]["depths"].as_u64());
}

/// The echo of a plane just before the lens is in the first bin, where a fit may end behind the lidar.
#[test]
fn no_depth_is_behind_the_lidar() {
    let folder = tempfile::tempdir().unwrap();
    let near = "[[object]]\nname = \"wall\"\nkind = \"plane\"\ncentre_m = [0, 0, 0.3]\nwidth_m = 20\nheight_m = 20\nreflectivity = 0.02\n";
    std::fs::write(folder.path().join("near.toml"), near).unwrap();
    let frame = gdtof_words(
        folder.path(),
        "frame --rows 8 --cols 8 --scene near.toml --guide truth --laser-cycles 200 --probe none --json",
    );
    assert!(frame.status.success(), "{frame:?}");
    let frame: serde_json::Value = serde_json::from_slice(&frame.stdout).unwrap();
    let macropixels = frame["macropixels"].as_array().unwrap();
    let depths: Vec<f64> = macropixels
        .iter()
        .filter_map(|m| m["measured_m"].as_f64())
        .collect();
    assert!(depths.iter().all(|&m| m >= 0.0), "{depths:?}");
    let reasons = macropixels.iter().filter_map(|m| m["no_depth"].as_str());
    let behind = reasons.filter(|&reason| reason == "behind_lidar").count();
    assert!(behind > 0, "{depths:?}");
}

/// Counts of a chip of one's own: one that saw nothing anywhere has no depths.
#[test]
fn other_counts_in_the_same_windows_give_other_depths() {
    let folder = tempfile::tempdir().unwrap();
    let folder = folder.path();
    run_frame(folder);
    write(&folder.join("dark.npy"), &[8, 8, 16], &[0; 1024]);
    let range = "range --format frame --frame out/frame.json --json --histograms";
    let dark = gdtof_words(folder, &format!("{range} dark.npy"));
    let dark: serde_json::Value = serde_json::from_slice(&dark.stdout).unwrap();
    assert_eq!(dark["summary"]["depths"], 0);

    write(&folder.join("small.npy"), &[2, 8, 16], &[0; 256]);
    let mut many = [0; 1024];
    many[8 * 16 + 5] = 401;
    write(&folder.join("many.npy"), &[8, 8, 16], &many);
    for (arguments, says) in [
        (format!("{range} small.npy"), "give one of [8, 8, 16]"),
        (
            format!("{range} many.npy"),
            "401 counts in bin 5 of macropixel (1, 0), and a bin of 14 bits counts at most 400 in 400 laser cycles",
        ),
        (
            format!("{range} dark.npy --fit even"),
            "--fit: is not for --format frame",
        ),
        (
            format!("{range} dark.npy --false-alarm-rate 0"),
            "--false-alarm-rate: 0 is not a share",
        ),
        (
            "range --format frame --histograms dark.npy".into(),
            "frame.json",
        ),
    ] {
        let refused = gdtof_words(folder, &arguments);
        let said = String::from_utf8(refused.stderr).unwrap();
        assert_eq!(refused.status.code(), Some(2), "{said}");
        assert!(said.contains(says), "{said}");
        assert_eq!(said.lines().count(), 1, "{said}");
    }
}
