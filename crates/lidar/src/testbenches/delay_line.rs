//! Testbench of HSLIDAR's delay lines: two macropixels of the array, far from where CLK comes in, with an even and an odd window
//! (thesis 4.9.3, 6.3.1, Fig. 88).
//!
//! ```text
//!   photon at an edge of a bin, and a femtosecond before it ─► SPAD_RAW ─► PHOTONS ─► taps ─► SAMPLE ─► HIT ─► histogram
//! ```
//!
//! What is expected is the window law's, whose edges are measured by static timing; what is found is counted by the gates.

use std::path::Path;

use crate::chip::{
    Exposure, Probe, Sensor, SensorConfig, SensorPins, WindowLaw, array, hslidar_delay_line, probes,
};
use crate::engine::GateSimulation;
use crate::engine::waveform::hits;
use crate::files::InputError;
use crate::kernel::Recorder;
use crate::photon::SpadEvent;
use crate::report::Checks;
use crate::testbenches::Testbench;
use crate::testbenches::rig::{self, record_exposure};
use crate::units::Time;
use crate::waves::{Entry, Layout, SignalGroup};

/// The column of the first macropixel.
const COLUMN: usize = 39;
/// Start values.
const STARTS: [u16; 2] = [6, 7];
/// CLK periods between two STOP edges.
const STOP_PERIODS: u32 = 16;

pub(super) const TESTBENCH: Testbench = Testbench {
    name: "tb_delay_line",
    about: "HSLIDAR's delay lines: bins edge by edge, photons that cancel, CLK that comes later",
    run,
    given: None,
};

fn run(waves: &Path, checks: &mut Checks) -> Result<(), InputError> {
    let sensor = Sensor::from(SensorConfig {
        rows: 1,
        ..(*hslidar_delay_line()).clone()
    });
    edges(waves, &sensor, checks)?;
    meetings(&sensor, checks);
    Ok(())
}

/// The law of the macropixel at a column.
fn law(sensor: &Sensor, exposure: &Exposure, col: usize) -> WindowLaw {
    WindowLaw::new(sensor, exposure).of_macropixel(col as u32)
}

/// A photon in each laser cycle: at an edge of a bin, or a femtosecond before it.
fn edges(waves: &Path, sensor: &Sensor, checks: &mut Checks) -> Result<(), InputError> {
    let cycles = 2 * (sensor.bins as u32 + 1);
    let exposure = Exposure::new(sensor, STOP_PERIODS, cycles);
    let lists: Vec<Vec<SpadEvent>> = (0..2)
        .map(|pixel| {
            let law = law(sensor, &exposure, COLUMN + pixel);
            let window = law.window(STARTS[pixel]).open().expect("it opens");
            let photon = |cycle: u32| SpadEvent {
                time: law.edges(&window, i64::from(cycle)).edges()[cycle as usize / 2]
                    - Time::from_fs(i64::from(cycle % 2)),
                spad: (cycle % 16) as u8,
            };
            (0..cycles).map(photon).collect()
        })
        .collect();
    let pulses: Vec<&[SpadEvent]> = lists.iter().map(Vec::as_slice).collect();
    let place = (0, COLUMN);
    let mut gate = GateSimulation::new(sensor, &exposure, place, (1, 2), &STARTS, &pulses);
    let local_stop = SensorPins::find(gate.netlist()).local_stop;
    let mut recorder = Recorder::new(local_stop.iter().copied());
    let origin = gate.schedule().origin;
    let view = view(sensor, &exposure, origin);
    record_exposure(&mut gate, waves, &view, &mut recorder)?;

    // Before the first edge nothing counts, nor at the last.
    let expected = vec![2u16; sensor.bins];
    let histograms = gate.histograms().ok();
    for (pixel, start) in STARTS.into_iter().enumerate() {
        let found = histograms.as_ref().map(|h| h[pixel].to_vec());
        checks.equal(
            format!("start value {start}: photons at every edge and 1 fs before it are in the bins after and before"),
            format!("{expected:?}"),
            format!("{:?}", found.unwrap_or_default()),
        );
    }
    let rises: Vec<Time> = local_stop
        .iter()
        .map(|&net| recorder.rising_edges(net)[0] - origin)
        .collect();
    let later = exposure.clock.period() + sensor.clk_skew(COLUMN + 1) - sensor.clk_skew(COLUMN);
    checks.times(
        "LOCAL_STOP, a start value and a column on",
        later,
        &[rises[1] - rises[0]],
    );
    for (pixel, start) in STARTS.into_iter().enumerate() {
        let law = law(sensor, &exposure, COLUMN + pixel);
        let edges = law.edges(&law.window(start).open().expect("it opens"), 0);
        let lengths: Vec<String> = (0..sensor.bins)
            .map(|bin| format!("{:.2}", edges.width(bin).as_ns()))
            .collect();
        checks.note(format!(
            "start value {start}, column {}: bins of {} ns",
            COLUMN + pixel,
            lengths.join(", ")
        ));
    }
    Ok(())
}

/// Two photons: in one bin, about an edge, and too close for the photon line.
fn meetings(sensor: &Sensor, checks: &mut Checks) {
    let exposure = Exposure::new(sensor, STOP_PERIODS, 1);
    let law = law(sensor, &exposure, COLUMN);
    let edges = law.edges(&law.window(STARTS[0]).open().expect("it opens"), 0);
    let edge = edges.edges()[4];
    let stage = law.timing().photon_line_stage;
    let femtosecond = Time::from_fs(1);
    for (what, times, bins) in [
        ("one photon", [edge, Time::MAX], &[4][..]),
        (
            "two in a bin cancel",
            [edge, edge + Time::from_ps(900)],
            &[],
        ),
        (
            "two on either side of an edge, an XOR's delay apart",
            [edge - femtosecond, edge - femtosecond + stage],
            &[3, 4],
        ),
        (
            "a femtosecond closer they leave no edge on the line",
            [edge - femtosecond, edge - femtosecond * 2 + stage],
            &[],
        ),
    ] {
        let pulses: Vec<SpadEvent> = (0..)
            .zip(times)
            .filter(|(_, time)| *time < exposure.end())
            .map(|(spad, time)| SpadEvent { time, spad })
            .collect();
        let counts = rig::counts(sensor, &exposure, (0, COLUMN), STARTS[0], &pulses);
        let counts = counts.unwrap_or_default().into_iter().enumerate();
        let found: Vec<usize> = counts.filter(|(_, n)| *n > 0).map(|(bin, _)| bin).collect();
        checks.equal(what, format!("bins {bins:?}"), format!("bins {found:?}"));
    }
}

fn view(sensor: &Sensor, exposure: &Exposure, origin: Time) -> Layout {
    let mut groups = vec![SignalGroup::new(
        "Global signals",
        [Entry::binary("CLK"), Entry::binary("STOP")],
    )];
    for (pixel, start) in STARTS.into_iter().enumerate() {
        let name = array::pixel_name(0, COLUMN + pixel);
        let taps = if start % 2 == 0 {
            Probe::EvenTap
        } else {
            Probe::OddTap
        };
        let signals = [
            Entry::binary(Probe::Clk.path(&name)),
            Entry::decimal(Probe::CounterOut.path(&name)),
            Entry::binary(Probe::LocalStop.path(&name)),
            Entry::hex(Probe::SpadRaw.path(&name)),
            Entry::binary(Probe::Photons.path(&name)),
            Entry::binary(taps.path(&name)),
            Entry::binary(Probe::SampleClk.path(&name)),
            Entry::binary(Probe::Strobe.path(&name)),
            hits(Probe::Hit.path(&name), sensor.bins),
        ];
        let bins = (0..sensor.bins).map(|bin| Entry::decimal(probes::bin_path(&name, bin)));
        groups.push(SignalGroup::new(
            format!("Column {}: {start}", COLUMN + pixel),
            signals.into_iter().chain(bins),
        ));
    }
    Layout::new(groups, (origin, origin + exposure.stop(1)), origin)
}
