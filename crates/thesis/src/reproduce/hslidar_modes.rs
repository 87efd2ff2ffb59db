//! Claim 29 and Table 10: bin interval a and window step s of HSLIDAR in either mode (thesis 4.9.3, Fig. 59), on the gates.
//!
//! ```text
//!   one photon, later by halves ─► gates ─► where its bin changes ─► edges of a bin       a
//!   start values n and n + 1 ────► gates ─► LOCAL_STOP ─► the time between them           s
//! ```

use super::claim::ClaimRow;
use super::delay_line;
use super::thesis::{claim, grid};
use crate::chip::{Exposure, Probe, Sensor, SensorConfig, WindowLaw, hslidar, hslidar_delay_line};
use crate::engine::GateSimulation;
use crate::kernel::Recorder;
use crate::numerics::intervals::mean_and_sigma;
use crate::photon::SpadEvent;
use crate::report::Grid;
use crate::units::Time;

/// CLK periods of a laser cycle: enough for the start values that are simulated.
const STOP_PERIODS: u32 = 60;
/// Start value whose bin is measured.
const START: u16 = 4;

/// One macropixel of a mode.
fn macropixel(sensor: &Sensor) -> SensorConfig {
    SensorConfig {
        rows: 1,
        cols: 1,
        ..SensorConfig::clone(sensor)
    }
}

/// The bin in which the gates count a photon at `time` after STOP.
fn bin_of(config: &SensorConfig, exposure: &Exposure, time: Time) -> Option<usize> {
    let pulse = [SpadEvent { time, spad: 0 }];
    let mut gate = GateSimulation::new(config, exposure, (0, 0), (1, 1), &[START], &[&pulse]);
    gate.run(&mut ());
    let counts = gate.histograms().ok()?.into_counts();
    counts.iter().position(|&count| count > 0)
}

/// Length of a bin in the middle of the window, between the photons that change their bin, to a femtosecond.
fn bin_interval(config: &SensorConfig) -> Time {
    let exposure = Exposure::new(config, STOP_PERIODS, 1);
    let law = WindowLaw::new(config, &exposure);
    let window = law.window(START).open().expect("it opens");
    let bin = config.bins / 2;
    let seen = law.edges(&window, 0);
    let middle = |bin: usize| Time::from_fs((seen.bin(bin).start + seen.bin(bin).end).as_fs() / 2);
    // The law only says where to look.
    let begins = |bin: usize| {
        let (mut before, mut after) = (middle(bin - 1), middle(bin));
        while (after - before).as_fs() > 1 {
            let time = Time::from_fs((before + after).as_fs() / 2);
            if bin_of(config, &exposure, time) == Some(bin) {
                after = time
            } else {
                before = time
            }
        }
        after
    };
    begins(bin + 1) - begins(bin)
}

/// From LOCAL_STOP of one start value to that of the next.
fn window_step(config: &SensorConfig) -> Time {
    let exposure = Exposure::new(config, STOP_PERIODS, 1);
    let local_stop = |start: u16| {
        let mut gate = GateSimulation::new(config, &exposure, (0, 0), (1, 1), &[start], &[&[]]);
        let net = gate.probes()[0].net(Probe::LocalStop);
        let mut recorder = Recorder::new([net]);
        gate.run(&mut recorder);
        recorder.rising_edges(net)[0]
    };
    local_stop(START + 1) - local_stop(START)
}

/// Bin interval and window step of each mode, and the CLK period.
struct Modes {
    clocked: (Time, Time, Time),
    lines: (Time, Time, Time),
}

impl Modes {
    fn measure() -> Self {
        let intervals = |sensor: &Sensor| {
            let config = macropixel(sensor);
            let period = config.clock().period();
            (bin_interval(&config), window_step(&config), period)
        };
        // An element of its own would be measured; all alike they are T_DL.
        let alike = SensorConfig {
            delay_sigma: 0.0,
            ..SensorConfig::clone(&hslidar_delay_line())
        };
        Modes {
            clocked: intervals(&hslidar()),
            lines: intervals(&alike.into()),
        }
    }
}

/// Claim 29: Table 10.
pub(super) fn rows() -> Vec<ClaimRow> {
    let claim = claim(29);
    let Modes { clocked, lines } = Modes::measure();
    let over = |time: Time, unit: Time| time.as_s() / unit.as_s();
    let element = hslidar_delay_line().delay_element();
    let window_s = clocked.0.as_s() * hslidar().bins as f64;
    let (mean_ns, _) = mean_and_sigma(&delay_line::lengths_ns());
    vec![
        claim.row("clocked_bin", over(clocked.0, clocked.2)),
        claim.row("clocked_step", over(clocked.1, clocked.2)),
        claim.row("overlap", 100.0 * (1.0 - clocked.1.as_s() / window_s)),
        claim.row("lines_bin", over(lines.0, element)),
        claim.row("lines_step", over(lines.1, lines.2)),
        claim.row("lines_bin_swept", mean_ns / element.as_ns()),
    ]
}

/// Table 10, with what the gates have.
pub(super) fn table_10() -> Grid {
    let Modes { clocked, lines } = Modes::measure();
    let mut grid = grid(10);
    for (mode, symbols, (bin, step, _)) in [
        ("clocked", ["1/CLK", "4/CLK"], clocked),
        ("delay line", ["T_DL", "1/CLK"], lines),
    ] {
        grid.push([
            mode.to_owned(),
            symbols[0].to_owned(),
            format!("{:.3}", bin.as_ns()),
            symbols[1].to_owned(),
            format!("{:.3}", step.as_ns()),
        ]);
    }
    grid
}
