//! Every change of a circuit, of many in lanes, and its hash.

use femtogate::kernel::{Drive, Kernel, LaneObserver, Lanes, Observer, Stimulus, TraceHash};
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

/// Number of changes, and hash of the trace; instants are handled in a random order where there is a seed for it.
pub fn trace(
    netlist: &Netlist,
    timing: &Timing,
    drives: Vec<Drive>,
    shuffle: Option<u64>,
) -> (u64, u64) {
    let mut kernel = Kernel::new(netlist, timing);
    if let Some(seed) = shuffle {
        kernel = kernel.shuffled(seed);
    }
    let end = drives.last().map_or(Time::ZERO, |d| d.time) + Time::from_ns(2);
    let mut hash = TraceHash::new(netlist);
    kernel
        .run(&mut Stimulus::sorted(drives), end, &mut hash)
        .unwrap();
    assert_eq!(hash.changes(), kernel.statistics().changes);
    (hash.changes(), hash.hash())
}
