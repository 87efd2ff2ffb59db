//! `gdtof range` on histograms of a real sensor, on made ones whose depths are known, and on the sample captures in
//! `vectors/range`, which our own chip has taken.
//!
//! The real captures are not part of the project. They are looked for in the folder that GDTOF_DATA names, or in
//! `shared/data` beside the checkout; without them that test says so and is skipped.

use std::io::Write;
use std::ops::Range;
use std::path::{Path, PathBuf};
use std::process::{Command, Output};

use guided_dtof::chip::{Exposure, SensorConfig, WindowLaw};
use guided_dtof::engine::{LitPixel, Window, expose, stream_config};
use guided_dtof::photon::PhotonStream;
use guided_dtof::scene::{DVec3, GroundTruth, Object, Scene, Shape};
use guided_dtof::units::TimeOfFlight;

fn range(folder: &Path, arguments: &[&str]) -> Output {
    Command::new(env!("CARGO_BIN_EXE_gdtof"))
        .args(["range", "--format", "tmf8820"])
        .args(arguments)
        .current_dir(folder)
        .output()
        .unwrap()
}

fn report(folder: &Path, arguments: &[&str]) -> serde_json::Value {
    let output = range(folder, &[arguments, &["--json"]].concat());
    let error = String::from_utf8_lossy(&output.stderr);
    assert!(output.status.success(), "{arguments:?}: {error}");
    serde_json::from_slice(&output.stdout).unwrap()
}

fn rms_mm(report: &serde_json::Value, key: &str) -> f64 {
    report[key]["rms_mm"].as_f64().unwrap()
}

/// Captures of a plane from 0.1 m to 0.5 m by two zones with 15 mm bins, a triangular pulse four bins
/// wide that pile-up makes earlier by one bin for a million counts, and a sensor that is 20 mm short.
fn made_captures() -> String {
    let pulse = |at: f64, counts: f64| -> Vec<u32> {
        let cdf = |x: f64| {
            let x = (x / 4.0).clamp(0.0, 1.0);
            if x < 0.5 {
                2.0 * x * x
            } else {
                1.0 - 2.0 * (1.0 - x) * (1.0 - x)
            }
        };
        let in_bin = |bin: usize| cdf(bin as f64 + 1.0 - at) - cdf(bin as f64 - at);
        (0..64)
            .map(|bin| (50.0 + counts * in_bin(bin)).round() as u32)
            .collect()
    };
    let captures: Vec<serde_json::Value> = (0..41)
        .map(|i| {
            let depth_m = 0.1 + 0.01 * f64::from(i);
            let reference = 5.0 + 0.003 * f64::from(i);
            let zones = [1.0, 1.1].map(|stretch| {
                let counts = 2e4 * stretch / (depth_m * depth_m);
                pulse(
                    reference + stretch * depth_m / 0.015 - counts * 1e-6,
                    counts,
                )
            });
            serde_json::json!({
                "capture": i, "dist_to_plane_m": depth_m,
                "reference_hist": pulse(reference, 1e5),
                "hists": zones,
                "on_chip_depths_mm": [1e3 * depth_m - 20.0, 1e3 * depth_m - 20.0],
            })
        })
        .collect();
    serde_json::to_string(&captures).unwrap()
}

#[test]
fn made_histograms_give_their_depths_back() {
    let folder = tempfile::tempdir().unwrap();
    std::fs::write(folder.path().join("made.json"), made_captures()).unwrap();
    for fit in ["even", "odd"] {
        let report = report(folder.path(), &["--histograms", "made.json", "--fit", fit]);
        assert!((rms_mm(&report, "sensor") - 20.0).abs() < 1e-6);
        assert!(rms_mm(&report, "sensor_refitted") < 1e-6);
        // Counts are taken as even within a bin, which a triangle's are not: some hundredths of 15 mm.
        assert!(rms_mm(&report, "depths") < 0.5, "{fit}: {report:#}");
    }
}

#[test]
fn a_kept_calibration_gives_the_same_depths_and_foreign_ones_are_refused() {
    let folder = tempfile::tempdir().unwrap();
    let file = |name: &str| folder.path().join(name);
    std::fs::write(file("made.json"), made_captures()).unwrap();
    let made = ["--histograms", "made.json"];
    let first = report(
        folder.path(),
        &[
            &made[..],
            &["--save-calibration", "cal.json", "--out", "odd.csv"],
        ]
        .concat(),
    );
    let again = report(
        folder.path(),
        &[
            &made[..],
            &["--calibration", "cal.json", "--out", "all.csv"],
        ]
        .concat(),
    );
    assert_eq!(first["calibration"], again["calibration"]);
    let lines = |name| -> Vec<String> {
        let text = std::fs::read_to_string(file(name)).unwrap();
        text.lines().map(String::from).collect()
    };
    let all = lines("all.csv");
    assert_eq!(all.len(), 1 + 41 * 2);
    assert!(lines("odd.csv").iter().all(|line| all.contains(line)));

    let refused = |arguments: &[&str], says: &str| {
        let output = range(folder.path(), arguments);
        let error = String::from_utf8(output.stderr).unwrap();
        assert_eq!(output.status.code(), Some(2), "{error}");
        assert!(
            error.contains(says) && error.trim_end().lines().count() == 1,
            "{error}"
        );
    };
    let kept = std::fs::read_to_string(file("cal.json")).unwrap();
    let mut calibration: serde_json::Value = serde_json::from_str(&kept).unwrap();
    calibration["zones"].as_array_mut().unwrap().pop();
    std::fs::write(file("one.json"), calibration.to_string()).unwrap();
    refused(
        &[&made[..], &["--calibration", "one.json"]].concat(),
        "is for 1 zones, not 2",
    );
    refused(
        &[&made[..], &["--calibration", "made.json"]].concat(),
        "made.json:1",
    );
    refused(&["--histograms", "missing.json"], "missing.json");
    refused(&["--histograms", "cal.json"], "cal.json:1");
    std::fs::write(file("few.json"), "[]").unwrap();
    refused(&["--histograms", "few.json"], "at least one");
}

/// Counts of `zones`, macropixels of a 3×3 array whose windows reach from the lidar to 25 m, before a plane at
/// `distance_m`.
fn modelled_counts(
    zones: Range<u32>,
    distance_m: f64,
    reflectivity: f64,
    seed: u64,
) -> Vec<Vec<u16>> {
    let sensor = modelled_sensor();
    let exposure = Exposure::new(&sensor, 120, 2_000);
    let mut scene = Scene::outdoor();
    scene.lidar.pulse_energy_uj = 0.1;
    scene.light.illuminance_klux = 10.0;
    scene.objects = vec![Object::new(
        "plane",
        reflectivity,
        Shape::Plane {
            centre_m: DVec3::new(0.0, 0.0, distance_m),
            normal: DVec3::new(0.0, 0.0, -1.0),
            width_m: 100.0,
            height_m: 100.0,
        },
    )];
    scene.validate("the plane").unwrap();
    let light = scene.pixel_light(&GroundTruth::render(&scene, 3, 3));
    let pixels: Vec<LitPixel> = zones
        .map(|number| LitPixel {
            number,
            start: MODELLED_START,
            light: Some(light[number as usize].clone()),
        })
        .collect();
    let stream = stream_config(&sensor, &exposure, seed, scene.pulse_sigma());
    let engine = Window::new(&sensor, &exposure);
    let exposed = expose(&engine, &PhotonStream::new(&stream), &pixels, |_| ()).unwrap();
    exposed.histograms.iter().map(<[u16]>::to_vec).collect()
}

/// Bins 0 to 63 lie before the end of this start value's window, at 25 m.
const MODELLED_START: u16 = 62;

fn modelled_sensor() -> SensorConfig {
    SensorConfig {
        rows: 3,
        cols: 3,
        bins: 64,
        bin_bits: 16,
        ..SensorConfig::default()
    }
}

/// A plane from 2 to 21 m. The reference is a dim surface half a metre away; the chip's own depth is the middle of its
/// fullest bin.
fn modelled_captures() -> String {
    let sensor = modelled_sensor();
    let law = WindowLaw::new(&sensor, &Exposure::new(&sensor, 120, 1));
    let window = law.window(MODELLED_START).open().unwrap();
    let captures: Vec<String> = (0..20)
        .map(|i| {
            let distance_m = 2.0 + f64::from(i);
            let seed = 2 * i as u64;
            let zones = modelled_counts(0..9, distance_m, 0.5, seed);
            let reference = modelled_counts(4..5, 0.5, 0.001, seed + 1).remove(0);
            let own_mm = zones.iter().map(|counts| {
                let fullest = (0..counts.len()).max_by_key(|&bin| counts[bin]).unwrap();
                let range_m = law.time_of(&window, fullest as f64).as_range_m();
                (1e3 * range_m).round() as i64
            });
            let capture = serde_json::json!({
                "capture": i, "dist_to_plane_m": distance_m, "reference_hist": reference,
                "hists": zones, "on_chip_depths_mm": own_mm.collect::<Vec<_>>(),
            });
            capture.to_string()
        })
        .collect();
    format!("[\n{}\n]\n", captures.join(",\n"))
}

/// Set GDTOF_REMAKE to write the file anew (`vectors/remake.sh` does) after a deliberate change.
#[test]
fn the_sample_captures_are_ranged() {
    let file = Path::new(env!("CARGO_MANIFEST_DIR")).join("vectors/range/captures.json");
    if std::env::var_os("GDTOF_REMAKE").is_some() {
        std::fs::write(&file, modelled_captures()).unwrap();
    }
    let folder = tempfile::tempdir().unwrap();
    let report = report(folder.path(), &["--histograms", file.to_str().unwrap()]);
    assert_eq!(report["captures"], 20);
    assert_eq!(report["zones"], 9);
    assert_eq!(report["sightings"], 180, "{report:#}");
    // The chip's own depth is a bin's, 390 mm: 113 mm RMS within it.
    let (ours, own) = (rms_mm(&report, "depths"), rms_mm(&report, "sensor"));
    assert!(ours < 60.0 && ours < 0.5 * own, "{report:#}");
}

#[test]
fn readings_that_are_left_out_are_counted_with_the_cause() {
    let folder = tempfile::tempdir().unwrap();
    let mut captures: serde_json::Value = serde_json::from_str(&made_captures()).unwrap();
    let flat = serde_json::json!(vec![50; 64]);
    captures[3]["reference_hist"] = flat.clone();
    captures[5]["on_chip_depths_mm"][1] = 0.into();
    captures[6]["on_chip_depths_mm"][0] = 0.into();
    captures[7]["hists"][0] = flat.clone();
    captures[7]["hists"][1] = flat.clone();
    captures[8]["hists"][1] = flat;
    std::fs::write(folder.path().join("made.json"), captures.to_string()).unwrap();
    let report = report(folder.path(), &["--histograms", "made.json"]);
    let causes =
        serde_json::json!({"no_reference_pulse": 2, "no_target_reported": 2, "no_pulse": 3});
    assert_eq!(report["left_out"], causes);
    assert_eq!(report["sightings"], 2 * 41 - 7);
    let output = range(folder.path(), &["--histograms", "made.json"]);
    let text = String::from_utf8(output.stdout).unwrap();
    for line in [
        "7 of 82 readings are left out",
        "  2 whose capture has no pulse in its reference histogram",
        "  2 where the sensor reports no target",
        "  3 without a pulse of 100 counts above background",
    ] {
        assert!(text.lines().any(|l| l == line), "{text}");
    }
}

#[test]
fn depths_of_a_real_sensor_beat_its_own() {
    let folder = std::env::var_os("GDTOF_DATA").map_or_else(
        || Path::new(env!("CARGO_MANIFEST_DIR")).join("../shared/data"),
        PathBuf::from,
    );
    let captures = folder.join("tmf8820_even.json");
    if !captures.exists() {
        // Not eprintln, which cargo hides where a test passes.
        let _ = writeln!(
            std::io::stderr(),
            "SKIPPED: {} is not there; set GDTOF_DATA",
            captures.display()
        );
        return;
    }
    let here = tempfile::tempdir().unwrap();
    for fit in ["even", "odd", "near", "far"] {
        let captures = captures.to_str().unwrap();
        let report = report(here.path(), &["--histograms", captures, "--fit", fit]);
        let ours = rms_mm(&report, "depths");
        assert!(report["reported"].as_u64().unwrap() > 300, "{report:#}");
        let left_out = report["left_out"].as_object().unwrap().values();
        let left_out: u64 = left_out.map(|n| n.as_u64().unwrap()).sum();
        assert_eq!(left_out, 15, "{report:#}");
        assert!(ours < rms_mm(&report, "sensor"), "{fit}: {report:#}");
        assert!(
            ours < rms_mm(&report, "sensor_refitted"),
            "{fit}: {report:#}"
        );
    }
}
