//! Testbench of HSLIDAR's counter TDC: what it makes of several photons in a bin, beside the shift register and delay lines, and how it
//! opens and ends its window (thesis 4.9.3, 2.4.3, Table 10).
//!
//! ```text
//!   photons ─► SPAD_RAW ─► SPAD_TIMED ─► EVENTS ─┐
//!   LOCAL_STOP ─► START ─► COUNTING ─► CODE ─► SELECTED ─► bins
//! ```
//!
//! Photons are placed by the window law. What is found is counted by the gates.

use std::path::Path;

use crate::chip::window_law::OpenWindow;
use crate::chip::{
    Exposure, Overflow, Probe, SensorConfig, Tdc, WindowLaw, array, hslidar, metdc_counter, probes,
};
use crate::engine::GateSimulation;
use crate::files::InputError;
use crate::kernel::Recorder;
use crate::photon::SpadEvent;
use crate::report::Checks;
use crate::testbenches::Testbench;
use crate::testbenches::rig::{self, record_exposure};
use crate::units::Time;
use crate::waves::{Entry, Layout, SignalGroup};

/// Start value.
const START: u16 = 3;
/// CLK periods between two STOP edges.
const STOP_PERIODS: u32 = 40;
/// Photons in the bins of the waveform.
const PHOTONS: [u8; 8] = [0, 1, 2, 3, 0, 16, 1, 5];

pub(super) const TESTBENCH: Testbench = Testbench {
    name: "tb_counter_tdc",
    about: "HSLIDAR's counter TDC: several photons in a bin, and its window from LOCAL_STOP on",
    run,
    given: None,
};

fn run(waves: &Path, checks: &mut Checks) -> Result<(), InputError> {
    let chip = chip(Tdc::Counter);
    window_by_window(waves, &chip, checks)?;
    beside_other_tdcs(checks);
    full_bins(&chip, checks);
    Ok(())
}

/// One macropixel of HSLIDAR with this TDC. Elements of delay lines are alike, and short enough for the clock.
fn chip(tdc: Tdc) -> SensorConfig {
    SensorConfig {
        rows: 1,
        cols: 1,
        tdc,
        delay_sigma: 0.0,
        delay_control_v: 0.6,
        ..(*hslidar()).clone()
    }
}

/// The law and its window.
fn window(config: &SensorConfig, exposure: &Exposure) -> (WindowLaw, OpenWindow) {
    let law = WindowLaw::new(config, exposure);
    let window = law.window(START).open().expect("it opens");
    (law, window)
}

/// The given number of photons in each bin of every laser cycle, a SPAD each, evenly over the bin.
fn photons(config: &SensorConfig, exposure: &Exposure, of_bins: &[u8]) -> Vec<SpadEvent> {
    let (law, window) = window(config, exposure);
    let mut pulses = Vec::new();
    for cycle in 0..i64::from(exposure.laser_cycles) {
        let edges = law.edges(&window, cycle);
        for (bin, &photons) in of_bins.iter().enumerate() {
            let places = i64::from(photons) + 1;
            let photon = |spad: u8| SpadEvent {
                time: edges.bin(bin).start
                    + Time::from_fs(edges.width(bin).as_fs() * i64::from(spad + 1) / places),
                // Neighbouring bins have SPADs of their own, as far as there are some.
                spad: (spad + 5 * bin as u8) % config.spads() as u8,
            };
            pulses.extend((0..photons).map(photon));
        }
    }
    pulses.sort_unstable();
    pulses
}

fn counts(config: &SensorConfig, exposure: &Exposure, pulses: &[SpadEvent]) -> Vec<u16> {
    rig::counts(config, exposure, (0, 0), START, pulses).unwrap_or_default()
}

/// Two laser cycles, watched CLK period by CLK period.
fn window_by_window(
    waves: &Path,
    config: &SensorConfig,
    checks: &mut Checks,
) -> Result<(), InputError> {
    let config = SensorConfig {
        // SPADs of a bin with all of them are ready again in the next one.
        dead_time_ns: 4.0,
        ..config.clone()
    };
    let exposure = Exposure::new(&config, STOP_PERIODS, 2);
    let (law, opens) = window(&config, &exposure);
    let pulses = photons(&config, &exposure, &PHOTONS);
    let mut gate = GateSimulation::new(&config, &exposure, (0, 0), (1, 1), &[START], &[&pulses]);
    let nets = |probe| gate.probes()[0].bus(probe).to_vec();
    let [local_stop, start, select] = [Probe::LocalStop, Probe::Start, Probe::Select].map(nets);
    let watched = [&local_stop[..], &start, &select].concat();
    let mut recorder = Recorder::new(watched.iter().copied());
    let origin = gate.schedule().origin;
    let edges = law.edges(&opens, 0);
    let shown = (
        origin + edges.edges()[0],
        origin + edges.edges()[config.bins],
    );
    let view = view(&config, shown, origin);
    record_exposure(&mut gate, waves, &view, &mut recorder)?;

    let cycles = exposure.laser_cycles;
    let expected = PHOTONS.map(|photons| u16::from(photons) * cycles as u16);
    checks.equal(
        format!("photons a laser cycle {PHOTONS:?}, {cycles} cycles: bins"),
        format!("{expected:?}"),
        format!(
            "{:?}",
            gate.histograms().map_or(Vec::new(), |h| h.into_counts())
        ),
    );
    let rises = |nets: &[_]| {
        let rises = recorder.rising_edges(nets[0]).into_iter();
        rises.map(|time| time - origin).collect::<Vec<Time>>()
    };
    checks.times(
        "LOCAL_STOP after STOP, by the law",
        opens.strobe_cause,
        &rises(&local_stop)[..1],
    );
    let timing = law.timing();
    checks.times(
        "START after STOP: LOCAL_STOP, strobe and clk-to-Q",
        opens.strobe_cause + timing.local_stop_to_strobe + timing.strobe_to_hit,
        &rises(&start)[..1],
    );
    // The model, edge by edge: START is high from the first edge of the window until the next STOP.
    let mut model = metdc_counter::MetdcCounterModel::new(config.bins);
    let (mut as_modelled, mut edges_seen) = (0, 0);
    for edge in 0..i64::from(STOP_PERIODS) {
        model.clock(edge >= opens.first_edge);
        let expected = model.selected().map_or(0, |bin| 1u64 << bin);
        let before_next = origin + exposure.rising(edge + 1) - Time::from_fs(1);
        let found = recorder.number_at(&select, before_next);
        as_modelled += u32::from(found == Some(expected));
        edges_seen += 1;
    }
    checks.equal(
        "CLK periods in which SELECTED is the model's",
        edges_seen,
        as_modelled,
    );
    Ok(())
}

/// Several photons in bin 3: the three TDCs.
fn beside_other_tdcs(checks: &mut Checks) {
    for (photons_in_bin, expected) in [(1u8, [1u16, 1, 1]), (2, [2, 1, 0]), (3, [3, 1, 1])] {
        for (tdc, expected) in [Tdc::Counter, Tdc::Clocked, Tdc::DelayLine]
            .into_iter()
            .zip(expected)
        {
            let config = chip(tdc);
            let exposure = Exposure::new(&config, STOP_PERIODS, 1);
            let pulses = photons(&config, &exposure, &[0, 0, 0, photons_in_bin]);
            let mut bins = vec![0; config.bins];
            bins[3] = expected;
            checks.equal(
                format!(
                    "photons in bin 3 of a laser cycle: {photons_in_bin}, tdc = {:?}: bins",
                    tdc.name()
                ),
                format!("{bins:?}"),
                format!("{:?}", counts(&config, &exposure, &pulses)),
            );
        }
    }
}

/// More photons than a small bin holds, the last ones together.
fn full_bins(config: &SensorConfig, checks: &mut Checks) {
    for (overflow, expected) in [(Overflow::Saturate, 15), (Overflow::Wrap, 2)] {
        let config = SensorConfig {
            bin_bits: 4,
            overflow,
            ..config.clone()
        };
        let exposure = Exposure::new(&config, STOP_PERIODS, 3);
        let pulses = photons(&config, &exposure, &[6]);
        let found = counts(&config, &exposure, &pulses);
        checks.equal(
            format!(
                "18 photons, 6 at once, in a bin of 4 bits, overflow = {:?}",
                overflow.name()
            ),
            expected,
            found.first().copied().unwrap_or(0),
        );
    }
}

fn view(config: &SensorConfig, shown: (Time, Time), origin: Time) -> Layout {
    let pixel = array::pixel_name(0, 0);
    let window = [
        Entry::binary(Probe::LocalStop.path(&pixel)),
        Entry::binary(Probe::Start.path(&pixel)),
        Entry::binary(Probe::Counting.path(&pixel)),
        Entry::decimal(Probe::Code.path(&pixel)),
        Entry::binary(Probe::Select.path(&pixel)),
    ];
    let events = [
        Entry::hex(Probe::SpadRaw.path(&pixel)),
        Entry::hex(Probe::SpadTimed.path(&pixel)),
        Entry::decimal(Probe::Events.path(&pixel)),
    ];
    let bins = (0..config.bins).map(|bin| Entry::decimal(probes::bin_path(&pixel, bin)));
    let period = config.clock().period();
    let groups = vec![
        SignalGroup::new(
            "Global signals",
            [Entry::binary("CLK"), Entry::binary("STOP")],
        ),
        SignalGroup::new(format!("Window of start value {START}"), window),
        SignalGroup::new("Events", events.into_iter().chain(bins)),
    ];
    Layout::new(groups, (shown.0 - period * 2, shown.1 + period * 3), origin)
}
