//! What is wrong with something the user gave, in one sentence that an editor can jump to.

use std::borrow::Cow;
use std::fmt;
use std::io;
use std::path::Path;

/// What is wrong with something the user gave us, and the cure.
#[derive(Debug, Clone, PartialEq, Eq, thiserror::Error)]
#[non_exhaustive]
pub struct InputError {
    /// File (or command-line option) at fault.
    pub source_name: String,
    /// One-based line, where there is one.
    pub line: Option<usize>,
    /// What is wrong and what to do about it.
    pub message: String,
    /// Further faults found in the same go, a line of text each.
    pub further: Vec<InputError>,
}

/// Names up to this many are listed where none is like the given one.
const MOST_LISTED: usize = 12;

/// How alike names are, by Jaro's measure, of which one is taken for the other: `clkhz` and `clk_hz` 0.94, `radr` and `radar` 0.93, `quantic`
/// and `quantic4x4` 0.9, `pd` and `pde` 0.89; `colour` and `cols` 0.75.
const ALIKE: f64 = 0.8;

/// The one of `known` that `given` is most like, if it is like any.
pub fn nearest<'k>(given: &str, known: impl IntoIterator<Item = &'k str>) -> Option<&'k str> {
    let given = given.to_lowercase();
    let with_likeness = |name: &'k str| (strsim::jaro(&given, &name.to_lowercase()), name);
    let known = known.into_iter().map(with_likeness);
    let best = known.max_by(|a, b| a.0.total_cmp(&b.0))?;
    (best.0 > ALIKE).then_some(best.1)
}

/// What to do about `given`, which is none of the `known` names: to follow a semicolon.
pub fn instead_of<'k>(given: &str, known: impl IntoIterator<Item = &'k str>) -> String {
    let known: Vec<&str> = known.into_iter().collect();
    match (nearest(given, known.iter().copied()), known.split_last()) {
        (Some(name), _) => format!("did you mean `{name}`?"),
        (None, None) => "leave it out".to_owned(),
        (None, Some((last, []))) => format!("give {last}"),
        (None, Some((last, others))) if known.len() <= MOST_LISTED => {
            format!("give {} or {last}", others.join(", "))
        }
        (None, Some(_)) => format!("give one of the {} names that there are", known.len()),
    }
}

/// An error of the system without its number.
pub fn in_words(error: &io::Error) -> String {
    if error.kind() == io::ErrorKind::UnexpectedEof {
        return "it ends early".to_owned();
    }
    let said = error.to_string();
    match said.rsplit_once(" (os error ") {
        Some((words, number)) if number.ends_with(')') => words.to_owned(),
        _ => said,
    }
}

/// Most characters of a source, or of a word of a message, before the middle is left out.
const LONGEST_WORD: usize = 160;

/// Most characters of a message. Those of the program have fewer; what they quote of the user's need not.
const LONGEST_MESSAGE: usize = 480;

/// `text` without its middle, if it has more than `most` characters.
fn without_middle(text: &str, most: usize) -> Cow<'_, str> {
    let length = text.chars().count();
    if length <= most {
        return text.into();
    }
    let head = text.chars().take(most / 4);
    let tail = text.chars().skip(length - most * 3 / 4);
    head.chain(['…']).chain(tail).collect()
}

/// A path or an option as a sentence has room for it, without the folder in which results are prepared.
fn shortened(source: &str) -> String {
    let is_staging = |part: &&str| !part.starts_with(".gdtof-");
    let parts: Vec<&str> = source.split('/').filter(is_staging).collect();
    without_middle(&parts.join("/"), LONGEST_WORD).into_owned()
}

/// A message as a line has room for it, whatever it quotes.
fn in_room(message: &str) -> String {
    let words: Vec<_> = message
        .split(' ')
        .map(|word| without_middle(word, LONGEST_WORD))
        .collect();
    without_middle(&words.join(" "), LONGEST_MESSAGE).into_owned()
}

/// Text in one line: a terminal does nothing but show it.
struct EscapedText<'t>(&'t str);

impl fmt::Display for EscapedText<'_> {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        self.0.chars().try_for_each(|c| {
            if c.is_control() {
                write!(f, "{}", c.escape_default())
            } else {
                write!(f, "{c}")
            }
        })
    }
}

impl fmt::Display for InputError {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "{}", EscapedText(&self.source_name))?;
        if let Some(line) = self.line {
            write!(f, ":{line}")?;
        }
        write!(f, ": {}", EscapedText(&in_room(&self.message)))?;
        self.further.iter().try_for_each(|e| write!(f, "\n{e}"))
    }
}

impl InputError {
    /// A complaint about `source` as a whole.
    pub fn new(source: impl fmt::Display, message: impl Into<String>) -> Self {
        InputError {
            source_name: shortened(&source.to_string()),
            line: None,
            message: message.into(),
            further: Vec::new(),
        }
    }

    /// A complaint about one line (counted from 1) of `source`.
    pub fn at_line(source: impl fmt::Display, line: usize, message: impl Into<String>) -> Self {
        InputError {
            line: Some(line),
            ..Self::new(source, message)
        }
    }

    /// All of `faults` as one complaint, in their order.
    ///
    /// # Errors
    /// When there is any.
    pub fn all(faults: impl IntoIterator<Item = InputError>) -> Result<(), InputError> {
        let mut faults = faults.into_iter();
        match faults.next() {
            None => Ok(()),
            Some(mut first) => {
                first.further.extend(faults);
                Err(first)
            }
        }
    }

    /// Complains about a file that cannot be read.
    pub fn unreadable(path: &Path, error: &io::Error) -> Self {
        Self::new(
            path.display(),
            format!(
                "cannot be read ({}); check the path and its permissions",
                in_words(error)
            ),
        )
    }

    /// Complains about a file that cannot be written.
    pub fn unwritable(path: &Path, error: &io::Error) -> Self {
        use io::ErrorKind::{FileTooLarge, QuotaExceeded, StorageFull};
        let cure = match error.kind() {
            FileTooLarge | QuotaExceeded | StorageFull => "free some space",
            _ => "choose a folder that exists and is writable",
        };
        Self::new(
            path.display(),
            format!("cannot be written ({}); {cure}", in_words(error)),
        )
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_nearest_name_is_that_with_a_slip() {
        let keys = [
            "rows",
            "cols",
            "clk_hz",
            "load_clk_hz",
            "pde",
            "radar",
            "quantic4x4",
        ];
        for (given, meant) in [
            ("clkhz", Some("clk_hz")),
            ("Clk_Hz", Some("clk_hz")),
            ("row", Some("rows")),
            ("pd", Some("pde")),
            ("radr", Some("radar")),
            ("quantic", Some("quantic4x4")),
            ("colour", None),
            ("", None),
        ] {
            assert_eq!(nearest(given, keys), meant, "{given}");
        }
        assert_eq!(instead_of("x", []), "leave it out");
        assert_eq!(instead_of("x", ["a"]), "give a");
        assert_eq!(instead_of("x", ["a", "b", "c"]), "give a, b or c");
        assert_eq!(instead_of("clkhz", keys), "did you mean `clk_hz`?");
        let many: Vec<String> = (0..45).map(|n| format!("k{n}")).collect();
        let many = instead_of("zzz", many.iter().map(String::as_str));
        assert_eq!(many, "give one of the 45 names that there are");
    }

    #[test]
    fn a_complaint_is_one_short_line() {
        let said = |path: &str| InputError::new(path, "a\nb").to_string();
        assert_eq!(said("x\ny\u{1b}[2J"), "x\\ny\\u{1b}[2J: a\\nb");
        assert_eq!(
            said("out/.gdtof-0123-4567/frame.json"),
            "out/frame.json: a\\nb"
        );
        let long = said(&("d/".repeat(1000) + "end.toml"));
        assert!(long.chars().count() < 180 && long.contains("…"), "{long}");
        assert!(long.contains("/end.toml"), "{long}");
        let quoted = |text: &str| {
            let said = InputError::new("x", format!("{text:?} is no word; give a or b"));
            said.to_string()
        };
        let long = quoted(&"y".repeat(20_000));
        assert!(long.chars().count() < 200, "{long}");
        assert!(long.ends_with("is no word; give a or b"), "{long}");
        let long = quoted(&"y ".repeat(20_000));
        assert!(long.chars().count() < 510, "{long}");
        assert!(long.ends_with("is no word; give a or b"), "{long}");
    }

    #[test]
    fn errors_of_the_system_are_in_our_words() {
        let mut short: &[u8] = b"a";
        let error = io::Read::read_exact(&mut short, &mut [0; 2]).unwrap_err();
        assert_eq!(in_words(&error), "it ends early");
        let missing = io::Error::from_raw_os_error(2);
        let said = InputError::unreadable(Path::new("x"), &missing).to_string();
        assert!(
            said.starts_with("x: cannot be read (") && !said.contains("os error"),
            "{said}"
        );
    }
}
