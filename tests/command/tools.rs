//! What tests of the command share: it, and Python as a reader that is not ours.

use std::path::Path;
use std::process::{Command, Output};

pub use super::command::gdtof;

/// [`gdtof`] with arguments between spaces.
pub fn gdtof_words(folder: &Path, arguments: &str) -> Output {
    let arguments: Vec<&str> = arguments.split(' ').collect();
    gdtof(folder, &arguments)
}

/// Runs a script that must succeed, unless a package that it needs is missing.
pub fn python(folder: &Path, packages: &[&str], script: &str) {
    for package in packages {
        let found = Command::new("python3")
            .args(["-c", &format!("import {package}")])
            .output();
        if !found.is_ok_and(|output| output.status.success()) {
            eprintln!("SKIPPED: no {package} to read files with; pip install {package}");
            return;
        }
    }
    let read = Command::new("python3")
        .args(["-c", script])
        .current_dir(folder)
        .output()
        .unwrap();
    assert!(
        read.status.success(),
        "{}",
        String::from_utf8_lossy(&read.stderr)
    );
}
