//! Switching activity: how often each net changes, and how long it has each value. Power and SAIF files come from it.
//!
//! ```text
//!   input    ──┐_____________________________┌──   one settling: from a change of any input to the next
//!   net      _____┌─┐_____┌────────────────────   three toggles, of which two are the edges of a transport glitch
//!   driver   _______________________┌┐_________   a pulse shorter than the driver's delay: an inertial glitch
//! ```

use super::observer::Observer;
use crate::logic::Logic;
use crate::netlist::{NetId, Netlist};
use crate::units::Time;

/// What one net did. Glitches are counted in edges, two a pulse; what is one is defined here.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub struct NetActivity {
    /// Changes between 0 and 1, either way; one through X counts once.
    pub toggles: u64,
    /// Those of them that are extra, before the net settles: it comes from one steady value to another with one toggle or
    /// none, and what it makes beyond that between a change of an input and the next one is a pulse. A pulse that the
    /// circuit makes of one edge on purpose is such a one, too; nothing but its purpose tells it from a hazard.
    pub transport_glitch_edges: u64,
    /// Edges of pulses that never come, because they are shorter than the driver's delay, and of those of which an X is
    /// left: times that the net went to X and came back to the value before.
    pub inertial_glitch_edges: u64,
    /// Time at 0.
    pub low: Time,
    /// Time at 1.
    pub high: Time,
    /// Time at X or Z, which cells cannot tell apart.
    pub unknown: Time,
}

#[derive(Debug, Clone, Copy)]
struct State {
    found: NetActivity,
    since: Time,
    now: Logic,
    /// The last known value.
    known: Logic,
    /// The last toggle is an odd one of the settling that began then: the next one of it goes back.
    may_go_back: Option<Time>,
    is_input: bool,
}

/// Counts the activity of every net from some time on.
///
/// # Example
///
/// ```
/// use femtogate::kernel::{Activity, Drive, Kernel, Stimulus};
/// use femtogate::netlist::{CellKind, Corner, Library, ModuleBuilder, Netlist, Timing};
/// use femtogate::units::Time;
///
/// let mut m = ModuleBuilder::new("top");
/// let (a, z) = (m.input("A"), m.output("Z"));
/// m.cell("inverter", CellKind::Inv, &[a], &[z]);
/// let netlist = Netlist::elaborate(&m.finish()?);
/// let [a, z] = ["A", "Z"].map(|name| netlist.net(name).unwrap());
/// let timing = Timing::nominal(&netlist, &Library::generic_40nm(), Corner::Typ);
/// let drives = [(0, false), (1, true), (2, false)];
/// let drives = drives.map(|(ns, level)| Drive::new(Time::from_ns(ns), a, level));
/// let mut activity = Activity::new(&netlist, Time::ZERO);
/// let mut kernel = Kernel::new(&netlist, &timing);
/// kernel.run(&mut Stimulus::new(drives), Time::from_ns(3), &mut activity)?;
/// // Z comes from X to 1, falls and rises.
/// assert_eq!(activity.net_activity(kernel.now())[z.index()].toggles, 2);
/// # Ok::<(), Box<dyn std::error::Error>>(())
/// ```
#[derive(Debug, Clone)]
pub struct Activity {
    from: Time,
    /// When an input changed last.
    settling: Time,
    nets: Vec<State>,
}

impl Activity {
    /// Nothing observed yet of the nets of `netlist`, all unknown; what happens before `from` only sets their values.
    pub fn new(netlist: &Netlist, from: Time) -> Self {
        let state = State {
            found: NetActivity::default(),
            since: from,
            now: Logic::X,
            known: Logic::X,
            may_go_back: None,
            is_input: false,
        };
        let mut nets = vec![state; netlist.net_count()];
        for input in netlist.inputs() {
            nets[input.index()].is_input = true;
        }
        Activity {
            from,
            settling: from,
            nets,
        }
    }

    /// From when on it counts.
    pub fn from(&self) -> Time {
        self.from
    }

    /// What each net did until `end`, which must not be before its last change.
    pub fn net_activity(&self, end: Time) -> Vec<NetActivity> {
        let close = |state: &State| {
            let mut state = *state;
            state.spend(end);
            state.found
        };
        self.nets.iter().map(close).collect()
    }
}

impl State {
    /// Adds the time since the last change.
    fn spend(&mut self, until: Time) {
        let found = &mut self.found;
        let time = match self.now {
            Logic::Zero => &mut found.low,
            Logic::One => &mut found.high,
            Logic::X | Logic::Z => &mut found.unknown,
        };
        *time += until - self.since;
        self.since = until;
    }

    fn toggle(&mut self, settling: Time) {
        self.found.toggles += 1;
        if self.may_go_back == Some(settling) {
            self.found.transport_glitch_edges += 2;
            self.may_go_back = None;
        } else {
            self.may_go_back = Some(settling);
        }
    }
}

impl Observer for Activity {
    #[inline]
    fn change(&mut self, time: Time, net: NetId, value: Logic) {
        let state = &mut self.nets[net.index()];
        if state.is_input {
            self.settling = time;
        }
        let counts = time >= self.from;
        if counts {
            state.spend(time);
        }
        if value.to_bool().is_some() {
            if counts && state.known.to_bool().is_some() {
                if state.known != value {
                    state.toggle(self.settling);
                } else if state.now != value {
                    state.found.inertial_glitch_edges += 2;
                }
            }
            state.known = value;
        }
        state.now = value;
    }

    #[inline]
    fn inertial_glitch(&mut self, time: Time, net: NetId, pulses: u32) {
        if time >= self.from {
            let found = &mut self.nets[net.index()].found;
            found.inertial_glitch_edges += 2 * u64::from(pulses);
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::kernel::{Drive, Kernel, Stimulus};
    use crate::netlist::{
        ArcDelay, CellId, CellKind, Corner, Library, MAX_INPUTS, MAX_OUTPUTS, ModuleBuilder, Timing,
    };
    use Logic::{One, X, Zero};

    /// Input A, output Z = A NAND (A inverted three times): low for a while where A rises.
    fn one_shot() -> Netlist {
        let mut m = ModuleBuilder::new("one_shot");
        let a = m.input("A");
        let z = m.output("Z");
        let late = (0..3).fold(a, |net, _| m.gate(CellKind::Inv, &[net]));
        m.gate_into(CellKind::Nand2, &[a, late], z);
        Netlist::elaborate(&m.finish().unwrap())
    }

    fn observed(from: i64, changes: &[(i64, Logic)], end: i64) -> NetActivity {
        let netlist = one_shot();
        let net = netlist.net("Z").unwrap();
        let mut activity = Activity::new(&netlist, Time::from_fs(from));
        for &(time, value) in changes {
            activity.change(Time::from_fs(time), net, value);
        }
        assert_eq!(activity.from().as_fs(), from);
        activity.net_activity(Time::from_fs(end))[net.index()]
    }

    #[test]
    fn values_are_timed_and_toggles_counted() {
        let found = observed(0, &[(10, Zero), (15, One), (18, Zero), (30, One)], 100);
        let times = [found.low, found.high, found.unknown].map(Time::as_fs);
        assert_eq!((found.toggles, found.inertial_glitch_edges), (3, 0));
        assert_eq!(times, [5 + 12, 3 + 70, 10]);
    }

    #[test]
    fn a_swallowed_pulse_is_two_edges() {
        let netlist = one_shot();
        let net = netlist.net("Z").unwrap();
        let mut activity = Activity::new(&netlist, Time::from_fs(10));
        activity.inertial_glitch(Time::from_fs(9), net, 1);
        activity.inertial_glitch(Time::from_fs(10), net, 3);
        let found = activity.net_activity(Time::from_fs(20))[net.index()];
        assert_eq!(found.inertial_glitch_edges, 6);
    }

    #[test]
    fn x_on_the_way_is_one_toggle_and_x_and_back_a_glitch() {
        let changes = [(0, Zero), (5, X), (6, One), (8, X), (9, One)];
        let found = observed(0, &changes, 10);
        assert_eq!((found.toggles, found.inertial_glitch_edges), (1, 2));
        assert_eq!(found.unknown.as_fs(), 2);
    }

    #[test]
    fn what_comes_before_sets_values_only() {
        let found = observed(20, &[(0, Zero), (5, One), (25, Zero)], 30);
        assert_eq!(found.toggles, 1);
        let times = [found.low, found.high, found.unknown].map(Time::as_fs);
        assert_eq!(times, [5, 5, 0]);
    }

    /// A pulse that is let through is a transport glitch, one that is not an inertial glitch.
    #[test]
    fn a_hazard_by_hand() {
        let netlist = one_shot();
        let [a, z] = ["A", "Z"].map(|name| netlist.net(name).unwrap());
        let drives = (0..21).map(|k| Drive::new(Time::from_ns(k), a, k % 2 == 1));
        let drives: Vec<Drive> = drives.collect();
        let run = |timing: &Timing| {
            let mut activity = Activity::new(&netlist, Time::ZERO);
            let end = Time::from_ns(30);
            Kernel::new(&netlist, timing)
                .run(&mut Stimulus::sorted(drives.clone()), end, &mut activity)
                .expect("no loop of cells without delay");
            let nets = activity.net_activity(end);
            let glitches = |net: NetId| {
                let found = nets[net.index()];
                let glitches = [found.transport_glitch_edges, found.inertial_glitch_edges];
                (found.toggles, glitches)
            };
            (glitches(a), glitches(z))
        };
        let mut timing = Timing::nominal(&netlist, &Library::generic_40nm(), Corner::Typ);
        assert_eq!(run(&timing), ((20, [0, 0]), (20, [20, 0])));
        // The gate slower than the chain.
        let nand = netlist
            .cells()
            .iter()
            .position(|cell| cell.outputs[0] == Some(z));
        let slow = ArcDelay {
            rise_fs: 500_000,
            fall_fs: 500_000,
        };
        timing.set(
            CellId::new(nand.unwrap()),
            [[slow; MAX_OUTPUTS]; MAX_INPUTS],
        );
        assert_eq!(run(&timing), ((20, [0, 0]), (0, [0, 20])));
    }
}
