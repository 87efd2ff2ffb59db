//! Handles lead to what they are named after, and nobody else uses such names.

use std::collections::BTreeSet;
use std::path::{Path, PathBuf};

use super::*;
use crate::chip::{PCounter, SensorConfig, Tdc, load_path, p_counter};

fn config(p_counter: PCounter) -> SensorConfig {
    SensorConfig {
        rows: 2,
        cols: 3,
        p_counter,
        ..SensorConfig::default()
    }
}

#[test]
fn a_macropixel_has_every_probe_but_those_of_other_p_counters_and_tdcs() {
    let clocked = PCounter::ALL.map(|p_counter| (p_counter, Tdc::Clocked));
    for (p_counter, tdc) in clocked
        .into_iter()
        .chain([Tdc::DelayLine, Tdc::Counter].map(|tdc| (PCounter::SetReset, tdc)))
    {
        let config = SensorConfig {
            tdc,
            ..config(p_counter)
        };
        let netlist = Netlist::elaborate(&array::circuit(&config));
        let probes = Probes::of_macropixel(&netlist, 1, 2);
        for probe in Probe::ALL {
            let expected = match probe {
                Probe::Memory => p_counter.row().has_memory,
                Probe::StepClk | Probe::Shaped | Probe::Wire => false,
                Probe::SpadTimed => tdc.has_clk_bins(),
                Probe::SpadEvent | Probe::Shift => tdc == Tdc::Clocked,
                Probe::Hit => tdc != Tdc::Counter,
                Probe::Start | Probe::Counting | Probe::Code | Probe::Select | Probe::Events => {
                    tdc == Tdc::Counter
                }
                Probe::Photons | Probe::SampleClk | Probe::EvenTap | Probe::OddTap => {
                    tdc == Tdc::DelayLine
                }
                _ => true,
            };
            assert_eq!(probes.find(probe).is_some(), expected, "{probe:?}");
            if expected {
                assert_eq!(
                    netlist.signal(&probes.path(probe)).unwrap(),
                    probes.bus(probe)
                );
            }
        }
        assert_eq!(probes.toggles().len(), config.spads());
        assert_eq!(probes.bins().len(), config.bins);
        assert_eq!(
            probes.net(Probe::LocalStop),
            SensorPins::find(&netlist).local_stop[5]
        );
    }
}

#[test]
fn cells_drive_the_nets_that_they_are_named_after() {
    let config = config(PCounter::Ripple);
    let netlist = Netlist::elaborate(&array::circuit(&config));
    let probes = Probes::of_macropixel(&netlist, 0, 1);
    let outputs = |cells: Vec<CellId>| -> Vec<NetId> {
        let output = |cell: CellId| netlist.cells()[cell.index()].outputs[0].unwrap();
        cells.into_iter().map(output).collect()
    };
    assert_eq!(outputs(probes.toggle_cells(&netlist)), probes.toggles());
    assert_eq!(
        outputs(probes.shift_cells(&netlist)),
        probes.bus(Probe::Shift)
    );
    assert_eq!(outputs(probes.hit_cells(&netlist)), probes.bus(Probe::Hit));
    // One of each SPAD, of the retiming below the front end; and the first of the shift register.
    let paths = |cells: Vec<CellId>| -> Vec<String> {
        let path = |cell| netlist.cell_path(cell);
        cells.into_iter().map(path).collect()
    };
    let samplers = paths(probes.samplers(&netlist).collect());
    assert_eq!(samplers.len(), config.spads());
    assert!(
        samplers.iter().all(|path| path.ends_with(".first")),
        "{samplers:?}"
    );
    assert_eq!(
        probes.event_stages(&netlist).collect::<Vec<_>>(),
        probes.shift_cells(&netlist)[..1]
    );
    // The borrow is a flip-flop more.
    assert_eq!(
        probes.counter_cells(&netlist).len(),
        config.counter_bits + 1
    );
    let clear = probes.counter_clear(&netlist);
    assert!(clear != probes.net(Probe::ResetPulse));
}

#[test]
fn a_block_alone_has_its_own_probes() {
    let netlist = Netlist::elaborate(&p_counter::circuit(&config(PCounter::Ripple)));
    let probes = Probes::of_block(&netlist);
    assert_eq!(probes.bus(Probe::CounterOut).len(), 9);
    assert!(probes.find(Probe::CounterClk).is_some());
    assert!(probes.find(Probe::Strobe).is_none() && probes.bins().is_empty());
}

/// String literals of a line of Rust, without escapes.
fn literals(line: &str) -> impl Iterator<Item = &str> {
    line.split('"').skip(1).step_by(2)
}

/// Every Rust file below a folder of the project.
fn sources(folder: &Path, found: &mut Vec<PathBuf>) {
    for entry in std::fs::read_dir(folder).unwrap() {
        let path = entry.unwrap().path();
        if path.is_dir() {
            sources(&path, found);
        } else if path.extension().is_some_and(|extension| extension == "rs") {
            found.push(path);
        }
    }
}

/// Signals of every circuit: those that are inside the sensor, and those that are no block's pin either.
fn inner_names() -> (BTreeSet<String>, BTreeSet<String>) {
    let (mut inner, mut hidden) = (BTreeSet::new(), BTreeSet::new());
    let (mut pins, mut ports) = (BTreeSet::new(), BTreeSet::new());
    for p_counter in PCounter::ALL {
        let netlist = Netlist::elaborate(&array::circuit(&config(p_counter)));
        for (index, scope) in netlist.scopes().iter().enumerate() {
            for (_, signal) in scope.module.port_signals() {
                ports.insert(signal.name.clone());
                if index == 0 {
                    pins.insert(signal.name.clone());
                }
            }
            let named = scope.module.signals().iter().filter(|s| s.is_named);
            inner.extend(named.map(|signal| signal.name.clone()));
        }
    }
    inner.retain(|name| !pins.contains(name));
    hidden.extend(inner.difference(&ports).cloned());
    // Every flip-flop has outputs of these names, in whatever circuit a test builds.
    hidden.retain(|name| !["Q", "QN"].contains(&name.as_str()));
    (inner, hidden)
}

/// The part of a literal that would look up one of `names`: the literal itself, or the end of a dotted path in it.
fn names_a_net<'n>(literal: &str, names: &'n BTreeSet<String>) -> Option<&'n String> {
    let path = literal.split('[').next().unwrap_or_default();
    let (scope, name) = path.rsplit_once('.').unwrap_or(("", path));
    let is_path = |c: char| c.is_ascii_alphanumeric() || "_.{}".contains(c);
    names.get(name).filter(|_| scope.chars().all(is_path))
}

/// Files that build circuits name their own nets, tests of a block the block's pins.
#[test]
fn nobody_else_names_an_inner_net() {
    let (inner, hidden) = inner_names();
    assert!(inner.contains("COUNTER_RESET") && hidden.contains("STROBE"));
    let root = Path::new(env!("CARGO_MANIFEST_DIR")).join("../..");
    let mut wrong = Vec::new();
    for (folder, names) in [
        ("src", &inner),
        ("crates/lidar/src", &inner),
        ("crates/light/src", &inner),
        ("crates/scene/src", &inner),
        ("crates/sensor/src", &inner),
        ("crates/thesis/src", &inner),
        ("benches", &inner),
        ("examples", &inner),
        ("crates/lidar/src/testbenches", &hidden),
        ("tests", &hidden),
    ] {
        let mut files = Vec::new();
        sources(&root.join(folder), &mut files);
        // Testbenches are a room of their own.
        files.retain(|file| {
            let below = file.strip_prefix(root.join(folder)).unwrap_or(file);
            let is_testbench = folder == "crates/lidar/src" && below.starts_with("testbenches");
            // A cell library has pins of such names.
            let writes_cells = below.ends_with("strategies/libraries.rs");
            !is_testbench && !writes_cells && !below.starts_with("chip/probes")
        });
        for file in files {
            let text = std::fs::read_to_string(&file).unwrap();
            let builds_circuits = folder.contains("src") && text.contains("ModuleBuilder");
            if builds_circuits {
                continue;
            }
            for (number, line) in text.lines().enumerate() {
                for literal in literals(line).filter(|l| names_a_net(l, names).is_some()) {
                    wrong.push(format!("{}:{}: {literal}", file.display(), number + 1));
                }
            }
        }
    }
    assert!(wrong.is_empty(), "{wrong:#?}");
    assert!(names_a_net("{pixel}.metdc.STROBE", &inner).is_some());
    assert!(names_a_net("mp_r0_c0.COUNTER_OUT[3]", &inner).is_some());
    assert!(names_a_net("HIT has no time to fall", &inner).is_none());
}

#[test]
fn the_load_path_is_found_with_and_without_its_macropixels() {
    let config = config(PCounter::Ripple);
    let sensor = Netlist::elaborate(&array::circuit(&config));
    let (rows, cols, bits) = (config.rows, config.cols, config.counter_bits);
    let load = Netlist::elaborate(&load_path::with_memories(rows, cols, bits));
    for netlist in [&sensor, &load] {
        assert_eq!(LoadProbe::Select.bus(netlist).len(), rows);
        assert_eq!(LoadProbe::Row.bus(netlist).len(), cols * bits);
        assert!(LoadProbe::Write.net(netlist).index() < netlist.net_count());
    }
    assert_eq!(memories(&load, rows, cols).len(), config.pixels());
}
