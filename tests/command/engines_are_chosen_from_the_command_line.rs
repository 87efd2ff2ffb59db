//! `gdtof frame` on every engine, `--tolerance`, and the commands that measure the engines: `speed` and `pareto`.

use guided_dtof::files::read_array;
use std::path::Path;
use std::process::Command;

use serde_json::Value;

fn gdtof(folder: &Path, arguments: &[&str]) -> String {
    let output = Command::new(env!("CARGO_BIN_EXE_gdtof"))
        .args(arguments)
        .current_dir(folder)
        .output()
        .unwrap();
    let error = String::from_utf8_lossy(&output.stderr);
    assert!(output.status.success(), "{arguments:?}: {error}");
    String::from_utf8(output.stdout).unwrap()
}

/// Histograms and frame.json of a small frame.
fn frame(arguments: &[&str]) -> (Vec<u16>, Value) {
    let here = tempfile::tempdir().unwrap();
    let small = ["frame", "--rows", "4", "--cols", "4", "--probe", "none"];
    let said = gdtof(here.path(), &[&small, arguments, &["--json"]].concat());
    let file = here.path().join("out/histograms.npy");
    let counts = read_array(&file, &[4, 4, 16]).unwrap();
    (counts, serde_json::from_str(&said).unwrap())
}

#[test]
fn engines_with_the_same_photons_make_the_same_histograms() {
    let frame_by =
        |engine: &[&str]| frame(&[&["--laser-cycles", "2", "--engine"], engine].concat());
    let (gates, report) = frame_by(&["gate"]);
    assert_eq!(report["engine"], "gate");
    assert!(gates.iter().any(|&count| count > 0));
    for engine in [&["cycle"][..], &["window"], &["window", "--no-skip"]] {
        assert_eq!(frame_by(engine).0, gates, "{engine:?}");
    }
}

#[test]
fn histograms_without_photons_have_as_many_counts() {
    let total = |engine: &[&str]| {
        let (counts, _) = frame(&[&["--engine"], engine].concat());
        counts.into_iter().map(f64::from).sum::<f64>()
    };
    // Macropixels that are 16 times as wide as the default ones are bright enough to keep SPADs busy from laser cycle to laser
    // cycle, which cohort refuses.
    let total = |engine: &[&str]| total(&[engine, &["--set", "scene.lidar.pde=0.02"]].concat());
    let drawn = total(&["window"]);
    let spread = (2.0 * drawn).sqrt();
    let cohort = total(&["cohort"]);
    let off = (cohort - drawn) / spread;
    assert!(off.abs() < 5.0, "{cohort} for {drawn}");
}

#[test]
fn a_probe_names_the_engine_it_is_compared_with() {
    let choices = [
        (["--engine", "cycle"], "cycle"),
        (["--engine", "cohort"], "window"),
        (["--tolerance", "0.01"], "window"),
    ];
    for (choice, compared_with) in choices {
        let here = tempfile::tempdir().unwrap();
        let small = "frame --rows 4 --cols 4 --laser-cycles 2 --set scene.lidar.pde=0.02";
        let small: Vec<&str> = small.split(' ').collect();
        let table = gdtof(here.path(), &[&small[..], &choice].concat());
        let said = format!("agree with the engine {compared_with} in 2 laser cycles");
        assert!(table.contains(&said), "{choice:?}: {table}");
    }
}

#[test]
fn gates_simulate_what_the_waveform_keeps_and_64_laser_cycles_at_least() {
    for (waves, cycles) in [
        (&[][..], 64),
        (&["--wave-cycles", "all"], 100),
        (&["--wave-cycles", "80"], 81),
        (&["--engine", "cycle"], 100),
    ] {
        let here = tempfile::tempdir().unwrap();
        let small = "frame --rows 4 --cols 4 --laser-cycles 100";
        let small: Vec<&str> = small.split(' ').collect();
        let table = gdtof(here.path(), &[&small[..], waves].concat());
        let said = format!("in {cycles} laser cycles");
        assert!(table.contains(&said), "{waves:?}: {table}");
    }
}

#[test]
fn a_tolerance_is_kept_and_its_bound_reported() {
    let on_window = ["0", "0.1"].map(|tolerance| {
        let report = &frame(&["--tolerance", tolerance]).1["tolerance"];
        let bound = report["bound_m"].as_f64().unwrap();
        assert!(bound <= tolerance.parse().unwrap(), "{report}");
        report["on_window"].as_u64().unwrap()
    });
    assert!(on_window[0] > on_window[1]);
}

/// A wall so near that its echo saturates SPADs, seen by a compact sensor indoors.
const WALL_AT_60_CM: &str = r#"
[lidar]
fov_deg = 16.0
pulse_energy_uj = 0.002
pulse_fwhm_ns = 4.5
pde = 0.185
lens_diameter_mm = 4.0
lens_f_number = 2.2
dark_count_hz = 20000.0
[stereo]
baseline_m = 0.05
max_disparity_px = 1000.0
position_m = [-0.025, 0.0, 0.0]
[light]
illuminance_klux = 5.0
[[object]]
name = "wall"
kind = "plane"
centre_m = [0.0, 0.0, 0.60]
normal = [0.0, 0.0, 1.0]
width_m = 10.0
height_m = 10.0
reflectivity = 0.3
"#;

/// The cohort engine takes the wall, and on average its depths are no farther from those of the window engine than the
/// bound says.
#[test]
fn the_bound_covers_the_difference_before_a_near_wall() {
    let here = tempfile::tempdir().unwrap();
    std::fs::write(here.path().join("wall.toml"), WALL_AT_60_CM).unwrap();
    let wall = |more: &[&str]| -> Value {
        let small =
            "frame --rows 16 --cols 16 --scene wall.toml --laser-cycles 16000 --probe none --json";
        let arguments: Vec<&str> = small.split(' ').chain(more.iter().copied()).collect();
        serde_json::from_str(&gdtof(here.path(), &arguments)).unwrap()
    };
    let (exact, chosen) = (wall(&[]), wall(&["--tolerance", "0.001"]));
    let kept = &chosen["tolerance"];
    assert_eq!(kept["on_cohort"], 256, "{kept}");
    let bound_m = kept["bound_m"].as_f64().unwrap();
    assert!(bound_m > 0.0 && bound_m <= 0.001, "{kept}");

    let depths = |report: &Value| -> Vec<f64> {
        let pixels = report["macropixels"].as_array().unwrap();
        let depth = |pixel: &Value| pixel["peak_m"].as_f64().expect("a peak");
        pixels.iter().map(depth).collect()
    };
    let (exact, chosen) = (depths(&exact), depths(&chosen));
    let off: Vec<f64> = chosen.iter().zip(&exact).map(|(a, b)| a - b).collect();
    let n = off.len() as f64;
    let mean = off.iter().sum::<f64>() / n;
    let variance = off.iter().map(|off| (off - mean).powi(2)).sum::<f64>() / (n - 1.0);
    // Chance: 4 standard errors of the mean over macropixels with photons and draws of their own.
    let chance = 4.0 * (variance / n).sqrt();
    println!("off by {mean:.2e} m, chance {chance:.2e} m, bound {bound_m:.2e} m");
    assert!(chance < 1e-3, "too noisy to tell: {chance}");
    assert!(
        mean.abs() <= bound_m + chance,
        "{mean} m, bound {bound_m} m, chance {chance} m"
    );
}

#[test]
fn a_refusal_of_the_cohort_engine_says_what_it_costs() {
    // Laser cycles hardly longer than the window: SPADs may stay busy from one to the next.
    let crowded = ["--scene", "wall.toml", "--stop-periods", "24"];
    let here = tempfile::tempdir().unwrap();
    std::fs::write(here.path().join("wall.toml"), WALL_AT_60_CM).unwrap();
    let frame = |more: &[&str]| {
        let small = ["frame", "--rows", "4", "--cols", "4", "--probe", "none"];
        let arguments = [&small[..], &crowded, more].concat();
        Command::new(env!("CARGO_BIN_EXE_gdtof"))
            .args(arguments)
            .current_dir(here.path())
            .output()
            .unwrap()
    };
    let refused = frame(&["--engine", "cohort"]);
    let error = String::from_utf8(refused.stderr).unwrap();
    assert_eq!(refused.status.code(), Some(2), "{error}");
    assert!(error.contains("16 of 16 macropixels"), "{error}");

    let done = frame(&["--tolerance", "0.1", "--verbose"]);
    let table = String::from_utf8(done.stdout).unwrap();
    assert!(
        table.contains("refused by cohort: laser cycles may depend"),
        "{table}"
    );
    assert!(table.contains("run time of those refused"), "{table}");
}

#[test]
fn speed_is_measured_for_every_engine_and_size() {
    let here = tempfile::tempdir().unwrap();
    let said = gdtof(
        here.path(),
        &["speed", "--runs", "1", "--largest", "4", "--json"],
    );
    let figures: Vec<Value> = serde_json::from_str(&said).unwrap();
    for work in ["cycle-packing", "window-whole", "cohort"] {
        for side in [1, 4] {
            let is_it = |f: &&Value| f["work"] == work && f["rows"] == side;
            let figure = figures.iter().find(is_it).expect("a figure");
            assert!(
                figure["wall"]["median_s"].as_f64().unwrap() > 0.0,
                "{figure}"
            );
        }
    }
    let table = gdtof(here.path(), &["speed", "--runs", "1", "--largest", "1"]);
    assert!(table.contains("cohort"), "{table}");
}

#[test]
fn run_time_against_error_comes_as_table_csv_and_picture() {
    let here = tempfile::tempdir().unwrap();
    let small =
        "pareto --no-gate --ranges 20 --klux 1 --macropixels 8 --laser-cycles 40 --repeats 1";
    let said = gdtof(here.path(), &small.split(' ').collect::<Vec<_>>());
    assert!(said.contains("window, no skipping"), "{said}");
    let csv = std::fs::read_to_string(here.path().join("pareto/pareto.csv")).unwrap();
    assert!(csv.lines().count() > 5, "{csv}");
    let picture = std::fs::read_to_string(here.path().join("pareto/pareto.svg")).unwrap();
    assert!(picture.starts_with("<svg"), "{picture}");
    assert!(here.path().join("pareto/pareto_cells.csv").exists());
}

/// Recorded pulses of a sensor with one macropixel on one engine: its output.
fn replayed(sensor: &str, events: &str, engine: &str, more: &[&str]) -> std::process::Output {
    let folder = tempfile::tempdir().unwrap();
    let write = |name: &str, text: &str| std::fs::write(folder.path().join(name), text).unwrap();
    write("sensor.toml", sensor);
    write("inits.csv", "row,col,init\n0,0,20\n");
    write("events.csv", &format!("time_fs,row,col,spad\n{events}"));
    let arguments = "replay --sensor sensor.toml --rows 1 --cols 1 --inits inits.csv --events events.csv \
        --stop-periods 100 --laser-cycles 1 --out counts.csv --engine";
    Command::new(env!("CARGO_BIN_EXE_gdtof"))
        .args(
            arguments
                .split_whitespace()
                .chain([engine])
                .chain(more.iter().copied()),
        )
        .current_dir(folder.path())
        .output()
        .unwrap()
}

#[test]
fn photons_that_cancel_are_told_of_on_every_engine() {
    let sensor = "clk_hz = 100e6\ndead_time_ns = 1.0\n";
    for engine in ["gate", "cycle", "window"] {
        let output = replayed(
            sensor,
            "101000000,0,0,3\n103000000,0,0,3\n",
            engine,
            &["--json"],
        );
        let said = String::from_utf8(output.stderr).unwrap();
        assert!(output.status.success(), "{engine}: {said}");
        assert!(said.contains("2 photons cancel"), "{engine}: {said}");
        let summary: Value = serde_json::from_slice(&output.stdout).unwrap();
        assert_eq!(summary["photons_that_cancel"], 2, "{engine}");
        let apart = replayed(
            sensor,
            "101000000,0,0,3\n113000000,0,0,3\n",
            engine,
            &["--json"],
        );
        let summary: Value = serde_json::from_slice(&apart.stdout).unwrap();
        assert_eq!(summary["photons_that_cancel"], 0, "{engine}");
        assert!(apart.stderr.is_empty(), "{engine}");
    }
}

#[test]
fn a_frame_states_its_timing_and_the_photons_that_cancel() {
    let (_, told) = frame(&["--laser-cycles", "20"]);
    assert_eq!(told["timing"]["met"], true);
    assert!(told["timing"]["slack_ps"].as_f64().unwrap() > 0.0);
    assert!(
        told["timing"]["path"]
            .as_str()
            .unwrap()
            .contains("mp_r0_c0")
    );
    assert_eq!(told["work"]["cancelled"], 0);

    let folder = tempfile::tempdir().unwrap();
    let sensor = folder.path().join("sensor.toml");
    std::fs::write(&sensor, "clk_hz = 500e6\ndead_time_ns = 0.5\n").unwrap();
    let arguments = [
        "--laser-cycles",
        "300",
        "--sensor",
        sensor.to_str().unwrap(),
        "--engine",
    ];
    let told = ["window", "cycle"].map(|engine| frame(&[&arguments[..], &[engine]].concat()).1);
    let cancelled = told
        .each_ref()
        .map(|told| told["work"]["cancelled"].as_u64().unwrap());
    assert!(
        cancelled[0] > 0 && cancelled[0] == cancelled[1],
        "{cancelled:?}"
    );
    let notes = told[0]["timing"]["notes"].to_string();
    assert!(
        notes.contains("rising CLK edge that it precedes") && notes.contains("cancel"),
        "{notes}"
    );
}

#[test]
fn a_dead_time_that_the_front_end_cannot_follow_is_refused_by_all_in_the_same_words() {
    for (dead_time, meant) in [
        ("8e-9", "did you mean 8 (ns)?"),
        ("0.06", "give at least 0.1104"),
    ] {
        let sensor = format!("dead_time_ns = {dead_time}\n");
        let mut words = std::collections::BTreeSet::new();
        for engine in ["gate", "cycle", "window", "cohort"] {
            let output = replayed(&sensor, "30000000,0,0,3\n30060001,0,0,3\n", engine, &[]);
            assert_eq!(output.status.code(), Some(2), "{engine}");
            words.insert(String::from_utf8(output.stderr).unwrap());
        }
        let folder = tempfile::tempdir().unwrap();
        std::fs::write(folder.path().join("sensor.toml"), &sensor).unwrap();
        for command in ["timing", "frame"] {
            let mut run = Command::new(env!("CARGO_BIN_EXE_gdtof"));
            let output = run
                .args([command, "--sensor", "sensor.toml"])
                .current_dir(folder.path());
            let output = output.output().unwrap();
            assert_eq!(output.status.code(), Some(2), "{command}");
            words.insert(String::from_utf8(output.stderr).unwrap());
        }
        assert_eq!(words.len(), 1, "{words:?}");
        let said = words.pop_first().unwrap();
        assert!(
            said.contains("sensor.toml:1: dead_time_ns") && said.contains(meant),
            "{said}"
        );
    }
}
