//! How fast the chip can be clocked: static timing of a macropixel beside what the event kernel does.
//!
//! ```text
//!   CLK falls ─► COUNTER_CLK ─► ripple ─► LOCAL_STOP ─► STROBE      must come before
//!   CLK rises (T/2 later) ─► SHIFT changes                          ⇒ T ≥ 2 (strobe − clk-to-Q)
//!   CLK rises ─► SPAD_TIMED ─► SPAD_EVENT                           must come before the next CLK rise
//! ```
//!
//! A period *works* when the histogram is the one of a slow clock: bin b holds the photons taken by rising
//! CLK edge start − bins + b. The counter counts falling CLK edges, so a STOP phase does not move the strobe
//! against CLK. It can only make the counter start one edge earlier, once STOP leads CLK's fall by more than
//! the reset pulse lasts, and so undo a shift by one whole bin: a period near the crossing itself stays
//! forbidden at every phase.

use super::gate::GateSimulation;
use crate::chip::p_counter::Rises;
use crate::chip::{Exposure, PCounter, SensorConfig, WindowLaw, p_counter, sensor};
use crate::kernel::{Drive, Kernel, Recorder, merge};
use crate::netlist::{Bound, Edge, NetId, Netlist, Path, StaticTiming, Timing};
use crate::photon::SpadEvent;
use crate::units::{Frequency, Time};

/// Delays for a netlist: the corner, derating and mismatch that a report is about.
pub type Delays<'a> = &'a dyn Fn(&Netlist) -> Timing;

/// Static windows of one macropixel, all from the edge named first.
#[derive(Debug, Clone)]
pub struct MacropixelTiming {
    /// CLK falls → LOCAL_STOP rises: the ripple delay of the thesis (4.6, Fig. 56), with its path.
    pub ripple: Path,
    /// CLK falls → STROBE rises, longest.
    pub strobe: Time,
    /// CLK rises → SHIFT changes, shortest.
    pub shift: Time,
    /// CLK rises → SPAD_EVENT settled, with its path.
    pub event: Path,
    /// CLK falls → COUNTER_CLK rises, shortest.
    pub counter_clk: Time,
    /// STOP rises → COUNTER_RESET rises, shortest and longest.
    pub reset: (Time, Time),
    /// STOP rises → COUNTER_RESET falls, shortest and longest.
    pub release: (Time, Time),
    /// COUNTER_CLK rises → what the next count samples has settled, longest.
    pub count: Time,
    /// Whether the first count is the first one that ENABLE lets through, and not the first after a reset.
    counts_at_once: bool,
    /// COUNTER_RESET rises → the last edge it can send into a stage's clock, longest.
    pub reset_to_stage_clock: Time,
    /// COUNTER_RESET rises → LOCAL_STOP falls → COUNTER_CLK rises, longest.
    pub reset_to_counter_clk: Time,
}

impl MacropixelTiming {
    /// Analyses a macropixel of this sensor.
    pub fn of(config: &SensorConfig, delays: Delays<'_>) -> Self {
        // The very netlist that the gate engine simulates, so that a cell's mismatch is the same in both.
        let netlist = Netlist::elaborate(&sensor::window(config, (0, 0), (1, 1)));
        let pixel = sensor::pixel_name(0, 0);
        let timing = delays(&netlist);
        let analysis = StaticTiming::new(&netlist, &timing);
        let bus = |name: &str| {
            let nets = netlist.signal(&format!("{pixel}.{name}"));
            nets.expect("a signal of the macropixel")
        };
        let net = |name: &str| bus(name)[0];
        // LOCAL_STOP blocks COUNTER_CLK, and FULL blocks a bin's clock: both loops are cut, as is the reset.
        let after = |from: &str, edge, cuts: &[NetId]| {
            let arrivals = analysis.arrivals(&[(net(from), edge)], cuts);
            arrivals.expect("every loop is cut")
        };
        let block = net("p_counter_timing.BLOCK");
        let hits = bus("HIT");
        // ENABLE changes with STOP, but only before the first and after the last laser cycle.
        let cuts: Vec<NetId> = hits.into_iter().chain([block, net("ENABLE")]).collect();
        let fall = after("CLK", Edge::Fall, &cuts);
        let rise = after("CLK", Edge::Rise, &cuts);
        let stop = after("STOP", Edge::Rise, &cuts);
        let whole = "the macropixel connects these";
        let counter_out = bus("p_counter.COUNTER_OUT");
        let counter_clk = net("COUNTER_CLK");
        let counted = after("COUNTER_CLK", Edge::Rise, &cuts);
        let sampled = netlist.cells().iter();
        let sampled = sampled.filter(|c| c.kind.is_flip_flop() && c.inputs[1] == counter_clk);
        let settled = sampled.filter_map(|c| counted.window(c.inputs[0]));
        // Each stage's own reset path: what arrives at a stage output goes no further.
        let cuts: Vec<NetId> = cuts
            .into_iter()
            .chain(counter_out.iter().copied())
            .collect();
        let reset = after("COUNTER_RESET", Edge::Rise, &cuts);
        let last = |nets: &[NetId]| {
            nets.iter()
                .filter_map(|&n| reset.window(n))
                .map(|w| w.1)
                .max()
        };
        // A counter without memory is not reset, and one that wraps is not blocked.
        let clear = last(&counter_out).unwrap_or(Time::ZERO);
        let local_stop_falls = reset.edge_window(net("LOCAL_STOP"), Edge::Fall);
        let unblocks = after(
            "LOCAL_STOP",
            Edge::Fall,
            &[net("COUNTER_CLK"), net("metdc.STROBE")],
        );
        let shift = bus("metdc.SHIFT");
        let shift = shift
            .iter()
            .filter_map(|&bit| rise.window(bit))
            .map(|w| w.0);
        MacropixelTiming {
            ripple: fall
                .path(net("LOCAL_STOP"), Edge::Rise, Bound::Longest)
                .expect(whole),
            strobe: fall
                .edge_window(net("metdc.STROBE"), Edge::Rise)
                .expect(whole)
                .1,
            shift: shift.min().expect(whole),
            event: rise
                .path_to(net("SPAD_EVENT"), Bound::Longest)
                .expect(whole),
            count: settled.map(|w| w.1).max().expect(whole),
            counts_at_once: config.p_counter == PCounter::Memoryless,
            counter_clk: fall.edge_window(counter_clk, Edge::Rise).expect(whole).0,
            reset: stop
                .edge_window(net("COUNTER_RESET"), Edge::Rise)
                .expect(whole),
            release: stop
                .edge_window(net("COUNTER_RESET"), Edge::Fall)
                .expect(whole),
            reset_to_stage_clock: clear,
            reset_to_counter_clk: local_stop_falls
                .zip(unblocks.edge_window(net("COUNTER_CLK"), Edge::Rise))
                .map_or(Time::ZERO, |(falls, unblocks)| falls.1 + unblocks.1),
        }
    }
}

impl MacropixelTiming {
    /// Width of the reset pulse, at its shortest.
    pub fn reset_width(&self) -> Time {
        self.release.0 - self.reset.1
    }

    /// Shortest CLK period of the path CLK → SPAD_EVENT → shift register, setup not counted.
    pub fn correlation_period(&self) -> Time {
        self.event.delay()
    }

    /// Shortest CLK period with STOP on CLK's falling edge: the strobe must precede the shift register's change,
    /// setup and hold not counted: the kernel samples D in the instant of the clock edge.
    pub fn strobe_period(&self) -> Time {
        (self.strobe - self.shift) * 2
    }

    /// Whether a start value selects the CLK periods it selects at a slow clock, STOP `phase` after CLK's fall.
    pub fn works(&self, period: Time, phase: Time) -> bool {
        let fs = Time::as_fs;
        let counts_from = fs(self.release.1 - self.counter_clk + phase);
        let first = if self.counts_at_once {
            1
        } else {
            counts_from.div_euclid(fs(period)) + (counts_from.rem_euclid(fs(period)) > 0) as i64
        };
        // Twice the time from the rising edge after the fall that is counted as number 0.
        let late = 2 * fs(self.strobe - self.shift) - fs(period);
        let edges = late.div_euclid(2 * fs(period)) + 1;
        first.max(0) + edges == 1 && period >= self.correlation_period().max(self.count)
    }
}

/// STOP phases that are tried: sixteenths of a CLK period, half a period either way.
pub fn phases(period: Time) -> impl Iterator<Item = Time> {
    (-8..=8).map(move |k| Time::from_fs(period.as_fs() * k / 16))
}

/// The shortest period (to 1 ps) from which on `works` holds up to `limit`, found by bisection; `works` must
/// hold at `limit`.
pub fn shortest_period(limit: Time, works: impl Fn(Time) -> bool) -> Option<Time> {
    let mut good = limit.as_fs() / 1_000;
    let mut bad = 100;
    if !works(limit) {
        return None;
    }
    while good - bad > 1 {
        let middle = (good + bad) / 2;
        if works(Time::from_ps(middle)) {
            good = middle;
        } else {
            bad = middle;
        }
    }
    Some(Time::from_ps(good))
}

/// A clock at which every delay is short.
const SLOW_HZ: f64 = 20e6;

/// Whether a gate-level macropixel counts a pattern of photons into the bins of a slow clock.
pub fn gate_works(config: &SensorConfig, delays: Delays<'_>, period: Time, phase: Time) -> bool {
    let Ok(clock) = Frequency::from_period(period) else {
        return false;
    };
    let start = (config.largest_start() / 2).min(2 * config.bins as u16);
    let rises = Rises::of(config, start).expect("LOCAL_STOP is low at first");
    let exposure = Exposure {
        clock,
        stop_phase: phase,
        stop_periods: match (config.p_counter, rises.every) {
            (PCounter::Memoryless, Some(every)) => every as u32,
            _ => start as u32 + 12,
        },
        laser_cycles: 1,
    };
    let slow = Exposure {
        clock: Frequency::from_hz_f64(SLOW_HZ).expect("a frequency"),
        stop_phase: Time::ZERO,
        ..exposure
    };
    let window = WindowLaw::new(config, &slow).window(start).open();
    let first_edge = window.expect("nothing races at a slow clock").first_edge;
    let mut config = config.clone();
    config.clk_hz = clock.as_hz();
    // A pattern that no shift maps to itself; one SPAD per photon, so that dead time plays no part.
    let has_photon = |bin: i64| [0, 1, 3, 4, 8, 13, 15].contains(&(bin % 16));
    let mut pulses = Vec::new();
    let mut expected = vec![0; config.bins];
    for bin in 0..config.bins as i64 {
        let edge = first_edge + bin;
        if has_photon(bin) && edge > 1 {
            expected[bin as usize] = 1;
            pulses.push(SpadEvent {
                time: exposure.rising(edge) - Time::from_fs(period.as_fs() / 2),
                spad: (bin % 16) as u8,
            });
        }
    }
    pulses.sort_unstable();
    let simulation = GateSimulation::new(&config, &exposure, (0, 0), (1, 1), &[start], &[&pulses]);
    let timing = delays(simulation.netlist());
    let mut simulation = simulation.with_timing(&timing);
    simulation.run(&mut ());
    simulation
        .histograms()
        .is_ok_and(|found| found[0] == expected)
}

/// COUNTER_CLK rises → LOCAL_STOP rises for the sensor's P-counter: longest path, and as simulated from start value 0.
pub fn ripple(config: &SensorConfig, delays: Delays<'_>) -> (Time, Time) {
    let netlist = Netlist::elaborate(&p_counter::circuit(config));
    let timing = delays(&netlist);
    let net = |name: &str| netlist.net(name).expect("a pin of the P-counter");
    let (clk, stop) = (net("COUNTER_CLK"), net("LOCAL_STOP"));
    let analysis = StaticTiming::new(&netlist, &timing);
    let arrivals = analysis
        .arrivals(&[(clk, Edge::Rise)], &[])
        .expect("a P-counter has no loop");
    let (_, longest) = arrivals.edge_window(stop, Edge::Rise).expect("the ripple");
    let resets = [net("MEMORY_RESET"), net("COUNTER_RESET")];
    let edge = Time::from_ns(200);
    let drives = netlist
        .inputs()
        .into_iter()
        .map(|n| Drive::new(Time::ZERO, n, resets.contains(&n)));
    let release = resets.map(|n| Drive::new(Time::from_ns(100), n, false));
    let drives: Vec<_> = drives
        .chain(release)
        .chain([Drive::new(edge, clk, true)])
        .collect();
    let mut stimulus =
        merge([Box::new(drives.into_iter()) as Box<dyn Iterator<Item = Drive> + Send>]);
    let mut recorder = Recorder::new([stop]);
    Kernel::new(&netlist, &timing).run(&mut stimulus, edge * 2, &mut recorder);
    let simulated = recorder
        .rising_edges(stop)
        .first()
        .map_or(Time::MAX, |&t| t - edge);
    (longest, simulated)
}
