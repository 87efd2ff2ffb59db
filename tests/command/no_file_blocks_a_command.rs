//! Pipes, devices and folders in the place of every file: refused with a sentence, in time.

use std::os::unix::fs::symlink;
use std::path::Path;
use std::process::Command;
use std::time::Duration;

use super::every_command::{commands, is_text, within, words, workplace};

/// Far longer than a refusal takes.
const LIMIT: Duration = Duration::from_secs(60);

/// What an argument of a kind is in a command.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
enum Role {
    /// A file that is read, in the words that name it.
    Input(&'static str),
    /// A folder that is read.
    InputFolder,
    /// A file that is written.
    Output,
    /// A folder that is written.
    OutputFolder,
    /// No file.
    Text,
}

/// Of an argument that is a path or a text; a new one fails here until it is entered.
fn role(command: &str, argument: &str) -> Role {
    use Role::*;
    match (command, argument) {
        ("sweep merge", "folders") | ("page", "folder") | ("export frame", "frame") => InputFolder,
        (_, "block") => Input("p_counter="),
        (_, "set") => Input("sensor.liberty="),
        (_, "guide" | "guides") => Input("file:path="),
        (
            "calibrate" | "range" | "replay" | "page" | "wave" | "export sdc" | "export sdf",
            "out",
        ) => Output,
        (_, "out") => OutputFolder,
        (_, "plot" | "vcd" | "saif" | "checks_json" | "save_calibration")
            if command != "sweep" && command != "sweep merge" =>
        {
            Output
        }
        (
            _,
            "sensor" | "scene" | "world" | "liberty" | "left" | "right" | "calib" | "truth"
            | "calibration" | "inits" | "events" | "sdf" | "histograms" | "frame" | "study",
        ) => Input(""),
        (
            _,
            "census" | "left_right" | "plots" | "cell" | "windows" | "probe" | "pixel" | "names"
            | "plot" | "only",
        ) => Text,
        _ => panic!("enter the argument {argument} of {command} here"),
    }
}

/// What must be given besides an argument, so that its file is opened; `@` stands for the same file.
fn besides(command: &str, argument: &str) -> &'static str {
    match (command, argument) {
        ("frame", "left" | "right" | "calib" | "truth") => "--left @ --right @ --calib @ --truth @",
        ("replay", "vcd" | "saif" | "sdf") => "--engine gate",
        ("replay", "checks_json") => "--engine gate --checks report",
        ("timing", "plot") => "--mismatch 0.05",
        ("range", "calibration") => "",
        ("range", "frame") => "--format frame",
        ("export verilog", "sdf" | "inits" | "events") => {
            "--inits inits.csv --events events.csv --rows 1 --cols 2 --stop-periods 100 --laser-cycles 5"
        }
        _ => "",
    }
}

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

/// The words of a command with `value` for an argument, instead of what it has there.
fn with(command: &str, argument: &clap::Arg, value: &str) -> Vec<String> {
    let id = argument.get_id().as_str();
    let mut all = words(command);
    if (command, id) == ("reproduce", "liberty") {
        all.truncate(1);
    }
    all.push("--quiet".into());
    let extra = besides(command, id).replace('@', value);
    let option = argument.get_long().map(|long| format!("--{long}"));
    let mut extra: Vec<String> = extra.split_whitespace().map(str::to_owned).collect();
    let named = option.iter().cloned().chain(extra.iter().cloned());
    // An option that is given twice is refused.
    for option in named
        .filter(|word| word.starts_with("--"))
        .collect::<Vec<_>>()
    {
        if let Some(at) = all.iter().position(|word| *word == option) {
            all.drain(at..at + 2);
        }
    }
    let value = match role(command, id) {
        Role::Input(prefix) => format!("{prefix}{value}"),
        _ => value.to_owned(),
    };
    let place = command.split(' ').count() + argument.get_index().map_or(0, |index| index - 1);
    let at = |words: &[String], option: &String| words.iter().position(|word| word == option);
    match option {
        Some(option) => match at(&extra, &option) {
            Some(at) => extra[at + 1] = value,
            None => extra.extend([option, value]),
        },
        // After the command's own words.
        None if all.get(place).is_some_and(|word| !word.starts_with("--")) => all[place] = value,
        None => all.push(value),
    }
    all.extend(extra);
    all
}

#[test]
fn no_argument_of_a_command_waits_for_a_file_or_reads_it_without_end() {
    let dir = workplace_with_sources();
    let here = dir.path();
    let (mut tried, mut wrong) = (0, Vec::new());
    for (command, arguments) in commands() {
        for argument in arguments.iter().filter(|argument| is_text(argument)) {
            let role = role(&command, argument.get_id().as_str());
            for (source, kind) in SOURCES {
                let wants_folder = matches!(role, Role::InputFolder | Role::OutputFolder);
                if role == Role::Text || wants_folder && kind == "folder" {
                    continue;
                }
                let words = with(&command, argument, source);
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
    assert!(tried > 250, "{tried}");
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
