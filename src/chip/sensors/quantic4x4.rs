//! QuantIC4x4, the guided direct time-of-flight chip (thesis 4.2, 4.8, Table 11): 64×64 macropixels of 4×4 SPADs, a 9-bit
//! ripple P-counter in each, 16 bins of 14 bits, one CLK period long, at 384 MHz.

use super::Sensor;
use crate::chip::config::{
    AfterBorrow, EventType, FrontEnd, Mode, Overflow, PCounter, SensorConfig, Tap, Tdc,
};
use crate::netlist::Corner;

/// The chip in its guided mode, in typical silicon.
pub fn quantic4x4() -> Sensor {
    SensorConfig::default().into()
}

impl Default for SensorConfig {
    /// The QuantIC4x4: what a sensor file leaves out.
    fn default() -> Self {
        SensorConfig {
            rows: 64,
            cols: 64,
            spad_rows: 4,
            spad_cols: 4,
            front_end: FrontEnd::Summation,
            coincident_spads: 2,
            counter_bits: 9,
            p_counter: PCounter::Ripple,
            tap: Tap::Borrow,
            after_borrow: AfterBorrow::Hold,
            step_periods: 1,
            tdc: Tdc::Clocked,
            delay_control_v: 0.70,
            delay_sigma: 0.154,
            delay_seed: 1,
            clk_skew_ps: 0.0,
            bins: 16,
            bin_bits: 14,
            clk_hz: 384e6,
            stop_phase_ps: 0.0,
            load_clk_hz: 200e6,
            reset_to_load: false,
            readout_pins: 8,
            read_clk_hz: 200e6,
            dead_time_ns: 8.0,
            paralysable: false,
            afterpulse_probability: 0.0,
            afterpulse_time_ns: 5.0,
            crosstalk_probability: 0.0,
            event_type: EventType::Greater,
            threshold: 0,
            overflow: Overflow::Saturate,
            mode: Mode::Guided,
            corner: Corner::Typ,
        }
    }
}
