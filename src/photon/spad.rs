//! What a SPAD does with photons: one edge each, then blindness for the dead time.
//!
//! A macropixel has 4×4 SPADs that share their photons evenly. Each drives one wire,
//! SPAD_RAW<15:0>, which rises with an avalanche and stays high for the dead time. The model is
//! non-paralysable: an avalanche while the wire is high makes no edge and does not prolong the
//! pulse, and one exactly at its end makes none either, because the wire falls and rises in the
//! same instant.

use crate::units::Time;

/// SPADs of one macropixel.
pub const SPADS: usize = 16;

/// A rising edge of one SPAD's wire. Ordered by time, then SPAD.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Hash)]
pub struct SpadEvent {
    /// When, counted from the first rising edge of STOP of the exposure.
    pub time: Time,
    /// Which SPAD_RAW wire, below [`SPADS`].
    pub spad: u8,
}

/// Removes the events that fall into the dead time of their SPAD; returns how many.
///
/// `events` must be sorted by (time, SPAD) with times from 0 on. An event stays if and only if it
/// is strictly later than the SPAD's last kept event plus `dead_time`. With a dead time of zero
/// only exact coincidences on one SPAD are removed.
pub fn apply_dead_time(events: &mut Vec<SpadEvent>, dead_time: Time) -> u64 {
    debug_assert!(events.is_sorted(), "events must come in order");
    let before = events.len();
    let mut pulse_end = [Time::from_fs(i64::MIN); SPADS];
    events.retain(|event| {
        let end = &mut pulse_end[usize::from(event.spad)];
        let makes_an_edge = event.time > *end;
        if makes_an_edge {
            *end = event.time + dead_time;
        }
        makes_an_edge
    });
    (before - events.len()) as u64
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    fn event(time_fs: i64, spad: u8) -> SpadEvent {
        SpadEvent {
            time: Time::from_fs(time_fs),
            spad,
        }
    }

    /// The rule, one SPAD at a time, straight from its wording.
    fn slow_reference(events: &[SpadEvent], dead_time: Time) -> Vec<SpadEvent> {
        let mut kept = Vec::new();
        for spad in 0..SPADS as u8 {
            let mut last: Option<Time> = None;
            for e in events.iter().filter(|e| e.spad == spad) {
                if last.is_none_or(|l| e.time > l + dead_time) {
                    kept.push(*e);
                    last = Some(e.time);
                }
            }
        }
        kept.sort();
        kept
    }

    #[test]
    fn an_avalanche_at_the_very_end_of_a_pulse_makes_no_edge() {
        let mut events = vec![event(0, 3), event(10, 3), event(11, 3)];
        assert_eq!(apply_dead_time(&mut events, Time::from_fs(10)), 1);
        assert_eq!(events, [event(0, 3), event(11, 3)]);
    }

    #[test]
    fn a_suppressed_avalanche_does_not_prolong_the_pulse() {
        let mut events = vec![event(0, 0), event(6, 0), event(12, 0)];
        assert_eq!(apply_dead_time(&mut events, Time::from_fs(10)), 1);
        assert_eq!(events, [event(0, 0), event(12, 0)]);
    }

    #[test]
    fn spads_do_not_blind_each_other() {
        let mut events = vec![event(5, 0), event(5, 1), event(6, 2)];
        assert_eq!(apply_dead_time(&mut events, Time::from_ns(10)), 0);
        assert_eq!(events.len(), 3);
    }

    proptest! {
        #[test]
        fn equals_the_slow_reference(
            raw in prop::collection::vec((0i64..500, 0u8..16), 0..200),
            dead_fs in 0i64..100,
        ) {
            let mut events: Vec<_> = raw.into_iter().map(|(t, s)| event(t, s)).collect();
            events.sort();
            let expected = slow_reference(&events, Time::from_fs(dead_fs));
            let total = events.len();
            let dropped = apply_dead_time(&mut events, Time::from_fs(dead_fs));
            prop_assert_eq!(total as u64 - dropped, expected.len() as u64);
            prop_assert_eq!(events, expected);
        }
    }
}
