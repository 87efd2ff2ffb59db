//! What the comparisons with Icarus Verilog share: running it, with random delays, too, and reading what its testbench
//! and our kernel found.

use crate::tool;

use std::path::Path;
use std::process::Command;

use guided_dtof::chip::SensorPins;
use guided_dtof::engine::GateSimulation;
use guided_dtof::kernel::Recorder;
use guided_dtof::netlist::{Corner, Netlist, Timing};
use rand::{RngExt, rngs::StdRng};

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

/// Options and sources of the exported testbench with standard cells, onto which it annotates `chip.sdf`.
#[allow(dead_code)]
pub fn standard_cells(corner: Corner) -> [&'static str; 6] {
    let delays = match corner {
        Corner::Fast => "-Tmin",
        Corner::Typ => "-Ttyp",
        Corner::Slow => "-Tmax",
    };
    let sdf = "-DSDF=\"chip.sdf\"";
    [
        "-gspecify",
        delays,
        sdf,
        "tb.v",
        "design.v",
        "cells_specify.v",
    ]
}

/// Histogram counts (row, col, bin, count) and LOCAL_STOP times (row, col, fs from the first STOP on), both sorted.
#[allow(dead_code)]
#[derive(Debug, PartialEq, Eq)]
pub struct Seen {
    /// Counts.
    pub counts: Vec<Vec<i64>>,
    /// Times.
    pub stops: Vec<Vec<i64>>,
}

#[allow(dead_code)]
impl Seen {
    /// By the exported testbench, which ran in `folder`.
    pub fn by_testbench(folder: &Path) -> Self {
        let table = |name: &str| {
            let text = std::fs::read_to_string(folder.join(name)).unwrap();
            // Unknown counts are no numbers.
            let row = |line: &str| line.split(',').map(|n| n.parse().unwrap_or(-1)).collect();
            let mut table: Vec<Vec<i64>> = text.lines().skip(1).map(row).collect();
            table.sort();
            table
        };
        Seen {
            counts: table("histograms.csv"),
            stops: table("local_stops.csv"),
        }
    }

    /// By our kernel, which has yet to run an array of `cols` columns.
    pub fn by_kernel(gate: &mut GateSimulation, cols: usize) -> Self {
        let local_stops = SensorPins::of(gate.netlist()).local_stop;
        let mut recorder = Recorder::new(local_stops.clone());
        gate.run(&mut recorder);
        let origin = gate.schedule().origin;
        let mut seen = Seen {
            counts: Vec::new(),
            stops: Vec::new(),
        };
        for (pixel, counts) in gate.histograms().unwrap().iter().enumerate() {
            let [row, col] = [pixel / cols, pixel % cols].map(|n| n as i64);
            for (bin, &count) in counts.iter().enumerate() {
                seen.counts.push(vec![row, col, bin as i64, count.into()]);
            }
            let rises = recorder.rising_edges(local_stops[pixel]).into_iter();
            let stops = rises.filter(|&time| time >= origin);
            let stops = stops.map(|time| vec![row, col, (time - origin).as_fs()]);
            seen.stops.extend(stops);
        }
        seen.counts.sort();
        seen.stops.sort();
        seen
    }
}

/// Every arc of every cell 0.7 to 1.4 times as slow as in the library, each by itself.
#[allow(dead_code)]
pub fn random_delays(netlist: &Netlist, nominal: &Timing, random: &mut StdRng) -> Timing {
    let mut timing = nominal.clone();
    for cell in 0..netlist.cells().len() {
        let mut delays = *nominal.of(cell);
        for arc in delays.as_flattened_mut() {
            arc.rise_fs = (arc.rise_fs as f64 * random.random_range(0.7..1.4)) as u32;
            arc.fall_fs = (arc.fall_fs as f64 * random.random_range(0.7..1.4)) as u32;
        }
        timing.set(cell, delays);
    }
    timing
}
