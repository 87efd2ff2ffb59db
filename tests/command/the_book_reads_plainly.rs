//! Prose of the book, the other documents, README, CONTRIBUTING and CHANGELOG keeps to the rules of CONTRIBUTING (*How to write*): none of the phrases below, and
//! sentences of at most 18 words on average in every chapter.
//!
//! Phrases are looked for in paragraphs, lists, tables and headings. Only sentences of paragraphs and lists are counted. Blocks of code are
//! left out. A link counts as its text, and a piece of code in a sentence as one word. `keys.md` is made of the keys' own texts and left out.

use std::path::{Path, PathBuf};

/// Most words of a chapter's mean sentence.
const MOST_WORDS: f64 = 18.0;

/// Fewest sentences that have a mean.
const FEWEST_SENTENCES: usize = 5;

/// Phrases at which a reader stops, in lower case, and what to write instead.
const PHRASES: [(&str, &str); 34] = [
    // Inversion, and things that act in place of somebody.
    ("for the asking", "you can"),
    ("is to be found", "is"),
    ("are to be little", "it minimises"),
    ("out come the", "it prints"),
    ("what becomes of", "say what happens to it"),
    ("what became of", "say what happened to it"),
    ("what is made of what", "how cells are chosen"),
    ("where they pay", "say which are kept, and why"),
    ("pays for it", "costs the same"),
    ("say of the thesis", "show of the thesis"),
    // Ellipsis.
    ("but for", "except for"),
    ("is no binary", "is not binary"),
    ("or said why", "exceptions are explained"),
    (
        "to their gates alone",
        "only gate-level engines support them",
    ),
    ("as a normal distribution has", "give the shares"),
    (
        "in the others ours asks",
        "elsewhere we are more pessimistic",
    ),
    (
        "as finely as it takes",
        "refines until the error is below …",
    ),
    ("on the wrong side of it", "define the error"),
    (
        "if every peak were a depth",
        "without the detection threshold",
    ),
    ("was told as", "was reported as"),
    ("that was aimed at", "target"),
    ("net for net", "identical to"),
    ("change for change", "identical to"),
    // Words of ours for what has a name.
    ("rooms", "name the thing"),
    ("house", "name the thing"),
    ("oddities", "exceptions"),
    ("breed", "kind"),
    ("grain", "texture"),
    ("rims", "edges"),
    ("hears of", "is told"),
    ("let of", "name the relation"),
    ("aside", "left out, or a remark"),
    ("asides", "remarks"),
    ("cure", "fix, or say what to do"),
];

/// A full stop after these ends no sentence.
const ABBREVIATIONS: [&str; 4] = ["Fig.", "Eq.", "al.", "e.g."];

fn root() -> &'static Path {
    Path::new(env!("CARGO_MANIFEST_DIR"))
}

/// Name and text of README, CONTRIBUTING and CHANGELOG, and of every file of documents that is not generated.
fn documents() -> Vec<(String, String)> {
    let mut paths: Vec<PathBuf> = ["README.md", "CONTRIBUTING.md", "CHANGELOG.md"]
        .map(|name| root().join(name))
        .to_vec();
    for folder in ["docs", "docs/src", "docs/src/commands"] {
        for entry in std::fs::read_dir(root().join(folder)).unwrap() {
            paths.push(entry.unwrap().path());
        }
    }
    paths.retain(|path| path.extension().is_some_and(|ending| ending == "md"));
    paths.retain(|path| !path.ends_with("docs/src/keys.md"));
    paths.sort();
    let document = |path: PathBuf| {
        let name = path.strip_prefix(root()).unwrap().display().to_string();
        (name, std::fs::read_to_string(path).unwrap())
    };
    paths.into_iter().map(document).collect()
}

/// Lines outside of blocks of code.
fn lines_of_prose(text: &str) -> Vec<&str> {
    let mut in_code = false;
    let mut lines = Vec::new();
    for line in text.lines().map(str::trim) {
        if line.starts_with("```") {
            in_code = !in_code;
        } else if !in_code {
            lines.push(line);
        }
    }
    lines
}

/// The text of links in their place, and one word in the place of a piece of code.
fn without_markup(text: &str) -> String {
    let pieces = text.split('`').enumerate();
    let is_code = |place: usize| place % 2 == 1;
    let text: String = pieces
        .map(|(place, piece)| if is_code(place) { "code" } else { piece })
        .collect();
    let mut parts = text.split("](");
    let mut plain = parts.next().unwrap_or("").to_owned();
    for part in parts {
        plain += part.split_once(')').map_or("", |(_target, rest)| rest);
    }
    plain.replace(['[', '*'], "")
}

/// Phrases of the list that a text has, as whole words.
fn phrases_in(text: &str) -> Vec<(&'static str, &'static str)> {
    let text = without_markup(&lines_of_prose(text).join(" ")).to_lowercase();
    let words: Vec<&str> = text
        .split(|sign: char| !sign.is_alphanumeric() && !['\'', '-'].contains(&sign))
        .filter(|word| !word.is_empty())
        .collect();
    let text = format!(" {} ", words.join(" "));
    let has = |phrase: &str| text.contains(&format!(" {phrase} "));
    PHRASES
        .into_iter()
        .filter(|(phrase, _)| has(phrase))
        .collect()
}

/// Paragraphs and items of lists, each in one line, without tables, headings and pictures.
fn paragraphs(text: &str) -> Vec<String> {
    let mut paragraphs = vec![String::new()];
    for line in lines_of_prose(text) {
        let numbered = line.split_once(". ");
        let numbered = numbered.filter(|(number, _)| number.parse::<u8>().is_ok());
        let item = line.strip_prefix("* ").or(numbered.map(|(_, item)| item));
        let is_no_sentence = line.is_empty() || line.starts_with(['#', '|']);
        if item.is_some() || is_no_sentence {
            paragraphs.push(String::new());
        }
        if !is_no_sentence && !line.starts_with("![") {
            let paragraph = paragraphs.last_mut().unwrap();
            *paragraph += item.unwrap_or(line);
            paragraph.push(' ');
        }
    }
    paragraphs.iter().map(|text| without_markup(text)).collect()
}

/// How many words each sentence of a text has.
fn sentence_lengths(text: &str) -> Vec<usize> {
    let mut lengths = Vec::new();
    for paragraph in paragraphs(text) {
        let mut length = 0;
        let mut words = paragraph.split_whitespace().peekable();
        while let Some(word) = words.next() {
            length += usize::from(word.contains(char::is_alphanumeric));
            let is_stop = word.trim_end_matches([')', '”']).ends_with(['.', '?', '!']);
            let goes_on = words.peek().is_some_and(|next| {
                next.starts_with(char::is_lowercase) && !next.starts_with("code")
            });
            let is_abbreviation = ABBREVIATIONS.iter().any(|short| word.ends_with(short));
            if is_stop && !goes_on && !is_abbreviation {
                lengths.push(std::mem::take(&mut length));
            }
        }
        lengths.push(length);
    }
    lengths.retain(|length| *length > 0);
    lengths
}

fn mean(lengths: &[usize]) -> f64 {
    lengths.iter().sum::<usize>() as f64 / lengths.len() as f64
}

#[test]
fn without_phrases_at_which_a_reader_stops() {
    let mut stops = Vec::new();
    for (name, text) in documents() {
        for (phrase, instead) in phrases_in(&text) {
            stops.push(format!("{name}: \"{phrase}\"; instead: {instead}"));
        }
    }
    assert!(stops.is_empty(), "{}", stops.join("\n"));
}

/// `--nocapture` shows the mean of every chapter.
#[test]
fn in_sentences_of_eighteen_words_on_average() {
    let mut too_long = Vec::new();
    for (name, text) in documents() {
        let lengths = sentence_lengths(&text);
        if lengths.len() < FEWEST_SENTENCES {
            continue;
        }
        let line = format!("{name}: {:.1} words a sentence", mean(&lengths));
        println!("{line}");
        if mean(&lengths) > MOST_WORDS {
            too_long.push(line);
        }
    }
    assert!(too_long.is_empty(), "{}", too_long.join("\n"));
}

#[test]
fn phrases_are_found_across_lines_and_not_in_code_or_words() {
    let text = "Waveforms are there for\nthe asking.\n\n```sh\nnet for net\n```\n\nA `cure` of\nlighthouses.\n\n| a | an\naside |\n";
    let phrases: Vec<&str> = phrases_in(text).iter().map(|(phrase, _)| *phrase).collect();
    assert_eq!(phrases, ["for the asking", "aside"]);
}

#[test]
fn sentences_end_at_stops_items_and_paragraphs() {
    let text = "# Not this heading\n\nTwo words. By Eq. 27 of the [whole thesis](there.md#a) it is\n`gdtof frame --out out`. 3145 see it:\n\n* one\n  item\n* another (6.4.2)\n\n1. numbered one\n\n| not | these |\n";
    assert_eq!(sentence_lengths(text), [2, 10, 3, 2, 2, 2]);
    assert_eq!(mean(&[2, 3]), 2.5);
}
