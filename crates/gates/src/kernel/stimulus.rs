//! What drives the chip's inputs: time-ordered streams of drives, merged lazily.
//!
//! Clocks are streams, too, so that an exposure of 10⁹ edges costs no memory.

use crate::logic::Logic;
use crate::netlist::NetId;
use crate::units::{Frequency, Time};

/// One input takes one value at one time.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Drive {
    /// When.
    pub time: Time,
    /// Which input.
    pub net: NetId,
    /// To what.
    pub value: Logic,
}

impl Drive {
    /// A drive from its parts.
    pub fn new(time: Time, net: NetId, value: impl Into<Logic>) -> Self {
        let value = value.into();
        Drive { time, net, value }
    }
}

type Drives<'a> = Box<dyn Iterator<Item = Drive> + Send + 'a>;

/// Drives of a netlist's inputs in time order, of which the kernel takes one after another.
///
/// ```
/// use femtogate::kernel::{Drive, Stimulus, clock};
/// use femtogate::netlist::NetId;
/// use femtogate::units::{Frequency, Time};
///
/// let [reset, clk] = [0, 1].map(NetId::new);
/// let release = [(0, true), (3, false)].map(|(ns, level)| Drive::new(Time::from_ns(ns), reset, level));
/// // A clock is a stream, too: 20 half periods, and no memory for them.
/// let ticks = clock(clk, Frequency::from_hz(500_000_000), Time::ZERO, 0, 20);
/// let stimulus = Stimulus::sorted(release).with_drives(ticks);
/// let times: Vec<i64> = stimulus.map(|drive| drive.time.as_fs() / 1_000_000).collect();
/// assert_eq!(times[..6], [0, 0, 1, 2, 3, 3]);
/// ```
pub struct Stimulus<'a> {
    // No `Peekable`, which is bound to one lifetime for ever.
    next: Option<Drive>,
    later: Drives<'a>,
}

impl<'a> Stimulus<'a> {
    /// From drives that are in time order.
    pub fn new(drives: impl IntoIterator<Item = Drive, IntoIter: Send + 'a>) -> Self {
        let mut later: Drives<'a> = Box::new(drives.into_iter());
        let next = later.next();
        Stimulus { next, later }
    }

    /// From drives in any order; of drives at the same time, the first given comes first.
    pub fn sorted(drives: impl IntoIterator<Item = Drive>) -> Self {
        let mut drives: Vec<Drive> = drives.into_iter().collect();
        drives.sort_by_key(|drive| drive.time);
        Stimulus::new(drives)
    }

    /// Both together; `other` is in time order, too. Of drives at the same time, those that were here first come first.
    #[must_use]
    pub fn with_drives(self, other: impl IntoIterator<Item = Drive, IntoIter: Send + 'a>) -> Self {
        Stimulus::merge([self, Stimulus::new(other)])
    }

    /// Several together. Of drives at the same time, those of earlier ones come first.
    pub fn merge(stimuli: impl IntoIterator<Item = Self>) -> Self {
        let mut stimuli: Vec<Self> = stimuli.into_iter().collect();
        Stimulus::new(std::iter::from_fn(move || {
            let mut first: Option<(usize, Time)> = None;
            for (index, stimulus) in stimuli.iter().enumerate() {
                if let Some(drive) = stimulus.peek()
                    && first.is_none_or(|(_, time)| drive.time < time)
                {
                    first = Some((index, drive.time));
                }
            }
            stimuli[first?.0].next()
        }))
    }

    /// The next drive, which stays the next one.
    #[inline]
    pub fn peek(&self) -> Option<&Drive> {
        self.next.as_ref()
    }

    /// The next drive, if it is not after `time`.
    #[inline]
    pub(super) fn next_until(&mut self, time: Time) -> Option<Drive> {
        match self.next {
            Some(drive) if drive.time <= time => self.next(),
            _ => None,
        }
    }
}

impl Iterator for Stimulus<'_> {
    type Item = Drive;

    #[inline]
    fn next(&mut self) -> Option<Drive> {
        let next = self.next?;
        self.next = self.later.next();
        Some(next)
    }
}

/// A clock's edges for half periods `first..end` counted from `origin`: even ones fall, odd ones
/// rise, none with an error that adds up.
///
/// # Example
///
/// ```
/// use femtogate::kernel::clock;
/// use femtogate::netlist::NetId;
/// use femtogate::units::{Frequency, Time};
///
/// // Half a period of 384 MHz is 1302083 1/3 fs.
/// let edges = clock(NetId::new(0), Frequency::from_hz(384_000_000), Time::ZERO, 0, 4);
/// let times: Vec<i64> = edges.map(|drive| drive.time.as_fs()).collect();
/// assert_eq!(times, [0, 1_302_083, 2_604_167, 3_906_250]);
/// ```
pub fn clock(
    net: NetId,
    frequency: Frequency,
    origin: Time,
    first: i64,
    end: i64,
) -> impl Iterator<Item = Drive> + Send {
    (first..end)
        .zip(frequency.ticks(first))
        .map(move |(k, tick)| Drive::new(origin + tick, net, k.rem_euclid(2) == 1))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn streams_merge_in_time_order_and_ties_in_stream_order() {
        let net = NetId::new;
        let drive = |fs, n, v| Drive::new(Time::from_fs(fs), net(n), v);
        let a = [drive(0, 0, true), drive(5, 0, false)];
        let b = [drive(0, 1, true), drive(3, 1, false)];
        let merged: Vec<_> = Stimulus::new(a)
            .with_drives(b)
            .map(|d| (d.time.as_fs(), d.net.index()))
            .collect();
        assert_eq!(merged, [(0, 0), (0, 1), (3, 1), (5, 0)]);
    }

    #[test]
    fn a_clock_falls_at_its_origin() {
        let f = Frequency::from_hz(1_000_000_000);
        let edges: Vec<_> = clock(NetId::new(0), f, Time::from_ns(1), 0, 3).collect();
        assert_eq!(edges[0].value, Logic::Zero);
        assert_eq!(
            edges[1],
            Drive::new(Time::from_ps(1_500), NetId::new(0), true)
        );
    }
}
