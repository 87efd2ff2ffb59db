//! Delays of the paths that decide what a macropixel counts: the only place that measures them.
//!
//! ```text
//!   Silicon ─► delays of every cell ─┐
//!   macropixel's netlist ────────────┴─► static timing ─► MacropixelDelays ─┬─► ChipTiming: the latest of each
//!                                                                           ├─► the engine with each macropixel's own timing
//!                                                                           └─► `gdtof timing`: margins and paths
//! ```
//!
//! | file | what it has |
//! |---|---|
//! | [`silicon`] | the cell library, conditions and mismatch |
//! | `clk_skew` | the wires of CLK to every column |
//! | `delay_lines` | taps of the delay lines of every macropixel |
//! | [`macropixel`] | which edges start a path, where it is cut, and what is read off |
//!
//! Reference models and the window law use a sensor's [`ChipTiming`] instead of simulating cells.

pub(crate) mod clk_skew;
pub(crate) mod delay_lines;
pub mod macropixel;
pub mod silicon;

use std::collections::HashMap;
use std::sync::{LazyLock, Mutex, PoisonError};

use super::config::{AfterBorrow, FrontEnd, Overflow, PCounter, SensorConfig, Tap, Tdc};
use super::front_end::PulseLimits;
use super::photon_line;
use crate::netlist::{CellKind, CheckKind, Corner};
use crate::units::Time;
use macropixel::{CounterDelays, MacropixelCircuit, MacropixelDelays};
use silicon::Silicon;

/// Delays of the paths that decide where a window lies.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct ChipTiming {
    /// SPAD_RAW rising to what is sampled, the toggle flip-flop's output or PHOTONS: the front-end latency. Earliest, where SPADs
    /// share a wire whose gates rise and fall at different speeds.
    pub spad_to_sampled: Time,
    /// Delay of each of the stages of the photon line, where there is one.
    pub photon_line_stage: Time,
    /// What the front end asks of SPAD_RAW.
    pub pulses: PulseLimits,
    /// CLK falling to COUNTER_CLK rising.
    pub clk_to_counter_clk: Time,
    /// The P-counter's own delays and limits.
    pub counter: CounterTiming,
    /// LOCAL_STOP rising to the clock of the HIT flip-flops.
    pub local_stop_to_strobe: Time,
    /// LOCAL_STOP rising to what freezes the window: that clock, or the one that samples the delay lines.
    pub local_stop_to_sample: Time,
    /// STOP rising to the clock of the HIT flip-flops, conventional mode.
    pub stop_to_strobe: Time,
    /// STOP rising to what freezes the window, conventional mode.
    pub stop_to_sample: Time,
    /// Clock of the HIT flip-flops to HIT.
    pub strobe_to_hit: Time,
    /// CLK rising to a change of the METDC's shift register; nothing where there is none.
    pub clk_to_shift: Time,
    /// STOP rising to COUNTER_RESET rising.
    pub stop_to_reset: Time,
    /// STOP rising to COUNTER_RESET falling.
    pub stop_to_reset_release: Time,
    /// STOP rising to the reset of the HIT flip-flops, guided mode.
    pub stop_to_hit_reset: Time,
    /// STOP rising to the release of the HIT flip-flops, guided mode.
    pub stop_to_hit_release: Time,
    /// STOP rising to the inverse of ENABLE, which blocks COUNTER_CLK, falling.
    pub stop_to_enabled: Time,
    /// CLK rising to SPAD_EVENT settled, longest path; nothing where events are not clocked.
    pub clk_to_event: Time,
    /// How long before its clock a flip-flop's data must be stable.
    pub setup: Time,
    /// How long after its clock a flip-flop's data must be stable.
    pub hold: Time,
    /// How long before a strobe that counts the reset of HIT must be released.
    pub recovery: Time,
    /// How long after a strobe that must not count the reset of HIT must still hold.
    pub removal: Time,
}

/// Delays and limits of a P-counter.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct CounterTiming {
    /// COUNTER_CLK rising → LOCAL_STOP rising.
    pub clk_to_local_stop: Time,
    /// COUNTER_RESET rising → LOCAL_STOP rising, where a start value can make it.
    pub reset_to_local_stop: Option<Time>,
    /// COUNTER_RESET falling → the last flip-flop is released.
    pub release: Time,
    /// COUNTER_RESET rising → the first count may come: everything it samples has settled, setup included.
    pub settle: Time,
    /// One count → the next may come: longest path and setup.
    pub period: Time,
    /// Longest recovery time among the flip-flops that COUNTER_CLK clocks.
    pub recovery: Time,
    /// Longest removal time among them.
    pub removal: Time,
    /// Their longest minimum high pulse of COUNTER_CLK.
    pub clock_high: Time,
}

impl ChipTiming {
    /// The timing of a sensor without mismatch, in its corner.
    ///
    /// Measured once for every circuit and corner, and remembered: a measurement takes 0.6 ms, four times as long as
    /// elaborating the macropixel, a look-up 60 ns; and window laws are asked for by the thousand.
    pub fn of(config: &SensorConfig) -> Self {
        static MEASURED: LazyLock<Mutex<HashMap<Circuit, ChipTiming>>> =
            LazyLock::new(Mutex::default);
        let measured = || MEASURED.lock().unwrap_or_else(PoisonError::into_inner);
        let circuit = Circuit::of(config);
        if let Some(&known) = measured().get(&circuit) {
            return known;
        }
        let timing = Self::measure(config, &Silicon::of(config));
        measured().insert(circuit, timing);
        timing
    }

    /// Measures macropixel (0, 0) of a sensor made of this silicon: the latest that each signal comes.
    pub fn measure(config: &SensorConfig, silicon: &Silicon) -> Self {
        let circuit = MacropixelCircuit::new(config, (0, 0));
        let timing = silicon.timing(&circuit.netlist);
        let paths = circuit.paths(&timing);
        let delays = MacropixelDelays::of(&paths);
        let counter = CounterDelays::of(&paths, &delays);
        let library = silicon.limits(silicon::Limits::Kept);
        let limit_of = |kind, check| {
            let limit = library.checks(kind).at(check, silicon.corner);
            Time::from_fs(limit.into())
        };
        // SPADs, SHIFT and HIT have flip-flops of this kind.
        let limit = |check| limit_of(CellKind::Dffr, check);
        let counting = circuit.clocked_by_counter_clk();
        let counting = counting.map(|cell| circuit.netlist.cells()[cell].kind);
        let counting: Vec<CellKind> = counting.collect();
        let of_counter = |check| {
            let limits = counting.iter().map(|&kind| limit_of(kind, check));
            limits.max().expect("a P-counter counts")
        };
        let latencies = delays.latency.iter();
        let slowest_toggle = latencies.map(|(rise, fall)| (*rise).max(*fall)).max();
        let toggle = slowest_toggle.expect("a macropixel has SPADs");
        let shift = delays.shift.iter().map(|span| span.1).max();
        let joining = delays.joining.map_or(Time::ZERO, |span| span.1);
        ChipTiming {
            spad_to_sampled: delays.latency[0].0 + joining,
            photon_line_stage: photon_line::stage(joining, config.spads()),
            pulses: match delays.shaper {
                None => PulseLimits {
                    width: limit(CheckKind::ClockHigh),
                    apart: toggle + limit(CheckKind::Setup),
                    shaped: None,
                },
                Some(shaper) => PulseLimits {
                    width: shaper.width,
                    apart: shaper.width + shaper.recovery,
                    shaped: Some(shaper.width),
                },
            },
            clk_to_counter_clk: counter.counter_clk.1,
            counter: CounterTiming {
                clk_to_local_stop: counter.local_stop.1 - counter.counter_clk.1,
                reset_to_local_stop: counter.reset_to_local_stop,
                release: counter.released,
                settle: counter
                    .reset_settled
                    .map_or(Time::ZERO, |settled| settled + of_counter(CheckKind::Setup)),
                period: counter.settled - counter.counter_clk.1 + of_counter(CheckKind::Setup),
                recovery: of_counter(CheckKind::Recovery),
                removal: of_counter(CheckKind::Removal),
                clock_high: of_counter(CheckKind::ClockHigh),
            },
            local_stop_to_strobe: counter.strobe.1 - counter.local_stop.1,
            local_stop_to_sample: counter.sample.1 - counter.local_stop.1,
            stop_to_strobe: delays.stop_strobe.1,
            stop_to_sample: delays.stop_sample.1,
            strobe_to_hit: delays.strobe_to_hit,
            clk_to_shift: shift.unwrap_or(Time::ZERO),
            stop_to_reset: delays.reset.1,
            stop_to_reset_release: delays.release.1,
            stop_to_hit_reset: delays.reset.1 + counter.hit_reset.1,
            stop_to_hit_release: delays.release.1 + counter.hit_release.1,
            stop_to_enabled: counter.enable,
            clk_to_event: delays.event,
            setup: limit(CheckKind::Setup),
            hold: limit(CheckKind::Hold),
            recovery: limit(CheckKind::Recovery),
            removal: limit(CheckKind::Removal),
        }
    }

    /// CLK falling to LOCAL_STOP rising: what the thesis calls the ripple delay (4.6, Fig. 56).
    pub fn ripple(&self) -> Time {
        self.clk_to_counter_clk + self.counter.clk_to_local_stop
    }
}

/// What a macropixel's circuit and delays depend on.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash)]
struct Circuit {
    spads: usize,
    front_end: FrontEnd,
    coincident_spads: usize,
    counter_bits: usize,
    p_counter: PCounter,
    own: [Option<u64>; 2],
    tap: Tap,
    after_borrow: AfterBorrow,
    step_periods: usize,
    tdc: Tdc,
    bins: usize,
    bin_bits: usize,
    overflow: Overflow,
    corner: Corner,
}

impl Circuit {
    fn of(config: &SensorConfig) -> Self {
        Circuit {
            spads: config.spads(),
            front_end: config.front_end,
            coincident_spads: config.coincident_spads,
            counter_bits: config.counter_bits,
            p_counter: config.p_counter,
            own: config.own_hashes(),
            tap: config.tap,
            after_borrow: config.after_borrow,
            step_periods: config.step_periods,
            tdc: config.tdc,
            bins: config.bins,
            bin_bits: config.bin_bits,
            overflow: config.overflow,
            corner: config.corner,
        }
    }
}
