//! QuantIC4x4, the guided direct time-of-flight chip (thesis 4.2, 4.8, Table 11): 64×64 macropixels of 4×4 SPADs, a 9-bit
//! ripple P-counter in each, 16 bins of 14 bits, one CLK period long, at 384 MHz.

use super::sensor::Sensor;
use crate::chip::config::SensorConfig;

/// What it is.
pub(super) const HEAD: &str = "QuantIC4x4, the guided chip of the thesis (4.2, 4.8, Table 11)";

/// Why its main values were chosen.
pub(super) const WHY: &[(&str, &str)] = &[
    ("rows", "the thesis's array of 64x64 (Table 11)"),
    (
        "cols",
        "0.25 degrees a macropixel in the street's field of 16 degrees",
    ),
    (
        "counter_bits",
        "512 start values of 0.39 m each: windows up to 200 m",
    ),
    (
        "bins",
        "a window of 6.2 m; a histogram of the whole 200 m would need 512 bins, which do not fit beside the SPADs",
    ),
    ("bin_bits", "16383 laser cycles fill a bin at the soonest"),
    (
        "clk_hz",
        "bins of 2.6 ns (0.39 m), about half as long as the laser's pulse of 4.5 ns",
    ),
    (
        "dead_time_ns",
        "longer than a CLK period of 2.6 ns, or two photons of a SPAD could cancel",
    ),
];

/// The chip in its guided mode, in typical silicon.
pub fn quantic4x4() -> Sensor {
    SensorConfig::default().into()
}
