//! A flash lidar for halls and vehicles in them: 128×96 macropixels at 200 MHz, before a VCSEL array of 940 nm.
//!
//! No published chip has these numbers. They are chosen, for the scene `warehouse` and for a start of one's own:
//!
//! | key | value | why |
//! |---|---|---|
//! | rows, columns | 96 × 128 | 0.47° a macropixel in a field of 60° × 47°: 14 cm at 17 m, a pallet is several macropixels wide |
//! | CLK | 200 MHz | bins of 5 ns (0.75 m), the length of a VCSEL's pulse: a shorter bin finds less of the echo in it |
//! | bins | 32 | a window of 24 m: a camera pair with a short baseline is sure enough of it everywhere in a hall |
//! | P-counter | 6 bits | windows up to 46 m, which is more than a hall needs; three stages fewer than the QuantIC4x4's |
//! | bits of a bin | 12 | 4095 laser cycles fill a bin at the soonest, four exposures of 1000 |
//!
//! Everything else is the QuantIC4x4's, so it has its macropixel of 4×4 SPADs and its front end. The dead time of 8 ns is longer
//! than a CLK period, as that front end requires. Laser and lens belong to the scene.

use super::sensor::Sensor;
use crate::chip::config::SensorConfig;

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
