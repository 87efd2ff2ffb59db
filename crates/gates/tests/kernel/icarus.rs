//! Icarus Verilog, and random delays for it.

use std::path::Path;
use std::process::Command;

use femtogate::netlist::{ArcDelay, Netlist, ScopeId, Timing};
use femtogate::units::Time;
use rand::{RngExt, rngs::StdRng};

use crate::tool;

/// Whether Icarus is installed; says so loudly where it is not, and fails where it must be.
pub fn is_here() -> bool {
    tool::is_here("iverilog", "nothing was compared with Icarus Verilog")
}

/// Compiles `sources` (and options) in `folder` without a word of warning, and simulates them there; gives what was
/// printed.
pub fn simulate(folder: &Path, sources: &[&str], plus_arguments: &[&str]) -> String {
    let mut compile = vec!["-g2005", "-Wall", "-o", "sim"];
    compile.extend(sources);
    let said = run(folder, "iverilog", &compile);
    assert_eq!(said, "", "Icarus has something to say about the export");
    run(folder, "vvp", &[&["-n", "sim"], plus_arguments].concat())
}

/// What a program printed. That it has no timing checks is said by Icarus from version 13 on, of each of them.
fn run(folder: &Path, program: &str, arguments: &[&str]) -> String {
    let output = Command::new(program)
        .args(arguments)
        .current_dir(folder)
        .output()
        .unwrap();
    let text = String::from_utf8_lossy(&output.stdout) + String::from_utf8_lossy(&output.stderr);
    assert!(output.status.success(), "{program}: {text}");
    let has_no_checks = |line: &&str| {
        line.contains("iming checks are not supported") || line.contains("TIMINGCHECK not support")
    };
    let lines = text.lines().filter(|line| !has_no_checks(line));
    lines.collect::<Vec<_>>().join("\n")
}

/// Every arc of every cell 0.7 to 1.4 times as slow as in the library, each by itself.
#[allow(dead_code)]
pub fn random_delays(netlist: &Netlist, nominal: &Timing, random: &mut StdRng) -> Timing {
    let mut timing = nominal.clone();
    for cell in netlist.cells_below(ScopeId::TOP) {
        let mut delays = *nominal.cell_delays(cell);
        for arc in delays.as_flattened_mut() {
            let mut varied = |delay: Time| {
                Time::from_fs((delay.as_fs() as f64 * random.random_range(0.7..1.4)) as i64)
            };
            *arc = ArcDelay::new(varied(arc.rise()), varied(arc.fall()));
        }
        timing.set(cell, delays);
    }
    timing
}
