//! Every command of the book, `docs/`, in the order in which it stands in its chapter.

use std::path::{Path, PathBuf};
use std::process::Command;

use rayon::prelude::*;

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

/// What stands between lines of ```sh and ```.
fn commands(text: &str) -> String {
    let mut in_block = false;
    let mut commands = String::new();
    for line in text.lines() {
        match (in_block, line) {
            (false, "```sh") => in_block = true,
            (true, "```") => in_block = false,
            (true, line) => commands += &format!("{line}\n"),
            (false, _) => {}
        }
    }
    commands
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
            for folder in ["examples/blocks", "examples/scenes", "vectors/liberty"].map(Path::new) {
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
            (!output.status.success()).then(|| format!("{chapter}: {said}"))
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
