//! Which photons of a layer of light are kept: those of some laser cycles, and of a profile or of SPADs that differ a share.
//!
//! ```text
//!   drawn     ↓ ↓  ↓   ↓ ↓  ↓ ↓ ↓    ↓  ↓↓     at the greatest rate
//!   profile   ▇▇▇▇▇▅▅▅▅▅▃▃▃▃▃▁▁▁▁▁             a photon is kept with the rate at its time, relative to the greatest
//!   kept      ↓ ↓  ↓     ↓    ↓                by a random word of its own
//! ```

use std::ops::Range;
use std::sync::Arc;

use super::{Group, PhotonStream, PixelStream};
use crate::photon::light::{Layer, Profile};
use crate::photon::random::Purpose;
use crate::units::Time;

/// What is kept of a layer.
#[derive(Debug, Clone)]
pub(super) struct Limits {
    /// Laser cycles that send an echo.
    cycles: Range<u32>,
    /// When there is background. Slots may begin before their laser cycle, so that the one after the last has some of it.
    lit: Range<Time>,
    profile: Option<Arc<Profile>>,
    by_spad: Option<Arc<[f64]>>,
}

impl Limits {
    /// Those of a layer; `None` if all of it is kept.
    pub(super) fn of(layer: &Layer<'_>, stream: &PhotonStream) -> Option<Self> {
        let laser_cycles = stream.config.laser_cycles;
        let cycles = layer.cycles.start.min(laser_cycles)..layer.cycles.end.min(laser_cycles);
        let is_everything =
            layer.profile.is_none() && layer.by_spad.is_none() && cycles == (0..laser_cycles);
        (!is_everything).then(|| Limits {
            lit: stream.cycle_start(cycles.start)..stream.cycle_start(cycles.end),
            cycles,
            profile: layer.profile.cloned(),
            by_spad: layer.by_spad.cloned(),
        })
    }

    /// Laser cycles whose slots may have photons.
    fn drawn(&self) -> Range<u32> {
        match self.cycles.is_empty() {
            true => 0..0,
            false => self.cycles.start..self.cycles.end + 1,
        }
    }

    /// Whether no photon of a group is kept.
    pub(super) fn is_outside(&self, group: Group) -> bool {
        let (drawn, first) = (self.drawn(), group.first_cycle());
        drawn.end <= first || drawn.start.saturating_sub(first) >= group.cycles()
    }

    /// Whether all photons of a group's laser cycles within the exposure are kept: slots of its first one may begin before it.
    pub(super) fn keep_all_of(&self, group: Group, stream: &PhotonStream) -> bool {
        let Range { start, end } = self.cycles;
        let first = group.first_cycle();
        let begins_before = start == 0 || start < first;
        let ends_after =
            end >= first.saturating_add(group.cycles()) || end == stream.config.laser_cycles;
        self.profile.is_none() && self.by_spad.is_none() && begins_before && ends_after
    }

    /// The chance of a photon of this SPAD.
    fn chance(&self, spad: u8) -> f64 {
        match &self.by_spad {
            Some(shares) => shares[usize::from(spad)],
            None => 1.0,
        }
    }
}

impl PixelStream<'_> {
    /// Whether the slots of a laser cycle may have photons that are kept.
    pub(super) fn draws_background_in(&self, cycle: u32) -> bool {
        let limits = self.limits.as_ref();
        limits.is_none_or(|limits| limits.drawn().contains(&cycle))
    }

    /// Whether photons of the echo of a laser cycle may be kept.
    pub(super) fn sends_echo_in(&self, cycle: u32) -> bool {
        let limits = self.limits.as_ref();
        limits.is_none_or(|limits| limits.cycles.contains(&cycle))
    }

    /// Whether a background photon is kept that comes `time_fs` after the start of its laser cycle. `words` are random ones
    /// that no other photon has, unless it comes at the same time on the same SPAD.
    #[inline(never)]
    pub(super) fn keeps_background(
        &self,
        cycle: u32,
        spad: u8,
        time_fs: i64,
        words: [u32; 2],
    ) -> bool {
        let Some(limits) = &self.limits else {
            return true;
        };
        let time = self.stream.cycle_start(cycle) + Time::from_fs(time_fs);
        if !limits.lit.contains(&time) {
            return false;
        }
        let mut chance = limits.chance(spad);
        if let Some(profile) = &limits.profile {
            let since_fs = match cycle.checked_sub(1) {
                Some(before) if time_fs < 0 => (time - self.stream.cycle_start(before)).as_fs(),
                _ => time_fs,
            };
            chance *= profile.rate_hz(since_fs) / profile.greatest_hz();
        }
        self.is_kept(chance, words)
    }

    /// Whether a photon of a laser cycle's echo is kept, with random words that no other photon has.
    #[inline]
    pub(super) fn keeps_signal(&self, cycle: u32, spad: u8, words: [u32; 2]) -> bool {
        match &self.limits {
            None => true,
            Some(limits) => {
                limits.cycles.contains(&cycle) && self.is_kept(limits.chance(spad), words)
            }
        }
    }

    fn is_kept(&self, chance: f64, [first, second]: [u32; 2]) -> bool {
        if chance >= 1.0 {
            return true;
        }
        let counter = [first, second, self.pixel, Purpose::Thinning as u32];
        let word = rand_philox::philox4x32_10(counter, self.key)[0];
        f64::from(word) < chance * 2f64.powi(32)
    }
}
