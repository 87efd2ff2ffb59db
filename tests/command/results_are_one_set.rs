//! Runs that are interrupted, killed or repeated: nothing half written stays, and what is in a folder is of one run.

use std::os::unix::process::ExitStatusExt;
use std::path::{Path, PathBuf};
use std::process::{Child, Command, ExitStatus, Stdio};
use std::time::{Duration, Instant};

/// Far longer than any of this takes on a busy machine: a run that hangs fails instead of blocking.
const PATIENCE: Duration = Duration::from_secs(120);

fn gdtof(folder: &Path, arguments: &[&str]) -> Command {
    let mut command = Command::new(env!("CARGO_BIN_EXE_gdtof"));
    command.args(arguments).current_dir(folder);
    command.stdout(Stdio::null()).stderr(Stdio::null());
    command
}

/// Little light: the few macropixels of a small array share the whole field of view, and would draw photons for long.
const DIM: [&str; 4] = [
    "--set",
    "scene.light.illuminance_klux=0",
    "--set",
    "scene.lidar.pulse_energy_uj=0.001",
];

/// A frame whose probe is at gate level for seconds and writes hundreds of megabytes.
const LONG: [&str; 11] = [
    "frame",
    "--rows",
    "2",
    "--cols",
    "2",
    "--probe",
    "1,1",
    "--laser-cycles",
    "4000",
    "--wave-cycles",
    "4000",
];

const SHORT: [&str; 7] = ["frame", "--rows", "4", "--cols", "4", "--laser-cycles", "3"];

fn long() -> Vec<&'static str> {
    [&LONG[..], &DIM].concat()
}

fn short<'a>(more: &[&'a str]) -> Vec<&'a str> {
    [&SHORT[..], &DIM, more].concat()
}

fn names(folder: &Path) -> Vec<String> {
    let entries = std::fs::read_dir(folder).into_iter().flatten();
    let mut names: Vec<String> = entries
        .map(|e| e.unwrap().file_name().into_string().unwrap())
        .collect();
    names.sort();
    names
}

fn temporaries(folder: &Path) -> Vec<PathBuf> {
    let ours = |name: &String| name.starts_with(".gdtof-");
    names(folder)
        .into_iter()
        .filter(ours)
        .map(|n| folder.join(n))
        .collect()
}

fn bytes_in(path: &Path) -> u64 {
    if path.is_dir() {
        names(path)
            .iter()
            .map(|name| bytes_in(&path.join(name)))
            .sum()
    } else {
        path.metadata().map_or(0, |m| m.len())
    }
}

/// Starts a run and waits until it is in the middle of a file of at least a megabyte.
fn start_writing(folder: &Path, arguments: &[&str], writes_to: &Path) -> Child {
    let others = temporaries(writes_to);
    let mut child = gdtof(folder, arguments).spawn().unwrap();
    let begun = Instant::now();
    let is_its = |path: &PathBuf| !others.contains(path);
    let its = || temporaries(writes_to).into_iter().filter(is_its);
    while its().map(|path| bytes_in(&path)).max().unwrap_or(0) < 1 << 20 {
        assert!(begun.elapsed() < PATIENCE, "nothing is written");
        assert!(child.try_wait().unwrap().is_none(), "it has ended already");
        std::thread::sleep(Duration::from_millis(10));
    }
    child
}

fn signal(child: &Child, name: &str) {
    let id = child.id().to_string();
    let status = Command::new("kill")
        .args(["-s", name, &id])
        .status()
        .unwrap();
    assert!(status.success());
}

fn end(mut child: Child) -> ExitStatus {
    let begun = Instant::now();
    loop {
        if let Some(status) = child.try_wait().unwrap() {
            return status;
        }
        if begun.elapsed() > PATIENCE {
            child.kill().unwrap();
            panic!("it does not end");
        }
        std::thread::sleep(Duration::from_millis(10));
    }
}

#[test]
fn a_signal_removes_all_of_a_half_written_frame_at_once() {
    let here = tempfile::tempdir().unwrap();
    let out = here.path().join("out");
    let child = start_writing(here.path(), &long(), &out);
    signal(&child, "INT");
    assert_eq!(end(child).code(), Some(130));
    assert_eq!(names(&out), [""; 0]);
}

#[test]
fn every_signal_removes_a_half_written_file() {
    let here = tempfile::tempdir().unwrap();
    let write = |name, text| std::fs::write(here.path().join(name), text).unwrap();
    write("i.csv", "row,col,init\n0,0,20\n0,1,30\n");
    write("e.csv", "time_fs,row,col,spad\n");
    let arguments = [
        "replay",
        "--rows",
        "1",
        "--cols",
        "2",
        "--inits",
        "i.csv",
        "--events",
        "e.csv",
        "--stop-periods",
        "100",
        "--laser-cycles",
        "100000",
        "--engine",
        "gate",
        "--vcd",
        "w.vcd",
    ];
    for (name, status) in [("INT", 130), ("TERM", 143), ("HUP", 129)] {
        if name == "HUP" && ignores_hangups() {
            eprintln!("SKIPPED: under nohup a hangup ends nothing");
            continue;
        }
        let child = start_writing(here.path(), &arguments, here.path());
        signal(&child, name);
        assert_eq!(end(child).code(), Some(status), "{name}");
        assert_eq!(names(here.path()), ["e.csv", "i.csv"], "{name}");
    }
}

/// Whether this process, and so its children, ignore SIGHUP (signal 1).
fn ignores_hangups() -> bool {
    let status = std::fs::read_to_string("/proc/self/status").unwrap_or_default();
    let ignored = status.lines().find_map(|line| line.strip_prefix("SigIgn:"));
    let mask = ignored.and_then(|mask| u64::from_str_radix(mask.trim(), 16).ok());
    mask.is_some_and(|mask| mask & 1 == 1)
}

#[test]
fn the_next_run_removes_what_a_killed_one_left_and_only_that() {
    let here = tempfile::tempdir().unwrap();
    let out = here.path().join("out");
    let killed = start_writing(here.path(), &long(), &out);
    signal(&killed, "KILL");
    assert_eq!(end(killed).signal(), Some(9));
    let left = temporaries(&out);
    assert!(left.iter().any(|path| bytes_in(path) >= 1 << 20));

    std::fs::write(out.join(".gdtof-notes"), "mine").unwrap();
    let alive = start_writing(here.path(), &long(), &out);
    assert!(left.iter().all(|path| !path.exists()), "{left:?}");
    let its = temporaries(&out);
    let status = gdtof(here.path(), &short(&["--probe", "none"])).status();
    assert!(status.unwrap().success());
    assert!(out.join("frame.json").exists());
    // The run that is still alive has lost nothing, and the user's file is there.
    assert_eq!(temporaries(&out), its);
    assert!(its.iter().any(|path| bytes_in(path) >= 1 << 20), "{its:?}");
    signal(&alive, "INT");
    assert_eq!(end(alive).code(), Some(130));
    assert_eq!(temporaries(&out), [out.join(".gdtof-notes")]);
}

fn manifest(out: &Path) -> serde_json::Value {
    let text = std::fs::read_to_string(out.join("manifest.json")).unwrap();
    serde_json::from_str(&text).unwrap()
}

#[test]
fn a_frame_replaces_the_one_before_it_and_keeps_what_the_user_changed() {
    let here = tempfile::tempdir().unwrap();
    let out = here.path().join("out");
    let run = |more: &[&str]| {
        let mut command = gdtof(here.path(), &short(more));
        let output = command.stderr(Stdio::piped()).output().unwrap();
        assert!(output.status.success(), "{output:?}");
        String::from_utf8(output.stderr).unwrap()
    };
    assert_eq!(run(&["--probe", "1,1", "--probe", "2,2"]), "");
    let first = names(&out);
    assert!(first.iter().any(|name| name.starts_with("probe_r1_c1")));
    assert!(first.iter().any(|name| name.starts_with("probe_r2_c2")));

    // A view saved from the viewer, and a picture drawn upon.
    let changed: Vec<&String> = first.iter().filter(|n| n.ends_with("r1_c1.gtkw")).collect();
    std::fs::write(out.join(changed[0]), "my signals").unwrap();
    std::fs::write(out.join("depth.png"), "my picture").unwrap();
    std::fs::write(out.join("notes.txt"), "mine").unwrap();
    let said = run(&["--probe", "3,3", "--seed", "7"]);
    assert_eq!(said.lines().count(), 2, "{said}");
    assert!(
        said.contains("depth.kept.png") && said.contains(changed[0]),
        "{said}"
    );
    let read = |name: &str| std::fs::read_to_string(out.join(name)).unwrap();
    assert_eq!(read("depth.kept.png"), "my picture");
    assert_eq!(read(changed[0]), "my signals");

    let manifest = manifest(&out);
    assert_eq!(manifest["program"], "gdtof");
    assert_eq!(manifest["command"], "frame");
    assert_eq!(manifest["version"], env!("CARGO_PKG_VERSION"));
    assert_eq!(manifest["complete"], true);
    assert_eq!(manifest["configuration"]["seed"], 7);
    assert_eq!(manifest["configuration"]["sensor"]["rows"], 4);
    let mut listed: Vec<String> = Vec::new();
    for file in manifest["files"].as_array().unwrap() {
        let name = file["name"].as_str().unwrap();
        assert_eq!(file["bytes"].as_u64().unwrap(), bytes_in(&out.join(name)));
        listed.push(name.to_owned());
    }
    assert!(listed.iter().any(|name| name.starts_with("probe_r3_c3")));
    for name in ["manifest.json", "depth.kept.png", "notes.txt", changed[0]] {
        assert!(!listed.iter().any(|n| n == name));
        listed.push(name.to_owned());
    }
    listed.sort();
    assert_eq!(names(&out), listed);
}

#[test]
fn two_runs_at_a_time_leave_the_set_of_one() {
    let here = tempfile::tempdir().unwrap();
    let out = here.path().join("out");
    for _ in 0..2 {
        let runs = [
            ["--seed", "1", "--probe", "1,1"],
            ["--seed", "2", "--probe", "2,2"],
        ];
        let runs = runs.map(|more| gdtof(here.path(), &short(&more)).spawn().unwrap());
        for run in runs {
            assert!(end(run).success());
        }
        let manifest = manifest(&out);
        let mut listed = vec!["manifest.json".to_owned()];
        for file in manifest["files"].as_array().unwrap() {
            listed.push(file["name"].as_str().unwrap().to_owned());
        }
        listed.sort();
        assert_eq!(names(&out), listed);
        let frame = std::fs::read_to_string(out.join("frame.json")).unwrap();
        let frame: serde_json::Value = serde_json::from_str(&frame).unwrap();
        for key in ["seed", "sensor", "scene"] {
            assert_eq!(frame[key], manifest["configuration"][key]);
        }
        assert_eq!(frame["scene"]["lidar"]["pde"], 0.185);
        assert_eq!(frame["scene"]["object"][1]["name"], "car");
    }
}

/// On a terminal (made by `script`) the interrupted progress bar is wiped and the message stands on a line of its own.
#[test]
fn an_interrupted_progress_bar_leaves_the_terminal_in_order() {
    let here = tempfile::tempdir().unwrap();
    if Command::new("script").arg("--version").output().is_err() {
        use std::io::Write;
        let _ = writeln!(
            std::io::stderr(),
            "SKIPPED: script (util-linux) is not there"
        );
        return;
    }
    let command = format!(
        "timeout --signal=INT --foreground 3 {} frame --rows 16 --cols 16 --laser-cycles 200000 --engine cycle --probe none",
        env!("CARGO_BIN_EXE_gdtof")
    );
    let output = Command::new("script")
        .args(["-qec", &command, "/dev/null"])
        .current_dir(here.path())
        .stdin(Stdio::null())
        .output()
        .unwrap();
    let screen = String::from_utf8_lossy(&output.stdout);
    let last = screen.rsplit('\r').find(|part| part.contains("gdtof:"));
    let last = last.unwrap_or_else(|| panic!("{screen:?}")).trim_end();
    assert_eq!(
        last,
        "\u{1b}[Kgdtof: interrupted; unfinished files are removed"
    );
    assert_eq!(names(&here.path().join("out")), [""; 0]);
}
