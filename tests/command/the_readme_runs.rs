//! The commands of README.md from top to bottom, in one folder that is empty but for the study that README names.
//!
//! `cargo run --release --` stands for the program that was built with the tests. What installs something or opens a window is left out;
//! the test prints these lines. `python/tests/test_readme.py` runs the blocks of Python, and the book's tests its chapters.
//!
//! What takes half a minute is shortened; the test prints how. With `GDTOF_CASES=1` nothing is.

use std::path::Path;
use std::process::Command;

/// How a line of README begins that is not run, and why.
const LEFT_OUT: [(&str, &str); 5] = [
    ("cargo test", "it is what runs this test"),
    ("cargo install ", "it installs the program"),
    ("pip install ", "it installs the Python package"),
    ("gtkwave ", "it opens a window"),
    ("surfer ", "it opens a window"),
];

/// What is short for what takes long: fewer frames, points and designs.
const SHORTENED: [(&str, &str); 3] = [
    ("--frames 30", "--frames 2"),
    (
        "laser_and_sunlight.toml",
        "laser_and_sunlight.toml --shard 1/36",
    ),
    (
        "--klux 1 --fps 50",
        "--klux 1 --fps 50 --bins 16 --clk 384 --thresholds 0 --guide-sigma 0.3",
    ),
];

/// What README says that a frame leaves in `out`, and what its viewers open there.
const FILES_OF_A_FRAME: [&str; 6] = [
    "depth.png",
    "histograms.npy",
    "frame.json",
    "probe_r31_c31.vcd",
    "probe_r31_c31.gtkw",
    "probe_r31_c31.sucl",
];

/// A file of the repository that a command of README reads.
const STUDY: &str = "examples/studies/laser_and_sunlight.toml";

fn readme() -> String {
    std::fs::read_to_string(Path::new(env!("CARGO_MANIFEST_DIR")).join("README.md")).unwrap()
}

/// Lines between ```KIND and ```, block after block.
pub fn blocks(text: &str, kind: &str) -> Vec<Vec<String>> {
    let mut blocks: Vec<Vec<String>> = Vec::new();
    let (begin, mut is_inside) = (format!("```{kind}"), false);
    for line in text.lines() {
        if is_inside {
            is_inside = line != "```";
            if is_inside {
                blocks.last_mut().unwrap().push(line.to_owned());
            }
        } else if line == begin {
            is_inside = true;
            blocks.push(Vec::new());
        }
    }
    blocks
}

/// A line as a shell runs it here; `None` for one that is left out.
fn runnable(line: &str) -> Option<String> {
    let is_left_out = LEFT_OUT.iter().any(|(begin, _)| line.starts_with(begin));
    (!is_left_out).then(|| line.replace("cargo run --release -- ", "gdtof "))
}

/// A line that takes little time, unless all is asked for.
fn shortened(mut line: String) -> String {
    let is_whole = std::env::var("GDTOF_CASES").is_ok();
    for (long, short) in SHORTENED {
        if !is_whole && line.contains(long) {
            line = line.replace(long, short);
            eprintln!("SHORTENED: {line}");
        }
    }
    line
}

/// Runs a line and returns what it prints.
fn run(folder: &Path, line: &str) -> String {
    let program = Path::new(env!("CARGO_BIN_EXE_gdtof"));
    let programs = program.parent().unwrap().display();
    let path = format!("{programs}:{}", std::env::var("PATH").unwrap());
    let output = Command::new("bash")
        .args(["-euo", "pipefail", "-c", line])
        .env("PATH", path)
        .current_dir(folder)
        .output()
        .unwrap();
    let complaint = String::from_utf8_lossy(&output.stderr).into_owned();
    assert!(output.status.success(), "{line}: {complaint}");
    String::from_utf8(output.stdout).unwrap()
}

#[test]
#[cfg(unix)]
fn from_top_to_bottom_in_an_empty_folder() {
    let (text, folder) = (readme(), tempfile::tempdir().unwrap());
    let here = folder.path();
    std::fs::create_dir_all(here.join(STUDY).parent().unwrap()).unwrap();
    let study = Path::new(env!("CARGO_MANIFEST_DIR")).join(STUDY);
    std::fs::copy(study, here.join(STUDY)).unwrap();
    let lines = blocks(&text, "sh").concat();
    let mut printed = Vec::new();
    for line in &lines {
        match runnable(line) {
            Some(command) => printed.push(run(here, &shortened(command))),
            None => eprintln!("LEFT OUT: {line}"),
        }
    }
    assert!(printed.len() >= 15, "{lines:?}");
    for name in FILES_OF_A_FRAME {
        assert!(here.join("out").join(name).is_file(), "out/{name}");
    }
    // Commands with an output of their own name.
    for line in lines.iter().filter(|line| line.contains("--out ")) {
        let rest = line.split("--out ").nth(1).unwrap();
        let out = rest.split_whitespace().next().unwrap();
        assert!(here.join(out).is_dir(), "{line}");
    }
    assert!(here.join("page.html").is_file());
    // The table below the first command is the one that it prints, up to what README adds behind its columns.
    let squeezed = |line: &str| line.split_whitespace().collect::<Vec<_>>().join(" ");
    let table: Vec<String> = printed[0].lines().map(squeezed).collect();
    let shown = &blocks(&text, "text")[0];
    assert!(shown.len() >= 5, "{shown:?}");
    for line in shown {
        let line = squeezed(line);
        let is_printed = |row: &String| !row.is_empty() && line.starts_with(row.as_str());
        assert!(table.iter().any(is_printed), "{line}: not in {table:?}");
    }
}

/// Nothing is left out in silence: a line is left out for a reason that still applies.
#[test]
fn what_is_left_out_stands_in_the_readme() {
    let lines = blocks(&readme(), "sh").concat();
    for (begin, why) in LEFT_OUT {
        let stands = lines.iter().any(|line| line.starts_with(begin));
        assert!(stands, "{begin} ({why}) is in no line of README");
    }
    for (long, _) in SHORTENED {
        let stands = lines.iter().any(|line| line.contains(long));
        assert!(stands, "{long} is in no line of README");
    }
    let runs = lines.iter().filter_map(|line| runnable(line));
    for line in runs {
        assert!(
            line.starts_with("gdtof "),
            "{line}: neither run nor left out"
        );
    }
}
