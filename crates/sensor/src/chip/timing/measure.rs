//! [`ChipTiming`] of a sensor: measured on the netlist of its macropixel, and remembered.

use std::collections::HashMap;
use std::sync::{Arc, LazyLock, Mutex, PoisonError};

use super::cell_library::CellLibrary;
use super::chip_timing::{BlockTiming, ChipTiming, CounterTiming};
use super::local_stop::LocalStopDelays;
use super::macropixel::{CounterDelays, MacropixelCircuit, MacropixelDelays, hull, spread};
use super::silicon::{Limits, Silicon};
use crate::chip::config::{AfterBorrow, FrontEnd, Overflow, PCounter, SensorConfig, Tap, Tdc};
use crate::chip::front_end::PulseLimits;
use crate::chip::photon_line;
use crate::netlist::{CellKind, CheckKind, Corner, Edge, Library, Requirement, Requirements};
use crate::units::Time;

/// What is measured of a sensor's macropixels.
#[derive(Debug, Clone)]
pub(in crate::chip) struct MeasuredDelays {
    /// One number for each path: the latest, where there are several.
    pub timing: ChipTiming,
    /// LOCAL_STOP, for each start value.
    pub local_stop: Arc<LocalStopDelays>,
}

impl ChipTiming {
    /// The timing of a sensor without mismatch, in its corner at its temperature.
    pub fn new(config: &SensorConfig) -> Self {
        MeasuredDelays::cached(config).timing
    }

    /// Measures macropixel (0, 0) of a sensor made of this silicon: the latest that each signal comes.
    pub fn measure(config: &SensorConfig, silicon: &Silicon) -> Self {
        MeasuredDelays::measure(config, silicon).timing
    }
}

/// By how much one event comes after another, at the least, so that their order is certain.
const EDGE: Time = Time::from_fs(1);

/// Width of COUNTER_RESET, and what it must outlast.
pub(crate) struct ResetPulse {
    /// At its shortest.
    pub width: Time,
    /// Stage outputs that return to their memory value, the COUNTER_CLK edges that LOCAL_STOP's fall and ENABLE let through, the shortest
    /// resets of flip-flops, and the gates on the way, which swallow a pulse shorter than their delay.
    pub need: Time,
    /// By how much HIT is ready before the same chain makes the strobe of the conventional mode, at the least.
    pub strobe_lead: Time,
}

impl ResetPulse {
    /// Measures macropixel (0, 0) of a sensor made of this silicon.
    pub(super) fn measure(config: &SensorConfig, silicon: &Silicon) -> Self {
        let circuit = MacropixelCircuit::new(config, (0, 0));
        let timing = silicon.timing(&circuit.netlist);
        let paths = circuit.paths(&timing);
        let delays = MacropixelDelays::measure(&paths);
        let counter = CounterDelays::measure(&paths, &delays);
        let limits = (&silicon.limits(Limits::Kept), silicon.corner);
        Self::from_delays(&circuit, (&delays, &counter), limits)
    }

    /// The same of delays that are known.
    pub(crate) fn from_delays(
        circuit: &MacropixelCircuit,
        (delays, counter): (&MacropixelDelays, &CounterDelays),
        (library, corner): (&Library, Corner),
    ) -> Self {
        let limit_of = |kind, check| library.checks(kind).limit(check, corner);
        let limit = |check| {
            let limits = circuit.counting_kinds().map(|kind| limit_of(kind, check));
            limits.max().expect("a P-counter counts")
        };
        let width = delays.release.0 - delays.reset.1;
        let to_hit = counter.hit_reset.1;
        let of_hit = limit_of(CellKind::Dffr, CheckKind::ControlHigh) - counter.hit_release.0;
        // What is left over of the pulse where gates make it.
        let made = (delays.stop_d.0 - delays.pulse.0.1).min(delays.pulse.1.0 - delays.reset.1);
        let of_counter = [
            counter.reset_edges() + limit(CheckKind::Removal),
            counter.enabled - delays.reset.0 + limit(CheckKind::Removal),
            limit(CheckKind::ControlHigh),
            // The pulse is there when the first laser cycle's other cause of COUNTER_RESET goes.
            width - (delays.pulse.1.0 - counter.clear_falls) + EDGE,
        ];
        let is_reset = counter.reset_settled.is_some();
        let of_counter = of_counter.into_iter().filter(|_| is_reset);
        let needs = of_counter.chain([to_hit + of_hit, to_hit, width - made]);
        ResetPulse {
            width,
            need: needs.max().expect("there are some"),
            strobe_lead: delays.stop_strobe.0
                - delays.stop_hit_release.1
                - limit_of(CellKind::Dffr, CheckKind::Recovery),
        }
    }
}

impl MeasuredDelays {
    /// Those of a sensor without mismatch, in its corner at its temperature.
    ///
    /// Measured once for every circuit and corner, and remembered: a measurement takes 0.6 ms, four times as long as
    /// elaborating the macropixel; and window laws are asked for by the thousand.
    pub(in crate::chip) fn cached(config: &SensorConfig) -> Self {
        static MEASURED: LazyLock<Mutex<HashMap<Circuit, MeasuredDelays>>> =
            LazyLock::new(Mutex::default);
        let measured = || MEASURED.lock().unwrap_or_else(PoisonError::into_inner);
        let circuit = Circuit::new(config).expect("checked");
        if let Some(known) = measured().get(&circuit) {
            return known.clone();
        }
        let delays = Self::measure(config, &Silicon::new(config));
        measured().insert(circuit, delays.clone());
        delays
    }

    /// Measures macropixel (0, 0) of a sensor made of this silicon.
    pub(in crate::chip) fn measure(config: &SensorConfig, silicon: &Silicon) -> Self {
        let circuit = MacropixelCircuit::new(config, (0, 0));
        let timing = silicon.timing(&circuit.netlist);
        let paths = circuit.paths(&timing);
        let delays = MacropixelDelays::measure(&paths);
        let counter = CounterDelays::measure(&paths, &delays);
        let library = silicon.limits(Limits::Kept);
        let reset =
            ResetPulse::from_delays(&circuit, (&delays, &counter), (&library, silicon.corner));
        let clk = Edge::BOTH.map(|edge| paths.after_clk(edge));
        let clk = Requirements::behind(&circuit.netlist, clk, &library, silicon.corner);
        let (_, clk) = circuit.split(clk.all(), false);
        let limit_of = |kind, check| library.checks(kind).limit(check, silicon.corner);
        // SPADs, SHIFT and HIT have flip-flops of this kind.
        let limit = |check| limit_of(CellKind::Dffr, check);
        let counting = circuit.clocked_by_counter_clk();
        let counting = counting.map(|cell| circuit.netlist.cells()[cell.index()].kind);
        let counting: Vec<CellKind> = counting.collect();
        let of_counter = |check| {
            let limits = counting.iter().map(|&kind| limit_of(kind, check));
            limits.max().expect("a P-counter counts")
        };
        let latencies = delays.latency.iter();
        let slowest_toggle = latencies.map(|(rise, fall)| (*rise).max(*fall)).max();
        let toggle = slowest_toggle.expect("a macropixel has SPADs");
        let shift = delays.shift.iter().copied().reduce(hull);
        let hit_high = |(kind, rise, fall): (CellKind, Time, Time)| {
            rise.max(rise - fall + limit_of(kind, CheckKind::ClockHigh))
        };
        let local_stop = (
            counter.local_stop.0 - counter.counter_clk.1,
            counter.local_stop.1 - counter.counter_clk.1,
        );
        let joining = delays.joining.map_or(Time::ZERO, |span| span.1);
        let chip_timing = ChipTiming {
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
                clk_to_local_stop: local_stop.1,
                reset_to_local_stop: counter.reset_to_local_stop,
                release: counter.released,
                settle: counter
                    .reset_settled
                    .map_or(Time::ZERO, |settled| settled + of_counter(CheckKind::Setup)),
                period: counter.settled - counter.counter_clk.1 + of_counter(CheckKind::Setup),
                recovery: of_counter(CheckKind::Recovery),
                removal: of_counter(CheckKind::Removal) + spread(delays.release),
                clock_high: of_counter(CheckKind::ClockHigh),
                block: counter.block.zip(counter.block_to_counter_clk).map(
                    |(block, to_counter_clk)| BlockTiming {
                        from_local_stop: block.1 - counter.local_stop.1,
                        to_counter_clk,
                    },
                ),
                load_pulse: counter.load_pulse,
                reset_width: reset.width,
                reset_need: reset.need,
            },
            local_stop_to_strobe: counter.strobe.1 - counter.local_stop.1,
            local_stop_to_sample: counter.sample.1 - counter.local_stop.1,
            stop_to_strobe: delays.stop_strobe.1,
            stop_to_sample: delays.stop_sample.1,
            strobe_to_hit: delays.strobe_to_hit,
            hit_high: delays.hit_to_count.map_or(Time::ZERO, hit_high),
            clk_to_shift: shift.map_or(Time::ZERO, |span| span.1),
            stop_to_reset: delays.reset.1,
            stop_to_reset_release: delays.release.1,
            stop_to_hit_reset: delays.reset.1 + counter.hit_reset.1,
            stop_to_hit_release: delays.release.1 + counter.hit_release.1,
            stop_to_hit_ready: delays.stop_hit_release.1 + limit(CheckKind::Recovery),
            stop_to_start_falls: delays.reset.1 + counter.hit_falls,
            stop_to_enabled: counter.enable,
            clk_to_event: delays.event,
            clk_period: clk
                .iter()
                .filter_map(Requirement::period)
                .max()
                .unwrap_or(Time::ZERO),
            broken_hold: clk
                .iter()
                .filter(|r| r.period().is_none())
                .map(|r| r.need)
                .max(),
            setup: limit(CheckKind::Setup),
            // From the earliest change of a stage on.
            hold: limit(CheckKind::Hold) + shift.map_or(Time::ZERO, spread),
            recovery: limit(CheckKind::Recovery),
            removal: limit(CheckKind::Removal),
        };
        MeasuredDelays {
            timing: chip_timing,
            local_stop: Arc::new(LocalStopDelays::new(config, &circuit, &timing, local_stop)),
        }
    }
}

/// What a macropixel's circuit and delays depend on.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash)]
pub(super) struct Circuit {
    spads: usize,
    front_end: FrontEnd,
    coincident_spads: usize,
    counter_bits: usize,
    p_counter: PCounter,
    own: [Option<u64>; 5],
    tap: Tap,
    after_borrow: AfterBorrow,
    step_periods: usize,
    reset_buffers: usize,
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
    /// Of this sensor; `None` where its corner has no library.
    pub(super) fn new(config: &SensorConfig) -> Option<Self> {
        Some(Circuit {
            spads: config.spads(),
            front_end: config.front_end,
            coincident_spads: config.coincident_spads,
            counter_bits: config.counter_bits,
            p_counter: config.p_counter,
            own: config.own_hashes(),
            tap: config.tap,
            after_borrow: config.after_borrow,
            step_periods: config.step_periods,
            reset_buffers: config.reset_buffers(),
            tdc: config.tdc,
            bins: config.bins,
            bin_bits: config.bin_bits,
            overflow: config.overflow,
            corner: config.corner,
            temperature: config.temperature_c.map(f64::to_bits),
            library: CellLibrary::from_config(config).ok()?,
        })
    }
}
