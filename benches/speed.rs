//! How fast things run: the event kernel on one macropixel (net changes per second), elaboration and load of the
//! whole array, and the engines on one macropixel of an outdoor frame.

use std::hint::black_box;

use criterion::{Criterion, Throughput, criterion_group, criterion_main};
use guided_dtof::chip::{Exposure, SensorConfig, array};
use guided_dtof::engine::load::{load, load_netlist};
use guided_dtof::engine::{Cycle, GateSimulation, LaneSimulation, Replay, Window, stream_config};
use guided_dtof::netlist::Netlist;
use guided_dtof::photon::{PhotonStream, PixelLight, SpadEvent};
use guided_dtof::units::Time;

const STOP_PERIODS: u32 = 520;
const LASER_CYCLES: u32 = 100;
const START: u16 = 300;

fn stream(config: &SensorConfig, exposure: &Exposure) -> PhotonStream {
    PhotonStream::new(&stream_config(config, exposure, 1, Time::from_ps(1_900)))
}

const LIGHT: PixelLight = PixelLight::echo(1.0, Time::from_ns(765)).with_background(10e6);

fn photons(config: &SensorConfig, exposure: &Exposure) -> Vec<SpadEvent> {
    stream(config, exposure).pixel_events(0, &LIGHT).events
}

fn kernel(c: &mut Criterion) {
    let config = SensorConfig::default();
    let exposure = Exposure::new(&config, STOP_PERIODS, LASER_CYCLES);
    let pulses = photons(&config, &exposure);
    let prepare = || GateSimulation::new(&config, &exposure, (0, 0), (1, 1), &[START], &[&pulses]);
    let mut once = prepare();
    once.run(&mut ());
    let mut group = c.benchmark_group("kernel");
    group.sample_size(10);
    group.throughput(Throughput::Elements(once.statistics().changes));
    group.bench_function("one macropixel, net changes", |b| {
        b.iter(|| {
            let mut simulation = prepare();
            simulation.run(&mut ());
            black_box(simulation.statistics())
        });
    });
    let lanes: Vec<Vec<SpadEvent>> = (0..64)
        .map(|pixel| {
            stream(&config, &exposure)
                .pixel_events(pixel, &LIGHT)
                .events
        })
        .collect();
    let lanes: Vec<&[SpadEvent]> = lanes.iter().map(Vec::as_slice).collect();
    let starts: Vec<u16> = (0..64).map(|lane| lane * 8).collect();
    let prepare = || LaneSimulation::new(&config, &exposure, &starts, &lanes);
    let mut once = prepare();
    once.run(&mut ());
    group.throughput(Throughput::Elements(once.kernel.lane_changes()));
    group.bench_function("64 macropixels in lanes, net changes", |b| {
        b.iter(|| {
            let mut simulation = prepare();
            simulation.run(&mut ());
            black_box(simulation.kernel.events())
        });
    });
    group.finish();
}

fn array(c: &mut Criterion) {
    let config = SensorConfig::default();
    let starts: Vec<u16> = (0..config.pixels()).map(|i| i as u16 & 511).collect();
    let mut group = c.benchmark_group("64x64 array");
    group.sample_size(10);
    group.bench_function("elaborate", |b| {
        b.iter(|| black_box(Netlist::elaborate(&array::circuit(&config))).net_count());
    });
    let netlist = load_netlist(&config);
    group.bench_function("load at gate level", |b| {
        b.iter(|| black_box(load(&config, &netlist, &starts, &mut ())).statistics);
    });
    group.finish();
}

fn engines(c: &mut Criterion) {
    let config = SensorConfig::default();
    let exposure = Exposure::new(&config, STOP_PERIODS, LASER_CYCLES);
    let pulses = photons(&config, &exposure);
    let clk_periods = u64::from(STOP_PERIODS) * u64::from(LASER_CYCLES);
    let mut group = c.benchmark_group("macropixel-CLK");
    group.throughput(Throughput::Elements(clk_periods));
    let (cycle, window) = (
        Cycle::new(&config, &exposure),
        Window::new(&config, &exposure),
    );
    group.bench_function("cycle", |b| {
        b.iter(|| cycle.histogram(START, black_box(&pulses)))
    });
    group.bench_function("window", |b| {
        b.iter(|| window.histogram(START, black_box(&pulses)))
    });
    let stream = stream(&config, &exposure);
    group.bench_function("photon stream", |b| {
        b.iter(|| stream.pixel_events(0, black_box(&LIGHT)).drawn);
    });
    group.finish();
}

criterion_group!(benches, kernel, array, engines);
criterion_main!(benches);
