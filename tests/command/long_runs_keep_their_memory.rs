//! Long sweeps and drives: the same memory however long they are, and killed and resumed on the way.
//!
//! `GDTOF_SOAK="10000 100000 1000000"` gives sweeps of so many points and `GDTOF_SOAK_FRAMES="10 100 1000"` drives of so many frames, of which
//! the cheap ones here have few. `GDTOF` names a program to use instead of the one built with the tests. `--nocapture` shows the table.

use std::fs;
use std::path::Path;
use std::process::{Command, Stdio};
use std::time::{Duration, Instant};

/// The grid of the book's theoretical study: 2000 points for each range.
const STUDY: &str = "\
[study]
kind = \"theory\"
[vary]
theory.illuminance_klux = [0, 10, 50, 100]
theory.range_m = { from = 2, to = 200, steps = STEPS }
theory.laser_cycles = { from = 50, to = 16000, steps = 25, scale = \"log\" }
theory.guide_sigma_m = { from = 0.1, to = 10, steps = 20, scale = \"log\" }
";

/// Peak of resident memory of a run, MB, killed after some time if it has not ended; and whether it has ended, with success.
fn run(here: &Path, words: &[&str], killed_after: Option<Duration>) -> (f64, bool) {
    let program = std::env::var("GDTOF").unwrap_or_else(|_| env!("CARGO_BIN_EXE_gdtof").into());
    let mut command = Command::new(program);
    command
        .args(words)
        .args(["--quiet", "--threads", "2"])
        .current_dir(here);
    let mut child = command.stdout(Stdio::null()).spawn().unwrap();
    let (begun, status) = (Instant::now(), format!("/proc/{}/status", child.id()));
    let mut peak_mb = 0.0;
    loop {
        let said = fs::read_to_string(&status).unwrap_or_default();
        let line = said.lines().find_map(|line| line.strip_prefix("VmHWM:"));
        let kb = line.and_then(|line| line.trim().strip_suffix(" kB")?.parse::<f64>().ok());
        peak_mb = kb.map_or(peak_mb, |kb| kb * 1e-3);
        if let Some(status) = child.try_wait().unwrap() {
            return (peak_mb, status.success());
        }
        if killed_after.is_some_and(|after| begun.elapsed() > after) {
            child.kill().unwrap();
            child.wait().unwrap();
            return (peak_mb, false);
        }
        std::thread::sleep(Duration::from_millis(5));
    }
}

fn sizes(name: &str, cheap: &str) -> Vec<u64> {
    let given = std::env::var(name).unwrap_or_else(|_| cheap.into());
    given.split(' ').map(|size| size.parse().unwrap()).collect()
}

/// Besides them, Parquet holds a group of 65536 rows.
#[test]
fn a_sweep_needs_16_bytes_a_point_and_survives_kills() {
    let dir = tempfile::tempdir().unwrap();
    let here = dir.path();
    let mut smallest_mb = f64::INFINITY;
    for points in sizes("GDTOF_SOAK", "4000 8000") {
        let study = STUDY.replace("STEPS", &(points / 2000).to_string());
        fs::write(here.join("study.toml"), study).unwrap();
        let out = points.to_string();
        let words = ["sweep", "study.toml", "--out", &out];
        let (mut peak_mb, mut runs, begun) = (0f64, 0, Instant::now());
        loop {
            // Runs become longer, so that it comes to an end.
            let share = f64::from(runs) * 0.618 % 1.0 + 0.2;
            let patience = Duration::from_secs_f64(share * f64::from(1 << runs.min(20)) * 0.2);
            let (peak, is_done) = run(here, &words, Some(patience));
            (peak_mb, runs) = (peak_mb.max(peak), runs + 1);
            if is_done {
                break;
            }
        }
        let table = fs::read_to_string(here.join(&out).join("results.csv")).unwrap();
        assert_eq!(table.lines().count() as u64, points + 1);
        println!(
            "sweep of {points} points: {runs} runs, all but the last killed, {:.0} s, peak {peak_mb:.1} MB",
            begun.elapsed().as_secs_f64()
        );
        smallest_mb = smallest_mb.min(peak_mb);
        assert!(
            peak_mb < smallest_mb + 16e-6 * points as f64 + 40.0,
            "{peak_mb} MB"
        );
        if points < 10_000 {
            assert!(run(here, &[&words[..3], &["whole"]].concat(), None).1);
            let whole = fs::read_to_string(here.join("whole/results.csv")).unwrap();
            assert!(whole == table, "a killed sweep gives another table");
            fs::remove_dir_all(here.join("whole")).unwrap();
        }
    }
}

/// Most write nearly two million pulses, of which each would need 16 bytes. In one file and in one for each macropixel, whether pulses are drawn in groups of laser cycles or one after the other.
#[test]
fn photons_need_the_same_memory_for_any_number_of_laser_cycles() {
    let dir = tempfile::tempdir().unwrap();
    for (name, light, few, many) in [
        ("dim", "--scene night --fov-deg 0.5", "20000", "120000"),
        ("bright", "--fov-deg 0.2 --spads 4", "2000", "100000"),
    ] {
        for format in ["csv", "txt", "memh --word-ns 100", "npy", "vcd --no-clk"] {
            let mut first_mb = None;
            for cycles in [few, many] {
                let words = format!(
                    "photons {light} --period-ns 400 --laser-cycles {cycles} --format {format} --out {name}"
                );
                let words: Vec<&str> = words.split(' ').collect();
                let (peak_mb, is_done) = run(dir.path(), &words, None);
                assert!(is_done, "{words:?}");
                println!("{cycles} laser cycles as {format}, {name}: peak {peak_mb:.1} MB");
                assert!(
                    peak_mb < *first_mb.get_or_insert(peak_mb) + 20.0,
                    "{words:?}: {peak_mb} MB"
                );
            }
        }
    }
}

#[test]
fn a_drive_needs_the_same_memory_for_any_number_of_frames() {
    let dir = tempfile::tempdir().unwrap();
    let mut first_mb = None;
    for frames in sizes("GDTOF_SOAK_FRAMES", "2 8") {
        let frames = frames.to_string();
        let small = "drive --rows 4 --cols 6 --laser-cycles 40 --no-pictures --set scene.light.illuminance_klux=0 --set scene.lidar.pulse_energy_uj=0.1";
        let words = small
            .split(' ')
            .chain(["--frames", &frames, "--out", &frames]);
        let begun = Instant::now();
        let (peak_mb, is_done) = run(dir.path(), &words.collect::<Vec<_>>(), None);
        assert!(is_done);
        println!(
            "drive of {frames} frames: {:.0} s, peak {peak_mb:.1} MB",
            begun.elapsed().as_secs_f64()
        );
        assert!(
            peak_mb < *first_mb.get_or_insert(peak_mb) + 20.0,
            "{peak_mb} MB"
        );
    }
}
