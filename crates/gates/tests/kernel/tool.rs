//! Tools that are not ours.

use std::io::Write;
use std::process::Command;

/// Whether `program` is installed; says so loudly where it is not, and fails where it must be. `so` is what then remains undone.
pub fn is_here(program: &str, so: &str) -> bool {
    if Command::new(program).arg("-V").output().is_ok() {
        return true;
    }
    let said =
        format!("SKIPPED: {program} is not installed, so {so} (apt-get install {program})\n");
    // Not eprintln, which cargo hides where a test passes; at once, beside other tests.
    let _ = std::io::stderr().write_all(said.as_bytes());
    assert!(std::env::var_os("CI").is_none(), "CI must have {program}");
    false
}
