//! Why a sweep ended.

use crate::files::InputError;
use crate::system::FrameError;

/// Why a sweep ended.
#[derive(Debug, thiserror::Error)]
pub enum SweepError {
    /// Something in the input is impossible, or a file cannot be written.
    #[error(transparent)]
    Input(#[from] InputError),
    /// The program failed at a frame.
    #[error(transparent)]
    Frame(#[from] FrameError),
    /// Who was told of its progress wanted no more of it.
    #[error("the sweep was stopped before its end; it goes on from there when it is started again")]
    Stopped,
}
