//! HSLIDAR, the chip that the demonstrator ran on (thesis 4.9, 6.3, Tables 10 and 11), in its clocked mode: 64×32
//! macropixels of 4×4 SPADs, a 7-bit P-counter of set/reset flip-flops with a delayed reset (Fig. 51b), 8 bins of 12 bits, one
//! CLK period long, and windows that step by four: half a window (Table 10).
//!
//! CLK may have 200 MHz at most (6.3.1), which is what it has here. The thesis gives no dead time and no load clock: those
//! are the QuantIC4x4's. Its other mode, whose bins are taps of a delay line, is not built yet.

use super::Sensor;
use crate::chip::config::{PCounter, SensorConfig};

/// The chip in its clocked, guided mode, in typical silicon.
pub fn hslidar() -> Sensor {
    let config = SensorConfig {
        rows: 32,
        cols: 64,
        counter_bits: 7,
        p_counter: PCounter::SetReset,
        step_periods: 4,
        bins: 8,
        bin_bits: 12,
        clk_hz: 200e6,
        ..SensorConfig::default()
    };
    config.into()
}
