//! What the photons of all macropixels of an exposure have in common: its laser cycles, their slots, and the laser pulse.

use std::ops::Range;
use std::sync::{Arc, Mutex};

use super::config::StreamConfig;
use super::group::Group;
use super::schedule::Schedule;
use super::slot::Slots;
use crate::photon::light::OtherLaser;
use crate::photon::pulse::{PulseSampler, PulseShape};
use crate::photon::quantile::NormalSampler;
use crate::photon::random::philox_key;
use crate::units::{Every, Time};

/// Farther away than any photon comes in its cycle, fs.
pub(super) const FAR_FS: i64 = 1 << 60;

/// A part of every laser cycle.
#[derive(Debug, Clone, PartialEq, Eq, Default)]
pub struct Span {
    /// Whose background photons belong to it.
    pub slots: Range<u32>,
    /// When photons of the cycle's own echo belong to it, fs after the start of the cycle; that may be outside the cycle.
    pub within_fs: Range<i64>,
}

/// Another laser, and when it sends its pulses.
type KnownLaser = (OtherLaser, Arc<Schedule>);

/// The photons of a whole array in an exposure.
#[derive(Debug, Clone)]
pub struct PhotonStream {
    pub(super) config: StreamConfig,
    pub(super) key: [u32; 2],
    starts: Every,
    /// The whole femtoseconds of a laser cycle.
    pub cycle_fs: i64,
    /// Slots of a laser cycle.
    pub slots: Slots,
    pub(super) gaussian: NormalSampler,
    pub(super) shape: Option<Arc<PulseSampler>>,
    /// Of other lasers, which all macropixels see.
    schedules: Arc<Mutex<Vec<KnownLaser>>>,
}

impl PhotonStream {
    /// Prepares the stream.
    pub fn new(config: &StreamConfig) -> Self {
        debug_assert!(config.stop_periods > 0, "a cycle needs a length");
        PhotonStream {
            key: philox_key(config.seed),
            starts: config.clock.every(config.stop_periods),
            cycle_fs: config.clock.whole_fs(i64::from(config.stop_periods)),
            slots: Slots::new(config.clock, config.stop_periods, config.lead),
            gaussian: NormalSampler::new(config.pulse_sigma.as_fs() as f64),
            shape: config.pulse_shape.as_ref().map(sampler),
            schedules: Arc::default(),
            config: config.clone(),
        }
    }

    /// When another laser sends its pulses.
    pub(super) fn schedule(&self, laser: &OtherLaser) -> Arc<Schedule> {
        let mut known = self.schedules.lock().expect("nobody panics with it");
        if let Some((_, schedule)) = known.iter().find(|(other, _)| other == laser) {
            return Arc::clone(schedule);
        }
        let schedule = Arc::new(Schedule::new(laser, self));
        known.push((*laser, Arc::clone(&schedule)));
        schedule
    }

    /// What it was made of.
    pub fn config(&self) -> &StreamConfig {
        &self.config
    }

    /// The key of its random words.
    pub(in crate::photon) fn key(&self) -> [u32; 2] {
        self.key
    }

    /// SPADs of a macropixel.
    #[inline]
    pub fn spads(&self) -> usize {
        self.config.spads.grid.spads()
    }

    /// Start of laser cycle `cycle`, exact to the femtosecond.
    #[inline]
    pub fn cycle_start(&self, cycle: u32) -> Time {
        self.starts.at(cycle)
    }

    /// When the photons of a cycle begin and end, fs after its start.
    pub fn ends_fs(&self) -> Range<i64> {
        -self.slots.lead_fs..self.cycle_fs - self.slots.lead_fs
    }

    /// What these slots are. Of the cycle's own echo, all that comes before the cycle begins with the first slot, and all
    /// that comes after it ends with the last one.
    pub(crate) fn span(&self, slots: Range<u32>) -> Span {
        let from_fs = match slots.start {
            0 => -FAR_FS,
            first => self.slots.start_fs(first),
        };
        let until_fs = match slots.end == self.slots.count {
            true => FAR_FS,
            false => self.slots.start_fs(slots.end),
        };
        Span {
            within_fs: from_fs..until_fs,
            slots,
        }
    }

    /// Groups of the exposure; the last one may outlast it.
    pub fn groups(&self) -> impl Iterator<Item = Group> + use<> {
        Group::until(self.config.laser_cycles, self.config.spads.grid)
    }
}

/// Draws times of a measured pulse.
pub(super) fn sampler(shape: &PulseShape) -> Arc<PulseSampler> {
    Arc::new(PulseSampler::measured(shape))
}
