//! Long shift registers go through the kernel a word at a time. A kernel that handles instants in a random order takes them
//! flip-flop by flip-flop: every change of every net must be the same, whatever happens to clock, data and reset.

use std::sync::Arc;

use femtogate::kernel::{Drive, Kernel, Stimulus};
use femtogate::logic::Logic;
use femtogate::netlist::{
    CellKind, Corner, Library, Module, ModuleBuilder, NetId, Netlist, Timing,
};
use femtogate::units::Time;
use proptest::prelude::*;

use crate::traces::{Change, Trace, trace};

/// A shift register of some stages with readers of its outputs by their D; outputs may be watched by gates.
fn register(stages: usize, watched: impl IntoIterator<Item = usize>) -> Arc<Module> {
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
            &[Some(q[stage]), None],
        );
        let name = format!("copy_{stage}");
        let pins = [q[stage], other, r];
        m.cell(&name, CellKind::Dffr, &pins, &[Some(copies[stage]), None]);
    }
    for stage in watched {
        m.gate(CellKind::Inv, &[q[stage]]);
    }
    m.finish().unwrap()
}

/// Every change, by time and net.
fn changes(netlist: &Netlist, timing: &Timing, drives: Vec<Drive>) -> Vec<Change> {
    let mut trace = Trace::default();
    let end = drives.last().expect("drives").time + Time::from_ns(2);
    Kernel::new(netlist, timing)
        .run(&mut Stimulus::sorted(drives), end, &mut trace)
        .unwrap();
    trace.0.sort_by_key(|&(time, net, _)| (time, net));
    trace.0
}

/// Values of all nets at some times, where nobody needs changes, and how many changes there were; instants are handled in a random order
/// where there is a seed for it.
fn values(
    netlist: &Netlist,
    timing: &Timing,
    drives: Vec<Drive>,
    times: &[Time],
    shuffle: Option<u64>,
) -> Vec<(Vec<Logic>, u64)> {
    let mut kernel = Kernel::new(netlist, timing);
    if let Some(seed) = shuffle {
        kernel = kernel.shuffled(seed);
    }
    let mut stimulus = Stimulus::sorted(drives);
    let values_after = |&time: &Time| {
        kernel.run(&mut stimulus, time, &mut ()).unwrap();
        let nets = (0..netlist.net_count()).map(NetId::new);
        let values = nets.map(|net| kernel.value(net));
        (values.collect(), kernel.statistics().changes)
    };
    times.iter().map(values_after).collect()
}

proptest! {
    #![proptest_config(ProptestConfig { cases: 150, ..ProptestConfig::default() })]

    /// Gaps from far below the delay to far above it, unknown clocks, data and resets among them: so few that most registers fill beyond
    /// their first word.
    #[test]
    fn in_a_register_on_its_own(
        stages in 60usize..200,
        watched in prop::option::weighted(0.3, 0usize..60),
        steps in prop::collection::vec((0u16..400, 0u8..100, 5_000i64..200_000), 20..600),
    ) {
        let netlist = Netlist::elaborate(&register(stages, watched));
        let timing = Timing::nominal(&netlist, &Library::generic_40nm(), Corner::Typ);
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
                1..20 => (nets[2], Logic::Zero),
                20 => (nets[1], Logic::X),
                21..50 => (nets[3], value),
                50..140 => (nets[0], value),
                _ => {
                    clock = !clock;
                    (nets[1], Logic::from(clock))
                }
            };
            drives.push(Drive::new(now, net, value));
            now += Time::from_fs(gap_fs);
        }
        let every_tenth = drives.iter().skip(9).step_by(10).map(|drive| drive.time);
        let times: Vec<Time> = every_tenth.chain([now + Time::from_ns(2)]).collect();
        let unwatched = |shuffle| values(&netlist, &timing, drives.clone(), &times, shuffle);
        prop_assert!(unwatched(None) == unwatched(Some(1)));
        let apart = trace(&netlist, &timing, drives.clone(), Some(1));
        prop_assert_eq!(trace(&netlist, &timing, drives.clone(), None), apart);
        // Where a gate watches every output there is no bank at all, and the register's nets, which come first, do the same.
        let watched = Netlist::elaborate(&register(stages, 0..stages));
        let timing_of_watched = Timing::nominal(&watched, &Library::generic_40nm(), Corner::Typ);
        let here = changes(&netlist, &timing, drives.clone());
        let mut there = changes(&watched, &timing_of_watched, drives);
        let of_register = 4 + 2 * stages;
        there.retain(|(_, net, _)| net.index() < of_register);
        prop_assert!(here.len() > stages);
        prop_assert_eq!(here.into_iter().filter(|(_, net, _)| net.index() < of_register).collect::<Vec<_>>(), there);
    }
}
