//! Blocks of one's own: every built-in P-counter, read back as a netlist of Yosys, is the built-in one to every engine; and a
//! counter that is not binary counts alike on all of them.

use crate::scenario;
use crate::yosys;

use guided_dtof::chip::own_block::Uneven;
use guided_dtof::chip::{
    ChipTiming, Exposure, Irregular, Mode, OwnBlock, PCounter, SensorConfig, Window, WindowLaw,
    correlation, p_counter,
};
use guided_dtof::engine::{self, Cycle, Gate, Histograms, Replay};
use guided_dtof::netlist::Module;
use rand::{RngExt, SeedableRng, rngs::StdRng};
use scenario::{Scenario, cases};

/// The same sensor with its P-counter read back from JSON.
fn read_back(config: &SensorConfig) -> SensorConfig {
    let json = yosys::json(&p_counter::circuit(config));
    let module = Module::from_yosys(&json, None).unwrap();
    assert_eq!(
        module.transistors(),
        p_counter::circuit(config).transistors()
    );
    let own = SensorConfig {
        p_counter_block: Some(OwnBlock::of("built_in.json", module, &json)),
        ..config.clone()
    };
    own.check().unwrap();
    own
}

/// A law and what each engine that takes it counts.
fn counted(config: &SensorConfig, scenario: &Scenario) -> (Vec<Window>, Vec<Option<Histograms>>) {
    let law = WindowLaw::new(config, &scenario.exposure);
    let windows = scenario.starts.iter().map(|&start| law.window(start));
    let engines: [Box<dyn Replay>; 3] = [
        Box::new(Gate::new(config, &scenario.exposure)),
        Box::new(Cycle::new(config, &scenario.exposure)),
        Box::new(engine::Window::new(config, &scenario.exposure)),
    ];
    let (starts, pulses) = (&scenario.starts, scenario.pulses());
    let histograms = engines
        .iter()
        .map(|engine| engine.histograms(starts, &pulses).ok());
    (windows.collect(), histograms.collect())
}

#[test]
fn every_built_in_counter_read_back_counts_the_same_on_every_engine() {
    let mut ran = [0; PCounter::ALL.len()];
    for seed in 0..cases(60).into() {
        let random = &mut StdRng::seed_from_u64(seed);
        let lanes = random.random_range(1..12);
        let scenario = Scenario::random(random, 1, lanes);
        let config = &scenario.config;
        let own = read_back(config);
        assert_eq!(ChipTiming::of(&own), ChipTiming::of(config), "{config:?}");
        let (windows, built_in) = counted(config, &scenario);
        assert_eq!(
            counted(&own, &scenario),
            (windows, built_in.clone()),
            "seed {seed}, {config:?}"
        );
        ran[config.p_counter as usize] += built_in.iter().flatten().count();
    }
    assert!(ran.iter().all(|&ran| ran >= 6), "{ran:?}");
}

#[test]
fn a_counter_that_is_not_binary_gets_its_codes_and_the_law_of_the_others() {
    let config = yosys::lfsr();
    let law = config.counter_law().unwrap();
    assert_eq!(
        (law.uneven(), law.offset(), law.is_plain()),
        (None, 0, false)
    );
    let mut state = 0u16;
    for start in 0..511 {
        assert_eq!(law.code(start), state);
        state = (state << 1 & 511) | u16::from(state >> 8 & 1 == state >> 4 & 1);
    }
    assert_eq!((law.code(511), state), (511, 0), "it stays where it is");
    let random = &mut StdRng::seed_from_u64(7);
    for mode in Mode::ALL {
        let config = SensorConfig {
            rows: 4,
            cols: 16,
            mode,
            ..config.clone()
        };
        let exposure = Exposure::new(&config, 520, 6);
        let mut scenario = Scenario::exposed(random, config, exposure);
        scenario.starts[5] = 511;
        let (windows, counted) = counted(&scenario.config, &scenario);
        let opens = |start: u16| {
            WindowLaw::new(&scenario.config, &exposure)
                .window(start)
                .open()
        };
        if mode == Mode::Guided {
            assert_eq!(windows[5], Window::Never);
            assert_eq!(
                opens(30).unwrap().first_edge - opens(7).unwrap().first_edge,
                23
            );
        }
        let gate = counted[0].clone().unwrap();
        assert!(gate.iter().flatten().any(|&count| count > 0));
        assert_eq!(counted, vec![Some(gate); 3]);
    }
}

/// A counter whose lowest bit is loaded with its second one.
#[test]
fn without_a_line_the_gates_and_the_cycles_count_and_the_law_refuses() {
    let built_in = SensorConfig::default();
    let json = yosys::json(&p_counter::circuit(&built_in));
    // The memory's lowest bit takes another one's input.
    let parsed: serde_json::Value = serde_json::from_str(&json).unwrap();
    let init = &parsed["modules"]["p_counter"]["ports"]["COUNTER_INIT"]["bits"];
    let from = format!(r#""D": [{}], "C""#, init[0]);
    assert_eq!(json.matches(&from).count(), 1);
    let json = json.replace(&from, &format!(r#""D": [{}], "C""#, init[1]));
    let module = Module::from_yosys(&json, None).unwrap();
    let config = SensorConfig {
        p_counter_block: Some(OwnBlock::of("doubled.json", module, &json)),
        cols: 8,
        rows: 1,
        ..built_in
    };
    config.check().unwrap();
    let law = config.counter_law().unwrap();
    assert_eq!(law.uneven(), Some(Uneven::Same(0, 1)));
    let exposure = Exposure::new(&config, 60, 5);
    let scenario = Scenario::exposed(&mut StdRng::seed_from_u64(1), config, exposure);
    let (windows, counted) = counted(&scenario.config, &scenario);
    let same = Window::Irregular(Irregular::OwnCounter(Uneven::Same(0, 1)));
    assert_eq!(windows, vec![same; 8]);
    assert_eq!(counted[0], counted[1]);
    assert!(counted[0].is_some() && counted[2].is_none());
    let why = WindowLaw::new(&scenario.config, &exposure)
        .refusal()
        .unwrap();
    assert_eq!(
        why.to_string(),
        "COUNTER_INIT 0 and 1 raise LOCAL_STOP with the same edge of COUNTER_CLK: no window law describes this P-counter"
    );
}

#[test]
fn a_correlation_block_of_ones_own_is_counted_by_gates_and_cycles() {
    let mut ran = 0;
    for seed in 0..20 {
        let random = &mut StdRng::seed_from_u64(seed);
        let scenario = Scenario::random(random, 1, 6);
        let config = &scenario.config;
        let json = yosys::json(&correlation::circuit(config.lines()));
        let module = Module::from_yosys(&json, None).unwrap();
        let own = SensorConfig {
            correlation_block: Some(OwnBlock::of("built_in.json", module, &json)),
            ..config.clone()
        };
        own.check().unwrap();
        assert_eq!(ChipTiming::of(&own), ChipTiming::of(config));
        let (windows, found) = counted(&own, &scenario);
        assert_eq!(found[..2], counted(config, &scenario).1[..2], "seed {seed}");
        let opens = windows
            .iter()
            .any(|window| matches!(window, Window::Open(_)));
        assert!(!opens, "{windows:?}");
        let why = Window::Irregular(Irregular::OwnCorrelation);
        ran += windows.iter().filter(|window| **window == why).count();
    }
    assert!(ran > 40, "{ran}");
}
