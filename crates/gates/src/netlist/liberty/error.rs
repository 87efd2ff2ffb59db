//! What is wrong with a Liberty file, and what its numbers are in.

/// A fault of a Liberty file, with its line.
#[derive(Debug, Clone, PartialEq, Eq, thiserror::Error)]
#[error("{message}")]
pub struct LibertyError {
    /// Line, from 1.
    pub line: usize,
    /// What is wrong, and the cure.
    pub message: String,
}

/// What a file's numbers are in.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct Units {
    pub time_fs: f64,
    pub load_ff: f64,
    /// Of internal energy: a load's, at the unit of voltage squared.
    pub energy_fj: f64,
}
