//! What the comparisons with Icarus Verilog share: running it.

use std::io::Write;
use std::path::Path;
use std::process::Command;

/// Whether Icarus is installed; says so loudly where it is not, and fails where it must be.
pub fn is_here() -> bool {
    if Command::new("iverilog").arg("-V").output().is_ok() {
        return true;
    }
    // Not eprintln, which cargo hides where a test passes.
    let _ = writeln!(
        std::io::stderr(),
        "SKIPPED: iverilog is not installed, so nothing was compared with Icarus Verilog (apt-get install iverilog)"
    );
    assert!(std::env::var_os("CI").is_none(), "CI must have iverilog");
    false
}

/// Compiles `sources` in `folder` without a word of warning, and simulates them there.
pub fn simulate(folder: &Path, sources: &[&str], plus_arguments: &[&str]) {
    let mut compile = vec!["-g2005", "-Wall", "-o", "sim"];
    compile.extend(sources);
    let said = run(folder, "iverilog", &compile);
    assert_eq!(said, "", "Icarus has something to say about the export");
    run(folder, "vvp", &[&["-n", "sim"], plus_arguments].concat());
}

fn run(folder: &Path, program: &str, arguments: &[&str]) -> String {
    let output = Command::new(program)
        .args(arguments)
        .current_dir(folder)
        .output()
        .unwrap();
    let text = String::from_utf8_lossy(&output.stdout) + String::from_utf8_lossy(&output.stderr);
    assert!(output.status.success(), "{program}: {text}");
    text.into_owned()
}
