//! Every change of a circuit, of many in lanes, and its hash.

use femtogate::kernel::{Drive, Kernel, LaneObserver, Lanes, Observer, TraceHash, in_order};
use femtogate::logic::Logic;
use femtogate::netlist::{NetId, Netlist, Timing};
use femtogate::units::Time;

/// When, which net, what.
pub type Change = (Time, NetId, Logic);

/// Every change of one circuit.
#[derive(Default)]
pub struct Trace(pub Vec<Change>);

impl Observer for Trace {
    fn change(&mut self, time: Time, net: NetId, value: Logic) {
        self.0.push((time, net, value));
    }
}

/// Every change in each lane.
pub struct LaneTraces(pub Vec<Vec<Change>>);

impl LaneObserver for LaneTraces {
    fn change(&mut self, time: Time, net: NetId, mask: u64, values: Lanes) {
        for (lane, trace) in self.0.iter_mut().enumerate() {
            if mask >> lane & 1 == 1 {
                trace.push((time, net, values.lane(lane)));
            }
        }
    }
}

/// Changes, as counted by both, and the hash of the trace.
pub fn trace(netlist: &Netlist, timing: &Timing, drives: &[Drive], apart: bool) -> [u64; 3] {
    let mut kernel = Kernel::new(netlist, timing);
    if apart {
        kernel = kernel.shuffled(1);
    }
    let mut hash = TraceHash::new(netlist);
    let end = drives.last().unwrap().time + Time::from_ns(5);
    kernel.run(&mut in_order(drives.to_vec()), end, &mut hash);
    assert_eq!(hash.changes(), kernel.statistics().changes);
    [hash.changes(), kernel.statistics().changes, hash.hash()]
}
