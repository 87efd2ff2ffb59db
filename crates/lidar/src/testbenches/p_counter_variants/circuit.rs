//! What the circuits of this testbench have in common: when they start, and a P-counter with its timing block.

use crate::chip::{SensorConfig, p_counter, p_counter_timing};
use crate::netlist::{ModuleBuilder, Net};
use crate::units::Time;

/// First STOP edge.
pub(super) const ORIGIN: Time = Time::from_ns(60);
/// When the chip comes out of reset.
pub(super) const RESET_END: Time = Time::from_ns(2);

/// Places a P-counter and its timing block among pins of their names; returns COUNTER_RESET.
pub(super) fn place_counter(m: &mut ModuleBuilder, config: &SensorConfig) -> Net {
    m.input_bus("COUNTER_INIT", config.counter_bits);
    m.wire("LOCAL_STOP");
    m.wire("COUNTER_CLK");
    let counter_reset = m.wire("COUNTER_RESET");
    m.wire("MEMORY_RESET");
    m.wire("STOP_D");
    let timing = p_counter_timing::circuit(config.after_borrow, config.reset_buffers());
    m.instance_by_names("p_counter_timing", &timing, &[]);
    m.instance_by_names("p_counter", &p_counter::circuit(config), &[]);
    counter_reset
}
