//! Every command of the book, `docs/`, in the order in which it stands in its chapter.

use std::path::{Path, PathBuf};
use std::process::Command;

use rayon::prelude::*;

use super::the_readme_runs::blocks;

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
                .args([
                    "-euo",
                    "pipefail",
                    "-c",
                    &blocks(&text, "sh").concat().join("\n"),
                ])
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
