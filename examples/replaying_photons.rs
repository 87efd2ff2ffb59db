//! Replaying photons: those of a macropixel, drawn once, through two engines, and what dead time took of them.
//!
//! `cargo run --release --example replaying_photons`

use guided_dtof::chip::{Exposure, SensorConfig};
use guided_dtof::engine::{Cycle, Engine, EngineError, Replay, Window, stream_config};
use guided_dtof::photon::{PhotonStream, PixelLight};
use guided_dtof::units::Time;

fn main() -> Result<(), EngineError> {
    let config = SensorConfig::default();
    let exposure = Exposure::new(&config, 520, 2000);
    let light = PixelLight::echo(0.4, Time::from_ns(400)).with_background(20e6);
    let stream = PhotonStream::new(&stream_config(&config, &exposure, 7, Time::from_ps(1_900)));
    let photons = stream.pixel_events(0, &light);
    println!(
        "{} photons and dark counts, {} of them in blind SPADs",
        photons.drawn, photons.lost_to_dead_time
    );
    let window = Window::new(&config, &exposure);
    let start = window
        .law()
        .start_for(light.arrival())
        .expect("within reach");
    let counts = window.histogram(start, &photons.events)?;
    println!("start value {start}, window {counts:?}");
    let cycle = Cycle::new(&config, &exposure).histogram(start, &photons.events)?;
    assert_eq!(counts, cycle);
    Ok(())
}
