//! One number for a whole simulation: equal for equal traces, whatever the machine, the build or the order within
//! an instant.
//!
//! Every change of every net is hashed by itself (time, path of the net, value), and the hashes are added up, so
//! that no order matters but that of time.

use rand_philox::splitmix64;

use super::observer::Observer;
use crate::logic::Logic;
use crate::netlist::{NetId, Netlist};
use crate::units::Time;

/// Spreads values over the hash's bits.
const ODD: u64 = 0x9e37_79b9_7f4a_7c15;

/// Hashes all changes that it observes.
#[derive(Debug, Clone)]
pub struct TraceHash {
    /// Hashed path of each net: its number may change where the circuit does not.
    paths: Vec<u64>,
    sum: u64,
    changes: u64,
}

impl TraceHash {
    /// Nothing observed yet.
    pub fn new(netlist: &Netlist) -> Self {
        let of_path = |path: String| {
            let bytes = path.bytes().map(u64::from);
            bytes.fold(0, |hash, byte| splitmix64(hash ^ byte).wrapping_add(ODD))
        };
        let paths = (0..netlist.net_count()).map(NetId::new);
        TraceHash {
            paths: paths
                .map(|net| netlist.net_path(net).map_or(0, of_path))
                .collect(),
            sum: 0,
            changes: 0,
        }
    }

    /// The hash of everything observed so far.
    pub fn hash(&self) -> u64 {
        splitmix64(self.sum)
    }

    /// How many changes there were.
    pub fn changes(&self) -> u64 {
        self.changes
    }
}

impl Observer for TraceHash {
    #[inline]
    fn change(&mut self, time: Time, net: NetId, value: Logic) {
        let what = self.paths[net.index()].wrapping_add(ODD.wrapping_mul(value as u64 + 1));
        let when = splitmix64(time.as_fs() as u64 ^ ODD);
        self.sum = self.sum.wrapping_add(splitmix64(when.wrapping_add(what)));
        self.changes += 1;
    }
}
