//! A flash lidar for halls and vehicles in them: 128×96 macropixels at 200 MHz, before a VCSEL array of 940 nm.
//!
//! No published chip has these numbers. They are chosen, for the scene `warehouse` and for a start of one's own; `WHY` has the reasons.
//!
//! Everything else is the QuantIC4x4's, so it has its macropixel of 4×4 SPADs and its front end. The dead time of 8 ns is longer
//! than a CLK period, as that front end requires. Laser and lens belong to the scene.

use super::sensor::Sensor;
use crate::chip::config::SensorConfig;

/// What it is.
pub(super) const HEAD: &str = "A flash lidar for halls, made for the scene warehouse. No published chip has these numbers; all are chosen. Keys without a reason have the QuantIC4x4's value";

/// Why its main values were chosen.
pub(super) const WHY: &[(&str, &str)] = &[
    (
        "rows",
        "with the 47 degrees of the warehouse's lidar a macropixel is 0.49 degrees high",
    ),
    (
        "cols",
        "with its 60 degrees a macropixel is 0.47 degrees wide: 14 cm at 17 m, so a pallet covers several",
    ),
    (
        "counter_bits",
        "windows up to 46 m, more than a hall needs; three stages fewer than the QuantIC4x4's",
    ),
    (
        "bins",
        "a window of 24 m holds the estimate of cameras 20 cm apart everywhere in a hall",
    ),
    (
        "bin_bits",
        "4095 laser cycles fill a bin at the soonest, four exposures of 1000",
    ),
    (
        "clk_hz",
        "bins of 5 ns (0.75 m) are as long as the pulse of a VCSEL array; a shorter bin holds less of the echo",
    ),
    (
        "dead_time_ns",
        "longer than a CLK period of 5 ns, as this front end requires",
    ),
];

/// The chip in its guided mode, in typical silicon.
pub fn vcsel_flash() -> Sensor {
    let config = SensorConfig {
        rows: 96,
        cols: 128,
        counter_bits: 6,
        bins: 32,
        bin_bits: 12,
        clk_hz: 200e6,
        ..SensorConfig::default()
    };
    config.into()
}
