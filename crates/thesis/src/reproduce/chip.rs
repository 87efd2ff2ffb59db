//! Claims 2 to 6: what the thesis says of the chip, measured on its netlist.

use super::claim::ClaimRow;
use super::thesis::{chart, claim};
use crate::analysis::{MacropixelTiming, gate_works, phases, ripple, shortest_period};
use crate::chip::readout::{self as readout_blocks, ReadoutOrder};
use crate::chip::{
    Exposure, Limits, PCounter, Probe, SensorConfig, Silicon, p_counter, p_counter_timing,
};
use crate::engine::readout::{PinNetlists, PinTimes, sparse_counts};
use crate::engine::{GateSimulation, Histograms};
use crate::kernel::Recorder;
use crate::netlist::{CellKind, Corner};
use crate::photon::SpadEvent;
use crate::report::Chart;
use crate::units::Time;

/// CLK periods in a laser cycle of the gate-level runs.
const STOP_PERIODS: u32 = 64;

/// Typical corner, 50 °C.
const NOMINAL: Silicon = Silicon::nominal(Corner::Typ);

/// Edges of one macropixel during its second laser cycle at gate level.
struct Edges {
    /// Rising STOP.
    stop: Time,
    /// Rising COUNTER_CLK once COUNTER_RESET has fallen.
    counter_clk: Vec<Time>,
    /// Falling CLK.
    clk_falls: Vec<Time>,
    /// Rising LOCAL_STOP, once per laser cycle.
    local_stop: Vec<Time>,
}

impl Edges {
    fn simulate(start: u16) -> Self {
        let config = SensorConfig {
            rows: 1,
            cols: 1,
            ..SensorConfig::default()
        };
        let exposure = Exposure::new(&config, STOP_PERIODS, 3);
        let mut simulation =
            GateSimulation::new(&config, &exposure, (0, 0), (1, 1), &[start], &[&[]]);
        let probes = [
            Probe::CounterReset,
            Probe::CounterClk,
            Probe::Clk,
            Probe::LocalStop,
        ];
        let nets = probes.map(|probe| simulation.probes()[0].net(probe));
        let mut recorder = Recorder::new(nets);
        simulation.run(&mut recorder);
        let cycle = simulation.schedule().origin + exposure.stop(1);
        let span = cycle..cycle + exposure.stop(1);
        let within = |times: Vec<Time>| -> Vec<Time> {
            times.into_iter().filter(|t| span.contains(t)).collect()
        };
        let released = within(recorder.falling_edges(nets[0]));
        let counts = |t: &Time| released.first().is_some_and(|release| t > release);
        let mut counter_clk = within(recorder.rising_edges(nets[1]));
        counter_clk.retain(counts);
        Edges {
            stop: cycle,
            counter_clk,
            clk_falls: within(recorder.falling_edges(nets[2])),
            local_stop: within(recorder.rising_edges(nets[3])),
        }
    }

    /// How many COUNTER_CLK edges it takes LOCAL_STOP to rise.
    fn edges_to_local_stop(&self) -> f64 {
        match self.local_stop[..] {
            [rise] => self.counter_clk.iter().filter(|&&t| t < rise).count() as f64,
            _ => f64::NAN,
        }
    }

    /// From the falling CLK edge that rolls the counter over to LOCAL_STOP, ns.
    fn ripple_ns(&self) -> f64 {
        match self.local_stop[..] {
            [rise] => {
                let fall = self.clk_falls.iter().rev().find(|&&t| t < rise);
                fall.map_or(f64::NAN, |&fall| (rise - fall).as_ns())
            }
            _ => f64::NAN,
        }
    }
}

/// Claim 2: the ripple, and the CLK period it allows.
pub(super) fn ripple_rows() -> Vec<ClaimRow> {
    let claim = claim(2);
    let config = SensorConfig::default();
    let timing = MacropixelTiming::analyse(&config, &NOMINAL, Limits::Ignored, (0, 0));
    let starts = [0, 1, 5, 21, 31, 42, 52, 60];
    let simulated = starts
        .map(|start| Edges::simulate(start).ripple_ns())
        .into_iter()
        .fold(f64::NEG_INFINITY, f64::max);
    let slow = Time::from_ns(20);
    let ns = |time: Option<Time>| time.map_or(f64::NAN, Time::as_ns);
    let gates = gate_works(&config, &NOMINAL, Limits::Ignored, 0);
    let by_gates = shortest_period(slow, |p| gates((p, Time::ZERO)));
    let by_paths = shortest_period(slow, |p| timing.works(p, Time::ZERO));
    let below = timing.forbidden(0).0 - Time::from_ps(2);
    let any_phase = shortest_period(below, |p| phases(p).any(|phase| timing.works(p, phase)));
    vec![
        claim.row("longest_path", timing.ripple.delay().as_ns()),
        claim.row("gate_level", simulated),
        claim.row("twice", 2.0 * timing.ripple.delay().as_ns()),
        claim.row("period_static", ns(by_paths)),
        claim.row("period_gate_level", ns(by_gates)),
        claim.row("period_best_phase", ns(any_phase)),
    ]
}

/// Fig. 56's question: the ripple against the number of stages.
pub(super) fn figure_56() -> Chart {
    let delays: Vec<(usize, Time, Time)> = (1..=12)
        .map(|bits| {
            let found = ripple(&counter_of(bits), &NOMINAL);
            (bits, found.longest_path, found.latest)
        })
        .collect();
    let points = |pick: fn(&(usize, Time, Time)) -> Time| {
        let points: Vec<(f64, f64)> = delays
            .iter()
            .map(|d| (d.0 as f64, pick(d).as_ns()))
            .collect();
        points
    };
    chart(56)
        .line("longest path", points(|d| d.1))
        .points("simulated", points(|d| d.2))
        .dashed("published worst case (from CLK)", [(0.0, 1.2), (13.0, 1.2)])
}

/// Claim 3: Fig. 54.
pub(super) fn fig_54_rows() -> Vec<ClaimRow> {
    let claim = claim(3);
    let edges = Edges::simulate(5);
    let after_stop = edges
        .counter_clk
        .first()
        .map_or(f64::NAN, |&t| (t - edges.stop).as_ns());
    vec![
        claim.row("edges_to_local_stop", edges.edges_to_local_stop()),
        claim.row("rises", edges.local_stop.len() as f64),
        claim.row("first_edge", after_stop),
    ]
}

/// Claim 4: Fig. 48.
pub(super) fn fig_48_rows() -> Vec<ClaimRow> {
    let claim = claim(4);
    let period = SensorConfig::default().clock().period();
    let [first, second] = [52, 49].map(|start| {
        let edges = Edges::simulate(start);
        let rise = edges.local_stop.first().copied();
        rise.map_or(f64::NAN, |t| (t - edges.stop).as_ns() / period.as_ns())
    });
    let bins = fig_48_bins();
    let peak = |counts: &[u16]| {
        counts
            .iter()
            .position(|&n| n > 0)
            .map_or(f64::NAN, |bin| bin as f64)
    };
    vec![
        claim.row("earlier", first - second),
        claim.row("bins_moved", peak(&bins[1]) - peak(&bins[0])),
    ]
}

fn fig_48_bins() -> Histograms {
    let config = SensorConfig {
        rows: 1,
        cols: 2,
        ..SensorConfig::default()
    };
    let exposure = Exposure::new(&config, STOP_PERIODS, 2);
    let photon = SpadEvent {
        time: exposure.rising(42) - Time::from_ns(1),
        spad: 6,
    };
    let mut simulation = GateSimulation::new(
        &config,
        &exposure,
        (0, 0),
        (1, 2),
        &[52, 49],
        &[&[photon], &[photon]],
    );
    simulation.run(&mut ());
    let histograms = simulation.histograms();
    histograms.expect("counts are known after a reset")
}

/// Claim 5: the serial load, and the readout that it must not outlast.
pub(super) fn load_rows() -> Vec<ClaimRow> {
    let claim = claim(5);
    let config = SensorConfig::default();
    let netlists = PinNetlists::new(&config);
    let counts = sparse_counts(&config);
    let all = PIN_CLOCKS_MHZ.map(|mhz| netlists.run_at(mhz, &config, &counts));
    let worst = all
        .iter()
        .map(|times| times.load.as_s() / times.read.as_s());
    let worst = worst.fold(f64::NEG_INFINITY, f64::max);
    let fewest_right = |pick: fn(&PinTimes) -> usize| all.iter().map(pick).min().unwrap_or(0);
    let pins = ReadoutOrder::new(&config).pins() as f64;
    let at_200 = &all[3];
    debug_assert_eq!(PIN_CLOCKS_MHZ[3], 200);

    let mut rows = vec![
        claim.row("bits", at_200.load_bits as f64 / 1e3),
        claim.row(
            "starts_right",
            fewest_right(|times| times.starts_right) as f64,
        ),
        claim.row("load_200_mhz", at_200.load.as_s() * 1e6),
        claim.row(
            "counts_right",
            fewest_right(|times| times.counts_right) as f64,
        ),
        claim.row("readout_200_mhz", at_200.read.as_s() * 1e6),
        claim.row("load_over_readout", worst),
        claim.row("pins", pins * at_200.read.as_s() / at_200.load.as_s()),
    ];
    for (mhz, times) in PIN_CLOCKS_MHZ.iter().zip(&all) {
        if *mhz != 200 {
            let load = times.load.as_s() * 1e6;
            rows.push(claim.row(&format!("load_{mhz}_mhz"), load));
            let readout = times.read.as_s() * 1e6;
            rows.push(claim.row(&format!("readout_{mhz}_mhz"), readout));
        }
    }
    rows
}

/// Clocks of load and readout that the whole array is run at.
const PIN_CLOCKS_MHZ: [u32; 6] = [50, 100, 150, 200, 300, 400];

/// A P-counter of `bits` stages.
fn counter_of(bits: usize) -> SensorConfig {
    SensorConfig {
        counter_bits: bits,
        ..SensorConfig::default()
    }
}

/// Claim 6: transistors.
pub(super) fn area_rows() -> Vec<ClaimRow> {
    let claim = claim(6);
    let flip_flop = f64::from(CellKind::Dffr.transistors());
    let stage = PCounter::Ripple.stage_transistors() as f64;
    let stages = PCounter::ALL.map(|p_counter| {
        let what = format!("transistors of {}", p_counter.row().stage);
        let found = ClaimRow::ours(what, "", p_counter.stage_transistors() as f64);
        match p_counter {
            PCounter::SetReset => found.remark("Fig. 51b, the HSLIDAR's."),
            _ => found,
        }
    });
    let config = SensorConfig {
        rows: 1,
        cols: 1,
        ..SensorConfig::default()
    };
    let macropixel = crate::chip::macropixel::circuit(&config).transistors() as f64;
    let counter = p_counter::circuit(&config).transistors() as f64;
    let timing =
        p_counter_timing::circuit(config.after_borrow, config.reset_buffers()).transistors() as f64;
    let selection = readout_blocks::bin_select(config.bins, config.bin_bits).transistors() as f64;
    let library = f64::from(CellKind::Dffsr.transistors());
    let mut rows = vec![
        claim.row("beyond_flip_flops", stage - 2.0 * flip_flop),
        claim.row("or_gate", f64::from(CellKind::Or2.transistors())),
    ];
    rows.extend(stages);
    let without_readout = 100.0 * (counter + timing) / (macropixel - selection);
    rows.extend([
        claim.row("library_flip_flop", library / flip_flop),
        claim.row("share", 100.0 * (counter + timing) / macropixel),
        claim.row("share_without_readout", without_readout),
    ]);
    rows
}
