//! QuantIC4x4, the guided direct time-of-flight chip (thesis 4.2, 4.8, Table 11): 64×64 macropixels of 4×4 SPADs, a 9-bit
//! ripple P-counter in each, 16 bins of 14 bits, one CLK period long, at 384 MHz.

use super::sensor::Sensor;
use crate::chip::config::SensorConfig;

/// The chip in its guided mode, in typical silicon.
pub fn quantic4x4() -> Sensor {
    SensorConfig::default().into()
}
