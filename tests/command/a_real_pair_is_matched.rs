//! Pictures of a real camera pair: `gdtof stereo`, and `gdtof frame --left --right`, which takes them in place of a scene.
//!
//! The pair here is made: a wall of blotches with a nearer square. One test needs the Motorcycle pair of Middlebury in `shared/data` beside the
//! checkout (or GDTOF_DATA); without it that test says so and is skipped.

use std::io::Write;
use std::path::{Path, PathBuf};
use std::process::Output;

use super::tools::gdtof;

const WIDTH: usize = 160;
const HEIGHT: usize = 120;
const CALIBRATION: &str = "\
left = [[300.0, 0, 80.0], [0, 300.0, 60.0], [0, 0, 1]]
baseline_m = 1.0
disparities = 32
";

fn disparity_px(x: usize, y: usize) -> usize {
    if (50..110).contains(&x) && (40..80).contains(&y) {
        20
    } else {
        10
    }
}

fn blotch(x: usize, y: usize) -> u8 {
    let wave = |a: f64, b: f64, c: f64| (a * x as f64 + b * y as f64 + c).sin();
    let sum = wave(0.9, 0.31, 1.0) + wave(0.37, -0.83, 2.0) + wave(-0.53, 0.59, 0.3);
    (120.0 + 35.0 * sum) as u8
}

fn write_png(path: &Path, (width, height): (usize, usize), pixels: &[u8]) {
    let file = std::fs::File::create(path).unwrap();
    let mut encoder = png::Encoder::new(file, width as u32, height as u32);
    encoder.set_color(png::ColorType::Grayscale);
    encoder.set_depth(png::BitDepth::Eight);
    let mut writer = encoder.write_header().unwrap();
    writer.write_image_data(pixels).unwrap();
    writer.finish().unwrap();
}

fn write_npy(path: &Path, shape: [usize; 2], values: impl Iterator<Item = f32>) {
    let mut file = std::fs::File::create(path).unwrap();
    let values: Vec<f32> = values.collect();
    guided_dtof::files::write_npy(&mut file, &shape, &values).unwrap();
}

/// A folder with left.png, right.png, truth.npy and calib.toml.
fn pair() -> tempfile::TempDir {
    let dir = tempfile::tempdir().unwrap();
    let all = || (0..HEIGHT).flat_map(|y| (0..WIDTH).map(move |x| (x, y)));
    let left: Vec<u8> = all().map(|(x, y)| blotch(x, y)).collect();
    let mut right: Vec<u8> = all().map(|(x, y)| blotch(x + 10, y)).collect();
    for (x, y) in all().filter(|&(x, y)| disparity_px(x, y) == 20) {
        right[y * WIDTH + x - 20] = left[y * WIDTH + x];
    }
    let size = (WIDTH, HEIGHT);
    write_png(&dir.path().join("left.png"), size, &left);
    write_png(&dir.path().join("right.png"), size, &right);
    let truth = all().map(|(x, y)| disparity_px(x, y) as f32);
    write_npy(&dir.path().join("truth.npy"), [HEIGHT, WIDTH], truth);
    std::fs::write(dir.path().join("calib.toml"), CALIBRATION).unwrap();
    dir
}

/// Macropixels are so wide that the usual PDE leaves SPADs blind long before the echo.
const FRAME: [&str; 17] = [
    "frame",
    "--left",
    "left.png",
    "--right",
    "right.png",
    "--calib",
    "calib.toml",
    "--rows",
    "8",
    "--cols",
    "8",
    "--probe",
    "none",
    "--laser-cycles",
    "200",
    "--set",
    "scene.lidar.pde=0.005",
];

fn json(output: &Output) -> serde_json::Value {
    assert!(
        output.status.success(),
        "{}",
        String::from_utf8_lossy(&output.stderr)
    );
    serde_json::from_slice(&output.stdout).unwrap()
}

#[test]
fn a_pair_stands_in_for_a_scene() {
    let here = pair();
    let with_truth = [&FRAME[..], &["--truth", "truth.npy", "--json"]].concat();
    let report = json(&gdtof(here.path(), &with_truth));
    assert_eq!(report["pair"]["light_from"], "the truth");
    let errors = &report["pair"]["disparity_errors"];
    assert!(errors["median_px"].as_f64().unwrap() < 0.2, "{errors}");
    // Walls at 30 m and 15 m.
    let pixels = report["macropixels"].as_array().unwrap();
    let guided = |at: usize| pixels[at]["guide_m"].as_f64().unwrap();
    assert!((guided(4 * 8 + 4) - 15.0).abs() < 0.5, "{}", pixels[36]);
    let measured = pixels[36]["measured_m"].as_f64().unwrap();
    assert!((measured - 15.0).abs() < 0.5, "{measured}");
    for name in [
        "depth_map.npy",
        "disparity.npy",
        "disparity.png",
        "frame.json",
    ] {
        assert!(here.path().join("out").join(name).exists(), "{name}");
    }
    // Without the truth, that is said.
    let output = gdtof(here.path(), &FRAME);
    let text = String::from_utf8(output.stdout).unwrap();
    assert!(text.contains("--truth gives other light"), "{text}");
    assert!(text.contains("the pair's own depths"), "{text}");
}

/// The same camera in the files of two data sets.
#[test]
fn calibrations_of_data_sets_are_taken_as_they_come() {
    let here = pair();
    let middlebury = "cam0=[300 0 80; 0 300 60; 0 0 1]\ncam1=[300 0 80; 0 300 60; 0 0 1]\ndoffs=0\nbaseline=1000\nwidth=160\nheight=120\nndisp=32\n";
    let projection = |fourth: i32| format!("300 0 80 {fourth} 0 300 60 0 0 0 1 0");
    let kitti = format!("P2: {}\nP3: {}\n", projection(15), projection(-285));
    let taken = |text: &str| {
        std::fs::write(here.path().join("calib.toml"), text).unwrap();
        let with_truth = [&FRAME[..], &["--truth", "truth.npy", "--json"]].concat();
        json(&gdtof(here.path(), &with_truth))["macropixels"].clone()
    };
    let ours = taken(CALIBRATION);
    assert_eq!(taken(middlebury), ours);
    // KITTI's does not say how many disparities to search, so that some are found elsewhere.
    let others = taken(&kitti);
    let guided = |frame_pixels: &serde_json::Value| frame_pixels[36]["guide_m"].as_f64().unwrap();
    assert!((guided(&others) - guided(&ours)).abs() < 0.1);
    std::fs::write(
        here.path().join("calib.toml"),
        middlebury.replace("160", "320"),
    )
    .unwrap();
    let refused = gdtof(here.path(), &FRAME);
    let said = String::from_utf8(refused.stderr).unwrap();
    assert_eq!(refused.status.code(), Some(2), "{said}");
    assert!(said.contains("320 x 120 pixels"), "{said}");
}

#[test]
fn disparities_are_found_and_held_against_the_truth() {
    let here = pair();
    let report = json(&gdtof(
        here.path(),
        &[
            "stereo",
            "left.png",
            "right.png",
            "--disparities",
            "32",
            "--truth",
            "truth.npy",
            "--json",
            "-o",
            "found",
        ],
    ));
    let errors = &report["errors"];
    assert!(errors["valid_percent"].as_f64().unwrap() > 70.0, "{errors}");
    assert!(
        errors["bad_2px_percent"].as_f64().unwrap() < 3.0,
        "{errors}"
    );
    for name in [
        "disparity.npy",
        "disparity.png",
        "stereo.json",
        "manifest.json",
    ] {
        assert!(here.path().join("found").join(name).exists(), "{name}");
    }
}

#[test]
fn what_is_no_pair_is_refused_in_one_sentence() {
    let here = pair();
    let path = |name: &str| here.path().join(name);
    write_png(&path("small.png"), (4, 4), &[0; 16]);
    std::fs::write(
        path("broken.png"),
        &std::fs::read(path("left.png")).unwrap()[..500],
    )
    .unwrap();
    write_npy(&path("small.npy"), [2, 2], [1.0; 4].into_iter());
    write_npy(
        &path("none.npy"),
        [HEIGHT, WIDTH],
        std::iter::repeat_n(f32::NAN, WIDTH * HEIGHT),
    );
    // The head of a picture of 60000 x 60000 pixels, with its checksum.
    let mut bomb = b"\x89PNG\r\n\x1a\n\0\0\0\x0dIHDR\0\0\xea\x60\0\0\xea\x60\x08\0\0\0\0".to_vec();
    let checksum = !bomb[12..].iter().fold(u32::MAX, |crc, &byte| {
        (0..8).fold(crc ^ u32::from(byte), |crc, _| {
            (crc >> 1) ^ (0xedb8_8320 & 0u32.wrapping_sub(crc & 1))
        })
    });
    bomb.extend(checksum.to_be_bytes());
    std::fs::write(path("bomb.png"), bomb).unwrap();
    for (name, left, more) in [
        ("singular.toml", "[[0, 0, 80], [0, 300, 60], [0, 0, 1]]", ""),
        ("skewed.toml", "[[300, 5, 80], [0, 300, 60], [0, 0, 1]]", ""),
        (
            "beside.toml",
            "[[300, 0, 80], [0, 300, 60], [0, 0, 1]]",
            "lidar_position_m = [900, 0, 0]",
        ),
        (
            "unknown.toml",
            "[[300, 0, 80], [0, 300, 60], [0, 0, 1]]",
            "bias = 1",
        ),
    ] {
        std::fs::write(
            path(name),
            format!("left = {left}\nbaseline_m = 1\n{more}\n"),
        )
        .unwrap();
    }
    let refused = |arguments: &[&str], says: &str| {
        let before = std::fs::read_dir(here.path()).unwrap().count();
        let output = gdtof(here.path(), arguments);
        let error = String::from_utf8(output.stderr).unwrap();
        assert_eq!(output.status.code(), Some(2), "{arguments:?}: {error}");
        assert!(
            error.contains(says),
            "{arguments:?}: {error:?} does not say {says:?}"
        );
        assert_eq!(error.trim_end().lines().count(), 1, "{error}");
        assert_eq!(std::fs::read_dir(here.path()).unwrap().count(), before);
    };
    let with = |place: usize, file: &'static str| {
        let mut arguments = FRAME.to_vec();
        arguments[place] = file;
        arguments
    };
    refused(
        &with(4, "small.png"),
        "160 x 120 pixels and the right one 4 x 4",
    );
    refused(&with(2, "broken.png"), "broken.png: ");
    refused(&with(2, "bomb.png"), "60000 x 60000 pixels");
    refused(&with(2, "truth.npy"), "is not a PNG");
    refused(&with(6, "singular.toml"), "are singular; give [[f, 0, u]");
    refused(&with(6, "skewed.toml"), "not those of a rectified camera");
    refused(
        &with(6, "beside.toml"),
        "puts every pixel of the pair outside",
    );
    refused(
        &with(6, "unknown.toml"),
        "unknown.toml:3: unknown key `bias`",
    );
    refused(
        &[&FRAME[..], &["--truth", "small.npy"]].concat(),
        "has 2 x 2 values",
    );
    refused(
        &[&FRAME[..], &["--truth", "none.npy"]].concat(),
        "no pixel has a depth",
    );
    refused(
        &["stereo", "left.png", "right.png", "--disparities", "0"],
        "are impossible; give 1 to 256",
    );
    refused(
        &["stereo", "left.png", "right.png", "--census", "8x8"],
        "must be odd",
    );
    refused(
        &["stereo", "left.png", "right.png", "--p1", "99"],
        "must not decrease",
    );
}

#[test]
fn the_motorcycle_is_matched_better_than_by_what_is_usual() {
    let folder = std::env::var_os("GDTOF_DATA").map_or_else(
        || Path::new(env!("CARGO_MANIFEST_DIR")).join("../shared/data"),
        PathBuf::from,
    );
    let [left, right] = ["left", "right"].map(|side| folder.join(format!("motorcycle_{side}.png")));
    if !left.exists() {
        // Not eprintln, which cargo hides where a test passes.
        let _ = writeln!(
            std::io::stderr(),
            "SKIPPED: {} is not there; set GDTOF_DATA",
            left.display()
        );
        return;
    }
    let here = tempfile::tempdir().unwrap();
    let output = gdtof(
        here.path(),
        &[
            "stereo",
            left.to_str().unwrap(),
            right.to_str().unwrap(),
            "--json",
        ],
    );
    let report = json(&output);
    // Without truth, which stands in a kind of file that we do not read: how much passes our own checks (measured: 323 700).
    assert!(report["matched"].as_u64().unwrap() > 310_000, "{report:#}");
}
