//! A whole frame on the window engine, photon stream included: 8 Mcounts/s of background and 0.1 signal photons a laser
//! cycle at 384 MHz. How it grows with macropixels and threads, and that it does not with the STOP period.
//! Throughput is in photons drawn.

use std::hint::black_box;
use std::time::Duration;

use criterion::{
    BenchmarkId, Criterion, SamplingMode, Throughput, criterion_group, criterion_main,
};
use guided_dtof::engine::Window;
use guided_dtof::system::{SPEED_LASER_CYCLES, SpeedCase, SpeedFrame};

fn frames(c: &mut Criterion) {
    let mut group = c.benchmark_group("frame, 16000 laser cycles");
    group.sample_size(10).sampling_mode(SamplingMode::Flat);
    group.warm_up_time(Duration::from_millis(500));
    for (threads, side, stop_periods) in [
        (1, 1, 4800),
        (1, 4, 4800),
        (1, 16, 4800),
        (1, 64, 4800),
        (1, 64, 520),
        (2, 16, 4800),
        (2, 64, 4800),
        (2, 64, 520),
        (2, 256, 4800),
    ] {
        let frame = SpeedFrame::new(
            SpeedCase::Street,
            (side, side),
            stop_periods,
            SPEED_LASER_CYCLES,
        );
        let engine = Window::new(&frame.sensor, &frame.exposure);
        let pool = rayon::ThreadPoolBuilder::new()
            .num_threads(threads)
            .build()
            .expect("threads");
        let drawn = frame.expose(&engine).expect("no race").work.photons_drawn;
        group.throughput(Throughput::Elements(drawn));
        let name = format!("{side}x{side}, STOP every {stop_periods}");
        group.bench_function(BenchmarkId::new(name, format!("{threads} threads")), |b| {
            b.iter(|| pool.install(|| black_box(frame.expose(&engine))));
        });
    }
    group.finish();
}

criterion_group!(benches, frames);
criterion_main!(benches);
