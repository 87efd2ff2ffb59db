//! Holds a property to random scenarios. The smallest one that fails is written as a waveform, with views for GTKWave and Surfer.

use std::path::{Path, PathBuf};

use proptest::strategy::Strategy;
use proptest::test_runner::{Config, Reason, TestCaseResult, TestError, TestRunner};

use super::{Scenario, seeded};
use crate::engine::waveform::{View, record};
use crate::files::{InputError, create_folder};
use crate::waves::WaveFormat;

/// A property that does not hold.
#[derive(Debug, thiserror::Error)]
pub enum PropertyFailure {
    /// A scenario of which it is not true.
    #[error("{reason}\n{scenario:?}\nwaveform: gtkwave {}", .view.display())]
    Fails {
        /// What the property says of it.
        reason: Reason,
        /// The smallest one found.
        scenario: Box<Scenario>,
        /// GTKWave's view of its waveform.
        view: PathBuf,
    },
    /// Too many scenarios are none that the property is about.
    #[error("{0}: few scenarios are left; draw those that the property is about")]
    Rejects(Reason),
    /// The waveform of the smallest failing scenario could not be written.
    #[error("{reason}\n{scenario:?}\nno waveform: {error}")]
    Unwritten {
        /// What the property says of it.
        reason: Reason,
        /// The smallest one found.
        scenario: Box<Scenario>,
        /// What kept it from being written.
        error: Box<InputError>,
    },
}

/// Holds a property to `cases` scenarios. The smallest failing one is written to `folder` as [`write_failing_case`] does.
///
/// Scenarios are new ones in each run, unless the environment has a PROPTEST_RNG_SEED. [`check_property_from`] always draws the same ones.
///
/// # Errors
/// That the property does not hold, or is about too few of the scenarios.
pub fn check_property(
    cases: u32,
    scenarios: &impl Strategy<Value = Scenario>,
    property: impl Fn(&Scenario) -> TestCaseResult,
    folder: &Path,
) -> Result<(), PropertyFailure> {
    check_with(TestRunner::new(config(cases)), scenarios, property, folder)
}

/// The same, with the scenarios that a seed gives.
///
/// # Errors
/// As [`check_property`].
pub fn check_property_from(
    seed: u64,
    cases: u32,
    scenarios: &impl Strategy<Value = Scenario>,
    property: impl Fn(&Scenario) -> TestCaseResult,
    folder: &Path,
) -> Result<(), PropertyFailure> {
    let runner = TestRunner::new_with_rng(config(cases), seeded(seed));
    check_with(runner, scenarios, property, folder)
}

fn config(cases: u32) -> Config {
    Config {
        cases,
        failure_persistence: None,
        // A sensor has some forty numbers, each of which takes a few steps.
        max_shrink_iters: 4096,
        ..Config::default()
    }
}

fn check_with(
    mut runner: TestRunner,
    scenarios: &impl Strategy<Value = Scenario>,
    property: impl Fn(&Scenario) -> TestCaseResult,
    folder: &Path,
) -> Result<(), PropertyFailure> {
    let result = runner.run(scenarios, |scenario| property(&scenario));
    let (reason, scenario) = match result {
        Ok(()) => return Ok(()),
        Err(TestError::Abort(reason)) => return Err(PropertyFailure::Rejects(reason)),
        Err(TestError::Fail(reason, scenario)) => (reason, Box::new(scenario)),
    };
    Err(match write_failing_case(&scenario, folder) {
        Ok(view) => PropertyFailure::Fails {
            reason,
            scenario,
            view,
        },
        Err(error) => PropertyFailure::Unwritten {
            reason,
            scenario,
            error: Box::new(error),
        },
    })
}

/// Writes every named net of the array to `failing_case.vcd` in `folder`, which is made if it is missing, and views beside it. Returns the
/// path of GTKWave's view.
///
/// The view shows the macropixel that counts first, at its first HIT.
///
/// # Errors
/// When a file cannot be written.
pub fn write_failing_case(scenario: &Scenario, folder: &Path) -> Result<PathBuf, InputError> {
    let Scenario {
        config,
        exposure,
        starts,
        ..
    } = scenario;
    create_folder(folder)?;
    let waves = folder.join("failing_case.vcd");
    let pixels = (0..config.pixels()).map(|number| config.position(number));
    let view = View::of_array(pixels.collect(), config, exposure, starts[0]);
    let mut simulation = scenario.simulation();
    record(&mut simulation, &waves, WaveFormat::Vcd, &view, &mut ())?;
    Ok(waves.with_extension("gtkw"))
}

#[cfg(test)]
mod tests {
    use proptest::prelude::*;

    use super::*;
    use crate::strategies::{photons, scenarios, sensors};

    #[test]
    fn the_smallest_failing_case_is_a_waveform() {
        let cases = scenarios(sensors(&[]), photons(30), 1..=2, 1..=2);
        let few_photons = |scenario: &Scenario| {
            let photons = scenario.pulses[0].len();
            prop_assert!(photons < 3 || scenario.starts[0] < 5, "{photons} photons");
            Ok(())
        };
        let folder = tempfile::tempdir().unwrap();
        let folder = folder.path().join("new");
        let failure = check_property(200, &cases, few_photons, &folder).unwrap_err();
        let message = failure.to_string();
        let PropertyFailure::Fails { scenario, view, .. } = failure else {
            panic!("{message}");
        };
        assert_eq!((scenario.config.rows, scenario.config.cols), (1, 1));
        assert_eq!(scenario.starts, [5]);
        assert_eq!(scenario.pulses[0].len(), 3);
        assert_eq!(view, folder.join("failing_case.gtkw"));
        assert!(message.contains("3 photons") && message.contains(&view.display().to_string()));
        let text = std::fs::read_to_string(&view).unwrap();
        assert!(text.contains("failing_case.vcd") && text.contains("LOCAL_STOP"));
        let waves = std::fs::read_to_string(view.with_extension("vcd")).unwrap();
        assert!(waves.contains("$var"));
    }

    #[test]
    fn a_property_of_too_few_scenarios_says_so() {
        let cases = scenarios(sensors(&[]), photons(1), 1..=1, 1..=1);
        let never = |_: &Scenario| Err(TestCaseError::reject("never"));
        let folder = tempfile::tempdir().unwrap();
        let failure = check_property(1, &cases, never, folder.path()).unwrap_err();
        assert!(matches!(failure, PropertyFailure::Rejects(_)), "{failure}");
    }
}
