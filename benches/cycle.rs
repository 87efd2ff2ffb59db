//! How fast the cycle engine is: macropixel-CLK periods per second over whole laser cycles, by array size and exposure
//! length, and what sorting the photons for it costs. 10 Mcounts/s of background and one signal photon a laser
//! cycle.

use std::hint::black_box;

use criterion::{Criterion, Throughput, criterion_group, criterion_main};
use guided_dtof::chip::{Exposure, SensorConfig};
use guided_dtof::engine::{Cycle, stream_config};
use guided_dtof::photon::{PhotonStream, PixelLight, SpadEvent};
use guided_dtof::units::Time;

const STOP_PERIODS: u32 = 520;

fn cycle(c: &mut Criterion) {
    let mut group = c.benchmark_group("cycle engine, macropixel-CLK");
    group.sample_size(10);
    for (side, laser_cycles) in [
        (16, 100),
        (32, 100),
        (64, 25),
        (64, 50),
        (64, 100),
        (128, 25),
    ] {
        let config = SensorConfig {
            rows: side,
            cols: side,
            ..SensorConfig::default()
        };
        let exposure = Exposure::new(&config, STOP_PERIODS, laser_cycles);
        let stream = PhotonStream::new(&stream_config(&config, &exposure, 1, Time::from_ps(1_900)));
        let light = PixelLight::echo(1.0, Time::from_ns(765)).with_background(10e6);
        let pulses: Vec<Vec<SpadEvent>> = (0..config.pixels())
            .map(|pixel| stream.pixel_events(pixel as u32, &light).events)
            .collect();
        let pulses: Vec<&[SpadEvent]> = pulses.iter().map(Vec::as_slice).collect();
        let starts: Vec<u16> = (0..config.pixels())
            .map(|pixel| (pixel * 197 % 512) as u16)
            .collect();
        let engine = Cycle::new(&config, &exposure);
        let packed = engine.pack(&starts, &pulses);
        engine
            .replay_packed(&starts, &packed)
            .expect("the default sensor is levelised");
        let periods = config.pixels() as u64 * u64::from(STOP_PERIODS) * u64::from(laser_cycles);
        group.throughput(Throughput::Elements(periods));
        let name = format!("{side}x{side}, {laser_cycles} laser cycles");
        group.bench_function(format!("{name}: logic"), |b| {
            b.iter(|| black_box(engine.replay_packed(&starts, &packed)));
        });
        group.bench_function(format!("{name}: sorting the photons"), |b| {
            b.iter(|| black_box(engine.pack(&starts, &pulses)));
        });
    }
    group.finish();
}

criterion_group!(benches, cycle);
criterion_main!(benches);
