//! What is wrong with something the user gave, in one sentence that an editor can jump to.

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

impl fmt::Display for InputError {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "{}", self.source_name)?;
        if let Some(line) = self.line {
            write!(f, ":{line}")?;
        }
        write!(f, ": {}", self.message)?;
        self.further.iter().try_for_each(|e| write!(f, "\n{e}"))
    }
}

impl InputError {
    /// A complaint about `source` as a whole.
    pub fn new(source: impl fmt::Display, message: impl Into<String>) -> Self {
        InputError {
            source_name: source.to_string(),
            line: None,
            message: message.into(),
            further: Vec::new(),
        }
    }

    /// A complaint about one line (counted from 1) of `source`.
    pub fn at(source: impl fmt::Display, line: usize, message: impl Into<String>) -> Self {
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

    pub fn unreadable(path: &Path, error: &io::Error) -> Self {
        Self::new(
            path.display(),
            format!("cannot be read ({error}); check the path and its permissions"),
        )
    }

    pub fn unwritable(path: &Path, error: &io::Error) -> Self {
        use io::ErrorKind::{FileTooLarge, QuotaExceeded, StorageFull};
        let cure = match error.kind() {
            FileTooLarge | QuotaExceeded | StorageFull => "free some space",
            _ => "choose a folder that exists and is writable",
        };
        Self::new(
            path.display(),
            format!("cannot be written ({error}); {cure}"),
        )
    }
}
