//! What users of the command line read of an error.

use crate::engine::EngineError;
use crate::files::InputError;
use crate::request::{self, Spelling};
use crate::system::FrameError;

/// The sentence for standard error.
pub(super) fn sentence(error: &anyhow::Error) -> String {
    if let Some(error) = error.downcast_ref::<EngineError>() {
        return request::of_engine(error, Spelling::Options);
    }
    match error.downcast_ref::<FrameError>() {
        Some(error) => request::sentence(error, Spelling::Options),
        None => format!("{error:#}"),
    }
}

/// Whether the user can mend it.
pub(super) fn is_bad_input(error: &anyhow::Error) -> bool {
    error.is::<InputError>()
        || matches!(error.downcast_ref::<EngineError>(), Some(e) if e.is_refusal())
        || matches!(error.downcast_ref::<FrameError>(), Some(e) if request::is_bad_input(e))
}
