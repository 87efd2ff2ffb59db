//! What the comparisons of chips with Icarus Verilog share: what its testbench and our kernel found.

use std::path::Path;

use guided_dtof::chip::SensorPins;
use guided_dtof::engine::GateSimulation;
use guided_dtof::kernel::Recorder;
use guided_dtof::netlist::Corner;

pub use crate::verilog::{is_here, random_delays, simulate};

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
pub struct IcarusChanges {
    /// Counts.
    pub counts: Vec<Vec<i64>>,
    /// Times.
    pub stops: Vec<Vec<i64>>,
}

#[allow(dead_code)]
impl IcarusChanges {
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
        IcarusChanges {
            counts: table("histograms.csv"),
            stops: table("local_stops.csv"),
        }
    }

    /// By our kernel, which has yet to run an array of `cols` columns.
    pub fn by_kernel(gate: &mut GateSimulation, cols: usize) -> Self {
        let local_stops = SensorPins::find(gate.netlist()).local_stop;
        let mut recorder = Recorder::new(local_stops.clone());
        gate.run(&mut recorder);
        let origin = gate.schedule().origin;
        let mut seen = IcarusChanges {
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
