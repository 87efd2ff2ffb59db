//! Whether guides are as wrong as they say, by the table of the book and what prints it.

#[allow(dead_code, reason = "an example has a main function")]
#[path = "../../examples/claims_of_guides.rs"]
mod claims_of_guides;

use claims_of_guides::{GUIDES, SCENES, line};

/// Share of a normal distribution within 3 standard deviations of its mean: what a claim promises.
const PROMISED: f64 = 0.997_300_2;

/// Numbers of a line; other processors round otherwise.
fn numbers(line: &str) -> Vec<f64> {
    let cells = line.split('|').map(str::trim);
    cells.filter_map(|cell| cell.parse().ok()).collect()
}

fn in_the_book(guide: &str, scene: &str) -> String {
    let book = include_str!("../../docs/src/guides.md");
    let begin = format!("| `{}` | {scene} |", guide.replace('+', "` + `"));
    let line = book.lines().find(|line| line.starts_with(&begin));
    line.expect("every guide before every scene").to_owned()
}

/// The book's table is what the example prints: here of the default guide, in the whole of one frame's errors.
#[test]
fn the_table_of_the_book_is_what_guides_do() {
    for guide in ["stereo", "truth"] {
        let (told, found) = (in_the_book(guide, "van"), line(guide, "van").unwrap());
        let (told, found) = (numbers(&told), numbers(&found));
        assert_eq!((told.len(), found.len()), (5, 5));
        for (told, found) in told.iter().zip(&found) {
            assert!((told - found).abs() < 0.011, "{guide}: {told} {found}");
        }
    }
}

/// Macropixels of the table with a target: some 3000 in each of at least four frames.
const TARGETS: f64 = 12_000.0;

/// At 3 standard deviations shares are within a hundredth of what is promised, and what chance does to few estimates.
#[test]
fn claims_are_kept_at_three_sigma() {
    for (guide, scene) in GUIDES.iter().flat_map(|g| SCENES.map(|s| (*g, s))) {
        let (estimated, three) = match numbers(&in_the_book(guide, scene))[..] {
            [estimated, _, _, _, three] => (estimated, three),
            // Nothing has an estimate.
            [0.0] => continue,
            _ => panic!("{guide} {scene}"),
        };
        let deviation = (PROMISED * (1.0 - PROMISED) / (estimated * TARGETS)).sqrt();
        let most = 0.01 + 3.0 * deviation;
        assert!((three - PROMISED).abs() <= most, "{guide} {scene}: {three}");
    }
}
