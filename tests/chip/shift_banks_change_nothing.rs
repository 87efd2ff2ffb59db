//! Long shift registers go through the kernel a word at a time. A kernel that handles instants in a random order takes them
//! flip-flop by flip-flop: every change of every net must be the same, whatever happens to clock, data and reset.

use guided_dtof::chip::{LoadPins, LoadProbe, load_path};
use guided_dtof::kernel::{Drive, Kernel, TraceHash, in_order};
use guided_dtof::logic::Logic;
use guided_dtof::netlist::{
    CellKind, Corner, Library, Module, ModuleBuilder, Net, Netlist, Timing,
};
use guided_dtof::units::Time;
use proptest::prelude::*;
use std::sync::Arc;

/// A shift register of some stages with readers of its outputs by their D; one output may be watched by a gate.
fn register(stages: usize, watched: Option<usize>) -> Arc<Module> {
    let mut m = ModuleBuilder::new("register");
    let (d, ck, r, other) = (m.input("D"), m.input("CK"), m.input("R"), m.input("OTHER"));
    let q = m.output_bus("Q", stages);
    let copies = m.output_bus("COPY", stages);
    for stage in 0..stages {
        let data = if stage == 0 { d } else { q[stage - 1] };
        let name = format!("stage_{stage}");
        m.cell(
            &name,
            CellKind::Dffr,
            &[data, ck, r],
            &[q[stage], Net::NONE],
        );
        let name = format!("copy_{stage}");
        let pins = [q[stage], other, r];
        m.cell(&name, CellKind::Dffr, &pins, &[copies[stage], Net::NONE]);
    }
    if let Some(stage) = watched {
        m.gate(CellKind::Inv, &[q[stage]]);
    }
    m.finish().unwrap()
}

/// Changes, as counted by both, and the hash of the trace.
fn trace(netlist: &Netlist, timing: &Timing, drives: &[Drive], apart: bool) -> [u64; 3] {
    let mut kernel = Kernel::new(netlist, timing);
    if apart {
        kernel = kernel.shuffled(1);
    }
    let mut hash = TraceHash::new(netlist);
    let end = drives.last().unwrap().time + Time::from_ns(5);
    kernel.run(&mut in_order(drives.to_vec()), end, &mut hash);
    [hash.changes(), kernel.statistics().changes, hash.hash()]
}

proptest! {
    #![proptest_config(ProptestConfig { cases: 150, ..ProptestConfig::default() })]

    /// Gaps from far below the delay to far above it, unknown clocks, data and resets among them.
    #[test]
    fn in_a_register_on_its_own(
        stages in 60usize..200,
        watched in prop::option::weighted(0.3, 0usize..60),
        steps in prop::collection::vec((0u8..40, 0u8..20, 5_000i64..200_000), 20..300),
    ) {
        let netlist = Netlist::elaborate(&register(stages, watched));
        let timing = Timing::nominal(&netlist, &Library::default(), Corner::Typ);
        let nets = ["D", "CK", "R", "OTHER"].map(|name| netlist.net(name).unwrap());
        let mut drives: Vec<Drive> = nets.map(|n| Drive::new(Time::ZERO, n, false)).into();
        drives.push(Drive::new(Time::from_ps(1), nets[2], true));
        drives.push(Drive::new(Time::from_ps(500), nets[2], false));
        let mut now = Time::from_ns(1);
        let mut clock = false;
        for (what, value, gap_fs) in steps {
            let value = match value {
                0 => Logic::X,
                value => Logic::from(value % 2 == 1),
            };
            let (net, value) = match what {
                0 => (nets[2], value),
                // A reset ends again.
                1..4 => (nets[2], Logic::Zero),
                4 => (nets[1], Logic::X),
                5..8 => (nets[3], value),
                8..20 => (nets[0], value),
                _ => {
                    clock = !clock;
                    (nets[1], Logic::from(clock))
                }
            };
            drives.push(Drive::new(now, net, value));
            now += Time::from_fs(gap_fs);
        }
        let apart = trace(&netlist, &timing, &drives, true);
        prop_assert_eq!(trace(&netlist, &timing, &drives, false), apart);
    }

    /// A load path of eight columns and more, broken off and begun anew.
    #[test]
    fn in_a_load_path(
        corner in prop::sample::select(Corner::ALL.to_vec()),
        (rows, cols) in (1usize..4, 8usize..12),
        half_ps in 60i64..3_000,
        bits in prop::collection::vec((any::<bool>(), 0u8..120), 50..600),
    ) {
        let netlist = Netlist::elaborate(&load_path::with_memories(rows, cols, 9));
        prop_assert!(LoadProbe::Row.bus(&netlist).len() > 64);
        let timing = Timing::nominal(&netlist, &Library::default(), corner);
        let pins = LoadPins::of(&netlist);
        let all = [pins.resetb, pins.enable, pins.clk, pins.serial];
        let mut drives: Vec<Drive> = all.map(|n| Drive::new(Time::ZERO, n, false)).into();
        drives.push(Drive::new(Time::from_ns(2), pins.resetb, true));
        drives.push(Drive::new(Time::from_ns(3), pins.enable, true));
        let half = Time::from_ps(half_ps);
        let mut now = Time::from_ns(5);
        for (bit, what) in bits {
            drives.push(Drive::new(now, pins.serial, bit));
            drives.push(Drive::new(now + half, pins.clk, true));
            now += half * 2;
            drives.push(Drive::new(now, pins.clk, false));
            if what == 0 {
                drives.push(Drive::new(now, pins.enable, false));
                now += half;
                drives.push(Drive::new(now, pins.enable, true));
            }
        }
        let apart = trace(&netlist, &timing, &drives, true);
        prop_assert_eq!(trace(&netlist, &timing, &drives, false), apart);
    }
}
