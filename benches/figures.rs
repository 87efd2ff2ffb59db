//! The gate engine's own figures, which `benches/compare/icarus.sh` prints below its table: net changes per second on one
//! core, elaboration by size of the array, cost of timing checks. Processor time; least, median and most of the runs.
//!
//!   cargo bench --bench figures

use std::hint::black_box;

use cpu_time::ProcessTime;
use guided_dtof::chip::{Exposure, SensorConfig, array};
use guided_dtof::engine::{GateSimulation, LaneSimulation, stream_config};
use guided_dtof::kernel::Policy;
use guided_dtof::netlist::Netlist;
use guided_dtof::photon::{PhotonStream, PixelLight, SpadEvent};
use guided_dtof::units::Time;

const RUNS: usize = 5;
const STOP_PERIODS: u32 = 520;
const LASER_CYCLES: u32 = 50;
const LANES: u16 = 64;

/// Processor seconds of what `run` does after `prepare`, in ascending order.
fn seconds<T>(prepare: impl Fn() -> T, run: impl Fn(&mut T)) -> [f64; RUNS] {
    let mut seconds = [(); RUNS].map(|()| {
        let mut prepared = prepare();
        let clock = ProcessTime::now();
        run(&mut prepared);
        clock.elapsed().as_secs_f64()
    });
    seconds.sort_by(f64::total_cmp);
    seconds
}

/// One line: least, median and most of what `value` makes of each run's seconds.
fn print(what: &str, seconds: &[f64; RUNS], value: impl Fn(f64) -> f64) {
    let mut values = seconds.map(value);
    values.sort_by(f64::total_cmp);
    println!(
        "{what}: {:.2} {:.2} {:.2}",
        values[0],
        values[RUNS / 2],
        values[RUNS - 1]
    );
}

fn main() {
    for side in [16, 32, 64] {
        let config = SensorConfig {
            rows: side,
            cols: side,
            ..SensorConfig::default()
        };
        let elaborate = || Netlist::elaborate(&array::circuit(&config));
        let cells = elaborate().cells().len() as f64;
        let seconds = seconds(|| (), |()| drop(black_box(elaborate())));
        print(
            &format!("elaboration of {side}x{side}, ns a cell"),
            &seconds,
            |s| 1e9 * s / cells,
        );
    }
    let config = SensorConfig::default();
    let exposure = Exposure::new(&config, STOP_PERIODS, LASER_CYCLES);
    let stream = PhotonStream::new(&stream_config(&config, &exposure, 1, Time::from_ps(1_900)));
    let light = PixelLight::echo(1.0, Time::from_ns(765)).with_background(10e6);
    let photons: Vec<Vec<SpadEvent>> = (0..u32::from(LANES))
        .map(|pixel| stream.pixel_events(pixel, &light).events)
        .collect();
    let photons: Vec<&[SpadEvent]> = photons.iter().map(Vec::as_slice).collect();

    let one = || GateSimulation::new(&config, &exposure, (0, 0), (1, 1), &[300], &photons[..1]);
    let mut once = one();
    once.run(&mut ());
    let changes = once.statistics().changes as f64;
    let unchecked = seconds(one, |gate| gate.run(&mut ()));
    let million = |changes: f64| move |seconds: f64| 1e-6 * changes / seconds;
    print(
        "one macropixel, M net changes/s",
        &unchecked,
        million(changes),
    );
    let checked = || {
        let gate = one();
        let checks = gate.timing_checks(Policy::ReportOnly);
        (gate, checks)
    };
    let with_checks = seconds(checked, |(gate, checks)| gate.run(checks));
    let median = unchecked[RUNS / 2];
    print("timing checks, times as long", &with_checks, |s| s / median);

    let starts: Vec<u16> = (0..LANES).map(|lane| lane * 8).collect();
    let together = || LaneSimulation::new(&config, &exposure, &starts, &photons);
    let mut once = together();
    once.run(&mut ());
    let changes = once.kernel.lane_changes() as f64;
    let together = seconds(together, |lanes| lanes.run(&mut ()));
    print(
        "64 macropixels in lanes, M net changes/s",
        &together,
        million(changes),
    );
}
