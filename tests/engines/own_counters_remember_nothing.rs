//! Random P-counters of a user: legal ones count the same on every engine, those with hidden state are refused by the cell that has it.

use crate::cases::cases;
use crate::counters::{self, Drawn, Hidden, Kind};
use crate::scenario::Scenario;

use std::collections::HashSet;

use guided_dtof::chip::SensorConfig;
use guided_dtof::engine::{self, Cycle, Gate, Replay};
use rand::{SeedableRng, rngs::StdRng};

/// Every engine that takes pulses, on a random exposure: whether the counts are those of the gates, and whether there are any.
fn count_alike(config: SensorConfig, random: &mut StdRng) -> bool {
    let config = SensorConfig {
        rows: 1,
        cols: 6,
        ..config
    };
    let scenario = Scenario::of(random, config);
    let (config, exposure) = (&scenario.config, &scenario.exposure);
    let engines: [Box<dyn Replay>; 3] = [
        Box::new(Gate::new(config, exposure)),
        Box::new(Cycle::new(config, exposure)),
        Box::new(engine::Window::new(config, exposure)),
    ];
    let (starts, pulses) = (&scenario.starts, scenario.pulses());
    let counted = engines.map(|engine| engine.histograms(starts, &pulses).unwrap());
    assert_eq!(counted[0], counted[1], "gate and cycle: {config:?}");
    assert_eq!(counted[0], counted[2], "gate and window: {config:?}");
    counted[0].iter().flatten().any(|&count| count > 0)
}

#[test]
fn legal_counters_count_alike_and_hidden_state_is_refused_by_name() {
    let mut drawn = HashSet::new();
    let (mut legal, mut telling) = (0, 0);
    for seed in 0..cases(216) {
        let random = &mut StdRng::seed_from_u64(seed.into());
        let Drawn {
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
                telling += usize::from(count_alike(config, random));
            }
            (Err(why), Some(name)) => {
                let why = why.to_string();
                let is_named = why.contains("random.json: module random ") && why.contains(name);
                assert!(is_named, "{what}: {why}");
            }
            (verdict, named) => panic!("{what}: {verdict:?}, {named:?}"),
        }
    }
    let kinds: HashSet<Kind> = drawn.iter().map(|(kind, _)| *kind).collect();
    let hidden: HashSet<Hidden> = drawn.iter().map(|(_, hidden)| *hidden).collect();
    assert!(
        kinds.len() == Kind::ALL.len() && hidden.len() == 14,
        "{drawn:?}"
    );
    assert!(legal > 30 && telling > legal / 2, "{telling} of {legal}");
}
