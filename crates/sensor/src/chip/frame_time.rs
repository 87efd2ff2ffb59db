//! How long a load, a readout and a frame take.

use super::config::SensorConfig;
use super::readout::ReadoutOrder;
use crate::units::Time;

impl SensorConfig {
    /// Time of one readout.
    pub fn readout_time(&self) -> Time {
        let periods = ReadoutOrder::new(self).periods();
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
        if self.reset_to_load {
            counted + self.load_time()
        } else {
            counted.max(self.load_time())
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_frame_takes_its_readout_and_the_load_that_nothing_hides() {
        let mut config = SensorConfig::default();
        let read_s = ReadoutOrder::new(&config).periods() as f64 / config.read_clock().as_hz();
        let load_s = (config.load_bits() as f64 + 0.5) / config.load_clock().as_hz();
        assert!((config.readout_time().as_s() / read_s - 1.0).abs() < 1e-9);
        assert!((config.load_time().as_s() / load_s - 1.0).abs() < 1e-9);
        let [short, long] = [Time::from_ns(1_000), Time::from_ns(5_000_000)];
        assert_eq!(config.frame_time(long), long + config.readout_time());
        assert_eq!(
            config.frame_time(short),
            (short + config.readout_time()).max(config.load_time())
        );
        config.reset_to_load = true;
        let behind = config.readout_time() + config.load_time();
        assert_eq!(config.frame_time(short), short + behind);
    }
}
