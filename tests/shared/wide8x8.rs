//! A sensor of another kind, in one file: 8×8 SPADs a macropixel, a 7-bit P-counter, 32 bins of 12 bits.

use guided_dtof::chip::{EventType, PCounter, Sensor, SensorConfig, SensorFault};

/// 16×8 macropixels that count where two SPADs fire together, at 250 MHz.
///
/// # Errors
/// None: the description is possible.
pub fn wide8x8() -> Result<Sensor, SensorFault> {
    Sensor::new(SensorConfig {
        rows: 16,
        cols: 8,
        spad_rows: 8,
        spad_cols: 8,
        counter_bits: 7,
        p_counter: PCounter::SetReset,
        bins: 32,
        bin_bits: 12,
        clk_hz: 250e6,
        dead_time_ns: 10.0,
        event_type: EventType::Greater,
        threshold: 1,
        ..SensorConfig::default()
    })
}
