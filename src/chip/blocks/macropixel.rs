//! Macropixel: its SPADs, their time window and their histogram (thesis 4.2, 4.3, Fig. 47, 48, 55).
//!
//! ```text
//!   SPAD_RAW ─► front_end ─► correlation ─► metdc ─HIT─► histogram
//!                                             ▲ LOCAL_STOP
//!   STOP, CLK ─► p_counter_timing ──────► p_counter ◄── COUNTER_INIT, MEMORY_LOAD
//!                    ▲                        │
//!                    └──────── LOCAL_STOP ────┘
//!   ROW_READ, BIN_READ ─► bin_select ◄── counts of the histogram
//!                             └─► WORD
//! ```
//!
//! Where delay lines time photons, `photon_line` is the front end and `metdc_delay_line` the METDC, and nothing is correlated:
//!
//! ```text
//!   SPAD_RAW ─► photon_line ─PHOTONS─► metdc_delay_line ─HIT─► histogram
//! ```
//!
//! [`Model`] is the clocked one circuit in plain Rust, stepped edge by edge through its blocks' models; only
//! the arrival of the strobe, of the reset and of the SPAD pulses is timed ([`ChipTiming`]).

use std::collections::VecDeque;
use std::sync::Arc;

use super::{
    correlation, finished, front_end, histogram, metdc, metdc_delay_line, p_counter,
    p_counter_timing, photon_line, readout,
};
use crate::chip::config::{Mode, PCounter, SensorConfig, Tdc};
use crate::chip::exposure::Exposure;
use crate::chip::timing::ChipTiming;
use crate::netlist::{Module, ModuleBuilder, Net};
use crate::units::Time;

/// One macropixel.
///
/// Ports: CLK, STOP, RESETB, ENABLE, PIXEL_CLEAR, CONVENTIONAL, TYPE\<2\>, THRESHOLD\<bits\>,
/// COUNTER_INIT\<bits\>, MEMORY_LOAD, SPAD_RAW\<SPADs\>, ROW_READ, BIN_READ\<bins\> → LOCAL_STOP, WORD\<bin bits\>.
pub fn circuit(config: &SensorConfig) -> Arc<Module> {
    let mut m = ModuleBuilder::new("macropixel");
    let clk = [m.input("CLK")];
    let stop = [m.input("STOP")];
    let resetb = [m.input("RESETB")];
    let enable = [m.input("ENABLE")];
    let clear = [m.input("PIXEL_CLEAR")];
    let conventional = [m.input("CONVENTIONAL")];
    let event_type = m.input_bus("TYPE", 2);
    let threshold = m.input_bus("THRESHOLD", config.threshold_bits());
    let init = m.input_bus("COUNTER_INIT", config.counter_bits);
    let load = [m.input("MEMORY_LOAD")];
    let raw = m.input_bus("SPAD_RAW", config.spads());
    let row_read = [m.input("ROW_READ")];
    let bin_read = m.input_bus("BIN_READ", config.bins);
    let local_stop = [m.output("LOCAL_STOP")];
    let word = m.output_bus("WORD", config.bin_bits);

    let counter_clk = [m.wire("COUNTER_CLK")];
    let counter_reset = [m.wire("COUNTER_RESET")];
    let memory_reset = [m.wire("MEMORY_RESET")];
    let stop_d = [m.wire("STOP_D")];
    let clocked = (config.tdc == Tdc::Clocked).then(|| {
        let timed = m.wire_bus("SPAD_TIMED", config.lines());
        (timed, [m.wire("SPAD_EVENT")])
    });
    let photons = (config.tdc == Tdc::DelayLine).then(|| [m.wire("PHOTONS")]);
    let hit = m.wire_bus("HIT", config.bins);
    let counts = m.wire_bus("COUNT", config.bins * config.bin_bits);

    m.instance(
        "p_counter_timing",
        &p_counter_timing::circuit(config.after_borrow),
        &[
            ("CLK", &clk),
            ("STOP", &stop),
            ("RESETB", &resetb),
            ("ENABLE", &enable),
            ("LOCAL_STOP", &local_stop),
            ("COUNTER_CLK", &counter_clk),
            ("COUNTER_RESET", &counter_reset),
            ("MEMORY_RESET", &memory_reset),
            ("STOP_D", &stop_d),
        ],
    );
    m.instance(
        "p_counter",
        &p_counter::circuit(config),
        &[
            ("COUNTER_INIT", &init),
            ("MEMORY_LOAD", &load),
            ("MEMORY_RESET", &memory_reset),
            ("COUNTER_CLK", &counter_clk),
            ("COUNTER_RESET", &counter_reset),
            ("LOCAL_STOP", &local_stop),
        ],
    );
    let strobes: [(&str, &[Net]); 7] = [
        ("LOCAL_STOP", &local_stop),
        ("STOP", &stop),
        ("STOP_D", &stop_d),
        ("COUNTER_RESET", &counter_reset),
        ("CONVENTIONAL", &conventional),
        ("PIXEL_CLEAR", &clear),
        ("HIT", &hit),
    ];
    if let Some((timed, event)) = &clocked {
        m.instance(
            "front_end",
            &front_end::circuit(config),
            &[
                ("SPAD_RAW", &raw),
                ("CLK", &clk),
                ("PIXEL_CLEAR", &clear),
                ("SPAD_TIMED", timed),
            ],
        );
        m.instance(
            "correlation",
            &correlation::circuit(config.lines()),
            &[
                ("SPAD_TIMED", timed),
                ("TYPE", &event_type),
                ("THRESHOLD", &threshold),
                ("SPAD_EVENT", event),
            ],
        );
        let events: [(&str, &[Net]); 2] = [("CLK", &clk), ("SPAD_EVENT", event)];
        let ports = [&events[..], &strobes].concat();
        m.instance("metdc", &metdc::circuit(config.bins), &ports);
    }
    if let Some(photons) = &photons {
        m.instance(
            "front_end",
            &photon_line::circuit(config.spads()),
            &[
                ("SPAD_RAW", &raw),
                ("PIXEL_CLEAR", &clear),
                ("PHOTONS", photons),
            ],
        );
        let own: [(&str, &[Net]); 4] = [
            ("PHOTONS", photons),
            ("COUNTER_INIT", &init[..1]),
            ("MEMORY_LOAD", &load),
            ("MEMORY_RESET", &memory_reset),
        ];
        let lines = metdc_delay_line::circuit(config.bins, &config.delay_elements());
        m.instance("metdc", &lines, &[&own[..], &strobes].concat());
    }
    let bins: Vec<String> = (0..config.bins).map(histogram::bin_name).collect();
    let mut histogram_ports = vec![("HIT", &hit[..]), ("PIXEL_CLEAR", &clear)];
    let of_bins = bins.iter().zip(counts.chunks(config.bin_bits));
    histogram_ports.extend(of_bins.map(|(name, count)| (name.as_str(), count)));
    m.instance(
        "histogram",
        &histogram::circuit(config.bins, config.bin_bits, config.overflow),
        &histogram_ports,
    );
    m.instance(
        "bin_select",
        &readout::bin_select(config.bins, config.bin_bits),
        &[
            ("ROW_READ", &row_read),
            ("BIN_READ", &bin_read),
            ("COUNT", &counts),
            ("WORD", &word),
        ],
    );
    finished(m.finish())
}

/// Reference model of a macropixel during one exposure.
#[derive(Debug, Clone)]
pub struct Model<'a> {
    config: &'a SensorConfig,
    exposure: &'a Exposure,
    timing: ChipTiming,
}

impl<'a> Model<'a> {
    /// A macropixel of this sensor in this exposure.
    pub fn new(config: &'a SensorConfig, exposure: &'a Exposure) -> Self {
        Model {
            config,
            exposure,
            timing: ChipTiming::of(config),
        }
    }

    /// Histogram after the exposure, `bins` counts, for a start value and the rising edges of
    /// SPAD_RAW as (time, SPAD), sorted by time.
    pub fn histogram(&self, start: u16, pulses: impl IntoIterator<Item = (Time, u8)>) -> Vec<u16> {
        let mut hits = vec![0u64; self.config.bins];
        self.run(start, pulses, |_, latched| {
            for (bin, count) in hits.iter_mut().enumerate() {
                *count += latched >> bin & 1;
            }
        });
        let (bits, overflow) = (self.config.bin_bits as u32, self.config.overflow);
        hits.iter()
            .map(|&n| histogram::model(n, bits, overflow))
            .collect()
    }

    /// Runs the exposure; `strobe` is told the time of every strobe (LOCAL_STOP's rise in the guided
    /// mode) and the HIT bits that rise with it.
    pub fn run(
        &self,
        start: u16,
        pulses: impl IntoIterator<Item = (Time, u8)>,
        mut strobe: impl FnMut(Time, u64),
    ) {
        let (config, exposure, timing) = (self.config, self.exposure, &self.timing);
        let periods = exposure.stop_periods as i64;
        let cycles = exposure.laser_cycles as i64;
        let guided = config.mode == Mode::Guided;
        let has_memory = config.p_counter != PCounter::Memoryless;
        let mut pulses = pulses.into_iter().peekable();
        let mut counter = p_counter::Model::new(config, start);
        let mut front_end = front_end::Model::new(config, timing);
        let mut metdc = metdc::Model::new(config.bins as u32);
        let mut hit = Hit::new(self);
        let mut pending: VecDeque<Strobe> = VecDeque::new();
        let by_local_stop = |local_stop, deadline| Strobe {
            cause: local_stop,
            arrival: local_stop + timing.local_stop_to_strobe,
            deadline,
        };
        let by_reset = |stop| {
            let reset_to_local_stop = timing.counter.reset_to_local_stop;
            let delay = reset_to_local_stop.expect("no other counter rises at its reset");
            by_local_stop(stop + timing.stop_to_reset + delay, Time::MAX)
        };
        // STOP edge number `cycle` is the next whose reset has not been released yet.
        let mut cycle = 0;
        let mut stop = exposure.stop(0);
        let mut ticks = exposure.clock.ticks(0).map(|t| t - exposure.stop_phase);

        for edge in 0..=cycles * periods {
            let (fall, rise) = (
                ticks.next().expect("endless"),
                ticks.next().expect("endless"),
            );
            if guided {
                let counter_clk = fall + timing.clk_to_counter_clk;
                while cycle <= cycles && stop + timing.stop_to_reset_release <= counter_clk {
                    if counter.reset() {
                        pending.push_back(by_reset(stop));
                    }
                    cycle += 1;
                    stop = exposure.stop(cycle);
                }
                let counts = if has_memory {
                    cycle > 0 && cycle <= cycles && stop + timing.stop_to_reset >= counter_clk
                } else {
                    rise > timing.stop_to_enabled && edge < cycles * periods
                };
                if counts && counter.clock() {
                    let local_stop = counter_clk + timing.counter.clk_to_local_stop;
                    // The next reset takes back what still ripples.
                    let deadline = if has_memory {
                        stop + timing.stop_to_hit_reset - timing.strobe_to_hit
                    } else {
                        Time::MAX
                    };
                    pending.push_back(by_local_stop(local_stop, deadline));
                }
            } else if edge % periods == 0 {
                let stop = exposure.stop(edge / periods);
                pending.push_back(Strobe {
                    cause: stop,
                    arrival: stop + timing.stop_to_strobe,
                    deadline: Time::MAX,
                });
            }

            // A strobe that comes before the shift register changes sees it as it was.
            while let Some(&s) = pending.front()
                && s.arrival < rise + timing.clk_to_shift
            {
                hit.latch(s, metdc.hits(), &mut strobe);
                pending.pop_front();
            }
            let timed = front_end.spad_timed();
            metdc.clock(correlation::model(
                timed,
                config.event_type,
                config.threshold,
            ));
            while let Some((time, spad)) =
                pulses.next_if(|(t, _)| *t + timing.spad_to_sampled <= rise)
            {
                front_end.pulse(time, spad);
            }
            front_end.clock();
        }
        if guided && cycle <= cycles && counter.reset() {
            pending.push_back(by_reset(stop));
        }
        for s in pending {
            hit.latch(s, metdc.hits(), &mut strobe);
        }
    }
}

/// A strobe on its way to the HIT flip-flops.
#[derive(Debug, Clone, Copy)]
struct Strobe {
    /// When LOCAL_STOP (or STOP) rose.
    cause: Time,
    /// When it clocks HIT.
    arrival: Time,
    /// The last arrival that a reset of the P-counter does not forestall.
    deadline: Time,
}

/// The HIT flip-flops, which a laser cycle's first strobe finds at zero and a second one does not.
struct Hit<'m> {
    model: &'m Model<'m>,
    held: u64,
    /// STOP edge whose reset of HIT comes next.
    next_stop: i64,
}

impl<'m> Hit<'m> {
    fn new(model: &'m Model<'m>) -> Self {
        Hit {
            model,
            held: 0,
            next_stop: 0,
        }
    }

    /// Latches `hits`, unless HIT is in reset, and tells `strobe` which bits rise.
    fn latch(&mut self, s: Strobe, hits: u64, strobe: &mut impl FnMut(Time, u64)) {
        let Model {
            config,
            exposure,
            timing,
        } = self.model;
        if config.mode == Mode::Conventional {
            // NOT STOP has cleared HIT.
            strobe(s.cause, hits);
            return;
        }
        if s.arrival > s.deadline {
            return;
        }
        let cycles = i64::from(exposure.laser_cycles);
        let resets_at = |stop| exposure.stop(stop) + timing.stop_to_hit_reset;
        while self.next_stop <= cycles && resets_at(self.next_stop) <= s.arrival {
            self.next_stop += 1;
            self.held = 0;
        }
        let last_release = exposure.stop(self.next_stop - 1) + timing.stop_to_hit_release;
        if self.next_stop == 0 || self.next_stop > cycles || s.arrival < last_release {
            strobe(s.cause, 0);
        } else if s.arrival <= resets_at(self.next_stop) - timing.strobe_to_hit {
            strobe(s.cause, hits & !self.held);
            self.held = hits;
        }
    }
}
