//! What tests of the command share: it, and Python as a reader that is not ours.

use std::path::Path;
use std::process::{Command, Output};

pub use super::command::gdtof;

/// [`gdtof`] with arguments between spaces.
pub fn gdtof_words(folder: &Path, arguments: &str) -> Output {
    let arguments: Vec<&str> = arguments.split(' ').collect();
    gdtof(folder, &arguments)
}

/// Whether all cases are asked for, as each night, and not only those of each change.
pub fn takes_all() -> bool {
    std::env::var_os("GDTOF_CASES").is_some()
}

/// Runs a script that needs no package and must succeed. Skipped, loudly, where there is no Python.
pub fn python(folder: &Path, script: &str) {
    let read = Command::new("python3")
        .args(["-c", script])
        .current_dir(folder)
        .output();
    let Ok(read) = read else {
        assert!(std::env::var_os("CI").is_none(), "no python3");
        eprintln!("SKIPPED: no python3 to read files with");
        return;
    };
    assert!(
        read.status.success(),
        "{}",
        String::from_utf8_lossy(&read.stderr)
    );
}
