//! 64 copies of a circuit in one lane-parallel simulation: every value change of every net of every lane comes at the time, and with
//! the value, that it has when the circuit is simulated alone.

use std::collections::BTreeMap;

use femtogate::kernel::{Drive, Kernel, LANES, LaneDrive, LaneKernel, Lanes, Stimulus};
use femtogate::logic::Logic;
use femtogate::netlist::{NetId, Netlist};
use femtogate::units::Time;
use proptest::prelude::*;
use rand::{RngExt, SeedableRng, rngs::StdRng};

use crate::every_edge::circuit::{self, Case};
use crate::traces::{LaneTraces, Trace};

/// Random circuits with inertial and transport delays: in each lane another part of the stimulus is left out.
fn compare_circuit(case: &Case, seed: u64) -> Result<(), TestCaseError> {
    let netlist = Netlist::elaborate(&case.circuit());
    let timing = case.timing(&netlist);
    // Lanes know no Z, and no input that is driven twice in one instant.
    let known = |value| if value == Logic::Z { Logic::X } else { value };
    let drives: BTreeMap<(Time, NetId), Logic> = case
        .drives(&netlist)
        .into_iter()
        .map(|drive| ((drive.time, drive.net), known(drive.value)))
        .collect();
    let random = &mut StdRng::seed_from_u64(seed);
    let drives: Vec<(u64, Drive)> = drives
        .into_iter()
        .map(|((time, net), value)| {
            let mask = random.random::<u64>() | random.random::<u64>();
            (mask, Drive::new(time, net, value))
        })
        .collect();
    let end = drives.last().map_or(Time::ZERO, |(_, d)| d.time) + Time::from_ns(2);

    let mut traces = LaneTraces(vec![Vec::new(); LANES]);
    let together = drives.iter().map(|&(mask, drive)| LaneDrive {
        time: drive.time,
        net: drive.net,
        mask,
        values: Lanes::all(drive.value),
    });
    let mut lanes = LaneKernel::new(&netlist, &timing);
    lanes
        .run(&mut together.peekable(), end, &mut traces)
        .unwrap();
    let bus: Vec<NetId> = (0..netlist.net_count().min(8)).map(NetId::new).collect();
    let of_lanes: usize = traces.0.iter().map(Vec::len).sum();
    prop_assert_eq!(lanes.lane_changes(), of_lanes as u64);
    let most = traces.0.iter().map(Vec::len).max().unwrap_or(0) as u64;
    prop_assert!((most..=of_lanes as u64).contains(&lanes.events()));
    for (lane, mut found) in traces.0.into_iter().enumerate() {
        let mine = drives.iter().filter(|(mask, _)| mask >> lane & 1 == 1);
        let mut trace = Trace::default();
        let mut stimulus = Stimulus::sorted(mine.map(|(_, drive)| *drive));
        let mut kernel = Kernel::new(&netlist, &timing);
        kernel.run(&mut stimulus, end, &mut trace).unwrap();
        prop_assert_eq!(lanes.number(&bus[..1], lane), kernel.number(&bus[..1]));
        prop_assert_eq!(lanes.number(&bus, lane), kernel.number(&bus));
        trace.0.sort_by_key(|(time, net, _)| (*time, *net));
        found.sort_by_key(|(time, net, _)| (*time, *net));
        prop_assert_eq!(found, trace.0, "lane {}", lane);
    }
    Ok(())
}

proptest! {
    #![proptest_config(ProptestConfig { cases: 150, ..ProptestConfig::default() })]

    #[test]
    fn in_random_circuits(
        case in prop_oneof![circuit::flat(), circuit::hierarchical()],
        seed in any::<u64>(),
    ) {
        compare_circuit(&case, seed)?;
    }
}
