//! `gdtof propose`: files that `gdtof frame` takes and that keep what is promised; refusals that leave nothing behind.

use super::tools::{gdtof, gdtof_words};

const ASKED: &str =
    "propose --range 20 --reflectivity 0.1 --klux 1 --fps 50 --detection 0.95 --precision 0.1";
const FEW: &str = " --bins 8,16 --clk 200,384 --thresholds 0 --guide-sigma 0.3";

#[test]
fn a_proposed_chip_is_taken_by_frame_and_keeps_its_promise() {
    let folder = tempfile::tempdir().unwrap();
    let output = gdtof_words(folder.path(), &format!("{ASKED}{FEW}"));
    let said = String::from_utf8(output.stdout).unwrap();
    assert!(
        output.status.success(),
        "{}",
        String::from_utf8_lossy(&output.stderr)
    );
    assert!(
        said.contains("The QuantIC4x4 is not on the front"),
        "{said}"
    );
    let table = std::fs::read_to_string(folder.path().join("propose/designs.csv")).unwrap();
    let balanced = table
        .lines()
        .find(|line| line.starts_with("balanced,"))
        .unwrap();
    let balanced_value = |name: &str| {
        let head = table.lines().next().unwrap().split(',');
        let column = head.clone().position(|heading| heading == name).unwrap();
        balanced
            .split(',')
            .nth(column)
            .unwrap()
            .parse::<f64>()
            .unwrap()
    };
    assert!(table.contains("\nthis sensor,"));
    let svg = std::fs::read_to_string(folder.path().join("propose/front.svg")).unwrap();
    assert!(svg.contains("balanced: sensor.toml"));

    let frame = said
        .lines()
        .find(|line| line.trim_start().starts_with("gdtof frame"));
    let words = frame
        .unwrap()
        .trim()
        .trim_start_matches("gdtof ")
        .to_owned();
    let words = format!("{words} --engine cohort --probe none --out frame");
    let output = gdtof_words(folder.path(), &words);
    assert!(
        output.status.success(),
        "{}",
        String::from_utf8_lossy(&output.stderr)
    );
    let text = std::fs::read_to_string(folder.path().join("frame/frame.json")).unwrap();
    let report: serde_json::Value = serde_json::from_str(&text).unwrap();
    let errors_m = report["macropixels"]
        .as_array()
        .unwrap()
        .iter()
        .filter_map(|pixel| Some(pixel["measured_m"].as_f64()? - pixel["true_m"].as_f64()?));
    let errors_m: Vec<f64> = errors_m.filter(|error_m| error_m.abs() < 0.75).collect();
    let found = errors_m.len() as f64 / 4096.0;
    let square: f64 = errors_m.iter().map(|error_m| error_m * error_m).sum();
    let sigma_m = (square / errors_m.len() as f64).sqrt();
    // Four standard errors of 4096 macropixels.
    assert!(
        found > balanced_value("detection") - 4.0 * (0.05 * 0.95 / 4096.0f64).sqrt(),
        "{found}"
    );
    let ratio = sigma_m / balanced_value("precision_m");
    assert!((0.85..1.15).contains(&ratio), "{ratio}");
}

#[test]
fn what_cannot_be_is_refused_in_a_sentence() {
    let folder = tempfile::tempdir().unwrap();
    let more = format!("{ASKED}{FEW}");
    for (from, to, says) in [
        ("--range 20", "--range 0", "range_m = 0 is impossible"),
        ("--range 20", "--range NaN", "range_m = NaN is impossible"),
        (
            "--reflectivity 0.1",
            "--reflectivity 1.5",
            "reflectivity = 1.5",
        ),
        ("--klux 1", "--klux=-1", "illuminance_klux = -1"),
        ("--fps 50", "--fps 0", "fps = 0"),
        ("--detection 0.95", "--detection 1", "detection = 1"),
        ("--precision 0.1", "--precision inf", "precision_m = inf"),
        ("--bins 8,16", "--bins 8,65", "bins = 65"),
        ("--clk 200,384", "--clk NaN", "clk_hz = NaN"),
        ("--guide-sigma 0.3", "--guide-sigma 0", "guide_sigma_m = 0"),
        (
            "--guide-sigma 0.3",
            "--guide-sigma 50",
            "the guide: its error of 50 m",
        ),
        ("--klux 1", "--klux 150", "class 1"),
        ("--fps 50", "--fps 90000", "times too short"),
        ("--clk 200,384", "--clk 1500", "static timing at 1500 MHz"),
        (
            "--range 20",
            "--range 20 --sensor hslidar_delay_line",
            "delay lines",
        ),
        (
            "--range 20",
            "--range 20 --set scene.lidar.wavelength_nm=1300",
            "1300 nm is not judged for the safety of eyes; give 700 to 1200 nm or 1500 to 1800 nm",
        ),
    ] {
        // Far enough that the sun decides, and a source that is allowed little.
        let words = more.replace(from, to);
        let words = match to {
            "--klux 150" => words.replace(
                "--range 20",
                "--range 150 --set scene.lidar.laser_source_mm=0",
            ),
            _ => words,
        };
        let words: Vec<&str> = words.split(' ').collect();
        let output = gdtof(folder.path(), &words);
        let error = String::from_utf8(output.stderr).unwrap();
        assert_eq!(output.status.code(), Some(2), "{to}: {error}");
        assert!(error.contains(says), "{to}: {error}");
        assert!(output.stdout.is_empty());
        let left = std::fs::read_dir(folder.path()).unwrap().count();
        assert_eq!(left, 0, "{to} left something behind");
    }
}
