//! The waveform of one laser cycle: a macropixel at gate level, with a view for GTKWave and Surfer.
//!
//! `cargo run --release --example waveform_of_one_cycle -- out/cycle.vcd`, then `gtkwave out/cycle.gtkw`

use std::path::PathBuf;

use guided_dtof::chip::{Exposure, SensorConfig};
use guided_dtof::engine::GateSimulation;
use guided_dtof::engine::waveform::{View, record};
use guided_dtof::files::{InputError, create_folder};
use guided_dtof::photon::SpadEvent;
use guided_dtof::units::Time;
use guided_dtof::waves::WaveFormat;

fn main() -> Result<(), InputError> {
    let file = PathBuf::from(std::env::args().nth(1).unwrap_or("out/cycle.vcd".into()));
    if let Some(folder) = file.parent() {
        create_folder(folder)?;
    }
    let config = SensorConfig {
        rows: 1,
        cols: 1,
        ..SensorConfig::default()
    };
    let exposure = Exposure::new(&config, 60, 1);
    let pulses = vec![SpadEvent {
        time: Time::from_ns(50),
        spad: 7,
    }];
    let mut simulation = GateSimulation::new(&config, &exposure, (0, 0), (1, 1), &[25], &[&pulses]);
    let view = View::of_array(vec![(0, 0)], &config, &exposure, 25);
    record(
        &mut simulation,
        &file,
        WaveFormat::from_path(&file),
        &view,
        &mut (),
    )?;
    println!("{}: {:?}", file.display(), simulation.histograms());
    Ok(())
}
