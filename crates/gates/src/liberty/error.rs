//! What is wrong with a Liberty file.

/// A fault of a Liberty file, with its line.
#[derive(Debug, Clone, PartialEq, Eq, thiserror::Error)]
#[error("{message}")]
#[non_exhaustive]
pub struct LibertyError {
    /// Line, from 1.
    pub line: usize,
    /// What is wrong, and the cure.
    pub message: String,
}

/// A fault of one of several Liberty files.
#[derive(Debug, Clone, PartialEq, Eq, thiserror::Error)]
#[error("{fault}")]
#[non_exhaustive]
pub struct KitError {
    /// Which file, from 0.
    pub file: usize,
    /// What is wrong with it.
    pub fault: LibertyError,
}
