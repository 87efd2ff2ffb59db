//! The published figures of the thesis: every claim that the model must meet is met, those that differ or are not
//! modelled are the ones that are known to be, and the command says so in files, in JSON and by its exit status.

use std::collections::BTreeSet;
use std::path::Path;
use std::process::{Command, Output};
use std::sync::OnceLock;

use guided_dtof::reproduce::{Report, Selection, Verdict, html, markdown, reproduce};

/// All claims, computed once; figures and tables are left to their own test.
fn claims() -> &'static Report {
    static REPORT: OnceLock<Report> = OnceLock::new();
    REPORT.get_or_init(|| {
        let selection = Selection {
            claims: Selection::all().claims,
            ..Selection::default()
        };
        reproduce(&selection, || ())
    })
}

fn gdtof(folder: &Path, arguments: &[&str]) -> Output {
    Command::new(env!("CARGO_BIN_EXE_gdtof"))
        .args(arguments)
        .current_dir(folder)
        .output()
        .unwrap()
}

#[test]
fn no_claim_leaves_its_tolerance() {
    let failures: Vec<String> = claims()
        .failures()
        .into_iter()
        .map(|(claim, row)| format!("claim {claim}: {}: {:?}", row.what, row.computed))
        .collect();
    assert!(failures.is_empty(), "{failures:#?}");
}

/// `vectors/remake.sh` remakes the list after a deliberate change.
#[test]
fn verdicts_are_the_known_ones() {
    let name = |verdict: Verdict| {
        serde_json::to_value(verdict)
            .unwrap()
            .as_str()
            .unwrap()
            .to_owned()
    };
    let lines = claims().claims.iter().flat_map(|result| {
        let line = move |row: &guided_dtof::reproduce::Row| {
            format!(
                "{} | {} | {}",
                result.claim.number,
                row.what,
                name(row.verdict())
            )
        };
        result.rows.iter().map(line)
    });
    let found: Vec<String> = lines.collect();
    let known: Vec<&str> = include_str!("../vectors/reproduce/verdicts.txt")
        .lines()
        .collect();
    let found_set: BTreeSet<&str> = found.iter().map(String::as_str).collect();
    let known_set: BTreeSet<&str> = known.iter().copied().collect();
    let new: Vec<_> = found_set.difference(&known_set).collect();
    let gone: Vec<_> = known_set.difference(&found_set).collect();
    assert!(
        new.is_empty() && gone.is_empty(),
        "new: {new:#?}, gone: {gone:#?}"
    );
    assert_eq!(found, known, "the same lines in another order");
}

#[test]
fn every_difference_and_every_gap_says_why() {
    for row in claims().rows() {
        match row.verdict() {
            Verdict::Differs | Verdict::NotModelled => {
                assert!(!row.notes().is_empty(), "{}", row.what)
            }
            Verdict::Agrees | Verdict::Ours => {
                assert!(row.computed.is_some_and(f64::is_finite), "{}", row.what)
            }
            Verdict::Fails => {}
        }
    }
}

#[test]
fn the_pages_hold_every_claim() {
    let report = claims();
    let (markdown, html) = (markdown(report), html(report));
    for result in &report.claims {
        assert!(markdown.contains(&format!("## Claim {}: ", result.claim.number)));
        assert!(html.contains(&format!("<section id=c{}>", result.claim.number)));
    }
    assert!(
        !html.contains("src=") && !html.contains("http-equiv"),
        "the page stands alone"
    );
}

#[test]
fn tables_and_figures_come_out_as_files_and_json() {
    let folder = tempfile::tempdir().unwrap();
    let output = gdtof(
        folder.path(),
        &[
            "reproduce",
            "--claim",
            "1",
            "--table",
            "9",
            "--figure",
            "71",
            "--json",
            "--out",
            "paper",
        ],
    );
    assert!(
        output.status.success(),
        "{}",
        String::from_utf8_lossy(&output.stderr)
    );
    let json: serde_json::Value = serde_json::from_slice(&output.stdout).unwrap();
    assert_eq!(json["claims"][0]["claim"], 1);
    assert_eq!(json["tables"][0]["table"], 9);
    assert_eq!(json["figures"][0]["figure"], 71);
    let mut files: Vec<String> = std::fs::read_dir(folder.path().join("paper"))
        .unwrap()
        .map(|entry| entry.unwrap().file_name().into_string().unwrap())
        .collect();
    files.sort();
    assert_eq!(
        files,
        [
            "fig_071.csv",
            "fig_071.svg",
            "report.html",
            "report.json",
            "report.md",
            "table_009.csv"
        ]
    );
    let page = std::fs::read_to_string(folder.path().join("paper/report.html")).unwrap();
    assert!(page.contains("<svg class=\"chart\""));
}

#[test]
fn what_does_not_exist_is_refused_in_one_sentence() {
    let folder = tempfile::tempdir().unwrap();
    for arguments in [["--figure", "999"], ["--table", "1"], ["--claim", "29"]] {
        let output = gdtof(
            folder.path(),
            &["reproduce", arguments[0], arguments[1], "--out", "paper"],
        );
        let error = String::from_utf8(output.stderr).unwrap();
        assert_eq!(output.status.code(), Some(2), "{error}");
        assert!(
            error.contains(arguments[0]) && error.contains("choose from"),
            "{error}"
        );
        assert_eq!(error.trim_end().lines().count(), 1, "{error}");
        assert!(output.stdout.is_empty() && !folder.path().join("paper").exists());
    }
}
