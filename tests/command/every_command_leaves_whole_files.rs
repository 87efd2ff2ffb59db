//! Full disks and signals, of all commands that write: one sentence, and nothing half written.

use std::collections::BTreeMap;
use std::path::Path;
use std::process::{Command, Output, Stdio};
use std::time::Duration;

use super::every_command::{RUNS, words, workplace};

/// Commands that write no file, and those that take minutes (`runs_survive_faults` has a demo).
const OTHERS: [&str; 8] = [
    "speed",
    "doctor",
    "sensor",
    "scene",
    "schema",
    "completion",
    "power",
    "demo",
];

/// Commands that write, with words that let them.
fn writing() -> impl Iterator<Item = Vec<String>> {
    let names = RUNS.iter().map(|(name, ..)| *name);
    names.filter(|name| !OTHERS.contains(name)).map(|name| {
        let more = match name {
            "replay" => "--out h.npy",
            "reproduce" => "--out reproduced",
            "range" => "--out depths.csv",
            "timing" => "--mismatch 0.05 --plot ripple.svg",
            _ => "",
        };
        let mut words = words(name);
        words.extend(more.split_whitespace().map(str::to_owned));
        words.push("--quiet".into());
        words
    })
}

fn files(folder: &Path) -> BTreeMap<String, u64> {
    let mut found = BTreeMap::new();
    for entry in std::fs::read_dir(folder).unwrap().map(Result::unwrap) {
        let path = entry.path();
        found.insert(path.display().to_string(), entry.metadata().unwrap().len());
        if path.is_dir() {
            found.extend(files(&path));
        }
    }
    found
}

#[test]
fn a_full_disk_is_one_sentence_and_changes_nothing() {
    let dir = workplace();
    let here = dir.path();
    for words in writing() {
        // The disk is full at once, and after 2 KiB of a file.
        for blocks in [0, 4] {
            let before = files(here);
            let script =
                format!("trap '' XFSZ; ulimit -f {blocks}; exec \"$0\" \"$@\" --threads 2");
            let run: Output = Command::new("sh")
                .args(["-c", &script, env!("CARGO_BIN_EXE_gdtof")])
                .args(&words)
                .current_dir(here)
                .output()
                .unwrap();
            if run.status.success() {
                assert!(blocks > 0, "{words:?} wrote nothing");
                continue;
            }
            let error = String::from_utf8_lossy(&run.stderr);
            assert_eq!(run.status.code(), Some(2), "{words:?}: {error}");
            assert_eq!(error.lines().count(), 1, "{words:?}: {error}");
            assert!(error.contains("free some space"), "{words:?}: {error}");
            assert!(!error.contains(".gdtof-"), "{words:?}: {error}");
            // Rows that were taken stay in a journal, for the next run.
            let is_result = |name: &&String| !name.contains("/sweep-study");
            let names = |files: &BTreeMap<String, u64>| -> Vec<String> {
                files.keys().filter(is_result).cloned().collect()
            };
            assert_eq!(names(&files(here)), names(&before), "{words:?}");
        }
    }
}

#[test]
fn a_signal_leaves_no_half_of_a_file() {
    let dir = workplace();
    let here = dir.path();
    for words in writing() {
        for milliseconds in [3, 30, 300] {
            let mut child = Command::new(env!("CARGO_BIN_EXE_gdtof"))
                .args(&words)
                .current_dir(here)
                .stdout(Stdio::null())
                .stderr(Stdio::null())
                .spawn()
                .unwrap();
            std::thread::sleep(Duration::from_millis(milliseconds));
            let kill = format!("kill -TERM {}", child.id());
            let _ = Command::new("sh")
                .args(["-c", &kill])
                .stderr(Stdio::null())
                .status();
            let status = child.wait().unwrap();
            // The first moments are those of the system's own end by a signal.
            use std::os::unix::process::ExitStatusExt;
            let is_ended = status.code() == Some(143) || status.signal() == Some(15);
            assert!(is_ended || status.success(), "{words:?}: {status}");
            let left = files(here);
            let left = left.keys().find(|name| name.contains("/.gdtof-"));
            assert_eq!(left, None, "{words:?}");
        }
    }
}
