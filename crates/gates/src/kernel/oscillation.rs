//! What a kernel cannot simulate: a loop of cells without delay.

use crate::netlist::NetId;
use crate::units::Time;

/// Rounds of zero-delay changes in one instant after which a loop is assumed to oscillate.
pub(super) const MOST_DELTA_CYCLES: u32 = 10_000;

/// A loop of cells without delay changes for ever within one instant. The simulation is left in the midst of that instant.
#[derive(Debug, Clone, Copy, PartialEq, Eq, thiserror::Error)]
#[non_exhaustive]
#[error("a loop of cells without delay oscillates at {time}; give one of them a delay")]
pub struct Oscillation {
    /// The instant.
    pub time: Time,
    /// A net of the loop, or behind it.
    pub net: NetId,
}

#[cfg(test)]
mod tests {
    use crate::kernel::{Drive, Kernel, LaneDrive, LaneKernel, Lanes, Stimulus};
    use crate::logic::Logic;
    use crate::netlist::{
        ArcDelay, CellId, CellKind, Corner, Library, MAX_INPUTS, MAX_OUTPUTS, ModuleBuilder,
        Netlist, Timing,
    };
    use crate::units::Time;

    #[test]
    fn a_loop_without_delay_is_an_error_that_names_it() {
        let mut m = ModuleBuilder::new("ring");
        let (a, z) = (m.input("A"), m.output("Z"));
        m.gate_into(CellKind::Nand2, &[a, z], z);
        let netlist = Netlist::elaborate(&m.finish().unwrap());
        let mut timing = Timing::nominal(&netlist, &Library::generic_40nm(), Corner::Typ);
        let nothing = ArcDelay {
            rise_fs: 0,
            fall_fs: 0,
        };
        timing.set(CellId::new(0), [[nothing; MAX_OUTPUTS]; MAX_INPUTS]);
        let [a, z] = ["A", "Z"].map(|name| netlist.net(name).unwrap());
        let drives = [(1, false), (3, true)].map(|(ns, value)| (Time::from_ns(ns), value));

        let mut kernel = Kernel::new(&netlist, &timing);
        let mut stimulus = Stimulus::new(drives.map(|(time, value)| Drive::new(time, a, value)));
        let found = kernel.run(&mut stimulus, Time::from_ns(9), &mut ());
        let found = found.unwrap_err();
        assert_eq!((found.time, found.net), (Time::from_ns(3), z));

        let mut lanes = LaneKernel::new(&netlist, &timing);
        let drives = drives.map(|(time, value)| LaneDrive {
            time,
            net: a,
            mask: 1,
            values: Lanes::all(Logic::from(value)),
        });
        let mut drives = drives.into_iter().peekable();
        let in_lanes = lanes.run(&mut drives, Time::from_ns(9), &mut ());
        assert_eq!(in_lanes.unwrap_err(), found);
    }
}
