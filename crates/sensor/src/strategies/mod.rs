//! Random chips, clocks, corners, cell libraries and photons for property tests: strategies of the crate `proptest`.
//!
//! ```text
//!   sensors ──┐
//!   exposures ┼─► scenarios ─► check_property ─── holds
//!   starts    │                     └─ fails ──► smallest case ──► failing_case.vcd, .gtkw, .sucl
//!   photons ──┘
//! ```
//!
//! | file | what it draws |
//! |---|---|
//! | `sensors` | descriptions of sensors that [`SensorConfig::check`](crate::chip::SensorConfig::check) takes |
//! | `exposures` | CLK, the phase of STOP against it, lengths of laser cycles, start values |
//! | `silicon` | process, voltage, temperature and mismatch |
//! | `libraries` | cell libraries as Liberty text |
//! | `photons` | SPAD pulses: anywhere, near edges of CLK and of the window, in bursts, after the dead time |
//! | `scenarios` | all of these together, and what the gates do with them |
//! | `waveforms` | runs a property, and writes its smallest failing case as a waveform |
//!
//! Values shrink towards few macropixels, low start values, few and early photons, and the QuantIC4x4's blocks. A property takes a
//! [`Scenario`]:
//!
//! ```
//! use guided_dtof_sensor::engine::{Replay, Window};
//! use guided_dtof_sensor::strategies::{
//!     Scenario, check_property, photons, scenarios, sensors_of_every_engine,
//! };
//! use proptest::prelude::*;
//!
//! let cases = scenarios(sensors_of_every_engine(&[]), photons(20), 1..=1, 1..=2);
//! let bins_keep_their_bits = |scenario: &Scenario| {
//!     let window = Window::new(&scenario.config, &scenario.exposure);
//!     // Where two signals race, the engine leaves it to the gates.
//!     if let Ok(counts) = window.histograms(&scenario.starts, &scenario.pulses()) {
//!         let full = (1 << scenario.config.bin_bits) - 1;
//!         prop_assert!(counts.iter().flatten().all(|&count| count <= full));
//!     }
//!     Ok(())
//! };
//! check_property(20, &cases, bins_keep_their_bits, "out".as_ref()).unwrap();
//! ```

mod exposures;
mod libraries;
mod photons;
mod scenarios;
mod sensors;
mod silicon;
mod waveforms;

pub use exposures::{clocks, exposures, start_values};
pub use libraries::{libraries, library_of};
pub use photons::{
    Photons, after_dead_time, anywhere, bursts, near_clk_edges, near_window_edges, photons,
    photons_anywhere, pulses_of,
};
pub use scenarios::{Scenario, scenarios, scenarios_of};
pub use sensors::{sensors, sensors_of_every_engine};
pub use silicon::{conditions, mismatches, silicon};
pub use waveforms::{PropertyFailure, check_property, check_property_from, write_failing_case};

use proptest::strategy::{Strategy, ValueTree};
use proptest::test_runner::{Config, RngAlgorithm, TestRng, TestRunner};

/// The value that a seed gives, for tests that go through seeds and do not shrink.
///
/// # Panics
/// If a strategy rejects thousands of values in a row.
pub fn drawn<S: Strategy>(seed: u64, strategy: &S) -> S::Value {
    let config = Config {
        failure_persistence: None,
        ..Config::default()
    };
    let mut runner = TestRunner::new_with_rng(config, seeded(seed));
    let tree = strategy.new_tree(&mut runner);
    tree.expect("few values are rejected").current()
}

fn seeded(seed: u64) -> TestRng {
    let mut bytes = [0; 32];
    bytes[..8].copy_from_slice(&seed.to_le_bytes());
    TestRng::from_seed(RngAlgorithm::ChaCha, &bytes)
}
