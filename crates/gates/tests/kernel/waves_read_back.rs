//! Whatever the simulation did, a reader of its dump sees: same names, times and values.
//!
//! Random circuits are driven at random; every change is recorded beside a VCD and an FST file of the whole
//! simulation or of a span of it. Two independent readers, Surfer's and that of the `vcd` crate, must then report for
//! every signal exactly what the recording says, one value per instant; and GTKWave's `fst2vcd`, where it is installed,
//! must make of the FST file the same declarations and changes as the VCD has.

use std::collections::{BTreeMap, HashMap};
use std::io::Cursor;
use std::ops::RangeInclusive;
use std::process::Command;
use std::sync::{Arc, Once};

use femtogate::kernel::{Drive, Kernel, Recorder, Stimulus};
use femtogate::logic::Logic;
use femtogate::netlist::{
    CellKind, Corner, Delay, Library, Module, ModuleBuilder, NetId, Netlist, ScopeId, Timing,
    TimingArc,
};
use femtogate::units::Time;
use femtogate::waves::{FstWriter, VcdWriter, WaveSelection};
use proptest::prelude::*;

/// Times (fs) and values of one signal, first the initial one.
type Changes = Vec<(u64, String)>;

/// A divide-by-two: D = Q̄.
fn toggle() -> Arc<Module> {
    let mut m = ModuleBuilder::new("toggle");
    let (clk, reset) = (m.input("CLK"), m.input("RESET"));
    let (q, qn) = (m.output("Q"), m.output("QN"));
    m.cell("flip", CellKind::Dffr, &[qn, clk, reset], &[q, qn]);
    m.finish().unwrap()
}

/// A ripple counter and the parity of its outputs, which glitches while the counter ripples.
fn counter(stages: usize) -> Arc<Module> {
    let toggle = toggle();
    let mut m = ModuleBuilder::new("counter");
    let (clk, reset) = (m.input("CLK"), m.input("RESET"));
    let count = m.output_bus("COUNT", stages);
    let parity = m.output("PARITY");
    let inverted = m.wire_bus("INVERTED", stages);
    let mut clock = clk;
    for i in 0..stages {
        let ports = [
            ("CLK", &[clock][..]),
            ("RESET", &[reset]),
            ("Q", &count[i..=i]),
            ("QN", &inverted[i..=i]),
        ];
        m.instance(&format!("stage{i}"), &toggle, &ports);
        clock = inverted[i];
    }
    let last = m.tree(CellKind::Xor2, &count);
    m.gate_into(CellKind::Buf, &[last], parity);
    m.finish().unwrap()
}

/// Two counters, probes that see a counter's bus whole, in part and turned round, and a random
/// network of gates.
fn chip(stages: usize, gates: &[(u8, u16, u16)]) -> Netlist {
    let mut m = ModuleBuilder::new("probe");
    let whole = m.input_bus("WHOLE", stages);
    let lowest = m.input_bus("LOWEST", 1);
    let turned = m.input_bus("TURNED", stages);
    m.gate(CellKind::Xor2, &[whole[0], lowest[0]]);
    m.gate(CellKind::Inv, &turned[..1]);
    let probe = m.finish().unwrap();

    let counter = counter(stages);
    let mut m = ModuleBuilder::new("chip");
    let (clk, reset) = (m.input("CLK"), m.input("RESET"));
    let data = m.input_bus("DATA", 3);
    let mut pool = [&[clk, reset], &data[..]].concat();
    for (name, clock) in [("a", clk), ("b", data[0])] {
        let bus = m.wire_bus(&format!("COUNT_{name}"), stages);
        let parity = m.wire(&format!("PARITY_{name}"));
        let ports = [
            ("CLK", &[clock][..]),
            ("RESET", &[reset]),
            ("COUNT", &bus),
            ("PARITY", &[parity]),
        ];
        m.instance(name, &counter, &ports);
        let turned: Vec<_> = bus.iter().rev().copied().collect();
        let ports = [
            ("WHOLE", &bus[..]),
            ("LOWEST", &bus[..1]),
            ("TURNED", &turned),
        ];
        m.instance(&format!("probe_{name}"), &probe, &ports);
        pool.extend(bus);
        pool.push(parity);
    }
    let kinds = [
        CellKind::Xor2,
        CellKind::Nand2,
        CellKind::Or2,
        CellKind::Xnor2,
    ];
    let outputs = m.output_bus("OUT", gates.len());
    for (&(kind, a, b), &output) in gates.iter().zip(&outputs) {
        let inputs = [a, b].map(|i| pool[i as usize % pool.len()]);
        m.gate_into(kinds[kind as usize % kinds.len()], &inputs, output);
        pool.push(output);
    }
    Netlist::elaborate(&m.finish().unwrap())
}

/// A reset pulse, then drives at gaps from nothing (several changes in an instant) to longer than
/// any ripple.
fn drives(netlist: &Netlist, choices: &[(usize, u8, i64)]) -> Vec<Drive> {
    let inputs = netlist.inputs();
    let reset = netlist.net("RESET").unwrap();
    let mut drives: Vec<Drive> = inputs
        .iter()
        .map(|&n| Drive::new(Time::ZERO, n, n == reset))
        .collect();
    let mut time = Time::from_ns(1);
    drives.push(Drive::new(time, reset, false));
    for &(net, value, gap_fs) in choices {
        time += Time::from_fs(gap_fs);
        let net = inputs[net % inputs.len()];
        drives.push(Drive::new(time, net, Logic::from_bits(value)));
    }
    drives
}

/// Delays of 0 and 1 ps, so that many changes fall into one instant and some are undone in it.
fn coarse_library() -> Library {
    let mut library = Library::generic_40nm();
    for kind in CellKind::ALL {
        let ps = i64::from(kind.is_flip_flop());
        let delay = Delay::fixed(Time::from_ps(ps));
        let arc = TimingArc {
            rise: delay,
            fall: delay,
        };
        library.set_arcs(kind, [[arc; 2]; 4]);
    }
    library
}

/// The files of a simulation, what they keep of it, and every change of every net in it.
struct SimulatedWaves {
    vcd: String,
    fst: Vec<u8>,
    span: RangeInclusive<u64>,
    recorder: Recorder,
}

/// Simulates, and keeps this part of the whole (from, until), in thousandths.
fn simulate(
    netlist: &Netlist,
    library: &Library,
    drives: Vec<Drive>,
    kept: Option<(i64, i64)>,
) -> SimulatedWaves {
    let end = drives.last().unwrap().time + Time::from_ns(3);
    let mut stimulus = Stimulus::new(drives);
    let selection = WaveSelection::all().with_anonymous();
    let mut vcd = VcdWriter::new(Vec::new(), netlist, &selection).unwrap();
    let mut fst = FstWriter::new(Cursor::new(Vec::new()), netlist, &selection).unwrap();
    let mut span = Time::ZERO..=end;
    if let Some((from, until)) = kept {
        let part = |thousandth| Time::from_fs(end.as_fs() / 1000 * thousandth);
        span = part(from.min(until))..=part(from.max(until));
        vcd = vcd.keep(span.clone());
        fst = fst.keep(span.clone());
    }
    let recorder = Recorder::new((0..netlist.net_count()).map(NetId::new));
    let mut observers = (recorder, (vcd, fst));
    let mut kernel = Kernel::new(netlist, &Timing::nominal(netlist, library, Corner::Typ));
    kernel.run(&mut stimulus, end, &mut observers).unwrap();
    let (recorder, (vcd, fst)) = observers;
    let vcd = String::from_utf8(vcd.finish(end).unwrap()).unwrap();
    let fst = fst.finish(end).unwrap().into_inner();
    assert!(vcd.ends_with('\n'));
    let span = span.start().as_fs() as u64..=span.end().as_fs() as u64;
    SimulatedWaves {
        vcd,
        fst,
        span,
        recorder,
    }
}

/// What a file should say of `nets` (bit 0 first): their value where it begins, then one per instant, and only changes.
fn expected(simulated: &SimulatedWaves, nets: &[NetId]) -> Changes {
    let (recorder, span) = (&simulated.recorder, &simulated.span);
    let mut values: HashMap<NetId, Logic> = nets.iter().map(|&n| (n, Logic::X)).collect();
    let text = |values: &HashMap<NetId, Logic>| -> String {
        nets.iter().rev().map(|n| values[n].to_char()).collect()
    };
    let mut by_time: BTreeMap<i64, Vec<(NetId, Logic)>> = BTreeMap::new();
    for &(time, net, value) in recorder.changes() {
        if values.contains_key(&net) {
            by_time.entry(time.as_fs()).or_default().push((net, value));
        }
    }
    let mut before = text(&values);
    let mut changes = Vec::new();
    for (time, instant) in by_time {
        values.extend(instant);
        let (time, now) = (time as u64, text(&values));
        if span.contains(&time) && changes.is_empty() {
            changes.push((*span.start(), before.clone()));
        }
        if span.contains(&time) && before != now {
            changes.push((time, now.clone()));
        }
        if time <= *span.end() {
            before = now;
        }
    }
    if changes.is_empty() {
        changes.push((*span.start(), before));
    }
    changes
}

/// Only the last of several values at one time, which a viewer settles on.
fn settled(changes: Changes) -> Changes {
    let mut settled: Changes = Vec::new();
    for (time, value) in changes {
        settled.pop_if(|(last, _)| *last == time);
        settled.push((time, value));
    }
    settled
}

/// Path, whether it is a bus, and nets of every signal of every scope.
fn signals(netlist: &Netlist) -> Vec<(Vec<String>, bool, Vec<NetId>)> {
    let mut signals = Vec::new();
    for (index, scope) in netlist.scopes().iter().enumerate() {
        for signal in scope.module.signals() {
            let path = format!(
                "{}.{}",
                netlist.scope_path(ScopeId::new(index)),
                signal.name
            );
            let path = path.split('.').map(str::to_owned).collect();
            let nets = netlist.signal_nets(scope, signal).collect();
            signals.push((path, signal.is_bus, nets));
        }
    }
    signals
}

/// Checks a file with Surfer's reader.
fn check_with_wellen(file: &[u8], netlist: &Netlist, simulated: &SimulatedWaves) {
    let mut waves = wellen::simple::read_from_reader(Cursor::new(file.to_owned())).unwrap();
    let first = *waves.time_table().first().unwrap();
    assert_eq!(first, *simulated.span.start(), "the file begins elsewhere");
    let unit = waves.hierarchy().timescale().unwrap();
    assert_eq!(
        (unit.factor, unit.unit),
        (1, wellen::TimescaleUnit::FemtoSeconds)
    );
    let mut signal_of: HashMap<Vec<NetId>, wellen::SignalRef> = HashMap::new();
    for (path, is_bus, nets) in signals(netlist) {
        let (name, scopes) = path.split_last().unwrap();
        let hierarchy = waves.hierarchy();
        let var = hierarchy.lookup_var(scopes, name.clone());
        let var = &hierarchy[var.unwrap_or_else(|| panic!("{path:?} is not in the dump"))];
        assert_eq!(var.length(hierarchy), Some(nets.len() as u32), "{path:?}");
        let range = var.index().map(|i| (i.msb(), i.lsb()));
        let wanted = is_bus.then_some((nets.len() as i64 - 1, 0));
        assert_eq!(range, wanted, "{path:?}");
        let signal = var.signal_ref();
        let first = *signal_of.entry(nets.clone()).or_insert(signal);
        assert_eq!(first, signal, "{path:?} shares its nets but not its code");
        waves.load_signals(&[signal]);
        let times = waves.time_table();
        let changes = waves.get_signal(signal).unwrap().iter_changes();
        let changes = changes
            .map(|(time, value)| (times[time as usize], value.to_bit_string().unwrap()))
            .collect();
        let wanted = settled(expected(simulated, &nets));
        assert_eq!(settled(changes), wanted, "{path:?}");
    }
    let mut distinct: Vec<_> = signal_of.values().collect();
    distinct.sort();
    distinct.dedup();
    assert_eq!(
        distinct.len(),
        signal_of.len(),
        "different nets share a code"
    );
}

/// Times and values of every line of a VCD, by identifier code.
fn lines(text: &str) -> (vcd::Header, HashMap<vcd::IdCode, Changes>) {
    let mut parser = vcd::Parser::new(text.as_bytes());
    let header = parser.parse_header().unwrap();
    assert_eq!(header.timescale, Some((1, vcd::TimescaleUnit::FS)));
    let mut lines: HashMap<vcd::IdCode, Changes> = HashMap::new();
    let mut time = None;
    let mut is_time_used = true;
    for command in parser {
        let (code, value) = match command.unwrap() {
            vcd::Command::Timestamp(next) => {
                assert!(time.is_none_or(|last| last < next), "time stands still");
                assert!(is_time_used, "a time without a change");
                time = Some(next);
                is_time_used = false;
                continue;
            }
            vcd::Command::ChangeScalar(code, value) => (code, value.to_string()),
            vcd::Command::ChangeVector(code, value) => (code, value.to_string()),
            _ => continue,
        };
        is_time_used = true;
        // `fst2vcd` leaves out the time of the first values where it is 0.
        let time = time.unwrap_or(0);
        lines.entry(code).or_default().push((time, value));
    }
    (header, lines)
}

/// Checks the VCD with the `vcd` crate's reader, which reports every line.
fn check_with_vcd(netlist: &Netlist, simulated: &SimulatedWaves) {
    let (header, lines) = lines(&simulated.vcd);
    for (path, _, nets) in signals(netlist) {
        let var = header.find_var(&path).expect("every signal is declared");
        // Not settled: no line may repeat what is known.
        assert_eq!(lines[&var.code], expected(simulated, &nets), "{path:?}");
    }
}

/// Path, type, width, range and changes of every variable, in the order of the file.
type DeclaredSignals = Vec<(
    String,
    vcd::VarType,
    u32,
    Option<vcd::ReferenceIndex>,
    Changes,
)>;

fn declared(text: &str) -> DeclaredSignals {
    fn add(
        items: &[vcd::ScopeItem],
        path: &str,
        lines: &HashMap<vcd::IdCode, Changes>,
        all: &mut DeclaredSignals,
    ) {
        for item in items {
            match item {
                vcd::ScopeItem::Var(var) => {
                    let path = format!("{path}.{}", var.reference);
                    let changes = settled(lines[&var.code].clone());
                    all.push((path, var.var_type, var.size, var.index, changes));
                }
                vcd::ScopeItem::Scope(scope) => {
                    let path = format!("{path}.{}", scope.identifier);
                    add(&scope.items, &path, lines, all);
                }
                _ => {}
            }
        }
    }
    let (header, lines) = lines(text);
    let mut all = Vec::new();
    add(&header.items, "", &lines, &mut all);
    all
}

/// Checks the FST file with GTKWave's own converter, where there is one.
fn check_with_fst2vcd(simulated: &SimulatedWaves) {
    static SKIPPED: Once = Once::new();
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("x.fst");
    std::fs::write(&path, &simulated.fst).unwrap();
    let Ok(output) = Command::new("fst2vcd").arg(&path).output() else {
        SKIPPED
            .call_once(|| eprintln!("SKIPPED: no fst2vcd; install gtkwave to compare FST with it"));
        return;
    };
    assert!(output.status.success(), "{output:?}");
    let text = String::from_utf8(output.stdout).unwrap();
    assert_eq!(declared(&text), declared(&simulated.vcd));
}

/// How a simulation is driven: input, value, gap in fs.
type Choices = Vec<(usize, u8, i64)>;

fn choices(most: usize) -> impl Strategy<Value = Choices> {
    let choice = (
        any::<usize>(),
        prop_oneof![8 => 0u8..2, 1 => 2u8..4],
        prop_oneof![Just(0), 0i64..3_000, 0i64..2_000_000],
    );
    prop::collection::vec(choice, 0..most)
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(64))]

    #[test]
    fn readers_see_what_happened(
        stages in 1usize..6,
        gates in prop::collection::vec(any::<(u8, u16, u16)>(), 1..12),
        choices in choices(120),
        is_coarse in any::<bool>(),
        kept in prop::option::of((0i64..=1000, 0i64..=1000)),
    ) {
        let netlist = chip(stages, &gates);
        let library = if is_coarse { coarse_library() } else { Library::generic_40nm() };
        let simulated = simulate(&netlist, &library, drives(&netlist, &choices), kept);
        check_with_wellen(simulated.vcd.as_bytes(), &netlist, &simulated);
        check_with_vcd(&netlist, &simulated);
        check_with_wellen(&simulated.fst, &netlist, &simulated);
        check_with_fst2vcd(&simulated);
    }
}

/// Many changes: several blocks of FST, at whose ends nothing may be lost or told twice.
#[test]
fn a_long_file_reads_back() {
    let netlist = chip(5, &[(0, 5, 9), (1, 3, 12)]);
    let inputs = netlist.inputs().len();
    let choices: Choices = (0..120_000)
        .map(|i| (i, (i / inputs % 2) as u8, 300_000 + i as i64 % 7))
        .collect();
    let drives = drives(&netlist, &choices);
    let simulated = simulate(&netlist, &Library::generic_40nm(), drives, Some((100, 900)));
    assert!(simulated.fst.len() < simulated.vcd.len() / 4);
    check_with_wellen(&simulated.fst, &netlist, &simulated);
    check_with_fst2vcd(&simulated);
}

#[test]
fn the_same_simulation_writes_the_same_bytes() {
    let choices: Choices = (0..200).map(|i| (i, (i / 5 % 2) as u8, 400_000)).collect();
    let run = || {
        let netlist = chip(4, &[(0, 5, 9), (1, 3, 12)]);
        let drives = drives(&netlist, &choices);
        let simulated = simulate(&netlist, &Library::generic_40nm(), drives, None);
        (simulated.vcd, simulated.fst)
    };
    assert_eq!(run(), run());
}
