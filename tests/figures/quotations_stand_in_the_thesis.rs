//! What the project quotes from the thesis stands there: words of published figures, and all between typographic quotes in claims, source,
//! book and README. Other quotes are not the thesis's.
//!
//! The thesis is not part of the project. It is looked for in `shared/seed` beside the checkout, or where `GDTOF_THESIS` says; without it the
//! test says so and is skipped.

use std::io::Write;
use std::path::{Path, PathBuf};

use guided_dtof_thesis::reproduce::{ClaimResult, ClaimRow, Report, between_quotes};

use super::published_figures_are_met::claims;

fn here() -> &'static Path {
    Path::new(env!("CARGO_MANIFEST_DIR"))
}

/// The thesis's text.
fn thesis() -> Option<String> {
    let folder = std::env::var_os("GDTOF_THESIS")
        .map_or_else(|| here().join("../shared/seed"), PathBuf::from);
    let files = std::fs::read_dir(folder).ok()?.filter_map(Result::ok);
    let texts = files.map(|file| file.path());
    let texts = texts.filter(|path| path.extension().is_some_and(|ending| ending == "txt"));
    let text: String = texts
        .map(|path| std::fs::read_to_string(path).unwrap())
        .collect();
    (!text.is_empty()).then_some(text)
}

/// A text without what line ends, page ends and typesetting do to it.
fn plain(text: &str) -> String {
    let mut text = text.to_owned();
    for (printed, meant) in [
        ("$", ""),
        ("\\times", "×"),
        ("\\text{CLK}", "CLK"),
        ("’", "'"),
        ("‘", "'"),
        ("–", "-"),
    ] {
        text = text.replace(printed, meant);
    }
    let words: Vec<&str> = text.split_whitespace().collect();
    words
        .join(" ")
        .replace(" × ", "×")
        .replace(" ×", "×")
        .replace("× ", "×")
}

/// Text files of the project below a folder.
fn texts_below(folder: &Path, found: &mut Vec<PathBuf>) {
    for entry in std::fs::read_dir(folder).unwrap() {
        let path = entry.unwrap().path();
        if path.is_dir() {
            texts_below(&path, found);
        } else if path
            .extension()
            .is_some_and(|ending| ending == "rs" || ending == "md" || ending == "toml")
        {
            found.push(path);
        }
    }
}

/// A file in one line, without the signs of comments and of strings that go on.
fn in_one_line(text: &str) -> String {
    let lines = text.lines().map(|line| {
        let line = line.trim();
        let line = ["//!", "///", "//", ">", "*"]
            .into_iter()
            .find_map(|sign| line.strip_prefix(sign))
            .unwrap_or(line);
        line.strip_suffix('\\').unwrap_or(line)
    });
    lines.collect::<Vec<_>>().join(" ")
}

/// What claims quote, with where.
fn quoted_in_claims(report: &Report) -> Vec<(String, String)> {
    let results = report.claims.iter();
    let of_claim = |result: &ClaimResult| {
        let place = format!("claim {}", result.claim.number);
        let words = result.rows.iter().flat_map(ClaimRow::quoted);
        let quoted = words.map(move |words| (place.clone(), words.to_owned()));
        quoted.collect::<Vec<_>>()
    };
    results.flat_map(of_claim).collect()
}

/// What files quote, tests in them left out, with where.
fn quoted_in_files() -> Vec<(String, String)> {
    let mut quoted = Vec::new();
    let mut files = ["README.md", "DESIGN.md", "COMPARE.md"]
        .map(|name| here().join(name))
        .to_vec();
    ["src", "crates", "docs/src"]
        .iter()
        .for_each(|folder| texts_below(&here().join(folder), &mut files));
    for file in files {
        let text = std::fs::read_to_string(&file).unwrap();
        let text = in_one_line(text.split("#[cfg(test)]").next().unwrap_or(""));
        let place = file.strip_prefix(here()).unwrap().display().to_string();
        quoted.extend(between_quotes(&text).map(|words| (place.clone(), words.to_owned())));
    }
    quoted
}

/// Looks up quotations, of which there must be `at_least`.
fn look_up(at_least: usize, quoted: impl FnOnce() -> Vec<(String, String)>) {
    let Some(thesis) = thesis() else {
        // Not eprintln, which cargo hides where a test passes.
        let _ = writeln!(
            std::io::stderr(),
            "SKIPPED: no text of the thesis in ../shared/seed; set GDTOF_THESIS"
        );
        return;
    };
    let (thesis, quoted) = (plain(&thesis), quoted());
    assert!(quoted.len() >= at_least, "they are found: {quoted:?}");
    let missing: Vec<_> = quoted
        .iter()
        .filter(|(_, words)| words.trim().is_empty() || !thesis.contains(&plain(words)))
        .collect();
    assert!(missing.is_empty(), "not in the thesis: {missing:#?}");
}

#[test]
fn what_files_quote_stands_in_the_thesis() {
    look_up(12, quoted_in_files);
}

#[test]
fn what_claims_quote_stands_in_the_thesis() {
    look_up(25, || quoted_in_claims(claims()));
}

#[test]
fn what_typesetting_does_is_undone_and_nothing_else() {
    let printed = "after every $5 \\times \\text{CLK}$ cycles\nof the  rig’s";
    assert!(plain(printed).contains(&plain("5 × CLK cycles of the rig's")));
    assert!(!plain(printed).contains(&plain("after 5 × CLK cycles")));
    let comment = "//! It says “so\n//! much”, and “no\n\\\n   more”";
    let comment = in_one_line(comment);
    let quoted: Vec<String> = between_quotes(&comment).map(plain).collect();
    assert_eq!(quoted, ["so much", "no more"]);
}
