//! A value of the wrong type, in the user's words: the readers of TOML and JSON name Rust's types.
//!
//! ```text
//!   invalid type: floating point `2.5`, expected u32 ─► 2.5 is impossible; give a whole number, 0 to 4294967295
//! ```

use std::fmt;

use femtogate::instead_of;

/// What stands there and what belongs there. As text it is a sentence with its cure.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Misfit {
    /// What stands there, as it is written, or what it is.
    pub(crate) found: String,
    /// What belongs there.
    pub(crate) wanted: String,
    /// What the type alone allows of it, to follow `wanted`; empty where that says nothing.
    limits: String,
}

impl fmt::Display for Misfit {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let Misfit {
            found,
            wanted,
            limits,
        } = self;
        write!(f, "{found} is impossible; give {wanted}{limits}")
    }
}

/// What a reader says of an entry, with a cure and without Rust's types.
pub fn in_plain_words(said: &str) -> String {
    let said = said.trim().replace('\n', " ");
    match Misfit::from_message(&said) {
        Some(misfit) => misfit.to_string(),
        None if is_no_word(&said) => "a word belongs here; correct this entry".into(),
        None if said.ends_with(" number overflowed") => {
            "this number is too large; give a smaller one".into()
        }
        None => match wrong_name(&said) {
            Some((what, cure)) => format!("{what}; {cure}"),
            None => format!("{said}; correct this entry"),
        },
    }
}

/// What a reader says of a name that is none or is missing, and a cure.
pub(crate) fn wrong_name(said: &str) -> Option<(String, String)> {
    let after = |beginning: &str| said.strip_prefix(beginning)?.split_once('`');
    // Names that are possible stand between backquotes, too.
    let known = |rest: &str| -> Vec<String> {
        rest.split('`')
            .skip(1)
            .step_by(2)
            .map(str::to_owned)
            .collect()
    };
    let instead = |given: &str, rest: &str| instead_of(given, known(rest).iter().map(|k| &**k));
    if let Some((name, rest)) = after("unknown field `") {
        return Some((format!("unknown key `{name}`"), instead(name, rest)));
    }
    if let Some((name, rest)) = after("unknown variant `") {
        return Some((format!("`{name}` is impossible"), instead(name, rest)));
    }
    let (name, _) = after("missing field `")?;
    Some((format!("the key `{name}` is missing"), "add it".into()))
}

/// The word that a reader does not know, if it says so.
pub(crate) fn unknown_word(said: &str) -> Option<&str> {
    let (word, _) = said
        .trim()
        .strip_prefix("unknown variant `")?
        .split_once('`')?;
    Some(word)
}

/// Whether a reader says that something else stands where one of some words belongs.
pub(crate) fn is_no_word(said: &str) -> bool {
    said == "wanted string or table" || said.starts_with("invalid type: unit variant")
}

impl Misfit {
    /// What a reader says, if it is about a value's type, size or length.
    pub fn from_message(said: &str) -> Option<Self> {
        let said = without_place(said);
        if is_no_word(said) {
            return None;
        }
        if let Some(rest) = said.strip_prefix("invalid length ") {
            let (length, expected) = rest.split_once(", expected ")?;
            let (wanted, limits) = wanted(expected);
            return Some(Misfit {
                found: format!("a list of {length}"),
                wanted,
                limits,
            });
        }
        let kinds = ["invalid type: ", "invalid value: "];
        let rest = kinds.iter().find_map(|kind| said.strip_prefix(kind))?;
        let (found, expected) = rest.rsplit_once(", expected ")?;
        let found = as_written(found);
        let (wanted, limits) = wanted(expected);
        // 2000.0 is a whole number to most people.
        let rounded = found.strip_suffix(".0").filter(|_| wanted == WHOLE);
        Some(match rounded {
            Some(rounded) => Misfit {
                wanted: format!("{rounded}, without a point"),
                limits: String::new(),
                found,
            },
            None => Misfit {
                found,
                wanted,
                limits,
            },
        })
    }

    /// What is wrong, for a sentence with a cure of its own.
    pub fn without_cure(&self) -> String {
        format!("{} stands where {} belongs", self.found, self.wanted)
    }

    /// Whether a number belongs there.
    pub(crate) fn wants_number(&self) -> bool {
        [WHOLE, NUMBER].contains(&&*self.wanted)
    }
}

const WHOLE: &str = "a whole number";
const NUMBER: &str = "a number";

/// Without the place that JSON's reader adds.
pub(crate) fn without_place(said: &str) -> &str {
    let is_number = |text: &str| text.bytes().all(|byte| byte.is_ascii_digit());
    let place = said.rsplit_once(" at line ").and_then(|(before, place)| {
        let (line, column) = place.split_once(" column ")?;
        (is_number(line) && is_number(column)).then_some(before)
    });
    place.unwrap_or(said)
}

/// A value as its writer sees it.
fn as_written(found: &str) -> String {
    let bare = match found {
        "sequence" => "a list",
        "map" => "a section",
        "null" | "unit value" | "Option value" => "nothing",
        _ => match (found.strip_prefix("string "), found.split_once('`')) {
            (Some(text), _) => text,
            (None, Some((_, value))) => value.rsplit_once('`').map_or(value, |(value, _)| value),
            (None, None) => found,
        },
    };
    match bare.parse::<f64>() {
        Ok(number) if bare.len() > 17 => format!("{number:e}"),
        _ => bare.to_owned(),
    }
}

/// What belongs where a type is expected, and what the type alone allows of it.
fn wanted(expected: &str) -> (String, String) {
    let plain = |what: &str| (what.to_owned(), String::new());
    let bits = |text: &str| text.parse::<u32>().ok();
    let list = ["a sequence", "an array", "a tuple", "tuple"];
    match expected {
        "usize" | "u64" | "u128" => (WHOLE.to_owned(), ", 0 or more".to_owned()),
        "isize" | "i64" | "i128" => plain(WHOLE),
        "f32" | "f64" => plain(NUMBER),
        "a boolean" => plain("true or false"),
        "a string" | "a borrowed string" | "a character" | "path string" => plain("a text"),
        "a map" => plain("a section with keys"),
        "string or map" => plain("a word"),
        _ if expected.starts_with("struct ") => plain("a section with keys"),
        _ if expected.starts_with("enum ") => plain("a word"),
        _ if list.iter().any(|of| expected.starts_with(of)) => {
            let is_digit = |c: char| c.is_ascii_digit();
            let mut words = expected.split(' ');
            let list_length = words.find(|word| word.chars().all(is_digit));
            let numbers = if expected.contains("f64") {
                " numbers"
            } else {
                ""
            };
            let length = list_length.map_or(String::new(), |of| format!(" of {of}{numbers}"));
            (format!("a list{length}"), String::new())
        }
        _ => match (
            expected.strip_prefix('u').and_then(bits),
            expected.strip_prefix('i').and_then(bits),
        ) {
            (Some(bits), _) => {
                let most = (1u64 << bits) - 1;
                (WHOLE.to_owned(), format!(", 0 to {most}"))
            }
            (_, Some(_)) => plain(WHOLE),
            _ => plain(expected),
        },
    }
}

#[cfg(test)]
mod tests {
    use std::collections::BTreeMap;
    use std::path::PathBuf;

    use proptest::prelude::*;
    use serde::de::DeserializeOwned;

    use super::*;

    fn toml<T: DeserializeOwned>(text: &str) -> String {
        let read = toml::from_str::<BTreeMap<String, T>>(&format!("x = {text}"));
        in_plain_words(read.err().expect(text).message())
    }

    fn json<T: DeserializeOwned>(text: &str) -> String {
        let read = serde_json::from_str::<Vec<T>>(&format!("[\n{text}]"));
        in_plain_words(&read.err().expect(text).to_string())
    }

    #[derive(Debug, serde::Deserialize)]
    struct Section {
        #[allow(dead_code)]
        key: u8,
    }

    #[derive(Debug, serde::Deserialize)]
    #[serde(rename_all = "lowercase")]
    enum Word {
        One,
    }

    #[test]
    fn no_type_of_rust_is_named() {
        let whole = "give a whole number, 0 to 4294967295";
        for (said, says) in [
            (toml::<u32>("2.5"), format!("2.5 is impossible; {whole}")),
            (toml::<u32>("-1"), format!("-1 is impossible; {whole}")),
            (toml::<u32>("true"), format!("true is impossible; {whole}")),
            (
                toml::<u32>("\"a, expected `b` at line 5\""),
                format!("\"a, expected `b` at line 5\" is impossible; {whole}"),
            ),
            (
                toml::<u32>("2000.0"),
                "2000.0 is impossible; give 2000, without a point".into(),
            ),
            (
                toml::<usize>("-3"),
                "-3 is impossible; give a whole number, 0 or more".into(),
            ),
            (
                toml::<i16>("1e9"),
                "1000000000.0 is impossible; give 1000000000, without a point".into(),
            ),
            (
                toml::<f64>("[1]"),
                "a list is impossible; give a number".into(),
            ),
            (
                toml::<bool>("1"),
                "1 is impossible; give true or false".into(),
            ),
            (
                toml::<String>("{ a = 1 }"),
                "a section is impossible; give a text".into(),
            ),
            (
                toml::<PathBuf>("0.5"),
                "0.5 is impossible; give a text".into(),
            ),
            (
                toml::<Section>("3"),
                "3 is impossible; give a section with keys".into(),
            ),
            (toml::<Vec<f64>>("3"), "3 is impossible; give a list".into()),
            (
                toml::<[f64; 2]>("[1]"),
                "a list of 1 is impossible; give a list of 2".into(),
            ),
            (
                toml::<Word>("3"),
                "a word belongs here; correct this entry".into(),
            ),
            (
                json::<u8>("null"),
                "nothing is impossible; give a whole number, 0 to 255".into(),
            ),
            (
                json::<u8>("300"),
                "300 is impossible; give a whole number, 0 to 255".into(),
            ),
            (
                toml::<Word>("\"two\""),
                "`two` is impossible; give one".into(),
            ),
        ] {
            assert_eq!(said, says);
        }
    }

    proptest! {
        /// Whatever is written where a whole number belongs, the sentence has it as it is written and no type.
        #[test]
        fn texts_stand_as_they_are(text in "[ -~&&[^\"\\\\]]{0,20}") {
            let said = toml::<u16>(&format!("\"{text}\""));
            prop_assert_eq!(said, format!("\"{text}\" is impossible; give a whole number, 0 to 65535"));
        }

        #[test]
        fn fractions_are_no_whole_numbers(whole in -1000i32..1000, tenths in 1u8..10) {
            let text = format!("{whole}.{tenths}");
            let said = toml::<u64>(&text);
            prop_assert_eq!(said, format!("{text} is impossible; give a whole number, 0 or more"));
        }

        #[test]
        fn anything_is_a_sentence(said in "\\PC{0,60}") {
            prop_assert!(in_plain_words(&said).contains("; "));
        }
    }
}
