//! Changes on their way through cells with transport delays: several at once on one net.
//!
//! ```text
//!   earliest ─► (t1, 1) (t2, 0) (t3, 1) ◄─ last computed; times strictly rise
//! ```
//!
//! A change that would arrive at or before an earlier one cancels it; if that leaves the net with the value it
//! would have anyway, nothing is on its way at all. What the event queue still holds of a cancelled change finds
//! nothing due, and is ignored.

use std::collections::VecDeque;

use crate::netlist::{CellId, DelayModel, Netlist, Timing};

/// No queue.
const NONE: u32 = u32::MAX;

/// What became of a change that was sent on its way.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub(super) struct Sent {
    /// Whether it is to arrive: it is not where the net has its value then without it.
    pub arrives: bool,
    /// Pulses from a known value to the other and back that it overtook, and that never arrive.
    pub swallowed: u32,
}

/// From a known value to the other.
fn is_edge(before: u8, after: u8) -> bool {
    (before | after) <= 1 && before != after
}

/// The nets that cells with transport delays drive.
#[derive(Default)]
pub(super) struct TransportQueues {
    /// Index into `queues` by net; empty where there are none.
    of_net: Vec<u32>,
    /// Time (fs) and value of each change.
    queues: Vec<VecDeque<(i64, u8)>>,
}

impl TransportQueues {
    /// One queue for each net that a cell of this kind drives.
    pub(super) fn new(netlist: &Netlist, timing: &Timing) -> Self {
        let mut queues = TransportQueues::default();
        for net in transport_nets(netlist, timing) {
            queues.of_net.resize(netlist.net_count(), NONE);
            queues.of_net[net] = queues.queues.len() as u32;
            queues.queues.push(VecDeque::new());
        }
        queues
    }

    /// Nets with a queue.
    pub(super) fn nets(&self) -> impl Iterator<Item = usize> {
        let of_net = self.of_net.iter().enumerate();
        of_net.filter(|(_, q)| **q != NONE).map(|(net, _)| net)
    }

    /// Sends `net`, which now is `present`, to `value` at the time that `due_fs` has for it.
    pub(super) fn send(&mut self, net: usize, present: u8, value: u8, due_fs: i64) -> Sent {
        let queue = &mut self.queues[self.of_net[net] as usize];
        let last = |queue: &VecDeque<(i64, u8)>| queue.back().map_or(present, |&(_, v)| v);
        let mut sent = Sent::default();
        if last(queue) == value {
            return sent;
        }
        // Changes between known values, from the newest back to the last that stays.
        let (mut edges, mut after) = (0, value);
        while let Some(&(time_fs, before)) = queue.back()
            && time_fs >= due_fs
        {
            queue.pop_back();
            edges += u32::from(is_edge(before, after));
            after = before;
        }
        let before = last(queue);
        edges += u32::from(is_edge(before, after));
        // One of them is left where the ends differ.
        sent.swallowed = edges / 2;
        sent.arrives = before != value;
        if sent.arrives {
            queue.push_back((due_fs, value));
        }
        sent
    }

    /// The value that arrives on `net` now, if any does.
    pub(super) fn arriving(&mut self, net: usize, now_fs: i64) -> Option<u8> {
        let queue = &mut self.queues[self.of_net[net] as usize];
        let &(time_fs, value) = queue.front()?;
        (time_fs == now_fs).then(|| {
            queue.pop_front();
            value
        })
    }
}

/// Nets driven by cells with transport delays.
pub(super) fn transport_nets(netlist: &Netlist, timing: &Timing) -> impl Iterator<Item = usize> {
    let cells = netlist.cells().iter().enumerate();
    cells
        .filter(|(index, _)| timing.model(CellId::new(*index)) == DelayModel::Transport)
        .flat_map(|(_, cell)| cell.output_nets())
        .map(|net| net.index())
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::netlist::{CellKind, Corner, Library, ModuleBuilder};

    const ARRIVES: Sent = Sent {
        arrives: true,
        swallowed: 0,
    };

    fn one_net() -> (TransportQueues, usize) {
        let mut m = ModuleBuilder::new("m");
        let a = m.input("A");
        m.gate(CellKind::Buf, &[a]);
        let netlist = Netlist::elaborate(&m.finish().unwrap());
        let mut timing = Timing::nominal(&netlist, &Library::generic_40nm(), Corner::Typ);
        timing.set_model(CellId::new(0), DelayModel::Transport);
        let queues = TransportQueues::new(&netlist, &timing);
        let net = queues.nets().next().unwrap();
        (queues, net)
    }

    #[test]
    fn short_pulses_come_through() {
        let (mut queues, net) = one_net();
        assert_eq!(queues.send(net, 0, 1, 100), ARRIVES);
        assert_eq!(queues.send(net, 0, 0, 103), ARRIVES);
        assert_eq!(
            queues.send(net, 0, 0, 107),
            Sent::default(),
            "on its way already"
        );
        assert_eq!(queues.arriving(net, 99), None);
        assert_eq!(queues.arriving(net, 100), Some(1));
        assert_eq!(queues.arriving(net, 103), Some(0));
    }

    #[test]
    fn what_is_overtaken_never_arrives() {
        let (mut queues, net) = one_net();
        assert_eq!(queues.send(net, 0, 1, 100), ARRIVES);
        let back_to_where_it_was = Sent {
            arrives: false,
            swallowed: 1,
        };
        assert_eq!(queues.send(net, 0, 0, 100), back_to_where_it_was);
        assert_eq!(queues.arriving(net, 100), None);
        assert_eq!(queues.send(net, 0, 1, 200), ARRIVES);
        assert_eq!(queues.send(net, 0, 2, 150), ARRIVES);
        assert_eq!(queues.arriving(net, 150), Some(2));
        assert_eq!(queues.arriving(net, 200), None);
    }

    #[test]
    fn of_several_changes_overtaken_the_pulses_count() {
        let (mut queues, net) = one_net();
        for (value, due_fs) in [(1, 100), (0, 110), (1, 120), (0, 130)] {
            assert_eq!(queues.send(net, 0, value, due_fs), ARRIVES);
        }
        // 1 0 1 0 1 becomes 1: two pulses to 0.
        let two = Sent {
            arrives: false,
            swallowed: 2,
        };
        assert_eq!(queues.send(net, 0, 1, 105), two);
        // 1 X 0 1 becomes 1: what is unknown on the way makes no pulse.
        assert_eq!(queues.send(net, 0, 2, 115), ARRIVES);
        assert_eq!(queues.send(net, 0, 0, 125), ARRIVES);
        let no_pulse = Sent {
            arrives: false,
            swallowed: 0,
        };
        assert_eq!(queues.send(net, 0, 1, 102), no_pulse);
    }
}
