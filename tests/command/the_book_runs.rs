//! Every command of the book, `docs/`, in the order in which it stands in its chapter.
//!
//! What takes seconds is shortened, most of it to a smaller array. With `GDTOF_CASES=1` nothing is.

use std::path::{Path, PathBuf};
use std::process::Command;

use rayon::prelude::*;

use super::the_readme_runs::blocks;
use super::tools::takes_all;

/// What the commands have that need not take the whole array, because no later command reads a macropixel of theirs.
const ON_A_SMALL_ARRAY: [&str; 32] = [
    // first-hour
    "vcsel_flash --out hall",
    "--out worker",
    "--out weak",
    "illuminance_klux=50 --out sun",
    "max_disparity_px=31 --out near",
    "--out smoke",
    "--out short",
    "--out long",
    "my_chip.toml --out mine",
    // concepts, guides
    "--probe none --out conventional",
    "third_camera_baseline_m=0.2 --out near",
    // frame, drive, page, stereo
    "--out glass",
    "--out slower",
    "--out truth",
    "--out fused",
    "--out neighbour",
    "--out cohort",
    "--out cheapest",
    "--laser-cycles 200 --out drive",
    "--out tracked",
    "--out recorded",
    "--out still",
    "--out matched",
    "--probe none --page",
    // settings, recipes, physics
    "--out warehouse",
    "--out shift_register",
    "--out more_bins",
    "--out fewer_spads",
    "--out guide_$sigma",
    "--out sun_$klux",
    "--out hot",
    "--out two_lidars",
];

/// Fewer macropixels, each with about the light of one of the whole array.
const SMALL_ARRAY: &str = "--rows 16 --cols 16 --set scene.lidar.fov_deg=2";

/// What is short for what else takes long: fewer macropixels of which times are told, fewer points and frames, another demo and
/// another figure.
const SHORTENED: [(&str, &str); 12] = [
    (
        "demo fog --laser-cycles 500",
        "demo glass --calibration-step-ps 200 --laser-cycles 100",
    ),
    ("timing --block", "timing --rows 4 --cols 4 --block"),
    ("timing --process", "timing --rows 4 --cols 4 --process"),
    (
        "timing --rows 16 --cols 16 --mismatch",
        "timing --rows 4 --cols 4 --mismatch",
    ),
    ("timing --set", "timing --rows 4 --cols 4 --set"),
    (
        "gdtof timing --liberty",
        "gdtof timing --rows 4 --cols 4 --liberty",
    ),
    ("timing --explain", "timing --rows 4 --cols 4 --explain"),
    (
        "--mapped --out mapped",
        "--mapped --rows 2 --cols 2 --out mapped",
    ),
    ("--figure 45 ", "--figure 32 "),
    (
        "--frames 4 --laser-cycles 400",
        "--frames 2 --laser-cycles 400",
    ),
    ("steps = 3, scale", "steps = 2, scale"),
    (
        "--bins 8,16 --clk 200,384 --thresholds 0 --guide-sigma 0.3,1",
        "--bins 16 --clk 384 --thresholds 0 --guide-sigma 0.3",
    ),
];

fn book() -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join("docs/src")
}

/// Chapters that the table of contents names.
fn chapters() -> Vec<String> {
    let summary = std::fs::read_to_string(book().join("SUMMARY.md")).unwrap();
    let links = summary.lines().filter_map(|line| line.split("](").nth(1));
    links
        .map(|link| link.trim_end_matches(')').to_owned())
        .collect()
}

/// The commands of a chapter, which take little time unless all is asked for.
fn commands(text: &str) -> String {
    let mut commands = blocks(text, "sh").concat().join("\n");
    if takes_all() {
        return commands;
    }
    for words in ON_A_SMALL_ARRAY {
        commands = commands.replace(words, &format!("{words} {SMALL_ARRAY}"));
    }
    for (long, short) in SHORTENED {
        commands = commands.replace(long, short);
    }
    commands
}

/// Counts of `replay` and laser cycles of `wave` below a folder in which nothing is counted: they show a reader nothing.
fn nothing_counted(folder: &Path) -> Vec<PathBuf> {
    let (mut empty, mut folders) = (Vec::new(), vec![folder.to_owned()]);
    while let Some(folder) = folders.pop() {
        for entry in std::fs::read_dir(folder).unwrap() {
            let path = entry.unwrap().path();
            let name = path.file_name().unwrap().to_string_lossy().into_owned();
            if path.is_dir() {
                folders.push(path);
            } else if name.ends_with(".csv") {
                let text = std::fs::read_to_string(&path).unwrap();
                let mut lines = text.lines();
                let is_counts = lines.next() == Some("row,col,bin,count");
                if is_counts && lines.all(|line| line.ends_with(",0")) {
                    empty.push(path);
                }
            } else if name.starts_with("wave_") && name.ends_with(".vcd") && !has_hit(&path) {
                empty.push(path);
            }
        }
    }
    empty
}

/// Whether a bit of HIT rises in a waveform.
fn has_hit(path: &Path) -> bool {
    let mut waves = wellen::simple::read(path).unwrap();
    let signal = {
        let hierarchy = waves.hierarchy();
        let mut vars = hierarchy.all_vars().map(|var| &hierarchy[var]);
        let hit = vars.find(|var| var.full_name(hierarchy).ends_with("metdc.HIT"));
        hit.expect("a macropixel has a HIT").signal_ref()
    };
    waves.load_signals(&[signal]);
    let mut changes = waves.get_signal(signal).unwrap().iter_changes();
    changes.any(|(_, value)| value.to_bit_string().unwrap().contains('1'))
}

#[test]
#[cfg(unix)]
fn every_command_runs() {
    let program = Path::new(env!("CARGO_BIN_EXE_gdtof"));
    let folder = program.parent().unwrap().display();
    let path = format!("{folder}:{}", std::env::var("PATH").unwrap());
    let failed: Vec<String> = (chapters().par_iter())
        .filter_map(|chapter| {
            let text = std::fs::read_to_string(book().join(chapter)).unwrap();
            let empty = tempfile::tempdir().unwrap();
            // What a chapter names of the repository.
            let [from, to] = [Path::new(env!("CARGO_MANIFEST_DIR")), empty.path()];
            for folder in [
                "examples/blocks",
                "examples/scenes",
                "vectors/liberty",
                "vectors/range",
            ]
            .map(Path::new)
            {
                std::fs::create_dir_all(to.join(folder)).unwrap();
                for entry in std::fs::read_dir(from.join(folder)).unwrap() {
                    let name = folder.join(entry.unwrap().file_name());
                    std::fs::copy(from.join(&name), to.join(name)).unwrap();
                }
            }
            let output = Command::new("bash")
                .args(["-euo", "pipefail", "-c", &commands(&text)])
                .env("PATH", &path)
                .current_dir(empty.path())
                .output()
                .unwrap();
            let said = String::from_utf8_lossy(&output.stderr).into_owned();
            if !output.status.success() {
                return Some(format!("{chapter}: {said}"));
            }
            let empty_ones = nothing_counted(empty.path());
            (!empty_ones.is_empty()).then(|| format!("{chapter}: nothing counts in {empty_ones:?}"))
        })
        .collect();
    assert!(failed.is_empty(), "{}", failed.join("\n"));
}

#[test]
fn what_is_shortened_stands_in_the_book() {
    let texts = chapters()
        .into_iter()
        .map(|chapter| std::fs::read_to_string(book().join(chapter)).unwrap());
    let all: Vec<String> = texts
        .flat_map(|text| blocks(&text, "sh").concat())
        .collect();
    let long = SHORTENED.iter().map(|(long, _)| *long);
    for words in ON_A_SMALL_ARRAY.into_iter().chain(long) {
        let stands = all.iter().any(|line| line.contains(words));
        assert!(stands, "{words} is in no command of the book");
    }
}

#[test]
fn every_chapter_is_in_the_table_of_contents_and_links_lead_somewhere() {
    let chapters = chapters();
    let mut files: Vec<PathBuf> = Vec::new();
    for folder in [book(), book().join("commands")] {
        for entry in std::fs::read_dir(folder).unwrap() {
            let path = entry.unwrap().path();
            if path.extension().is_some_and(|ending| ending == "md") {
                files.push(path);
            }
        }
    }
    for file in files {
        let name = file.strip_prefix(book()).unwrap().display().to_string();
        assert!(name == "SUMMARY.md" || chapters.contains(&name), "{name}");
        let text = std::fs::read_to_string(&file).unwrap();
        for link in text.split("](").skip(1) {
            let target = link.split([')', '#']).next().unwrap();
            let is_local = !target.is_empty() && !target.contains("://");
            let path = file.parent().unwrap().join(target);
            assert!(!is_local || path.exists(), "{name}: {target}");
        }
    }
}

/// The book has a chapter, or a part of one, for every command.
#[test]
fn every_command_is_in_the_book() {
    let help = Command::new(env!("CARGO_BIN_EXE_gdtof"))
        .arg("--help")
        .output()
        .unwrap();
    let help = String::from_utf8(help.stdout).unwrap();
    let listed = help.split("<COMMAND>").nth(1).unwrap();
    let listed = listed.split("Options:").next().unwrap().lines();
    let all: String = (chapters().iter())
        .map(|chapter| std::fs::read_to_string(book().join(chapter)).unwrap())
        .collect();
    for line in listed {
        let name = line
            .strip_prefix("  ")
            .and_then(|line| line.split(' ').next());
        let Some(name) = name.filter(|name| !name.is_empty() && *name != "help") else {
            continue;
        };
        assert!(all.contains(&format!("gdtof {name}")), "{name}");
    }
}

#[test]
fn the_citation_names_this_version_and_licence() {
    let root = Path::new(env!("CARGO_MANIFEST_DIR"));
    let citation = std::fs::read_to_string(root.join("CITATION.cff")).unwrap();
    let has = |line: &str| citation.lines().any(|other| other == line);
    assert!(has(concat!("version: ", env!("CARGO_PKG_VERSION"))));
    assert!(has(concat!("license: ", env!("CARGO_PKG_LICENSE"))));
}
