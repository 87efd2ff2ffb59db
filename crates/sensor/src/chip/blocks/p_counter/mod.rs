//! P-counter: the programmable counter that opens a macropixel's time window, in every variant of the thesis (4.4).
//!
//! ```text
//!   COUNTER_INIT<n> ─► memory ─► start value ─┐
//!   MEMORY_LOAD ─────►                        ▼
//!   COUNTER_CLK ──────────────────────────► counter ─► LOCAL_STOP rises with COUNTER_CLK edge start + 1
//!   COUNTER_RESET (each STOP) ────────────►           after the reset
//! ```
//!
//! All have the same pins, so that the macropixel does not care. [`PCounter`] lists them, each with a [`Variant`]: what other
//! files ask of it, from the variant's own file. Two questions the thesis leaves open are keys of
//! the sensor file. [`Tap`]: it ties LOCAL_STOP to the counter's most significant bit *and* claims 2ⁿ window steps,
//! but a start value of 2ⁿ⁻¹ or more has that bit high from the reset on. The default, `borrow`, is a stage more,
//! which rises when the counter rolls over past zero for every start value. [`AfterBorrow`]: a counter that runs on
//! comes round, and raises LOCAL_STOP again, every 2ⁿ⁺¹ counts (2ⁿ with the tap `msb`). By default LOCAL_STOP
//! blocks COUNTER_CLK; the timing block sees to it. A step divider before the first stage lets windows step by several
//! CLK periods.

mod comparator;
mod gray;
mod memoryless;
mod ripple;
mod set_reset;
mod step_divider;
mod synchronous;

use std::sync::Arc;

use super::finished;
use crate::chip::config::{AfterBorrow, SensorConfig, Tap};
use crate::netlist::{CellKind, Module, ModuleBuilder, Net};
use crate::settings::words;

words! {
    /// How the P-counter is built (thesis 4.4). All have the same pins. Those with a memory open the same time windows where the
    /// counter holds after LOCAL_STOP. Where it wraps, LOCAL_STOP comes again after 2ⁿ⁺¹ counts of a counter of n bits with
    /// its borrow, and after 2ⁿ of one without: of the comparator, and of all with the tap `msb`.
    pub enum PCounter: Variant {
        /// Ripple down counter of reset-only flip-flops, Q or Q̄ chosen by the memory bit (Fig. 51c, 53).
        Ripple = "ripple": ripple::VARIANT,
        /// Ripple down counter of set/reset flip-flops and a delayed reset (Fig. 51b), the HSLIDAR's (4.9.2).
        SetReset = "set_reset": set_reset::VARIANT,
        /// Synchronous down counter (Fig. 50a).
        Synchronous = "synchronous": synchronous::VARIANT,
        /// Up counter from zero and a comparator (Fig. 49a).
        Comparator = "comparator": comparator::VARIANT,
        /// Ripple down counter without memory, loaded once, never reset: it comes round with STOP (4.4.3).
        Memoryless = "memoryless": memoryless::VARIANT,
        /// Synchronous down counter in Gray code, of which one bit changes with each count.
        Gray = "gray": gray::VARIANT,
    }
}

/// What other files ask of a variant.
#[derive(Debug)]
pub struct Variant {
    /// Its circuit; ports as in [`circuit`].
    pub circuit: fn(&SensorConfig) -> Arc<Module>,
    /// Its reference model, holding this start value.
    pub model: fn(&SensorConfig, u32) -> Box<dyn Counter>,
    /// How COUNTER_OUT shows a count.
    pub code: fn(u32) -> u32,
    /// What a bit more of it is called.
    pub stage: &'static str,
    /// What that costs, transistors; a test counts them ([`PCounter::stage_transistors`]).
    pub transistors: u64,
    /// Nets that no other variant has, for viewers.
    pub nets: &'static [&'static str],
    /// Whether it keeps the start value in a memory, from which each STOP resets it. Without one it must come round with STOP,
    /// and has no step divider.
    pub has_memory: bool,
    /// Why no bit of the count can be LOCAL_STOP, if none can. The tap `borrow` is no bit more, then.
    pub no_msb: Option<&'static str>,
    /// Whether a reset clears bits that it then sets, so that an `msb` that is high falls and rises at STOP.
    pub clears_first: bool,
}

impl Variant {
    /// A down counter with a memory, in plain binary.
    const fn down_counter(
        circuit: fn(&SensorConfig) -> Arc<Module>,
        stage: &'static str,
        transistors: u64,
    ) -> Self {
        Variant {
            circuit,
            model: |config, start| {
                Box::new(DownCounter::new(config.counter_bits, config.tap, start))
            },
            code: |count| count,
            stage,
            transistors,
            nets: &[],
            has_memory: true,
            no_msb: None,
            clears_first: false,
        }
    }
}

impl PCounter {
    /// The QuantIC4x4 with this P-counter, LOCAL_STOP taken where it suits.
    pub fn sensor(self) -> SensorConfig {
        let (tap, after_borrow) = match self.row().has_memory {
            true => (Tap::Borrow, AfterBorrow::Hold),
            false => (Tap::Msb, AfterBorrow::Wrap),
        };
        SensorConfig {
            p_counter: self,
            tap,
            after_borrow,
            ..SensorConfig::default()
        }
    }

    /// Transistors of a stage: what the ninth bit adds to its circuit.
    pub fn stage_transistors(self) -> u64 {
        let [nine, eight] = [9, 8].map(|counter_bits| {
            let sensor = SensorConfig {
                counter_bits,
                ..self.sensor()
            };
            circuit(&sensor).transistors()
        });
        nine - eight
    }
}

/// The P-counter of a sensor.
///
/// Ports: COUNTER_INIT\<bits\>, MEMORY_LOAD, MEMORY_RESET, COUNTER_CLK, COUNTER_RESET → LOCAL_STOP. Inside, the count
/// is COUNTER_OUT\<bits\> and the start value, where there is a memory, MEMORY\<bits\>.
pub fn circuit(config: &SensorConfig) -> Arc<Module> {
    match &config.p_counter_block {
        Some(own) => own.circuit("p_counter"),
        None => (config.p_counter.row().circuit)(config),
    }
}

/// The memory that keeps a start value: `bits` flip-flops clocked by MEMORY_LOAD.
///
/// Ports: COUNTER_INIT\<bits\>, MEMORY_LOAD, MEMORY_RESET → MEMORY\<bits\>.
pub(crate) fn memory(bits: usize) -> Arc<Module> {
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
        m.instance_by_names("memory", &self::memory(bits), &[]);
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

/// Reference model of a counter behind its clock: what it does, in numbers.
pub trait Counter: std::fmt::Debug {
    /// Back to where it counts from.
    fn reset(&mut self);
    /// A rising edge of its clock.
    fn clock(&mut self);
    /// The count, of which COUNTER_OUT shows the lower bits.
    fn count(&self) -> u32;
    /// LOCAL_STOP.
    fn local_stop(&self) -> bool;
}

/// Reference model of a down counter. The tap `borrow` makes it one bit wider than the start value; LOCAL_STOP is its top bit.
#[derive(Debug)]
pub struct DownCounter {
    start: u32,
    value: u32,
    width: usize,
}

impl DownCounter {
    /// A counter that has just taken its start value.
    pub(crate) fn new(bits: usize, tap: Tap, start: u32) -> Self {
        DownCounter {
            start,
            value: start,
            width: bits + usize::from(tap == Tap::Borrow),
        }
    }
}

impl Counter for DownCounter {
    fn reset(&mut self) {
        self.value = self.start;
    }

    fn clock(&mut self) {
        self.value = self.value.wrapping_sub(1) & ((1 << self.width) - 1);
    }

    fn count(&self) -> u32 {
        self.value
    }

    fn local_stop(&self) -> bool {
        self.value >> (self.width - 1) & 1 == 1
    }
}

/// Reference model of a P-counter together with what the timing block makes of its LOCAL_STOP.
#[derive(Debug)]
pub struct Model {
    variant: &'static Variant,
    divider: step_divider::Model,
    counter: Box<dyn Counter>,
    after_borrow: AfterBorrow,
    bits: usize,
}

impl Model {
    /// The P-counter of this sensor, just reset (or, without memory, just loaded) with `start`.
    pub fn new(config: &SensorConfig, start: u16) -> Self {
        let variant = config.p_counter.row();
        Model {
            variant,
            divider: step_divider::Model::new(config.step_bits()),
            counter: (variant.model)(config, start.into()),
            after_borrow: config.after_borrow,
            bits: config.counter_bits,
        }
    }

    /// COUNTER_RESET: back to the start value, which a counter without memory has forgotten. Returns whether
    /// LOCAL_STOP rose.
    pub fn reset(&mut self) -> bool {
        let before = self.local_stop();
        if self.variant.has_memory {
            self.divider.reset();
            self.counter.reset();
        }
        self.local_stop() && !before
    }

    /// A rising edge of COUNTER_CLK, if LOCAL_STOP does not block it. Returns whether LOCAL_STOP rose.
    pub fn clock(&mut self) -> bool {
        let before = self.local_stop();
        if before && self.after_borrow == AfterBorrow::Hold {
            return false;
        }
        if self.divider.clock() {
            self.counter.clock();
        }
        self.local_stop() && !before
    }

    /// COUNTER_OUT.
    pub fn counter_out(&self) -> u64 {
        let shown = (self.variant.code)(self.counter.count());
        u64::from(shown) & ((1 << self.bits) - 1)
    }

    /// LOCAL_STOP.
    pub fn local_stop(&self) -> bool {
        self.counter.local_stop()
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
    pub(crate) fn of(config: &SensorConfig, start: u16) -> Option<Self> {
        if let Some(law) = config.counter_law() {
            return law.rises(start);
        }
        let (bits, step) = (config.counter_bits, config.step_bits());
        let first = i64::from(start) << step;
        match config.after_borrow {
            AfterBorrow::Hold => {
                (!starts_high(config, start)).then_some(Rises { first, every: None })
            }
            AfterBorrow::Wrap => {
                let is_bit = config.p_counter.row().no_msb.is_none();
                let is_wider = is_bit && config.tap == Tap::Borrow;
                let every = Some(1 << (bits + usize::from(is_wider) + step as usize));
                Some(Rises { first, every })
            }
        }
    }
}

/// Whether LOCAL_STOP is high already when the counter holds its start value.
pub fn starts_high(config: &SensorConfig, start: u16) -> bool {
    if let Some(law) = config.counter_law() {
        return law.starts_high(start);
    }
    config.tap == Tap::Msb && start >> (config.counter_bits - 1) & 1 == 1
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    #[test]
    fn a_stage_costs_what_its_row_says() {
        for p_counter in PCounter::ALL {
            let found = p_counter.stage_transistors();
            assert_eq!(found, p_counter.row().transistors, "{p_counter:?}");
        }
        let flip_flop = u64::from(CellKind::Dffr.transistors());
        assert_eq!(PCounter::Ripple.row().transistors, 2 * flip_flop + 4);
    }

    #[test]
    fn the_nets_of_a_row_are_in_its_circuit() {
        for p_counter in PCounter::ALL {
            let circuit = circuit(&p_counter.sensor());
            for net in p_counter.row().nets {
                assert!(circuit.signals().iter().any(|s| s.name == *net), "{net}");
            }
        }
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
            p_counter in prop::sample::select(PCounter::ALL.to_vec()),
            msb: bool,
            wraps: bool,
            counter_bits in 2usize..8,
            step in 0u32..3,
            start: u16,
        ) {
            let tap = if msb { Tap::Msb } else { Tap::Borrow };
            let after_borrow = if wraps { AfterBorrow::Wrap } else { AfterBorrow::Hold };
            let config = SensorConfig { counter_bits, step_periods: 1 << step, p_counter, tap, after_borrow, ..SensorConfig::default() };
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
