//! HSLIDAR, the chip that the demonstrator ran on (thesis 4.9, 6.3, Tables 10 and 11): 64×32 macropixels of 4×4 SPADs, a 7-bit
//! P-counter of set/reset flip-flops with a delayed reset (Fig. 51b) and 8 bins of 12 bits, in either of its modes:
//!
//! | mode | bin | window step | here |
//! |---|---|---|---|
//! | clocked | CLK period | 4 CLK periods, half a window | CLK at its most, 200 MHz (6.3.1) |
//! | delay line | element, 2.6 ns on average, 0.4 ns σ (Fig. 91) | CLK period | CLK at 80 MHz: 12.5 ns, or 1.875 m (Table 14) |
//!
//! Its clocked mode times photons with a counter TDC (4.9.3, 2.4.3). The thesis says of it that a bin is a CLK period; that all photons of a
//! bin count is chosen (`metdc_counter`). With `tdc = "clocked"` the chip has the QuantIC4x4's shift register, which counts one of them. Nor
//! does the thesis say how SPADs come together on a delay line: that they toggle one line through a tree of XORs, on which two
//! photons in the same bin cancel, is chosen.
//!
//! The chip has both modes; each is a sensor of its own here, because nothing of one is used in the other but what they share. The thesis
//! gives no dead time, no load clock and no scale for the delay that Fig. 90 shows from left to right: dead time and load clock are
//! the QuantIC4x4's, and the skew is chosen, 45 ps from column to column.

use super::sensor::Sensor;
use crate::chip::config::{PCounter, SensorConfig, Tdc};

/// The fastest CLK that the chip takes (thesis 6.3.1), Hz. The model's gates are those of a faster library.
pub const HSLIDAR_MOST_HZ: f64 = 200e6;

/// What it is.
pub(super) const HEAD: &str = "HSLIDAR, the chip of the thesis's demonstrator (4.9, 6.3, Tables 10 and 11), in one of its modes";

/// Why the main values of the clocked mode were chosen.
pub(super) const WHY: &[(&str, &str)] = &[
    ("rows", "the thesis's array of 64x32 (Table 11)"),
    ("cols", "the thesis's array of 64x32 (Table 11)"),
    ("counter_bits", "the thesis's P-counter (Fig. 51b)"),
    (
        "tdc",
        "of this mode the thesis says that a bin is a CLK period; that all photons of a bin count is chosen",
    ),
    (
        "step_periods",
        "windows step by half their length (Table 10)",
    ),
    ("bins", "a window of 40 ns (6 m)"),
    (
        "clk_hz",
        "the fastest CLK that the thesis's chip takes (6.3.1)",
    ),
];

/// Why those of the delay-line mode were chosen.
pub(super) const WHY_DELAY_LINE: &[(&str, &str)] = &[
    ("rows", "the thesis's array of 64x32 (Table 11)"),
    ("cols", "the thesis's array of 64x32 (Table 11)"),
    ("counter_bits", "the thesis's P-counter (Fig. 51b)"),
    (
        "tdc",
        "bins are the elements of delay lines, 2.6 ns on average (Fig. 91)",
    ),
    ("step_periods", "windows step by a CLK period (Table 10)"),
    ("clk_hz", "windows step by 12.5 ns, or 1.875 m (Table 14)"),
    (
        "clk_skew_ps",
        "Fig. 90 shows from left to right that CLK comes later, without a scale",
    ),
];

/// The chip in its clocked, guided mode, in typical silicon.
pub fn hslidar() -> Sensor {
    let config = SensorConfig {
        rows: 32,
        cols: 64,
        counter_bits: 7,
        p_counter: PCounter::SetReset,
        tdc: Tdc::Counter,
        step_periods: 4,
        reset_to_load: true,
        bins: 8,
        bin_bits: 12,
        clk_hz: HSLIDAR_MOST_HZ,
        ..SensorConfig::default()
    };
    config.into()
}

/// The chip in its delay-line, guided mode, in typical silicon.
pub fn hslidar_delay_line() -> Sensor {
    let config = SensorConfig {
        tdc: Tdc::DelayLine,
        step_periods: 1,
        clk_hz: 80e6,
        clk_skew_ps: 45.0,
        ..(*hslidar()).clone()
    };
    config.into()
}
