//! Texts that users give: read whole, or line by line where they may be long.
//!
//! UTF-8, with or without a byte order mark. What is no text, or shows no end, is refused by the time a megabyte of it
//! has been read: a byte that no text has, a line of more than a mebibyte, and, of pipes, which need not
//! end, more than a mebibyte that must be read whole or that has nothing to use in it. Long tables have no limit: they
//! are read line by line and never held in memory.

use std::fmt;
use std::fs::File;
use std::io::{self, BufRead, BufReader, Read};
use std::path::{Path, PathBuf};

use serde::de::DeserializeOwned;
use toml::de::DeTable;

use super::guarded::open_input;
use super::misfit::{Misfit, in_plain_words, without_place, wrong_name};
use super::no_toml::{no_settings, other_kind};
use femtogate::InputError;

/// Longest line of a table, and most that is read of an input that need not end before it has shown its use, bytes.
/// Lines of our tables have some fifty bytes; a scene of 1 MiB has eight thousand objects.
const MEBIBYTE: usize = 1 << 20;

/// What a byte order mark is in UTF-8.
const MARK: &[u8] = "\u{feff}".as_bytes();

/// Reads over a byte order mark at the beginning of a file.
///
/// # Errors
/// When the reader fails.
pub fn skip_mark(reader: &mut impl BufRead) -> io::Result<()> {
    if reader.fill_buf()?.starts_with(MARK) {
        reader.consume(MARK.len());
    }
    Ok(())
}

/// `bytes` without a byte order mark at their beginning.
fn without_mark(bytes: &[u8]) -> &[u8] {
    bytes.strip_prefix(MARK).unwrap_or(bytes)
}

/// An opened file, and whether its end is known.
fn open(path: &Path) -> Result<(File, bool), InputError> {
    let file = open_input(path)?;
    let about = file.metadata();
    let about = about.map_err(|e| InputError::unreadable(path, &e))?;
    Ok((file, about.is_file()))
}

/// What is wrong with `bytes` as text, apart from a character that they end within.
fn flaw(bytes: &[u8], are_first: bool) -> Option<&'static str> {
    if are_first && (bytes.starts_with(&[0xff, 0xfe]) || bytes.starts_with(&[0xfe, 0xff])) {
        return Some("is UTF-16; save it as UTF-8");
    }
    if bytes.contains(&0) {
        return Some("is binary, not text; give a text file");
    }
    match std::str::from_utf8(bytes) {
        Err(e) if e.error_len().is_some() => {
            Some("is not UTF-8 text; give a text file, saved as UTF-8")
        }
        _ => None,
    }
}

/// A file that settings in `folder` name. It keeps its place when they are printed elsewhere.
pub fn placed(folder: &Path, file: &Path) -> PathBuf {
    let joined = folder.join(file);
    std::path::absolute(&joined).unwrap_or(joined)
}

/// Reads a text file as a whole.
///
/// # Errors
/// When it cannot be read, is no UTF-8 text, or is a pipe with more than a mebibyte.
pub fn read_text(path: &Path) -> Result<String, InputError> {
    read_text_within(path, usize::MAX)
}

/// The same for a file with at most `most_bytes` bytes. Of a longer one not much more is read.
///
/// # Errors
/// When it has more, and as [`read_text`].
pub fn read_text_within(path: &Path, most_bytes: usize) -> Result<String, InputError> {
    let (mut file, has_end) = open(path)?;
    let mut bytes = Vec::new();
    let mut checked = 0;
    loop {
        let more = (&mut file).take(MEBIBYTE as u64).read_to_end(&mut bytes);
        let more = more.map_err(|e| InputError::unreadable(path, &e))?;
        if let Some(message) = flaw(&bytes[checked..], checked == 0) {
            return Err(InputError::new(path.display(), message));
        }
        if more == 0 {
            break;
        }
        if bytes.len() > most_bytes {
            return Err(too_long(path.display(), most_bytes));
        }
        if !has_end && bytes.len() >= MEBIBYTE {
            let message =
                "goes on after a mebibyte and may never end; write its contents to a file first";
            return Err(InputError::new(path.display(), message));
        }
        // A character that the bytes end within is looked at again.
        checked = bytes.len() - bytes.len().min(3);
        while checked < bytes.len() && bytes[checked] & 0xc0 == 0x80 {
            checked += 1;
        }
    }
    let start = bytes.len() - without_mark(&bytes).len();
    bytes.drain(..start);
    String::from_utf8(bytes).map_err(|_| {
        let message = "ends within a character; give a whole text file, saved as UTF-8";
        InputError::new(path.display(), message)
    })
}

/// A complaint about a text with more than `most_bytes`, a number of mebibytes.
pub fn too_long(source: impl fmt::Display, most_bytes: usize) -> InputError {
    let mebibytes = most_bytes / MEBIBYTE;
    let message = format!(
        "has more than {mebibytes} MiB, the most that is read of such a file; give a shorter one"
    );
    InputError::new(source, message)
}

/// A text line by line, as long as it likes, in the memory of one line.
pub struct Lines<R> {
    /// What complaints call the text.
    pub source: String,
    reader: R,
    has_end: bool,
    number: usize,
    bytes: Vec<u8>,
}

impl Lines<BufReader<File>> {
    /// The lines of a file.
    ///
    /// # Errors
    /// When it cannot be opened.
    pub fn open(path: &Path) -> Result<Self, InputError> {
        let (file, has_end) = open(path)?;
        let reader = BufReader::with_capacity(1 << 18, file);
        Ok(Lines {
            has_end,
            ..Lines::new(path.display(), reader)
        })
    }
}

impl<R: BufRead> Lines<R> {
    /// The lines of a text that ends; `source` names it in complaints.
    pub fn new(source: impl fmt::Display, reader: R) -> Self {
        Lines {
            source: source.to_string(),
            reader,
            has_end: true,
            number: 0,
            bytes: Vec::new(),
        }
    }

    /// The next line that is neither blank nor starts with `#`, without spaces around it, and its number from 1.
    ///
    /// # Errors
    /// When it cannot be read or is no UTF-8 text, and when an input that need not end has shown nothing but such lines
    /// for a mebibyte.
    pub fn next_used(&mut self) -> Result<Option<(usize, &str)>, InputError> {
        let mut passed_over = 0;
        loop {
            self.bytes.clear();
            let limited = (&mut self.reader).take(MEBIBYTE as u64 + 1);
            let read = { limited }.read_until(b'\n', &mut self.bytes);
            let read = read.map_err(|e| InputError::unreadable(Path::new(&self.source), &e))?;
            if read == 0 {
                return Ok(None);
            }
            self.number += 1;
            let is_first = self.number == 1;
            let start = if is_first {
                self.bytes.len() - without_mark(&self.bytes).len()
            } else {
                0
            };
            let complain = |message| Err(InputError::at_line(&self.source, self.number, message));
            if let Some(message) = flaw(&self.bytes, is_first) {
                return complain(message);
            }
            if read > MEBIBYTE {
                return complain("has a line of more than a mebibyte; give a text file with lines");
            }
            let is_used = |bytes: &[u8]| {
                let mut bytes = bytes.iter().skip_while(|b| b.is_ascii_whitespace());
                bytes.next().is_some_and(|&b| b != b'#')
            };
            if !is_used(&self.bytes[start..]) {
                passed_over += read;
                if !self.has_end && passed_over > MEBIBYTE {
                    return complain(
                        "has had nothing but blank lines and comments for a mebibyte and may never end; give a file",
                    );
                }
                continue;
            }
            break match std::str::from_utf8(&self.bytes[start..]) {
                Ok(line) => Ok(Some((self.number, line.trim()))),
                Err(_) => {
                    let message = "ends within a character; give a whole text file, saved as UTF-8";
                    Err(InputError::at_line(&self.source, self.number, message))
                }
            };
        }
    }
}

/// Most lines and commas of TOML, and most bytes of a file: 16 MiB of `[0,1],` take 4 s and 2 GB to parse, five times the entries.
const MOST_ENTRIES: usize = 1 << 20;
/// See [`MOST_ENTRIES`].
pub(crate) const MOST_TOML_BYTES: usize = 16 << 20;

/// Parses TOML text; `source` names it in complaints.
///
/// # Errors
/// Syntax errors, unknown keys and wrong types, with their line; a text that is too long.
pub fn parse_toml<T: DeserializeOwned>(
    source: impl fmt::Display,
    text: &str,
) -> Result<T, InputError> {
    if text.len() > MOST_TOML_BYTES {
        return Err(too_long(source, MOST_TOML_BYTES));
    }
    let entries = text.bytes().filter(|byte| matches!(byte, b',' | b'\n'));
    let entries = entries.count();
    if entries > MOST_ENTRIES {
        let message = format!(
            "has {entries} lines and commas, of which at most {MOST_ENTRIES} are read of settings; give fewer values"
        );
        return Err(InputError::new(source, message));
    }
    toml::from_str(text).map_err(|e| {
        if let Some(other) = other_kind(text) {
            return InputError::new(
                &source,
                format!("is {other}, not settings; give a TOML file"),
            );
        }
        let message = match DeTable::parse(text) {
            Ok(_) => in_plain_words(e.message()),
            Err(_) => no_settings(e.message()).to_owned(),
        };
        match e.span() {
            Some(span) => {
                let line = LineEnds::new(text).line_of(span.start);
                InputError::at_line(source, line, message)
            }
            None => InputError::new(source, message),
        }
    })
}

/// Parses JSON text; `source` names it in complaints, and `wanted` is what to give instead.
///
/// # Errors
/// Syntax errors, unknown keys and wrong types, with their line.
pub fn parse_json<T: DeserializeOwned>(
    source: impl fmt::Display,
    text: &str,
    wanted: &str,
) -> Result<T, InputError> {
    serde_json::from_str(text).map_err(|e| {
        if text.trim().is_empty() {
            return InputError::new(source, format!("is empty; give {wanted}"));
        }
        let said = e.to_string();
        let what = match Misfit::from_message(&said) {
            Some(misfit) => misfit.without_cure(),
            None if e.is_data() => match wrong_name(without_place(&said)) {
                Some((what, _)) => what,
                None => without_place(&said).to_owned(),
            },
            None if e.is_eof() => "the text ends early".to_owned(),
            None => "this is no JSON".to_owned(),
        };
        InputError::at_line(source, e.line(), format!("{what}; give {wanted}"))
    })
}

/// Where the lines of a text end.
#[derive(Debug)]
pub struct LineEnds(Vec<usize>);

impl LineEnds {
    pub(crate) fn new(text: &str) -> Self {
        LineEnds(text.match_indices('\n').map(|(at, _)| at).collect())
    }

    /// The one-based line of a byte.
    pub(crate) fn line_of(&self, offset: usize) -> usize {
        1 + self.0.partition_point(|&end| end < offset)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    #[derive(Debug, serde::Deserialize)]
    #[serde(deny_unknown_fields)]
    struct Sample {
        #[allow(dead_code)]
        rows: u32,
    }

    #[test]
    fn complaints_name_file_and_line() {
        let e = parse_toml::<Sample>("a.toml", "rows = 3\n\ncolour = 1\n").unwrap_err();
        assert_eq!(e.line, Some(3));
        assert!(
            e.to_string().starts_with("a.toml:3: unknown key `colour`"),
            "{e}"
        );
    }

    fn read(bytes: &[u8]) -> Result<String, InputError> {
        let dir = tempfile::tempdir().unwrap();
        let path = dir.path().join("x");
        std::fs::write(&path, bytes).unwrap();
        read_text(&path)
    }

    proptest! {
        #[test]
        fn a_byte_is_in_the_line_after_as_many_ends(text in "[a\n€]{0,40}", offset in 0usize..100) {
            let ends = text.bytes().take(offset).filter(|&byte| byte == b'\n').count();
            prop_assert_eq!(LineEnds::new(&text).line_of(offset), 1 + ends);
        }
    }

    #[test]
    fn a_text_that_is_too_long_is_refused_before_it_is_read_whole() {
        let dir = tempfile::tempdir().unwrap();
        let path = dir.path().join("x");
        std::fs::write(&path, vec![b'x'; 2 * MEBIBYTE + 1]).unwrap();
        let refused = read_text_within(&path, 2 * MEBIBYTE).unwrap_err();
        assert!(
            refused.message.starts_with("has more than 2 MiB"),
            "{refused}"
        );
        assert!(read_text_within(&path, 3 * MEBIBYTE).is_ok());
    }

    fn used_lines(bytes: &[u8]) -> Result<Vec<(usize, String)>, InputError> {
        let mut lines = Lines::new("x", bytes);
        let mut found = Vec::new();
        while let Some((number, line)) = lines.next_used()? {
            found.push((number, line.to_owned()));
        }
        Ok(found)
    }

    #[test]
    fn a_byte_order_mark_is_no_part_of_the_text() {
        assert_eq!(read("\u{feff}rows = 3".as_bytes()).unwrap(), "rows = 3");
        let lines = used_lines("\u{feff}# x\r\n\r\n a,b \r\n".as_bytes()).unwrap();
        assert_eq!(lines, [(3, "a,b".to_owned())]);
        let lines = used_lines("\u{feff}a\n".as_bytes()).unwrap();
        assert_eq!(lines, [(1, "a".to_owned())]);
    }

    #[test]
    fn what_is_no_text_is_named() {
        let utf_16 = [0xff, 0xfe, b'a', 0];
        let long = vec![b'x'; MEBIBYTE + 1];
        for (bytes, says) in [
            (&utf_16[..], "UTF-16"),
            (b"a\0b", "binary"),
            (b"a\xffb", "UTF-8"),
            (b"a\xc3", "ends within a character"),
        ] {
            assert!(read(bytes).unwrap_err().message.contains(says));
            assert!(used_lines(bytes).unwrap_err().message.contains(says));
        }
        assert!(used_lines(&long).unwrap_err().message.contains("mebibyte"));
        assert!(read(&long).is_ok());
    }

    proptest! {
        /// Characters of any length across the borders of what is read at once.
        #[test]
        fn long_texts_come_whole(shift in 0usize..8, character in "[a-zä€𝄞]") {
            let text = "x".repeat(MEBIBYTE - shift) + &character.repeat(MEBIBYTE / 2);
            prop_assert_eq!(read(text.as_bytes()).unwrap(), text);
        }
    }
}
