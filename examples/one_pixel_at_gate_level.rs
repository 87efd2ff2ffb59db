//! One macropixel at gate level: photons in, histogram out, and the same from the fast engine.
//!
//! `cargo run --release --example one_pixel_at_gate_level`

use guided_dtof::chip::{Exposure, SensorConfig};
use guided_dtof::engine::{EngineError, Gate, Replay, Window};
use guided_dtof::photon::SpadEvent;
use guided_dtof::units::Time;

fn main() -> Result<(), EngineError> {
    let config = SensorConfig::default();
    let exposure = Exposure::new(&config, 60, 20); // 60 CLK periods a laser cycle, 20 cycles
    let start = 25; // COUNTER_INIT
    // An echo 50 ns after each STOP, on another SPAD each time, and now and then a background photon.
    let pulses: Vec<SpadEvent> = (0..20)
        .flat_map(|cycle| {
            let stop = exposure.stop(cycle);
            let echo = SpadEvent {
                time: stop + Time::from_ns(50),
                spad: (cycle % 16) as u8,
            };
            let background = SpadEvent {
                time: stop + Time::from_ps(60_000 + 2_500 * cycle),
                spad: ((cycle + 5) % 16) as u8,
            };
            [Some(echo), (cycle % 3 == 0).then_some(background)]
        })
        .flatten()
        .collect();

    let counts = Gate::new(&config, &exposure).histogram(start, &pulses)?;
    println!("gate    {counts:?}");
    let fast = Window::new(&config, &exposure).histogram(start, &pulses)?;
    println!("window  {fast:?}");
    assert_eq!(counts, fast);
    Ok(())
}
