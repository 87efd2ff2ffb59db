//! What a SPAD does with photons: an edge, then blindness for the dead time; at times an afterpulse or crosstalk.
//!
//! A macropixel has 4×4 SPADs that share their photons evenly. Each drives one wire, SPAD_RAW<15:0>, which rises with
//! an avalanche and stays high for the dead time. An avalanche exactly at the end of a pulse makes no edge, because the
//! wire falls and rises in the same instant.
//!
//! ```text
//!   photon      ↓     ↓          ↓          ↓
//!   SPAD_RAW  ▁▁▔▔▔▔▔▔▔▔▁▁▁▁▁▁▁▁▁▔▔▔▔▔▔▔▔▁▁▁▔▔   non-paralysable: the second photon is lost
//!                                       ╰─ carriers trapped by an avalanche release an afterpulse later
//! ```
//!
//! An afterpulse comes from the same SPAD after its dead time, with an exponential delay that is cut at
//! [`AFTERPULSE_REACH`] time constants. Crosstalk fires a direct neighbour within the macropixel after
//! [`CROSSTALK_DELAY`]; what leaves the macropixel is lost. Neither breeds further ones: probabilities are those of one
//! generation. Both are drawn from the avalanche's own time, SPAD and macropixel, so that whoever
//! starts from a known state sees the same ones.

use std::cmp::Reverse;
use std::collections::BinaryHeap;

use super::random::Purpose;
use crate::units::Time;

/// SPADs of one macropixel.
pub const SPADS: usize = 16;

/// Longest delay of an afterpulse after the dead time, in time constants; e⁻⁸ of the exponential lie beyond.
pub const AFTERPULSE_REACH: i64 = 8;

/// How long after an avalanche crosstalk fires a neighbour.
pub const CROSSTALK_DELAY: Time = Time::from_ps(10);

/// A rising edge of one SPAD's wire. Ordered by time, then SPAD.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Hash)]
pub struct SpadEvent {
    /// When, counted from the first rising edge of STOP of the exposure.
    pub time: Time,
    /// Which SPAD_RAW wire, below [`SPADS`].
    pub spad: u8,
}

/// What an avalanche in a blind SPAD does.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub enum DeadTimeLaw {
    /// Nothing (active recharge).
    #[default]
    NonParalysable,
    /// It begins the dead time anew (passive quenching).
    Paralysable,
}

/// How SPADs answer to photons.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub struct SpadModel {
    /// How long a SPAD stays blind after an avalanche.
    pub dead_time: Time,
    /// What an avalanche during that time does.
    pub law: DeadTimeLaw,
    /// Chance that an avalanche has an afterpulse, 0 to 1.
    pub afterpulse_probability: f64,
    /// Time constant of afterpulses.
    pub afterpulse_time: Time,
    /// Chance that an avalanche fires one of four neighbours, 0 to 1.
    pub crosstalk_probability: f64,
}

impl SpadModel {
    /// Nothing but a non-paralysable dead time.
    pub fn with_dead_time(dead_time: Time) -> Self {
        SpadModel {
            dead_time,
            ..SpadModel::default()
        }
    }

    /// Whether avalanches cause others.
    pub fn has_secondaries(&self) -> bool {
        self.afterpulse_probability > 0.0 || self.crosstalk_probability > 0.0
    }

    /// How long a photon can matter: where more than this time passes without one, every SPAD is ready afterwards and
    /// nothing is pending.
    pub fn memory(&self) -> Time {
        let mut secondary = Time::ZERO;
        if self.afterpulse_probability > 0.0 {
            secondary = self.dead_time + self.afterpulse_time * AFTERPULSE_REACH + Time::from_fs(2);
        }
        if self.crosstalk_probability > 0.0 {
            secondary = secondary.max(CROSSTALK_DELAY);
        }
        secondary + self.dead_time
    }

    /// Turns photons of macropixel `pixel` into rising edges; returns how many avalanches met a blind SPAD. `events` are
    /// sorted by (time, SPAD), before and after; before the first one the macropixel was in the dark. `key` is that of
    /// the photon stream.
    pub fn detect(&self, key: [u32; 2], pixel: u32, events: &mut Vec<SpadEvent>) -> u64 {
        debug_assert!(events.is_sorted(), "events must come in order");
        if !self.has_secondaries() {
            let before = events.len();
            let mut readiness = Readiness::new(self);
            events.retain(|event| readiness.fires(event));
            return (before - events.len()) as u64;
        }
        let photons = std::mem::take(events);
        let mut photons = photons.into_iter().peekable();
        let mut secondaries = BinaryHeap::new();
        let mut readiness = Readiness::new(self);
        let mut lost = 0;
        loop {
            let secondary = secondaries.peek().map(|&Reverse(event)| event);
            let (event, is_photon) = match (photons.peek(), secondary) {
                (None, None) => break,
                (Some(&photon), earliest) if earliest.is_none_or(|s| photon <= s) => {
                    photons.next();
                    (photon, true)
                }
                (_, earliest) => {
                    secondaries.pop();
                    (earliest.expect("not both are none"), false)
                }
            };
            if !readiness.fires(&event) {
                lost += 1;
                continue;
            }
            events.push(event);
            if is_photon {
                self.breed(key, pixel, event, |child| secondaries.push(Reverse(child)));
            }
        }
        lost
    }

    /// The avalanches that a photon's avalanche causes.
    fn breed(
        &self,
        key: [u32; 2],
        pixel: u32,
        parent: SpadEvent,
        mut child: impl FnMut(SpadEvent),
    ) {
        let time_fs = parent.time.as_fs() as u64;
        let purpose = Purpose::Avalanches as u32 | u32::from(parent.spad) << 8;
        let counter = [time_fs as u32, (time_fs >> 32) as u32, pixel, purpose];
        let words = rand_philox::philox4x32_10(counter, key);
        let happens = |word: u32, probability: f64| f64::from(word) < probability * 2f64.powi(32);
        if happens(words[0], self.afterpulse_probability) {
            let reached = -libm::expm1(-AFTERPULSE_REACH as f64);
            let share = reached * rand_philox::u32_to_unit_f64(words[1]);
            let delay_fs = -libm::log1p(-share) * self.afterpulse_time.as_fs() as f64;
            child(SpadEvent {
                time: parent.time + self.dead_time + Time::from_fs(1 + delay_fs.round() as i64),
                spad: parent.spad,
            });
        }
        if happens(words[2], self.crosstalk_probability)
            && let Some(spad) = neighbour(parent.spad, words[3] >> 30)
        {
            let time = parent.time + CROSSTALK_DELAY;
            child(SpadEvent { time, spad });
        }
    }
}

/// The neighbour of a SPAD to the left, right, top or bottom of the 4×4 array, if there is one.
fn neighbour(spad: u8, direction: u32) -> Option<u8> {
    let (row, col) = (spad / 4, spad % 4);
    match direction {
        0 => (col > 0).then(|| spad - 1),
        1 => (col < 3).then(|| spad + 1),
        2 => (row > 0).then(|| spad - 4),
        _ => (row < 3).then(|| spad + 4),
    }
}

/// Until when each SPAD is blind.
struct Readiness {
    blind_until: [Time; SPADS],
    dead_time: Time,
    law: DeadTimeLaw,
}

impl Readiness {
    fn new(model: &SpadModel) -> Self {
        Readiness {
            blind_until: [Time::from_fs(i64::MIN); SPADS],
            dead_time: model.dead_time,
            law: model.law,
        }
    }

    /// Whether an avalanche makes an edge.
    fn fires(&mut self, event: &SpadEvent) -> bool {
        let until = &mut self.blind_until[usize::from(event.spad)];
        let fires = event.time > *until;
        if fires || self.law == DeadTimeLaw::Paralysable {
            *until = event.time + self.dead_time;
        }
        fires
    }
}

/// Removes the events that fall into the (non-paralysable) dead time of their SPAD; returns how many.
///
/// `events` must be sorted by (time, SPAD) with times from 0 on. An event stays if and only if it
/// is strictly later than the SPAD's last kept event plus `dead_time`. With a dead time of zero
/// only exact coincidences on one SPAD are removed.
pub fn apply_dead_time(events: &mut Vec<SpadEvent>, dead_time: Time) -> u64 {
    SpadModel::with_dead_time(dead_time).detect([0; 2], 0, events)
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

    /// The rules, one SPAD at a time, straight from their wording.
    fn slow_reference(events: &[SpadEvent], dead_time: Time, law: DeadTimeLaw) -> Vec<SpadEvent> {
        let mut kept = Vec::new();
        for spad in 0..SPADS as u8 {
            let mut last: Option<Time> = None;
            for e in events.iter().filter(|e| e.spad == spad) {
                let ready = last.is_none_or(|l| e.time > l + dead_time);
                if ready {
                    kept.push(*e);
                }
                if ready || law == DeadTimeLaw::Paralysable {
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
    fn a_suppressed_avalanche_prolongs_the_pulse_only_if_paralysable() {
        let photons = [event(0, 0), event(6, 0), event(12, 0)];
        let mut events = photons.to_vec();
        let mut model = SpadModel::with_dead_time(Time::from_fs(10));
        assert_eq!(model.detect([0; 2], 0, &mut events), 1);
        assert_eq!(events, [event(0, 0), event(12, 0)]);
        model.law = DeadTimeLaw::Paralysable;
        let mut events = photons.to_vec();
        assert_eq!(model.detect([0; 2], 0, &mut events), 2);
        assert_eq!(events, [event(0, 0)]);
    }

    #[test]
    fn spads_do_not_blind_each_other() {
        let mut events = vec![event(5, 0), event(5, 1), event(6, 2)];
        assert_eq!(apply_dead_time(&mut events, Time::from_ns(10)), 0);
        assert_eq!(events.len(), 3);
    }

    /// Lonely avalanches of SPAD 5, and what they cause.
    fn secondaries(model: &SpadModel, lonely: i64) -> Vec<(Time, u8)> {
        let apart = Time::from_ns(10_000);
        let mut events: Vec<_> = (0..lonely)
            .map(|n| SpadEvent {
                time: apart * n,
                spad: 5,
            })
            .collect();
        assert_eq!(model.detect([1, 2], 3, &mut events), 0);
        let caused = events.iter().map(|e| {
            let since = e.time.as_fs() % apart.as_fs();
            (Time::from_fs(since), e.spad)
        });
        caused.filter(|(since, _)| *since > Time::ZERO).collect()
    }

    #[test]
    fn afterpulses_have_their_probability_and_delay() {
        let model = SpadModel {
            afterpulse_probability: 0.2,
            afterpulse_time: Time::from_ns(5),
            ..SpadModel::with_dead_time(Time::from_ns(8))
        };
        let n = 20_000;
        let caused = secondaries(&model, n);
        let expected = 0.2 * n as f64;
        assert!((caused.len() as f64 - expected).abs() < 5.0 * (expected * 0.8).sqrt());
        let delays = caused.iter().map(|&(since, spad)| {
            assert_eq!(spad, 5);
            assert!(since > model.dead_time && since <= model.memory() - model.dead_time);
            (since - model.dead_time).as_ns()
        });
        let mean = delays.sum::<f64>() / caused.len() as f64;
        // Mean of an exponential cut at 8 time constants.
        let expected = 5.0 * (1.0 - 8.0 / (8f64.exp() - 1.0));
        assert!((mean - expected).abs() < 5.0 * 5.0 / (caused.len() as f64).sqrt());
    }

    #[test]
    fn crosstalk_goes_to_every_neighbour_alike() {
        let model = SpadModel {
            crosstalk_probability: 0.5,
            ..SpadModel::with_dead_time(Time::from_ns(8))
        };
        let n = 8_000;
        let caused = secondaries(&model, n);
        for neighbour in [1, 4, 6, 9] {
            let hits = caused
                .iter()
                .filter(|&&(_, spad)| spad == neighbour)
                .count() as f64;
            let expected = 0.5 * n as f64 / 4.0;
            assert!(
                (hits - expected).abs() < 5.0 * expected.sqrt(),
                "{hits} {expected}"
            );
        }
        assert!(
            caused
                .iter()
                .all(|&(since, spad)| { since == CROSSTALK_DELAY && [1, 4, 6, 9].contains(&spad) })
        );
        let inside = |spad| (0..4).filter_map(|d| neighbour(spad, d)).count();
        assert_eq!([0, 1, 5].map(inside), [2, 3, 4]);
    }

    proptest! {
        #[test]
        fn equals_the_slow_reference(
            raw in prop::collection::vec((0i64..500, 0u8..16), 0..200),
            dead_fs in 0i64..100,
            paralysable: bool,
        ) {
            let law = if paralysable { DeadTimeLaw::Paralysable } else { DeadTimeLaw::NonParalysable };
            let model = SpadModel { law, ..SpadModel::with_dead_time(Time::from_fs(dead_fs)) };
            let mut events: Vec<_> = raw.into_iter().map(|(t, s)| event(t, s)).collect();
            events.sort();
            let expected = slow_reference(&events, Time::from_fs(dead_fs), law);
            let total = events.len();
            let dropped = model.detect([0; 2], 0, &mut events);
            prop_assert_eq!(total as u64 - dropped, expected.len() as u64);
            prop_assert_eq!(events, expected);
        }

        /// After a gap longer than the memory, what went before does not matter.
        #[test]
        fn the_past_is_forgotten_after_the_memory(
            raw in prop::collection::vec((0i64..200_000, 0u8..16), 1..100),
            afterpulse_probability in 0.0f64..1.0,
            crosstalk_probability in 0.0f64..1.0,
            paralysable: bool,
        ) {
            let law = if paralysable { DeadTimeLaw::Paralysable } else { DeadTimeLaw::NonParalysable };
            let model = SpadModel {
                law,
                afterpulse_probability,
                afterpulse_time: Time::from_fs(500),
                crosstalk_probability,
                ..SpadModel::with_dead_time(Time::from_fs(3_000))
            };
            let mut before: Vec<_> = raw.iter().map(|&(t, s)| event(t, s)).collect();
            before.sort();
            let gap = before.last().unwrap().time + model.memory() + Time::from_fs(1);
            let after: Vec<_> = before
                .iter()
                .map(|e| SpadEvent { time: gap + (e.time - before[0].time), ..*e })
                .collect();
            let mut all: Vec<_> = before.iter().chain(&after).copied().collect();
            let mut alone = after;
            model.detect([7, 8], 1, &mut all);
            model.detect([7, 8], 1, &mut alone);
            all.retain(|e| e.time >= gap);
            prop_assert_eq!(all, alone);
        }
    }
}
