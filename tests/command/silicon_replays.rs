//! `gdtof replay` in any silicon: columns to which CLK comes late, timing checks under process, voltage, temperature and mismatch, and
//! what is said of the timing.

use std::path::Path;

use super::tools::gdtof_words;

fn folder(starts: &str, events: &str) -> tempfile::TempDir {
    let folder = tempfile::tempdir().unwrap();
    let write = |name: &str, text: String| std::fs::write(folder.path().join(name), text).unwrap();
    write("inits.csv", format!("row,col,init\n{starts}"));
    write("events.csv", format!("time_fs,row,col,spad\n{events}"));
    folder
}

/// Counts that are not zero, and what was said.
fn replay(folder: &Path, more: &str) -> (Vec<String>, String) {
    let words = format!("replay --inits inits.csv --events events.csv {more}");
    let output = gdtof_words(folder, &words);
    let said = String::from_utf8(output.stderr).unwrap();
    assert!(output.status.success(), "{words}: {said}");
    let counts = String::from_utf8(output.stdout).unwrap();
    let counted = counts.lines().skip(1).filter(|line| !line.ends_with(",0"));
    (counted.map(str::to_owned).collect(), said)
}

#[test]
fn a_skewed_column_counts_alike_with_and_without_a_waveform() {
    let folder = folder("0,0,0\n0,1,0\n0,2,0\n", "156000000,0,2,0\n");
    let chip = "--sensor hslidar_delay_line --set sensor.clk_skew_ps=120 --set sensor.delay_sigma=0 --rows 1 --cols 3 --stop-periods 12 --laser-cycles 2";
    for (silicon, bin) in [
        ("--set sensor.corner=slow", 5),
        ("--set sensor.corner=slow --process slow", 6),
        (
            "--set sensor.corner=slow --temperature 100 --mismatch 0.1",
            6,
        ),
    ] {
        for engine in ["gate", "gate --vcd a.vcd", "gate --checks report", "window"] {
            let (counts, _) = replay(
                folder.path(),
                &format!("{chip} {silicon} --engine {engine}"),
            );
            assert_eq!(counts, [format!("0,2,{bin},1")], "{silicon}, {engine}");
        }
    }
}

#[test]
fn what_counts_nothing_says_where_windows_are() {
    // Nanoseconds in the place of femtoseconds.
    let folder = folder("0,0,100\n", "250,0,0,0\n");
    let said = |more: &str| {
        let chip = "--rows 1 --cols 1 --laser-cycles 2";
        let (counts, said) = replay(folder.path(), &format!("{chip} {more}"));
        assert!(counts.is_empty(), "{counts:?}");
        said
    };
    for engine in ["gate", "window"] {
        let never = said(&format!("--stop-periods 80 --engine {engine}"));
        assert!(never.contains("opens a window within 80 CLK"), "{never}");
        let elsewhere = said(&format!("--stop-periods 200 --engine {engine}"));
        let where_it_is = "start value 100 is from 217.";
        assert!(elsewhere.contains(where_it_is), "{elsewhere}");
    }
}

#[test]
fn checks_are_those_of_the_silicon() {
    // In every other CLK period of the window, so that the shift register changes when it is strobed.
    let photons = (0..20).map(|k| format!("{},0,0,{}\n", 30_000_000 + 5_208_333 * k, k % 16));
    let folder = folder("0,0,30\n", &photons.collect::<String>());
    let chip = "--rows 1 --cols 1 --stop-periods 60 --laser-cycles 2 --engine gate";
    let violated = |silicon: &str| {
        let more = format!("{chip} {silicon}");
        let (plain, _) = replay(folder.path(), &more);
        let checks = format!("{more} --checks report --checks-json c.json");
        let (counts, _) = replay(folder.path(), &checks);
        assert_eq!(counts, plain, "{silicon}");
        let text = std::fs::read_to_string(folder.path().join("c.json")).unwrap();
        let report: serde_json::Value = serde_json::from_str(&text).unwrap();
        report["violations"].as_array().unwrap().len()
    };
    assert_eq!(violated("--mismatch 0"), 0);
    assert_eq!(violated("--process fast --temperature 0"), 0);
    assert_eq!(
        violated("--voltage 1.15 --mismatch 0.02 --mismatch-seed 4"),
        0
    );
    // The strobe meets the change of the shift register.
    assert!(violated("--voltage 1.03 --set sensor.clk_hz=384e6") > 0);
}

#[test]
fn what_is_said_of_the_timing_is_what_frames_are_told() {
    let folder = folder("0,0,10\n", "15600000,0,0,0\n");
    let chip = "--rows 1 --cols 1 --stop-periods 60 --laser-cycles 2";
    let later = "windows end 1 bin later, as the window law has it";
    let report = |more: &str| replay(folder.path(), &format!("{chip} {more}")).1;
    assert!(report("--set sensor.clk_hz=450e6").contains(later));
    assert!(!report("--set sensor.clk_hz=450e6 --quiet").contains(later));
    assert!(!report("--set sensor.clk_hz=384e6").contains(later));
    let lines = "--sensor hslidar_delay_line --set sensor.mode=conventional";
    let said = report(lines);
    assert!(!said.contains("timing fails"), "{said}");
}
