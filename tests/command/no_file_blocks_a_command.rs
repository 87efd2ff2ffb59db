//! Pipes, devices and folders in the place of every file: refused with a sentence, in time.

use std::os::unix::fs::symlink;
use std::path::Path;
use std::process::Command;
use std::time::Duration;

use super::every_command::{commands, is_text, within, workplace};
use super::every_path::{Role, role, words_with};
use super::tools::takes_all;

/// Far longer than a refusal takes.
const LIMIT: Duration = Duration::from_secs(60);

/// Names in the folder, and what each is called in the refusal.
const SOURCES: [(&str, &str); 4] = [
    ("pipe.csv", "pipe"),
    ("folder.csv", "folder"),
    ("zero.csv", "device"),
    ("urandom.csv", "device"),
];

/// As [`workplace`], with a pipe, a folder and links to devices. Root would replace a device itself, were it an output.
fn workplace_with_sources() -> tempfile::TempDir {
    let dir = workplace();
    let here = dir.path();
    make_pipe(&here.join("pipe.csv"));
    std::fs::create_dir(here.join("folder.csv")).unwrap();
    symlink("/dev/zero", here.join("zero.csv")).unwrap();
    symlink("/dev/urandom", here.join("urandom.csv")).unwrap();
    dir
}

fn make_pipe(path: &Path) {
    let status = Command::new("mkfifo").arg(path).status();
    assert!(status.unwrap().success());
}

#[test]
fn no_argument_of_a_command_waits_for_a_file_or_reads_it_without_end() {
    let dir = workplace_with_sources();
    let here = dir.path();
    // Devices are refused alike, so one does for each change.
    let sources = if takes_all() {
        &SOURCES[..]
    } else {
        &SOURCES[..3]
    };
    let (mut tried, mut wrong) = (0, Vec::new());
    for (command, arguments) in commands() {
        for argument in arguments.iter().filter(|argument| is_text(argument)) {
            let role = role(&command, argument.get_id().as_str());
            for &(source, kind) in sources {
                let wants_folder = matches!(role, Role::InputFolder | Role::OutputFolder);
                if role == Role::Text || wants_folder && kind == "folder" {
                    continue;
                }
                let words = words_with(&command, argument, source);
                let run = within(here, &words, LIMIT);
                let error = String::from_utf8_lossy(&run.stderr).into_owned();
                let is_refused = run.status.code() == Some(2)
                    && error.trim_end().lines().count() == 1
                    && error.contains(source)
                    && (wants_folder || error.contains(kind));
                if !is_refused {
                    wrong.push(format!("{words:?}: {:?} {error}", run.status));
                }
                tried += 1;
            }
        }
    }
    assert!(
        wrong.is_empty(),
        "{} of {tried}:\n{}",
        wrong.len(),
        wrong.join("\n")
    );
    assert!(tried > 62 * sources.len(), "{tried}");
    assert!(here.join("zero.csv").is_symlink() && here.join("urandom.csv").is_symlink());
}

/// Files that are found in a folder or named in a file, not given.
#[test]
fn no_file_in_a_folder_of_results_is_waited_for() {
    let dir = workplace_with_sources();
    let here = dir.path();
    let taken = std::fs::read_to_string(here.join("taken/frame.json")).unwrap();
    let library = here.join("pipe.csv");
    let named = taken.replacen(
        "\"liberty\":\"\"",
        &format!("\"liberty\":{:?}", library.display()),
        1,
    );
    assert_ne!(named, taken);
    std::fs::create_dir(here.join("named")).unwrap();
    std::fs::write(here.join("named/frame.json"), named).unwrap();
    let frame = "frame --rows 2 --cols 2 --laser-cycles 2 --probe none";
    for (pipe, words, succeeds) in [
        ("out/manifest.json", format!("{frame} --out out"), true),
        ("out/depth.png", format!("{frame} --out out"), true),
        (
            "swept/journal-9.log",
            "sweep study.toml --out swept".into(),
            true,
        ),
        (
            "swept/results.csv",
            "sweep study.toml --out swept".into(),
            true,
        ),
        (
            "swept/study.json",
            "sweep study.toml --out swept".into(),
            false,
        ),
        ("swept/study.json", "sweep merge swept".into(), false),
        ("swept/journal-9.log", "sweep merge swept".into(), true),
        ("taken/histograms.npy", "page taken".into(), false),
        ("taken/histograms.npy", "export frame taken".into(), false),
        ("taken/frame.json", "page taken".into(), false),
        ("taken/frame.json", "export frame taken".into(), false),
        (
            "taken/frame.json",
            "wave --frame taken/frame.json --pixel 0,0 --cycle 0".into(),
            false,
        ),
        (
            "named/none",
            "wave --frame named/frame.json --pixel 0,0 --cycle 0".into(),
            false,
        ),
        ("named/none", "page named".into(), false),
    ] {
        let path = here.join(pipe);
        std::fs::create_dir_all(path.parent().unwrap()).unwrap();
        let before = std::fs::read(&path).ok();
        let _ = std::fs::remove_file(&path);
        make_pipe(&path);
        let words: Vec<&str> = words.split(' ').collect();
        let run = within(here, &words, LIMIT);
        let error = String::from_utf8_lossy(&run.stderr).into_owned();
        let status = if succeeds { 0 } else { 2 };
        assert_eq!(
            run.status.code(),
            Some(status),
            "{pipe}, {words:?}: {error}"
        );
        let _ = std::fs::remove_file(&path);
        if let Some(bytes) = before {
            std::fs::write(&path, bytes).unwrap();
        }
    }
}
