//! The published figures of the thesis: every claim that the model must meet is met, those that differ or are not
//! modelled are the ones that are known to be, and the command says so in files, in JSON and by its exit status.

use std::collections::BTreeSet;
use std::sync::OnceLock;

use guided_dtof_thesis::reproduce::{
    ClaimRow, Report, Selection, Verdict, html, markdown, overall, reproduce, tally,
};

use super::command::gdtof;

/// All claims, computed once; figures and tables are left to their own test.
pub fn claims() -> &'static Report {
    static REPORT: OnceLock<Report> = OnceLock::new();
    REPORT.get_or_init(|| {
        let selection = Selection {
            claims: Selection::all().claims,
            ..Selection::default()
        };
        reproduce(&selection, || ())
    })
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

fn rows_of(number: u32) -> &'static [ClaimRow] {
    let mut claims = claims().claims.iter();
    let claim = claims.find(|result| result.claim.number == number);
    &claim.expect("every claim is computed").rows
}

fn computed(number: u32, what: &str) -> f64 {
    let row = rows_of(number).iter().find(|row| row.what == what);
    let row = row.unwrap_or_else(|| panic!("claim {number} has no row {what}"));
    row.computed.unwrap()
}

/// Numbers that were put in: the ripple that the delays are chosen for, the delay lines' spread, measured light, published
/// times.
#[test]
fn inputs_that_come_out_again_are_given_and_meet_no_claim() {
    for (number, inputs) in [(2, 3), (20, 2), (21, 4), (27, 3)] {
        let rows = rows_of(number);
        let given = rows.iter().filter(|r| r.verdict() == Verdict::Given);
        assert_eq!(given.count(), inputs, "claim {number}");
        assert_ne!(overall(rows), Verdict::Agrees, "claim {number}");
    }
}

/// What is published of the demonstrator before its scenes comes from the whole chain; inputs that come out again are asides.
#[test]
fn the_demonstrator_s_claims_are_measured() {
    for number in 22..=26 {
        let rows = rows_of(number);
        let verdict = overall(rows);
        assert!(
            matches!(verdict, Verdict::Agrees | Verdict::Differs),
            "claim {number}: {verdict:?}"
        );
        for row in rows.iter().filter(|row| !row.is_aside) {
            let verdict = row.verdict();
            assert!(
                !matches!(verdict, Verdict::Given | Verdict::NotModelled),
                "claim {number}: {}: {verdict:?}",
                row.what
            );
        }
    }
}

/// Verdicts follow from what is computed: the same rows of other numbers have others.
#[test]
fn claims_that_looked_better_than_they_are_are_not_met() {
    let row = |number: u32, what: &str| {
        let mut rows = rows_of(number).iter();
        let row = rows.find(|row| row.what.starts_with(what));
        row.unwrap_or_else(|| panic!("claim {number} has no row {what}"))
    };
    // 128 and 10 px of disparity: what sees nothing nearer than 15 m sees no farther than 192 m.
    let farthest_m = [
        computed(17, "farthest distance at 10 px, 2×2 binned"),
        computed(17, "farthest distance at 10 px, unbinned"),
    ];
    let nearest_m = [
        computed(17, "nearest distance at 128 px, 2×2 binned"),
        computed(17, "nearest distance at 128 px, unbinned"),
    ];
    let mut meet_both = 0;
    for (near, far) in nearest_m.into_iter().zip(farthest_m) {
        assert!((far / near - 12.8).abs() < 1e-9, "{near} {far}");
        meet_both += u32::from((13.5..=16.5).contains(&near) && far >= 200.0);
    }
    let pairs = row(17, "pairs, unbinned and 2×2 binned");
    assert_eq!(pairs.computed, Some(f64::from(meet_both)));
    assert_eq!(overall(rows_of(17)), Verdict::Differs);

    assert_eq!(row(19, "simulated guide").verdict(), Verdict::Given);
    let held = row(19, "share of matched estimates");
    let held_as_published = held.computed.unwrap() >= 99.7;
    assert_eq!(held.verdict() == Verdict::Agrees, held_as_published);

    let counted = row(21, "signal photons per pulse times z² that the chip counts");
    assert_eq!(counted.verdict(), Verdict::Given);
    assert_eq!(counted.published.range(), Some((88.5, 89.5)));
    // What is given is in the model.
    for counted in [counted, row(21, "background that the chip counts")] {
        let (low, high) = counted.published.range().unwrap();
        let found = counted.computed.unwrap();
        assert!((low..=high).contains(&found), "{}: {found}", counted.what);
    }

    let crossing = row(24, "the same of one who crosses");
    let is_updated = crossing.computed.unwrap() >= 0.5;
    assert_eq!(crossing.verdict() == Verdict::Agrees, is_updated);

    let sliding = row(15, "penalty of the better partial histogram, measured");
    let (low, high) = sliding.interval.unwrap();
    let expected = match (low >= 6.0, high >= 6.0) {
        (true, _) => Verdict::Agrees,
        (false, true) => Verdict::NotShown,
        (false, false) => Verdict::Fails,
    };
    assert_eq!(sliding.verdict(), expected, "{low} to {high}");
}

/// Less is left of σ when what it comes from is taken away, and never less than its bound by more than chance.
#[test]
fn what_sigma_comes_from_is_measured() {
    let whole = computed(22, "σ at 50 m over its bound");
    let both = computed(22, "the same, both");
    assert!(0.9 < both && both <= whole, "{both} of {whole}");
}

#[test]
fn references_of_our_own_are_not_called_published() {
    let bounds = rows_of(10)
        .iter()
        .filter(|row| row.what.starts_with("bound at"));
    let verdicts: Vec<Verdict> = bounds.map(ClaimRow::verdict).collect();
    assert_eq!(verdicts, [Verdict::Ours; 3]);
}

/// Three of zooming's coarse bins end at 74.83 m: a metre decides between 28× and 81×.
#[test]
fn the_step_of_zooming_is_shown_from_both_sides() {
    let zooming: Vec<f64> = {
        let rows = rows_of(15).iter();
        let from = rows.skip_while(|row| row.what != "penalty of zooming");
        from.take(2).filter_map(|row| row.computed).collect()
    };
    assert!(
        (zooming[0] - 81.3).abs() < 0.1 && (zooming[1] - 28.0).abs() < 0.5,
        "{zooming:?}"
    );
    assert!((computed(15, "third zoom step from") * 3.0 - 74.83).abs() < 0.01);
}

#[test]
fn the_tally_counts_every_row_and_claim_once() {
    let text = tally(claims());
    let numbers = |line: &str| -> Vec<usize> {
        let words = line.split(|c: char| !c.is_ascii_digit());
        words.filter_map(|word| word.parse().ok()).collect()
    };
    let lines: Vec<Vec<usize>> = text.lines().map(numbers).collect();
    assert_eq!(lines[0][0], 29);
    assert_eq!(lines[1][0], claims().rows().count());
    for line in &lines {
        assert_eq!(line[0], line[1..].iter().sum::<usize>(), "{text}");
    }
    let agree = claims()
        .claims
        .iter()
        .filter(|c| overall(&c.rows) == Verdict::Agrees);
    let agree = agree.count();
    assert_eq!(lines[0][1], agree, "{text}");
    let chapter = include_str!("../../docs/src/commands/reproduce.md").replace('\n', " ");
    assert!(chapter.contains(&format!(
        "all that is published of it agrees: {agree} of 29 are,"
    )));
}

/// A difference from a published 0 has no percentage.
#[test]
fn nothing_is_infinitely_far_off() {
    let report = claims();
    for text in [markdown(report), html(report)] {
        assert!(!text.contains("inf %") && !text.contains("NaN"));
    }
}

#[test]
fn the_thesis_s_slips_are_listed() {
    let report = claims();
    let (markdown, html) = (markdown(report), html(report));
    for slip in [
        "at most 7 fps",
        "at most 6 fps",
        "1.25 ns",
        "3.5 % at 840 nm",
    ] {
        assert!(markdown.contains(slip) && html.contains(slip), "{slip}");
    }
    assert_eq!(report.json()["slips"].as_array().unwrap().len(), 6);
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
        let line = move |row: &ClaimRow| {
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
    let known: Vec<&str> = include_str!("../../vectors/reproduce/verdicts.txt")
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
            Verdict::Differs | Verdict::NotShown | Verdict::NotModelled | Verdict::Given => {
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
            "manifest.json",
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
    for arguments in [["--figure", "999"], ["--table", "1"], ["--claim", "30"]] {
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
