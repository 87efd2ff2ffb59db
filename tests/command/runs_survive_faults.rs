//! Runs that are killed at any moment, stopped, or short of disk, memory or rights: every file is whole or absent, and the next run puts
//! everything right.
//!
//! `GDTOF_MOMENTS=200` kills each command so often (4 times without it). The demo, which takes 5 s, is killed only with it or with
//! `GDTOF_CASES`. `GDTOF` names a program to use instead of the one built with the
//! tests. With `--nocapture` it says what was met.

use std::collections::BTreeMap;
use std::fs;
use std::os::unix::process::ExitStatusExt;
use std::path::Path;
use std::process::{Child, Command, Output, Stdio};
use std::time::{Duration, Instant};

use serde_json::Value;
use sha2::{Digest, Sha256};

use super::tools::takes_all;

/// A command that writes into `out`, by the words after it and a seed; the demo takes seconds and gets a tenth of the moments.
const RUNS: [(&str, &str); 5] = [
    (
        "frame",
        "frame --rows 4 --cols 4 --laser-cycles 3 --set scene.light.illuminance_klux=0 --set scene.lidar.pulse_energy_uj=0.001",
    ),
    (
        "drive",
        "drive --rows 4 --cols 6 --frames 2 --laser-cycles 40 --set scene.light.illuminance_klux=0 --set scene.lidar.pulse_energy_uj=0.1",
    ),
    (
        "demo",
        "demo glass --calibration-step-ps 200 --laser-cycles 100",
    ),
    ("sweep", "sweep study"),
    ("page", "page frame"),
];

/// Files in which run times stand.
const TIMED: [&str; 6] = [
    "manifest.json",
    "frame.json",
    "drive.json",
    "frames.jsonl",
    "glass.json",
    "times.csv",
];

const STUDY: &str = "\
[study]
seed = SEED
[fixed]
sensor.rows = 2
sensor.cols = 3
scene.lidar.pulse_energy_uj = \"1 nJ\"
scene.lidar.fov_deg = 0.8
scene.light.illuminance_klux = 0
[vary]
frame.laser_cycles = { from = 20, to = 100, steps = 8 }
";

fn program() -> String {
    std::env::var("GDTOF").unwrap_or_else(|_| env!("CARGO_BIN_EXE_gdtof").into())
}

/// The words of a run into `out` with a seed, in a folder made by [`workplace`].
fn words(run: &str, seed: u32) -> Vec<String> {
    let mut words: Vec<String> = run.split(' ').map(str::to_owned).collect();
    match &*words[0] {
        "sweep" => words[1] = format!("study{seed}.toml"),
        "page" => words[1] = format!("frame{seed}"),
        _ => words.extend(["--seed".into(), seed.to_string()]),
    }
    let out = if words[0] == "page" {
        "out/page.html"
    } else {
        "out"
    };
    words.extend(["--out".into(), out.into()]);
    words
}

/// What the runs read: studies, and frames to make pages of.
fn workplace() -> tempfile::TempDir {
    let here = tempfile::tempdir().unwrap();
    for seed in [1, 2] {
        let study = STUDY.replace("SEED", &seed.to_string());
        fs::write(here.path().join(format!("study{seed}.toml")), study).unwrap();
        let mut words = words(RUNS[0].1, seed);
        words.pop();
        let done = started(
            here.path(),
            &[&words[..], &[format!("frame{seed}")]].concat(),
        );
        assert!(done.wait_with_output().unwrap().status.success());
    }
    fs::create_dir(here.path().join("out")).unwrap();
    here
}

fn started(here: &Path, words: &[String]) -> Child {
    let mut command = Command::new(program());
    command
        .args(words)
        .args(["--threads", "2", "--quiet"])
        .current_dir(here);
    command
        .stdout(Stdio::null())
        .stderr(Stdio::piped())
        .spawn()
        .unwrap()
}

/// Runs it under what `sh` sets up first.
fn limited(here: &Path, setup: &str, words: &[String]) -> Output {
    let script = format!("{setup}; exec \"$0\" \"$@\" --threads 2 --quiet");
    let mut command = Command::new("sh");
    command
        .args(["-c", &script, &program()])
        .args(words)
        .current_dir(here);
    command.output().unwrap()
}

fn files(folder: &Path) -> BTreeMap<String, Vec<u8>> {
    let entries = fs::read_dir(folder).unwrap().map(Result::unwrap);
    let read = |entry: fs::DirEntry| {
        let contents = fs::read(entry.path()).unwrap_or_default();
        (entry.file_name().into_string().unwrap(), contents)
    };
    entries.map(read).collect()
}

/// Hash by name, as a manifest lists them.
fn listed(manifest: &Value, key: &str) -> Vec<(String, String)> {
    let files = manifest[key].as_array().into_iter().flatten();
    let text = |file: &Value, key: &str| file[key].as_str().unwrap().to_owned();
    files
        .map(|file| (text(file, "name"), text(file, "sha256")))
        .collect()
}

/// That every file in `out` is whole, and of the set that the manifest says is whole; returns whether a switch was under way.
fn check(out: &Path, whole: &[&BTreeMap<String, Vec<u8>>], what: &str) -> bool {
    let found = files(out);
    let results = found.iter().filter(|(name, _)| {
        !(name.starts_with(".gdtof-") || name.starts_with("journal") || *name == "study.json")
    });
    let mut results: BTreeMap<&String, &Vec<u8>> = results.collect();
    if let Some(page) = results.remove(&"page.html".to_owned()) {
        assert!(
            whole.iter().any(|set| set["page.html"] == *page),
            "{what}: a torn page"
        );
    }
    let Some(manifest) = results.remove(&"manifest.json".to_owned()) else {
        assert!(
            results.is_empty(),
            "{what}: without a manifest {:?}",
            results.keys()
        );
        return false;
    };
    let manifest: Value = serde_json::from_slice(manifest).unwrap();
    let (now, before) = (
        listed(&manifest, "files"),
        listed(&manifest, "previous_files"),
    );
    let hashes = results.iter().map(|(name, contents)| {
        let hash = Sha256::digest(contents);
        (
            (*name).clone(),
            hash.iter().map(|b| format!("{b:02x}")).collect(),
        )
    });
    let hashes: Vec<(String, String)> = hashes.collect();
    if manifest["complete"] == true {
        assert_eq!(hashes, now, "{what}")
    } else {
        assert!(
            hashes
                .iter()
                .all(|file| now.contains(file) || before.contains(file)),
            "{what}: {hashes:?}"
        )
    }
    manifest["complete"] == false
}

/// Runs it again to its end and compares with what an undisturbed run gives.
fn check_restart(here: &Path, run: &str, whole: &BTreeMap<String, Vec<u8>>, what: &str) {
    let again = started(here, &words(run, 2)).wait_with_output().unwrap();
    assert!(
        again.status.success(),
        "{what}: {}",
        String::from_utf8_lossy(&again.stderr)
    );
    let out = here.join("out");
    assert!(!check(&out, &[whole], what), "{what}");
    let found = files(&out);
    assert!(found.keys().eq(whole.keys()), "{what}: {:?}", found.keys());
    for (name, contents) in found {
        // A journal has its lines in the order in which they were done.
        if !TIMED.contains(&&*name) && !name.starts_with("journal") {
            assert!(contents == whole[&name], "{what}: {name} differs");
        }
    }
}

/// Empties `out`, or puts a set there as it was before.
fn put(out: &Path, set: Option<&BTreeMap<String, Vec<u8>>>) {
    fs::remove_dir_all(out).unwrap();
    fs::create_dir(out).unwrap();
    for (name, contents) in set.into_iter().flatten() {
        fs::write(out.join(name), contents).unwrap();
    }
}

/// What an undisturbed run of each seed gives, and how long the second took.
fn undisturbed(here: &Path, run: &str) -> ([BTreeMap<String, Vec<u8>>; 2], Duration) {
    let out = here.join("out");
    let mut took = Duration::ZERO;
    let sets = [1, 2].map(|seed| {
        put(&out, None);
        let begun = Instant::now();
        let done = started(here, &words(run, seed)).wait_with_output().unwrap();
        assert!(done.status.success(), "{done:?}");
        took = begun.elapsed();
        files(&out)
    });
    (sets, took)
}

/// Waits until the run is about to switch sets; false if it ends before that is seen.
fn awaits_switch(child: &mut Child, out: &Path) -> bool {
    while child.try_wait().unwrap().is_none() {
        let entries = fs::read_dir(out).into_iter().flatten().flatten();
        let mut staged = entries.filter(|e| e.file_name().to_string_lossy().starts_with(".gdtof-"));
        if staged.any(|e| e.path().join("manifest of the switch").exists()) {
            return true;
        }
    }
    false
}

#[test]
fn a_run_killed_at_any_moment_leaves_whole_files_and_the_next_one_clears_up() {
    let given = std::env::var("GDTOF_MOMENTS");
    let has_demo = given.is_ok() || takes_all();
    let moments = given.map_or(4, |n| n.parse().unwrap());
    for (name, run) in RUNS
        .into_iter()
        .filter(|(name, _)| has_demo || *name != "demo")
    {
        let here = workplace();
        let out = here.path().join("out");
        let ([before, after], took) = undisturbed(here.path(), run);
        let moments = if name == "demo" {
            (moments / 10_u32).max(1)
        } else {
            moments
        };
        let (mut killed, mut stopped, mut switching) = (0, 0, 0);
        for moment in 0..moments {
            let what = &format!("{name}, moment {moment}");
            let had = (moment % 2 == 0).then_some(&before);
            put(&out, had);
            let mut child = started(here.path(), &words(run, 2));
            // Evenly over the run, and of every third a moment of the switch of sets, which takes some tenths of a millisecond.
            let share = f64::from(moment) * 0.618 % 1.0;
            if moment % 3 == 2 && awaits_switch(&mut child, &out) {
                let begun = Instant::now();
                while begun.elapsed().as_secs_f64() < share * 4e-4 {}
            } else {
                std::thread::sleep(took.mul_f64(share));
            }
            if moment % 4 == 3 {
                let id = child.id().to_string();
                let mut kill = Command::new("kill");
                let _ = kill
                    .args(["-s", "TERM", &id])
                    .stderr(Stdio::null())
                    .status();
            } else {
                let _ = child.kill();
            }
            let status = child.wait_with_output().unwrap().status;
            killed += u32::from(status.signal() == Some(9));
            stopped += u32::from(status.code() == Some(143));
            switching += u32::from(check(&out, &[&before, &after], what));
            if status.code() == Some(143) {
                let left = files(&out)
                    .into_keys()
                    .find(|name| name.starts_with(".gdtof-"));
                assert_eq!(left, None, "{what}");
            }
            check_restart(here.path(), run, &after, what);
        }
        println!(
            "{name}: {moments} moments, {killed} killed ({switching} while sets were switched), {stopped} stopped by SIGTERM"
        );
    }
}

#[test]
fn a_run_short_of_disk_or_memory_leaves_what_was_there() {
    for (name, run) in RUNS.into_iter().filter(|(name, _)| *name != "demo") {
        let here = workplace();
        let out = here.path().join("out");
        let ([before, after], _) = undisturbed(here.path(), run);
        let (mut refused, mut ended) = (0, 0);
        // Blocks of 512 bytes for a file; kB of address space.
        let disk = [0, 1, 4, 16, 64, 256].map(|blocks| format!("trap '' XFSZ; ulimit -f {blocks}"));
        let memory = [40, 80, 120, 160, 320].map(|mb| format!("ulimit -v {mb}000"));
        for (at, setup) in disk.iter().chain(&memory).enumerate() {
            let what = &format!("{name} with {setup}");
            put(&out, (at % 2 == 0).then_some(&before));
            let done = limited(here.path(), setup, &words(run, 2));
            let said = String::from_utf8_lossy(&done.stderr);
            assert!(!check(&out, &[&before, &after], what), "{what}");
            if !done.status.success() && setup.starts_with("trap") {
                assert_eq!(
                    (done.status.code(), said.lines().count()),
                    (Some(2), 1),
                    "{what}: {said}"
                );
                let left = files(&out)
                    .into_keys()
                    .find(|name| name.starts_with(".gdtof-"));
                assert_eq!(left, None, "{what}");
                assert!(said.contains("free some space"), "{what}: {said}");
                refused += 1;
            }
            ended += u32::from(!done.status.success());
            check_restart(here.path(), run, &after, what);
        }
        println!(
            "{name}: of 11 limits {ended} ended it, {refused} of them with a sentence about the disk"
        );
        assert!(refused > 0, "{name}");
    }
}

/// Root may write anywhere, and runs it as nobody.
#[test]
fn a_folder_that_may_not_be_written_is_refused_and_untouched() {
    use std::os::unix::fs::PermissionsExt;
    for (name, run) in RUNS {
        let here = workplace();
        let out = here.path().join("out");
        let mode = |mode| fs::set_permissions(&out, fs::Permissions::from_mode(mode)).unwrap();
        fs::set_permissions(here.path(), fs::Permissions::from_mode(0o755)).unwrap();
        fs::write(out.join("mine"), "mine").unwrap();
        mode(0o555);
        let is_root = fs::write(out.join("probe"), "").is_ok();
        let _ = fs::remove_file(out.join("probe"));
        let setup = if is_root {
            "set -- --reuid=65534 --regid=65534 --clear-groups \"$0\" \"$@\"; exec setpriv \"$@\""
        } else {
            "true"
        };
        let done = limited(here.path(), setup, &words(run, 2));
        mode(0o755);
        let said = String::from_utf8_lossy(&done.stderr);
        if is_root && !said.contains("out") {
            assert!(std::env::var_os("CI").is_none(), "{name}: {said}");
            eprintln!("SKIPPED: nobody cannot run the program here: {said}");
            return;
        }
        assert_eq!(
            (done.status.code(), said.lines().count()),
            (Some(2), 1),
            "{name}: {said}"
        );
        assert!(files(&out).into_keys().eq(["mine".to_owned()]), "{name}");
    }
}
