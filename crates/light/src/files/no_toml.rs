//! What is wrong with a text that is no TOML, in plain words: its reader speaks of its grammar.

/// What a text is that is plainly no TOML, by its beginning.
pub(super) fn other_kind(text: &str) -> Option<&'static str> {
    let text = text.trim_start();
    let kinds = [
        ("{", "JSON"),
        ("[[[", "JSON"),
        ("[\n", "JSON"),
        ("[{", "JSON"),
        ("library (", "a cell library (Liberty)"),
        ("library(", "a cell library (Liberty)"),
        ("/*", "a cell library (Liberty)"),
        ("(DELAYFILE", "delays (SDF)"),
        ("$", "a waveform (VCD)"),
        ("<", "a page (HTML)"),
        ("module ", "Verilog"),
    ];
    let begins = kinds
        .iter()
        .find(|(beginning, _)| text.starts_with(beginning));
    begins.map(|(_, kind)| *kind)
}

/// What TOML's reader says of a text that is no TOML, in plain words and with a cure.
pub(super) fn no_settings(said: &str) -> &'static str {
    const SETTING: &str = "this cannot be read as a setting; write key = value, texts in quotes, and [section] on a line of its own";
    const NUMBER: &str = "this value is written in no known way; write numbers like 1000, 0.5 or 2e-3, and true or false";
    const COMMA: &str = "a comma is missing; put one between values";
    const QUOTE: &str = "a quote is not closed; close it";
    const ESCAPE: &str =
        "a \\ in this text stands for nothing; write \\\\, or the text between single quotes";
    const NESTED: &str = "brackets are nested too deep; write fewer";
    const FAULTS: [(&str, &str); 22] = [
        (
            "duplicate key",
            "this key or section is written a second time; leave one of them out",
        ),
        (
            "cannot extend",
            "this key goes on where there is no section; write each section once",
        ),
        ("key with no value", "this is no setting; write key = value"),
        ("extra `=`", "there is an = too many; write key = value"),
        (
            "string values must be quoted",
            "this value is no number; put texts and quantities in quotes, such as \"300 MHz\"",
        ),
        (
            "unexpected key or value",
            "something follows the value; write one setting a line, and decimals with a point",
        ),
        ("cannot recurse", NESTED),
        ("recursion limit", NESTED),
        ("unclosed", "a bracket is not closed; close it"),
        ("missing comma", COMMA),
        ("extra assignment", COMMA),
        ("extra comma", "there is a comma too many; remove it"),
        ("invalid basic string", QUOTE),
        // Of a key in braces, too.
        (
            "invalid literal string",
            "a quote is not closed or a value is missing; write key = value, and close quotes",
        ),
        ("invalid multi-line", QUOTE),
        ("missing escaped value", ESCAPE),
        ("too few unicode", ESCAPE),
        ("invalid key-value pair", SETTING),
        ("invalid ", NUMBER),
        ("unexpected leading zero", NUMBER),
        ("redundant", NUMBER),
        ("`_`", NUMBER),
    ];
    let known = FAULTS
        .iter()
        .find(|(beginning, _)| said.starts_with(beginning));
    known.map_or(SETTING, |(_, words)| words)
}

#[cfg(test)]
mod tests {
    use crate::files::parse_toml;

    /// What TOML's reader says is not shown.
    #[test]
    fn faults_of_syntax_are_in_plain_words() {
        for (text, says) in [
            ("x = \"abc", "a quote is not closed"),
            ("x = 'abc", "a quote is not closed"),
            ("x = {a}", "a value is missing"),
            ("}", "write key = value"),
            ("]", "write key = value"),
            ("a. = 1", "write key = value"),
            ("x = 5.", "in no known way"),
            ("x = 1 2", "put texts and quantities in quotes"),
            ("x = \"a\" \"b\"", "one setting a line"),
            ("x = \"\"\"abc", "a quote is not closed"),
            ("x = [1,", "a bracket is not closed"),
            ("[a", "a bracket is not closed"),
            ("[[a]", "a bracket is not closed"),
            ("x = [1 2]", "put texts and quantities in quotes"),
            ("x = ", "put texts and quantities in quotes"),
            ("x = 10 MHz", "put texts and quantities in quotes"),
            ("x = {a = 1,, b = 2}", "a comma too many"),
            ("x = {a = 1 b = 2}", "a comma is missing"),
            ("x = 01", "in no known way"),
            ("x = +-1", "in no known way"),
            ("x = 1__0", "in no known way"),
            ("x = True", "in no known way"),
            ("x = nan1", "in no known way"),
            ("x = 1e400", "too large"),
            ("x = 2020-13-01", "in no known way"),
            ("x = 1,5", "decimals with a point"),
            ("x == 1", "an = too many"),
            ("x.y = 1\nx = 2", "a second time"),
            ("x = 1\nx = 2", "a second time"),
            ("[a]\n[a]", "a second time"),
            ("x = 1\nx.y = 2", "where there is no section"),
            ("x", "write key = value"),
            ("x: 1", "write key = value"),
            ("= 3", "write key = value"),
            ("x = \"C:\\users\"", "write \\\\"),
            ("x = \"\\q\"", "write \\\\"),
            (&format!("x = {}", "[".repeat(2000)), "nested too deep"),
            ("{\"a\": 1}", "is JSON, not settings"),
            ("[[[1]]]", "is JSON, not settings"),
            (
                "library (a) {}",
                "is a cell library (Liberty), not settings",
            ),
            ("$date now $end", "is a waveform (VCD), not settings"),
        ] {
            let said = parse_toml::<toml::Table>("a.toml", text).unwrap_err();
            let said = said.to_string();
            assert!(said.contains(says), "{text}: {said}");
            for foreign in ["expected", "invalid", "unexpected", "overflow"] {
                assert!(!said.contains(foreign), "{text}: {said}");
            }
        }
    }
}
