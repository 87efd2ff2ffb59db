//! What light costs the window engine: 64 macropixels in 1600 laser cycles of 4800 CLK periods, one thread.
//!
//! A SPAD fires at most once a dead time, so bright light should cost what is detected and not what shines. The first line is
//! the light that others are compared with: 8 Mcounts/s a macropixel and a tenth of a signal photon a laser cycle.

use criterion::{Criterion, criterion_group, criterion_main};
use guided_dtof::chip::{Exposure, SensorConfig};
use guided_dtof::engine::{Expose, LitPixel, Window, stream_config};
use guided_dtof::photon::{PhotonStream, PixelLight};
use guided_dtof::units::Time;

/// Background of a macropixel, 1/s; signal photons a laser cycle; probability of afterpulses, and of crosstalk.
const LIGHTS: [(&str, f64, f64, f64); 12] = [
    ("8 Mcounts/s", 8e6, 0.1, 0.0),
    ("8 Mcounts/s, 1 % afterpulses and crosstalk", 8e6, 0.1, 0.01),
    ("80 Mcounts/s", 80e6, 0.1, 0.0),
    (
        "80 Mcounts/s, 1 % afterpulses and crosstalk",
        80e6,
        0.1,
        0.01,
    ),
    ("400 Mcounts/s", 400e6, 0.1, 0.0),
    ("1600 Mcounts/s", 1600e6, 0.1, 0.0),
    ("1 signal photon", 8e6, 1.0, 0.0),
    (
        "1 signal photon, 1 % afterpulses and crosstalk",
        8e6,
        1.0,
        0.01,
    ),
    ("5 signal photons", 8e6, 5.0, 0.0),
    ("60 signal photons", 8e6, 60.0, 0.0),
    ("1000 signal photons", 8e6, 1e3, 0.0),
    ("10 000 signal photons", 8e6, 1e4, 0.0),
];

fn light(c: &mut Criterion) {
    let config = SensorConfig::default();
    let exposure = Exposure::new(&config, 4800, 1600);
    let mut group = c.benchmark_group("window, 64 macropixels");
    group.sample_size(10);
    for (name, background_hz, signal_per_cycle, probability) in LIGHTS {
        let mut stream = stream_config(&config, &exposure, 1, Time::from_ps(1_900));
        stream.spads.afterpulse_probability = probability;
        stream.spads.crosstalk_probability = probability;
        let stream = PhotonStream::new(&stream);
        let pixels: Vec<LitPixel> = (0..64u16)
            .map(|number| {
                let start = number * 197 % 512;
                LitPixel {
                    number: number.into(),
                    start,
                    light: Some(PixelLight {
                        signal_per_cycle,
                        arrival: exposure.clock.periods(i64::from(start) - 8),
                        background_hz,
                    }),
                }
            })
            .collect();
        let engine = Window::new(&config, &exposure);
        group.bench_function(name, |b| {
            b.iter(|| engine.expose(&stream, &pixels).unwrap())
        });
    }
    group.finish();
}

criterion_group!(benches, light);
criterion_main!(benches);
