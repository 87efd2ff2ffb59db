//! P-counter: the programmable counter that opens a macropixel's time window, in every variant of the thesis (4.4).
//!
//! ```text
//!   COUNTER_INIT<n> ─► memory ─► start value ─┐
//!   MEMORY_LOAD ─────►                        ▼
//!   COUNTER_CLK ──────────────────────────► counter ─► LOCAL_STOP rises with COUNTER_CLK edge start + 1
//!   COUNTER_RESET (each STOP) ────────────►           after the reset
//! ```
//!
//! All have the same pins, so that the macropixel does not care. [`PCounter`] lists them, each with a [`PCounterVariant`]: what other
//! files ask of it, from the variant's own file. Two questions the thesis leaves open are keys of
//! the sensor file. [`Tap`]: it ties LOCAL_STOP to the counter's most significant bit *and* claims 2ⁿ window steps,
//! but a start value of 2ⁿ⁻¹ or more has that bit high from the reset on. The default, `borrow`, is a stage more,
//! which rises when the counter rolls over past zero for every start value. [`AfterBorrow`]: a counter that runs on
//! comes round, and raises LOCAL_STOP again, every 2ⁿ⁺¹ counts (2ⁿ with the tap `msb`). By default LOCAL_STOP
//! blocks COUNTER_CLK; the timing block sees to it. A step divider before the first stage lets windows step by several
//! CLK periods.

pub(in crate::chip) mod count_down;
mod pins;
mod step_divider;
mod variant;
pub(in crate::chip) mod variants;

use std::sync::Arc;

use crate::chip::config::{AfterBorrow, PCounter, SensorConfig, Tap};
use crate::chip::own_block::block::OwnBlock;
use crate::netlist::Module;

pub(crate) use pins::memory;
pub use variant::{Counter, DownCounter, PCounterVariant};

impl PCounter {
    /// What other files ask of it.
    pub fn row(self) -> &'static PCounterVariant {
        const ROWS: [&PCounterVariant; PCounter::ALL.len()] = variants::rows!();
        ROWS[self as usize]
    }

    /// The QuantIC4x4 with this P-counter, LOCAL_STOP taken where it suits.
    pub fn sensor(self) -> SensorConfig {
        let (tap, after_borrow) = if self.row().has_memory {
            (Tap::Borrow, AfterBorrow::Hold)
        } else {
            (Tap::Msb, AfterBorrow::Wrap)
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
    let own = config.p_counter_block.as_ref();
    OwnBlock::or(own, "p_counter", || {
        (config.p_counter.row().circuit)(config)
    })
}

/// Reference model of a P-counter together with what the timing block makes of its LOCAL_STOP.
#[derive(Debug)]
pub struct PCounterModel {
    variant: &'static PCounterVariant,
    divider: step_divider::StepDividerModel,
    counter: Box<dyn Counter>,
    after_borrow: AfterBorrow,
    bits: usize,
}

impl PCounterModel {
    /// The P-counter of this sensor, just reset (or, without memory, just loaded) with `start`.
    pub fn new(config: &SensorConfig, start: u16) -> Self {
        let variant = config.p_counter.row();
        PCounterModel {
            variant,
            divider: step_divider::StepDividerModel::new(config.step_bits()),
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
    pub fn from_start_value(config: &SensorConfig, start: u16) -> Option<Self> {
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
    use crate::netlist::CellKind;
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
        let mut model = PCounterModel::new(&SensorConfig::default(), 5);
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
            let mut model = PCounterModel::new(&config, start);
            prop_assert_eq!(model.local_stop(), starts_high(&config, start));
            let found: Vec<i64> = (0..1000).filter(|_| model.clock()).collect();
            let expected: Vec<i64> = match Rises::from_start_value(&config, start) {
                None => vec![],
                Some(Rises { first, every: None }) => vec![first],
                Some(Rises { first, every: Some(every) }) => (first..1000).step_by(every as usize).collect(),
            };
            prop_assert_eq!(found, expected);
        }
    }
}
