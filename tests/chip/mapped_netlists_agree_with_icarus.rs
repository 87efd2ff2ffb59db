//! `mapped.v` with `mapped_cells.v` and `mapped.sdf`, in Icarus Verilog, beside our kernel with the library's delays: every edge of every net of a macropixel.
//!
//! ```text
//!   gate engine ─► what comes to the macropixel's pins ─┬─► Kernel, delays of `CharacterisedNetlist` ─┐
//!                                                       └─► Icarus, mapped.v and mapped.sdf ──────────┴─► the same?
//! ```
//!
//! Where several cells of the library stand for one of ours the kernel has one delay, the sum, rounded to whole femtoseconds; Icarus rounds each.
//! A ripple adds such differences up, so edges may be [`APART_FS`] apart. A pulse shorter than the sum, but not than each, comes through in Icarus alone;
//! Icarus 11 mistakes some of three changes within one delay, too (`verilog/standard_cells`). The adders of the correlation are full of such pulses and are left
//! out: what CLK samples of them is compared in the METDC. Elsewhere a few are passed over and counted, and none on [`EXACT`].
//!
//! Chips: the QuantIC4x4 with every P-counter whose reset pulse is not more than 50 ps too short in the library (`gdtof timing` says by how much; removal times, which neither
//! simulator knows, are in it). HSLIDAR's reset, which loads the counter, is too short in them.

use crate::cases::cases;
use crate::every_edge::waves::Waves;
use crate::icarus;
use crate::library_chips::{self, MappedChip};
use crate::testbench::testbench;

use std::collections::BTreeMap;
use std::fs::File;
use std::io::BufReader;

use guided_dtof::analysis::TimingVerdict;
use guided_dtof::chip::{Exposure, PCounter, Probe, Silicon};
use guided_dtof::engine::GateSimulation;
use guided_dtof::kernel::{Drive, Kernel, Recorder, Stimulus};
use guided_dtof::netlist::{Direction, NetId, ScopeId};
use guided_dtof::photon::{SpadEvent, apply_dead_time};
use guided_dtof::units::Time;
use rand::{RngExt, SeedableRng, rngs::StdRng};

/// Nets of which no edge is off.
const EXACT: [Probe; 4] = [
    Probe::CounterClk,
    Probe::CounterReset,
    Probe::LocalStop,
    Probe::Strobe,
];
/// How far apart an edge may be.
const APART_FS: u64 = 20;

/// A net's edges: time (fs) and level.
type Edges = Vec<(u64, String)>;

/// Compares every edge from the first STOP on; how many there are, and pulses and edges that are off.
fn compare(mapped: &MappedChip, seed: u64) -> (usize, usize) {
    let random = &mut StdRng::seed_from_u64(seed);
    let config = &mapped.config;
    let exposure = Exposure::new(config, 70, 3);
    let mut pulses: Vec<SpadEvent> = (0..120)
        .map(|_| SpadEvent {
            time: Time::from_fs(random.random_range(0..exposure.end().as_fs())),
            spad: random.random_range(0..config.spads() as u8),
        })
        .collect();
    pulses.sort_unstable();
    apply_dead_time(&mut pulses, &config.spad_model(), 0);
    let start = random.random_range(20..40);
    let mut gate = GateSimulation::new(config, &exposure, (0, 0), (1, 1), &[start], &[&pulses]);

    // What comes to the pins of the macropixel in its array, for the macropixel alone.
    let netlist = &mapped.netlist;
    let (array, top) = (gate.netlist(), &netlist.scopes()[0]);
    let mut scopes = array.scopes().iter();
    let placed = scopes.find(|scope| scope.module.name() == top.module.name());
    let placed = placed.expect("the array has a macropixel");
    let mut pins: Vec<(NetId, NetId)> = Vec::new();
    let ports = placed.module.port_signals().zip(top.module.port_signals());
    for ((direction, within), (_, alone)) in ports {
        if direction == Direction::Input {
            let within = array.signal_nets(placed, within);
            pins.extend(within.zip(netlist.signal_nets(top, alone)));
        }
    }
    let mut recorder = Recorder::new(pins.iter().map(|pin| pin.0));
    gate.run(&mut recorder);
    let (from, end) = (gate.schedule().origin, gate.schedule().end);
    let mut drives: Vec<Drive> = Vec::new();
    for &(time, net, value) in recorder.changes() {
        let behind = pins.iter().filter(|pin| pin.0 == net);
        drives.extend(behind.map(|pin| Drive::new(time, pin.1, value)));
    }

    let all = 0..netlist.net_count();
    let mut recorder = Recorder::new(all.map(NetId::new));
    let timing = &mapped.characterised.timing;
    Kernel::new(netlist, timing)
        .run(&mut Stimulus::sorted(drives.clone()), end, &mut recorder)
        .unwrap();
    let mut ours: BTreeMap<String, Edges> = BTreeMap::new();
    for &(time, net, value) in recorder.changes().iter().filter(|change| change.0 >= from) {
        if let Some(name) = netlist.net_path(net) {
            ours.entry(name)
                .or_default()
                .push((time.as_fs() as u64, value.to_string()));
        }
    }

    let top = &netlist.scopes()[0].module;
    let annotated = "  initial $sdf_annotate(\"mapped.sdf\", dut);\n";
    let bench = testbench(top, netlist, &drives, annotated);
    let dump = format!(
        "$dumpfile(\"icarus.vcd\"); $dumpvars(0, tb.dut); #{} $finish;",
        end.as_fs()
    );
    let run = format!("module run; initial begin {dump} end endmodule\n");
    let (cells, netlist) = (mapped.text("mapped_cells.v"), mapped.text("mapped.v"));
    let all = format!("{cells}\n{netlist}\n`timescale 1fs/1fs\n{bench}{run}");
    let folder = mapped.folder.path();
    std::fs::write(folder.join("case.v"), all).unwrap();
    let said = icarus::simulate(folder, &["-gspecify", "case.v"], &["-sdf-warn"]);
    assert!(!said.contains("SDF"), "every entry finds its path: {said}");
    let dump = File::open(folder.join("icarus.vcd")).unwrap();
    let waves = Waves::read(BufReader::new(dump), "tb.dut");
    let theirs = waves.changes().map(|(path, changes)| {
        let changes = changes
            .iter()
            .filter(|(time, _)| *time >= from.as_fs() as u64);
        (
            path.trim_start_matches('\\').to_owned(),
            changes.cloned().collect(),
        )
    });
    let theirs: BTreeMap<String, Edges> = theirs.collect();

    let slowest = mapped.netlist.cells_below(ScopeId::TOP).flat_map(|cell| {
        let arcs = timing.cell_delays(cell).as_flattened().iter();
        arcs.map(|arc| arc.rise().max(arc.fall()))
            .collect::<Vec<_>>()
    });
    let slowest = 4 * slowest.max().unwrap().as_fs() as u64;
    let mut wrong: BTreeMap<u64, String> = BTreeMap::new();
    let (mut edges, mut off, mut exact) = (0, 0, 0);
    let is_adder = |name: &str| name.contains("correlation") || name.ends_with("SPAD_EVENT");
    for (name, ours) in ours.iter().filter(|(name, _)| !is_adder(name)) {
        // Ports have no path there.
        let theirs = theirs
            .get(name)
            .or_else(|| theirs.get(name.strip_prefix("macropixel.")?));
        let Some(theirs) = theirs else {
            continue;
        };
        let before = off;
        edges += ours.len();
        let (mut ours, mut theirs) = (&ours[..], &theirs[..]);
        while let (Some(own), Some(other)) = (ours.first(), theirs.first()) {
            let is_pulse =
                |edges: &[(u64, String)]| edges.len() > 1 && edges[1].0 - edges[0].0 < slowest;
            if own.1 == other.1 && own.0.abs_diff(other.0) <= APART_FS {
                (ours, theirs) = (&ours[1..], &theirs[1..]);
            } else if other.0 < own.0 && is_pulse(theirs) {
                (theirs, off) = (&theirs[2..], off + 1);
            } else if is_pulse(ours) {
                (ours, off) = (&ours[2..], off + 1);
            } else if own.1 == other.1 && own.0.abs_diff(other.0) < slowest {
                (ours, theirs, off) = (&ours[1..], &theirs[1..], off + 1);
            } else {
                let text = format!("{name}: {own:?}, in Icarus {other:?}");
                wrong.insert(own.0.min(other.0), text);
                break;
            }
        }
        off += usize::max(ours.len(), theirs.len()).div_ceil(2);
        let local = name.rsplit('.').next().unwrap();
        let is_exact = EXACT.iter().any(|probe| probe.name() == local);
        assert!(off == before || !is_exact, "{name}");
        exact += usize::from(is_exact);
    }
    assert!(wrong.is_empty(), "{:?}", wrong.first_key_value());
    assert_eq!(exact, EXACT.len());
    (edges, off)
}

#[test]
fn edge_by_edge() {
    if !icarus::is_here() {
        return;
    }
    // Half of the chips in each library, each chip in some.
    let takes_all = cases(1) > 1;
    let mut compared = 0;
    for (place, (library, text)) in library_chips::libraries().into_iter().enumerate() {
        let chips = library_chips::chips()
            .into_iter()
            .filter(|chip| !chip.reset_to_load);
        for (seed, chip) in (0..).zip(chips) {
            if !takes_all && !(place + seed as usize).is_multiple_of(2) {
                continue;
            }
            let p_counter = chip.p_counter;
            let mapped = MappedChip::new(&text, chip);
            let verdict =
                TimingVerdict::analyse(&mapped.config, &Silicon::new(&mapped.config), (0, 0));
            if verdict.worst().slack < Time::from_ps(-50) {
                continue;
            }
            compared += 1;
            let (edges, off) = compare(&mapped, seed);
            println!("{library}, {p_counter:?}: {edges} edges, {off} off");
            // 6.9 % in the synchronous counter's carry chain, 1.5 % in those of segments, and none in the others.
            let most = match p_counter {
                PCounter::Synchronous => edges / 12,
                PCounter::Segmented => edges / 50,
                _ => 0,
            };
            let found = format!("{library}, {p_counter:?}: {off} of {edges}");
            assert!(edges > 1000 && off <= most, "{found}");
        }
    }
    assert!(compared >= if takes_all { 6 } else { 3 }, "{compared}");
}
