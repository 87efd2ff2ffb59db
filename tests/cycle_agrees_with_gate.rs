//! The levelised netlist counts what the gates and the reference model count: random sensors, clocks, STOP phases,
//! start values and pulses, many macropixels in one block.

mod scenario;

use guided_dtof::chip::macropixel::Model;
use guided_dtof::chip::window_law::{Window, WindowLaw};
use guided_dtof::chip::{Mode, PCounter};
use guided_dtof::engine::{Cycle, Engine, Gate};
use rand::{RngExt, SeedableRng, rngs::StdRng};
use scenario::Scenario;

/// Runs random chips of up to `most` macropixels whose windows are certain; how many ran, and how many of them
/// had to be left to the gates.
fn compare(
    seeds: std::ops::Range<u64>,
    most: usize,
    expected: impl Fn(&Scenario) -> Vec<Vec<u16>>,
) -> (usize, usize) {
    let (mut ran, mut unlevelled) = (0, 0);
    for seed in seeds {
        let random = &mut StdRng::seed_from_u64(seed);
        let lanes = random.random_range(1..=most);
        let scenario = Scenario::random(random, 1, lanes);
        let Scenario {
            config,
            exposure,
            starts,
            ..
        } = &scenario;
        let law = WindowLaw::new(config, exposure);
        if starts
            .iter()
            .any(|&start| matches!(law.window(start), Window::Race(_)))
        {
            continue;
        }
        // Set/reset flip-flops are left to the gates, where they matter.
        let is_set = matches!(config.p_counter, PCounter::SetReset | PCounter::Memoryless);
        if is_set && config.mode == Mode::Guided {
            assert!(Cycle::new(config, exposure).unlevelled().is_some());
            continue;
        }
        ran += 1;
        let cycle = Cycle::new(config, exposure);
        // Without the gate engine to fall back on.
        let Ok(found) = cycle.run(starts, &cycle.pack(starts, &scenario.pulses())) else {
            unlevelled += 1;
            continue;
        };
        for (lane, (found, expected)) in found.iter().zip(expected(&scenario)).enumerate() {
            let start = starts[lane];
            assert_eq!(
                found, &expected,
                "seed {seed}, start {start}, {config:?} {exposure:?}"
            );
        }
    }
    (ran, unlevelled)
}

#[test]
fn as_the_gates_count() {
    let gates = |scenario: &Scenario| {
        let gate = Gate::new(&scenario.config, &scenario.exposure);
        gate.histograms(&scenario.starts, &scenario.pulses())
            .expect("known counts")
    };
    let (ran, unlevelled) = compare(0..60, 64, gates);
    assert!(ran > 20 && unlevelled * 20 <= ran, "{unlevelled} of {ran}");
}

#[test]
fn as_the_reference_model_counts_in_larger_numbers() {
    let model = |scenario: &Scenario| {
        let model = Model::new(&scenario.config, &scenario.exposure);
        let one = |(&start, pulses): (&u16, &Vec<_>)| {
            model.histogram(
                start,
                pulses
                    .iter()
                    .map(|p: &guided_dtof::photon::SpadEvent| (p.time, p.spad)),
            )
        };
        scenario
            .starts
            .iter()
            .zip(&scenario.pulses)
            .map(one)
            .collect()
    };
    let (ran, unlevelled) = compare(1_000..1_060, 1_200, model);
    assert!(ran > 20 && unlevelled * 20 <= ran, "{unlevelled} of {ran}");
}
