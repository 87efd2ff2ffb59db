//! The cohort engine on a frame: 64×64 macropixels, 16 000 laser cycles, 8 Mcounts/s of background and 0.1 signal
//! photons a cycle, 384 MHz; and on one macropixel, in both ways of keeping the state.

use std::hint::black_box;

use criterion::{Criterion, Throughput, criterion_group, criterion_main};
use guided_dtof::chip::{Exposure, SensorConfig};
use guided_dtof::engine::{Cohort, CohortOptions, LitPixel, expose, stream_config};
use guided_dtof::photon::{PhotonStream, PixelLight};
use guided_dtof::units::Time;

const LIGHT: PixelLight = PixelLight::echo(0.1, Time::from_ns(765)).with_background(8e6);

fn frame(c: &mut Criterion) {
    let config = SensorConfig::default();
    let exposure = Exposure::new(&config, 520, 16_000);
    let stream = PhotonStream::new(&stream_config(&config, &exposure, 1, Time::from_ps(1_900)));
    let pixels: Vec<LitPixel> = (0..config.pixels() as u32)
        .map(|number| LitPixel {
            number,
            start: 300,
            light: Some(LIGHT),
        })
        .collect();
    let cohort = Cohort::new(&config, &exposure, CohortOptions::default());
    let mut group = c.benchmark_group("cohort");
    group.throughput(Throughput::Elements(pixels.len() as u64));
    group.bench_function("64x64 frame, all threads", |b| {
        b.iter(|| expose(&cohort, black_box(&stream), &pixels, |_| ()).unwrap());
    });
    group.throughput(Throughput::Elements(1));
    for (name, neglect) in [("pool", 1e-4), ("joint state", 0.0)] {
        let options = CohortOptions {
            neglect,
            ..CohortOptions::default()
        };
        let cohort = Cohort::new(&config, &exposure, options);
        let mut pixel = 0;
        group.bench_function(format!("macropixel, {name}"), |b| {
            b.iter(|| {
                pixel += 1;
                cohort
                    .hits(stream.config(), pixel, 300, black_box(&LIGHT))
                    .unwrap()
            });
        });
    }
    group.finish();
}

criterion_group!(benches, frame);
criterion_main!(benches);
