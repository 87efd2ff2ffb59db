//! Full disks and signals, of all commands that write: one sentence, nothing half written, and what was there before stays.

use std::collections::BTreeMap;
use std::path::Path;
use std::process::{Command, Output, Stdio};
use std::time::Duration;

use super::every_command::{RUNS, words, workplace};
use super::tools::takes_all;

/// Commands that write no file.
const WITHOUT_FILES: [&str; 7] = [
    "speed",
    "doctor",
    "sensor",
    "scene",
    "schema",
    "completion",
    "power",
];

/// Words that let a command write, or write more, beside those that let it run.
const MORE: [(&str, &str); 12] = [
    ("frame", "--page --probe 0,0"),
    ("drive", "--mcap"),
    ("photons", "--format vcd"),
    ("photons", "--format memh"),
    ("photons", "--format npy"),
    ("replay", "--out h.npy"),
    (
        "replay",
        "--out h.csv --engine gate --vcd r.vcd --saif r.saif --checks report --checks-json r.json",
    ),
    ("reproduce", "--out reproduced"),
    ("range", "--out depths.csv --save-calibration zones.json"),
    ("timing", "--mismatch 0.05 --plot ripple.svg"),
    (
        "export verilog",
        "--inits inits.csv --events events.csv --cols 2 --stop-periods 100 --laser-cycles 5",
    ),
    ("sweep", "--plot theory.laser_cycles,p_right"),
];

/// Commands that write, with words that let them.
fn writing() -> Vec<Vec<String>> {
    let mut all = Vec::new();
    let names = RUNS.iter().map(|(name, ..)| *name);
    for name in names.filter(|name| !WITHOUT_FILES.contains(name)) {
        let more: Vec<&str> = MORE
            .iter()
            .filter(|(known, _)| *known == name)
            .map(|(_, more)| *more)
            .collect();
        // Those that write without further words.
        let plain = !["replay", "reproduce", "range", "timing"].contains(&name);
        for more in plain.then_some("").into_iter().chain(more) {
            let mut words = words(name);
            let more: Vec<&str> = more.split_whitespace().collect();
            for option in more.iter().filter(|word| word.starts_with("--")) {
                if let Some(at) = words.iter().position(|word| word == option) {
                    words.drain(at..at + 2);
                }
            }
            words.extend(more.into_iter().map(str::to_owned));
            words.push("--quiet".into());
            all.push(words);
        }
    }
    all
}

/// Every file and folder below a folder, with its contents. A sweep's journal keeps rows that were taken, for the next run.
fn contents(folder: &Path) -> BTreeMap<String, Vec<u8>> {
    let mut found = BTreeMap::new();
    for entry in std::fs::read_dir(folder).unwrap().map(Result::unwrap) {
        let path = entry.path();
        let name = path.display().to_string();
        if path.is_dir() {
            found.extend(contents(&path));
            found.insert(name, Vec::new());
        } else if !name.contains("/journal") {
            found.insert(name, std::fs::read(path).unwrap());
        }
    }
    found
}

/// Names of what is not the same in both.
fn differences(one: &BTreeMap<String, Vec<u8>>, other: &BTreeMap<String, Vec<u8>>) -> Vec<String> {
    let names = one.keys().chain(other.keys());
    let differing = names.filter(|name| one.get(*name) != other.get(*name));
    differing.cloned().collect()
}

fn gdtof(here: &Path, words: &[String]) -> Command {
    let mut command = Command::new(env!("CARGO_BIN_EXE_gdtof"));
    command.args(words).current_dir(here);
    command
}

/// Without and with an older set in the place of the results.
#[test]
fn a_full_disk_is_one_sentence_and_changes_nothing() {
    let dir = workplace();
    let here = dir.path();
    for words in writing() {
        // The disk is full at once, and after 2 KiB of a file.
        let moments: &[(bool, u32)] = if words[0] == "demo" {
            &[(false, 0)]
        } else if takes_all() {
            &[(false, 0), (false, 4), (true, 0), (true, 4)]
        } else {
            &[(false, 0), (true, 4)]
        };
        let mut is_written = false;
        for &(has_older, blocks) in moments {
            // A run that fails leaves the older set, so one serves all that follow.
            if has_older && !is_written {
                is_written = true;
                let run = gdtof(here, &words).output().unwrap();
                assert!(run.status.success(), "{words:?}: {run:?}");
            }
            let before = contents(here);
            let script =
                format!("trap '' XFSZ; ulimit -f {blocks}; exec \"$0\" \"$@\" --threads 2");
            let run: Output = Command::new("sh")
                .args(["-c", &script, env!("CARGO_BIN_EXE_gdtof")])
                .args(&words)
                .current_dir(here)
                .output()
                .unwrap();
            let error = String::from_utf8_lossy(&run.stderr);
            // What is there already, byte for byte, need not be written.
            if run.status.success() {
                assert!(blocks > 0 || has_older, "{words:?} wrote nothing");
                continue;
            }
            assert_eq!(run.status.code(), Some(2), "{words:?}: {error}");
            assert_eq!(error.lines().count(), 1, "{words:?}: {error}");
            assert!(error.contains("free some space"), "{words:?}: {error}");
            assert!(!error.contains(".gdtof-"), "{words:?}: {error}");
            let mut changed = differences(&before, &contents(here));
            // The folder of a sweep and its study are made before the first row is taken.
            changed.retain(|name| has_older || !name.contains("/sweep-study"));
            assert_eq!(changed, [""; 0], "{words:?}, older set: {has_older}");
        }
    }
}

/// Each command gets one of four signals; each night, all of them.
#[test]
fn a_signal_leaves_no_half_of_a_file() {
    use std::os::unix::process::ExitStatusExt;
    let dir = workplace();
    let here = dir.path();
    for (number, words) in writing().into_iter().enumerate() {
        if words[0] != "demo" {
            let run = gdtof(here, &words).output().unwrap();
            assert!(run.status.success(), "{words:?}: {run:?}");
        }
        let moments = [
            (3, "INT", 2),
            (30, "TERM", 15),
            (100, "HUP", 1),
            (300, "TERM", 15),
        ];
        let chosen = if takes_all() {
            &moments[..]
        } else {
            &moments[number % 4..][..1]
        };
        for &(milliseconds, signal, number) in chosen {
            let before = contents(here);
            let mut child = gdtof(here, &words)
                .stdout(Stdio::null())
                .stderr(Stdio::null())
                .spawn()
                .unwrap();
            std::thread::sleep(Duration::from_millis(milliseconds));
            let kill = format!("kill -{signal} {}", child.id());
            let _ = Command::new("sh")
                .args(["-c", &kill])
                .stderr(Stdio::null())
                .status();
            let status = child.wait().unwrap();
            // The first moments are those of the system's own end by a signal.
            let is_ended = status.code() == Some(128 + number) || status.signal() == Some(number);
            assert!(is_ended || status.success(), "{words:?}: {status}");
            let after = contents(here);
            let left = after.keys().find(|name| name.contains("/.gdtof-"));
            assert_eq!(left, None, "{words:?}");
            if status.success() {
                continue;
            }
            let mut changed = differences(&before, &after);
            // Empty folders of results are left.
            changed.retain(|name| !Path::new(name).is_dir());
            // The signal may come after the results, which are whole then.
            let manifest = changed.iter().find(|name| name.ends_with("/manifest.json"));
            let is_whole = manifest.is_some_and(|name| {
                let manifest: serde_json::Value = serde_json::from_slice(&after[name]).unwrap();
                manifest["complete"] == true
            });
            assert!(
                changed.is_empty() || is_whole,
                "{words:?}, {signal} after {milliseconds} ms: {changed:?}"
            );
        }
    }
}
