//! A sensor of your own: other counters, clocks and bins than the QuantIC4x4's, on three engines.
//!
//! `cargo run --release --example sensor_of_your_own`

use guided_dtof::chip::{Exposure, PCounter, SensorConfig};
use guided_dtof::engine::{Cycle, EngineError, Gate, Replay, Window};
use guided_dtof::photon::SpadEvent;
use guided_dtof::units::Time;

fn main() -> Result<(), EngineError> {
    let config = SensorConfig {
        counter_bits: 7,
        p_counter: PCounter::Synchronous,
        bins: 32,
        bin_bits: 12,
        clk_hz: 200e6,
        dead_time_ns: 12.0,
        ..SensorConfig::default()
    };
    if let Err(fault) = config.check() {
        println!("{fault}");
        return Ok(());
    }
    let exposure = Exposure::new(&config, 140, 8);
    let pulses: Vec<SpadEvent> = (0..8)
        .map(|cycle| SpadEvent {
            time: exposure.stop(cycle) + Time::from_ns(300 + 5 * cycle),
            spad: cycle as u8,
        })
        .collect();
    let engines: [(&str, &dyn Replay); 3] = [
        ("gate", &Gate::new(&config, &exposure)),
        ("cycle", &Cycle::new(&config, &exposure)),
        ("window", &Window::new(&config, &exposure)),
    ];
    for (name, engine) in engines {
        println!("{name:6} {:?}", engine.histogram(70, &pulses)?);
    }
    Ok(())
}
