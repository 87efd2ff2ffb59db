//! What a Liberty file's bytes say as text, before its syntax is read.
//!
//! Files come in UTF-8, with or without a byte order mark, and older ones in Latin-1, mostly in comments. A string that goes on
//! in the next line, behind a backslash, is one string.

use std::borrow::Cow;

/// The text of a file's bytes: UTF-8, else Latin-1; nothing where zero bytes show that it is no text.
pub fn liberty_text(bytes: Vec<u8>) -> Option<String> {
    if bytes.contains(&0) {
        return None;
    }
    let latin_1 = |bytes: &[u8]| bytes.iter().map(|&byte| char::from(byte)).collect();
    Some(String::from_utf8(bytes).unwrap_or_else(|error| latin_1(error.as_bytes())))
}

/// The text without byte order mark, and with the strings joined that a backslash at the end of a line continues. Lines keep their numbers from the end of
/// such a string on.
pub(super) fn joined(text: &str) -> Cow<'_, str> {
    let text = text.strip_prefix('\u{feff}').unwrap_or(text);
    let bytes = text.as_bytes();
    let (mut joined, mut kept, mut at) = (String::new(), 0, 0);
    while at < bytes.len() {
        let is_behind_word = at > 0 && !b" \t\r\n(){};,\"".contains(&bytes[at - 1]);
        match (bytes[at], bytes.get(at + 1)) {
            (b'/', Some(b'*')) => {
                at += text[at + 2..].find("*/").map_or(bytes.len(), |end| end + 4);
                continue;
            }
            (b'/', Some(b'/')) if !is_behind_word => {
                at += text[at..].find('\n').unwrap_or(bytes.len());
                continue;
            }
            (b'"', _) => {}
            _ => {
                at += 1;
                continue;
            }
        }
        at += 1;
        let mut lines = 0;
        while at < bytes.len() && bytes[at] != b'"' {
            let continued = (bytes[at] == b'\\').then(|| end_of_line(&bytes[at + 1..]));
            match continued {
                Some(Some(end)) => {
                    joined.push_str(&text[kept..at]);
                    at += 1 + end;
                    kept = at;
                    lines += 1;
                }
                Some(None) => at += 2,
                None => at += 1,
            }
        }
        at += 1;
        if lines > 0 && at <= bytes.len() {
            joined.push_str(&text[kept..at]);
            joined.extend(std::iter::repeat_n('\n', lines));
            kept = at;
        }
    }
    if kept == 0 {
        return Cow::Borrowed(text);
    }
    joined.push_str(&text[kept..]);
    Cow::Owned(joined)
}

/// Where the next line begins, if nothing but blanks is before it.
fn end_of_line(bytes: &[u8]) -> Option<usize> {
    let blanks = bytes.iter().take_while(|byte| b" \t\r".contains(byte));
    let end = blanks.count();
    (bytes.get(end) == Some(&b'\n')).then_some(end + 1)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn continued_strings_are_joined_and_later_lines_keep_their_numbers() {
        let text = "a : \"b\\\n  c \\ \r\n d\";\n// \"\\\ne : \"f\";\n/* \"\\\n */";
        let wanted = "a : \"b  c  d\"\n\n;\n// \"\\\ne : \"f\";\n/* \"\\\n */";
        assert_eq!(joined(text), wanted);
        assert_eq!(text.lines().count(), wanted.lines().count());
        // Escapes stay, and a backslash between strings is the reader's.
        for same in [
            r#"a : "\"b\\";"#,
            "v (\"1\", \\\n \"2\");",
            "http://\"x\"",
            "\"",
            "\"\\",
            "/*",
            "//",
        ] {
            assert!(
                matches!(joined(same), Cow::Borrowed(text) if text == same),
                "{same}"
            );
        }
        assert_eq!(joined("\u{feff}library"), "library");
        // What has no end stays without one.
        assert_eq!(joined("\"a\\\nb"), "\"ab");
    }

    #[test]
    fn latin_1_is_text_and_zero_bytes_are_none() {
        let text = |bytes: &[u8]| liberty_text(bytes.to_vec());
        assert_eq!(text(b"/* 25 \xb0C */").as_deref(), Some("/* 25 °C */"));
        assert_eq!(
            text("/* 25 °C */".as_bytes()).as_deref(),
            Some("/* 25 °C */")
        );
        assert_eq!(text(b"l\0i\0b\0"), None);
    }
}
