//! [`ChipTiming`] of a sensor: measured on the netlist of its macropixel, and remembered.

use std::collections::HashMap;
use std::sync::{LazyLock, Mutex, PoisonError};

use super::cell_library::CellLibrary;
use super::chip_timing::{ChipTiming, CounterTiming};
use super::macropixel::{CounterDelays, MacropixelCircuit, MacropixelDelays};
use super::silicon::{Limits, Silicon};
use crate::chip::config::{AfterBorrow, FrontEnd, Overflow, PCounter, SensorConfig, Tap, Tdc};
use crate::chip::front_end::PulseLimits;
use crate::chip::photon_line;
use crate::netlist::{CellKind, CheckKind, Corner};
use crate::units::Time;

impl ChipTiming {
    /// The timing of a sensor without mismatch, in its corner at its temperature.
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
        let library = silicon.limits(Limits::Kept);
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
}

/// What a macropixel's circuit and delays depend on.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash)]
struct Circuit {
    spads: usize,
    front_end: FrontEnd,
    coincident_spads: usize,
    counter_bits: usize,
    p_counter: PCounter,
    own: [Option<u64>; 5],
    tap: Tap,
    after_borrow: AfterBorrow,
    step_periods: usize,
    tdc: Tdc,
    bins: usize,
    bin_bits: usize,
    overflow: Overflow,
    corner: Corner,
    /// Its bits.
    temperature: Option<u64>,
    library: CellLibrary,
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
            temperature: config.temperature_c.map(f64::to_bits),
            library: CellLibrary::of(config).expect("checked"),
        }
    }
}
