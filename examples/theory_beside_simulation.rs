//! Theory beside simulation: the probability that the fullest bin is the target's (thesis Eq. 17), and its share among
//! simulated macropixels.
//!
//! `cargo run --release --example theory_beside_simulation`

use guided_dtof::chip::{Exposure, SensorConfig};
use guided_dtof::engine::{Engine, EngineError, Expose, LitPixel, Window, stream_config};
use guided_dtof::photon::{PhotonStream, PixelLight};
use guided_dtof::theory::detection::{DetectionModel, PerCycle, Ties, probability};
use guided_dtof::units::Time;

const MACROPIXELS: u32 = 4096;
/// Bin that all of the echo falls into.
const BIN: i64 = 8;

fn main() -> Result<(), EngineError> {
    let config = SensorConfig::default();
    let clk_s = 1.0 / config.clk_hz;
    println!("laser cycles   theory   simulated");
    for laser_cycles in [100, 300, 1000, 3000] {
        let exposure = Exposure::new(&config, 520, laser_cycles);
        let light = PerCycle {
            signal: 0.01,
            background: 0.01,
            bins: config.bins as u32,
        };
        let window = Window::new(&config, &exposure);
        let law = window.law();
        let start = 200;
        let open = law.window(start).open().expect("it is open");
        let bin = law.bin_interval(&open, 0, BIN);
        let arrival = Time::from_fs((bin.start.as_fs() + bin.end.as_fs()) / 2);
        // A pulse far shorter than a bin, so that all of it is in one.
        let stream = PhotonStream::new(&stream_config(&config, &exposure, 1, Time::from_ps(20)));
        let pixels: Vec<LitPixel> = (0..MACROPIXELS)
            .map(|number| LitPixel {
                number,
                start,
                light: Some(
                    PixelLight::echo(light.signal, arrival)
                        .with_background(light.background / clk_s),
                ),
            })
            .collect();
        let exposed = window.expose(&stream, &pixels)?;
        let found = exposed.histograms.iter().filter(|counts| {
            let target = counts[BIN as usize];
            let others = counts
                .iter()
                .enumerate()
                .filter(|&(bin, _)| bin != BIN as usize);
            others.into_iter().all(|(_, &count)| count < target)
        });
        let simulated = found.count() as f64 / f64::from(MACROPIXELS);
        let theory = probability(
            &light,
            laser_cycles.into(),
            DetectionModel::Bernoulli(Ties::Strict),
        );
        println!(
            "{laser_cycles:12}   {:.4}   {simulated:.4}",
            theory.probability
        );
    }
    Ok(())
}
