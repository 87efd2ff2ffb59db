//! How long after its last count a P-counter raises LOCAL_STOP, for each start value.
//!
//! ```text
//!   macropixel's delays ─┬─► static timing ─► earliest and latest ── equal? ─► one delay for all start values
//!                        └─► its P-counter, counted down on the gates ───────► a delay for each
//! ```
//!
//! Where Q and QN, or rise and fall, have different delays, the path of the last count depends on the start value: the memory
//! chooses Q or QN in every stage. Static timing bounds all paths. What each start value takes is read off the gates, 64 start
//! values at a time and only when somebody asks.

use std::cmp::Reverse;
use std::ops::RangeInclusive;
use std::sync::OnceLock;

use super::macropixel::{DelaySpan, MacropixelCircuit, hull, spread};
use crate::chip::p_counter::Rises;
use crate::chip::p_counter::count_down::{CountDown, CountDownResult, CountDownSetup};
use crate::chip::{Probes, SensorConfig, p_counter};
use crate::kernel::LANES;
use crate::netlist::{Netlist, Timing};
use crate::units::Time;

/// COUNTER_CLK rises → LOCAL_STOP rises, by start value.
#[derive(Debug)]
pub struct LocalStopDelays {
    /// Earliest and latest by static timing.
    bounds: DelaySpan,
    counter: Counter,
}

/// A P-counter with the delays that it has in its macropixel.
#[derive(Debug)]
struct Counter {
    config: SensorConfig,
    netlist: Netlist,
    probes: Probes,
    timing: Timing,
    /// What 64 start values do each, once it has been measured.
    measured: Vec<OnceLock<Box<[CountDownResult]>>>,
}

impl LocalStopDelays {
    /// Those of the macropixel `circuit` of this sensor with these delays; `bounds` are those of static timing.
    pub(super) fn new(
        config: &SensorConfig,
        circuit: &MacropixelCircuit,
        timing: &Timing,
        bounds: DelaySpan,
    ) -> Self {
        LocalStopDelays {
            bounds,
            counter: Counter::new(config, circuit, timing),
        }
    }

    /// Earliest and latest by static timing: no start value is outside.
    pub fn bounds(&self) -> DelaySpan {
        self.bounds
    }

    /// The delay of a start value. Where no count raises LOCAL_STOP from it, the latest of static timing.
    pub fn of_start(&self, start: u16) -> Time {
        if spread(self.bounds) == Time::ZERO {
            return self.bounds.1;
        }
        self.counter
            .count_down(start)
            .delay
            .unwrap_or(self.bounds.1)
    }

    /// The count that raises LOCAL_STOP from a start value with these delays, the first count being 0, if that is not the one that the
    /// start value stands for: `Some(None)` where none does.
    ///
    /// A counter without memory keeps its start value only if the end of its load pulse comes in the right order. In others a delay
    /// that differs from one start value to the next may hide an edge that clocks a stage.
    pub(in crate::chip) fn miscount(&self, start: u16) -> Option<Option<u32>> {
        let config = &self.counter.config;
        if spread(self.bounds) == Time::ZERO && config.p_counter.row().has_memory {
            return None;
        }
        let found = self.counter.count_down(start).rises[0];
        let expected = Rises::from_start_value(config, start).map(|rises| rises.first);
        (found.map(i64::from) != expected).then_some(found)
    }

    /// The earliest and the latest delay of all start values.
    pub fn span(&self) -> DelaySpan {
        let delays = self.starts().map(|start| self.of_start(start));
        let spans = delays.map(|delay| (delay, delay));
        spans.reduce(hull).expect("a counter has start values")
    }

    /// The start value with the latest delay, and that delay, by events. Where static timing allows one delay only, start value 0 stands for
    /// all.
    pub fn latest(&self) -> (u16, Time) {
        let simulated = |start| {
            let delay = self.counter.count_down(start).delay;
            (delay.unwrap_or(self.bounds.1), start)
        };
        // The least of the start values that take as long.
        let slowest = self.starts().map(simulated);
        let slowest = slowest.max_by_key(|&(delay, start)| (delay, Reverse(start)));
        let (delay, start) = slowest.expect("a counter has start values");
        (start, delay)
    }

    /// Start values among which all delays are.
    fn starts(&self) -> RangeInclusive<u16> {
        if spread(self.bounds) == Time::ZERO {
            0..=0
        } else {
            0..=self.counter.config.largest_start()
        }
    }
}

impl Counter {
    fn new(config: &SensorConfig, circuit: &MacropixelCircuit, of_circuit: &Timing) -> Self {
        let netlist = Netlist::elaborate(&p_counter::circuit(config));
        let place = circuit.netlist.scope(&circuit.probes.p_counter());
        let cells = circuit
            .netlist
            .cells_below(place.expect("a macropixel has a P-counter"));
        debug_assert_eq!(cells.len(), netlist.cells().len());
        let timing = of_circuit.part(cells);
        let chunks = usize::from(config.largest_start()) / LANES + 1;
        Counter {
            config: config.clone(),
            probes: Probes::of_block(&netlist),
            netlist,
            timing,
            measured: (0..chunks).map(|_| OnceLock::new()).collect(),
        }
    }

    fn count_down(&self, start: u16) -> CountDownResult {
        let (chunk, place) = (usize::from(start) / LANES, usize::from(start) % LANES);
        self.measured[chunk].get_or_init(|| self.measure(chunk))[place]
    }

    /// What the start values of one chunk do.
    fn measure(&self, chunk: usize) -> Box<[CountDownResult]> {
        let first = chunk * LANES;
        let last = (first + LANES - 1).min(self.config.largest_start().into());
        let starts: Vec<u16> = (first..=last).map(|start| start as u16).collect();
        let codes = self.config.load_codes(&starts);
        let expected = CountDownSetup::of_sensor(&self.config);
        let counter = (&self.netlist, &self.probes);
        let counted = CountDown::new(counter, &self.timing, &codes, expected).measure(1);
        // A LOCAL_STOP that is unknown or no clean edge raises nothing that can be counted on.
        let counted = counted.unwrap_or_else(|_| vec![CountDownResult::NEVER; starts.len()]);
        counted.into()
    }
}
