//! What drives the chip's inputs: time-ordered streams of drives, merged lazily.
//!
//! Clocks are streams, too, so that an exposure of 10⁹ edges costs no memory.

use std::iter::Peekable;

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

/// A stream of drives in time order that can be looked ahead into.
pub type Stimulus<'a> = Peekable<Box<dyn Iterator<Item = Drive> + Send + 'a>>;

/// Makes a [`Stimulus`] of several time-ordered streams. Of drives at the same time, those of
/// earlier streams come first.
pub fn merge<'a>(
    streams: impl IntoIterator<Item = Box<dyn Iterator<Item = Drive> + Send + 'a>>,
) -> Stimulus<'a> {
    let mut streams: Vec<Stimulus<'a>> = streams.into_iter().map(Iterator::peekable).collect();
    let merged = std::iter::from_fn(move || {
        let mut first: Option<(usize, Time)> = None;
        for (i, stream) in streams.iter_mut().enumerate() {
            if let Some(drive) = stream.peek()
                && first.is_none_or(|(_, time)| drive.time < time)
            {
                first = Some((i, drive.time));
            }
        }
        streams[first?.0].next()
    });
    (Box::new(merged) as Box<dyn Iterator<Item = Drive> + Send + 'a>).peekable()
}

/// Makes a [`Stimulus`] of drives in any order; of drives at the same time, the first given comes first.
pub fn in_order(mut drives: Vec<Drive>) -> Stimulus<'static> {
    drives.sort_by_key(|drive| drive.time);
    (Box::new(drives.into_iter()) as Box<dyn Iterator<Item = Drive> + Send>).peekable()
}

/// A clock's edges for half periods `first..end` counted from `origin`: even ones fall, odd ones
/// rise, none with an error that adds up.
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
        let at = |fs, n, v| Drive::new(Time::from_fs(fs), net(n), v);
        let a = vec![at(0, 0, true), at(5, 0, false)];
        let b = vec![at(0, 1, true), at(3, 1, false)];
        let merged: Vec<_> = merge([
            Box::new(a.into_iter()) as Box<dyn Iterator<Item = Drive> + Send>,
            Box::new(b.into_iter()),
        ])
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
