//! Blocks of one's own: every built-in block, read back as a netlist of Yosys, is the built-in one to every engine that takes it; a
//! counter that is not binary counts alike on all of them, and other blocks that differ do so on `gate` and `cycle` alike.

use crate::scenario;
use crate::yosys;

use std::path::PathBuf;
use std::sync::Arc;

use crate::cases::cases;
use guided_dtof::analysis::{LocalClocks, MacropixelTiming};
use guided_dtof::chip::own_block::Uneven;
use guided_dtof::chip::{
    ChipTiming, Exposure, Irregular, Limits, Mode, OwnBlock, PCounter, SensorConfig, Silicon,
    WindowLaw, WindowOutcome, correlation, front_end, histogram, metdc, p_counter,
};
use guided_dtof::engine::{self, Cycle, Gate, Histograms, Replay};
use guided_dtof::netlist::Module;
use rand::{RngExt, SeedableRng, rngs::StdRng};
use scenario::Scenario;
use serde_json::Value;

/// The same sensor with its P-counter read back from JSON.
fn read_back(config: &SensorConfig) -> SensorConfig {
    let json = yosys::json(&p_counter::circuit(config));
    let module = Module::from_yosys(&json, None).unwrap();
    assert_eq!(
        module.transistors(),
        p_counter::circuit(config).transistors()
    );
    let own = SensorConfig {
        p_counter_block: Some(OwnBlock::from_module("built_in.json", module, &json)),
        ..config.clone()
    };
    own.check().unwrap();
    own
}

/// A law and what each engine that takes it counts.
fn counted(
    config: &SensorConfig,
    scenario: &Scenario,
) -> (Vec<WindowOutcome>, Vec<Option<Histograms>>) {
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
        let scenario = scenario::random(random, 1, lanes);
        let config = &scenario.config;
        let own = read_back(config);
        assert_eq!(ChipTiming::new(&own), ChipTiming::new(config), "{config:?}");
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
    assert_eq!(law.silent_in_words().unwrap(), "511 (1 of 512)");
    let random = &mut StdRng::seed_from_u64(7);
    for mode in Mode::ALL {
        let config = SensorConfig {
            rows: 4,
            cols: 16,
            mode,
            ..config.clone()
        };
        let exposure = Exposure::new(&config, 520, 6);
        let mut scenario = scenario::in_exposure(random, config, exposure);
        scenario.starts[5] = 511;
        let (windows, counted) = counted(&scenario.config, &scenario);
        let opens = |start: u16| {
            WindowLaw::new(&scenario.config, &exposure)
                .window(start)
                .open()
        };
        if mode == Mode::Guided {
            assert_eq!(windows[5], WindowOutcome::Never);
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
        p_counter_block: Some(OwnBlock::from_module("doubled.json", module, &json)),
        cols: 8,
        rows: 1,
        ..built_in
    };
    config.check().unwrap();
    let law = config.counter_law().unwrap();
    assert_eq!(law.uneven(), Some(Uneven::Same(0, 1)));
    assert!(!config.may_have_law());
    let exposure = Exposure::new(&config, 60, 5);
    let scenario = scenario::in_exposure(&mut StdRng::seed_from_u64(1), config, exposure);
    let (windows, counted) = counted(&scenario.config, &scenario);
    let same = WindowOutcome::Irregular(Irregular::OwnCounter(Uneven::Same(0, 1)));
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

/// A block without a law: its built-in circuit, and where a netlist of one's own goes.
type Lawless = (
    &'static str,
    fn(&SensorConfig) -> Arc<Module>,
    fn(&mut SensorConfig) -> &mut Option<OwnBlock>,
);

const LAWLESS: [Lawless; 4] = [
    (
        "correlation_block",
        |c| correlation::circuit(c.lines()),
        |c| &mut c.correlation_block,
    ),
    ("front_end_block", front_end::circuit, |c| {
        &mut c.front_end_block
    }),
    (
        "metdc_block",
        |c| metdc::circuit(c.bins),
        |c| &mut c.metdc_block,
    ),
    (
        "histogram_block",
        |c| histogram::circuit(c.bins, c.bin_bits, c.overflow),
        |c| &mut c.histogram_block,
    ),
];

/// The sensor with a block read back from JSON, which `edit` has changed.
fn with_own(
    config: &SensorConfig,
    (key, circuit, own): Lawless,
    edit: impl FnOnce(&mut Value),
) -> SensorConfig {
    let circuit = circuit(config);
    let mut json: Value = serde_json::from_str(&yosys::json(&circuit)).unwrap();
    edit(&mut json["modules"][circuit.name()]);
    let json = json.to_string();
    let module = Module::from_yosys(&json, None).unwrap();
    let mut config = config.clone();
    *own(&mut config) = Some(OwnBlock::from_module(key, module, &json));
    config.check().unwrap();
    config
}

#[test]
fn other_blocks_read_back_count_the_same_on_gates_and_cycles_and_have_no_law() {
    let mut ran = [0; LAWLESS.len() + 1];
    for seed in 0..cases(40).into() {
        let random = &mut StdRng::seed_from_u64(seed);
        let mut scenario = scenario::random(random, 1, 6);
        // A library's toggle flip-flops are slower than they are read back as.
        scenario.config.liberty = PathBuf::new();
        scenario.config.liberty_slow = PathBuf::new();
        scenario.config.liberty_fast = PathBuf::new();
        let config = &scenario.config;
        // One after the other, and all of them at once.
        let which = seed as usize % (LAWLESS.len() + 1);
        let blocks = LAWLESS.get(which..=which).unwrap_or(&LAWLESS);
        let plain = |config: SensorConfig, block: &Lawless| with_own(&config, *block, |_| ());
        let own = blocks.iter().fold(config.clone(), plain);
        assert_eq!(ChipTiming::new(&own), ChipTiming::new(config), "{config:?}");
        let (windows, found) = counted(&own, &scenario);
        assert_eq!(
            found[..2],
            counted(config, &scenario).1[..2],
            "seed {seed}, {config:?}"
        );
        let opens = windows.iter().any(|w| matches!(w, WindowOutcome::Open(_)));
        assert!(!opens && found[2].is_none(), "{windows:?}");
        let why = WindowOutcome::Irregular(Irregular::OwnBlock(blocks[0].0));
        ran[which] += windows.iter().filter(|window| **window == why).count();
        // What the table of `gdtof timing` asks for.
        let silicon = Silicon::new(&own);
        MacropixelTiming::analyse(&own, &silicon, Limits::Kept, (0, 0));
        LocalClocks::analyse(&own, &silicon);
    }
    assert!(ran.iter().all(|&ran| ran > 10), "{ran:?}");
}

/// Bits that a netlist's port or a cell's pin is connected to.
fn bits(connection: &mut Value) -> &mut Vec<Value> {
    connection.as_array_mut().unwrap()
}

/// Connections of all cells of a type.
fn pins_of<'v>(module: &'v mut Value, kind: &'static str) -> impl Iterator<Item = &'v mut Value> {
    let cells = module["cells"].as_object_mut().unwrap().values_mut();
    let of_kind = cells.filter(move |cell| cell["type"] == kind);
    of_kind.map(|cell| &mut cell["connections"])
}

#[test]
fn other_blocks_that_differ_show_it_on_gates_and_cycles() {
    let config = SensorConfig {
        cols: 12,
        rows: 1,
        bin_bits: 2,
        ..SensorConfig::default()
    };
    let [_, of_front_end, of_metdc, of_histogram] = LAWLESS;
    let exposure = Exposure::new(&config, 60, 12);
    let mut scenario = scenario::in_exposure(&mut StdRng::seed_from_u64(3), config, exposure);
    scenario.starts.fill(20);
    let config = &scenario.config;
    let built_in = counted(config, &scenario).1[0].clone().unwrap();
    assert!(built_in.iter().flatten().any(|&count| count == 3));
    let found = |own: &SensorConfig| {
        let found = counted(own, &scenario).1;
        assert_eq!(found[0], found[1]);
        let cycle = Cycle::new(own, &exposure);
        assert_eq!(cycle.unlevelled(), None, "gates have not run for cycles");
        found[0].clone().unwrap()
    };

    // The newest bin first.
    let reversed = with_own(config, of_metdc, |module| {
        bits(&mut module["ports"]["HIT"]["bits"]).reverse();
    });
    let reversed = found(&reversed);
    for (own, built_in) in reversed.iter().zip(built_in.iter()) {
        assert!(own.iter().eq(built_in.iter().rev()));
    }

    // Full at 2, where both bits of a count make it full in the built-in one.
    let sooner = with_own(config, of_histogram, |module| {
        let bin = |bin| bits(&mut module["ports"][format!("BIN_{bin}")]["bits"]).clone();
        let counts: Vec<Vec<Value>> = (0..config.bins).map(bin).collect();
        for pins in pins_of(module, "$_AND_") {
            if let Some(count) = counts.iter().find(|count| count[0] == pins["A"][0]) {
                pins["A"][0] = count[1].clone();
            }
        }
    });
    let sooner = found(&sooner);
    for (own, built_in) in sooner.iter().zip(built_in.iter()) {
        let full = built_in.iter().map(|&count| count.min(2));
        assert!(own.iter().copied().eq(full), "{own:?} {built_in:?}");
    }

    // SPADs 0 to 7 fire nothing: their samples meet themselves.
    let half = with_own(config, of_front_end, |module| {
        let timed = bits(&mut module["ports"]["SPAD_TIMED"]["bits"]).clone();
        for pins in pins_of(module, "$_XOR_") {
            if timed[..8].contains(&pins["Y"][0]) {
                pins["A"] = pins["B"].clone();
            }
        }
    });
    let half = found(&half);
    let total = |histograms: &Histograms| {
        histograms
            .iter()
            .flatten()
            .map(|&n| u32::from(n))
            .sum::<u32>()
    };
    assert!(0 < total(&half) && total(&half) < total(&built_in));
}
