//! A journal: lines that are only ever appended, each with a checksum, so that a run that is killed loses at most what it had
//! not appended yet.
//!
//! ```text
//!   3f09c2aa text of a line␊          8 hexadecimal digits of the text's SHA-256, a blank, the text
//! ```
//!
//! One process appends to a journal at a time (a lock that the kernel drops however the process ends); anybody may read meanwhile. A line
//! goes out in one write. What a kill or a full disk leaves of one at the end of the file is cut off by the next process that appends;
//! readers pass over it, and over any line whose checksum is wrong.

use std::fs::File;
use std::io::{self, BufRead, BufReader, Read, Seek, SeekFrom, Write};
use std::path::{Path, PathBuf};

use sha2::{Digest, Sha256};

use super::open::open_file;
use super::temporary::lock;
use femtogate::InputError;

/// Bytes of a line before its text.
const HEAD: usize = 9;

/// The line that says `text`, with its end.
///
/// `text` has no line feed.
pub fn journal_line(text: &str) -> String {
    debug_assert!(!text.contains('\n'));
    format!("{}{text}\n", head(text))
}

fn head(text: &str) -> String {
    let hash = Sha256::digest(text);
    let check = u32::from_be_bytes(hash[..4].try_into().expect("4 of 32 bytes"));
    format!("{check:08x} ")
}

/// The text of a line without its end, if its checksum is right.
fn text_of(line: &[u8]) -> Option<&str> {
    let line = std::str::from_utf8(line).ok()?;
    let (said, text) = line.split_at_checked(HEAD)?;
    (said == head(text)).then_some(text)
}

/// Whether a file is a journal: one with a line that is right in its first mebibyte, an empty one, or one that was killed within its
/// first line.
pub fn is_journal(file: impl BufRead) -> bool {
    let mut file = file.take(1 << 20);
    let mut line = Vec::new();
    let mut is_first = true;
    while file.read_until(b'\n', &mut line).is_ok_and(|read| read > 0) {
        match line.strip_suffix(b"\n") {
            Some(whole) if text_of(whole).is_some() => return true,
            None if is_first => return begins_like_a_line(&line),
            _ => {}
        }
        line.clear();
        is_first = false;
    }
    is_first
}

fn begins_like_a_line(bytes: &[u8]) -> bool {
    let (digits, rest) = bytes.split_at(bytes.len().min(HEAD - 1));
    let is_digit = |b: &u8| matches!(b, b'0'..=b'9' | b'a'..=b'f');
    digits.iter().all(is_digit) && rest.first().is_none_or(|&b| b == b' ')
}

/// A journal that this process appends to.
#[derive(Debug)]
pub struct Journal {
    path: PathBuf,
    file: File,
}

impl Journal {
    /// Opens a journal, created if missing, and cuts off an unfinished line; `None` where another process appends to
    /// it.
    ///
    /// # Errors
    /// When it cannot be written.
    pub fn open(path: &Path) -> Result<Option<Self>, InputError> {
        let unwritable = |e: io::Error| InputError::unwritable(path, &e);
        let mut options = File::options();
        options.read(true).append(true).create(true);
        follow_no_link(&mut options);
        let mut file = options.open(path).map_err(unwritable)?;
        if lock::is_held_elsewhere(&file) {
            return Ok(None);
        }
        let whole = end_of_last_line(&mut file).map_err(unwritable)?;
        file.set_len(whole).map_err(unwritable)?;
        let path = path.to_owned();
        Ok(Some(Journal { path, file }))
    }

    /// Appends lines of [`journal_line`].
    ///
    /// # Errors
    /// When the disk is full, or the journal was removed.
    pub fn append(&mut self, lines: &str) -> Result<(), InputError> {
        self.check_place()?;
        let written = self.file.write_all(lines.as_bytes());
        written.map_err(|e| InputError::unwritable(&self.path, &e))
    }

    /// Complains if it no longer stands under its name, so that nobody will find its lines.
    ///
    /// # Errors
    /// When it was removed or replaced.
    pub fn check_place(&self) -> Result<(), InputError> {
        if lock::is_same(&self.path, &self.file) {
            return Ok(());
        }
        let message = "was removed or replaced while lines were appended to it, which are lost; run the same command once more";
        Err(InputError::new(self.path.display(), message))
    }
}

/// Through a link, lines would go into a file elsewhere, and what that ends with would be cut off.
#[cfg(unix)]
fn follow_no_link(options: &mut std::fs::OpenOptions) {
    use std::os::unix::fs::OpenOptionsExt;
    options.custom_flags(rustix::fs::OFlags::NOFOLLOW.bits() as i32);
}

#[cfg(not(unix))]
fn follow_no_link(_: &mut std::fs::OpenOptions) {}

/// Where what is no whole line begins.
fn end_of_last_line(file: &mut File) -> io::Result<u64> {
    let mut end = file.metadata()?.len();
    let mut chunk = vec![0; 1 << 16];
    while end > 0 {
        let length = chunk.len().min(usize::try_from(end).unwrap_or(usize::MAX));
        let begin = end - length as u64;
        file.seek(SeekFrom::Start(begin))?;
        file.read_exact(&mut chunk[..length])?;
        if let Some(at) = chunk[..length].iter().rposition(|&b| b == b'\n') {
            return Ok(begin + at as u64 + 1);
        }
        end = begin;
    }
    Ok(0)
}

/// A journal that is read.
#[derive(Debug)]
pub struct JournalReader {
    path: PathBuf,
    reader: BufReader<File>,
    at: u64,
    line: Vec<u8>,
}

impl JournalReader {
    /// Opens a journal.
    ///
    /// # Errors
    /// When it cannot be read.
    pub fn open(path: &Path) -> Result<Self, InputError> {
        let file = open_file(path)?;
        Ok(JournalReader {
            path: path.to_owned(),
            reader: BufReader::with_capacity(1 << 16, file),
            at: 0,
            line: Vec::new(),
        })
    }

    /// Tells `found` of every whole line from here on whose checksum is right, with where it begins. Returns how many had a wrong
    /// one; what the file ends with, if no whole line, is none of them.
    ///
    /// # Errors
    /// When it cannot be read.
    pub fn scan(&mut self, mut found: impl FnMut(u64, &str)) -> Result<usize, InputError> {
        let mut wrong = 0;
        loop {
            let begin = self.at;
            if !self.read_line()? {
                return Ok(wrong);
            }
            match text_of(&self.line) {
                Some(text) => found(begin, text),
                None => wrong += 1,
            }
        }
    }

    /// The text of the line that begins there; `None` if it is not right, or no longer there.
    ///
    /// # Errors
    /// When it cannot be read.
    pub fn read_line_at(&mut self, begin: u64) -> Result<Option<&str>, InputError> {
        let by = begin as i64 - self.at as i64;
        let moved = self.reader.seek_relative(by);
        moved.map_err(|e| InputError::unreadable(&self.path, &e))?;
        self.at = begin;
        Ok(if self.read_line()? {
            text_of(&self.line)
        } else {
            None
        })
    }

    /// Reads a line without its end; `false` where there is no whole one any more.
    fn read_line(&mut self) -> Result<bool, InputError> {
        self.line.clear();
        let read = self.reader.read_until(b'\n', &mut self.line);
        self.at += read.map_err(|e| InputError::unreadable(&self.path, &e))? as u64;
        Ok(self.line.pop_if(|&mut b| b == b'\n').is_some())
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    fn texts(path: &Path) -> (Vec<String>, usize) {
        let mut found = Vec::new();
        let mut reader = JournalReader::open(path).unwrap();
        let wrong = reader.scan(|_, text| found.push(text.to_owned())).unwrap();
        (found, wrong)
    }

    proptest! {
        /// Wherever a run is killed, and whatever byte of a line is spoilt, the other lines stand, and the next run appends to them.
        #[test]
        fn a_journal_is_good_for_its_whole_lines(
            lines in prop::collection::vec("[^\n]{0,40}", 1..6),
            cut in 0usize..400,
            spoilt in prop::option::of((0usize..400, 1u8..)),
        ) {
            let dir = tempfile::tempdir().unwrap();
            let path = dir.path().join("x");
            let mut bytes: Vec<u8> = lines.iter().flat_map(|l| journal_line(l).into_bytes()).collect();
            bytes.truncate(cut.max(1));
            let whole = bytes.iter().filter(|&&b| b == b'\n').count();
            let mut good = vec![true; whole];
            if let Some((at, by)) = spoilt.map(|(at, by)| (at % bytes.len(), by)) {
                let line = bytes[..at].iter().filter(|&&b| b == b'\n').count();
                // A line feed more or less would make other lines of it.
                if bytes[at] != b'\n' && bytes[at] ^ by != b'\n' {
                    bytes[at] ^= by;
                    if line < whole {
                        good[line] = false;
                    }
                }
            }
            std::fs::write(&path, &bytes).unwrap();
            let mut expected: Vec<String> =
                lines.iter().zip(&good).filter(|(_, good)| **good).map(|(l, _)| l.clone()).collect();
            prop_assert_eq!(texts(&path), (expected.clone(), good.iter().filter(|g| !**g).count()));

            let mut journal = Journal::open(&path).unwrap().unwrap();
            journal.append(&journal_line("next")).unwrap();
            expected.push("next".into());
            prop_assert_eq!(texts(&path).0, expected);
        }
    }

    /// Nothing but what was written is a line: no sign and no capital digit, though they give the same number.
    #[test]
    fn a_checksum_is_its_digits() {
        // The checksum of "5" begins with ef, that of "39" with 0.
        assert!(journal_line("5").starts_with("ef") && journal_line("39").starts_with('0'));
        let spoilt = [
            journal_line("5").replacen("ef", "Ef", 1),
            journal_line("39").replacen('0', "+", 1),
        ];
        for line in spoilt {
            assert_eq!(text_of(line.trim_end().as_bytes()), None, "{line}");
        }
    }

    #[test]
    fn lines_are_found_again_where_they_were() {
        let dir = tempfile::tempdir().unwrap();
        let path = dir.path().join("x");
        let mut journal = Journal::open(&path).unwrap().unwrap();
        let lines: Vec<String> = (0..5000).map(|i| format!("line {}", i * i)).collect();
        for line in &lines {
            journal.append(&journal_line(line)).unwrap();
        }
        let mut places = Vec::new();
        let mut reader = JournalReader::open(&path).unwrap();
        reader.scan(|begin, _| places.push(begin)).unwrap();
        for (place, line) in places
            .iter()
            .zip(&lines)
            .rev()
            .step_by(7)
            .chain(places.iter().zip(&lines))
        {
            assert_eq!(reader.read_line_at(*place).unwrap(), Some(line.as_str()));
        }
        assert_eq!(reader.read_line_at(3).unwrap(), None);
    }

    #[test]
    fn a_journal_is_known_by_its_lines() {
        let line = journal_line("text");
        for ours in [
            "",
            "0123",
            "0123abcd",
            "0123abcd 00ff",
            &line,
            &format!("spoilt\n{line}"),
        ] {
            assert!(is_journal(ours.as_bytes()), "{ours:?}");
        }
        for foreign in [
            "\n",
            "my notes",
            "my notes\n",
            "0123abcd 00ff\n",
            "0123abcde",
            "\u{1}\n",
        ] {
            assert!(!is_journal(foreign.as_bytes()), "{foreign:?}");
        }
    }

    #[cfg(unix)]
    #[test]
    fn links_are_not_followed() {
        let dir = tempfile::tempdir().unwrap();
        let [target, link] = ["target", "x"].map(|name| dir.path().join(name));
        std::fs::write(&target, "no line").unwrap();
        std::os::unix::fs::symlink(&target, &link).unwrap();
        assert!(Journal::open(&link).is_err());
        assert_eq!(std::fs::read_to_string(&target).unwrap(), "no line");
    }

    #[cfg(unix)]
    #[test]
    fn nothing_is_appended_to_a_journal_that_was_removed() {
        let dir = tempfile::tempdir().unwrap();
        let path = dir.path().join("x");
        let mut journal = Journal::open(&path).unwrap().unwrap();
        journal.append(&journal_line("first")).unwrap();
        std::fs::remove_file(&path).unwrap();
        let refused = journal.append(&journal_line("second")).unwrap_err();
        assert!(refused.to_string().contains("was removed"), "{refused}");
        std::fs::write(&path, "another").unwrap();
        assert!(journal.check_place().is_err());
    }

    #[cfg(unix)]
    #[test]
    fn one_process_appends_at_a_time() {
        let dir = tempfile::tempdir().unwrap();
        let path = dir.path().join("x");
        let first = Journal::open(&path).unwrap().unwrap();
        assert!(Journal::open(&path).unwrap().is_none());
        drop(first);
        assert!(Journal::open(&path).unwrap().is_some());
    }
}
