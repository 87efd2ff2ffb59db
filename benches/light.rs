//! What light costs the window engine: 64 macropixels in 1600 laser cycles of 4800 CLK periods, one thread.
//!
//! A SPAD fires at most once a dead time, so bright light should cost what is detected and not what shines. The first line is
//! the light that others are compared with: 8 Mcounts/s a macropixel and a tenth of a signal photon a laser cycle. The last group
//! has as much, but in several parts.

use criterion::{Criterion, criterion_group, criterion_main};
use guided_dtof::chip::{Exposure, SensorConfig};
use guided_dtof::engine::{Expose, LitPixel, Window, stream_config};
use guided_dtof::photon::{Echo, PhotonStream, PixelLight, Profile, SpadSpread};
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
                    light: Some(
                        PixelLight::echo(
                            signal_per_cycle,
                            exposure.clock.periods(i64::from(start) - 8),
                        )
                        .with_background(background_hz),
                    ),
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

/// Light of several parts, with an echo of a tenth of a photon at `arrival`.
fn in_parts(arrival: Time) -> [(&'static str, PixelLight); 5] {
    let plain = || PixelLight::echo(0.1, arrival).with_background(8e6);
    let edges = [5, 40, 120, 400].map(Time::from_ns);
    let fog = Profile::new(&edges, &[60e6, 15e6, 2e6]).expect("a profile");
    let segments = (0..8).map(|segment| {
        let arrival = arrival - Time::from_ps(200) * segment;
        (200 * segment as u32, plain().with_arrival(arrival))
    });
    let factors: [f64; 16] = std::array::from_fn(|spad| 0.8 + 0.4 * spad as f64 / 15.0);
    let spread = SpadSpread::new(&factors, &[2e3; 16]).expect("a spread");
    [
        ("one echo", plain()),
        (
            "two echoes",
            plain().with_echo(Echo::new(0.1, arrival - Time::from_ns(9))),
        ),
        ("fog", plain().with_profile(fog)),
        (
            "8 segments",
            PixelLight::timeline(segments).expect("segments"),
        ),
        ("SPADs that differ", plain().with_spads(spread)),
    ]
}

fn light_in_parts(c: &mut Criterion) {
    let config = SensorConfig::default();
    let exposure = Exposure::new(&config, 4800, 1600);
    let stream = stream_config(&config, &exposure, 1, Time::from_ps(1_900));
    let stream = PhotonStream::new(&stream);
    let engine = Window::new(&config, &exposure);
    let mut group = c.benchmark_group("window, 64 macropixels, light in parts");
    group.sample_size(10);
    for part in 0..5 {
        let mut name = "";
        let pixels: Vec<LitPixel> = (0..64u16)
            .map(|number| {
                let start = number * 197 % 512;
                let arrival = exposure.clock.periods(i64::from(start) - 8);
                let (what, light) = in_parts(arrival)[part].clone();
                name = what;
                LitPixel {
                    number: number.into(),
                    start,
                    light: Some(light),
                }
            })
            .collect();
        group.bench_function(name, |b| {
            b.iter(|| engine.expose(&stream, &pixels).unwrap())
        });
    }
    group.finish();
}

criterion_group!(benches, light, light_in_parts);
criterion_main!(benches);
