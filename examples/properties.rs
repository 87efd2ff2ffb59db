//! Five properties of the chip, held to random sensors, start values and photons. What fails is shrunk and written as a waveform.
//!
//! `cargo run --example properties --features proptest`, and with `-- wrong` five claims that do not hold
//!
//! In a crate of your own the strategies are `guided_dtof::strategies`.

use std::path::Path;
use std::process::ExitCode;

use guided_dtof::chip::{EventType, Mode, Probe, SensorConfig, Tap};
use guided_dtof::engine::{Gate, Histograms, Replay, Window};
use guided_dtof::units::Time;
use guided_dtof_sensor::strategies::{
    Scenario, check_property, photons, scenarios, sensors_of_every_engine,
};
use proptest::prelude::*;
use proptest::test_runner::TestCaseResult;

/// A name, and what is claimed of every scenario.
pub type Claim = (&'static str, fn(&Scenario) -> TestCaseResult);

/// What holds.
pub const PROPERTIES: [Claim; 5] = [
    ("local_stop_lies_within_static_timing", |scenario| {
        local_stop_lies_within_static_timing(scenario, Time::ZERO)
    }),
    ("a_start_value_more_is_a_step_later", |scenario| {
        a_start_value_more_is_later(scenario, 1)
    }),
    ("no_photon_counts_twice", |scenario| {
        photons_count_at_most(scenario, 1)
    }),
    ("engines_count_alike", |scenario| {
        engines_count_alike(scenario, 0)
    }),
    ("photons_outside_change_nothing", |scenario| {
        photons_outside_change_nothing(scenario, 0)
    }),
];

/// What does not hold: the same with another number.
pub const WRONG: [Claim; 5] = [
    ("local_stop_is_a_picosecond_earlier", |scenario| {
        local_stop_lies_within_static_timing(scenario, Time::from_ps(1))
    }),
    ("a_start_value_more_is_two_steps_later", |scenario| {
        a_start_value_more_is_later(scenario, 2)
    }),
    ("no_photon_counts", |scenario| {
        photons_count_at_most(scenario, 0)
    }),
    ("a_start_value_more_counts_alike", |scenario| {
        engines_count_alike(scenario, 1)
    }),
    ("photons_of_the_first_bin_change_nothing", |scenario| {
        photons_outside_change_nothing(scenario, 1)
    }),
];

/// Up to two macropixels in guided mode, whose events are any SPAD's or several SPADs'.
pub fn cases() -> impl Strategy<Value = Scenario> + Clone {
    let sensors = sensors_of_every_engine(&[]).prop_map(|config| SensorConfig {
        mode: Mode::Guided,
        // LOCAL_STOP of the tap `msb` rises at the reset as well.
        tap: Tap::Borrow,
        threshold: config.threshold.min(config.spads() as u8 - 1),
        event_type: EventType::Greater,
        ..config
    });
    scenarios(sensors, photons(20), 1..=1, 1..=2)
}

/// LOCAL_STOP rises after a count, by a delay between the shortest and the longest path of static timing.
fn local_stop_lies_within_static_timing(scenario: &Scenario, earlier: Time) -> TestCaseResult {
    let law = scenario.law();
    let (least, most) = law.sensor().local_stop_delays().bounds();
    let counts = scenario.rising_edges(Probe::CounterClk);
    let rises = scenario.rising_edges(Probe::LocalStop);
    for ((&start, counts), rises) in scenario.starts.iter().zip(counts).zip(rises) {
        let is_after_count = |&rise: &Time| {
            let range = rise + earlier - most..=rise + earlier - least;
            counts.iter().any(|count| range.contains(count))
        };
        let is_open = law.window(start).open().is_some();
        let holds = !is_open || rises.iter().all(is_after_count);
        prop_assert!(holds, "start value {start}: LOCAL_STOP rises at {rises:?}");
    }
    Ok(())
}

/// The next start value opens its window `steps` steps later.
fn a_start_value_more_is_later(scenario: &Scenario, steps: usize) -> TestCaseResult {
    let law = scenario.law();
    let later = steps * scenario.config.step_periods;
    let later = scenario.exposure.clock.periods(later as i64);
    for &start in &scenario.starts {
        let next = (start + 1).min(scenario.config.largest_start());
        let windows = [start, next].map(|start| law.window(start).open());
        if let [Some(window), Some(next)] = windows
            && window.start < next.start
        {
            let moved = law.interval(&next).start - law.interval(&window).start;
            let off_fs = (moved - later).as_fs();
            prop_assert!(off_fs.abs() <= 1, "start value {start}: {moved} later");
        }
    }
    Ok(())
}

/// Each photon counts `times` times at most.
fn photons_count_at_most(scenario: &Scenario, times: usize) -> TestCaseResult {
    let law = scenario.law();
    let counts = gates(scenario)?;
    for ((&start, bins), photons) in scenario.starts.iter().zip(&counts).zip(&scenario.pulses) {
        let counted: usize = bins.iter().map(|&count| usize::from(count)).sum();
        let is_open = law.window(start).open().is_some();
        let most = times * photons.len();
        prop_assert!(
            !is_open || counted <= most,
            "{counted} counts of {} photons",
            photons.len()
        );
    }
    Ok(())
}

/// `window` counts what the gates count from start values so much larger, or says that it cannot tell.
fn engines_count_alike(scenario: &Scenario, more: u16) -> TestCaseResult {
    let (config, exposure) = (&scenario.config, &scenario.exposure);
    let pulses = scenario.pulses();
    match Window::new(config, exposure).histograms(&scenario.starts, &pulses) {
        Ok(window) => {
            let other = |start: &u16| (start + more).min(config.largest_start());
            let other: Vec<u16> = scenario.starts.iter().map(other).collect();
            prop_assert_eq!(
                Gate::new(config, exposure).histograms(&other, &pulses),
                Ok(window)
            );
        }
        Err(why) => prop_assert!(why.is_refusal(), "{why}"),
    }
    Ok(())
}

/// Without the photons outside of the bins from this one on the gates count the same.
fn photons_outside_change_nothing(scenario: &Scenario, first_bin: usize) -> TestCaseResult {
    let law = scenario.law();
    let mut inside = scenario.clone();
    for (&start, pulses) in scenario.starts.iter().zip(&mut inside.pulses) {
        let Some(window) = law.window(start).open() else {
            continue;
        };
        let cycles = 0..i64::from(scenario.exposure.laser_cycles);
        let windows: Vec<_> = cycles.map(|cycle| law.edges(&window, cycle)).collect();
        pulses.retain(|pulse| {
            let mut bins = windows.iter().map(|edges| edges.bin_of(pulse.time));
            bins.any(|bin| bin >= Some(first_bin))
        });
    }
    prop_assert_eq!(gates(scenario)?, gates(&inside)?);
    Ok(())
}

/// What the gates count. Where two signals race, a bin may be unknown, and the scenario is no case.
fn gates(scenario: &Scenario) -> Result<Histograms, TestCaseError> {
    let gate = Gate::new(&scenario.config, &scenario.exposure);
    let counts = gate.histograms(&scenario.starts, &scenario.pulses());
    counts.map_err(|why| TestCaseError::reject(why.to_string()))
}

fn main() -> ExitCode {
    let is_wrong = std::env::args().nth(1).as_deref() == Some("wrong");
    let mut all_hold = true;
    for (name, claim) in if is_wrong { WRONG } else { PROPERTIES } {
        let folder = Path::new("out/properties").join(name);
        match check_property(40, &cases(), claim, &folder) {
            Ok(()) => println!("{name}: holds"),
            Err(failure) => {
                println!("{name}: FAILS\n{failure}\n");
                all_hold = false;
            }
        }
    }
    ExitCode::from(u8::from(!all_hold))
}
