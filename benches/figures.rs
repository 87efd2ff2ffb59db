//! The gate engine's figures as `name value` lines, for `benches/compare/icarus.sh` to set beside Icarus Verilog's:
//! net changes per second on one core, elaboration by size of the array, cost of timing checks.
//! Best of several runs.
//!
//!   cargo bench --bench figures

use std::hint::black_box;
use std::time::Instant;

use guided_dtof::chip::{Exposure, SensorConfig, sensor};
use guided_dtof::engine::{GateSimulation, LaneSimulation, stream_config};
use guided_dtof::kernel::Policy;
use guided_dtof::netlist::Netlist;
use guided_dtof::photon::{PhotonStream, PixelLight, SpadEvent};
use guided_dtof::units::Time;

const RUNS: usize = 5;
const STOP_PERIODS: u32 = 520;
const LASER_CYCLES: u32 = 50;
const LANES: u16 = 64;

/// Shortest of several times, s, of what `run` does after `prepare`.
fn best<T>(prepare: impl Fn() -> T, run: impl Fn(&mut T)) -> f64 {
    let time = || {
        let mut prepared = prepare();
        let start = Instant::now();
        run(&mut prepared);
        start.elapsed().as_secs_f64()
    };
    (0..RUNS).map(|_| time()).fold(f64::INFINITY, f64::min)
}

fn main() {
    for side in [16, 32, 64] {
        let config = SensorConfig {
            rows: side,
            cols: side,
            ..SensorConfig::default()
        };
        let elaborate = || Netlist::elaborate(&sensor::circuit(&config));
        let cells = elaborate().cells().len();
        println!("cells_{side} {cells}");
        let seconds = best(|| (), |()| drop(black_box(elaborate())));
        println!("elaborate_{side}_s {seconds:.4}");
    }
    let config = SensorConfig::default();
    let exposure = Exposure::new(&config, STOP_PERIODS, LASER_CYCLES);
    let stream = PhotonStream::new(&stream_config(&config, &exposure, 1, Time::from_ps(1_900)));
    let light = PixelLight {
        signal_per_cycle: 1.0,
        arrival: Time::from_ns(765),
        background_hz: 10e6,
    };
    let photons: Vec<Vec<SpadEvent>> = (0..u32::from(LANES))
        .map(|pixel| stream.pixel_events(pixel, &light).events)
        .collect();
    let photons: Vec<&[SpadEvent]> = photons.iter().map(Vec::as_slice).collect();

    let one = || GateSimulation::new(&config, &exposure, (0, 0), (1, 1), &[300], &photons[..1]);
    let mut once = one();
    once.run(&mut ());
    let changes = once.statistics().changes as f64;
    let seconds = best(one, |gate| gate.run(&mut ()));
    println!("scalar_changes_per_s {:.4e}", changes / seconds);
    let checked = || {
        let gate = one();
        let checks = gate.timing_checks(Policy::ReportOnly);
        (gate, checks)
    };
    let with_checks = best(checked, |(gate, checks)| gate.run(checks));
    println!("checks_ratio {:.2}", with_checks / seconds);

    let starts: Vec<u16> = (0..LANES).map(|lane| lane * 8).collect();
    let together = || LaneSimulation::new(&config, &exposure, &starts, &photons);
    let mut once = together();
    once.run(&mut ());
    let changes = once.kernel().lane_changes() as f64;
    let seconds = best(together, |lanes| lanes.run(&mut ()));
    println!("lane_changes_per_s {:.4e}", changes / seconds);
}
