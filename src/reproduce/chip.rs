//! Claims 2 to 6: what the thesis says of the chip, measured on its netlist.

use super::claim::Row;
use super::published::Published::*;
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
use crate::report::{Axis, Chart, Style};
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
    fn of(start: u16) -> Self {
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
pub(super) fn ripple_rows() -> Vec<Row> {
    let config = SensorConfig::default();
    let timing = MacropixelTiming::of(&config, &NOMINAL, Limits::Ignored, (0, 0));
    let starts = [0, 1, 5, 21, 31, 42, 52, 60];
    let simulated = starts
        .map(|start| Edges::of(start).ripple_ns())
        .into_iter()
        .fold(f64::NEG_INFINITY, f64::max);
    let slow = Time::from_ns(20);
    let ns = |time: Option<Time>| time.map_or(f64::NAN, Time::as_ns);
    let by_gates = shortest_period(slow, |p| {
        gate_works(&config, &NOMINAL, Limits::Ignored, (p, Time::ZERO), 0)
    });
    let by_paths = shortest_period(slow, |p| timing.works(p, Time::ZERO));
    let below = timing.forbidden(0).0 - Time::from_ps(2);
    let any_phase = shortest_period(below, |p| phases(p).any(|phase| timing.works(p, phase)));
    vec![
        Row::holds("worst ripple, longest path", "ns", Exactly("1.2"), timing.ripple.delay().as_ns())
            .given("The library's delays are chosen to meet it.")
            .remark("CLK falling to LOCAL_STOP, typical, 50 °C."),
        Row::holds("worst ripple, gate level", "ns", Exactly("1.2"), simulated)
            .given("The same delays, simulated.")
            .remark("The worst of eight start values; rolling over toggles every stage of each."),
        Row::holds("twice the ripple", "ns", Exactly("2.4"), 2.0 * timing.ripple.delay().as_ns())
            .given("As the ripple."),
        Row::holds("shortest CLK period, static", "ns", Within("2.4", 0.2), ns(by_paths))
            .remark("STOP on CLK's falling edge; “around 2.4 ns (~400 MHz)”. The ripple is put in; that a period takes twice as long is the circuit's own."),
        Row::holds("shortest CLK period, gate level", "ns", Within("2.4", 0.2), ns(by_gates))
            .remark("The shortest period from which on every pattern is counted as at a slow clock."),
        Row::ours("shortest CLK period at the best STOP phase", "ns", ns(any_phase))
            .remark("Static; beyond the crossing near the period above, which no phase moves."),
    ]
}

/// Fig. 56's question: the ripple against the number of stages.
pub(super) fn figure_56() -> Vec<Chart> {
    let delays: Vec<(usize, Time, Time)> = (1..=12)
        .map(|bits| {
            let (longest, simulated) = ripple(&counter_of(bits), &NOMINAL);
            (bits, longest, simulated)
        })
        .collect();
    let points = |pick: fn(&(usize, Time, Time)) -> Time| {
        let points: Vec<(f64, f64)> = delays
            .iter()
            .map(|d| (d.0 as f64, pick(d).as_ns()))
            .collect();
        points
    };
    vec![
        Chart::new(
            "Ripple from COUNTER_CLK to LOCAL_STOP, typical corner, 50 °C",
            Axis::linear("programmable stages").between(0.0, 13.0),
            Axis::linear("delay (ns)").between(0.0, 1.6),
        )
        .with("longest path", Style::Line, points(|d| d.1))
        .with("simulated", Style::Points, points(|d| d.2))
        .with(
            "published worst case (from CLK)",
            Style::Dashed,
            [(0.0, 1.2), (13.0, 1.2)],
        ),
    ]
}

/// Claim 3: Fig. 54.
pub(super) fn fig_54_rows() -> Vec<Row> {
    let edges = Edges::of(5);
    let after_stop = edges
        .counter_clk
        .first()
        .map_or(f64::NAN, |&t| (t - edges.stop).as_ns());
    vec![
        Row::holds("COUNTER_CLK edges from STOP to LOCAL_STOP, start value 5", "", Says("transitions high on the next COUNTER_CLK edge", 6.0, 6.0), edges.edges_to_local_stop())
            .remark("The text: zero after five edges, LOCAL_STOP on the next. The figure's caption says “after every 5 × CLK cycles”."),
        Row::holds("rises of LOCAL_STOP in a laser cycle", "", Says("The next rising edge of the global STOP signal resets the counter", 1.0, 1.0), edges.local_stop.len() as f64),
        Row::ours("first COUNTER_CLK edge that counts, after STOP", "ns", after_stop)
            .remark("COUNTER_CLK is NOT CLK: the edge that comes together with STOP is swallowed by the reset."),
    ]
}

/// Claim 4: Fig. 48.
pub(super) fn fig_48_rows() -> Vec<Row> {
    let period = SensorConfig::default().clock().period();
    let [first, second] = [52, 49].map(|start| {
        let edges = Edges::of(start);
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
        Row::holds(
            "LOCAL_STOP of start value 49 before that of 52",
            "CLK periods",
            Within("3", 1e-6),
            first - second,
        ),
        Row::holds(
            "bins by which the same photon moves",
            "",
            Exactly("3"),
            peak(&bins[1]) - peak(&bins[0]),
        )
        .remark("One photon in both macropixels, histograms read at gate level."),
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
pub(super) fn load_rows() -> Vec<Row> {
    let config = SensorConfig::default();
    let netlists = PinNetlists::of(&config);
    let counts = sparse_counts(&config);
    let all = PIN_CLOCKS_MHZ.map(|mhz| netlists.run_at(mhz, &config, &counts));
    let worst = all
        .iter()
        .map(|times| times.load.as_s() / times.read.as_s());
    let worst = worst.fold(f64::NEG_INFINITY, f64::max);
    let fewest_right = |pick: fn(&PinTimes) -> usize| all.iter().map(pick).min().unwrap_or(0);
    let pins = ReadoutOrder::of(&config).pins() as f64;
    let at_200 = &all[3];
    debug_assert_eq!(PIN_CLOCKS_MHZ[3], 200);

    let mut rows = vec![
        Row::holds("bits of a load", "kbit", Exactly("36.9"), at_200.load_bits as f64 / 1e3)
            .remark("Rising LOAD_CLK edges at gate level."),
        Row::holds(
            "start values that arrive",
            "",
            Says("all pixel counters", 4096.0, 4096.0),
            fewest_right(|times| times.starts_right) as f64,
        )
        .remark("Through deserialiser, row scanner and memories at gate level, at the worst of six clocks from 50 to 400 MHz."),
        Row::holds(
            "time of a load at 200 MHz",
            "µs",
            Says("a few hundred microseconds", 100.0, 999.0),
            at_200.load.as_s() * 1e6,
        )
        .remark("First to last LOAD_CLK edge, and a period. At “a few hundred megahertz”, of which 200 is our choice."),
        Row::ours(
            "counts that leave through the pins right, of 65536",
            "",
            fewest_right(|times| times.counts_right) as f64,
        )
        .remark("Bin selection, columns and serialisers of the whole array at gate level, at the worst of the six clocks."),
        Row::ours("time of a readout at 200 MHz", "µs", at_200.read.as_s() * 1e6)
            .remark("Through 8 pins, our choice, each with the serialiser of 8 columns."),
        Row::holds("load over readout", "", Says("not expected to ever impact the time required to capture a dToF frame", 0.0, 1.0), worst)
            .remark("The greatest at the six clocks; both at gate level, at the same clock, with one pin for the load and 8 for the readout."),
        Row::ours("pins of a readout as short as the load", "", pins * at_200.read.as_s() / at_200.load.as_s())
            .remark("9 bits against 16 × 14 a macropixel: a chip with more output pins than this at the same clock would wait for the load."),
    ];
    for (mhz, times) in PIN_CLOCKS_MHZ.iter().zip(&all) {
        if *mhz != 200 {
            let load = format!("time of a load at {mhz} MHz");
            rows.push(Row::ours(load, "µs", times.load.as_s() * 1e6));
            let readout = format!("time of a readout at {mhz} MHz");
            rows.push(Row::ours(readout, "µs", times.read.as_s() * 1e6));
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

/// Transistors that one more stage of a P-counter takes.
fn stage_transistors(p_counter: PCounter) -> f64 {
    let of = |bits| {
        let config = SensorConfig {
            p_counter,
            ..counter_of(bits)
        };
        p_counter::circuit(&config).transistors() as f64
    };
    of(9) - of(8)
}

/// Claim 6: transistors.
pub(super) fn area_rows() -> Vec<Row> {
    let flip_flop = f64::from(CellKind::Dffr.transistors());
    let stage = stage_transistors(PCounter::Ripple);
    let config = SensorConfig {
        rows: 1,
        cols: 1,
        ..SensorConfig::default()
    };
    let macropixel = crate::chip::macropixel::circuit(&config).transistors() as f64;
    let counter = p_counter::circuit(&config).transistors() as f64;
    let timing = p_counter_timing::circuit(config.after_borrow).transistors() as f64;
    let selection = readout_blocks::bin_select(config.bins, config.bin_bits).transistors() as f64;
    let library = f64::from(CellKind::Dffsr.transistors());
    vec![
        Row::holds("transistors of a stage beyond its two flip-flops", "", Exactly("4"), stage - 2.0 * flip_flop)
            .given("The library's mux has 4 transistors.")
            .remark("The difference between P-counters of nine and eight stages: nothing but the mux comes on top."),
        Row::holds("transistors of an OR gate that the mux replaces", "", Exactly("6"), f64::from(CellKind::Or2.transistors()))
            .given("A number of the library's table."),
        Row::ours("transistors of a stage", "", stage),
        Row::ours("transistors of a stage of set/reset flip-flops", "", stage_transistors(PCounter::SetReset))
            .remark("Fig. 51b, the HSLIDAR's."),
        Row::ours("transistors of a synchronous stage", "", stage_transistors(PCounter::Synchronous)),
        Row::ours("transistors of a stage with a comparator", "", stage_transistors(PCounter::Comparator)),
        Row::holds("library flip-flop over the custom one", "", Within("3", 0.5), library / flip_flop)
            .differs("The published ratio is one of layout areas (Fig. 52); in transistors it is 36 to 24, and the model has no layout."),
        Row::holds("P-counter and its timing, share of the macropixel", "%", AtMost("5"), 100.0 * (counter + timing) / macropixel)
            .differs("By transistors of the modelled macropixel; the published share is one of layout area (Fig. 55), and the model has no layout.")
            .remark("By transistors of the netlist, the macropixel's part of the readout among them; the published share is one of layout area (Fig. 55)."),
        Row::ours("the same without the macropixel's part of the readout", "%", 100.0 * (counter + timing) / (macropixel - selection))
            .remark("Gates select a bin here, where a chip may have fewer transistors on a bus."),
    ]
}
