//! What a SPAD does with photons: an edge, then blindness for the dead time; at times an afterpulse or crosstalk.
//!
//! The SPADs of a macropixel share its photons evenly. Each drives one wire of SPAD_RAW, which rises with
//! an avalanche and stays high for the dead time. An avalanche exactly at the end of a pulse makes no edge, because the
//! wire falls and rises in the same instant. Where SPADs differ in dead time, all pulses are as wide as the shortest one.
//!
//! ```text
//!   photon      ↓     ↓          ↓          ↓
//!   SPAD_RAW  ▁▁▔▔▔▔▔▔▔▔▁▁▁▁▁▁▁▁▁▔▔▔▔▔▔▔▔▁▁▁▔▔   non-paralysable: the second photon is lost
//!                                       ╰─ carriers trapped by an avalanche release an afterpulse later
//! ```
//!
//! An afterpulse comes from the same SPAD after its dead time, with an exponential delay that is cut at
//! [`AFTERPULSE_REACH`] time constants. Crosstalk fires a direct neighbour within the macropixel after
//! [`CROSSTALK_DELAY`]; what leaves the macropixel is lost. Neither triggers further ones: probabilities are those of
//! one generation. Which photons trigger others, should they make an avalanche, is drawn with the photons
//! ([`Photon::triggers`]). What they trigger is drawn from their own time, SPAD and macropixel, so that code which
//! starts from a known state sees the same.

use smallvec::SmallVec;

use super::random::{RandomPurpose, normal, random_stream};
use crate::photon::SpadGrid;
use crate::units::Time;

/// Longest delay of an afterpulse after the dead time, in time constants; e⁻⁸ of the exponential lie beyond.
pub const AFTERPULSE_REACH: i64 = 8;

/// The share of the exponential within them: 1 − e⁻⁸.
const AFTERPULSE_REACHED: f64 = 0.999_664_537_372_097_5;

/// SPADs that need no memory of their own. Made for 64 of them, the state of 16 took 2 % of a frame's time on the window engine.
pub(super) const FEW_SPADS: usize = 16;

/// Greatest spread of dead times: the shortest one is then a fifth of the mean.
pub const MOST_SPREAD: f64 = 0.2;

/// Standard deviations at which dead times are cut off.
const SPREAD_REACH: f64 = 4.0;

/// Added to a SPAD's number for the random numbers of its dead time, which are no others then: a macropixel has at most 64 SPADs.
const DEAD_TIMES: u32 = 1 << 8;

/// How long after an avalanche crosstalk fires a neighbour.
pub const CROSSTALK_DELAY: Time = Time::from_ps(10);

/// A rising edge of one SPAD's wire. Ordered by time, then SPAD.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Hash)]
pub struct SpadEvent {
    /// When, counted from the first rising edge of STOP of the exposure.
    pub time: Time,
    /// Which SPAD_RAW wire.
    pub spad: u8,
}

/// A photon or dark count on one SPAD, seen or not. Ordered by time, then SPAD.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Hash)]
pub struct Photon {
    /// When, counted from the first rising edge of STOP of the exposure.
    pub time: Time,
    /// Which SPAD.
    pub spad: u8,
    /// Whether its avalanche, if it makes one, has an afterpulse or crosstalk.
    pub triggers: bool,
}

/// What is asked of SPADs depends on the time before the photons are known.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Unknown;

impl SpadEvent {
    /// A pulse at a time.
    pub const fn new(time: Time, spad: u8) -> Self {
        SpadEvent { time, spad }
    }
}

impl Photon {
    /// A photon at a time.
    pub const fn new(time: Time, spad: u8, triggers: bool) -> Self {
        Photon {
            time,
            spad,
            triggers,
        }
    }
}

impl From<SpadEvent> for Photon {
    /// A photon that triggers no other avalanche.
    fn from(event: SpadEvent) -> Self {
        Photon::new(event.time, event.spad, false)
    }
}

/// Sorts photons, none of which comes before `from`, as words of time, SPAD (7 bits) and whether they trigger others; `keys` is room for these. Those of a laser
/// cycle, some twenty, took 8 % of the time of a drive at night in bright macropixels when whole photons were compared.
pub fn sort_photons(photons: &mut [Photon], from: Time, keys: &mut Vec<u64>) {
    keys.clear();
    keys.extend(photons.iter().map(|photon| {
        let since_fs = (photon.time - from).as_fs() as u64;
        since_fs << 8 | u64::from(photon.spad) << 1 | u64::from(photon.triggers)
    }));
    keys.sort_unstable();
    for (photon, key) in photons.iter_mut().zip(keys) {
        *photon = Photon::new(
            from + Time::from_fs((*key >> 8) as i64),
            (*key >> 1 & 0x7f) as u8,
            *key % 2 != 0,
        );
    }
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
    /// The SPADs of a macropixel.
    pub grid: SpadGrid,
    /// How long a SPAD stays blind after an avalanche: the mean of the array.
    pub dead_time: Time,
    /// Standard deviation of the SPADs' dead times, relative to the mean: 0 to [`MOST_SPREAD`].
    pub dead_time_spread: f64,
    /// Seed that decides which SPAD has which of them.
    pub dead_time_seed: u32,
    /// What an avalanche during that time does.
    pub law: DeadTimeLaw,
    /// Probability that an avalanche has an afterpulse, 0 to 1.
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

    /// How long SPAD number `spad` of macropixel number `pixel` stays blind: a Gaussian number, cut off at four standard
    /// deviations.
    pub fn dead_time_of(&self, pixel: u32, spad: u8) -> Time {
        if self.dead_time_spread == 0.0 {
            return self.dead_time;
        }
        let place = DEAD_TIMES | u32::from(spad);
        let seed = self.dead_time_seed.into();
        let mut random = random_stream(seed, RandomPurpose::SpadSpread, pixel, place);
        self.dead_time_at(normal(&mut random).clamp(-SPREAD_REACH, SPREAD_REACH))
    }

    /// Those of all SPADs of a macropixel; none where all have the mean.
    pub(super) fn dead_times(&self, pixel: u32) -> SmallVec<[Time; FEW_SPADS]> {
        if self.dead_time_spread == 0.0 {
            return SmallVec::new();
        }
        let spads = 0..self.grid.spads() as u8;
        spads.map(|spad| self.dead_time_of(pixel, spad)).collect()
    }

    /// The dead time of a SPAD, where these are those of its macropixel.
    #[inline]
    pub(super) fn dead_time_among(&self, dead_times: &[Time], spad: u8) -> Time {
        let own = dead_times.get(usize::from(spad));
        own.copied().unwrap_or(self.dead_time)
    }

    /// The dead time this many standard deviations above the mean.
    fn dead_time_at(&self, deviations: f64) -> Time {
        let factor = 1.0 + self.dead_time_spread * deviations;
        Time::from_fs((self.dead_time.as_fs() as f64 * factor).round() as i64)
    }

    /// No SPAD has a shorter dead time. It is the width of all pulses.
    pub fn shortest_dead_time(&self) -> Time {
        self.dead_time_at(-SPREAD_REACH)
    }

    /// No SPAD has a longer one.
    pub fn longest_dead_time(&self) -> Time {
        self.dead_time_at(SPREAD_REACH)
    }

    /// Whether avalanches cause others.
    pub fn has_secondaries(&self) -> bool {
        self.afterpulse_probability > 0.0 || self.crosstalk_probability > 0.0
    }

    /// Probability that an avalanche triggers others: an afterpulse, crosstalk, or both.
    pub(crate) fn triggering_probability(&self) -> f64 {
        let (afterpulse, crosstalk) = (self.afterpulse_probability, self.crosstalk_probability);
        afterpulse + crosstalk - afterpulse * crosstalk
    }

    /// Longest time from an avalanche to the last one that it triggers; zero if none does.
    pub fn reach(&self) -> Time {
        let mut reach = Time::ZERO;
        if self.afterpulse_probability > 0.0 {
            reach = self.longest_dead_time()
                + self.afterpulse_time * AFTERPULSE_REACH
                + Time::from_fs(2);
        }
        if self.crosstalk_probability > 0.0 {
            reach = reach.max(CROSSTALK_DELAY);
        }
        reach
    }

    /// The avalanches that the avalanche `parent` of macropixel `pixel` triggers, if it is one that does. `dead_time` is that of its SPAD, `key` that
    /// of the photon stream.
    pub(super) fn children(
        &self,
        key: [u32; 2],
        pixel: u32,
        dead_time: Time,
        parent: SpadEvent,
    ) -> impl Iterator<Item = SpadEvent> {
        let time_fs = parent.time.as_fs() as u64;
        let purpose = RandomPurpose::Avalanches as u32 | u32::from(parent.spad) << 8;
        let counter = [time_fs as u32, (time_fs >> 32) as u32, pixel, purpose];
        let words = rand_philox::philox4x32_10(counter, key);
        // One word tells which of the two it causes, given that it causes something.
        let (afterpulse, crosstalk) = (self.afterpulse_probability, self.crosstalk_probability);
        let choice = rand_philox::u32_to_unit_f64(words[0]) * self.triggering_probability();
        let has_afterpulse = choice < afterpulse;
        let has_crosstalk = choice < afterpulse * crosstalk || choice >= afterpulse;
        let afterpulse = has_afterpulse.then(|| {
            let share = AFTERPULSE_REACHED * rand_philox::u32_to_unit_f64(words[1]);
            let delay_fs = -libm::log1p(-share) * self.afterpulse_time.as_fs() as f64;
            SpadEvent::new(
                parent.time + dead_time + Time::from_fs(1 + delay_fs.round() as i64),
                parent.spad,
            )
        });
        let neighbour = has_crosstalk.then(|| self.grid.neighbour(parent.spad, words[3] >> 30));
        let crosstalk = neighbour
            .flatten()
            .map(|spad| SpadEvent::new(parent.time + CROSSTALK_DELAY, spad));
        afterpulse.into_iter().chain(crosstalk)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn event(time_fs: i64, spad: u8) -> SpadEvent {
        SpadEvent::new(Time::from_fs(time_fs), spad)
    }

    /// What isolated avalanches of SPAD 5 trigger: SPAD, and time since the avalanche.
    fn children(model: &SpadModel, lonely: i64) -> Vec<Vec<(Time, u8)>> {
        let apart = Time::from_ns(10_000);
        let parents = (0..lonely).map(|n| event((apart * n).as_fs(), 5));
        let since = |parent: SpadEvent, child: SpadEvent| (child.time - parent.time, child.spad);
        parents
            .map(|parent| {
                let children = model.children([1, 2], 3, model.dead_time, parent);
                children.map(|child| since(parent, child)).collect()
            })
            .collect()
    }

    #[test]
    fn dead_times_have_their_spread() {
        let model = SpadModel {
            dead_time_spread: 0.1,
            dead_time_seed: 3,
            ..SpadModel::with_dead_time(Time::from_ns(8))
        };
        let spads = (0..1000).flat_map(|pixel| (0..16).map(move |spad| (pixel, spad)));
        let own = spads.map(|(pixel, spad)| model.dead_time_of(pixel, spad).as_ns());
        let own: Vec<f64> = own.collect();
        let (least, most) = (model.shortest_dead_time(), model.longest_dead_time());
        assert_eq!([least, most], [4.8, 11.2].map(|ns| Time::from_s(ns * 1e-9)));
        assert!(own.iter().all(|ns| (4.8..=11.2).contains(ns)));
        let n = own.len() as f64;
        let mean = own.iter().sum::<f64>() / n;
        let variance = own.iter().map(|ns| (ns - 8.0).powi(2)).sum::<f64>() / n;
        assert!((mean - 8.0).abs() < 5.0 * 0.8 / n.sqrt(), "{mean}");
        assert!((variance.sqrt() - 0.8).abs() < 5.0 * 0.8 / (2.0 * n).sqrt());
        let other = SpadModel {
            dead_time_seed: 4,
            ..model
        };
        assert_ne!(model.dead_time_of(5, 6), other.dead_time_of(5, 6));
    }

    #[test]
    fn afterpulses_have_their_delay() {
        let model = SpadModel {
            afterpulse_probability: 0.2,
            afterpulse_time: Time::from_ns(5),
            ..SpadModel::with_dead_time(Time::from_ns(8))
        };
        let n = 5_000;
        let delays = children(&model, n).into_iter().map(|caused| {
            let [(since, 5)] = caused[..] else {
                panic!("one afterpulse, not {caused:?}");
            };
            assert!(since > model.dead_time && since <= model.reach());
            (since - model.dead_time).as_ns()
        });
        let mean = delays.sum::<f64>() / n as f64;
        assert_eq!(AFTERPULSE_REACHED, -libm::expm1(-AFTERPULSE_REACH as f64));
        // Mean of an exponential cut at 8 time constants.
        let expected = 5.0 * (1.0 - 8.0 / (8f64.exp() - 1.0));
        assert!((mean - expected).abs() < 5.0 * 5.0 / (n as f64).sqrt());
    }

    #[test]
    fn crosstalk_goes_to_every_neighbour_alike() {
        let model = SpadModel {
            crosstalk_probability: 0.5,
            ..SpadModel::with_dead_time(Time::from_ns(8))
        };
        let n = 4_000;
        let caused: Vec<_> = children(&model, n).concat();
        for neighbour in [1, 4, 6, 9] {
            let hits = caused.iter().filter(|&&(_, spad)| spad == neighbour);
            let (hits, expected) = (hits.count() as f64, n as f64 / 4.0);
            assert!(
                (hits - expected).abs() < 5.0 * expected.sqrt(),
                "{hits} {expected}"
            );
        }
        assert!(caused.iter().all(|&(since, _)| since == CROSSTALK_DELAY));
        assert_eq!(caused.len() as i64, n);
        let inside = |spad| (0..4).filter_map(|d| model.grid.neighbour(spad, d)).count();
        assert_eq!([0, 1, 5].map(inside), [2, 3, 4]);
    }

    #[test]
    fn avalanches_that_trigger_others_cause_one_or_the_other_or_both() {
        let model = SpadModel {
            afterpulse_probability: 0.3,
            afterpulse_time: Time::from_ns(5),
            crosstalk_probability: 0.1,
            ..SpadModel::with_dead_time(Time::from_ns(8))
        };
        let triggering = model.triggering_probability();
        assert!((triggering - 0.37).abs() < 1e-12);
        let n = 20_000;
        let mut counts = [0; 3];
        for caused in children(&model, n) {
            let has_afterpulse = caused.iter().any(|&(_, spad)| spad == 5);
            counts[0] += i64::from(has_afterpulse);
            counts[1] += i64::from(caused.len() == 2);
            counts[2] += i64::from(caused.is_empty());
        }
        for (count, expected) in counts.into_iter().zip([0.3 / 0.37, 0.03 / 0.37, 0.0]) {
            let found = count as f64 / n as f64;
            assert!(
                (found - expected).abs() < 5.0 * 0.5 / (n as f64).sqrt(),
                "{found} {expected}"
            );
        }
    }
}
