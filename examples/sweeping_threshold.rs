//! Sweeping THRESHOLD: how many SPADs must fire within a CLK period for it to count (thesis 4.2, TYPE and THRESHOLD).
//!
//! `cargo run --release --example sweeping_threshold`

use guided_dtof::chip::{Exposure, SensorConfig};
use guided_dtof::engine::{Engine, EngineError, Expose, LitPixel, Window, stream_config};
use guided_dtof::photon::{PhotonStream, PixelLight};
use guided_dtof::units::Time;

fn main() -> Result<(), EngineError> {
    println!("THRESHOLD  counts by bin");
    for threshold in 0..4 {
        let config = SensorConfig {
            threshold,
            ..SensorConfig::default()
        };
        let exposure = Exposure::new(&config, 520, 4000);
        let stream = PhotonStream::new(&stream_config(&config, &exposure, 1, Time::from_ps(1_900)));
        let window = Window::new(&config, &exposure);
        let arrival = Time::from_ns(600);
        let pixel = LitPixel {
            number: 0,
            start: window.law().start_for(arrival).expect("within reach"),
            light: Some(PixelLight::echo(2.0, arrival).with_background(100e6)),
        };
        // More than THRESHOLD SPADs: background is suppressed faster than the echo.
        let exposed = window.expose(&stream, &[pixel])?;
        println!("{threshold:9}  {:?}", &exposed.histograms[0]);
    }
    Ok(())
}
