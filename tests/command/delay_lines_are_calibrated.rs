//! `gdtof calibrate` and `gdtof frame --calibration`: bins of delay lines are measured, kept, used, and another sensor's refused.

use std::path::Path;
use std::process::{Command, Output};

fn gdtof(folder: &Path, arguments: &str) -> Output {
    let mut command = Command::new(env!("CARGO_BIN_EXE_gdtof"));
    command.args(arguments.split(' ')).current_dir(folder);
    command.output().unwrap()
}

const SENSOR: &str = "--sensor hslidar_delay_line --rows 8 --cols 16";
const FRAME: &str = "--stop-periods 140 --laser-cycles 3000 --set scene.lidar.pde=0.01 --json";

/// Median absolute error of the depths, m.
fn median_error_m(output: &Output) -> f64 {
    let said = String::from_utf8_lossy(&output.stderr);
    assert!(output.status.success(), "{said}");
    let report: serde_json::Value = serde_json::from_slice(&output.stdout).unwrap();
    let pixels = report["macropixels"].as_array().unwrap().iter();
    let error = |pixel: &serde_json::Value| {
        let (measured, truth) = (pixel["measured_m"].as_f64()?, pixel["true_m"].as_f64()?);
        Some((measured - truth).abs())
    };
    let mut errors: Vec<f64> = pixels.filter_map(error).collect();
    assert!(errors.len() > 30, "{} depths", errors.len());
    errors.sort_by(f64::total_cmp);
    errors[errors.len() / 2]
}

#[test]
fn a_calibration_makes_depths_better_and_belongs_to_its_sensor() {
    let folder = tempfile::tempdir().unwrap();
    let folder = folder.path();
    let swept = gdtof(folder, &format!("calibrate {SENSOR} --out c.json"));
    assert!(swept.status.success());
    let table = String::from_utf8(swept.stdout).unwrap();
    assert!(table.contains("1024 bins"), "{table}");
    // Windows of a line are whole steps of CLK apart: what differs is where the laser's steps and photons fell.
    let every =
        "calibrate --sensor hslidar_delay_line --rows 1 --cols 2 --every-window --out e.json";
    let swept = gdtof(folder, every);
    let table = String::from_utf8(swept.stdout).unwrap();
    let line = table.lines().find(|line| line.contains("differ by"));
    let before_unit = line.and_then(|line| line.split(" ps").next()).unwrap();
    let largest_ps: f64 = before_unit.rsplit(' ').next().unwrap().parse().unwrap();
    assert!(
        table.contains("16 bins, mean of") && (1.0..60.0).contains(&largest_ps),
        "{table}"
    );
    let without = median_error_m(&gdtof(folder, &format!("frame {SENSOR} {FRAME}")));
    let calibrated = format!("frame {SENSOR} {FRAME} --calibration c.json");
    let frame = gdtof(folder, &calibrated);
    let with = median_error_m(&frame);
    assert!(with < 0.5 * without, "{with} {without}");

    // Depths from its histograms once more: with the calibration the same to the bit, and worse without.
    let range = "range --format frame --histograms out/histograms.npy --json";
    let again = gdtof(folder, &format!("{range} --calibration c.json"));
    let depths = |output: &Output| {
        let report: serde_json::Value = serde_json::from_slice(&output.stdout).unwrap();
        report["macropixels"].clone()
    };
    assert_eq!(depths(&again), depths(&frame));
    let uncalibrated = median_error_m(&gdtof(folder, range));
    assert!(with < 0.5 * uncalibrated, "{with} {uncalibrated}");

    for (arguments, says) in [
        (
            "--set sensor.delay_control_v=0.72",
            "it was measured on a sensor with delay_control_v = 0.7, but this one has delay_control_v = 0.72; make one",
        ),
        (
            "--set sensor.delay_seed=2",
            "it was measured on a sensor with delay_seed = 1, but this one",
        ),
        (
            "--set sensor.clk_skew_ps=-1",
            "clk_skew_ps = -1 is impossible; give 0 to 200",
        ),
    ] {
        let refused = gdtof(folder, &format!("{calibrated} --out other {arguments}"));
        let said = String::from_utf8(refused.stderr).unwrap();
        assert_eq!(refused.status.code(), Some(2), "{said}");
        assert!(said.contains(says), "{said}");
        assert!(!folder.join("other").exists());
    }
}

#[test]
fn what_cannot_be_calibrated_is_refused() {
    let folder = tempfile::tempdir().unwrap();
    let folder = folder.path();
    std::fs::write(folder.join("text.json"), "no profile").unwrap();
    for (arguments, says) in [
        (
            "calibrate --sensor hslidar",
            "--sensor: bins of a clocked TDC are CLK periods",
        ),
        (
            "calibrate --sensor hslidar_delay_line --step-ps 0",
            "--step-ps: 0 is impossible; give",
        ),
        (
            "calibrate --sensor hslidar_delay_line --rows 1 --cols 2 --stop-periods 4",
            "--stop-periods: no window of an odd start value lies within the laser cycle",
        ),
        (
            "frame --sensor hslidar_delay_line --stop-periods 140 --calibration text.json",
            "text.json:1: this is no JSON; give a bin profile",
        ),
        (
            "frame --sensor hslidar_delay_line --stop-periods 140 --engine cycle",
            "use --engine window, cohort or gate",
        ),
        (
            "timing --sensor hslidar_delay_line",
            "--sensor: the tables are those of a shift register",
        ),
    ] {
        let refused = gdtof(folder, arguments);
        let said = String::from_utf8(refused.stderr).unwrap();
        assert_eq!(refused.status.code(), Some(2), "{arguments}: {said}");
        assert!(said.contains(says), "{said}");
        assert_eq!(said.lines().count(), 1, "{said}");
    }
}
