//! Depth from histograms: an echo found, judged and freed of range walk.
//!
//! `cargo run --release --example depth_from_histograms`

use guided_dtof::chip::{Exposure, SensorConfig};
use guided_dtof::engine::{Engine, Expose, LitPixel, Window, stream_config};
use guided_dtof::photon::{PhotonStream, PixelLight};
use guided_dtof::ranging::{DepthOptions, EchoFinder};
use guided_dtof::theory::precision::{range_m, time_ns};
use guided_dtof::units::Time;

fn main() -> Result<(), Box<dyn std::error::Error>> {
    let config = SensorConfig::default();
    let exposure = Exposure::new(&config, 520, 1000);
    let sigma = Time::from_ps(1_900);
    let stream = PhotonStream::new(&stream_config(&config, &exposure, 1, sigma));
    let window = Window::new(&config, &exposure);
    let law = window.law();
    let finder = EchoFinder::new(&law, sigma, &DepthOptions::default())?;
    println!("truth      depth       error    confidence");
    for (number, truth_m) in [20.0, 50.0, 100.0, 150.0].into_iter().enumerate() {
        let arrival = Time::from_s(1e-9 * time_ns(truth_m));
        let start = law.start_for(arrival).expect("within reach");
        let pixel = LitPixel {
            number: number as u32,
            start,
            light: Some(
                PixelLight::echo(2000.0 / (truth_m * truth_m), arrival).with_background(8e6),
            ),
        };
        let histogram = window.expose(&stream, &[pixel])?.histograms[0].to_vec();
        let counts: Vec<u32> = histogram.into_iter().map(u32::from).collect();
        match finder.find(&counts).filter(|found| found.is_significant) {
            Some(found) => {
                let open = law.window(start).open().expect("start_for gives open ones");
                let depth_m = range_m(law.time_of(&open, found.position_bins).as_ns());
                println!(
                    "{truth_m:5} m  {depth_m:8.3} m  {:+.3} m  {:.1}",
                    depth_m - truth_m,
                    found.confidence
                );
            }
            None => println!("{truth_m:5} m  no significant peak"),
        }
    }
    Ok(())
}
