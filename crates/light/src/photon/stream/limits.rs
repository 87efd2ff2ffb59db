//! What is kept of a layer of light: photons of some laser cycles, and of a profile or of SPADs that differ a share.

use std::ops::Range;
use std::sync::Arc;

use super::exposure::PhotonStream;
use super::group::CycleGroup;
use crate::photon::light::{Layer, Profile};
use crate::photon::random::RandomPurpose;
use crate::units::Time;

/// What is kept of a layer.
#[derive(Debug, Clone)]
pub(super) struct Limits {
    /// Laser cycles that send an echo.
    pub(super) cycles: Range<u32>,
    /// When there is background. Slots may begin before their laser cycle, so that the one after the last has some of it.
    pub(super) lit: Range<Time>,
    pub(super) profile: Option<Arc<Profile>>,
    pub(super) by_spad: Option<Arc<[f64]>>,
    /// Whether laser cycles' echoes differ in energy.
    has_energies: bool,
}

impl Limits {
    /// Those of a layer; `None` if all of it is kept.
    pub(super) fn from_layer(layer: &Layer<'_>, stream: &PhotonStream) -> Option<Self> {
        let laser_cycles = stream.config.laser_cycles;
        let cycles = layer.cycles.start.min(laser_cycles)..layer.cycles.end.min(laser_cycles);
        let has_energies = stream.config.energy_spread > 0.0
            && layer.signal_per_cycle > 0.0
            && layer.train.is_none();
        let is_everything = !has_energies
            && layer.profile.is_none()
            && layer.by_spad.is_none()
            && cycles == (0..laser_cycles);
        (!is_everything).then(|| Limits {
            lit: stream.cycle_start(cycles.start)..stream.cycle_start(cycles.end),
            cycles,
            profile: layer.profile.cloned(),
            by_spad: layer.by_spad.cloned(),
            has_energies,
        })
    }

    /// Laser cycles whose slots may have photons.
    pub(super) fn drawn(&self) -> Range<u32> {
        if self.cycles.is_empty() {
            0..0
        } else {
            self.cycles.start..self.cycles.end + 1
        }
    }

    /// Whether no photon of a group is kept.
    pub(super) fn is_outside(&self, group: CycleGroup) -> bool {
        let (drawn, first) = (self.drawn(), group.first_cycle());
        drawn.end <= first || drawn.start.saturating_sub(first) >= group.cycles()
    }

    /// Whether all photons of a group's laser cycles within the exposure are kept: slots of its first one may begin before it.
    pub(super) fn keep_all_of(&self, group: CycleGroup, stream: &PhotonStream) -> bool {
        let Range { start, end } = self.cycles;
        let first = group.first_cycle();
        let begins_before = start == 0 || start < first;
        let ends_after =
            end >= first.saturating_add(group.cycles()) || end == stream.config.laser_cycles;
        let has_all = self.profile.is_none() && self.by_spad.is_none() && !self.has_energies;
        has_all && begins_before && ends_after
    }

    /// Energy of a laser cycle's pulse, relative to the greatest one; the same for all macropixels.
    pub(super) fn energy(&self, cycle: u32, stream: &PhotonStream) -> f64 {
        if !self.has_energies {
            return 1.0;
        }
        let counter = [cycle, 0, 0, RandomPurpose::PulseEnergy as u32];
        let word = rand_philox::philox4x32_10(counter, stream.key)[0];
        let greatest = stream.config.greatest_energy();
        let least = 2.0 - greatest;
        (least + (greatest - least) * rand_philox::u32_to_unit_f64(word)) / greatest
    }

    /// The greatest rate of background within a time after the start of a laser cycle, as a share of the layer's. Before the start are the end of the cycle
    /// before, and what follows that.
    pub(super) fn greatest_share(&self, within_fs: &Range<i64>, cycle_fs: i64) -> f64 {
        let Some(profile) = &self.profile else {
            return 1.0;
        };
        // Starts of cycles are rounded.
        let ends_fs = within_fs.start + cycle_fs - 2..within_fs.end.min(0) + cycle_fs + 2;
        let before_hz = if within_fs.start < 0 {
            profile.greatest_within_hz(&ends_fs)
        } else {
            0.0
        };
        let own_hz = profile.greatest_within_hz(&(within_fs.start.max(0)..within_fs.end));
        own_hz.max(before_hz) / profile.greatest_hz
    }

    /// The chance of a photon of this SPAD.
    pub(super) fn chance(&self, spad: u8) -> f64 {
        match &self.by_spad {
            Some(shares) => shares[usize::from(spad)],
            None => 1.0,
        }
    }
}
