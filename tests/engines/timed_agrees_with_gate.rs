//! Fast engines that keep time count what the gates count with the same delays: random sensors, clocks near and far from
//! their limits, STOP phases, corners, conditions, mismatch, start values and pulses.
//!
//! `GDTOF_CASES=1500 cargo test --release --test engines timed_agrees_with_gate -- --nocapture` runs thousands of macropixels.

use crate::scenario;

use std::collections::BTreeMap;

use crate::cases::cases;
use guided_dtof::chip::{
    AfterBorrow, ChipTiming, Mode, PCounter, Sensor, SensorConfig, Silicon, Tap, array,
};
use guided_dtof::engine::{Doubt, Gate, Histograms, PulsedPixel, Replay, Runner, Timed};
use guided_dtof::netlist::{Corner, Mismatch, Netlist, Timing};
use rand::{RngExt, SeedableRng, rngs::StdRng};
use scenario::Scenario;

/// Macropixels that kept time, and those that did not by reason.
#[derive(Default)]
struct Tally {
    kept: usize,
    replayed: BTreeMap<Doubt, usize>,
}

impl Tally {
    fn macropixels(&self) -> usize {
        self.kept + self.replayed.values().sum::<usize>()
    }

    fn add(&mut self, other: Tally) {
        self.kept += other.kept;
        for (why, count) in other.replayed {
            *self.replayed.entry(why).or_default() += count;
        }
    }
}

/// How a random chip is clocked.
#[derive(Clone, Copy, PartialEq)]
enum Clock {
    /// Anything.
    Any,
    /// With slack everywhere.
    Slow,
    /// About where the strobe meets the next change of the shift register.
    NearLimit,
}

fn silicon(random: &mut StdRng, config: &SensorConfig) -> Silicon {
    let sigma = random.random_range(0.0..0.3);
    Silicon {
        factor: [1.0, random.random_range(0.7..1.5)][random.random_range(0..2)],
        mismatch: random.random_bool(0.8).then(|| Mismatch {
            sigma,
            seed: random.random(),
        }),
        ..Silicon::new(config)
    }
}

fn scenario(random: &mut StdRng, clock: Clock) -> (Scenario, Silicon) {
    let (rows, cols) = (random.random_range(1..3), random.random_range(1..5));
    let Scenario { mut config, .. } = scenario::random(random, rows, cols);
    let silicon = silicon(random, &config);
    if clock != Clock::Any {
        if clock == Clock::NearLimit {
            config.counter_bits = random.random_range(8..13);
            config.tap = Tap::Borrow;
            config.mode = Mode::Guided;
            // One that is reset, and ripples for longer than it takes to count.
            let mut p_counters = PCounter::ALL.to_vec();
            p_counters.retain(|&p_counter| {
                config.p_counter = p_counter;
                let timing = ChipTiming::new(&config);
                p_counter.row().has_memory && timing.counter.period < timing.ripple()
            });
            config.p_counter = p_counters[random.random_range(0..p_counters.len())];
        }
        let timing = ChipTiming::new(&config);
        let strobe = timing.ripple() + timing.local_stop_to_strobe - timing.clk_to_shift;
        let edge = strobe.as_s().max(timing.clk_to_event.as_s() / 2.0) * silicon.factor;
        let half = match clock {
            Clock::Slow => edge * random.random_range(2.0..4.0),
            _ => edge * random.random_range(0.97..1.05),
        };
        config.clk_hz = 0.5 / half;
        config.stop_phase_ps = random.random_range(-0.3..0.3) * 1e12 * half;
        if clock == Clock::Slow {
            config.stop_phase_ps = 0.0;
            config.p_counter = PCounter::Ripple;
            // One that wraps is left to the gates at any clock.
            config.after_borrow = AfterBorrow::Hold;
        }
        config.check().expect("a sensor");
    }
    (scenario::of_sensor(random, config), silicon)
}

fn compare(seed: u64, scenario: &Scenario, silicon: &Silicon) -> Tally {
    let Scenario {
        config,
        exposure,
        starts,
        ..
    } = scenario;
    let pulses = scenario.pulses();
    let timing = |pixel: usize| {
        let position = (pixel / config.cols, pixel % config.cols);
        silicon.timing(&Netlist::elaborate(&array::subarray(
            config,
            position,
            (1, 1),
        )))
    };
    let timings: Vec<Timing> = (0..config.pixels()).map(timing).collect();
    let timings: Vec<&Timing> = timings.iter().collect();
    let pixels = PulsedPixel::array(starts, &pulses);
    let uniform = Silicon {
        mismatch: None,
        ..*silicon
    };
    let gates = Gate::new(Sensor::from(config).made_of(&uniform), exposure);
    let gates = gates.replay_with(&timings, &pixels);
    let mut tally = Tally::default();
    for runner in [Runner::Window, Runner::Cycle] {
        let timed = Timed::new(Sensor::from(config).made_of(silicon), exposure, runner);
        // In two parts, the last one first: what a macropixel is made of goes with its number.
        let (before, after) = pixels.split_at(pixels.len() / 2);
        let found = [after, before].map(|part| timed.replay(part));
        let Ok(gates) = &gates else {
            assert!(
                found.iter().any(Result::is_err),
                "seed {seed}: {config:?} {exposure:?} {silicon:?}"
            );
            continue;
        };
        let parts = found.map(Result::unwrap).into_iter().rev();
        let found = Histograms::joined(config.bins, parts);
        for (pixel, (counts, gate)) in found.iter().zip(gates).enumerate() {
            let start = starts[pixel];
            assert_eq!(
                counts,
                gate,
                "seed {seed}, {runner:?}, macropixel {pixel} with start {start}: {config:?} {exposure:?} {silicon:?} {:?}",
                timed.coverage()
            );
        }
        let coverage = timed.coverage();
        tally = Tally {
            kept: coverage.decided,
            replayed: coverage.replayed,
        };
        assert_eq!(tally.macropixels(), config.pixels());
    }
    tally
}

fn compare_all(clock: Clock, first_seed: u64, cases: u32) -> Tally {
    let mut sum = Tally::default();
    for seed in first_seed..first_seed + u64::from(cases) {
        let random = &mut StdRng::seed_from_u64(seed);
        let (scenario, silicon) = scenario(random, clock);
        sum.add(compare(seed, &scenario, &silicon));
    }
    println!(
        "{} of {} macropixels kept time, {:?}",
        sum.kept,
        sum.macropixels(),
        sum.replayed
    );
    sum
}

#[test]
fn at_any_clock() {
    let sum = compare_all(Clock::Any, 0, cases(60));
    assert!(sum.kept * 3 > sum.macropixels());
}

#[test]
fn with_slack_almost_all_keep_time() {
    let sum = compare_all(Clock::Slow, 1_000_000, cases(50));
    assert!(sum.kept * 10 > sum.macropixels() * 9);
}

#[test]
fn near_the_limit_most_keep_time_and_some_are_replayed() {
    let sum = compare_all(Clock::NearLimit, 2_000_000, cases(60));
    let replayed = sum.macropixels() - sum.kept;
    assert!(sum.kept * 10 > sum.macropixels() * 8 && replayed > 0);
}

/// The strobe in the very femtosecond of the shift register's change, and a picosecond to either side.
#[test]
fn at_the_limit_the_gates_are_asked() {
    for (off_fs, is_replayed) in [(-1_000, false), (0, true), (1_000, false)] {
        let random = &mut StdRng::seed_from_u64(1);
        let mut config = SensorConfig {
            rows: 2,
            cols: 2,
            ..SensorConfig::default()
        };
        let timing = ChipTiming::new(&config);
        let strobe = timing.ripple() + timing.local_stop_to_strobe - timing.clk_to_shift;
        config.clk_hz = 1e15 / (2 * strobe.as_fs() + 2 * off_fs) as f64;
        let mut scenario = scenario::of_sensor(random, config);
        scenario.starts = vec![5, 8, 12, 15];
        let tally = compare(0, &scenario, &Silicon::nominal(Corner::Typ));
        assert_eq!(tally.kept, if is_replayed { 0 } else { 4 }, "{off_fs}");
    }
}
