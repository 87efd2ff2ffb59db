//! Exporting: two by two macropixels, their stimulus and a testbench for other simulators.
//!
//! `cargo run --release --example exporting_verilog -- out/verilog`, then
//! `cd out/verilog && iverilog -g2005 -o sim tb.v design.v cells.v && vvp sim`

use std::path::PathBuf;

use guided_dtof::chip::{Exposure, SensorConfig};
use guided_dtof::files::InputError;
use guided_dtof::photon::SpadEvent;
use guided_dtof::stimulus::{StimulusPlan, export_verilog};
use guided_dtof::units::Time;

fn main() -> Result<(), InputError> {
    let folder = std::env::args().nth(1).unwrap_or("out/verilog".into());
    let config = SensorConfig {
        rows: 2,
        cols: 2,
        ..SensorConfig::default()
    };
    let exposure = Exposure::new(&config, 60, 4);
    let pulses = |ns: i64| {
        vec![SpadEvent {
            time: Time::from_ns(ns),
            spad: 3,
        }]
    };
    let events = [pulses(20), pulses(45), pulses(70), pulses(95)];
    let events = events.each_ref().map(|events| &events[..]);
    let plan = StimulusPlan::new(&config, &exposure, config.cols, &[10, 20, 30, 40], &events);
    export_verilog(&PathBuf::from(&folder), &config, Some(&plan), None)?;
    println!("{folder}: design.v, cells.v, cells_specify.v, tb.v, stimulus.txt");
    Ok(())
}
