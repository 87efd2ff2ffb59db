//! Who watches the simulation: anything that wants to hear of every value change.

use crate::logic::Logic;
use crate::netlist::{CellId, NetId};
use crate::units::Time;

/// Hears of every net change, in time order. The kernel takes it as `dyn`, so that only its own crate compiles it, as optimised as that is: a
/// change takes 60 ns, and what the call adds is lost in the noise.
pub trait Observer {
    /// `net` took `value` at `time`.
    fn change(&mut self, time: Time, net: NetId, value: Logic);

    /// A flip-flop whose state is in doubt. The kernel asks after every instant, and makes
    /// the state unknown, until there is none. An observer that only watches leaves this as it is, at no cost.
    #[inline]
    fn doubtful(&mut self) -> Option<CellId> {
        None
    }

    /// `net`'s driver went to another value and back in less than its delay, so that `pulses` pulses never come.
    /// Nothing changes.
    #[inline]
    fn inertial_glitch(&mut self, _: Time, _: NetId, _pulses: u32) {}

    /// Whether it needs [`Observer::change`] at all. Where it does not, the kernel leaves out calls that take long.
    #[inline]
    fn needs_changes(&self) -> bool {
        true
    }
}

/// Watches nothing, at no cost.
impl Observer for () {
    #[inline]
    fn change(&mut self, _: Time, _: NetId, _: Logic) {}

    #[inline]
    fn needs_changes(&self) -> bool {
        false
    }
}

/// Two observers see the same changes.
impl<A: Observer, B: Observer> Observer for (A, B) {
    #[inline]
    fn change(&mut self, time: Time, net: NetId, value: Logic) {
        self.0.change(time, net, value);
        self.1.change(time, net, value);
    }

    #[inline]
    fn doubtful(&mut self) -> Option<CellId> {
        self.0.doubtful().or_else(|| self.1.doubtful())
    }

    #[inline]
    fn inertial_glitch(&mut self, time: Time, net: NetId, pulses: u32) {
        self.0.inertial_glitch(time, net, pulses);
        self.1.inertial_glitch(time, net, pulses);
    }

    #[inline]
    fn needs_changes(&self) -> bool {
        self.0.needs_changes() || self.1.needs_changes()
    }
}

impl<O: Observer + ?Sized> Observer for &mut O {
    #[inline]
    fn change(&mut self, time: Time, net: NetId, value: Logic) {
        (**self).change(time, net, value);
    }

    #[inline]
    fn doubtful(&mut self) -> Option<CellId> {
        (**self).doubtful()
    }

    #[inline]
    fn inertial_glitch(&mut self, time: Time, net: NetId, pulses: u32) {
        (**self).inertial_glitch(time, net, pulses);
    }

    #[inline]
    fn needs_changes(&self) -> bool {
        (**self).needs_changes()
    }
}

/// Keeps every change of a few nets.
///
/// # Example
///
/// ```
/// use femtogate::kernel::{Drive, Kernel, Recorder, Stimulus};
/// use femtogate::netlist::{CellKind, Corner, Library, ModuleBuilder, Netlist, Timing};
/// use femtogate::units::Time;
///
/// let mut m = ModuleBuilder::new("top");
/// let (a, z) = (m.input("A"), m.output("Z"));
/// m.cell("inverter", CellKind::Inv, &[a], &[z]);
/// let netlist = Netlist::elaborate(&m.finish()?);
/// let [a, z] = ["A", "Z"].map(|name| netlist.net(name).unwrap());
/// let timing = Timing::nominal(&netlist, &Library::generic_40nm(), Corner::Typ);
/// let mut recorder = Recorder::new([z]);
/// let mut stimulus = Stimulus::new([Drive::new(Time::from_ns(1), a, true)]);
/// Kernel::new(&netlist, &timing).run(&mut stimulus, Time::from_ns(2), &mut recorder)?;
/// assert_eq!(recorder.falling_edges(z), [Time::from_fs(1_018_979)]);
/// # Ok::<(), Box<dyn std::error::Error>>(())
/// ```
#[derive(Debug, Clone, Default)]
pub struct Recorder {
    nets: Vec<NetId>,
    changes: Vec<(Time, NetId, Logic)>,
}

impl Recorder {
    /// Records these nets.
    pub fn new(nets: impl IntoIterator<Item = NetId>) -> Self {
        Recorder {
            nets: nets.into_iter().collect(),
            changes: Vec::new(),
        }
    }

    /// Everything recorded, in time order.
    pub fn changes(&self) -> &[(Time, NetId, Logic)] {
        &self.changes
    }

    /// Times at which `net` rose to 1.
    pub fn rising_edges(&self, net: NetId) -> Vec<Time> {
        self.edges(net, Logic::One)
    }

    /// Times at which `net` fell to 0.
    pub fn falling_edges(&self, net: NetId) -> Vec<Time> {
        self.edges(net, Logic::Zero)
    }

    /// The value of a recorded net at `time`, changes at that instant included; X before its first change.
    pub fn value_at(&self, net: NetId, time: Time) -> Logic {
        let until = self.changes.partition_point(|(t, _, _)| *t <= time);
        let last = self.changes[..until].iter().rev().find(|c| c.1 == net);
        last.map_or(Logic::X, |&(_, _, value)| value)
    }

    /// The number on a recorded bus (bit 0 first, at most 64 bits) at `time`, where all bits are known.
    pub fn number_at(&self, nets: &[NetId], time: Time) -> Option<u64> {
        nets.iter().rev().try_fold(0, |number, &net| {
            Some(number << 1 | self.value_at(net, time).to_bool()? as u64)
        })
    }

    fn edges(&self, net: NetId, to: Logic) -> Vec<Time> {
        self.changes
            .iter()
            .filter(|(_, n, v)| *n == net && *v == to)
            .map(|(t, _, _)| *t)
            .collect()
    }
}

impl Observer for Recorder {
    #[inline]
    fn change(&mut self, time: Time, net: NetId, value: Logic) {
        if self.nets.contains(&net) {
            self.changes.push((time, net, value));
        }
    }
}
