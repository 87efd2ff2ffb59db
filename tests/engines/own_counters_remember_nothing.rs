//! Random P-counters of a user: legal ones count the same on every engine, those with hidden state are refused by the cell that has it.

use crate::cases::cases;
use crate::counters::{self, CounterKind, Hidden, RandomCounter};
use crate::scenario;

use std::collections::HashSet;

use guided_dtof::chip::{AfterBorrow, Exposure, Irregular, SensorConfig};
use guided_dtof::engine::{self, Cycle, EngineError, Gate, Replay};
use rand::{RngExt, SeedableRng, rngs::StdRng};

/// Every engine that takes pulses, on a random exposure: whether anything is counted, and whether a law describes it.
fn count_alike(config: SensorConfig, random: &mut StdRng) -> (bool, bool) {
    let config = SensorConfig {
        rows: 1,
        cols: 6,
        ..config
    };
    // In three of four cases a counter that wraps comes round once in a laser cycle.
    let wraps = config.after_borrow == AfterBorrow::Wrap;
    let scenario = if wraps && config.p_counter.row().has_memory && random.random_bool(0.75) {
        let exposure = Exposure::new(&config, u32::from(config.largest_start()), 6);
        scenario::in_exposure(random, config, exposure)
    } else {
        scenario::of_sensor(random, config)
    };
    let (config, exposure) = (&scenario.config, &scenario.exposure);
    let (starts, pulses) = (&scenario.starts, scenario.pulses());
    let gate = Gate::new(config, exposure)
        .histograms(starts, &pulses)
        .unwrap();
    let tells = gate.iter().flatten().any(|&count| count > 0);
    match Cycle::new(config, exposure).histograms(starts, &pulses) {
        Ok(cycle) => assert_eq!(gate, cycle, "{config:?}"),
        Err(EngineError::Race { .. }) => return (tells, false),
        Err(why) => panic!("{why}: {config:?}"),
    }
    let window = engine::Window::new(config, exposure).histograms(starts, &pulses);
    match &window {
        Ok(window) => assert_eq!(&gate, window, "{config:?}"),
        Err(EngineError::Irregular(Irregular::LocalStopRepeats { .. })) if wraps => {}
        Err(why) => panic!("{why}: {config:?}"),
    }
    (tells, window.is_ok())
}

#[test]
fn legal_counters_count_alike_and_hidden_state_is_refused_by_name() {
    let mut drawn = HashSet::new();
    let (mut legal, mut telling, mut lawful) = (0, 0, 0);
    for seed in 0..cases(216) {
        let random = &mut StdRng::seed_from_u64(seed.into());
        let RandomCounter {
            kind,
            hidden,
            config,
            named,
        } = counters::drawn(seed as usize, random);
        drawn.insert((kind, hidden));
        let what = format!("seed {seed}: {kind:?} with {hidden:?}");
        match (config.check(), named) {
            (Ok(()), None) => {
                let law = config.counter_law().unwrap();
                assert_eq!(law.uneven(), None, "{what}");
                legal += 1;
                let (tells, has_law) = count_alike(config, random);
                telling += usize::from(tells);
                lawful += usize::from(has_law);
            }
            (Err(why), Some(name)) => {
                let why = why.to_string();
                let is_named = why.contains("random.json: module random ") && why.contains(name);
                assert!(is_named, "{what}: {why}");
            }
            (verdict, named) => panic!("{what}: {verdict:?}, {named:?}"),
        }
    }
    let kinds: HashSet<CounterKind> = drawn.iter().map(|(kind, _)| *kind).collect();
    let hidden: HashSet<Hidden> = drawn.iter().map(|(_, hidden)| *hidden).collect();
    assert!(
        kinds.len() == CounterKind::ALL.len() && hidden.len() == 14,
        "{drawn:?}"
    );
    assert!(
        legal > 30 && 3 * telling > 2 * legal && 4 * lawful > 3 * legal,
        "of {legal} legal counters {telling} count something, {lawful} have a law"
    );
}
