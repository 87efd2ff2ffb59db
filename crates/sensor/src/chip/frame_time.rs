//! How long a load, a readout and a frame take.

use super::config::SensorConfig;
use super::readout::ReadoutOrder;
use crate::units::Time;

impl SensorConfig {
    /// Time of one readout.
    pub fn readout_time(&self) -> Time {
        let periods = ReadoutOrder::of(self).periods();
        self.read_clock().periods(periods as i64)
    }

    /// Time of one serial load.
    pub fn load_time(&self) -> Time {
        self.load_clock()
            .half_periods(2 * self.load_bits() as i64 + 1)
    }

    /// Time from one frame to the next one with windows of its own, of an exposure that ends `exposed` after it began: the load
    /// goes on while the frame before is exposed and read out, and is hidden behind them, unless the sensor has to be reset for
    /// it (thesis 4.9.5). Guide and ranging take none of it.
    pub fn frame_time(&self, exposed: Time) -> Time {
        let counted = exposed + self.readout_time();
        match self.reset_to_load {
            true => counted + self.load_time(),
            false => counted.max(self.load_time()),
        }
    }
}
