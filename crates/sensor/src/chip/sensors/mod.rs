//! Sensors: chips described once, one file each.
//!
//! ```text
//!   SensorConfig   geometry, blocks, clocks, mode ─┐
//!   Silicon        library corner, conditions, ────┴─► Sensor ──► circuits, delays, window law, every engine
//!                  mismatch                            (shared, immutable)
//! ```
//!
//! A [`Sensor`] is a value: engines keep one, and copies share what is in it.

use std::ops::Deref;
use std::sync::{Arc, OnceLock};

mod hslidar;
mod quantic4x4;

pub use hslidar::{HSLIDAR_MOST_HZ, hslidar, hslidar_delay_line};
pub use quantic4x4::quantic4x4;

use super::config::{SensorConfig, Tdc};
use super::sensor_file::SensorFault;
use super::timing::ChipTiming;
use super::timing::clk_skew::clk_skew;
use super::timing::delay_lines::{DelayLines, Taps};
use super::timing::silicon::Silicon;
use crate::units::Time;

/// A sensor that is possible, and what it is made of. Copies share their contents; the fields of its [`SensorConfig`] are
/// read as its own.
#[derive(Debug, Clone)]
pub struct Sensor(Arc<Parts>);

#[derive(Debug)]
struct Parts {
    config: SensorConfig,
    silicon: Silicon,
    timing: OnceLock<ChipTiming>,
    delay_lines: OnceLock<Arc<DelayLines>>,
    clk_skews: OnceLock<Box<[Time]>>,
    alike: OnceLock<Sensor>,
}

/// A chip's name, and what makes its [`Sensor`].
pub type Chip = (&'static str, fn() -> Sensor);

/// The chips described here.
pub const CHIPS: [Chip; 3] = [
    ("quantic4x4", quantic4x4),
    ("hslidar", hslidar),
    ("hslidar_delay_line", hslidar_delay_line),
];

impl Sensor {
    /// The chip of this name, one of [`CHIPS`].
    pub fn named(name: &str) -> Option<Self> {
        let chip = CHIPS.iter().find(|(known, _)| *known == name);
        chip.map(|(_, chip)| chip())
    }

    /// A sensor of this description, made of the library in its corner.
    ///
    /// # Errors
    /// What [`SensorConfig::check`] finds.
    pub fn new(config: SensorConfig) -> Result<Self, SensorFault> {
        config.check()?;
        Ok(config.into())
    }

    /// The same sensor made of other silicon: other conditions, mismatch of its cells.
    pub fn made_of(&self, silicon: &Silicon) -> Self {
        Self::from_parts(self.0.config.clone(), *silicon)
    }

    /// What it is made of.
    pub fn silicon(&self) -> &Silicon {
        &self.0.silicon
    }

    /// Delays of macropixel (0, 0), measured once. Where cells have mismatch, others have others.
    pub fn timing(&self) -> &ChipTiming {
        let Parts {
            config,
            silicon,
            timing,
            ..
        } = &*self.0;
        timing.get_or_init(|| match *silicon == Silicon::of(config) {
            true => ChipTiming::of(config),
            false => ChipTiming::measure(config, silicon),
        })
    }

    /// Taps of a macropixel's delay lines, by its number in the array, row-major; `None` where the TDC is clocked.
    pub(super) fn taps(&self, number: usize) -> Option<Taps> {
        let Parts {
            config,
            silicon,
            delay_lines,
            ..
        } = &*self.0;
        (config.tdc == Tdc::DelayLine).then(|| {
            let lines = delay_lines.get_or_init(|| DelayLines::of(config, silicon));
            lines.taps(number)
        })
    }

    /// Longer than the delay lines of any macropixel: twice the average, for mismatch and the slow corner. Nothing where there are
    /// none.
    pub fn longest_delay_line(&self) -> Time {
        let typical = self.delay_element() * (2 * self.bins as i64);
        match self.tdc {
            Tdc::Clocked => Time::ZERO,
            Tdc::DelayLine => Time::from_s(typical.as_s() * self.silicon().factor.max(1.0)),
        }
    }

    /// By how much CLK, STOP and RUN come later to a column of macropixels than to column 0: what its wires take in this silicon.
    pub fn clk_skew(&self, col: usize) -> Time {
        let Parts {
            config,
            silicon,
            clk_skews,
            ..
        } = &*self.0;
        if config.clk_skew_ps == 0.0 {
            return Time::ZERO;
        }
        let of_column = |col| clk_skew(config, silicon, col);
        let known = clk_skews.get_or_init(|| (0..config.cols).map(of_column).collect());
        known.get(col).copied().unwrap_or_else(|| of_column(col))
    }

    /// Whether macropixels differ by description: each has delay lines of its own, or CLK comes later to some. One window law
    /// does not describe them all then ([`WindowLaw::of_macropixel`](crate::chip::WindowLaw::of_macropixel)).
    pub fn has_own_laws(&self) -> bool {
        self.tdc == Tdc::DelayLine || self.clk_skew_ps > 0.0
    }

    /// This sensor of the library's own silicon with delay lines whose elements are all alike, and a CLK that comes everywhere at once:
    /// what is assumed of one that has not been calibrated. A copy, where it is such a sensor.
    #[must_use]
    pub fn alike(&self) -> Self {
        let config = SensorConfig {
            delay_sigma: 0.0,
            clk_skew_ps: 0.0,
            ..self.0.config.clone()
        };
        let silicon = Silicon::of(&config);
        let is_alike = config == self.0.config || !self.has_own_laws();
        if is_alike && silicon == self.0.silicon {
            return self.clone();
        }
        let alike = || Self::from_parts(config, silicon);
        self.0.alike.get_or_init(alike).clone()
    }

    fn from_parts(config: SensorConfig, silicon: Silicon) -> Self {
        Sensor(Arc::new(Parts {
            config,
            silicon,
            timing: OnceLock::new(),
            delay_lines: OnceLock::new(),
            clk_skews: OnceLock::new(),
            alike: OnceLock::new(),
        }))
    }
}

impl Deref for Sensor {
    type Target = SensorConfig;

    fn deref(&self) -> &SensorConfig {
        &self.0.config
    }
}

/// Sensors are equal if they are described alike and made of the same.
impl PartialEq for Sensor {
    fn eq(&self, other: &Self) -> bool {
        Arc::ptr_eq(&self.0, &other.0)
            || self.0.config == other.0.config && self.0.silicon == other.0.silicon
    }
}

impl Default for Sensor {
    /// The QuantIC4x4.
    fn default() -> Self {
        quantic4x4()
    }
}

impl From<SensorConfig> for Sensor {
    /// A sensor of this description, made of the library in its corner. The description must have passed
    /// [`SensorConfig::check`].
    fn from(config: SensorConfig) -> Self {
        let silicon = Silicon::of(&config);
        Self::from_parts(config, silicon)
    }
}

impl From<&SensorConfig> for Sensor {
    /// As from the [`SensorConfig`] itself.
    fn from(config: &SensorConfig) -> Self {
        config.clone().into()
    }
}

impl From<&Sensor> for Sensor {
    /// A copy, which shares its contents.
    fn from(sensor: &Sensor) -> Self {
        sensor.clone()
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::netlist::{Corner, Mismatch};

    #[test]
    fn copies_share_their_delays_and_other_silicon_has_others() {
        let sensor = quantic4x4();
        let copy = Sensor::from(&sensor);
        assert!(std::ptr::eq(sensor.timing(), copy.timing()));
        assert_eq!(*sensor.timing(), ChipTiming::of(&sensor));
        let slow = sensor.made_of(&sensor.silicon().at(1.5));
        assert!(slow.timing().ripple() > sensor.timing().ripple());
        assert!(slow != sensor && copy == sensor);
    }

    /// Delays of the slow corner are 1.45 times the typical ones, of the fast one 0.72; conditions scale them, and wires do not differ.
    #[test]
    fn clk_comes_as_late_to_a_column_as_its_silicon_is_slow() {
        for (corner, slower) in Corner::ALL.into_iter().zip([0.72, 1.0, 1.45]) {
            let sensor = Sensor::from(SensorConfig {
                corner,
                ..(*hslidar_delay_line()).clone()
            });
            let mismatch = Mismatch {
                sigma: 0.2,
                seed: 1,
            };
            for factor in [1.0, 1.3] {
                let sensor = sensor.made_of(&Silicon {
                    factor,
                    mismatch: Some(mismatch),
                    ..*sensor.silicon()
                });
                for col in [0, 1, 39, 63, 64] {
                    let wanted_fs = 45e3 * col as f64 * slower * factor;
                    let found_fs = sensor.clk_skew(col).as_fs() as f64;
                    assert!((found_fs - wanted_fs).abs() <= 2.0, "{col}: {found_fs}");
                }
            }
        }
    }

    #[test]
    fn what_is_assumed_without_calibration_is_made_once() {
        let clocked = quantic4x4();
        assert!(std::ptr::eq(clocked.timing(), clocked.alike().timing()));
        let lines = hslidar_delay_line();
        let alike = lines.alike();
        assert!(std::ptr::eq(alike.timing(), lines.clone().alike().timing()));
        assert!((lines.delay_sigma, lines.clk_skew_ps) > (0.0, 0.0));
        assert_eq!((alike.delay_sigma, alike.clk_skew_ps), (0.0, 0.0));
    }

    #[test]
    fn every_chip_is_possible_and_has_its_name() {
        for (name, chip) in CHIPS {
            assert!(chip().check().is_ok(), "{name}");
            assert_eq!(Sensor::named(name), Some(chip()));
        }
        assert!(Sensor::named("other").is_none());
    }

    /// Thesis 4.9.5 and Table 11.
    #[test]
    fn a_load_costs_frame_time_where_the_sensor_is_reset_for_it() {
        let exposed = Time::from_ns(1_000_000);
        for (sensor, is_reset) in [(quantic4x4(), false), (hslidar(), true)] {
            let counted = exposed + sensor.readout_time();
            let load = sensor.frame_time(exposed) - counted;
            let wanted = if is_reset {
                sensor.load_time()
            } else {
                Time::ZERO
            };
            assert_eq!(load, wanted);
            // Without an exposure to hide behind, the load is what a frame waits for.
            assert!(sensor.frame_time(Time::ZERO) >= sensor.load_time());
        }
    }

    #[test]
    fn what_is_impossible_is_no_sensor() {
        let config = SensorConfig {
            rows: 0,
            ..SensorConfig::default()
        };
        assert_eq!(Sensor::new(config).unwrap_err().key(), "rows");
    }
}
