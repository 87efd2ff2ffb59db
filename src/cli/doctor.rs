//! `gdtof doctor`: what the program uses on this machine, and which other tools it found.

use std::process::{Command, Stdio};

use clap::Args;
use serde::Serialize;

use super::voice::{say_json, say_unless_quiet};
use crate::report::Table;

/// Arguments of `gdtof doctor`.
#[derive(Args)]
pub(super) struct DoctorArgs {
    /// Print JSON instead of the table.
    #[arg(long)]
    json: bool,
}

/// A tool, how it tells its version, and what it is for.
const TOOLS: [(&str, &str, &str); 8] = [
    (
        "iverilog",
        "-V",
        "tests of the netlist beside an independent simulator",
    ),
    ("vvp", "-V", "running exported Verilog (Icarus)"),
    ("verilator", "--version", "speed beside compiled Verilog"),
    ("yosys", "-V", "tests of the exported netlist's synthesis"),
    ("gtkwave", "--version", "looking at waveforms (.gtkw)"),
    ("surfer", "--version", "looking at waveforms (.sucl)"),
    ("python3", "--version", "the Python package"),
    ("chromium", "--version", "tests of the page"),
];

#[derive(Serialize)]
struct Tool {
    name: &'static str,
    /// First line that it prints about itself; `None` if it is not installed.
    version: Option<String>,
    used_for: &'static str,
}

#[derive(Serialize)]
struct Report {
    version: &'static str,
    target: String,
    built: &'static str,
    /// Vector instructions that engines choose among, as this processor has them.
    vectors: Vec<&'static str>,
    threads: usize,
    cores: usize,
    tools: Vec<Tool>,
}

/// Runs the command.
///
/// # Errors
/// When the report cannot be written.
pub(super) fn run(args: &DoctorArgs) -> anyhow::Result<()> {
    let report = Report {
        version: env!("CARGO_PKG_VERSION"),
        target: format!("{} {}", std::env::consts::ARCH, std::env::consts::OS),
        built: if cfg!(debug_assertions) {
            "without optimisation; give --release for speed"
        } else {
            "for release"
        },
        vectors: vectors(),
        threads: rayon::current_num_threads(),
        cores: std::thread::available_parallelism().map_or(1, usize::from),
        tools: TOOLS
            .map(|(name, option, used_for)| Tool {
                name,
                version: version(name, option),
                used_for,
            })
            .into(),
    };
    if args.json {
        return say_json(&report);
    }
    let mut table = Table::new(format!("gdtof {}", report.version))
        .row("built", report.built)
        .row("machine", &report.target)
        .row(
            "threads, cores",
            format!("{}, {}", report.threads, report.cores),
        )
        .row("vector instructions", report.vectors.join(" "));
    for tool in &report.tools {
        let found = tool.version.as_deref().unwrap_or("not found");
        table.push(tool.name, format!("{found}; for {}", tool.used_for));
    }
    Ok(say_unless_quiet(table)?)
}

/// The version that a tool prints, or just that it is there.
fn version(name: &str, option: &str) -> Option<String> {
    let output = Command::new(name).arg(option).stdin(Stdio::null()).output();
    let output = output.ok()?;
    let said = [output.stdout, output.stderr].concat();
    let said = String::from_utf8_lossy(&said);
    Some(version_in(&said).unwrap_or("found").to_owned())
}

/// The first line with a number like 1.2: GTKWave without a display tells how it is used, too.
fn version_in(said: &str) -> Option<&str> {
    let has_number = |line: &&str| {
        let letters = line.as_bytes().windows(3);
        let mut numbers = letters.filter(|letters| {
            letters[0].is_ascii_digit() && letters[1] == b'.' && letters[2].is_ascii_digit()
        });
        numbers.next().is_some()
    };
    said.lines().map(str::trim).find(has_number)
}

#[cfg(target_arch = "x86_64")]
fn vectors() -> Vec<&'static str> {
    let known = [
        ("sse4.2", std::is_x86_feature_detected!("sse4.2")),
        ("avx", std::is_x86_feature_detected!("avx")),
        ("avx2", std::is_x86_feature_detected!("avx2")),
        ("fma", std::is_x86_feature_detected!("fma")),
        ("avx512f", std::is_x86_feature_detected!("avx512f")),
    ];
    known
        .into_iter()
        .filter(|(_, has)| *has)
        .map(|(name, _)| name)
        .collect()
}

#[cfg(not(target_arch = "x86_64"))]
fn vectors() -> Vec<&'static str> {
    Vec::new()
}

#[cfg(test)]
mod tests {
    use super::version_in;

    #[test]
    fn a_version_is_found_among_other_lines() {
        let usage = "\nUsage: gtkwave [OPTION]... [DUMPFILE]\n\n  GTKWave Analyzer v3.3.118 (w)1999-2023 BSI\n";
        let version = version_in(usage);
        assert_eq!(version, Some("GTKWave Analyzer v3.3.118 (w)1999-2023 BSI"));
        assert_eq!(version_in("Could not initialize GTK!\n"), None);
    }
}
