//! Files in and out: user's input read with line numbers, output written whole or not at all.
//!
//! Every complaint about a file is one sentence, `FILE:LINE: what is wrong; what to do`, so that
//! an editor can jump to it. Output goes to a temporary file in the target's folder and is renamed
//! over the target only when it is complete.

use std::fmt;
use std::io::{self, BufWriter, Read, Seek, SeekFrom, Write};
use std::path::{Path, PathBuf};

use serde::de::DeserializeOwned;

/// What is wrong with something the user gave us, and the cure.
#[derive(Debug, Clone, PartialEq, Eq, thiserror::Error)]
pub struct InputError {
    /// File (or command-line option) at fault.
    pub source_name: String,
    /// One-based line, where there is one.
    pub line: Option<usize>,
    /// What is wrong and what to do about it.
    pub message: String,
}

impl fmt::Display for InputError {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "{}", self.source_name)?;
        if let Some(line) = self.line {
            write!(f, ":{line}")?;
        }
        write!(f, ": {}", self.message)
    }
}

impl InputError {
    /// A complaint about `source` as a whole.
    pub fn new(source: impl fmt::Display, message: impl Into<String>) -> Self {
        InputError {
            source_name: source.to_string(),
            line: None,
            message: message.into(),
        }
    }

    /// A complaint about one line (counted from 1) of `source`.
    pub fn at(source: impl fmt::Display, line: usize, message: impl Into<String>) -> Self {
        InputError {
            line: Some(line),
            ..Self::new(source, message)
        }
    }

    fn unreadable(path: &Path, error: &io::Error) -> Self {
        Self::new(
            path.display(),
            format!("cannot be read ({error}); check the path and its permissions"),
        )
    }

    fn unwritable(path: &Path, error: &io::Error) -> Self {
        Self::new(
            path.display(),
            format!("cannot be written ({error}); choose a folder that exists and is writable"),
        )
    }
}

/// Reads a text file.
///
/// # Errors
/// When it cannot be read or is not UTF-8.
pub fn read_text(path: &Path) -> Result<String, InputError> {
    std::fs::read_to_string(path).map_err(|e| InputError::unreadable(path, &e))
}

/// Parses TOML text; `source` names it in complaints.
///
/// # Errors
/// Syntax errors, unknown keys and wrong types, with their line.
pub fn parse_toml<T: DeserializeOwned>(
    source: impl fmt::Display,
    text: &str,
) -> Result<T, InputError> {
    toml::from_str(text).map_err(|e| {
        let message = format!("{}; correct this entry", e.message().replace('\n', " "));
        match e.span() {
            Some(span) => InputError::at(source, line_of(text, span.start), message),
            None => InputError::new(source, message),
        }
    })
}

/// The one-based line of byte `offset` in `text`.
pub fn line_of(text: &str, offset: usize) -> usize {
    let end = offset.min(text.len());
    1 + text.as_bytes()[..end]
        .iter()
        .filter(|&&b| b == b'\n')
        .count()
}

/// A buffered output file that appears under its name only when [`OutputFile::commit`] succeeds.
pub struct OutputFile {
    path: PathBuf,
    writer: BufWriter<tempfile::NamedTempFile>,
}

impl OutputFile {
    /// Starts a file beside `path`.
    ///
    /// # Errors
    /// When the folder does not exist or is not writable, or `path` is a folder.
    pub fn create(path: &Path) -> Result<Self, InputError> {
        let unwritable = |e: io::Error| InputError::unwritable(path, &e);
        if path.is_dir() {
            return Err(unwritable(io::Error::other("it is a folder")));
        }
        let folder = match path.parent() {
            Some(p) if !p.as_os_str().is_empty() => p,
            _ => Path::new("."),
        };
        let mut builder = tempfile::Builder::new();
        builder.prefix(".gdtof-");
        #[cfg(unix)]
        {
            use std::os::unix::fs::PermissionsExt;
            builder.permissions(std::fs::Permissions::from_mode(0o644));
        }
        let file = builder.tempfile_in(folder).map_err(unwritable)?;
        Ok(OutputFile {
            path: path.to_owned(),
            writer: BufWriter::with_capacity(1 << 20, file),
        })
    }

    /// Flushes and moves the file to its final name.
    ///
    /// # Errors
    /// When the disk is full or the target cannot be replaced; the target is then untouched.
    pub fn commit(self) -> Result<(), InputError> {
        let path = self.path;
        let unwritable = |e: io::Error| InputError::unwritable(&path, &e);
        let file = self
            .writer
            .into_inner()
            .map_err(|e| unwritable(e.into_error()))?;
        file.persist(&path).map_err(|e| unwritable(e.error))?;
        Ok(())
    }

    /// Writes a whole file through `fill`.
    ///
    /// # Errors
    /// As [`OutputFile::create`] and [`OutputFile::commit`], or an I/O error of `fill`.
    pub fn write_with(
        path: &Path,
        fill: impl FnOnce(&mut dyn Write) -> io::Result<()>,
    ) -> Result<(), InputError> {
        let mut file = Self::create(path)?;
        fill(&mut file.writer).map_err(|e| InputError::unwritable(path, &e))?;
        file.commit()
    }
}

impl Write for OutputFile {
    fn write(&mut self, buffer: &[u8]) -> io::Result<usize> {
        self.writer.write(buffer)
    }

    fn flush(&mut self) -> io::Result<()> {
        self.writer.flush()
    }
}

/// Formats that tell at the beginning what is known at the end go back for it.
impl Seek for OutputFile {
    fn seek(&mut self, to: SeekFrom) -> io::Result<u64> {
        self.writer.seek(to)
    }
}

impl Read for OutputFile {
    fn read(&mut self, buffer: &mut [u8]) -> io::Result<usize> {
        self.writer.flush()?;
        self.writer.get_mut().read(buffer)
    }
}

/// Makes sure a folder for output exists.
///
/// # Errors
/// When it cannot be made.
pub fn create_folder(path: &Path) -> Result<(), InputError> {
    std::fs::create_dir_all(path).map_err(|e| InputError::unwritable(path, &e))
}

#[cfg(test)]
mod tests {
    use super::*;

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
            e.to_string()
                .starts_with("a.toml:3: unknown field `colour`"),
            "{e}"
        );
    }

    #[test]
    fn a_failed_write_leaves_the_old_file_and_nothing_else() {
        let dir = tempfile::tempdir().unwrap();
        let path = dir.path().join("x.txt");
        std::fs::write(&path, "old").unwrap();
        let failed = OutputFile::write_with(&path, |w| {
            w.write_all(b"half")?;
            Err(io::Error::other("disk full"))
        });
        assert!(failed.is_err());
        assert_eq!(std::fs::read_to_string(&path).unwrap(), "old");
        assert_eq!(std::fs::read_dir(dir.path()).unwrap().count(), 1);
        OutputFile::write_with(&path, |w| w.write_all(b"new")).unwrap();
        assert_eq!(std::fs::read_to_string(&path).unwrap(), "new");
    }

    #[test]
    fn a_missing_folder_is_a_clear_sentence() {
        let e = OutputFile::create(Path::new("/nonexistent/dir/x"))
            .err()
            .unwrap();
        assert!(
            e.to_string()
                .contains("/nonexistent/dir/x: cannot be written"),
            "{e}"
        );
    }
}
