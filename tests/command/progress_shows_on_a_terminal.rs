//! How far a run is: on a terminal, and nowhere else. How long it will take: in the first line of standard error.

use std::io::{BufRead, BufReader};
use std::path::Path;
use std::process::{Command, Stdio};

use super::every_command::{words, workplace};

/// What appears on a terminal of 120 columns.
fn on_terminal(here: &Path, words: &[String]) -> String {
    let program = env!("CARGO_BIN_EXE_gdtof");
    let command = format!("stty cols 120 rows 40; {program} {}", words.join(" "));
    let run = Command::new("script")
        .args(["-qec", &command, "/dev/null"])
        .current_dir(here)
        .stdin(Stdio::null())
        .output()
        .unwrap();
    let shown = String::from_utf8_lossy(&run.stdout).into_owned();
    assert!(run.status.success(), "{words:?}: {shown}");
    shown
}

#[test]
fn long_runs_say_how_far_they_are() {
    let dir = workplace();
    let here = dir.path();
    for (command, more, says) in [
        // As many macropixels as take a second.
        (
            "frame",
            "--rows 32 --cols 32 --laser-cycles 2000 --set scene.lidar.fov_deg=4 --out f",
            "exposing",
        ),
        ("photons", "--laser-cycles 40", "drawing"),
        ("page", "", "making the page"),
        ("timing", "", "analysing"),
        ("reproduce", "--liberty example.lib", "measuring"),
        ("tb", "", "/1 testbenches"),
        ("power", "", "counting toggles"),
    ] {
        let mut words = words(command);
        if command == "reproduce" {
            words.truncate(1);
        }
        let more: Vec<&str> = more.split_whitespace().collect();
        for pair in more.chunks(2) {
            match words.iter().position(|word| word == pair[0]) {
                Some(at) => words[at + 1] = pair[1].to_owned(),
                None => words.extend(pair.iter().map(|word| (*word).to_owned())),
            }
        }
        let shown = on_terminal(here, &words);
        assert!(shown.contains(says), "{words:?}: {shown:?}");
        if command == "frame" {
            let counts = shown.split("exposing").skip(1);
            let counts = counts.filter_map(|part| part.split_once("/1024")?.0.rsplit(' ').next());
            let counts: Vec<u32> = counts.filter_map(|count| count.parse().ok()).collect();
            assert!(
                counts.iter().any(|&count| 0 < count && count < 1024),
                "{counts:?}"
            );
        }
        words.push("--quiet".into());
        assert_eq!(on_terminal(here, &words), "", "{words:?}");
        words.pop();
        let piped = Command::new(env!("CARGO_BIN_EXE_gdtof"))
            .args(&words)
            .current_dir(here)
            .output()
            .unwrap();
        let noted = String::from_utf8_lossy(&piped.stderr);
        assert!(!noted.contains(says), "{words:?}: {noted}");
    }
}

#[test]
fn long_runs_say_first_how_long_they_take() {
    let dir = workplace();
    for (words, says) in [
        ("reproduce", "gdtof: reproducing this takes about "),
        ("pareto", "gdtof: this comparison takes about "),
        ("demo van", "gdtof: van takes about "),
        (
            "drive --rows 2 --cols 2 --laser-cycles 2 --no-pictures --frames 100000",
            "gdtof: the rest of the drive takes about ",
        ),
    ] {
        let mut child = Command::new(env!("CARGO_BIN_EXE_gdtof"))
            .args(words.split(' '))
            .args(["--threads", "1"])
            .current_dir(dir.path())
            .stdout(Stdio::null())
            .stderr(Stdio::piped())
            .spawn()
            .unwrap();
        let mut line = String::new();
        let mut said = BufReader::new(child.stderr.take().unwrap());
        said.read_line(&mut line).unwrap();
        child.kill().unwrap();
        child.wait().unwrap();
        assert!(line.starts_with(says), "{words}: {line}");
        assert!(line.ends_with(" on 1 thread\n"), "{words}: {line}");
    }
}
