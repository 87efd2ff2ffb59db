//! What a P-counter is to other files: its row, and the reference model of its counting.

use std::sync::Arc;

use crate::chip::config::{SensorConfig, Tap};
use crate::netlist::Module;

/// What other files ask of a variant.
#[derive(Debug)]
pub struct PCounterVariant {
    /// Its circuit; ports as in [`super::circuit`].
    pub circuit: fn(&SensorConfig) -> Arc<Module>,
    /// Its reference model, holding this start value.
    pub model: fn(&SensorConfig, u32) -> Box<dyn Counter>,
    /// How COUNTER_OUT shows a count.
    pub code: fn(u32) -> u32,
    /// What a bit more of it is called.
    pub stage: &'static str,
    /// What that costs, transistors; a test counts them ([`PCounter::stage_transistors`](crate::chip::PCounter::stage_transistors)).
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

impl PCounterVariant {
    /// A down counter with a memory, in plain binary.
    pub(super) const fn down_counter(
        circuit: fn(&SensorConfig) -> Arc<Module>,
        stage: &'static str,
        transistors: u64,
    ) -> Self {
        PCounterVariant {
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
