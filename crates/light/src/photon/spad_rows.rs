//! From photons to rising edges where no avalanche causes another, without sorting the photons: SPADs are followed one by one, row by row.
//!
//! ```text
//!   row       0         1         2         3        no longer than the dead time
//!   SPAD 0    ·· ·  ·   │ · ··    │         │ ·      of a row's photons at most one finds its SPAD ready: the first that
//!   SPAD 1      ·       │         │··  · ·  │        comes after the SPAD has recovered
//! ```
//!
//! Photons are counted by SPAD and row, and put where their row begins. A row that a SPAD is blind for is not looked at. Where photons prolong blindness, or
//! the SPAD's state is not known yet, only the first and the last photon of a row matter. The results are those of
//! [`Avalanches::append_edges`](super::Avalanches::append_edges).

use super::spad::{DeadTimeLaw, Photon, SpadEvent, Unknown};
use super::stream::PixelStream;
use crate::units::Time;

/// Photons of a macropixel by SPAD and row; keeps its memory from one use to the next.
#[derive(Debug, Default)]
pub struct SpadRows {
    /// Where the photons of each SPAD and row end.
    ends: Vec<u32>,
    /// Times since the first row begins, fs.
    times_fs: Vec<i64>,
    rows: usize,
    row_bits: u32,
}

impl SpadRows {
    /// Sorts `photons` in, none of which comes before `from` or from `until` on. False, and nothing done, where there are far fewer photons than rows of
    /// all SPADs: then a sort takes less time.
    pub fn sort_in(
        &mut self,
        light: &PixelStream<'_>,
        photons: &[Photon],
        from: Time,
        until: Time,
    ) -> bool {
        let spads = &light.stream.config().spads;
        let dead_fs = spads.shortest_dead_time().as_fs();
        if dead_fs < 1 || until <= from {
            return false;
        }
        self.row_bits = dead_fs.ilog2();
        let last_fs = (until - from).as_fs() - 1;
        self.rows = (last_fs >> self.row_bits) as usize + 1;
        let all_rows = self.rows.saturating_mul(spads.grid.spads());
        if 4 * photons.len() < all_rows {
            return false;
        }
        let (rows, row_bits) = (self.rows, self.row_bits);
        let place = |photon: &Photon| {
            let since_fs = (photon.time - from).as_fs();
            (
                usize::from(photon.spad) * rows + (since_fs >> row_bits) as usize,
                since_fs,
            )
        };
        self.ends.clear();
        self.ends.resize(all_rows, 0);
        for photon in photons {
            self.ends[place(photon).0] += 1;
        }
        let mut total = 0;
        for end in &mut self.ends {
            // Where the row begins, until its photons have moved it to where it ends.
            total += std::mem::replace(end, total);
        }
        self.times_fs.resize(photons.len(), 0);
        for photon in photons {
            let (row, since_fs) = place(photon);
            let end = &mut self.ends[row];
            self.times_fs[*end as usize] = since_fs;
            *end += 1;
        }
        true
    }

    /// How many photons there are.
    pub(super) fn photons(&self) -> usize {
        self.times_fs.len()
    }

    /// Appends the rising edges that the photons make, by time and SPAD; those before `wanted_from` may be missing. `blind_until` is until when
    /// each SPAD is blind by what came before `from`, and then by these photons too; `None` where that is not known.
    ///
    /// # Errors
    /// Where an edge from `wanted_from` on depends on what came before `from`.
    pub fn append_edges(
        &self,
        light: &PixelStream<'_>,
        from: Time,
        mut blind_until: Option<&mut [Time]>,
        wanted_from: Time,
        edges: &mut Vec<SpadEvent>,
    ) -> Result<(), Unknown> {
        let spads = &light.stream.config().spads;
        let is_paralysable = spads.law == DeadTimeLaw::Paralysable;
        let wanted_from_fs = (wanted_from - from).as_fs();
        let mut begin = 0;
        for (spad, ends) in (0..).zip(self.ends.chunks_exact(self.rows)) {
            let dead_fs = spads.dead_time_among(&light.dead_times, spad).as_fs();
            let known = blind_until.as_deref_mut();
            let mut known = known.map(|blind_until| &mut blind_until[usize::from(spad)]);
            let known_fs = known.as_ref().map(|until| (**until - from).as_fs());
            let mut state = SpadState {
                dead_fs,
                wanted_from_fs,
                blind_until_fs: known_fs.unwrap_or(dead_fs - 1),
                is_unknown: known_fs.is_none(),
            };
            for (row, &end) in (1..).zip(ends) {
                let row_ends_fs: i64 = row << self.row_bits;
                let times_fs = &self.times_fs[begin..end as usize];
                begin = end as usize;
                if times_fs.is_empty() {
                    continue;
                }
                let fired = if state.is_unknown || is_paralysable {
                    state.first_unless_prolonged(times_fs, is_paralysable)?
                } else if row_ends_fs - 1 <= state.blind_until_fs {
                    None
                } else {
                    state.first_when_ready(times_fs)
                };
                let edge = |since_fs| SpadEvent::new(from + Time::from_fs(since_fs), spad);
                edges.extend(fired.map(edge));
            }
            if let Some(until) = &mut known {
                **until = from + Time::from_fs(state.blind_until_fs);
            }
        }
        edges.sort_unstable();
        Ok(())
    }
}

/// What is known of a SPAD. Times are since the first row begins, fs.
struct SpadState {
    dead_fs: i64,
    wanted_from_fs: i64,
    /// Until when it is blind, at the latest.
    blind_until_fs: i64,
    is_unknown: bool,
}

impl SpadState {
    /// The photon of a row that fires the SPAD, where all that find it blind prolong its blindness, or may do so.
    fn first_unless_prolonged(
        &mut self,
        times_fs: &[i64],
        is_paralysable: bool,
    ) -> Result<Option<i64>, Unknown> {
        let ends = (i64::MAX, i64::MIN);
        let ends = times_fs.iter().fold(ends, |(first, last), &time_fs| {
            (first.min(time_fs), last.max(time_fs))
        });
        let (first_fs, last_fs) = ends;
        if first_fs > self.blind_until_fs {
            self.is_unknown = false;
            let last_fs = if is_paralysable { last_fs } else { first_fs };
            self.blind_until_fs = last_fs + self.dead_fs;
            return Ok(Some(first_fs));
        }
        if self.is_unknown && last_fs >= self.wanted_from_fs {
            return Err(Unknown);
        }
        self.blind_until_fs = self.blind_until_fs.max(last_fs + self.dead_fs);
        Ok(None)
    }

    /// The first photon of a row that comes when the SPAD is ready.
    fn first_when_ready(&mut self, times_fs: &[i64]) -> Option<i64> {
        let ready = times_fs.iter();
        let ready = ready.filter(|time_fs| **time_fs > self.blind_until_fs);
        let first_fs = ready.copied().min()?;
        self.blind_until_fs = first_fs + self.dead_fs;
        Some(first_fs)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::photon::{PhotonStream, PixelLight, SpadGrid, SpadModel, StreamConfig};
    use crate::units::Frequency;
    use proptest::prelude::*;

    proptest! {
        #[test]
        fn rows_give_what_sorted_photons_give(
            raw in prop::collection::vec((0i64..60_000, 0u8..4), 1..1500),
            from_fs in 0i64..40_000,
            wait_fs in 0i64..30_000,
            dead_fs in 500i64..9_000,
            paralysable: bool,
            knows_all: bool,
            dead_time_spread in prop::sample::select(vec![0.0, 0.2]),
        ) {
            let stream = PhotonStream::new(&StreamConfig {
                seed: 1,
                clock: Frequency::from_hz(384_000_000),
                stop_periods: 100,
                laser_cycles: 1,
                lead: Time::ZERO,
                pulse_sigma: Time::ZERO,
                pulse_shape: None,
                energy_spread: 0.0,
                spads: SpadModel {
                    grid: SpadGrid::new(2, 2),
                    law: if paralysable { DeadTimeLaw::Paralysable } else { DeadTimeLaw::NonParalysable },
                    dead_time_spread,
                    ..SpadModel::with_dead_time(Time::from_fs(dead_fs))
                },
            });
            let parts = stream.parts(7, &PixelLight::dark());
            let (from, until) = (Time::from_fs(from_fs), Time::from_fs(60_000));
            let wanted_from = from + Time::from_fs(wait_fs);
            let photons = raw.iter().map(|&(time_fs, spad)| Photon::new(Time::from_fs(time_fs), spad, false));
            let mut photons: Vec<Photon> = photons.filter(|photon| !knows_all || photon.time >= from).collect();
            let known: Vec<Photon> = photons.iter().copied().filter(|photon| photon.time >= from).collect();
            let mut rows = SpadRows::default();
            prop_assume!(rows.sort_in(&parts[0], &known, from, until));
            let mut found = Vec::new();
            let mut blind_until = [Time::from_fs(from_fs - 1); 4];
            let before = knows_all.then_some(&mut blind_until[..]);
            let is_known = rows.append_edges(&parts[0], from, before, wanted_from, &mut found);
            photons.sort_unstable();
            let known = &photons[photons.len() - known.len()..];
            let mut without_past = parts[0].avalanches((!knows_all).then_some(from), std::iter::empty());
            let without_past = without_past.append_edges(known, None, until, wanted_from, &mut Vec::new());
            prop_assert_eq!(is_known, without_past);
            if is_known.is_ok() {
                let mut expected = Vec::new();
                let mut with_past = parts[0].avalanches(None, std::iter::empty());
                prop_assert!(with_past.append_edges(&photons, None, until, from, &mut expected).is_ok());
                for edges in [&mut found, &mut expected] {
                    edges.retain(|edge| edge.time >= wanted_from);
                }
                prop_assert_eq!(found, expected);
            }
        }
    }
}
