//! Scenarios of the library's strategies for tests that go through seeds, with photons at any time.

use std::path::{Path, PathBuf};

use guided_dtof::chip::{AfterBorrow, Exposure, PCounter, SensorConfig, Silicon, Tap};
use guided_dtof_sensor::strategies::{
    self, drawn, exposures, photons_anywhere, scenarios, scenarios_of, sensors_of_every_engine,
};
use rand::{RngExt, rngs::StdRng};

pub use guided_dtof_sensor::strategies::Scenario;

/// Photons of a macropixel.
const MOST_PHOTONS: usize = 199;

/// Anything that every engine takes, in an array of this size.
pub fn random(random: &mut StdRng, rows: usize, cols: usize) -> Scenario {
    let sensors = sensors_of_every_engine(&[example_library()]);
    let photons = photons_anywhere(MOST_PHOTONS);
    let scenarios = scenarios(sensors, photons, rows..=rows, cols..=cols);
    drawn(random.random(), &scenarios)
}

/// Anything that may happen to this sensor.
pub fn of_sensor(random: &mut StdRng, config: SensorConfig) -> Scenario {
    let exposure = drawn(random.random(), &exposures(&config));
    in_exposure(random, config, exposure)
}

/// Any start values and photons.
pub fn in_exposure(random: &mut StdRng, config: SensorConfig, exposure: Exposure) -> Scenario {
    let photons = photons_anywhere(MOST_PHOTONS);
    drawn(random.random(), &scenarios_of(config, exposure, photons))
}

/// Every P-counter that a sensor may have.
pub fn p_counters() -> Vec<(PCounter, Tap, AfterBorrow)> {
    let mut all = Vec::new();
    for p_counter in PCounter::ALL {
        for tap in Tap::ALL {
            for after_borrow in AfterBorrow::ALL {
                let config = SensorConfig {
                    p_counter,
                    tap,
                    after_borrow,
                    ..SensorConfig::default()
                };
                if config.check().is_ok() {
                    all.push((p_counter, tap, after_borrow));
                }
            }
        }
    }
    all
}

/// What a chip of this description may be made of.
pub fn silicon(random: &mut StdRng, config: &SensorConfig) -> Silicon {
    drawn(random.random(), &strategies::silicon(config))
}

/// The library of invented numbers.
pub fn example_library() -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join("vectors/liberty/example.lib")
}
