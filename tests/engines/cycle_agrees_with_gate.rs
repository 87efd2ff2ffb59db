//! The levelised netlist counts what the gates and the reference model count: random sensors, clocks, STOP phases,
//! start values and pulses, many macropixels in one block.
//!
//! `GDTOF_CASES=10000 cargo test --release --test engines cycle_agrees_with_gate` runs more of them.

use crate::scenario;

use crate::cases::cases;
use guided_dtof::chip::macropixel_model::MacropixelModel;
use guided_dtof::chip::window_law::{WindowLaw, WindowOutcome};
use guided_dtof::chip::{EventType, Exposure, Mode, PCounter, Sensor, SensorConfig};
use guided_dtof::engine::{Cycle, Gate, Histograms, Replay};
use guided_dtof::netlist::Corner;
use rand::{RngExt, SeedableRng, rngs::StdRng};
use scenario::Scenario;

/// Chips with one kind of P-counter.
#[derive(Debug, Clone, Copy, Default)]
struct Tally {
    /// That ran.
    ran: usize,
    /// That had to be left to the gates.
    unlevelled: usize,
}

/// Runs random chips of up to `most` macropixels, those whose windows are certain. Whatever the P-counter, nearly all
/// chips have a tape.
fn compare(first_seed: u64, cases: u32, most: usize, expected: impl Fn(&Scenario) -> Histograms) {
    let mut tallies = [Tally::default(); PCounter::ALL.len()];
    for seed in first_seed..first_seed + u64::from(cases) {
        let random = &mut StdRng::seed_from_u64(seed);
        let lanes = random.random_range(1..=most);
        let mut scenario = scenario::random(random, 1, lanes);
        leave_out_races(&mut scenario);
        let Scenario {
            config,
            exposure,
            starts,
            ..
        } = &scenario;
        if starts.is_empty() {
            continue;
        }
        // In a library's cells signals race more often: what has a tape is compared, but need not be nearly all.
        let is_of_library = !config.liberty.as_os_str().is_empty();
        let mut other = Tally::default();
        let tally = if is_of_library {
            &mut other
        } else {
            &mut tallies[config.p_counter as usize]
        };
        tally.ran += 1;
        let cycle = Cycle::new(config, exposure);
        // Without the gate engine to fall back on.
        let Ok(found) = cycle.replay_packed(starts, &cycle.pack(starts, &scenario.pulses())) else {
            tally.unlevelled += 1;
            continue;
        };
        let expected = expected(&scenario);
        for (lane, (found, expected)) in found.iter().zip(&expected).enumerate() {
            let start = starts[lane];
            assert_eq!(
                found, expected,
                "seed {seed}, start {start}, {config:?} {exposure:?}"
            );
        }
    }
    for (p_counter, Tally { ran, unlevelled }) in PCounter::ALL.iter().zip(tallies) {
        assert!(
            ran > 5 && unlevelled * 20 <= ran,
            "{p_counter:?}: {unlevelled} of {ran}"
        );
    }
}

/// Keeps the macropixels whose windows are certain.
fn leave_out_races(scenario: &mut Scenario) {
    let law = WindowLaw::new(&scenario.config, &scenario.exposure);
    let starts = std::mem::take(&mut scenario.starts);
    let pulses = std::mem::take(&mut scenario.pulses);
    let pixels = starts.into_iter().zip(pulses);
    (scenario.starts, scenario.pulses) = pixels
        .filter(|&(start, _)| !matches!(law.window(start), WindowOutcome::Race(_)))
        .unzip();
}

fn gates(scenario: &Scenario) -> Histograms {
    let gate = Gate::new(&scenario.config, &scenario.exposure);
    gate.histograms(&scenario.starts, &scenario.pulses())
        .expect("known counts")
}

#[test]
fn as_the_gates_count() {
    compare(0, cases(120), 64, gates);
}

/// HSLIDAR's set/reset P-counter of 7 bits and its 8 bins of 12 (thesis 4.9), from every start value.
#[test]
fn as_the_gates_of_hslidar_count() {
    let random = &mut StdRng::seed_from_u64(0);
    let mut ran = 0;
    for corner in Corner::ALL {
        for stop_phase_ps in [-900.0, 0.0, 900.0] {
            let config = SensorConfig {
                rows: 1,
                cols: 128,
                p_counter: PCounter::SetReset,
                counter_bits: 7,
                bins: 8,
                bin_bits: 12,
                stop_phase_ps,
                corner,
                ..SensorConfig::default()
            };
            let exposure = Exposure::new(&config, 140, 12);
            let mut scenario = Scenario {
                starts: (0..128).collect(),
                ..scenario::in_exposure(random, config, exposure)
            };
            leave_out_races(&mut scenario);
            let Scenario { config, starts, .. } = &scenario;
            let cycle = Cycle::new(config, &exposure);
            let found = cycle.replay_packed(starts, &cycle.pack(starts, &scenario.pulses()));
            assert_eq!(found, Ok(gates(&scenario)), "{config:?}");
            ran += starts.len();
        }
    }
    assert!(ran > 6 * 128, "{ran}");
}

#[test]
fn as_the_reference_model_counts_in_larger_numbers() {
    let model = |scenario: &Scenario| {
        let sensor = Sensor::from(&scenario.config);
        let delays = (*sensor.timing(), &**sensor.local_stop_delays());
        let model = MacropixelModel::new(&scenario.config, delays, &scenario.exposure);
        let one = |(&start, pulses): (&u16, &Vec<_>)| {
            model.histogram(
                start,
                pulses
                    .iter()
                    .map(|p: &guided_dtof::photon::SpadEvent| (p.time, p.spad)),
            )
        };
        let macropixels = scenario.starts.iter().zip(&scenario.pulses);
        Histograms::from_rows(scenario.config.bins, macropixels.map(one))
    };
    compare(1_000_000, cases(120), 1_200, model);
}

/// SPAD_EVENT is a constant, and STOP rises so long before CLK falls that HIT samples after the rising CLK edge.
#[test]
fn an_event_that_never_comes_is_sampled_as_the_gates_sample_it() {
    for (spad_rows, event_type, threshold) in [
        (1, EventType::Less, 0),
        (1, EventType::Equal, 0),
        (4, EventType::Less, 0),
    ] {
        let config = SensorConfig {
            spad_rows,
            spad_cols: spad_rows,
            counter_bits: 4,
            bins: 1,
            clk_hz: 4e6,
            stop_phase_ps: -107_203.0,
            event_type,
            threshold,
            mode: Mode::Conventional,
            ..SensorConfig::default()
        };
        let exposure = Exposure::new(&config, 4, 20);
        let gate = Gate::new(&config, &exposure).histogram(0, &[]);
        let cycle = Cycle::new(&config, &exposure).histogram(0, &[]);
        assert_eq!(gate, cycle, "{config:?}");
    }
}
