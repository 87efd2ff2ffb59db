//! The `gdtof` that was built with the tests.

use std::path::Path;
use std::process::{Command, Output};

/// Runs it in `folder` to its end.
pub fn gdtof(folder: &Path, arguments: &[&str]) -> Output {
    Command::new(env!("CARGO_BIN_EXE_gdtof"))
        .args(arguments)
        .current_dir(folder)
        .output()
        .unwrap()
}
