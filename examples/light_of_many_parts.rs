//! Light of many parts: a wall that comes nearer behind a pane of glass, in fog, on SPADs of which one is hot.
//!
//! `cargo run --release --example light_of_many_parts`

use guided_dtof::chip::{Exposure, SensorConfig};
use guided_dtof::engine::{Engine, LitPixel, Window, expose, stream_config};
use guided_dtof::photon::{Echo, PhotonStream, PixelLight, Profile, SpadSpread};
use guided_dtof::units::{Time, TimeOfFlight};

fn main() -> Result<(), Box<dyn std::error::Error>> {
    let config = SensorConfig::default();
    let exposure = Exposure::new(&config, 520, 2000);
    let stream = PhotonStream::new(&stream_config(&config, &exposure, 7, Time::from_ps(1_900)));
    let engine = Window::new(&config, &exposure);

    // What fog sends back, photons a second: most of it before 40 ns, or 6 m.
    let edges = [5, 40, 120, 400].map(Time::from_ns);
    let fog = Profile::new(&edges, &[60e6, 15e6, 2e6])?;
    let wall = |range_m| {
        // A slanted wall: its echo is wider than the laser pulse.
        Echo::new(0.3, Time::of_flight(range_m)).with_sigma(Time::from_ns(3))
    };
    let glass = || PixelLight::echo(0.8, Time::of_flight(51.0)).with_background(8e6);
    let moving = PixelLight::timeline([
        (0, glass().with_echo(wall(54.0))),
        (1000, glass().with_echo(wall(53.4))),
    ])?;
    let mut dark_hz = [1e3; 16];
    dark_hz[5] = 2e6;
    let light = moving
        .with_profile(fog)
        .with_spads(SpadSpread::new(&[1.0; 16], &dark_hz)?);

    let arrival = Time::of_flight(52.5);
    let start = engine.law().start_for(arrival).expect("within reach");
    let pixel = LitPixel {
        number: 0,
        start,
        light: Some(light),
    };
    let exposed = expose(&engine, &stream, &[pixel], |_| ())?;
    println!("start value {start}");
    for (bin, count) in exposed.histograms[0].iter().enumerate() {
        println!(
            "bin {bin:2} {count:4} {}",
            "#".repeat(usize::from(*count) / 8)
        );
    }
    Ok(())
}
