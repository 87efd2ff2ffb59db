//! What starts the actions of each pass: CLK's edges while it runs, and the other causes of every laser cycle in turn.
//!
//! Causes come in groups, one to a laser cycle: those of the first, of a middle and of the last cycle, and those of the
//! STOP edge that ends the exposure. All middle cycles have the same ones.

use crate::chip::Exposure;

/// The causes of an exposure, handed out in order.
pub(super) struct Schedule<'a> {
    /// Causes by group, as in [`LevelisedLogic`](super::levelise::LevelisedLogic).
    groups: &'a [Vec<(i64, u16)>],
    laser_cycles: i64,
    /// CLK periods of a laser cycle.
    pub(super) stop_periods: i64,
    /// CLK runs in passes from 0 up to this one.
    pub clocked: i64,
    /// The next cause: its laser cycle and its place in the group.
    next: (i64, usize),
}

impl<'a> Schedule<'a> {
    /// The causes of an exposure with CLK edges in `clocked` passes.
    pub(super) fn new(groups: &'a [Vec<(i64, u16)>], exposure: &Exposure, clocked: usize) -> Self {
        Schedule {
            groups,
            laser_cycles: i64::from(exposure.laser_cycles),
            stop_periods: i64::from(exposure.stop_periods),
            clocked: clocked as i64,
            next: (0, 0),
        }
    }

    /// The next cause other than CLK: its pass and action.
    #[inline]
    pub(super) fn due(&mut self) -> Option<(i64, u16)> {
        while self.next.0 <= self.laser_cycles {
            let (cycle, index) = self.next;
            let last = self.groups.len() - 1;
            let group = match cycle {
                0 => 0,
                c if c == self.laser_cycles => last,
                c if c + 1 == self.laser_cycles => last - 1,
                _ => 1,
            };
            if let Some(&(pass, action)) = self.groups[group].get(index) {
                return Some((cycle * self.stop_periods + pass, action));
            }
            self.next = (cycle + 1, 0);
        }
        None
    }

    /// The next cause that is due by `pass`.
    #[inline]
    pub(super) fn next_until(&mut self, pass: i64) -> Option<u16> {
        let (_, action) = self.due().filter(|&(due, _)| due <= pass)?;
        self.next.1 += 1;
        Some(action)
    }

    /// Whether all middle cycles are alike: each one's causes come before the next one's.
    pub(super) fn is_periodic(&self) -> bool {
        let first = |group: &Vec<(i64, u16)>| group.first().map(|&(pass, _)| pass);
        let [_, middle, last, _] = self.groups else {
            return false;
        };
        let (Some(start), Some(last)) = (first(middle), first(last)) else {
            return false;
        };
        let end = start + self.stop_periods;
        last >= start && middle.iter().all(|&(pass, _)| pass < end)
    }

    /// How many middle cycles begin with the next one, if its first cause is the next cause and due in `pass`.
    pub(super) fn middle_cycles(&mut self, pass: i64) -> Option<i64> {
        let (due, _) = self.due()?;
        let (cycle, index) = self.next;
        let is_first = due == pass && index == 0 && cycle >= 1;
        Some(self.laser_cycles - 1 - cycle).filter(|&left| is_first && left > 0)
    }

    /// Every action that a cause other than CLK starts.
    pub(super) fn actions(&self) -> impl Iterator<Item = u16> {
        self.groups.iter().flatten().map(|&(_, action)| action)
    }
}
