//! Sensors: chips described once, one file each.
//!
//! ```text
//!   SensorConfig   geometry, blocks, clocks, mode ─┐
//!   Silicon        library corner, conditions, ────┴─► Sensor ──► circuits, delays, window law, every engine
//!                  mismatch                            (shared, immutable)
//! ```
//!
//! A [`Sensor`] is a value: engines keep one, and copies share what is in it.

mod hslidar;
mod quantic4x4;
mod sensor;
mod vcsel_flash;

pub use hslidar::{HSLIDAR_MOST_HZ, hslidar, hslidar_delay_line};
pub use quantic4x4::quantic4x4;
pub use sensor::Sensor;
pub use vcsel_flash::vcsel_flash;

use crate::settings::Notes;

/// A chip that is described here.
#[derive(Debug, Clone, Copy)]
pub struct Chip {
    /// What `--sensor` takes.
    pub name: &'static str,
    /// Makes its [`Sensor`].
    pub sensor: fn() -> Sensor,
    /// What it is.
    pub head: &'static str,
    /// Why its main values were chosen, by their keys.
    pub reasons: &'static [(&'static str, &'static str)],
}

/// The chips described here; the first is the default.
pub const CHIPS: [Chip; 4] = [
    Chip {
        name: "quantic4x4",
        sensor: quantic4x4,
        head: quantic4x4::HEAD,
        reasons: quantic4x4::WHY,
    },
    Chip {
        name: "vcsel_flash",
        sensor: vcsel_flash,
        head: vcsel_flash::HEAD,
        reasons: vcsel_flash::WHY,
    },
    Chip {
        name: "hslidar",
        sensor: hslidar,
        head: hslidar::HEAD,
        reasons: hslidar::WHY,
    },
    Chip {
        name: "hslidar_delay_line",
        sensor: hslidar_delay_line,
        head: hslidar::HEAD,
        reasons: hslidar::WHY_DELAY_LINE,
    },
];

/// The chip of this name, one of [`CHIPS`].
fn chip(name: &str) -> Option<&'static Chip> {
    CHIPS.iter().find(|chip| chip.name == name)
}

impl Sensor {
    /// The chip of this name, one of [`CHIPS`].
    pub fn named(name: &str) -> Option<Self> {
        chip(name).map(|chip| (chip.sensor)())
    }

    /// Why the main values of the chip of this name, one of [`CHIPS`], were chosen.
    pub fn built_in_notes(name: &str) -> Option<Notes> {
        let chip = chip(name)?;
        let chosen = (chip.sensor)().table();
        Some(Notes::from_keys(chip.head, chip.reasons, chosen))
    }
}

impl Default for Sensor {
    /// The QuantIC4x4.
    fn default() -> Self {
        quantic4x4()
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::chip::{ChipTiming, SensorConfig, Silicon};
    use crate::netlist::{Corner, Mismatch};
    use crate::units::Time;

    #[test]
    fn copies_share_their_delays_and_other_silicon_has_others() {
        let sensor = quantic4x4();
        let copy = Sensor::from(&sensor);
        assert!(std::ptr::eq(sensor.timing(), copy.timing()));
        assert_eq!(*sensor.timing(), ChipTiming::new(&sensor));
        let slow = sensor.made_of(&sensor.silicon().with_factor(1.5));
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
        for Chip {
            name, sensor: chip, ..
        } in CHIPS
        {
            assert!(chip().check().is_ok(), "{name}");
            assert_eq!(Sensor::named(name), Some(chip()));
            // The file with reasons reads back unchanged, and has them all.
            let notes = Sensor::built_in_notes(name).unwrap();
            let text = chip().commented_with(&notes);
            assert_eq!(SensorConfig::parse(name, &text).unwrap(), *chip(), "{name}");
            let (_, keys) = text.split_once("# A sensor").unwrap();
            assert!(keys.matches("# Why: ").count() >= 5, "{name}");
        }
        assert!(Sensor::built_in_notes("other").is_none());
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
