//! The request for light without a chip: laser cycles, and the SPADs of a macropixel.
//!
//! ```text
//!   sensor: SPADs, CLK, array ─┐
//!   scene ─────────────────────┼─► LightRequest ─► LightSource
//!   period, SPADs, view ───────┘
//! ```

use super::frame::as_warm_as;
use super::spelling::Spelling;
use super::wording::{exposure, of_engine};
use crate::chip::Sensor;
use crate::files::InputError;
use crate::photons::{LightSource, LightSourceError, LitExposure};
use crate::scene::{Lidar, Scene};
use crate::settings::Settings;
use crate::units::{Frequency, Time};

/// Laser periods that are drawn, ns: up to a laser of 1 kHz.
const PERIODS_NS: std::ops::RangeInclusive<f64> = 1.0..=1e6;

/// Longest exposure, s: times are 64-bit femtoseconds, of which there are 9223 s.
const LONGEST_S: f64 = 9000.0;

/// What light is asked for. The default is an exposure of the sensor, all of whose macropixels see the scene.
#[derive(Debug, Clone, PartialEq)]
pub struct LightRequest {
    /// Length of a laser cycle, ns, to the femtosecond; CLK periods of the sensor if `None`.
    pub period_ns: Option<f64>,
    /// CLK periods in a laser cycle.
    pub stop_periods: u32,
    /// Laser cycles.
    pub laser_cycles: u32,
    /// Seed of the photons.
    pub seed: u64,
    /// SPADs of a macropixel, 1 to 64, instead of the sensor's.
    pub spads: Option<usize>,
    /// A single macropixel with this horizontal field of view, degrees, instead of the sensor's array.
    pub fov_deg: Option<f64>,
    /// What complaints call these settings.
    pub spelling: Spelling,
}

impl Default for LightRequest {
    fn default() -> Self {
        LightRequest {
            period_ns: None,
            stop_periods: 520,
            laser_cycles: 1000,
            seed: 1,
            spads: None,
            fov_deg: None,
            spelling: Spelling::default(),
        }
    }
}

impl LightRequest {
    /// The light of a scene on the sensor's SPADs.
    ///
    /// # Errors
    /// Impossible values, named by the setting at fault, and light that does not fit into memory.
    pub fn source(&self, sensor: Sensor, mut scene: Scene) -> Result<LightSource, InputError> {
        let sensor = as_warm_as(&scene, sensor)?;
        let mut size = (sensor.rows, sensor.cols);
        if let Some(fov_deg) = self.fov_deg {
            let key = Lidar::KEYS.iter().find(|key| key.name == "fov_deg");
            let fault = key.and_then(|key| key.fault(&toml::Value::from(fov_deg)));
            if let Some(fault) = fault {
                return Err(self.wrong("fov_deg", fault));
            }
            scene.lidar.fov_deg = fov_deg;
            size = (1, 1);
        }
        let mut lit = self.laser_cycles_of(&sensor)?;
        if let Some(spads) = self.spads {
            lit = lit.with_spads(spads).ok_or_else(|| {
                let message = format!("{spads} are no SPADs of a macropixel; give 1 to 64");
                self.wrong("spads", message)
            })?;
        }
        LightSource::of_scene(&scene, size, &lit).map_err(|why| self.too_bright(&why))
    }

    fn laser_cycles_of(&self, sensor: &Sensor) -> Result<LitExposure, InputError> {
        let Some(period_ns) = self.period_ns else {
            exposure(sensor, self.stop_periods, self.laser_cycles, self.spelling)?;
            let cycles = (self.stop_periods, self.laser_cycles);
            return Ok(LitExposure::of_sensor(sensor, cycles, self.seed));
        };
        if !PERIODS_NS.contains(&period_ns) {
            let message = format!("{period_ns} ns is no laser period; give 1 to 1e6 ns");
            return Err(self.wrong("period_ns", message));
        }
        let period = Time::from_s(period_ns * 1e-9);
        let seconds = period.as_s() * f64::from(self.laser_cycles);
        if self.laser_cycles == 0 {
            let message = "an exposure needs a laser cycle; give at least 1";
            return Err(self.wrong("laser_cycles", message));
        }
        if seconds > LONGEST_S {
            let message = format!(
                "{} laser cycles of {period_ns} ns last {seconds:.0} s; stay below {LONGEST_S} s",
                self.laser_cycles
            );
            return Err(self.wrong("laser_cycles", message));
        }
        let clock = Frequency::from_period(period)
            .map_err(|why| self.wrong("period_ns", why.to_string()))?;
        Ok(LitExposure {
            clock,
            periods: 1,
            laser_cycles: self.laser_cycles,
            lead: Time::ZERO,
            clk_phase: Time::ZERO,
            ..LitExposure::of_sensor(sensor, (2, 1), self.seed)
        })
    }

    fn wrong(&self, key: &str, message: impl Into<String>) -> InputError {
        InputError::new(self.spelling.name(key), message)
    }

    fn too_bright(&self, why: &LightSourceError) -> InputError {
        match why {
            LightSourceError::Echo(why) => {
                InputError::new("the light", of_engine(why, self.spelling))
            }
            LightSourceError::Background { .. } => {
                let cure = match self.period_ns {
                    Some(_) => self.spelling.name("period_ns"),
                    None => self.spelling.name("stop_periods"),
                };
                InputError::new(
                    "the light",
                    format!("{why}; give less light or a shorter {cure}"),
                )
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn what_is_impossible_is_named() {
        let usual = LightRequest::default;
        let one = |request: LightRequest| {
            let sensor = Sensor::default();
            let said = request.source(sensor, Scene::outdoor());
            said.map(|_| ()).unwrap_err().to_string()
        };
        for (request, key) in [
            (
                LightRequest {
                    period_ns: Some(0.5),
                    ..usual()
                },
                "period_ns",
            ),
            (
                LightRequest {
                    period_ns: Some(f64::NAN),
                    ..usual()
                },
                "period_ns",
            ),
            (
                LightRequest {
                    period_ns: Some(1e6),
                    laser_cycles: 10_000_000,
                    ..usual()
                },
                "laser_cycles",
            ),
            (
                LightRequest {
                    period_ns: Some(100.0),
                    laser_cycles: 0,
                    ..usual()
                },
                "laser_cycles",
            ),
            (
                LightRequest {
                    stop_periods: 1,
                    ..usual()
                },
                "stop_periods",
            ),
            (
                LightRequest {
                    spads: Some(65),
                    ..usual()
                },
                "spads",
            ),
            (
                LightRequest {
                    fov_deg: Some(0.0),
                    ..usual()
                },
                "fov_deg",
            ),
        ] {
            for spelling in [Spelling::Keys, Spelling::Options] {
                let said = one(LightRequest {
                    spelling,
                    ..request.clone()
                });
                assert!(said.starts_with(&spelling.name(key)), "{said}");
                assert!(said.contains("; ") || said.contains("give"), "{said}");
            }
        }
    }

    /// The same photons whether CLK or a period says how long a laser cycle is would need the same slots; the means are the same.
    #[test]
    fn a_period_is_exact_and_changes_no_light() {
        let small = Sensor::from(crate::chip::SensorConfig {
            rows: 2,
            cols: 3,
            ..Default::default()
        });
        let of_period = LightRequest {
            period_ns: Some(777.123_457),
            laser_cycles: 10,
            ..LightRequest::default()
        };
        let source = of_period.source(small.clone(), Scene::outdoor()).unwrap();
        assert_eq!(source.end(), Time::from_fs(7_771_234_570));
        let of_chip = LightRequest {
            laser_cycles: 10,
            ..LightRequest::default()
        };
        let of_chip = of_chip.source(small, Scene::outdoor()).unwrap();
        for pixel in 0..6 {
            assert_eq!(source.facts(pixel), of_chip.facts(pixel));
        }
    }

    #[test]
    fn a_view_of_its_own_is_one_macropixel() {
        let request = LightRequest {
            fov_deg: Some(0.5),
            laser_cycles: 10,
            ..LightRequest::default()
        };
        let source = request.source(Sensor::default(), Scene::outdoor()).unwrap();
        assert_eq!((source.rows, source.cols, source.pixels()), (1, 1, 1));
        assert!(source.facts(0).truth_m.is_some());
    }
}
