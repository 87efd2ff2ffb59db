//! P-counter: the programmable counter that opens a macropixel's time window, in every variant of the thesis (4.4).
//!
//! ```text
//!   COUNTER_INIT<n> ─► memory ─► start value ─┐
//!   MEMORY_LOAD ─────►                        ▼
//!   COUNTER_CLK ──────────────────────────► counter ─► LOCAL_STOP rises with COUNTER_CLK edge start + 1
//!   COUNTER_RESET (each STOP) ────────────►           after the reset
//! ```
//!
//! | file | [`PCounter`] | transistors a stage | LOCAL_STOP comes |
//! |---|---|---|---|
//! | [`ripple`] | memory, reset-only flip-flop, multiplexer (Fig. 51c): the sensor's | 52 | a ripple late |
//! | [`set_reset`] | memory, set/reset flip-flop, delayed reset (Fig. 51b): HSLIDAR's | 66 | a ripple late |
//! | [`synchronous`] | the sensor's stage, all clocked together (Fig. 50a) | 68 | at once |
//! | [`comparator`] | memory, up counter, comparator (Fig. 49a) | 62 | at once |
//! | [`memoryless`] | set/reset flip-flop, loaded once (4.4.3) | 42 | a ripple late |
//!
//! All have the same pins, so that the macropixel does not care. Two questions the thesis leaves open are keys of
//! the sensor file. [`Tap`]: it ties LOCAL_STOP to the counter's most significant bit *and* claims 2ⁿ window steps,
//! but a start value of 2ⁿ⁻¹ or more has that bit high from the reset on. The default, `borrow`, is a stage more,
//! which rises when the counter rolls over past zero for every start value. [`AfterBorrow`]: a counter that runs on
//! comes round, and raises LOCAL_STOP again, every 2ⁿ⁺¹ counts (2ⁿ with the tap `msb`). By default LOCAL_STOP
//! blocks COUNTER_CLK; the timing block sees to it. A [`step_divider`] before the first stage lets windows step by several
//! CLK periods.

pub mod comparator;
pub mod memoryless;
pub mod ripple;
pub mod set_reset;
pub mod step_divider;
pub mod synchronous;

use std::sync::Arc;

use super::finished;
use crate::chip::config::{AfterBorrow, PCounter, SensorConfig, Tap};
use crate::netlist::{CellKind, Module, ModuleBuilder, Net};

/// The P-counter of a sensor.
///
/// Ports: COUNTER_INIT\<bits\>, MEMORY_LOAD, MEMORY_RESET, COUNTER_CLK, COUNTER_RESET → LOCAL_STOP. Inside, the count
/// is COUNTER_OUT\<bits\> and the start value, but for the memory-less variant, MEMORY\<bits\>.
pub fn circuit(config: &SensorConfig) -> Arc<Module> {
    match config.p_counter {
        PCounter::Ripple => ripple::circuit(config),
        PCounter::SetReset => set_reset::circuit(config),
        PCounter::Synchronous => synchronous::circuit(config),
        PCounter::Comparator => comparator::circuit(config),
        PCounter::Memoryless => memoryless::circuit(config),
    }
}

/// The memory that keeps a start value: `bits` flip-flops clocked by MEMORY_LOAD.
///
/// Ports: COUNTER_INIT\<bits\>, MEMORY_LOAD, MEMORY_RESET → MEMORY\<bits\>.
pub fn memory(bits: usize) -> Arc<Module> {
    let mut m = ModuleBuilder::new("p_counter_memory");
    let init = m.input_bus("COUNTER_INIT", bits);
    let load = m.input("MEMORY_LOAD");
    let reset = m.input("MEMORY_RESET");
    let memory = m.output_bus("MEMORY", bits);
    for bit in 0..bits {
        m.cell(
            &format!("memory_{bit}"),
            CellKind::Dffr,
            &[init[bit], load, reset],
            &[memory[bit], Net::NONE],
        );
    }
    finished(m.finish())
}

/// The pins that every variant has.
struct Pins {
    init: Vec<Net>,
    load: Net,
    memory_reset: Net,
    /// What clocks the counter: COUNTER_CLK, divided where windows step by several CLK periods.
    clk: Net,
    reset: Net,
    local_stop: Net,
}

impl Pins {
    fn declare(m: &mut ModuleBuilder, config: &SensorConfig) -> Self {
        let mut pins = Pins {
            init: m.input_bus("COUNTER_INIT", config.counter_bits),
            load: m.input("MEMORY_LOAD"),
            memory_reset: m.input("MEMORY_RESET"),
            clk: m.input("COUNTER_CLK"),
            reset: m.input("COUNTER_RESET"),
            local_stop: m.output("LOCAL_STOP"),
        };
        pins.clk = step_divider::place(m, pins.clk, pins.reset, config.step_bits());
        pins
    }

    /// Places the memory; returns MEMORY.
    fn memory(&self, m: &mut ModuleBuilder) -> Vec<Net> {
        let bits = self.init.len();
        let memory = m.wire_bus("MEMORY", bits);
        m.instance(
            "memory",
            &self::memory(bits),
            &[
                ("COUNTER_INIT", &self.init),
                ("MEMORY_LOAD", &[self.load]),
                ("MEMORY_RESET", &[self.memory_reset]),
                ("MEMORY", &memory),
            ],
        );
        memory
    }

    /// LOCAL_STOP of a ripple counter whose last output is `last`: a toggle flip-flop more, or that output.
    fn ripple_tap(&self, m: &mut ModuleBuilder, tap: Tap, last: Net, reset: Net) {
        match tap {
            Tap::Borrow => {
                let borrow_n = m.wire("BORROW_N");
                m.cell(
                    "borrow",
                    CellKind::Dffr,
                    &[borrow_n, last, reset],
                    &[self.local_stop, borrow_n],
                );
            }
            Tap::Msb => m.gate_into(CellKind::Buf, &[last], self.local_stop),
        }
    }
}

/// Reference model of a down counter: what it does, in numbers. The tap `borrow` makes it one bit wider than the start
/// value; LOCAL_STOP is its top bit.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct DownCounter {
    start: u32,
    value: u32,
    width: usize,
}

impl DownCounter {
    /// A counter that has just taken its start value.
    pub fn new(bits: usize, tap: Tap, start: u32) -> Self {
        DownCounter {
            start,
            value: start,
            width: bits + usize::from(tap == Tap::Borrow),
        }
    }

    /// Back to the start value.
    pub fn reset(&mut self) {
        self.value = self.start;
    }

    /// A rising edge of COUNTER_CLK.
    pub fn clock(&mut self) {
        self.value = self.value.wrapping_sub(1) & ((1 << self.width) - 1);
    }

    /// The count, borrow included.
    pub fn value(&self) -> u32 {
        self.value
    }

    /// LOCAL_STOP.
    pub fn local_stop(&self) -> bool {
        self.value >> (self.width - 1) & 1 == 1
    }
}

/// Reference model of a P-counter together with what the timing block makes of its LOCAL_STOP.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Model {
    divider: step_divider::Model,
    counter: Counter,
    after_borrow: AfterBorrow,
    bits: usize,
}

#[derive(Debug, Clone, Copy, PartialEq, Eq)]
enum Counter {
    Reloading(DownCounter),
    Free(DownCounter),
    Comparing(comparator::Model),
}

impl Model {
    /// The P-counter of this sensor, just reset (or, without memory, just loaded) with `start`.
    pub fn new(config: &SensorConfig, start: u16) -> Self {
        let (bits, start) = (config.counter_bits, u32::from(start));
        let down = DownCounter::new(bits, config.tap, start);
        Model {
            divider: step_divider::Model::new(config.step_bits()),
            counter: match config.p_counter {
                PCounter::Ripple | PCounter::SetReset | PCounter::Synchronous => {
                    Counter::Reloading(down)
                }
                PCounter::Comparator => Counter::Comparing(comparator::Model::new(bits, start)),
                PCounter::Memoryless => Counter::Free(down),
            },
            after_borrow: config.after_borrow,
            bits,
        }
    }

    /// COUNTER_RESET: back to the start value, which a counter without memory has forgotten. Returns whether
    /// LOCAL_STOP rose.
    pub fn reset(&mut self) -> bool {
        let before = self.local_stop();
        self.divider.reset();
        match &mut self.counter {
            Counter::Reloading(down) => down.reset(),
            Counter::Comparing(up) => up.reset(),
            Counter::Free(_) => {}
        }
        self.local_stop() && !before
    }

    /// A rising edge of COUNTER_CLK, if LOCAL_STOP does not block it. Returns whether LOCAL_STOP rose.
    pub fn clock(&mut self) -> bool {
        let before = self.local_stop();
        if before && self.after_borrow == AfterBorrow::Hold {
            return false;
        }
        if !self.divider.clock() {
            return false;
        }
        match &mut self.counter {
            Counter::Reloading(down) | Counter::Free(down) => down.clock(),
            Counter::Comparing(up) => up.clock(),
        }
        self.local_stop() && !before
    }

    /// COUNTER_OUT.
    pub fn counter_out(&self) -> u64 {
        let value = match &self.counter {
            Counter::Reloading(down) | Counter::Free(down) => down.value(),
            Counter::Comparing(up) => up.value(),
        };
        u64::from(value) & ((1 << self.bits) - 1)
    }

    /// LOCAL_STOP.
    pub fn local_stop(&self) -> bool {
        match &self.counter {
            Counter::Reloading(down) | Counter::Free(down) => down.local_stop(),
            Counter::Comparing(up) => up.local_stop(),
        }
    }
}

/// Counts, the first after the reset being number 0, at which LOCAL_STOP rises.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Rises {
    /// The first one.
    pub first: i64,
    /// Counts between one rise and the next; `None` where the counter waits after the first.
    pub every: Option<i64>,
}

impl Rises {
    /// When a sensor's LOCAL_STOP rises from this start value; `None` where it is high from the reset on and blocks
    /// the counter for good.
    pub fn of(config: &SensorConfig, start: u16) -> Option<Self> {
        let (bits, step) = (config.counter_bits, config.step_bits());
        let first = i64::from(start) << step;
        match config.after_borrow {
            AfterBorrow::Hold => {
                (!starts_high(config, start)).then_some(Rises { first, every: None })
            }
            AfterBorrow::Wrap => {
                let is_wider =
                    config.p_counter != PCounter::Comparator && config.tap == Tap::Borrow;
                let every = Some(1 << (bits + usize::from(is_wider) + step as usize));
                Some(Rises { first, every })
            }
        }
    }
}

/// Whether LOCAL_STOP is high already when the counter holds its start value.
pub fn starts_high(config: &SensorConfig, start: u16) -> bool {
    config.tap == Tap::Msb && start >> (config.counter_bits - 1) & 1 == 1
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    fn sensor(p_counter: PCounter, tap: Tap, after_borrow: AfterBorrow) -> SensorConfig {
        SensorConfig {
            p_counter,
            tap,
            after_borrow,
            ..SensorConfig::default()
        }
    }

    /// Transistors that one more bit costs.
    fn stage(p_counter: PCounter) -> u64 {
        let transistors = |counter_bits| {
            let config = sensor(p_counter, Tap::Borrow, AfterBorrow::Wrap);
            circuit(&SensorConfig {
                counter_bits,
                ..config
            })
            .transistors()
        };
        transistors(9) - transistors(8)
    }

    #[test]
    fn a_stage_is_two_flip_flops_and_a_four_transistor_mux() {
        let flip_flop = u64::from(CellKind::Dffr.transistors());
        assert_eq!(stage(PCounter::Ripple), 2 * flip_flop + 4);
    }

    #[test]
    fn the_other_stages_cost_what_the_table_says() {
        let stages = PCounter::ALL.map(stage);
        assert_eq!(stages, [52, 66, 68, 62, 42]);
    }

    #[test]
    fn local_stop_comes_one_edge_after_zero() {
        let mut model = Model::new(&SensorConfig::default(), 5);
        let rises: Vec<bool> = (0..10).map(|_| model.clock()).collect();
        assert_eq!(rises.iter().position(|&r| r), Some(5));
        assert_eq!(rises.iter().filter(|&&r| r).count(), 1);
        model.reset();
        assert!(!model.local_stop());
    }

    proptest! {
        #[test]
        fn rises_come_when_they_are_said_to(
            variant in 0usize..5,
            msb: bool,
            wraps: bool,
            counter_bits in 2usize..8,
            step in 0u32..3,
            start: u16,
        ) {
            let tap = if msb { Tap::Msb } else { Tap::Borrow };
            let after_borrow = if wraps { AfterBorrow::Wrap } else { AfterBorrow::Hold };
            let config = SensorConfig { counter_bits, step_periods: 1 << step, ..sensor(PCounter::ALL[variant], tap, after_borrow) };
            prop_assume!(config.check().is_ok());
            let start = start & config.largest_start();
            let mut model = Model::new(&config, start);
            prop_assert_eq!(model.local_stop(), starts_high(&config, start));
            let found: Vec<i64> = (0..1000).filter(|_| model.clock()).collect();
            let expected: Vec<i64> = match Rises::of(&config, start) {
                None => vec![],
                Some(Rises { first, every: None }) => vec![first],
                Some(Rises { first, every: Some(every) }) => (first..1000).step_by(every as usize).collect(),
            };
            prop_assert_eq!(found, expected);
        }
    }
}
