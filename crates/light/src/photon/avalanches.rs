//! From photons to rising edges of the SPAD wires, from a known state of the SPADs or from an unknown one.
//!
//! A SPAD that is ready makes an avalanche of a photon, and is blind for the dead time. Where the photons are known only
//! from some time on, each SPAD begins as unknown: an avalanche just before that time may still blind it. It becomes known
//! with the first photon that comes after all that may blind it:
//!
//! ```text
//!   known from │         ╭ may be lost      ╭ fires for certain
//!              │   dead  ↓   dead           ↓
//!   SPAD       │?????????????????????????   ▔▔▔▔▔▔▔▔▁▁▁▁
//!              ╰─────────┴─────────────┴ ready at the latest
//! ```
//!
//! So whatever comes out for certain is what the whole past would give, and [`Unknown`] says that more of it is needed.

use std::cmp::Reverse;
use std::collections::BinaryHeap;

use smallvec::{SmallVec, smallvec};

use super::spad::{DeadTimeLaw, FEW_SPADS, Photon, SpadEvent, SpadModel, Unknown};
use super::spad_grid::SpadGrid;
use super::spad_rows::SpadRows;
use super::stream::{OrderedEchoes, PixelStream};
use crate::units::Time;

/// Where a photon comes from.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
enum Source {
    /// It comes for certain, whatever the SPADs did before.
    Known,
    /// The avalanche that may cause it is not known to have happened.
    Possible,
    /// It comes for certain if its SPAD was ready for it.
    Echo,
}

/// The SPADs of one macropixel while photons come in.
pub struct Avalanches<'a> {
    model: &'a SpadModel,
    key: [u32; 2],
    pixel: u32,
    /// Of each SPAD, where they differ.
    dead_times: &'a [Time],
    /// Until when each SPAD is blind, at the latest.
    blind_until: SmallVec<[Time; FEW_SPADS]>,
    /// SPADs that may be ready before that.
    unknown: u64,
    /// Afterpulses and crosstalk to come, and whether they come for certain.
    pending: BinaryHeap<Reverse<(SpadEvent, bool)>>,
    /// How many avalanches have met a blind SPAD.
    pub(crate) lost: u64,
}

impl<'a> Avalanches<'a> {
    /// SPADs that were in the dark before the first photon. `key` is that of the photon stream, `pixel` the number of the
    /// macropixel in it, `dead_times` are those of [`SpadModel::dead_times`].
    pub(crate) fn in_the_dark(
        model: &'a SpadModel,
        key: [u32; 2],
        pixel: u32,
        dead_times: &'a [Time],
    ) -> Self {
        Avalanches {
            model,
            key,
            pixel,
            dead_times,
            blind_until: smallvec![Time::from_fs(i64::MIN / 2); model.grid.spads()],
            unknown: 0,
            pending: BinaryHeap::new(),
            lost: 0,
        }
    }

    /// SPADs whose photons are known from `time` on. `triggering` are the photons before it that trigger others, since
    /// [`SpadModel::reach`] at least.
    pub(crate) fn known_from(
        model: &'a SpadModel,
        key: [u32; 2],
        pixel: u32,
        dead_times: &'a [Time],
        time: Time,
        triggering: impl Iterator<Item = Photon>,
    ) -> Self {
        let mut avalanches = Self::in_the_dark(model, key, pixel, dead_times);
        for (spad, until) in (0..).zip(&mut avalanches.blind_until) {
            *until = time - Time::from_fs(1) + model.dead_time_among(dead_times, spad);
        }
        avalanches.unknown = u64::MAX;
        for photon in triggering {
            avalanches.queue_children(photon, false);
        }
        avalanches
            .pending
            .retain(|Reverse((child, _))| child.time >= time);
        avalanches
    }

    #[inline]
    fn dead_time_of(&self, spad: u8) -> Time {
        self.model.dead_time_among(self.dead_times, spad)
    }

    /// Runs all `photons`, sorted, and what they cause; appends the rising edges to `edges` and returns how many avalanches
    /// met a blind SPAD. The state must be known.
    pub(crate) fn run_to_the_end(mut self, photons: &[Photon], edges: &mut Vec<SpadEvent>) -> u64 {
        let forever = Time::from_fs(i64::MAX);
        let known = self.append_edges(photons, None, forever, forever, edges);
        debug_assert!(known.is_ok(), "nothing is unknown from the beginning on");
        self.lost
    }

    /// Runs the photons of `rows`, which begin at `from`, where the state is known and no avalanche causes another.
    pub(crate) fn run_rows(
        &mut self,
        rows: &SpadRows,
        light: &PixelStream<'_>,
        from: Time,
        edges: &mut Vec<SpadEvent>,
    ) {
        let before = edges.len();
        let known = rows.append_edges(light, from, Some(&mut self.blind_until), from, edges);
        debug_assert!(known.is_ok(), "nothing is unknown from the beginning on");
        self.lost += (rows.photons() - (edges.len() - before)) as u64;
    }

    /// Runs `photons`, sorted and all before `until`, and what they cause before that time, and the photons of `echoes`.
    /// Appends the rising edges to `edges`; those before `wanted_from` may be missing.
    ///
    /// # Errors
    /// Where an edge from `wanted_from` on, or a photon of `echoes`, depends on a SPAD whose state is not known.
    pub fn append_edges(
        &mut self,
        photons: &[Photon],
        mut echoes: Option<&mut OrderedEchoes<'_>>,
        until: Time,
        wanted_from: Time,
        edges: &mut Vec<SpadEvent>,
    ) -> Result<(), Unknown> {
        if echoes.is_none() && self.pending.is_empty() && !self.model.has_secondaries() {
            // Nothing comes in between.
            return photons.iter().try_for_each(|photon| {
                self.one(*photon, Source::Known, &mut None, wanted_from, edges)
            });
        }
        let mut photons = photons.iter().copied().peekable();
        loop {
            let of_echo = echoes.as_ref().and_then(|echoes| echoes.next());
            let of_echo = of_echo.filter(|photon| photon.time < until);
            let is_of_echo = match (photons.peek(), of_echo) {
                (Some(photon), Some(of_echo)) => of_echo < *photon,
                (_, of_echo) => of_echo.is_some(),
            };
            let photon = if is_of_echo {
                of_echo
            } else {
                photons.peek().copied()
            };
            let child = self.pending.peek().map(|&Reverse(child)| child);
            let child = child.filter(|(child, _)| child.time < until);
            let (photon, source) = match (photon, child) {
                (None, None) => return Ok(()),
                (photon, Some((child, is_certain)))
                    // At the same instant the photon comes first.
                    if photon.is_none_or(|photon| (child.time, child.spad) < (photon.time, photon.spad)) =>
                {
                    self.pending.pop();
                    let source = if is_certain { Source::Known } else { Source::Possible };
                    (child.into(), source)
                }
                (Some(photon), _) if is_of_echo => (photon, Source::Echo),
                (Some(_), _) => (photons.next().expect("it was seen"), Source::Known),
                (None, Some(_)) => unreachable!("a child without a photon before it comes"),
            };
            self.one(photon, source, &mut echoes, wanted_from, edges)?;
        }
    }

    /// One photon, afterpulse or crosstalk.
    #[inline]
    fn one(
        &mut self,
        photon: Photon,
        source: Source,
        echoes: &mut Option<&mut OrderedEchoes<'_>>,
        wanted_from: Time,
        edges: &mut Vec<SpadEvent>,
    ) -> Result<(), Unknown> {
        let Photon {
            time,
            spad,
            triggers,
        } = photon;
        let is_paralysable = self.model.law == DeadTimeLaw::Paralysable;
        let before = self.blind_until[usize::from(spad)];
        let is_ready = time > before;
        let is_unknown = self.unknown >> spad & 1 != 0;
        let is_certain = source != Source::Possible;
        if is_certain && (is_ready || !is_unknown) {
            if is_ready {
                edges.push(SpadEvent { time, spad });
                self.unknown &= !(1 << spad);
            } else {
                self.lost += 1;
            }
            if is_ready || is_paralysable {
                let mut until = before.max(time + self.dead_time_of(spad));
                if let Some(echoes) = echoes {
                    until = echoes.blind(spad, self.dead_time_of(spad), before.max(time), until);
                }
                self.blind_until[usize::from(spad)] = until;
            }
            if is_ready && triggers {
                self.queue_children(photon, true);
            }
            return Ok(());
        }
        if !is_certain && !is_unknown && !is_ready && !is_paralysable {
            return Ok(());
        }
        // Whether it comes, or whether the SPAD is ready, is not known. An echo's next photon depends on what was before.
        if time >= wanted_from || source == Source::Echo {
            return Err(Unknown);
        }
        self.blind_until[usize::from(spad)] = before.max(time + self.dead_time_of(spad));
        self.unknown |= 1 << spad;
        if triggers {
            self.queue_children(photon, false);
        }
        Ok(())
    }

    /// Notes what an avalanche causes.
    fn queue_children(&mut self, parent: Photon, is_certain: bool) {
        let parent = SpadEvent::new(parent.time, parent.spad);
        let dead_time = self.dead_time_of(parent.spad);
        let children = self.model.children(self.key, self.pixel, dead_time, parent);
        self.pending
            .extend(children.map(|child| Reverse((child, is_certain))));
    }
}

impl PixelStream<'_> {
    /// The SPADs of this macropixel, where its photons are known from `time` on, or from the beginning. `triggering` are the
    /// photons before `time` that trigger others, since [`SpadModel::reach`] at least.
    pub fn avalanches(
        &self,
        time: Option<Time>,
        triggering: impl Iterator<Item = Photon>,
    ) -> Avalanches<'_> {
        let (model, key) = (&self.stream.config().spads, self.stream.key());
        match time {
            Some(time) => {
                let (pixel, dead_times) = (self.pixel, &self.dead_times);
                Avalanches::known_from(model, key, pixel, dead_times, time, triggering)
            }
            None => Avalanches::in_the_dark(model, key, self.pixel, &self.dead_times),
        }
    }
}

/// Removes the events that fall into the (non-paralysable) dead time of their SPAD; returns how many.
///
/// `events` of macropixel number `pixel` must be sorted by (time, SPAD) with times from 0 on. An event stays if and only if it
/// is strictly later than the SPAD's last kept event plus its dead time. With a dead time of zero
/// only exact coincidences on one SPAD are removed.
pub fn apply_dead_time(events: &mut Vec<SpadEvent>, spads: &SpadModel, pixel: u32) -> u64 {
    let model = SpadModel {
        // Events may be of any SPADs there are.
        grid: SpadGrid::new(8, 8),
        law: DeadTimeLaw::NonParalysable,
        ..*spads
    };
    let photons: Vec<Photon> = events.iter().map(|&event| event.into()).collect();
    events.clear();
    let dead_times = model.dead_times(pixel);
    Avalanches::in_the_dark(&model, [0; 2], pixel, &dead_times).run_to_the_end(&photons, events)
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    fn event(time_fs: i64, spad: u8) -> SpadEvent {
        SpadEvent::new(Time::from_fs(time_fs), spad)
    }

    proptest! {
        /// What is known without the past is what the past gives.
        #[test]
        fn whatever_is_certain_without_the_past_is_so_with_it(
            raw in prop::collection::vec((0i64..100_000, 0u8..16, prop::bool::weighted(0.1)), 1..120),
            from_fs in 0i64..60_000,
            wait_fs in 0i64..40_000,
            dead_fs in 0i64..9_000,
            afterpulse_probability in 0.0f64..1.0,
            crosstalk_probability in 0.0f64..1.0,
            paralysable: bool,
            dead_time_spread in prop::sample::select(vec![0.0, 0.2]),
        ) {
            let law = if paralysable { DeadTimeLaw::Paralysable } else { DeadTimeLaw::NonParalysable };
            let model = SpadModel {
                law,
                afterpulse_probability,
                afterpulse_time: Time::from_fs(500),
                crosstalk_probability,
                dead_time_spread,
                ..SpadModel::with_dead_time(Time::from_fs(dead_fs))
            };
            let mut photons: Vec<Photon> = raw
                .into_iter()
                .map(|(time_fs, spad, triggers)| Photon { time: Time::from_fs(time_fs), spad, triggers })
                .collect();
            photons.sort();
            let (from, wanted_from) = (Time::from_fs(from_fs), Time::from_fs(from_fs + wait_fs));
            let mut all = Vec::new();
            let dead_times = model.dead_times(1);
            Avalanches::in_the_dark(&model, [7, 8], 1, &dead_times).run_to_the_end(&photons, &mut all);
            let (before, known) = photons.split_at(photons.partition_point(|p| p.time < from));
            let since = from - model.reach();
            let triggering = before.iter().filter(|p| p.triggers && p.time >= since).copied();
            let mut avalanches = Avalanches::known_from(&model, [7, 8], 1, &dead_times, from, triggering);
            let mut edges = Vec::new();
            let forever = Time::from_fs(i64::MAX);
            if avalanches.append_edges(known, None, forever, wanted_from, &mut edges).is_ok() {
                all.retain(|edge| edge.time >= wanted_from);
                edges.retain(|edge| edge.time >= wanted_from);
                prop_assert_eq!(all, edges);
            }
        }
    }

    #[test]
    fn every_spad_has_its_own_dead_time() {
        let spads = SpadModel {
            dead_time_spread: 0.2,
            ..SpadModel::with_dead_time(Time::from_fs(1000))
        };
        for pixel in [0, 7] {
            let flood = (0..20_000).flat_map(|time_fs| (0..4).map(move |n| event(time_fs, n)));
            let mut edges: Vec<SpadEvent> = flood.collect();
            apply_dead_time(&mut edges, &spads, pixel);
            for spad in 0..4 {
                let own: Vec<_> = edges.iter().filter(|edge| edge.spad == spad).collect();
                let apart = spads.dead_time_of(pixel, spad) + Time::from_fs(1);
                assert!(
                    own.windows(2)
                        .all(|pair| pair[1].time - pair[0].time == apart)
                );
            }
        }
    }

    #[test]
    fn a_photon_after_a_dead_time_of_darkness_is_known() {
        let model = SpadModel::with_dead_time(Time::from_fs(100));
        let photon = |time_fs| Photon::new(Time::from_fs(time_fs), 3, false);
        let run = |photons: &[Photon], wanted_from| {
            let from = Time::from_fs(1_000);
            let mut avalanches =
                Avalanches::known_from(&model, [0; 2], 0, &[], from, std::iter::empty());
            let (forever, wanted) = (Time::from_fs(i64::MAX), Time::from_fs(wanted_from));
            let mut edges = Vec::new();
            let known = avalanches.append_edges(photons, None, forever, wanted, &mut edges);
            known.map(|()| edges.len())
        };
        assert_eq!(run(&[photon(1_100)], 0), Ok(1));
        assert_eq!(run(&[photon(1_099)], 0), Err(Unknown));
        // The second one is lost or not, the third one comes late enough.
        assert_eq!(
            run(&[photon(1_050), photon(1_120), photon(1_221)], 1_200),
            Ok(1)
        );
        assert_eq!(
            run(&[photon(1_050), photon(1_120), photon(1_220)], 1_200),
            Err(Unknown)
        );
    }

    /// The rules, one SPAD at a time, straight from their wording.
    fn slow_reference(events: &[SpadEvent], dead_time: Time, law: DeadTimeLaw) -> Vec<SpadEvent> {
        let mut kept = Vec::new();
        for spad in 0..16u8 {
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

    /// Edges of photons that trigger no others, and how many were lost.
    fn detected(model: &SpadModel, photons: &[SpadEvent]) -> (Vec<SpadEvent>, u64) {
        let photons: Vec<Photon> = photons.iter().map(|&event| event.into()).collect();
        let mut edges = Vec::new();
        let lost =
            Avalanches::in_the_dark(model, [0; 2], 0, &[]).run_to_the_end(&photons, &mut edges);
        (edges, lost)
    }

    #[test]
    fn an_avalanche_at_the_very_end_of_a_pulse_makes_no_edge() {
        let mut events = vec![event(0, 3), event(10, 3), event(11, 3)];
        assert_eq!(
            apply_dead_time(
                &mut events,
                &SpadModel::with_dead_time(Time::from_fs(10)),
                0
            ),
            1
        );
        assert_eq!(events, [event(0, 3), event(11, 3)]);
    }

    #[test]
    fn a_suppressed_avalanche_prolongs_the_pulse_only_if_paralysable() {
        let photons = [event(0, 0), event(6, 0), event(12, 0)];
        let mut model = SpadModel::with_dead_time(Time::from_fs(10));
        assert_eq!(
            detected(&model, &photons),
            (vec![event(0, 0), event(12, 0)], 1)
        );
        model.law = DeadTimeLaw::Paralysable;
        assert_eq!(detected(&model, &photons), (vec![event(0, 0)], 2));
    }

    #[test]
    fn spads_do_not_blind_each_other() {
        let mut events = vec![event(5, 0), event(5, 1), event(6, 2)];
        assert_eq!(
            apply_dead_time(
                &mut events,
                &SpadModel::with_dead_time(Time::from_ns(10)),
                0
            ),
            0
        );
        assert_eq!(events.len(), 3);
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
            let (edges, lost) = detected(&model, &events);
            prop_assert_eq!(events.len() as u64 - lost, expected.len() as u64);
            prop_assert_eq!(edges, expected);
        }
    }
}
